//! Profiles are read, derated and refused at their place.

use std::path::Path;

use super::{BoardProfile, ProfileFault};
use darm_core::profile::{BoardWiring, PICO};
use darm_robot::source::{Fault, FileError};

fn read(text: &str) -> Result<BoardProfile, FileError<ProfileFault>> {
    BoardProfile::parse(Path::new("profile.toml"), text)
}

#[test]
fn the_profile_of_every_example_is_written_as_it_is_read() {
    for name in ["planar4", "planar4-hybrid", "spatial6"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../examples/{name}.profile.toml"));
        let profile = BoardProfile::read(&path).unwrap();
        assert_eq!(profile.profile.check(), Ok(()), "{name}");
        assert_eq!(read(&profile.to_toml()).unwrap(), profile, "{name}");
    }
}

const HEAD: &str = "format = 1\nname = \"x\"\nsupply = { new_outputs = 1, window_ms = 10 }\n";

fn with_output(keys: &str) -> String {
    let output = "number = 0\ndrive = \"hold\"\nline = 0\nmax_on_ms = 1000\nduty_percent = 80\nwindow_ms = 10000";
    format!("{HEAD}{keys}\n[[output]]\n{output}\n")
}

#[test]
fn a_fault_is_reported_by_its_line() {
    let second =
        "[[output]]\nnumber = 1\ndrive = \"hold\"\nline = 0\nmax_on_ms = 1\nduty_percent = 1\nwindow_ms = 16\n";
    let error = read(&format!("{}{second}", with_output(""))).unwrap_err();
    assert_eq!(error.place.map(|place| place.line), Some(12), "{error}");
    assert!(error.to_string().contains("line 0"), "{error}");
    let error = read(&with_output("").replace("window_ms = 10000", "window_ms = 0")).unwrap_err();
    assert!(matches!(error.fault, Fault::Content(_)), "{error}");
}

#[test]
fn hot_surroundings_take_from_the_duty() {
    let duty = |keys: &str| read(&with_output(keys)).unwrap().profile.outputs[0].unwrap().limit.duty_percent;
    assert_eq!(duty(""), 80);
    assert_eq!(duty("ambient_c = 50.0\nderate_percent_per_k = 2.0"), 64, "10 K above 40 °C");
    assert_eq!(duty("ambient_c = 30.0\nderate_percent_per_k = 2.0"), 80);
    assert!(read(&with_output("ambient_c = 100.0\nderate_percent_per_k = 2.0")).is_err(), "nothing is left");
}

#[test]
fn keys_and_temperatures_without_effect_are_refused_at_their_place() {
    let refused = |text: &str| read(text).unwrap_err().to_string();
    let cases = [
        (with_output("") + "peak_ms = 20\n", "12:11: an output with drive = \"hold\" has no key `peak_ms`"),
        (with_output("") + "pull = 3\n", "12:8: an output with drive = \"hold\" has no key `pull`"),
        (
            with_output("").replace("drive = \"hold\"\n", "drive = \"latch\"\nset = 1\nreset = 2\npulse_ms = 9\n"),
            "11:8: an output with drive = \"latch\" has no key `line`, its keys are set, reset, pulse_ms",
        ),
        (with_output("ambient_c = 60.0"), "4:13: ambient_c is 60 °C, above rated_c of 40 °C, and derate_percent_per_k"),
        (with_output("rated_c = 20.0"), "4:11: ambient_c is 25 °C, above rated_c of 20 °C"),
        (with_output("ambient_c = -300.0"), "4:13: ambient_c is -300 °C"),
        (with_output("rated_c = nan"), "4:11: rated_c is NaN °C"),
        (with_output("derate_percent_per_k = 101.0"), "4:24: derate_percent_per_k is 101; give 0 to 100"),
    ];
    for (text, expected) in cases {
        let error = refused(&text);
        assert!(error.starts_with(&format!("profile.toml:{expected}")), "{error}\n{text}");
    }
    assert!(read(&with_output("ambient_c = 60.0\nderate_percent_per_k = 0.0")).is_ok());
}

#[test]
fn the_board_its_pins_and_the_length_of_the_chain_are_checked_at_their_place() {
    let text = |keys: &str| with_output(keys);
    let pins = |line: &str| text(&format!("board = \"Pico\"\n[chain]\nchips = 1\n[pins]\n{line}"));
    let read_back = |text: &str| read(&read(text).unwrap().to_toml()).unwrap().profile.board;
    let wired = BoardWiring { chips: Some(1), layout: Some(PICO.layout()) };
    assert_eq!(read_back(&pins("latch = \"GP4\"\ninputs = [\"GP6\", \"GP7\"]")), wired);
    assert_eq!(read_back(&text("")), BoardWiring::ANY);
    let has_sync = |text: &str| read(&read(text).unwrap().to_toml()).unwrap().profile.sync;
    assert!(has_sync(&pins("sync = \"GP19\"")) && !has_sync(&pins("latch = \"GP4\"")));
    let cases = [
        (text("board = \"pico\""), "4:9: board \"pico\" is not known; give one of B-L475E-IOT01A, Pico"),
        (text("[pins]\nlatch = \"GP4\""), "5:9: [pins] without `board`"),
        (pins("sync = \"GP7\""), "8:8: `sync` is at GP7, and the firmware of Pico has it at GP19; move the wire"),
        (pins("latch = \"GP7\""), "8:9: `latch` is at GP7, and the firmware of Pico has it at GP4; move the wire"),
        (pins("far_end = \"GP7\""), "8:11: Pico has no pin for `far_end`; the functions of its pins are data, clock"),
        (pins("inputs = [\"GP7\"]"), "8:10: `inputs` is at GP7, and the firmware of Pico has it at GP6, GP7,"),
        (text("[chain]\nchips = 0"), "5:9: a chain of 0 chips is not possible; give 1 to 8"),
        (text("[chain]\nchips = 1").replace("line = 0", "line = 8"), "6:1: line 8 is wired, and a chain of 1 chips"),
    ];
    for (text, expected) in cases {
        let error = read(&text).unwrap_err().to_string();
        assert!(error.starts_with(&format!("profile.toml:{expected}")), "{error}\n{text}");
    }
}

#[test]
fn a_threshold_of_the_supply_is_one_that_the_board_measures() {
    let with = |keys: &str| with_output(keys);
    let read_back = |text: &str| read(&read(text).unwrap().to_toml()).unwrap().profile.min_supply_mv;
    assert_eq!(read_back(&with("min_board_supply_mv = 4500")), Some(4_500));
    assert_eq!(read_back(&with("board = \"Pico\"\nmin_board_supply_mv = 4500")), Some(4_500));
    assert_eq!(read_back(&with("")), None);
    let cases = [
        (with("min_board_supply_mv = 1619"), "4:23: min_board_supply_mv is 1619; give 1620 to 5500"),
        (with("min_board_supply_mv = 5501"), "4:23: min_board_supply_mv is 5501; give 1620 to 5500"),
        (
            with("min_board_supply_mv = 4500\nboard = \"B-L475E-IOT01A\""),
            "4:23: the threshold of the supply is 4500 mV, and the board measures 1620 to 3600 mV",
        ),
        (
            with("board = \"Pico\"\nmin_board_supply_mv = 1700"),
            "5:23: the threshold of the supply is 1700 mV, and the board measures 1800 to 5500 mV",
        ),
    ];
    for (text, expected) in cases {
        let error = read(&text).unwrap_err().to_string();
        assert!(error.starts_with(&format!("profile.toml:{expected}")), "{error}\n{text}");
    }
}
