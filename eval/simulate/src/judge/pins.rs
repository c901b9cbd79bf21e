//! Judge 1, the lines: on-times, duty, supply, wiring, the safe state.

use std::collections::VecDeque;

use super::chain::{Chain, LATCH, Lines};
use super::{Ceilings, LatchCeiling, LineCeiling, Verdict};

const JUDGE: &str = "pins";
const MS: u64 = 1_000_000;
/// A limit is noticed and acted on within this time: each coil is looked at once in 8 ms, and the lines follow a tick
/// later.
const NOTICE_MS: u64 = 10;
/// A refresh is this much late at most: two ticks.
const REFRESH_SLACK_MS: u32 = 2;
/// From one peak of full current of a line to the next it takes at least this many times the length of either, as seen.
const PEAK_PERIODS: u64 = 10;
/// A peak that is shorter than the ceiling's may last this much longer than its table says: two late ticks.
const PEAK_LATE_MS: u64 = 2;
/// Its two times of going on may be nearer by a tick, in board time.
const PEAK_SLACK_MS: u64 = 1;
/// After the emergency stop is pressed the lines are off within this time, in board time: it is read once a tick.
const EMERGENCY_MS: u64 = 3;
/// A peak of full current, or a pulse of a latch, ends this much later than its length at most, in board time: two late ticks,
/// and the one in which it begins.
const BURST_LATE_MS: u64 = 3;
/// After the stated time of a fault the lines are off within this time, in board time.
const SAFE_MS: u64 = 2;

/// A chain that no longer returns what is shifted into it is noticed within this time, in board time: docs/safety.md, and two ticks.
const RETURN_MS: u64 = 302;

/// The judge's memory.
pub struct Pins {
    ceilings: Ceilings,
    /// The chain returned what was shifted into it when the firmware started.
    has_return: bool,
    /// Since when lines are on, and it does so no longer.
    unreturned_ns: Option<u64>,
    chain: Chain,
    lines: Lines,
    since_ns: [u64; 64],
    /// Spans in which each line was on, of those that still matter.
    spans: Vec<VecDeque<(u64, u64)>>,
    /// How often each line went on.
    rises: [u32; 64],
    /// Time between the last two times of going on of each line.
    apart_ns: [u64; 64],
    /// How long full current flowed in each line before it went off last, ms; 0 where the line carries none.
    peak_ms: [u64; 64],
    /// When loads went on lately.
    fed: VecDeque<(u64, u8)>,
    /// When lines were all off, as times of change: to off at even, to on at odd indices.
    changes: Vec<u64>,
    latched_ns: u64,
    started_ns: u64,
    verdict: Verdict,
}

impl Pins {
    /// A board that has just got its power.
    pub fn new(ceilings: Ceilings) -> Self {
        Self {
            ceilings,
            has_return: true,
            unreturned_ns: None,
            chain: Chain::default(),
            lines: Lines::default(),
            since_ns: [0; 64],
            spans: vec![VecDeque::new(); 64],
            rises: [0; 64],
            apart_ns: [u64::MAX; 64],
            peak_ms: [0; 64],
            fed: VecDeque::new(),
            changes: vec![0],
            latched_ns: 0,
            started_ns: 0,
            verdict: Verdict::default(),
        }
    }

    /// Whether output enable is low: the lines are driven.
    pub fn is_driven(&self) -> bool {
        self.chain.is_driven()
    }

    /// Lines that are high for certain.
    pub fn high(&self) -> u64 {
        self.lines.high
    }

    /// How often a line went on.
    pub fn rises(&self, line: u8) -> u32 {
        self.rises[usize::from(line) % 64]
    }

    /// How often all lines but these have gone high.
    pub fn rises_of_others(&self, lines: u64) -> u32 {
        (0..64u8).filter(|line| lines >> line & 1 == 0).map(|line| self.rises(line)).sum()
    }

    /// The longest time that a line was on, of those that have begun since then, ns.
    pub fn longest_on_ns(&self, now_ns: u64, line: u8, since_ns: u64) -> u64 {
        let spans = self.spans_until(usize::from(line) % 64, now_ns).filter(|(start, _)| *start >= since_ns);
        spans.map(|(start, end)| end - start).max().unwrap_or(0)
    }

    /// The lines that were on from before the one time until after the other, ns.
    pub fn on_over(&self, from_ns: u64, to_ns: u64) -> u64 {
        let is_over =
            |index: &usize| self.spans_until(*index, u64::MAX).any(|(start, end)| start < from_ns && end > to_ns);
        (0..64).filter(is_over).fold(0, |lines, index| lines | 1 << index)
    }

