//! Judge 1, the supply of the board: where the profile has a threshold, nothing is driven while the supply is low, and a supply
//! that is good, or dips once in a while, latches nothing.
//!
//! The judge sees the supply itself, tick by tick while the firmware runs, never what the converter reports.

use std::collections::VecDeque;

use super::{Ceilings, Verdict};

const JUDGE: &str = "pins";
const MS: u64 = 1_000_000;
/// After this number of ticks in a row with a low supply nothing is driven: five measurements 10 ms apart, and their ticks.
const LOW_TICKS: u64 = 60;
/// The same where it was low for more than `MAX_LOW_TICKS` of this number of ticks: a tenth of 2 s, where the board states a twentieth.
const WINDOW_TICKS: u64 = 2_000;
const MAX_LOW_TICKS: u64 = 200;
/// A supply that was low for no more than `DIP_MS` in the last `DIP_WINDOW_MS` is no fault, in board time: a motor that starts.
const DIP_MS: u64 = 40;
const DIP_WINDOW_MS: u64 = 900;

/// The judge's memory.
pub struct BoardSupply {
    ceilings: Ceilings,
    /// Ticks since the start.
    ticks: u64,
    /// From which tick to which it was low, not before somebody left the safe state last.
    low: VecDeque<(u64, u64)>,
    /// Ticks in a row in which it is low.
    in_a_row: u64,
    /// From when to when it was low in this run, ns.
    spans_ns: Vec<(u64, u64)>,
    verdict: Verdict,
}

impl BoardSupply {
    /// A board that has just got its power.
    pub fn new(ceilings: Ceilings) -> Self {
        let (low, spans_ns) = (VecDeque::new(), Vec::new());
        Self { ceilings, ticks: 0, low, in_a_row: 0, spans_ns, verdict: Verdict::default() }
    }

    /// The firmware starts.
    pub fn on_start(&mut self) {
        self.low.clear();
        self.in_a_row = 0;
    }

    /// Somebody asks for the safe state to be left: what a short dip adds to counts again from now on.
    pub fn on_cleared(&mut self) {
        self.low.clear();
    }

    /// The end of a tick in which the firmware ran; whether nothing may be driven. `is_in_force`: its profile is in force for certain, as it
    /// may be before.
    pub fn look(&mut self, now_ns: u64, is_low: bool, is_in_force: bool) -> bool {
        if is_low {
            match self.spans_ns.last_mut().filter(|(_, end_ns)| *end_ns + 2 * MS > now_ns) {
                Some((_, end_ns)) => *end_ns = now_ns,
                None => self.spans_ns.push((now_ns.saturating_sub(MS), now_ns)),
            }
        }
        if !is_in_force {
            return false;
        }
        self.ticks += 1;
        if is_low {
            self.note_low();
        } else {
            self.in_a_row = 0;
            if self.low.is_empty() {
                return false;
            }
        }
        let from = self.ticks.saturating_sub(WINDOW_TICKS);
        while self.low.front().is_some_and(|&(_, end)| end <= from) {
            self.low.pop_front();
        }
        let low: u64 = self.low.iter().map(|&(start, end)| end - start.max(from)).sum();
        self.in_a_row >= LOW_TICKS || low > MAX_LOW_TICKS
    }

    fn note_low(&mut self) {
        self.in_a_row += 1;
        match self.low.back_mut().filter(|(_, end)| *end + 1 == self.ticks) {
            Some((_, end)) => *end = self.ticks,
            None => self.low.push_back((self.ticks - 1, self.ticks)),
        }
    }

    /// The board reports at this true time that its supply is low.
    pub fn on_fault(&mut self, now_ns: u64, fault_ns: u64) {
        let from_ns = fault_ns.saturating_sub(self.ceilings.true_ns(DIP_WINDOW_MS));
        let low = |&(start_ns, end_ns): &(u64, u64)| end_ns.min(fault_ns + MS).saturating_sub(start_ns.max(from_ns));
        let low_ns: u64 = self.spans_ns.iter().map(low).sum();
        if low_ns <= self.ceilings.true_ns(DIP_MS) {
            self.verdict.note(JUDGE, "supply-false", now_ns, || {
                let low_ms = low_ns / MS;
                format!("the board reports a low supply, which was low for {low_ms} ms of the last {DIP_WINDOW_MS} ms")
            });
        }
    }

    /// The end of the run.
    pub fn finish(self) -> Verdict {
        self.verdict
    }
}

#[cfg(test)]
mod tests {
    use super::super::Ceilings;
    use super::{BoardSupply, MS};

    fn judge() -> BoardSupply {
        let (lines, latches, servos) = ([None; 64], Vec::new(), Vec::new());
        BoardSupply::new(Ceilings {
            lines,
            latches,
            servos,
            new_loads: 1,
            budget_ms: 10,
            refresh_ms: 100,
            clock_ppm: 0,
        })
    }

    /// Whether nothing may be driven after spans of a low and a good supply in turn, ms each.
    fn must_be_off(judge: &mut BoardSupply, spans_ms: &[u64]) -> bool {
        let (mut now_ms, mut is_off) = (0, false);
        for (index, span_ms) in spans_ms.iter().enumerate() {
            for _ in 0..*span_ms {
                now_ms += 1;
                is_off = judge.look(now_ms * MS, index % 2 == 0, true);
            }
        }
        is_off
    }

    #[test]
    fn a_supply_that_stays_low_or_collapses_again_and_again_lets_nothing_be_driven() {
        assert!(!must_be_off(&mut judge(), &[59]));
        assert!(must_be_off(&mut judge(), &[60]));
        assert!(!must_be_off(&mut judge(), &[60, 1]), "a single dip of 60 ms");
        assert!(!must_be_off(&mut judge(), &[40, 40].repeat(5)));
        assert!(must_be_off(&mut judge(), &[40, 40].repeat(6)));
        assert!(!must_be_off(&mut judge(), &[40, 960].repeat(9)), "a dip each second");
    }

    #[test]
    fn after_the_safe_state_was_left_dips_count_again_and_a_low_supply_goes_on() {
        let mut judge = judge();
        assert!(must_be_off(&mut judge, &[300, 10]));
        judge.on_cleared();
        assert!(!judge.look(311 * MS, false, true));
        assert!(must_be_off(&mut judge, &[100]));
        judge.on_cleared();
        assert!(judge.look(412 * MS, true, true));
    }

    #[test]
    fn a_fault_of_the_supply_is_false_where_it_only_dipped() {
        for (spans_ms, is_false) in
            [(&[0, 500][..], true), (&[40, 960, 40], true), (&[50, 1], false), (&[40, 40, 20], false), (&[900], false)]
        {
            let mut judge = judge();
            must_be_off(&mut judge, spans_ms);
            let now_ns = spans_ms.iter().sum::<u64>() * MS;
            judge.on_fault(now_ns, now_ns);
            assert_eq!(judge.finish().has("supply-false"), is_false, "{spans_ms:?}");
        }
    }
}
