//! Judge 1, the limit switches: what the mechanism shows against what the lines say.
//!
//! The judge takes the state of each actuator from the lines themselves: a coil is on while its line is high, a latch is set by
//! the last line that went high. It sees the inputs as they are at the board's pins, whatever is broken before them.

use std::collections::VecDeque;

use super::{Ceilings, SwitchCeiling, Verdict};

const JUDGE: &str = "pins";
const MS: u64 = 1_000_000;
/// A contradiction counts once it has been there for this time, and is acted on within it, in board time: contacts bounce for
/// three ticks, the inputs are a tick old, and the lines follow a tick later.
const NOTICE_MS: u64 = 6;
/// What was sent before a stop may still switch lines for this time, ms.
const INTERRUPTED_MS: u64 = 50;
/// Spans of an actuator that are kept until the start of a program is reported.
const SPANS: usize = 16;

#[derive(Clone, Debug, Default)]
struct Track {
    /// Its digit as the lines say.
    digit: u8,
    /// Lines of its latches that have gone high since the board knew of none in which state it is.
    pulsed: u64,
    /// Since when the board says so too, while lines were on.
    since_ns: Option<u64>,
    /// Since when its switch contradicts that.
    wrong_ns: Option<u64>,
    /// Since when it does so while lines are on and it has not moved since they were all off, or before a program, and the last such
    /// spans that ended.
    resting_ns: Option<u64>,
    rested_ns: VecDeque<(u64, u64)>,
    /// When it moved last, and when it did so by a pulse of a command by hand, since the last thing that lets the board expect
    /// nothing of its switch.
    moved_ns: Option<u64>,
    by_hand_ns: Option<u64>,
    /// Since when its switch contradicts the state that its lines say, whatever is on.
    contradicts_ns: Option<u64>,
}

/// The judge's memory.
pub struct Switches {
    ceilings: Ceilings,
    actuators: Vec<SwitchCeiling>,
    tracks: Vec<Track>,
    lines: u64,
    /// Whether latches are set before the first row of a program: the board compares their switches from its start on.
    is_approaching: bool,
    /// Since when no line has been high.
    off_ns: Option<u64>,
    /// When something was wrong with an input, a switch or a valve last.
    disturbed_ns: Option<u64>,
    /// When somebody last sent what may end all that is expected of the switches; what moves soon after it may still be due to what came
    /// before. And whether a program may have run since then.
    interrupted_ns: u64,
    has_played: bool,
    verdict: Verdict,
}

impl Switches {
    /// Actuators at rest.
    pub fn new(ceilings: Ceilings, actuators: Vec<SwitchCeiling>) -> Self {
        let tracks = vec![Track::default(); actuators.len()];
        let verdict = Verdict::default();
        Self {
            ceilings,
            actuators,
            tracks,
            lines: 0,
            is_approaching: false,
            off_ns: None,
            disturbed_ns: None,
            interrupted_ns: 0,
            has_played: true,
            verdict,
        }
    }

    /// Somebody sends what may stop the board, or leave the safe state: nothing is expected of the switch of an actuator that has not been
    /// moved by hand since.
    pub fn on_interrupted(&mut self, now_ns: u64) {
        (self.interrupted_ns, self.has_played) = (now_ns, false);
        self.tracks.iter_mut().for_each(|track| track.by_hand_ns = None);
    }

    /// Something is wrong with an input, a switch or a valve now.
    pub fn on_disturbed(&mut self, now_ns: u64) {
        self.disturbed_ns = Some(now_ns);
    }

    /// Texts come that act later than they are sent: nothing is taken for done by hand until something else is sent.
    pub fn on_texts(&mut self) {
        self.has_played = true;
        self.tracks.iter_mut().for_each(|track| track.by_hand_ns = None);
    }

    /// The board has started, or has been given another table: it knows of no latch any more.
    pub fn on_latches_unknown(&mut self) {
        self.tracks.iter_mut().for_each(|track| (track.pulsed, track.by_hand_ns) = (0, None));
        self.has_played = true;
    }

