//! The firmware's library behind bad lines, with a plant that breaks.

use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, ServoWiring, Wiring};
use darm_core::sequencer::{Command, Event, FaultKind, Phase};
use darm_core::table::{Record, Row, head};
use darm_core::units::{ActuatorId, Micros, ModelHash, Word};

use super::{Chip, InProcess, MemoryFlash};
use crate::plant::{Broken, Plant};
use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;
use darm_device::client::{Client, TimedEvent};
use darm_device::link::faulty::{Faults, Faulty};
use darm_device::strokes::{InputHistory, SentRow, stroke_times};

/// Four valves with switches, and a servo.
fn wiring() -> Wiring {
    let mut wiring = Wiring::default();
    for index in 0..4 {
        let drive = Drive::Hold { line: index };
        let switch = Some(LimitSwitch { input: index, closed_in: 0b10 });
        let limit = CoilLimit { duty_percent: 100, ..drive.default_limit() };
        wiring.coils.push(Coil { output: index, drive, limit }).unwrap();
        wiring.actuators.push(ActuatorWiring { states: 2, switch, travel_ms: 100 }).unwrap();
    }
    let (max_speed_rad_s, max_torque, timeout_ms) = (2.0, 0.8, 100);
    let joint = ServoWiring { id: 1, min_rad: -1.5, max_rad: 1.5, max_speed_rad_s, max_torque, timeout_ms };
    wiring.servos.push(joint).unwrap();
    wiring
}

fn words(count: usize) -> Vec<Word> {
    let digits = |n: usize| [n & 1, n >> 1 & 1, n >> 2 & 1, n >> 3 & 1].map(|bit| bit as u8);
    (1..=count).map(|n| Word::new(&digits(n ^ n >> 1)).unwrap()).collect()
}

/// The profile that allows this wiring.
fn profile() -> BoardProfile {
    BoardProfile::of("four valves", &wiring())
}

/// A row every 200 ms; the servo goes to and fro.
fn table(words: &[Word]) -> UploadImage {
    let (wiring, model) = (wiring(), ModelHash(9));
    let profile = profile().profile.digest;
    let mut records: Vec<Record> = head(&wiring, model, None, profile).collect();
    for (row, &word) in words.iter().enumerate() {
        let servos = [0.1 * (row % 2) as f32].into_iter().collect();
        records.push(Record::Row(Row { at: Micros(200_000 * row as u64), word, servos }));
    }
    records.push(Record::End { at: Micros(200_000 * words.len() as u64) });
    UploadImage::table(&records, model)
}

fn boot(servo_offset_rad: f32) -> InProcess {
    InProcess::boot(Plant::new(&wiring(), &[servo_offset_rad]), MemoryFlash::with_profile(&profile().image())).unwrap()
}

fn loaded() -> (InProcess, Client) {
    let board = boot(0.0);
    let mut client = Client::connect_as(board.link(), 1).unwrap();
    client.upload(&table(&words(8)), &mut |_| {}).unwrap();
    (board, client)
}

fn all_events(client: &mut Client) -> Vec<TimedEvent> {
    let mut happened: Vec<TimedEvent> = Vec::new();
    loop {
        let next = client.events(happened.last().map_or(0, |last| last.number + 1)).unwrap();
        if next.is_empty() {
            return happened;
        }
        happened.extend(next);
    }
}

fn safe_kind(client: &mut Client) -> Option<FaultKind> {
    match client.status().unwrap().phase {
        Phase::Safe(fault) => Some(fault.kind),
        _ => None,
    }
}

#[test]
fn every_row_is_seen_at_rest_by_the_camera() {
    let (board, mut client) = loaded();
    client.command(Command::Play).unwrap();
    board.pass(3.0);
    let happened = all_events(&mut client);
    assert!(matches!(happened.last().unwrap().event, Event::Finished));
    let rows =
        happened.iter().filter_map(|h| if let Event::Row { word, .. } = h.event { Some((h.at, word)) } else { None });
    let rows: Vec<(Micros, Word)> = rows.collect();
    assert_eq!(rows.iter().map(|row| row.1).collect::<Vec<_>>(), words(8));
    let mut previous = Word::zeros(4).unwrap();
    for (at, word) in rows {
        let host = client.clock().host_time(1e-6 * at.0 as f64).unwrap();
        assert!(host.uncertainty_s < 0.01, "{host:?}");
        let frame = board.film().at_rest_between(host.at_s + 0.11, host.at_s + 0.19).unwrap();
        assert_eq!((frame.state.reached, frame.state.previous), (word, previous));
        previous = word;
    }
}

#[test]
fn uploads_and_commands_survive_bad_lines() {
    let image = table(&words(300));
    for seed in 0..20 {
        let board = boot(0.0);
        let line = Faulty::new(board.link(), Faults::all(0.04), seed);
        let mut client = Client::connect_as(Box::new(line), 1 + seed as u32).unwrap();
        assert_eq!(client.upload(&image, &mut |_| {}).unwrap(), 300, "seed {seed}");
        client.command(Command::Play).unwrap();
        board.pass(1.0);
        let started = all_events(&mut client).iter().filter(|h| h.event == Event::Started).count();
        assert_eq!(started, 1, "seed {seed}");
    }
}