    /// Begin and end of each span in which a line was on, of one that lasts until then.
    fn spans_until(&self, index: usize, end_ns: u64) -> impl Iterator<Item = (u64, u64)> {
        let present = (self.lines.high >> index & 1 == 1).then_some((self.since_ns[index], end_ns));
        self.spans[index].iter().copied().chain(present)
    }

    /// When the firmware started last, ns.
    pub fn started_ns(&self) -> u64 {
        self.started_ns
    }

    /// True time that a span of the board's clock lasts, ns.
    pub fn true_us_ns(&self, board_us: u64) -> u64 {
        self.ceilings.true_us_ns(board_us)
    }

    /// An edge at a pin of the chain.
    pub fn on_edge(&mut self, now_ns: u64, pin: u8, high: bool) {
        if !self.chain.edge(pin, high) {
            return;
        }
        if pin == LATCH {
            self.check_refresh(now_ns);
            self.latched_ns = now_ns;
        }
        self.look(now_ns);
    }

    /// The flash lets nothing run: nobody would switch a line off in time.
    pub fn on_pause(&mut self, now_ns: u64) {
        let high = self.lines.high;
        if high != 0 {
            self.verdict.note(JUDGE, "flash-under-current", now_ns, || {
                format!("lines {high:#018x} are on while the flash lets no control tick run")
            });
        }
    }

    /// The lines were on since the last latching and longer than they may be without another one.
    fn check_refresh(&mut self, now_ns: u64) {
        let (gap_ns, refresh_ms) = (now_ns - self.latched_ns, self.ceilings.refresh_ms);
        let allowed_ns = self.ceilings.true_ns(u64::from(refresh_ms + REFRESH_SLACK_MS));
        if self.lines.high != 0 && gap_ns > allowed_ns {
            self.verdict.note(JUDGE, "refresh", now_ns, || {
                format!("lines were on for {} ms without being shifted again, allowed are {refresh_ms}", gap_ns / MS)
            });
        }
    }

    /// The firmware starts, with or without a pause of the supply.
    pub fn on_start(&mut self, now_ns: u64, power_was_off: bool) {
        self.chain.release();
        if power_was_off {
            self.chain.forget();
        }
        self.started_ns = now_ns;
        self.look(now_ns);
    }

    /// The firmware has started, and the chain returns what is shifted into it, or does not.
    pub fn on_first_return(&mut self, has_return: bool) {
        self.has_return = has_return;
    }

    /// The end of a tick in which the chain returns what is shifted into it, or does not.
    pub fn on_return(&mut self, now_ns: u64, has_return: bool) {
        // The chips are counted in the first tick after a start: cut in that tick, the return is taken for one that nobody has wired.
        self.has_return &= has_return || now_ns > self.started_ns + 2 * MS;
        let is_missed = self.has_return && !has_return && self.lines.high != 0;
        self.unreturned_ns = if is_missed { self.unreturned_ns.or(Some(now_ns)) } else { None };
        let Some(since_ns) = self.unreturned_ns.filter(|since_ns| now_ns - since_ns > self.ceilings.true_ns(RETURN_MS))
        else {
            return;
        };
        self.verdict.note(JUDGE, "chain-unreturned", now_ns, || {
            format!("lines are on, and for {} ms the chain has not returned them", (now_ns - since_ns) / MS)
        });
    }

    /// The supply fails.
    pub fn on_power_off(&mut self, now_ns: u64) {
        self.chain.forget();
        self.look(now_ns);
    }

    /// The firmware panicked.
    pub fn on_panic(&mut self, now_ns: u64, message: &str) {
        self.verdict.note(JUDGE, "panic", now_ns, || format!("the firmware panicked: {message}"));
    }

    /// The board reports that it found a fault at `at_us` of the board's clock, in its present start.
    pub fn on_fault_report(&mut self, now_ns: u64, at_us: u64) {
        let board_ms = at_us.div_ceil(1000) + SAFE_MS;
        let limit_ns = self.started_ns + self.ceilings.true_ns(board_ms);
        if limit_ns > now_ns {
            return;
        }
        let before = self.changes.iter().take_while(|&&at| at <= limit_ns).count();
        if before % 2 == 0 {
            self.verdict.note(JUDGE, "safe-state", limit_ns, || {
                format!("a line is on {SAFE_MS} ms after the board found a fault at {} ms of its clock", at_us / 1000)
            });
        }
    }