    /// Somebody asks for a program to be run, for which the board takes the states of all latches for unknown.
    pub fn on_play(&mut self) {
        (self.is_approaching, self.off_ns) = (true, None);
        self.on_latches_unknown();
    }

    /// The end of a tick: these lines are high, these inputs closed. `is_watched`: the loaded table names the switches.
    pub fn look(&mut self, now_ns: u64, lines: u64, inputs: u32, is_watched: bool) {
        let rising = lines & !self.lines;
        let was = std::mem::replace(&mut self.lines, lines);
        self.off_ns = if lines == 0 { self.off_ns.or(Some(now_ns)) } else { None };
        // An exhausted supply holds the next latch back for its window at most.
        let gap_ns = self.ceilings.true_ns(u64::from(self.ceilings.budget_ms) + NOTICE_MS);
        self.is_approaching &= self.off_ns.is_none_or(|off_ns| now_ns <= off_ns + gap_ns);
        for (actuator, track) in self.actuators.iter().zip(&mut self.tracks) {
            if lines == 0 {
                // Nothing is expected of a switch while the board drives nothing.
                (track.since_ns, track.wrong_ns) = (None, None);
            }
            let digit = digit(&actuator.coils, track.digit, lines, rising);
            // A pulse may move it though the lines say that it is there already: one before it was cut too early.
            let pulsed = rising & latches(actuator).fold(0, |all, lines| all | lines);
            if (digit != track.digit || pulsed != 0) && lines != 0 {
                (track.since_ns, track.wrong_ns) = (Some(now_ns), None);
            }
            if digit != track.digit || pulsed != 0 {
                track.moved_ns = Some(now_ns);
            }
            // A stop switches other coils off too, and nothing is expected of those then.
            let is_by_hand = !self.has_played && now_ns > self.interrupted_ns + INTERRUPTED_MS * MS;
            if pulsed != 0 && is_by_hand && actuator.coils.iter().all(|coil| coil.1.is_some()) {
                track.by_hand_ns = Some(now_ns);
            }
            track.digit = digit;
            track.pulsed |= pulsed;
            let is_closed = inputs >> actuator.input & 1 == 1;
            let is_wrong = is_closed != (actuator.closed_in >> digit & 1 == 1);
            let arrived_ns =
                track.since_ns.map(|since_ns| since_ns + self.ceilings.true_ns(u64::from(actuator.travel_ms)));
            let has_arrived = arrived_ns.is_some_and(|at_ns| now_ns >= at_ns);
            let rests = arrived_ns.is_none() || self.is_approaching && has_arrived;
            let is_resting = is_watched && is_wrong && lines != 0 && rests;
            if let (Some(from_ns), false) = (track.resting_ns, is_resting) {
                track.rested_ns.push_back((from_ns, now_ns));
                track.rested_ns.drain(..track.rested_ns.len().saturating_sub(SPANS));
            }
            track.resting_ns = if is_resting { track.resting_ns.or(Some(now_ns)) } else { None };
            // A latch that was set before is reset for the board: of such a state it knows nothing.
            let is_state = digit < actuator.states && is_known(actuator, track.pulsed);
            let contradicts = is_watched && is_wrong && is_state;
            track.contradicts_ns = if contradicts { track.contradicts_ns.or(Some(now_ns)) } else { None };
            let counts = is_watched && is_wrong && is_state && has_arrived && !self.is_approaching && was != 0;
            track.wrong_ns = if counts { track.wrong_ns.or(Some(now_ns)) } else { None };
            if track.wrong_ns.is_some_and(|wrong_ns| now_ns > wrong_ns + self.ceilings.true_ns(NOTICE_MS)) {
                let (input, seen) = (actuator.input, if is_closed { "closed" } else { "open" });
                self.verdict.note(JUDGE, "switch-ignored", now_ns, || {
                    format!("lines {lines:#x} are on, and the switch at input {input} is {seen} in state {digit}")
                });
            }
        }
    }

