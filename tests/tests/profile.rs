//! `darm profile write` on the flashed image in the emulator: the board stores a profile only while its button is held.

mod emulator;

use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;

use darm_arm::arm::Arm;
use darm_arm::board_profile::BoardProfile;
use darm_arm::wired_arm::WiredArm;
use darm_core::profile::BUILT_IN;
use darm_core::units::Digest;
use darm_core::wire::message::Refusal;
use darm_device::client::Client;
use darm_device::link;
use darm_sim::follow::Follower;
use darm_sim::plant::Plant;
use darm_sim::qemu::{Console, Machine, Qemu};
use emulator::Ready;

/// Long enough for a profile to be written if nothing held it back.
const WAIT: Duration = Duration::from_secs(2);

fn example(name: &str) -> String {
    format!("{}/../examples/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn profile_of_the_board(port: &str) -> Digest {
    Client::connect(link::open(port).unwrap()).unwrap().hello().unwrap().profile
}

#[test]
fn a_profile_is_written_while_the_button_is_held_and_not_before() {
    let Some(Ready { elf, lock: _lock }) = emulator::ready() else { return };
    let folder = tempfile::tempdir().unwrap();
    let machine = Machine::new(elf, folder.path().to_owned(), Console::Pty);
    let mut qemu = Qemu::start(&machine).unwrap();
    let arm = Arm::read(Path::new(&example("planar4.toml"))).unwrap();
    let wiring = WiredArm::new(arm).unwrap().wiring;
    let follower = Follower::start(&qemu, &wiring, Plant::new(&wiring, &[])).unwrap();
    qemu.resume().unwrap();
    let port = qemu.console_port().to_owned();
    let write = |name: &str| -> Child {
        let mut command = Command::new(emulator::target().join("debug/darm"));
        command.args(["profile", "write", &example(name), "--port", &port]);
        command.env("XDG_STATE_HOME", folder.path().join("state"));
        command.spawn().expect("the package darm is built")
    };

    let mut child = write("planar4.profile.toml");
    std::thread::sleep(WAIT);
    assert_eq!(child.try_wait().unwrap(), None, "nobody holds the button: it waits");
    follower.hold_button(true);
    assert!(child.wait().unwrap().success());
    follower.hold_button(false);
    let planar = BoardProfile::read(Path::new(&example("planar4.profile.toml"))).unwrap();
    assert_eq!(profile_of_the_board(&port), planar.profile.digest);
    assert_ne!(planar.profile.digest, BUILT_IN.digest);

    let other = BoardProfile::read(Path::new(&example("spatial6.profile.toml"))).unwrap();
    let mut client = Client::connect(link::open(&port).unwrap()).unwrap();
    let refused = client.upload(&other.image(), &mut |_| {}).unwrap_err();
    assert_eq!(refused.refusal(), Some(Refusal::NobodyPresent));
    // What is in force already needs no button.
    drop(client);
    assert!(write("planar4.profile.toml").wait().unwrap().success());
}
