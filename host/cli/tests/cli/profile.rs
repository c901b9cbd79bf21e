//! Profiles of boards: made for an arm, checked, and stored on a board.

use super::{Board, Home, example, text};

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
