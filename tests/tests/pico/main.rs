//! The image of the Raspberry Pi Pico in its emulator, with a plant at its pins, in virtual time.
//!
//! `cargo xtask test` installs the emulator and builds the image; without them see `missing`.

mod bench;
mod faults;
mod longest_tick;
#[path = "../emulator/missing.rs"]
mod missing;
mod sync;
#[path = "../bench/tables.rs"]
mod tables;

use std::path::Path;

use bench::Bench;
use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, Wiring};
use darm_core::sequencer::{Command, Event, FaultKind, Phase};
use darm_core::table::{Record, Row};
use darm_core::units::{Micros, ModelHash, Word};
use darm_core::wire::bootstrap::RebootTarget;
use darm_core::wire::message::{Calibration, Refusal};
use darm_device::client::{Client, ClientError, TimedEvent};
use darm_sim::pico::{self, Ended, PicoBench};
use darm_sim::plant::Broken;
use tables::{profile, servo_angle_rad, stepped, table, table_with, wiring};

fn row_words(happened: &[TimedEvent]) -> Vec<Word> {
    happened.iter().filter_map(|h| if let Event::Row { word, .. } = h.event { Some(word) } else { None }).collect()
}

#[test]
fn a_table_is_uploaded_and_played_by_the_pins() {
    let Some(bench) = Bench::start(false) else { return };
    let mut client = bench.connect();
    assert_eq!(client.identity().board, "Pico");
    let caps = client.hello().unwrap().caps.clone();
    assert_eq!((caps.lines, caps.inputs, caps.servos, caps.board.as_str()), (64, 13, 4, "Pico"));
    assert_eq!(client.last_crash().unwrap(), None);
    let words = stepped(8);
    let rows = client.upload(&table(&bench.wiring, &words, ModelHash(1)), &mut |_| {}).unwrap();
    assert_eq!(usize::from(rows), words.len());
    client.command(Command::Play).unwrap();
    for word in &words {
        bench.wait("the next word at the pins", || bench.reached() == *word);
    }
    let happened = bench.events_until(&mut client, |event| event == Event::Finished);
    assert_eq!(row_words(&happened), words);
    assert_eq!(bench.with(|board| (board.resets(), board.ended())), (1, None), "one restart, for the profile");
}

