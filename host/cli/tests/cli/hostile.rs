//! Hostile numbers: no command of arms ends with exit code 0 and a number that is infinite or NaN, none panics, none hangs.

use std::time::{Duration, Instant};

use super::{Home, example, text};

/// On the command line.
const ARGUMENTS: [&str; 9] = ["1e308", "-1e308", "nan", "inf", "-inf", "1e12", "-1e12", "1e-300", "0"];
/// In files.
const NUMBERS: [&str; 7] = ["1e308", "-1e308", "1e12", "-1e12", "1e-300", "0.0", "5e9"];
/// A command takes less, also on a busy machine.
const LONGEST: Duration = Duration::from_secs(60);

/// Commands with `{v}` where a number is expected.
const COMMANDS: [&str; 21] = [
    "nearest {arm} {v},0,0",
    "nearest {arm} 0,0,{v}",
    "nearest {arm} {v},{v} --position-only",
    "nearest {arm} 300,4200,10 --from 000000000000 --within={v}",
    "nearest {servo} 300,4200,10 --q={v}",
    "nearest {servo} 300,4200,10 --gap={v}",
    "map {arm} --cell={v}",
    "map {arm} --angle={v}",
    "map {servo} --cell 100 --q={v}",
    "path {arm} 000000000000 111000111000 --deviation={v}",
    "path {servo} 000000000000 111000111000 --deviation 2000 --q={v}",
    "adjust {arm} {arm} --resolution={v}",
    "synth {arm} {frames} -o new.toml --least-stroke={v}",
    "synth {arm} {frames} -o new.toml --anchors={v}",
    "synth {arm} {frames} -o new.toml --shortest={v}",
    "synth {arm} {frames} -o new.toml --longest={v}",
    "synth {arm} {frames} -o new.toml --part-error={v}",
    "synth {arm} {frames} -o new.toml --part-error 0.05 --adjustment-per-halving={v}",
    "synth {arm} {frames} -o new.toml --method paper --regularisation={v}",
    "table {servo} --words 000010000000 --dwell 0.2 -o one.darm --q={v}",
    "fk {servo} --q={v}",
];

/// Runs a command; what is wrong with how it ended.
fn fault(home: &Home, line: &str) -> Option<String> {
    let started = Instant::now();
    let output = home.darm(line);
    let (code, printed) = (output.status.code(), text(&output.stdout));
    let is_number =
        |word: &str| matches!(word.trim_start_matches('-').to_lowercase().as_str(), "inf" | "nan" | "infinity");
    let not_finite = printed.split(|c: char| !(c.is_alphanumeric() || c == '-')).any(is_number);
    let is_wrong = (code == Some(0) && not_finite) || !matches!(code, Some(0..=3)) || started.elapsed() > LONGEST;
    is_wrong
        .then(|| format!("`darm {line}`: {code:?} after {:?}: {printed}{}", started.elapsed(), text(&output.stderr)))
}

#[test]
fn no_command_of_arms_answers_with_a_number_that_is_not_finite() {
    let home = Home::new();
    let (arm, servo, frames) =
        (example("planar4.toml"), example("planar4-hybrid.toml"), example("planar4-frames.toml"));
    let mut faults = Vec::new();
    for command in COMMANDS {
        let command = command.replace("{arm}", &arm).replace("{servo}", &servo).replace("{frames}", &frames);
        for value in ARGUMENTS {
            let line = command.replace("{v}", value);
            faults.extend(["", "--json "].into_iter().filter_map(|json| fault(&home, &format!("{json}{line}"))));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn hostile_files_end_with_an_error_or_with_finite_numbers() {
    let home = Home::new();
    let [arm, frames] =
        ["planar4.toml", "planar4-frames.toml"].map(|name| std::fs::read_to_string(example(name)).unwrap());
    let old = example("planar4.toml");
    let commands = [
        "fk arm.toml".to_owned(),
        "nearest arm.toml 300,4200,10".to_owned(),
        "path arm.toml 000000000000 111000111000 --deviation 2000".to_owned(),
        "synth arm.toml frames.toml -o new.toml --closest --starts 2".to_owned(),
        "synth arm.toml frames.toml -o new.toml --closest --starts 2 --method paper --steps 3".to_owned(),
        format!("adjust {old} arm.toml"),
    ];
    let profile = format!("profile = \"{}\"", example("planar4.profile.toml"));
    let arm = arm.replace("profile = \"planar4.profile.toml\"", &profile);
    let places = [
        (&arm, "length_scale_m = 0.5"),
        (&arm, "length_m = [1.0"),
        (&arm, "base_m = [-0.5"),
        (&arm, "mass_kg = 1.5"),
        (&frames, "position_m = [0.04"),
        (&frames, "angle_deg = 2.0"),
    ];
    let mut faults = Vec::new();
    for (file, place) in places {
        let key = place.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.' || c == '-');
        assert!(file.contains(place), "{place}");
        for number in NUMBERS {
            let changed = |text: &String| text.replacen(place, &format!("{key}{number}"), 1);
            home.write("arm.toml", &changed(&arm));
            home.write("frames.toml", &changed(&frames));
            faults.extend(commands.iter().filter_map(|line| fault(&home, line)));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
