//! Which board `darm sim` runs, and what it needs.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use super::stop::interrupt;
use super::{Home, example, text};

#[test]
fn the_simulated_pico_says_what_it_needs() {
    let home = Home::new();
    let planar4 = example("planar4.toml");
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

/// Runs a simulator without any emulator until it has printed its addresses; the lines, and what it printed on standard error.
fn simulated(home: &Home, line: &str, then: impl FnOnce(&str)) -> String {
    let mut command = home.command(line);
    command.env("PATH", "").stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("darm starts");
    let mut output = BufReader::new(child.stdout.take().expect("it is piped"));
    let mut printed = String::new();
    while !printed.contains("camera ") {
        assert!(output.read_line(&mut printed).expect("it can be read") > 0, "`{line}` ended: {printed}");
    }
    then(&printed);
    interrupt(&child);
    let ended = child.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "`{line}`: {}", text(&ended.stderr));
    text(&ended.stderr)
}

#[test]
fn a_profile_for_a_pico_simulates_without_an_image() {
    let home = Home::new();
    let line = format!("sim {} --folder board", example("pneumatic9.toml"));
    let notes = simulated(&home, &line, |printed| {
        assert!(printed.contains("the firmware's library in this process, as a Pico"), "{printed}");
        let status = home.succeeds(&format!("status -p unix:{}", home.path("board/port").display()));
        assert!(status.contains("pneumatic9") || status.contains("profile"), "{status}");
    });
    assert!(notes.contains("running the firmware's library in this process instead"), "{notes}");
}

#[test]
fn without_an_emulator_a_terminal_is_the_port_of_a_board_in_this_process() {
    let home = Home::new();
    let line = format!("sim {} --pty --folder board", example("planar4.toml"));
    simulated(&home, &line, |printed| {
        assert!(printed.contains("port     board/port\n"), "{printed}");
        let port = home.path("board/port").display().to_string();
        for _ in 0..2 {
            let status = home.succeeds(&format!("status -p {port}"));
            assert!(status.contains("idle"), "{status}");
        }
    });
}