#[test]
fn a_stored_table_outlives_a_power_cut_and_half_an_upload_does_not() {
    let (board, mut client) = loaded();
    let half = &mut |progress: darm_device::client::Progress| {
        if 2 * progress.done > progress.total {
            board.power_cycle();
        }
    };
    // The board starts anew again and again; the client gives up some time.
    let _ = client.upload(&table(&words(200)), half);
    let mut client = Client::connect_as(board.link(), 2).unwrap();
    assert_eq!(client.status().unwrap().rows, 8);
    assert!(client.hello().unwrap().boots > 1);
}

#[test]
fn a_broken_output_switch_or_servo_is_named() {
    let line = Broken { lines_high: 0b100, ..Broken::default() };
    let switch = Broken { switches_open: 0b1, ..Broken::default() };
    let servo = Broken { servos_silent: 0b1, ..Broken::default() };
    let actuator = |index, expected_closed| FaultKind::Switch {
        actuator: ActuatorId(index),
        expected_closed,
        seen_closed: !expected_closed,
    };
    let silent = FaultKind::ServoSilent { servo: 0 };
    for (broken, kind) in [(line, actuator(2, false)), (switch, actuator(0, true)), (servo, silent)] {
        let (board, mut client) = loaded();
        client.command(Command::Play).unwrap();
        board.pass(0.02);
        board.set_broken(broken);
        board.pass(1.0);
        assert_eq!(safe_kind(&mut client), Some(kind), "{broken:?}");
    }
}

#[test]
fn the_servo_stands_at_its_joint_angle_whatever_its_horn() {
    let board = boot(0.3);
    let mut client = Client::connect_as(board.link(), 1).unwrap();
    client.upload(&table(&words(8)), &mut |_| {}).unwrap();
    let calibration = darm_core::wire::message::Calibration::try_from([0.3, 0.0, 0.0, 0.0]).unwrap();
    client.calibrate(calibration).unwrap();
    client.command(Command::Servo { servo: 0, angle_rad: 0.5 }).unwrap();
    board.pass(3.0);
    assert!((board.state().unwrap().servos_rad[0] - 0.5).abs() < 2e-3, "{:?}", board.state());
    assert_eq!(client.calibration().unwrap(), Some(calibration));
}

#[test]
fn a_run_repeats_exactly() {
    let run = || {
        let (board, mut client) = loaded();
        client.command(Command::Play).unwrap();
        board.pass(1.0);
        (board.film().take(), all_events(&mut client))
    };
    assert_eq!(run(), run());
}

/// How long it takes to store a table where an older one was, s.
fn overwriting_s(chip: Chip) -> f64 {
    let flash = MemoryFlash::with_profile_on(chip, &profile().image());
    let board = InProcess::boot(Plant::new(&wiring(), &[0.0]), flash).unwrap();
    let mut client = Client::connect_as(board.link(), 1).unwrap();
    // Two tables fill both slots: from the third on an older one is erased.
    let times = [8, 9, 10].map(|n_words| {
        let from_s = board.now_s();
        client.upload(&table(&words(n_words)), &mut |_| {}).unwrap();
        board.now_s() - from_s
    });
    times[2]
}

#[test]
fn nothing_runs_while_a_flash_that_holds_the_code_is_erased() {
    let [apart_s, shared_s] = [Chip::Stm32l475, Chip::Rp2040].map(overwriting_s);
    let pause_s = 1e-6 * Chip::Rp2040.erase_pause().0 as f64;
    assert!(apart_s < pause_s && pause_s < shared_s, "{apart_s} s and {shared_s} s");
}

#[test]
fn strokes_are_timed_by_the_board_to_a_tick() {
    let (_board, mut client) = loaded();
    client.command(Command::Play).unwrap();
    client.listen(2.0).unwrap();
    let rows = all_events(&mut client).into_iter().filter_map(|timed| match timed.event {
        Event::Row { row, word } => Some(SentRow { row, at: timed.at, word }),
        _ => None,
    });
    let mut inputs = InputHistory::default();
    while inputs.take(&client.input_changes(inputs.next()).unwrap().unwrap()) {}
    let strokes = stroke_times(&wiring().actuators, &rows.collect::<Vec<_>>(), &inputs);
    assert!(strokes.len() >= 6, "{strokes:?}");
    for stroke in strokes {
        // A quarter of the 100 ms in the wiring to arrive, nothing to leave; a tick in between, and one of the simulated pins.
        let true_ms = if stroke.to == 1 { 25 } else { 0 };
        let late = Micros(stroke.time.0.saturating_sub(1000 * true_ms));
        assert!(stroke.time.0 >= 1000 * true_ms && late <= Micros(2000), "{stroke:?}");
    }
}