    /// The board reports that a program has started at this true time, and nobody else has acted since: after the time of travel each
    /// switch is compared, also that of an actuator that stays where it is.
    pub fn on_started(&mut self, now_ns: u64, started_ns: u64) {
        self.is_approaching = false;
        for (actuator, track) in self.actuators.iter().zip(&mut self.tracks) {
            track.since_ns = track.since_ns.map(|since_ns| since_ns.max(started_ns));
            let arrived_ns = started_ns + self.ceilings.true_ns(u64::from(actuator.travel_ms) + 1);
            let noticed_ns = arrived_ns + self.ceilings.true_ns(NOTICE_MS);
            let lasts = track.resting_ns.map(|from_ns| (from_ns, now_ns));
            let covers = |&(from_ns, to_ns): &(u64, u64)| from_ns <= arrived_ns && to_ns > noticed_ns;
            if lasts.iter().chain(&track.rested_ns).any(covers) {
                let input = actuator.input;
                self.verdict.note(JUDGE, "switch-ignored", noticed_ns, || {
                    format!(
                        "a program continues, and the switch at input {input} contradicts an actuator that has not moved"
                    )
                });
            }
        }
    }

    /// The board says, to somebody who asked at `asked_ns`, that a program runs which started then, or that coils are driven by hand (`None`):
    /// each switch that had to show its state by then has shown it, also while no line was high.
    pub fn on_running(&mut self, now_ns: u64, asked_ns: u64, started_ns: Option<u64>) {
        for (actuator, track) in self.actuators.iter().zip(&self.tracks) {
            let moved_ns =
                started_ns.map(|started_ns| track.moved_ns.unwrap_or(0).max(started_ns)).or(track.by_hand_ns);
            let Some((moved_ns, contradicts_ns)) = moved_ns.zip(track.contradicts_ns) else { continue };
            let last_ns = track.moved_ns.unwrap_or(0).max(moved_ns);
            let arrived_ns = last_ns + self.ceilings.true_ns(u64::from(actuator.travel_ms) + 1);
            if asked_ns > arrived_ns.max(contradicts_ns) + self.ceilings.true_ns(NOTICE_MS) {
                let (input, digit) = (actuator.input, track.digit);
                self.verdict.note(JUDGE, "switch-ignored", now_ns, || {
                    format!("the board says that it runs, and the switch at input {input} contradicts state {digit}")
                });
            }
        }
    }

    /// The board reports at this true time that a switch contradicts.
    pub fn on_fault(&mut self, now_ns: u64, fault_ns: u64) {
        let longest_ms = self.actuators.iter().map(|actuator| actuator.travel_ms).max().unwrap_or(0);
        let is_recent = |at_ns: u64| at_ns + u64::from(4 * longest_ms + 100) * MS > fault_ns;
        let has_latch = self.actuators.iter().flat_map(|actuator| &actuator.coils).any(|coil| coil.1.is_some());
        // The state of a latch whose pulse was cut is known to nobody.
        if !has_latch && !self.disturbed_ns.is_some_and(is_recent) {
            self.verdict.note(JUDGE, "switch-false", now_ns, || {
                "the board reports that a switch contradicts, and each actuator moved as it was driven".to_owned()
            });
        }
    }

    /// The end of the run.
    pub fn finish(self) -> Verdict {
        self.verdict
    }
}

/// The latches of an actuator, each by the lines that set and reset it.
fn latches(actuator: &SwitchCeiling) -> impl Iterator<Item = u64> {
    actuator.coils.iter().filter_map(|&(line, reset)| Some(1 << line | 1 << reset?))
}

/// Whether each latch of an actuator is among those with a line of these.
fn is_known(actuator: &SwitchCeiling, pulsed: u64) -> bool {
    latches(actuator).all(|lines| pulsed & lines != 0)
}

