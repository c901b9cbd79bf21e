//! Judge 1 on lines that are set by hand.

use super::super::chain::{CLOCK, DATA, ENABLE};
use super::LATCH;
use super::{Ceilings, LatchCeiling, LineCeiling, MS, Pins};

/// Line 3 carries full current for 20 ms.
const PEAK_MS: [u32; 4] = [0, 0, 0, 20];

fn judge() -> Pins {
    let (max_on_ms, duty_percent, window_ms) = (100, 50, 1000);
    let ceiling =
        |load| Some(LineCeiling { max_on_ms, duty_percent, window_ms, load, peak_ms: PEAK_MS[load as usize] });
    let mut lines = [None; 64];
    (0..4).for_each(|line| lines[line] = ceiling(line as u8));
    let (latches, servos, new_loads, budget_ms) = (Vec::new(), Vec::new(), 2, 10);
    Pins::new(Ceilings { lines, latches, servos, new_loads, budget_ms, refresh_ms: 10_000, clock_ppm: 0 })
}

fn set(judge: &mut Pins, at_ms: u64, lines: u64) {
    for bit in (0..64).rev() {
        judge.on_edge(at_ms * MS, DATA, lines >> bit & 1 == 1);
        judge.on_edge(at_ms * MS, CLOCK, true);
        judge.on_edge(at_ms * MS, CLOCK, false);
    }
    judge.on_edge(at_ms * MS, LATCH, true);
    judge.on_edge(at_ms * MS, LATCH, false);
    judge.on_edge(at_ms * MS, ENABLE, false);
}

fn rules(steps: &[(u64, u64)]) -> Vec<&'static str> {
    let mut judge = judge();
    steps.iter().for_each(|&(at_ms, lines)| set(&mut judge, at_ms, lines));
    judge.finish(9_000 * MS).firsts().iter().map(|(first, _)| first.rule).collect()
}

#[test]
fn each_rule_is_seen_and_only_where_it_is_broken() {
    assert!(rules(&[(0, 0), (1, 1), (101, 0), (500, 3), (600, 0)]).is_empty());
    assert_eq!(rules(&[(0, 1), (112, 0)]), ["on-time"]);
    assert_eq!(rules(&[(0, 0x10), (9, 0)]), ["wiring"]);
    assert_eq!(rules(&[(0, 1), (1, 3), (2, 7), (3, 0)]), ["supply"]);
    let pulses: Vec<(u64, u64)> = (0..6).flat_map(|n| [(n * 150, 1), (n * 150 + 90, 0)]).collect();
    assert_eq!(rules(&pulses), ["duty"]);
}

#[test]
fn a_chain_that_no_longer_returns_its_lines_is_seen_where_it_did_at_the_start() {
    // From a tick on that the firmware had for its count, or from its first tick.
    for (at_start, cut_ms, is_seen) in
        [(true, 3..=312, true), (true, 3..=292, false), (false, 3..=312, false), (true, 1..=312, false)]
    {
        let mut judge = judge();
        judge.on_first_return(at_start);
        set(&mut judge, 0, 1);
        (1..400).for_each(|ms| judge.on_return(ms * MS, !cut_ms.contains(&ms)));
        assert_eq!(judge.verdict.has("chain-unreturned"), is_seen, "{at_start} {cut_ms:?}");
    }
}

#[test]
fn output_enable_that_stays_low_without_a_line_is_seen() {
    let mut judge = judge();
    judge.on_tick_end(MS);
    set(&mut judge, 10, 1);
    judge.on_tick_end(11 * MS);
    assert!(!judge.verdict.has("idle-enable"));
    set(&mut judge, 20, 0);
    judge.on_edge(20 * MS, ENABLE, true);
    judge.on_tick_end(20 * MS);
    assert!(!judge.verdict.has("idle-enable"));
    judge.on_edge(21 * MS, ENABLE, false);
    judge.on_tick_end(21 * MS);
    assert!(judge.verdict.has("idle-enable"));
}

#[test]
fn current_while_the_flash_lets_nothing_run_is_seen() {
    let mut judge = judge();
    set(&mut judge, 0, 0);
    judge.on_pause(MS);
    assert!(!judge.verdict.has("flash-under-current"));
    set(&mut judge, 2, 1);
    judge.on_pause(3 * MS);
    assert!(judge.verdict.has("flash-under-current"));
}

