//! The real image in the emulator, with a plant at its pins: what a user with a board on the dispatcher would see.
//!
//! `cargo xtask test` installs the emulator and builds the image; without them see `emulator::missing`.

mod bench;
mod emulator;

use std::path::Path;
use std::time::Duration;

use bench::{Bench, SETTLE_S, row_words, stepped, table, wait};
use darm_arm::arm::Arm;
use darm_arm::reach::{best_words, board};
use darm_core::se::Pose2;
use darm_core::sequencer::{Command, Event, FaultKind, Phase};
use darm_core::units::{ActuatorId, ModelHash};
use darm_core::wire::message::Calibration;
use darm_device::link::Link;
use darm_sim::plant::Broken;
use darm_sim::qemu::Console;

#[test]
fn a_table_is_uploaded_and_played_by_the_pins() {
    let Some(bench) = Bench::start(Console::Socket, false) else { return };
    let mut client = bench.connect();
    assert_eq!(client.identity().board, "B-L475E-IOT01A");
    assert_eq!(client.last_crash().unwrap(), None);
    let words = stepped(8);
    let image = table(&bench.wiring, &words, ModelHash(1));
    assert_eq!(usize::from(client.upload(&image, &mut |_| {}).unwrap()), words.len());
    assert_eq!(client.status().unwrap().model, Some(ModelHash(1)));
    bench.film().take();
    client.command(Command::Play).unwrap();
    let happened = bench::events_until(&mut client, |event| event == Event::Finished);
    assert_eq!(row_words(&happened), words);
    for (start, end) in bench::rows_in_host_time(&client, &happened) {
        let from_s = start.at.at_s + start.at.uncertainty_s + SETTLE_S;
        let frame = bench.film().at_rest_between(from_s, end.at.at_s - end.at.uncertainty_s);
        let frame = frame.unwrap_or_else(|| panic!("no frame at rest between {:?} and {:?}", start.at, end.at));
        assert_eq!(frame.state.reached, start.word, "row at {:?}", start.at);
        assert_eq!(frame.state.previous, start.previous);
    }
    wait("all coils off", || bench.follower.state().reached == words[0].with_digit(0, 0));
    let health = client.health().unwrap().unwrap();
    let stack = health.stack.unwrap();
    // What `board.x` gives, and the goal of `cargo xtask image --stack`.
    assert!(stack.size == 14 * 1024 && (1024..=85 * stack.size / 100).contains(&stack.used), "{stack:?}");
    // The emulator is as fast as this machine, so that only the bounds are known.
    assert!(health.load_permille.is_some_and(|load| (1..1000).contains(&load)), "{health:?}");
}