/// The digit of an actuator of these coils by its lines.
pub(super) fn digit(coils: &[(u8, Option<u8>)], before: u8, lines: u64, rising: u64) -> u8 {
    let high = |mask: u64, line: u8| mask >> line & 1 == 1;
    coils.iter().enumerate().fold(0, |digit, (bit, &(line, reset))| {
        let is_on = match reset {
            None => high(lines, line),
            Some(_) if high(rising, line) => true,
            Some(reset) if high(rising, reset) => false,
            Some(_) => before >> bit & 1 == 1,
        };
        digit | u8::from(is_on) << bit
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Ceilings, SwitchCeiling};
    use super::{MS, Switches};

    fn judge(reset: Option<u8>) -> Switches {
        let (lines, latches, servos) = ([None; 64], Vec::new(), Vec::new());
        let ceilings = Ceilings { lines, latches, servos, new_loads: 1, budget_ms: 10, refresh_ms: 100, clock_ppm: 0 };
        let actuator = SwitchCeiling { coils: vec![(0, reset)], states: 2, input: 3, closed_in: 0b10, travel_ms: 50 };
        Switches::new(ceilings, vec![actuator])
    }

    /// Whether it is broken after lines and inputs that stay for so many ms each.
    fn is_ignored(mut judge: Switches, spans: &[(u64, u64, u32)]) -> bool {
        let mut now_ms = 0;
        for &(ms, lines, inputs) in spans {
            for _ in 0..ms {
                now_ms += 1;
                judge.look(now_ms * MS, lines, inputs, true);
            }
        }
        judge.finish().has("switch-ignored")
    }

    #[test]
    fn a_switch_that_contradicts_while_lines_stay_on_is_seen() {
        assert!(!is_ignored(judge(None), &[(10, 0, 0), (40, 1, 0), (900, 1, 8)]));
        assert!(!is_ignored(judge(None), &[(10, 0, 0), (55, 1, 0), (900, 0, 0)]), "off in time");
        assert!(is_ignored(judge(None), &[(10, 0, 0), (70, 1, 0)]));
        assert!(is_ignored(judge(None), &[(10, 0, 0), (40, 1, 0), (100, 1, 8), (9, 1, 0)]), "it left its stop");
        assert!(!is_ignored(judge(None), &[(10, 0, 0), (40, 1, 0), (100, 1, 8), (3, 1, 0), (9, 1, 8)]), "it bounced");
    }

    #[test]
    fn the_switch_of_an_actuator_that_stays_where_it_is_counts_from_the_start_of_a_program() {
        // Lines of another load are on from 100 ms on; the switch must be open in state 0.
        for (started_ms, inputs, off_ms, is_ignored) in
            [(100, 8, 400, true), (100, 0, 400, false), (100, 8, 156, false), (380, 8, 400, false)]
        {
            let mut judge = judge(None);
            for ms in 1..500 {
                let lines = if (100..off_ms).contains(&ms) { 4 } else { 0 };
                judge.look(ms * MS, lines, inputs, true);
            }
            judge.on_started(500 * MS, started_ms * MS);
            assert_eq!(judge.finish().has("switch-ignored"), is_ignored, "{started_ms} {inputs} {off_ms}");
        }
    }

    #[test]
    fn a_latch_keeps_its_state_without_current() {
        assert!(is_ignored(judge(Some(1)), &[(10, 0, 0), (20, 0b101, 0), (60, 0b100, 0)]));
        assert!(!is_ignored(judge(Some(1)), &[(10, 0, 0), (20, 0b101, 0), (20, 0b100, 0), (60, 0b100, 8)]));
        assert!(!is_ignored(judge(Some(1)), &[(10, 0, 0), (20, 1, 0), (60, 0, 0)]), "nothing is driven");
    }

    /// An actuator of two latches: one is set, the other one is reset later, and the switch never closes.
    fn two_latches() -> Switches {
        let mut judge = judge(Some(1));
        judge.actuators[0] =
            SwitchCeiling { coils: vec![(0, Some(1)), (2, Some(3))], states: 4, ..judge.actuators[0].clone() };
        judge
    }

    const OTHER_LOAD: u64 = 1 << 8;

    #[test]
    fn a_state_counts_once_each_latch_has_had_a_pulse() {
        for (is_started, set_again, is_ignored) in [(false, 0, true), (true, 0, false), (true, 1, true)] {
            let mut judge = two_latches();
            (1..20).for_each(|ms| judge.look(ms * MS, 1, 0, true));
            if is_started {
                judge.on_latches_unknown();
            }
            for ms in 20..200 {
                let pulses = if (40..60).contains(&ms) { 1 << 3 | set_again } else { 0 };
                judge.look(ms * MS, OTHER_LOAD | pulses, 0, true);
            }
            assert_eq!(judge.finish().has("switch-ignored"), is_ignored, "{is_started} {set_again}");
        }
    }

    #[test]
    fn a_pulse_takes_its_time_where_the_state_was_there_already() {
        for (pulse_ms, is_ignored) in [(0..0, true), (40..60, false)] {
            let mut judge = two_latches();
            for ms in 1..80 {
                let pulses = if pulse_ms.contains(&ms) { 1 << 3 } else { 0 };
                judge.look(ms * MS, OTHER_LOAD | u64::from(ms < 20) | u64::from(ms < 20) << 3 | pulses, 0, true);
            }
            assert_eq!(judge.finish().has("switch-ignored"), is_ignored, "{pulse_ms:?}");
        }
    }

    /// The board sets all latches before a program, one after the other, and looks at the switches from its first row on.
    #[test]
    fn a_switch_before_a_program_counts_from_its_start() {
        for (started_ms, until_ms, is_ignored) in [(100, 140, false), (100, 200, true), (20, 140, true)] {
            let mut judge = judge(Some(1));
            judge.on_play();
            (1..until_ms).for_each(|ms| judge.look(ms * MS, OTHER_LOAD | u64::from(ms < 20), 0, true));
            judge.on_started(until_ms * MS, started_ms * MS);
            assert_eq!(judge.finish().has("switch-ignored"), is_ignored, "{started_ms} {until_ms}");
        }
    }

    #[test]
    fn a_program_that_waits_for_the_supply_has_not_started() {
        // The supply of this judge has a window of 10 ms.
        for (off_ms, is_ignored) in [(10, false), (40, true)] {
            let mut judge = judge(None);
            judge.on_play();
            (1..20).for_each(|ms| judge.look(ms * MS, OTHER_LOAD, 0, true));
            (20..20 + off_ms).for_each(|ms| judge.look(ms * MS, 0, 0, true));
            (20 + off_ms..200).for_each(|ms| judge.look(ms * MS, 1, 0, true));
            assert_eq!(judge.finish().has("switch-ignored"), is_ignored, "{off_ms}");
        }
    }

    #[test]
    fn a_switch_of_latches_alone_counts_while_the_board_says_that_it_runs() {
        // The latch is set from 100 to 120 ms, the switch never closes; somebody asks for the status.
        for (asked_ms, stopped_ms, inputs, is_ignored) in
            [(190, 0, 0, true), (155, 0, 0, false), (190, 0, 8, false), (190, 130, 0, false), (190, 90, 0, false)]
        {
            let mut judge = judge(Some(1));
            judge.on_interrupted(0);
            for ms in 1..200 {
                if ms == stopped_ms {
                    judge.on_interrupted(ms * MS);
                }
                judge.look(ms * MS, u64::from((100..120).contains(&ms)), inputs, true);
            }
            judge.on_running(200 * MS, asked_ms * MS, None);
            assert_eq!(judge.finish().has("switch-ignored"), is_ignored, "{asked_ms} {stopped_ms} {inputs}");
        }
    }

    #[test]
    fn a_program_of_latches_alone_counts_from_its_start() {
        for (started_ms, is_ignored) in [(100, true), (180, false)] {
            let mut judge = judge(Some(1));
            judge.on_play();
            (1..250).for_each(|ms| judge.look(ms * MS, u64::from((20..40).contains(&ms)), 0, true));
            judge.on_running(250 * MS, 230 * MS, Some(started_ms * MS));
            assert_eq!(judge.finish().has("switch-ignored"), is_ignored, "{started_ms}");
        }
    }

    #[test]
    fn a_contradiction_that_nothing_explains_is_a_false_one() {
        for (disturbed_ms, is_false) in [(None, true), (Some(100), true), (Some(900), false)] {
            let mut judge = judge(None);
            disturbed_ms.into_iter().for_each(|ms: u64| judge.on_disturbed(ms * MS));
            judge.on_fault(2_000 * MS, 1_000 * MS);
            assert_eq!(judge.finish().has("switch-false"), is_false, "{disturbed_ms:?}");
        }
    }
}