#[test]
fn full_current_that_comes_again_too_soon_is_seen() {
    let peaks = |at_ms| [(10, 8), (20, 0), (at_ms, 8), (at_ms + 20, 0)];
    assert!(rules(&peaks(209)).is_empty(), "200 ms, less a tick");
    assert_eq!(rules(&peaks(208)), ["peak-share"]);
    assert!(rules(&peaks(208).map(|(at_ms, lines)| (at_ms, lines >> 1))).is_empty(), "line 2 has no peak");
    let mut judge = judge();
    set(&mut judge, 10, 8);
    judge.on_power_off(29 * MS);
    judge.on_start(30 * MS, true);
    set(&mut judge, 100, 8);
    assert!(judge.verdict.has("peak-share"));
}

/// A table's peaks may be shorter than the profile's: the length counts that the line shows.
#[test]
fn a_short_peak_after_a_long_one_waits_for_the_long_one() {
    let peaks = |at_ms| [(10, 8), (20, 0), (110, 8), (130, 0), (at_ms, 8), (at_ms + 10, 0)];
    assert_eq!(rules(&peaks(400)), ["peak-share"], "the long one comes 100 ms after the short one");
    let peaks = |at_ms| [(10, 8), (30, 0), (at_ms, 8), (at_ms + 10, 0), (at_ms + 90, 8), (at_ms + 100, 0)];
    assert!(rules(&peaks(210)).is_empty(), "two short ones, 90 ms apart");
    assert_eq!(rules(&peaks(110)), ["peak-share"]);
}

#[test]
fn lines_that_stay_on_under_the_emergency_stop_are_seen() {
    let mut judge = judge();
    set(&mut judge, 10, 1);
    judge.on_emergency_stop(13 * MS, 10 * MS);
    assert!(!judge.verdict.has("emergency-stop"));
    judge.on_emergency_stop(14 * MS, 10 * MS);
    assert!(judge.verdict.has("emergency-stop"));
}

#[test]
fn a_line_that_stays_on_after_a_fault_is_seen() {
    let mut judge = judge();
    set(&mut judge, 10, 1);
    set(&mut judge, 20, 0);
    judge.on_fault_report(100 * MS, 18_000);
    assert!(!judge.verdict.has("safe-state"));
    judge.on_fault_report(100 * MS, 12_000);
    assert!(judge.verdict.has("safe-state"));
}

/// Lines 1 and 2 set and reset a latch by pulses of 20 ms.
fn latch_rules(steps: &[(u64, u64)]) -> Vec<&'static str> {
    let mut judge = judge();
    judge.ceilings.latches = vec![LatchCeiling { set: 1, reset: 2, pulse_ms: 20 }];
    steps.iter().for_each(|&(at_ms, lines)| set(&mut judge, at_ms, lines));
    judge.finish(9_000 * MS).firsts().iter().map(|(first, _)| first.rule).collect()
}

#[test]
fn a_pulse_that_is_too_long_and_both_lines_of_a_latch_are_seen() {
    assert!(latch_rules(&[(0, 0), (10, 2), (33, 0), (500, 4), (523, 0)]).is_empty());
    assert_eq!(latch_rules(&[(0, 0), (10, 2), (34, 0)]), ["latch-pulse"]);
    assert_eq!(latch_rules(&[(0, 0), (10, 4), (50, 0)]), ["latch-pulse"]);
    assert_eq!(latch_rules(&[(0, 0), (10, 2), (15, 6), (20, 0)]), ["latch-both"]);
    assert!(latch_rules(&[(0, 0), (10, 2), (20, 4), (30, 0)]).is_empty(), "one after the other");
}

#[test]
fn full_current_that_lasts_too_long_is_seen() {
    assert!(rules(&[(0, 0), (10, 8), (33, 0)]).is_empty());
    assert_eq!(rules(&[(0, 0), (10, 8), (34, 0)]), ["peak-length"]);
}

#[test]
fn lines_in_a_safe_state_are_seen() {
    let mut judge = judge();
    judge.on_forbidden(MS, "safe-latched", "in the safe state");
    assert!(!judge.verdict.has("safe-latched"));
    set(&mut judge, 10, 1);
    judge.on_forbidden(10 * MS, "safe-latched", "in the safe state");
    assert!(judge.verdict.has("safe-latched"));
}

#[test]
fn loads_count_over_a_reset() {
    let mut judge = judge();
    judge.ceilings.budget_ms = 1_000;
    assert!(!judge.has_supply(500 * MS, 1), "just started");
    set(&mut judge, 100, 1);
    set(&mut judge, 110, 3);
    judge.on_start(200 * MS, true);
    set(&mut judge, 300, 0);
    set(&mut judge, 900, 4);
    assert!(judge.verdict.has("supply"));
    assert!(judge.has_supply(9_000 * MS, 2));
}