#[test]
fn a_program_runs_on_without_its_cable_and_a_stop_ends_it() {
    let Some(bench) = Bench::start(false) else { return };
    let mut client = bench.connect();
    let words = stepped(6);
    client.upload(&table(&bench.wiring, &words, ModelHash(2)), &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    drop(client);
    bench.wait("the last row", || bench.reached() == words[5]);
    let mut client = bench.connect();
    bench.events_until(&mut client, |event| event == Event::Finished);
    client.command(Command::Play).unwrap();
    bench.wait("the second row", || bench.reached() == words[1]);
    assert_ne!(bench.lines(), 0);
    let (asked_s, mut link) = (bench.board.now_s(), bench.board.link());
    link.send(b"stop\r").unwrap();
    bench.wait("all lines low", || bench.lines() == 0);
    let took_s = bench.board.now_s() - asked_s;
    assert!(took_s <= 0.005, "{took_s} s");
    assert_eq!(bench.connect().status().unwrap().phase, Phase::Idle);
}

#[test]
fn a_servo_goes_where_the_rows_say_and_its_silence_is_a_fault() {
    let Some(bench) = Bench::start(true) else { return };
    let mut client = bench.connect();
    let words = stepped(4);
    client.upload(&table(&bench.wiring, &words, ModelHash(7)), &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    let happened = bench.events_until(&mut client, |event| event == Event::Finished);
    assert_eq!(row_words(&happened), words);
    let angle_rad = bench.board.state().unwrap().servos_rad[0];
    assert!((angle_rad - servo_angle_rad(3)).abs() < 2e-3, "{angle_rad} rad");
    client.command(Command::Play).unwrap();
    bench.board.set_broken(Broken { servos_silent: 1, ..Broken::default() });
    bench.wait("the safe state", || matches!(client.status().unwrap().phase, Phase::Safe(_)));
    let Phase::Safe(fault) = client.status().unwrap().phase else { unreachable!("the safe state is latched") };
    assert_eq!(fault.kind, FaultKind::ServoSilent { servo: 0 });
}

#[test]
fn a_profile_needs_the_jumper_and_a_reboot_starts_again() {
    let Some(bench) = Bench::start(false) else { return };
    let mut client = bench.connect();
    let refused = client.upload(&profile(&wiring(true)).image(), &mut |_| {}).unwrap_err();
    assert_eq!(refused.refusal(), Some(Refusal::NobodyPresent));
    let boots = client.hello().unwrap().boots;
    client.reboot(RebootTarget::Application).unwrap();
    bench.board.pass(1.0);
    assert_eq!(bench.connect().hello().unwrap().boots, boots + 1);
    let refused = bench.connect().reboot(RebootTarget::Loader);
    assert!(matches!(refused, Err(ClientError::NoReboot(RebootTarget::Loader))), "{refused:?}");
    bench.board.pass(0.1);
    assert_eq!(bench.with(|board| board.ended()), None, "the loader is on the console's cable");
    bench.board.hold_button(true);
    bench.board.pass(0.1);
    bench.connect().reboot(RebootTarget::Loader).unwrap();
    bench.board.pass(0.1);
    bench.board.hold_button(false);
    assert_eq!(bench.with(|board| board.ended()), Some(Ended::Loader));
    bench.board.power_cycle();
    bench.board.pass(1.0);
    assert_eq!(bench.connect().hello().unwrap().boots, boots + 2);
}

/// The noises each operation is cut with: 1, or as many as the environment variable `DARM_PICO_NOISES` says, behind those that
/// `DARM_SEED` counts.
fn noises() -> std::ops::RangeInclusive<u32> {
    let [count, before] = [("DARM_PICO_NOISES", 1), ("DARM_SEED", 0)]
        .map(|(name, default)| std::env::var(name).map_or(default, |text| text.parse().unwrap()));
    before + 1..=before + count
}

#[test]
fn a_power_cut_within_any_operation_of_the_flash_leaves_the_old_or_the_new_table() {
    let Some(bench) = Bench::start(false) else { return };
    let images = [11, 12].map(|model| table_with(&bench.wiring, &stepped(40), ModelHash(model), &[]));
    bench.connect().upload(&images[0], &mut |_| {}).unwrap();
    let calibration = Calibration::try_from([0.25, 0.0, 0.0, 0.0]).unwrap();
    bench.connect().calibrate(calibration).unwrap();
    let operations = |bench: &Bench| bench.with(|board| board.measure().flash_operations);
    let (mut loaded, mut old, mut new, mut cuts) = (ModelHash(11), 0, 0, 0);
    for noise in noises() {
        // Beyond the last operation of an upload no power fails: then all have been cut.
        for operation in 1.. {
            let next = images[usize::from(loaded == ModelHash(11))].clone();
            let model = next.image().model;
            let before = operations(&bench);
            bench.with(move |board| board.cut_within(operation, noise.wrapping_mul(0x9e37_79b9) ^ operation));
            let acknowledged =
                Client::connect(bench.board.link()).is_ok_and(|mut client| client.upload(&next, &mut |_| {}).is_ok());
            let is_cut = bench.with(|board| board.ended()) == Some(Ended::Cut);
            assert!(is_cut || acknowledged && operations(&bench) > before);
            bench.board.power_cycle();
            bench.board.pass(1.0);
            let mut client = bench.connect();
            let found = client.status().unwrap().model.expect("a table is there");
            assert!([loaded, model].contains(&found), "operation {operation}, noise {noise}: {found}");
            assert!(!acknowledged || found == model, "operation {operation}: an acknowledged table was lost");
            assert_eq!(client.calibration().unwrap(), Some(calibration), "operation {operation}, noise {noise}");
            let profile = profile(&bench.wiring).profile.digest;
            assert_eq!(client.hello().unwrap().profile, profile, "operation {operation}, noise {noise}");
            loaded = found;
            if !is_cut {
                break;
            }
            cuts += 1;
            *if found == model { &mut new } else { &mut old } += 1;
        }
    }
    assert!(cuts > 5, "only {cuts} operations were cut");
    println!("FIGURE pico: power cuts within an operation of the flash = {cuts} cuts");
    println!("FIGURE pico: power cuts with the old table complete = {old} cuts");
    println!("FIGURE pico: power cuts with the new table complete = {new} cuts");
    println!("FIGURE pico: power cuts with a mixture or a lost calibration = 0 cuts");
    assert!(Path::exists(&bench.folder.path().join(pico::FLASH_FILE)));
}

#[test]
fn a_long_table_is_uploaded_in_reasonable_time() {
    let Some(bench) = Bench::start(false) else { return };
    let image = table(&bench.wiring, &stepped(900), ModelHash(10));
    let mut client = bench.connect();
    let began_s = bench.board.now_s();
    client.upload(&image, &mut |_| {}).unwrap();
    let bytes_per_s = f64::from(image.image().len) / (bench.board.now_s() - began_s);
    println!("FIGURE pico: upload in the time of the board = {} bytes/s", bytes_per_s.round());
    // A line of 115 200 baud would carry 11 520.
    assert!(bytes_per_s > 1_000.0, "{bytes_per_s}");
}

#[test]
fn a_held_board_answers_packets_of_any_length_and_stays_held() {
    let Some(bench) = Bench::start(false) else { return };
    let mut link = bench.board.link();
    let protocol = |bench: &Bench| bench.connect().version().protocol;
    for _ in 0..3 {
        assert_ne!(protocol(&bench), 0);
        bench.with(PicoBench::bite);
        bench.board.pass(1.0);
    }
    assert_eq!(protocol(&bench), 0, "it is held");
    for line in ["reboot, please\r", "reboot please, dear board\r", &format!("{}\r", "x".repeat(63))] {
        link.send(line.as_bytes()).unwrap();
        bench.board.pass(0.5);
        assert_eq!(protocol(&bench), 0, "after {} bytes", line.len());
    }
    let resets = bench.with(|board| board.resets());
    bench.board.pass(5.0);
    assert_eq!(bench.with(|board| board.resets()), resets, "the console feeds the watchdog");
    bench.with(PicoBench::bite);
    bench.board.pass(1.0);
    assert_eq!(protocol(&bench), 0, "a held board that is reset is held again");
    assert!(bench.connect().reboot(RebootTarget::Loader).is_err());
    bench.board.pass(0.5);
    assert_eq!(protocol(&bench), 0, "the loader is on the console's cable");
    link.send(b"reboot\r").unwrap();
    bench.board.pass(1.0);
    assert_ne!(protocol(&bench), 0);
}

/// An erase takes 45 ms, in which neither ticks nor the servo bus run.
#[test]
fn an_upload_is_no_silence_of_a_servo() {
    let mut wiring = wiring(true);
    wiring.servos[0].timeout_ms = 30;
    let Some(bench) = Bench::wired(wiring) else { return };
    let mut client = bench.connect();
    client.upload(&table(&bench.wiring, &stepped(4), ModelHash(7)), &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    bench.events_until(&mut client, |event| event == Event::Finished);
    bench.board.pass(0.5);
    client.upload(&table(&bench.wiring, &stepped(5), ModelHash(8)), &mut |_| {}).unwrap();
    assert_eq!(client.status().unwrap().phase, Phase::Idle);
}

/// A table with the frames of six spatial modules, and a program of 20 s.
fn table_with_frames(wiring: &Wiring, model: ModelHash) -> darm_arm::image::UploadImage {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/spatial6.toml");
    let modules = darm_arm::reach::board::records(&darm_arm::arm::Arm::read(&example).unwrap()).unwrap();
    let profile = profile(wiring).profile.digest;
    let mut records = vec![Record::Start { model, device: None, profile, switch_limit: wiring.switch_limit }];
    records.extend(wiring.coils.iter().copied().map(Record::Coil));
    records.extend(wiring.actuators.iter().copied().map(Record::Actuator));
    records.extend(modules.iter().cloned());
    records.extend((0..200u32).map(|row| {
        let digits: Vec<u8> = (0..36).map(|k| u8::from(k == 0 || row % 2 == k)).collect();
        let (at, word) = (Micros::from_millis(100 * row), Word::new(&digits).unwrap());
        Record::Row(Row { at, word, servos: Default::default() })
    }));
    records.push(Record::End { at: Micros::from_millis(20_000) });
    darm_arm::image::UploadImage::table(&records, model)
}

#[test]
fn a_stop_acts_while_the_board_searches_for_a_word() {
    let mut wiring = Wiring::default();
    for index in 0..36 {
        let drive = Drive::Hold { line: index };
        let limit = CoilLimit { duty_percent: 100, ..drive.default_limit() };
        wiring.coils.push(Coil { output: index, drive, limit }).unwrap();
        wiring.actuators.push(ActuatorWiring { states: 2, switch: None, travel_ms: 10 }).unwrap();
    }
    let Some(bench) = Bench::wired(wiring) else { return };
    bench.connect().upload(&table_with_frames(&bench.wiring, ModelHash(3)), &mut |_| {}).unwrap();
    let mut link = bench.board.link();
    let mut longest_s = 0.0f64;
    for delay_ms in (0..6u32).map(|k| 3 + 61 * k) {
        bench.connect().command(Command::Play).unwrap();
        bench.wait("a line", || bench.lines() != 0);
        link.send(b"nearest 100 200 1900 0 15 0\r").unwrap();
        bench.board.pass(1e-3 * f64::from(delay_ms));
        assert_ne!(bench.lines(), 0);
        let asked_s = bench.board.now_s();
        link.send(b"stop\r").unwrap();
        while bench.lines() != 0 {
            bench.board.pass(0.001);
        }
        longest_s = longest_s.max(bench.board.now_s() - asked_s);
    }
    println!("longest stop while the board searches for a word = {:.0} ms", 1e3 * longest_s);
    assert!(longest_s <= 0.005, "{longest_s} s");
    let measured = bench.with(PicoBench::measure);
    assert!(measured.stack_bytes <= 85 * 24 * 1024 / 100, "{measured:?}");
}