    /// The end of a tick.
    pub fn on_tick_end(&mut self, now_ns: u64) {
        if self.chain.is_driven() && self.lines.high == 0 {
            self.verdict.note(JUDGE, "idle-enable", now_ns, || "output enable is low, and no line is high".to_owned());
        }
    }

    /// The end of a tick in which the emergency stop was pressed, since then.
    pub fn on_emergency_stop(&mut self, now_ns: u64, since_ns: u64) {
        let (pressed_ns, lines) = (now_ns.saturating_sub(since_ns), self.lines.high);
        if lines != 0 && pressed_ns > self.ceilings.true_ns(EMERGENCY_MS) {
            self.verdict.note(JUDGE, "emergency-stop", now_ns, || {
                format!("the lines {lines:#x} are on {} ms after the emergency stop was pressed", pressed_ns / MS)
            });
        }
    }

    /// The end of the run.
    pub fn finish(mut self, now_ns: u64) -> Verdict {
        self.check_refresh(now_ns);
        self.chain.forget();
        self.look(now_ns);
        self.verdict
    }

    fn look(&mut self, now_ns: u64) {
        let (before, now) = (self.lines, self.chain.lines());
        self.lines = now;
        if now.unknown & !before.unknown != 0 {
            let line = now.unknown.trailing_zeros();
            self.verdict.note(JUDGE, "undefined", now_ns, || {
                format!("line {line} is driven with what its register held at power-on: nobody shifted it")
            });
        }
        for line in bits(before.high & !now.high) {
            self.fall(now_ns, line);
        }
        let rising = now.high & !before.high;
        for line in bits(rising) {
            self.rise(now_ns, line);
        }
        if rising != 0 {
            self.count_fed(now_ns, rising);
            self.check_latches(now_ns);
        }
        if (before.high == 0) != (now.high == 0) {
            self.changes.push(now_ns);
        }
    }

    fn rise(&mut self, now_ns: u64, line: usize) {
        if self.rises[line] > 0 {
            self.apart_ns[line] = now_ns - self.since_ns[line];
            self.check_peak(now_ns, line, self.peak_ms[line]);
        }
        self.since_ns[line] = now_ns;
        self.rises[line] += 1;
        if self.ceilings.lines[line].is_none() {
            self.verdict.note(JUDGE, "wiring", now_ns, || format!("line {line} goes high, and nothing is wired there"));
        }
    }

    /// The time from one peak to the next against the length of either, also over tables, resets and power cuts. The
    /// length is that of the line, so no table can say another.
    fn check_peak(&mut self, now_ns: u64, line: usize, peak_ms: u64) {
        let (apart_ns, min_ms) = (self.apart_ns[line], PEAK_PERIODS * peak_ms);
        if peak_ms > 0 && apart_ns < self.ceilings.true_ns(min_ms.saturating_sub(PEAK_SLACK_MS)) {
            self.verdict.note(JUDGE, "peak-share", now_ns, || {
                format!("line {line} carries full current again after {} ms, least are {min_ms}", apart_ns / MS)
            });
        }
    }

    /// How long full current has flowed in a line that goes off after this time, ms.
    fn peak_ms(&self, line: usize, on_ns: u64) -> u64 {
        let longest_ms = self.ceilings.lines[line].map_or(0, |ceiling| u64::from(ceiling.peak_ms));
        if on_ns >= self.ceilings.true_ns(longest_ms) {
            return longest_ms;
        }
        (on_ns / MS).saturating_sub(PEAK_LATE_MS)
    }

    fn fall(&mut self, now_ns: u64, line: usize) {
        let Some(ceiling) = self.ceilings.lines[line] else { return };
        let on_ns = now_ns - self.since_ns[line];
        self.check_burst(now_ns, line, ceiling.peak_ms, on_ns);
        self.peak_ms[line] = if ceiling.peak_ms > 0 { self.peak_ms(line, on_ns) } else { 0 };
        self.check_peak(now_ns, line, self.peak_ms[line]);
        let allowed_ns = self.ceilings.true_ns(u64::from(ceiling.max_on_ms) + NOTICE_MS);
        if on_ns > allowed_ns {
            self.verdict.note(JUDGE, "on-time", now_ns, || {
                format!("line {line} was on for {} ms, allowed are {}", on_ns / MS, ceiling.max_on_ms)
            });
        }
        self.spans[line].push_back((self.since_ns[line], now_ns));
        self.check_duty(now_ns, line, ceiling);
    }

