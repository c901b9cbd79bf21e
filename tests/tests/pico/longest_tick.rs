//! The longest control tick and the stack, with all that a board drives.

use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;
use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, ServoWiring, SwitchLimit, Wiring};
use darm_core::profile::{BoardWiring, PICO, Profile};
use darm_core::sequencer::{Command, Event};
use darm_core::table::{Record, Row, head};
use darm_core::units::{Micros, ModelHash, Word};
use darm_sim::pico::PicoBench;

use crate::bench::Bench;

/// Clock of the chip.
const CYCLES_PER_TICK: f64 = 125e3;
const OUTPUTS: usize = 48;
const SERVOS: u8 = 4;
/// Outputs that the supply feeds newly in one millisecond.
const CHANGING: usize = 16;
/// Rows in which a third of the outputs changes, and the time from one to the next, ms.
const STEADY_ROWS: u32 = 18;
const STEADY_MS: u32 = 30;
/// Bursts of three rows 1 ms apart, and of a fourth in which every output goes off, and the time from one burst to the next, ms.
const BURSTS: u32 = 6;
const BURST_MS: u32 = 120;
const PLAYS: usize = 4;

/// 48 outputs, of which 16 pull in with a peak, and four servos.
fn wiring() -> Wiring {
    let supply = SwitchLimit { new_coils: CHANGING as u8, window_ms: 1 };
    let mut wiring = Wiring { switch_limit: supply, ..Wiring::default() };
    for output in 0..OUTPUTS as u8 {
        let drive = if usize::from(output) < CHANGING {
            Drive::PeakHold { pull: output, hold: 48 + output, peak_ms: 5 }
        } else {
            Drive::Hold { line: output }
        };
        let limit = CoilLimit { max_on_ms: 60_000, duty_percent: 90, window_ms: 200 };
        wiring.coils.push(Coil { output, drive, limit }).unwrap();
        wiring.actuators.push(ActuatorWiring { states: 2, switch: None, travel_ms: 1 }).unwrap();
    }
    for id in 1..=SERVOS {
        let (min_rad, max_rad, max_speed_rad_s, max_torque) = (-1.5, 1.5, 3.0, 0.5);
        let servo = ServoWiring { id, min_rad, max_rad, max_speed_rad_s, max_torque, timeout_ms: 500 };
        wiring.servos.push(servo).unwrap();
    }
    wiring
}

/// Times of rows in ms, and their digits: steady rows, then bursts.
fn rows() -> Vec<(u32, [u8; OUTPUTS])> {
    let mut digits = [0; OUTPUTS];
    let mut rows = Vec::new();
    for row in 0..STEADY_ROWS {
        let third = row as usize % 3 * CHANGING;
        digits[third..third + CHANGING].iter_mut().for_each(|digit| *digit = 1 - *digit);
        rows.push((row * STEADY_MS, digits));
    }
    for burst in 0..BURSTS {
        let begin_ms = STEADY_ROWS * STEADY_MS + (1 + burst) * BURST_MS;
        for third in 0..3 {
            digits[third * CHANGING..][..CHANGING].fill(1);
            rows.push((begin_ms + third as u32, digits));
        }
        digits.fill(0);
        // As soon as a table may: a turn of the meters of 48 outputs and 2 ms behind the last of the others.
        rows.push((begin_ms + 16, digits));
    }
    rows
}

fn table(wiring: &Wiring, profile: &BoardProfile) -> UploadImage {
    let model = ModelHash(9);
    let mut records: Vec<Record> = head(wiring, model, None, profile.profile.digest).collect();
    let rows = rows();
    let end_ms = rows.last().unwrap().0 + BURST_MS;
    for (at_ms, digits) in rows {
        let servos = wiring.servos.iter().map(|_| 0.2).collect();
        records.push(Record::Row(Row { at: Micros::from_millis(at_ms), word: Word::new(&digits).unwrap(), servos }));
    }
    records.push(Record::End { at: Micros::from_millis(end_ms) });
    UploadImage::table(&records, model)
}

#[test]
fn the_longest_control_tick_and_the_stack_keep_their_limits() {
    let wiring = wiring();
    let board = BoardWiring { chips: None, layout: Some(PICO.layout()) };
    let profile = BoardProfile::new("full", Profile { sync: true, board, ..Profile::of(&wiring) });
    let Some(bench) = Bench::with_profile(wiring, &profile) else { return };
    let mut client = bench.connect();
    client.upload(&table(&bench.wiring, &profile), &mut |_| {}).unwrap();
    // After power-up every output counts as used to its limit.
    bench.board.pass(1.0);
    bench.with(PicoBench::measure);
    for _ in 0..PLAYS {
        client.command(Command::Play).unwrap();
        bench.board.pass(2.5);
        client.status().unwrap();
    }
    let happened = bench.events_until(&mut client, |event| matches!(event, Event::Finished | Event::Fault(_)));
    assert!(happened.iter().all(|timed| !matches!(timed.event, Event::Fault(_))), "{happened:?}");
    let reported = client.health().unwrap().unwrap();
    let measured = bench.with(PicoBench::measure);
    let share = |cycles: u64| 100.0 * cycles as f64 / CYCLES_PER_TICK;
    let percent = |cycles| (10.0 * share(cycles)).round() / 10.0;
    println!("FIGURE pico: longest control tick = {} instructions", measured.longest_instructions);
    println!("FIGURE pico: longest control tick of 1 ms at 125 MHz = {} %", percent(measured.longest_cycles));
    println!(
        "FIGURE pico: the same with waits for the flash, by a model of its cache = {} %",
        percent(measured.waiting_cycles)
    );
    println!("FIGURE pico: the same with no line in the cache at the begin = {} %", percent(measured.cold_cycles));
    println!("FIGURE pico: stack in use, measured = {} bytes", measured.stack_bytes);
    assert!(measured.ticks > 3_000, "{measured:?}");
    assert!(share(measured.cold_cycles) <= 40.0, "{measured:?}");
    // The board finds the same stack by itself, up to a call that went deeper between the two.
    let stack = reported.stack.unwrap();
    assert!(
        stack.size == 24 * 1024 && stack.used.abs_diff(measured.stack_bytes as u32) <= 256,
        "{stack:?} {measured:?}"
    );
    // The ticks alone take a tenth of the time.
    let load = reported.load_permille.unwrap();
    println!("FIGURE pico: load while a table is played = {} %", 0.1 * f64::from(load));
    assert!((50..900).contains(&load), "{load} permille");
    // Of the 24 KiB that `board.x` gives.
    assert!(measured.stack_bytes <= 85 * 24 * 1024 / 100, "{measured:?}");
}
