//! Which board `darm sim` runs, and what it needs.

use super::{Home, example, text};

#[test]
fn the_simulated_pico_says_what_it_needs() {
    let home = Home::new();
    let planar4 = example("planar4.toml");
    home.fails(
        &format!("sim {planar4} --board pico --in-process"),
        2,
        "darm: the Pico runs in its emulator, at a socket; leave out --pty and --in-process",
    );
    home.write("image.elf", "");
    let line = format!("sim {planar4} --board pico --firmware image.elf --folder board");
    let output = home.command(&line).env("PATH", "").output().expect("darm starts");
    assert_eq!(output.status.code(), Some(1));
    let errors = text(&output.stderr);
    assert!(
        errors.contains("Node.js 18 or newer is not installed; `cargo xtask image --board pico` installs it"),
        "{errors}"
    );
}

#[test]
fn a_board_in_this_process_refuses_a_profile_for_the_pins_of_another() {
    let home = Home::new();
    let profile = std::fs::read_to_string(example("planar4.profile.toml")).expect("the example is there");
    home.write("pico.toml", &format!("board = \"Pico\"\n{profile}"));
    home.fails(
        &format!("sim {} --in-process --folder board --profile pico.toml", example("planar4.toml")),
        1,
        "darm: the profile is made for the pins of Pico, and a board in this process has none; leave `board` out, or run that board \
         in its emulator (`darm sim --help`)",
    );
}
