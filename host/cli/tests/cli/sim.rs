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