    /// Full current, and the pulse of a latch, last no longer than the profile says.
    fn check_burst(&mut self, now_ns: u64, line: usize, peak_ms: u32, on_ns: u64) {
        let is_own = |latch: &&LatchCeiling| [latch.set, latch.reset].map(usize::from).contains(&line);
        let pulse_ms = self.ceilings.latches.iter().find(is_own).map_or(0, |latch| latch.pulse_ms);
        for (burst_ms, rule) in [(peak_ms, "peak-length"), (pulse_ms, "latch-pulse")] {
            if burst_ms > 0 && on_ns > self.ceilings.true_ns(u64::from(burst_ms) + BURST_LATE_MS) {
                self.verdict.note(JUDGE, rule, now_ns, || {
                    format!("line {line} was on for {} ms, its peak or pulse lasts {burst_ms}", on_ns / MS)
                });
            }
        }
    }

    /// A latch is set or reset, never both at once.
    fn check_latches(&mut self, now_ns: u64) {
        let high = self.lines.high;
        let both = |latch: &&LatchCeiling| high >> latch.set & high >> latch.reset & 1 == 1;
        if let Some(LatchCeiling { set, reset, .. }) = self.ceilings.latches.iter().find(both).copied() {
            self.verdict.note(JUDGE, "latch-both", now_ns, || {
                format!("line {set} sets a latch and line {reset} resets it at the same time")
            });
        }
    }

    /// Whether the supply feeds this number of further loads now.
    pub fn has_supply(&self, now_ns: u64, loads: usize) -> bool {
        let window_ns = self.ceilings.true_ns(u64::from(self.ceilings.budget_ms) + NOTICE_MS);
        let has_started = now_ns.saturating_sub(self.started_ns) > window_ns;
        let fed = self.fed.iter().filter(|&&(at, _)| at + window_ns > now_ns).count();
        has_started && fed + loads <= self.ceilings.new_loads.into()
    }

    /// The end of a tick in which nothing may be driven.
    pub fn on_forbidden(&mut self, now_ns: u64, rule: &'static str, why: &str) {
        let lines = self.lines.high;
        if lines != 0 {
            self.verdict.note(JUDGE, rule, now_ns, || format!("the lines {lines:#x} are on {why}"));
        }
    }

    /// On-time in the window that ends now; the largest is one that ends where the line goes off.
    fn check_duty(&mut self, now_ns: u64, line: usize, ceiling: LineCeiling) {
        let window_ns = self.ceilings.true_ns(u64::from(ceiling.window_ms));
        let from_ns = now_ns.saturating_sub(window_ns);
        let spans = &mut self.spans[line];
        while spans.front().is_some_and(|&(_, end)| end <= from_ns) {
            spans.pop_front();
        }
        let on_ns: u64 = spans.iter().map(|&(start, end)| end - start.max(from_ns)).sum();
        let share_ms = u64::from(ceiling.window_ms) * u64::from(ceiling.duty_percent) / 100;
        if ceiling.duty_percent < 100 && on_ns > self.ceilings.true_ns(share_ms + NOTICE_MS) {
            let rule = if self.started_ns > from_ns && self.started_ns > 0 { "duty-over-reset" } else { "duty" };
            self.verdict.note(JUDGE, rule, now_ns, || {
                let (on_ms, window_ms) = (on_ns / MS, ceiling.window_ms);
                format!("line {line} was on for {on_ms} ms of {window_ms} ms, allowed are {share_ms}")
            });
        }
    }

    /// Loads that are newly switched on: lines of one load in one instant count once.
    fn count_fed(&mut self, now_ns: u64, rising: u64) {
        // A tick and the error of the clock are the board's to lose.
        let window_ns = self.ceilings.true_ns(u64::from(self.ceilings.budget_ms).saturating_sub(1));
        let mut loads: Vec<u8> =
            bits(rising).filter_map(|line| self.ceilings.lines[line]).map(|line| line.load).collect();
        loads.sort_unstable();
        loads.dedup();
        self.fed.extend(loads.into_iter().map(|load| (now_ns, load)));
        while self.fed.front().is_some_and(|&(at, _)| at + window_ns <= now_ns) {
            self.fed.pop_front();
        }
        let (count, allowed) = (self.fed.len(), self.ceilings.new_loads);
        if count > usize::from(allowed) {
            self.verdict.note(JUDGE, "supply", now_ns, || {
                format!("{count} loads went on within {} ms, the supply feeds {allowed}", self.ceilings.budget_ms)
            });
        }
    }
}

fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize)?;
        mask &= mask - 1;
        Some(bit)
    })
}

#[cfg(test)]
mod tests;