#[test]
fn a_program_runs_on_without_its_cable() {
    let Some(bench) = Bench::start(Console::Socket, false) else { return };
    let mut client = bench.connect();
    let words = stepped(6);
    client.upload(&table(&bench.wiring, &words, ModelHash(2)), &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    wait("the second row", || bench.follower.state().reached == words[1]);
    drop(client);
    wait("the last row", || bench.follower.state().reached == words[5]);
    let mut client = bench.connect();
    let happened = bench::events_until(&mut client, |event| event == Event::Finished);
    assert_eq!(row_words(&happened), words);
}

#[test]
fn an_upload_without_its_cable_leaves_the_old_table_and_resumes() {
    let Some(bench) = Bench::start(Console::Socket, false) else { return };
    let old = table(&bench.wiring, &stepped(3), ModelHash(3));
    let new = table(&bench.wiring, &stepped(900), ModelHash(4));
    bench.connect().upload(&old, &mut |_| {}).unwrap();
    let cut = bench::cut_after(bench.link(), new.bytes().len() / 2);
    let mut client = darm_device::client::Client::connect_as(cut, 5).unwrap();
    client.upload(&new, &mut |_| {}).unwrap_err();
    drop(client);
    let mut client = bench.connect();
    assert_eq!(client.status().unwrap().model, Some(ModelHash(3)));
    let mut first = None;
    client
        .upload(&new, &mut |progress| {
            first.get_or_insert(progress.done);
        })
        .unwrap();
    assert!(first > Some(0), "the upload began anew");
    assert_eq!(client.status().unwrap().model, Some(ModelHash(4)));
}

#[test]
fn a_stuck_output_latches_the_safe_state_and_is_named() {
    let Some(bench) = Bench::start(Console::Socket, false) else { return };
    let mut client = bench.connect();
    client.upload(&table(&bench.wiring, &stepped(8), ModelHash(5)), &mut |_| {}).unwrap();
    bench.follower.set_broken(Broken { lines_low: 1 << 3, ..Broken::default() });
    client.command(Command::Play).unwrap();
    wait("the safe state", || matches!(client.status().unwrap().phase, Phase::Safe(_)));
    let Phase::Safe(fault) = client.status().unwrap().phase else { unreachable!("the safe state is latched") };
    let actuator = ActuatorId(3);
    assert_eq!(fault.kind, FaultKind::Switch { actuator, expected_closed: true, seen_closed: false });
    wait("all coils off", || bench.follower.state().reached.iter().all(|digit| digit == 0));
    let heard = bench::type_and_hear(&mut client, "status", "seen open");
    assert!(heard.contains("actuator 3") && heard.contains("expected closed"), "{heard}");
    bench.follower.set_broken(Broken::default());
    client.command(Command::Clear).unwrap();
    assert_eq!(client.status().unwrap().phase, Phase::Idle);
}

#[test]
fn a_person_types_at_a_serial_port() {
    let Some(bench) = Bench::start(Console::Pty, false) else { return };
    let mut client = bench.connect();
    client.upload(&table(&bench.wiring, &stepped(3), ModelHash(6)), &mut |_| {}).unwrap();
    drop(client);
    let mut port = darm_device::link::open(bench.qemu.console_port()).unwrap();
    let mut say = |line: &str, answer: &str| {
        port.send(format!("{line}\r").as_bytes()).unwrap();
        let mut heard = Vec::new();
        wait(&format!("{answer:?} after {line:?}"), || {
            let mut bytes = [0; 256];
            let count = port.receive(&mut bytes, Duration::from_millis(100)).unwrap();
            heard.extend_from_slice(&bytes[..count]);
            String::from_utf8_lossy(&heard).contains(answer)
        });
    };
    say("help", "reboot");
    say("id", "B-L475E-IOT01A");
    say("table", "rows");
    say("coil 2 on 400", "\n");
    wait("coil 2 pulled", || bench.follower.state().reached.digit(2) == 1);
    wait("coil 2 let go", || bench.follower.state().reached.digit(2) == 0);
    say("word 110000000001", "\n");
    wait("the word", || bench.follower.state().reached.to_string() == "110000000001");
    say("stop", "\n");
    wait("all coils off", || bench.follower.state().reached.iter().all(|digit| digit == 0));
    say("coil 99 on 10", "?");
    say("dance", "help");
}

#[test]
fn a_servo_goes_where_the_rows_say_and_its_silence_is_a_fault() {
    let Some(bench) = Bench::start(Console::Socket, true) else { return };
    let mut client = bench.connect();
    let words = stepped(4);
    client.upload(&table(&bench.wiring, &words, ModelHash(7)), &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    let happened = bench::events_until(&mut client, |event| event == Event::Finished);
    assert_eq!(row_words(&happened), words);
    let angle_rad = bench.follower.state().servos_rad[0];
    assert!((angle_rad - bench::servo_angle_rad(3)).abs() < 2e-3, "{angle_rad} rad");
    client.command(Command::Play).unwrap();
    bench.follower.set_broken(Broken { servos_silent: 1, ..Broken::default() });
    wait("the safe state", || matches!(client.status().unwrap().phase, Phase::Safe(_)));
    let Phase::Safe(fault) = client.status().unwrap().phase else { unreachable!("the safe state is latched") };
    assert_eq!(fault.kind, FaultKind::ServoSilent { servo: 0 });
}

#[test]
fn the_board_answers_which_word_is_nearest() {
    let Some(bench) = Bench::start(Console::Socket, false) else { return };
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/planar4.toml");
    let arm = Arm::read(&example).unwrap();
    let modules = board::records(&arm).unwrap();
    let mut client = bench.connect();
    let image = bench::table_with(&bench.wiring, &stepped(3), ModelHash(8), &modules);
    client.upload(&image, &mut |_| {}).unwrap();
    for (x, y, angle) in [(0.3, 4.2, 0.2), (-0.5, 4.0, 0.0), (0.0, 4.6, -0.3)] {
        let target = Pose2::new(x, y, angle).into();
        let found = client.nearest(&target).unwrap();
        let expected = board::nearest(&modules, 12, &target).unwrap();
        assert!((found.distance_m - expected.distance_m).abs() < 1e-4, "{found:?}, in this process {expected:?}");
        let all = best_words(&arm, &target, &arm.rest(), 1).unwrap();
        assert!((f64::from(found.distance_m) - all[0].distance_m).abs() < 1e-3, "{found:?}, of all {all:?}");
    }
}

/// A number from an environment variable, or the one given.
fn number(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).map_or(otherwise, |text| text.parse().unwrap())
}

/// How many times the power is cut: 5, or as many as the environment variable `DARM_KILLS` says.
fn kills() -> u64 {
    number("DARM_KILLS", 5)
}

#[test]
fn power_cuts_leave_the_old_or_the_new_table() {
    let Some(mut bench) = Bench::start(Console::Socket, false) else { return };
    let images = [11, 12].map(|model| table(&bench.wiring, &stepped(100), ModelHash(model)));
    bench.connect().upload(&images[0], &mut |_| {}).unwrap();
    let calibration = Calibration::try_from([0.25, 0.0, 0.0, 0.0]).unwrap();
    bench.connect().calibrate(calibration).unwrap();
    let start = std::time::Instant::now();
    bench.connect().upload(&images[1], &mut |_| {}).unwrap();
    let whole_s = start.elapsed().as_secs_f64();
    let (mut loaded, mut new, mut random) = (ModelHash(12), 0, 0x5eed + number("DARM_SEED", 0));
    for kill in 0..kills() {
        let next = images[usize::from(loaded == ModelHash(11))].clone();
        let model = next.image().model;
        let link = bench.link();
        let uploading = std::thread::spawn(move || {
            darm_device::client::Client::connect(link).is_ok_and(|mut client| client.upload(&next, &mut |_| {}).is_ok())
        });
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // Some of the moments lie within the commit at the end, some after it.
        std::thread::sleep(std::time::Duration::from_secs_f64(
            1.1 * whole_s * (random >> 33) as f64 / f64::from(1u32 << 31),
        ));
        bench.power_cycle();
        let acknowledged = uploading.join().unwrap();
        let mut client = bench.connect();
        let found = client.status().unwrap().model.expect("a table is there");
        assert!([loaded, model].contains(&found), "kill {kill}: {found}");
        assert!(!acknowledged || found == model, "kill {kill}: an acknowledged table was lost");
        assert_eq!(client.calibration().unwrap(), Some(calibration), "kill {kill}");
        new += u64::from(found == model);
        loaded = found;
    }
    println!("FIGURE power cuts with the old table complete = {} cuts", kills() - new);
    println!("FIGURE power cuts with the new table complete = {new} cuts");
    println!("FIGURE power cuts with a mixture or a lost calibration = 0 cuts");
}

#[test]
fn a_closed_switch_is_closed_after_a_restart_of_the_board() {
    let Some(mut bench) = Bench::start(Console::Socket, false) else { return };
    bench.follower.set_broken(Broken { switches_closed: 1 << 5, ..Broken::default() });
    let closed = |bench: &Bench| {
        let mut client = bench.connect();
        wait("the switch", || client.status().unwrap().switches == 1 << 5);
        client.hello().unwrap().boots
    };
    let before = closed(&bench);
    bench.qemu.reset().unwrap();
    wait("the restart", || bench.connect().hello().unwrap().boots > before);
    closed(&bench);
}
