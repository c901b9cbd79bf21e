//! `darm calibrate`: what its folder has decides what is next. The loop on a board is an example of its help.

use std::path::{Path, PathBuf};

use darm_arm::arm::{Arm, frames};
use darm_diagnose::calibrate::{CalibrateOptions, Next, State, Task, look};
use darm_diagnose::progress::Progress;
use darm_diagnose::truth::{Kind, Truth};
use darm_measure::poses::{self, Which};
use darm_measure::{Run, write_text};

use super::Home;

const LINE: &str = "calibrate planar4.toml planar4-frames.toml --poses sim";
const NO_SIMULATOR: &str =
    "darm: no simulator runs; start `darm sim` in another terminal, or name another source with --poses";

/// A home with the arm of the examples, and the rows of all looks of its calibration with this goal.
fn measured(goal_m: f64) -> (Home, Vec<String>) {
    let home = Home::new();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for file in ["planar4.toml", "planar4.profile.toml", "planar4-frames.toml"] {
        std::fs::copy(examples.join(file), home.path(file)).unwrap();
    }
    let arm = Arm::read(&home.path("planar4.toml")).unwrap();
    let frames = frames::read(&home.path("planar4-frames.toml"), &arm).unwrap();
    let options = CalibrateOptions { goal_m: Some(goal_m), ..CalibrateOptions::default() };
    let task = Task { arm: &arm, frames: &frames, options: &options };
    let truth = Truth::draw(&arm, &frames, 3, Some(Kind::Play)).unwrap();
    let (mut state, mut visits, mut visited, mut looks) = (State::default(), task.first().unwrap(), vec![], vec![]);
    loop {
        let from = visited.len();
        visited.extend(visits);
        let samples = truth.measure(&visited, 0.0, 7).unwrap().samples.split_off(from);
        let text = write_text(&Run { samples, ..Run::default() });
        // What a file has of them.
        home.write("look.csv", &text);
        let (run, _) = poses::read(&home.path("look.csv"), &Default::default(), &Which::default()).unwrap();
        state = state.with(run.samples);
        looks.push(text);
        match look(&task, &state, &Progress::default()).unwrap().next {
            Next::Measure(next) => visits = next,
            Next::Stop(_) => return (home, looks),
        }
    }
}

fn look_file(home: &Home, look: usize) -> PathBuf {
    home.path(&format!("calibration/look-{:02}.csv", look + 1))
}

#[test]
fn a_calibration_continues_with_the_look_that_is_not_complete() {
    let (home, looks) = measured(2e-5);
    let line = format!("{LINE} --goal 0.02");
    assert!(looks.len() > 1, "{} looks", looks.len());
    for (number, text) in looks.iter().enumerate() {
        // Each command looks at all rows again: two of them show that it continues.
        if number < 2 {
            let said = super::text(&home.darm(&line).stderr);
            let diagnosed = said.lines().filter(|line| line.contains(" of at most 11, ")).count();
            assert_eq!((diagnosed, said.lines().last()), (number, Some(NO_SIMULATOR)), "{said}");
        }
        std::fs::write(look_file(&home, number), text).unwrap();
    }
    let said = home.json(&line);
    assert_eq!((&said["reason"], &said["verdict"]), (&"reached".into(), &"effect-found".into()));
    assert_eq!(said["effects"][0]["law"], "play");
    assert_eq!(said["looks"].as_array().unwrap().len(), looks.len());
    // The stops of the example are no synthesis for its frames.
    let drawn = "the arm as drawn misses the frames by up to 77.";
    let text = home.succeeds(&line);
    assert!(text.contains(drawn), "{text}");
    // As one recording for the diagnosis it gives the same model, but for the way to the profile.
    home.succeeds("diagnose planar4.toml calibration/run.csv -o model.toml");
    let effects =
        |name: &str| std::fs::read_to_string(home.path(name)).unwrap().split_once("[[effect]]").unwrap().1.to_owned();
    assert_eq!(effects("calibration/model.toml"), effects("model.toml"));
    home.succeeds("table --show calibration/words.darm");
    let page = std::fs::read_to_string(home.path("calibration/report.html")).unwrap();
    let next = page.split_once("<b>Next: </b>").unwrap().1.split_once("</p>").unwrap().0;
    for named in ["words.darm", "adjusted.toml", "model.toml", " mm "] {
        assert!(next.contains(named), "{named}: {next}");
    }
    home.succeeds("adjust calibration/model.toml calibration/adjusted.toml");
}

#[test]
fn a_source_of_no_kind_is_refused_before_a_folder_is_made() {
    let home = Home::new();
    let [arm, frames] = ["planar4.toml", "planar4-frames.toml"].map(super::example);
    let refused = "darm: --poses foo: no such file; give sim, tcp:HOST:PORT, unix:PATH, or a CSV file or MCAP log that a \
                   program writes";
    home.fails(&format!("calibrate {arm} {frames} --poses foo"), 2, refused);
    assert!(!home.path("calibration").exists());
    std::fs::create_dir(home.path("empty")).unwrap();
    home.fails(&format!("calibrate {arm} {frames} --poses foo --folder empty"), 2, refused);
    assert_eq!(home.path("empty").read_dir().unwrap().count(), 0);
}

#[test]
fn a_folder_is_of_one_calibration() {
    let (home, looks) = measured(1.0);
    home.fails(LINE, 1, NO_SIMULATOR);
    std::fs::write(look_file(&home, 0), &looks[0]).unwrap();
    let other = "darm: calibration/calibration.json: the calibration was begun with another --goal, --looks or --seed; \
                 repeat that command, or choose another --folder";
    home.fails(&format!("{LINE} --looks 3"), 1, other);
    home.fails(&format!("{LINE} --folder ."), 1, "darm: .: the folder has other files; choose a new one with --folder");
    home.fails(&format!("{LINE} --goal 0"), 2, "darm: --goal 0: give a length above 0 mm");
}
