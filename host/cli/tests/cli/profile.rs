//! Profiles of boards: made for an arm, split off an arm file of format 1, checked, and stored on a board.

use super::{Board, Home, example, text};

/// An arm file of format 1, with its profile in it.
fn old() -> String {
    example("../tests/data/arms-format-1/planar4.toml")
}

#[test]
fn an_arm_file_of_format_1_is_refused_with_a_fix_and_split_in_two() {
    let home = Home::new();
    std::fs::copy(old(), home.path("old.toml")).unwrap();
    let message = "darm: old.toml:5:10: the file has format 1, in which the arm carried the limits of its board; convert it \
                   by `darm profile migrate OLD.toml -o NEW.toml --new-profile PROFILE.toml`";
    for line in [
        "table old.toml --words 000010000000 -o one.darm",
        "fk old.toml --word 000010000000",
        "stops old.toml old.toml",
    ] {
        home.fails(line, 1, message);
    }
    std::fs::create_dir(home.path("boards")).unwrap();
    let migrate = "profile migrate old.toml -o arm.toml --new-profile boards/valves.toml";
    let made = home.json(migrate);
    assert_eq!((&made["outputs"], &made["name"]), (&12.into(), &"planar4".into()));
    home.fails(migrate, 1, "darm: arm.toml exists; overwrite it with --force");
    home.succeeds(&format!("{migrate} --force"));
    home.fails(
        "profile migrate arm.toml -o b.toml --new-profile b.profile.toml",
        1,
        "darm: arm.toml:5:10: the file has format 2; only files of format 1 are brought over",
    );
    let old = std::fs::read_to_string(home.path("old.toml")).unwrap();
    let outside = old.replacen("coil = { ", "coil = { output = 300, ", 1);
    assert_ne!(outside, old);
    std::fs::write(home.path("outside.toml"), outside).unwrap();
    home.fails(
        "profile migrate outside.toml -o b.toml --new-profile b.profile.toml",
        1,
        "darm: outside.toml: the drives and limits of this arm make no profile: invalid value: integer `300`, expected u8; correct the TOML",
    );
    let checked = home.json("profile check boards/valves.toml --arm arm.toml");
    assert_eq!(checked["digest"], made["digest"]);
    home.succeeds("table arm.toml --words 000010000000 -o one.darm");
    let shown = home.json("table --show one.darm");
    assert_eq!(shown["profile"], made["digest"]);
    assert_eq!(shown["outputs"][4]["duty_percent"], 100);
}

#[test]
fn a_synthesised_arm_names_the_profile_of_the_initial_arm() {
    let home = Home::new();
    std::fs::create_dir(home.path("out")).unwrap();
    for name in ["planar4.toml", "planar4.profile.toml"] {
        std::fs::copy(example(name), home.path(name)).unwrap();
    }
    home.succeeds(&format!("synth planar4.toml {} -o out/arm.toml", example("planar4-frames.toml")));
    let arm = std::fs::read_to_string(home.path("out/arm.toml")).unwrap();
    assert!(arm.contains("\nprofile = \"../planar4.profile.toml\"\n"), "{arm}");
    home.succeeds("profile check planar4.profile.toml --arm out/arm.toml");
    home.succeeds("table out/arm.toml --words 000010000000 -o one.darm");
}

#[test]
fn a_first_profile_is_made_with_advice_and_runs_on_a_board() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("profile make {arm} -o first.toml"));
    home.fails(&format!("profile make {arm} -o first.toml"), 1, "darm: first.toml exists; overwrite it with --force");
    let first = std::fs::read_to_string(home.path("first.toml")).unwrap();
    assert!(first.contains("Data sheet: duty cycle") && first.contains("\nmax_on_ms = 1000\n"), "{first}");
    let slow = home.darm(&format!("table {arm} --words 000010000000 --dwell 2 --profile first.toml -o one.darm"));
    assert!(text(&slow.stderr).contains("output 4 would be on for longer than it may"), "{}", text(&slow.stderr));
    home.succeeds(&format!("table {arm} --words 000010000000 --dwell 0.2 --profile first.toml -o one.darm"));
    let board = Board::start(&home, &format!("{arm} --profile first.toml"));
    home.succeeds(&format!("upload one.darm {}", board.port));
    let fewer = first.replace("number = 4\n", "number = 40\n");
    home.write("fewer.toml", &fewer);
    let refused = home.darm(&format!("profile check fewer.toml --arm {arm}"));
    let said = text(&refused.stderr);
    let place =
        "planar4.toml:72:10: module 2, diagonal leg: the board's profile has no output 4; add it to the profile";
    assert!(refused.status.code() == Some(1) && said.contains(place), "{said}");
}
