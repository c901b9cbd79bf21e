//! The pulse to a camera, at its pin.

use darm_arm::board_profile::BoardProfile;
use darm_core::profile::{BoardWiring, PICO, Profile};
use darm_core::sequencer::{Command, Event};
use darm_core::units::ModelHash;
use darm_sim::pico::{Edges, PicoBench};

use super::bench::Bench;
use super::tables::{profile, stepped, table_under, wiring};

/// From a row's lines to its pulse: a part of one control tick.
const BEHIND_NS: u64 = 20_000;
/// The work before the lines, which is more in some ticks.
const JITTER_NS: u64 = 50_000;

/// Each row has one pulse, which follows its lines within the same tick and lasts until the next one.
#[test]
fn each_row_has_a_pulse_to_the_camera_right_behind_its_lines() {
    let wiring = wiring(false);
    let board = BoardWiring { chips: None, layout: Some(PICO.layout()) };
    let with_sync = BoardProfile::new("sync", Profile { sync: true, board, ..profile(&wiring).profile });
    let Some(bench) = Bench::with_profile(wiring, &with_sync) else { return };
    let mut client = bench.connect();
    let words = stepped(8);
    client.upload(&table_under(&with_sync, &bench.wiring, &words, ModelHash(1), &[]), &mut |_| {}).unwrap();
    assert_eq!(bench.with(PicoBench::take_edges).sync, [], "no row, no pulse");
    client.command(Command::Play).unwrap();
    let happened = bench.events_until(&mut client, |event| event == Event::Finished);
    let rows_us: Vec<u64> =
        happened.iter().filter(|timed| matches!(timed.event, Event::Row { .. })).map(|timed| timed.at.0).collect();
    let Edges { lines, sync } = bench.with(PicoBench::take_edges);
    // The pin becomes an output with the first pulse: until then nobody drives it.
    let (pulses, rest) = sync[1..].as_chunks::<2>();
    assert!(rest.is_empty() && pulses.len() == words.len() && rows_us.len() == words.len(), "{sync:?}");
    let mut longest_ns = 0;
    for (pulse, row_us) in pulses.iter().zip(&rows_us) {
        let &[(rise_ns, true), (fall_ns, false)] = pulse else { panic!("{pulse:?}") };
        let lines_ns = lines.iter().copied().filter(|at| *at <= rise_ns).max().expect("lines of the row");
        longest_ns = longest_ns.max(rise_ns - lines_ns);
        assert!((fall_ns - rise_ns).abs_diff(1_000_000) <= JITTER_NS, "{pulse:?}");
        // Both clocks count from their own start.
        let since_first_ns = (rise_ns - pulses[0][0].0).abs_diff(1000 * (row_us - rows_us[0]));
        assert!(since_first_ns <= JITTER_NS, "{since_first_ns} ns off the row of the log");
    }
    println!("longest time from a row's lines to its pulse = {:.1} us", 1e-3 * longest_ns as f64);
    assert!(longest_ns <= BEHIND_NS, "{longest_ns} ns behind the lines");
}
