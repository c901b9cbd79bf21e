//! How long the control tick takes and interrupts are masked, in core cycles of the emulated SysTick; how late ticks are.
//!
//! Under `-icount shift=6` an instruction lasts 64 ns, 5.12 cycles at 80 MHz, so cycles give exact instructions.
//! SysTick alone preempts the control tick; what its handler takes is not counted as the tick's.
use core::fmt::Display;
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering};

use cortex_m_semihosting::{debug, hprintln};
use darm_core::sequencer::Outputs;
use darm_core::units::Micros;

use crate::time::cycles;

static TICK: Longest = Longest::new();
static MASKED: Longest = Longest::new();
static HANDLER: Longest = Longest::new();
static MASKED_FROM: AtomicU32 = AtomicU32::new(0);
/// Cycles spent in the SysTick handler so far.
static PREEMPTED: AtomicU32 = AtomicU32::new(0);
static LINES_SEEN: AtomicU32 = AtomicU32::new(0);
static ENABLED: AtomicBool = AtomicBool::new(false);
static ENABLES: AtomicU32 = AtomicU32::new(0);

struct Longest(AtomicU32);

impl Longest {
    const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    fn note(&self, cycles: u32) {
        if cycles > self.0.load(Ordering::Relaxed) {
            self.0.store(cycles, Ordering::Relaxed);
        }
    }
}

/// The longest of each so far, in instructions.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Control tick.
    pub tick: u32,
    /// Stretch with masked interrupts.
    pub masked: u32,
    /// SysTick handler.
    pub handler: u32,
    /// Lines 0 to 31 that were high at some time.
    pub lines_seen: u32,
    /// How often output enable went low: at least once a program, unless a fault is latched.
    pub enables: u32,
}

/// Ends the run as failed unless `holds`.
pub fn check(what: &str, holds: bool) {
    if !holds {
        hprintln!("failed: {}", what);
        debug::exit(debug::EXIT_FAILURE);
    }
}

/// Prints a figure of something.
pub fn print(of: &str, name: impl Display, value: impl Display, unit: &str) {
    hprintln!("{}.{} {} {}", of, name, value, unit);
}

/// Reads the longest of each and starts again.
pub fn take() -> Measured {
    let instructions = |longest: &Longest| (longest.0.swap(0, Ordering::Relaxed) * 25 + 64) / 128;
    Measured {
        tick: instructions(&TICK),
        masked: instructions(&MASKED),
        handler: instructions(&HANDLER),
        lines_seen: LINES_SEEN.swap(0, Ordering::Relaxed),
        enables: ENABLES.swap(0, Ordering::Relaxed),
    }
}

/// How many instructions `work` takes, the SysTick handler left out; no other interrupt may be at work.
pub fn instructions(work: impl FnOnce()) -> u32 {
    let (began, preempted) = begin_tick();
    work();
    let taken = PREEMPTED.load(Ordering::Relaxed).wrapping_sub(preempted);
    let cycles = cycles().wrapping_sub(began).wrapping_sub(taken);
    (u64::from(cycles) * 25 / 128) as u32
}

/// Start of a tick: the time, and what preemption took before.
pub(crate) fn begin_tick() -> (u32, u32) {
    (cycles(), PREEMPTED.load(Ordering::Relaxed))
}

pub(crate) fn end_tick((began, preempted): (u32, u32), outputs: &Outputs) {
    let taken = PREEMPTED.load(Ordering::Relaxed).wrapping_sub(preempted);
    TICK.note(cycles().wrapping_sub(began).wrapping_sub(taken));
    LINES_SEEN.fetch_or(outputs.lines as u32, Ordering::Relaxed);
    if !ENABLED.swap(outputs.enabled, Ordering::Relaxed) && outputs.enabled {
        ENABLES.fetch_add(1, Ordering::Relaxed);
    }
}

pub(crate) fn begin_masked() {
    MASKED_FROM.store(cycles(), Ordering::Relaxed);
}

pub(crate) fn end_masked() {
    MASKED.note(cycles().wrapping_sub(MASKED_FROM.load(Ordering::Relaxed)));
}

/// The SysTick handler ran from `began` to now.
pub(crate) fn end_handler(began: u32) {
    let taken = cycles().wrapping_sub(began);
    HANDLER.note(taken);
    PREEMPTED.fetch_add(taken, Ordering::Relaxed);
}

/// How late ticks were, outside stores and during them.
pub static LATENESS: [Lateness; 2] = [const { Lateness::new() }; 2];
static STORING: AtomicBool = AtomicBool::new(false);
/// When the last store ended, in wrapping microseconds.
static STORED: AtomicU32 = AtomicU32::new(0);

/// Counts of ticks by their lateness.
pub struct Lateness([AtomicU16; Self::BINS]);

impl Lateness {
    const BINS: usize = 400;
    const BIN_US: u64 = 10;

    const fn new() -> Self {
        Self([const { AtomicU16::new(0) }; Self::BINS])
    }

    fn note(&self, late: Micros) {
        let bin = (late.0 / Self::BIN_US) as usize;
        self.0[bin.min(Self::BINS - 1)].fetch_add(1, Ordering::Relaxed);
    }

    /// Ticks that were counted.
    pub fn ticks(&self) -> u32 {
        self.0.iter().map(|bin| u32::from(bin.load(Ordering::Relaxed))).sum()
    }

    /// The lateness that this percentage of the ticks does not exceed, to 10 µs; what is later than 10 ms counts as
    /// 10 ms.
    pub fn percentile(&self, percent: u32) -> Micros {
        let wanted = (self.ticks() * percent).div_ceil(100);
        let mut seen = 0;
        let bin = self.0.iter().position(|bin| {
            seen += u32::from(bin.load(Ordering::Relaxed));
            seen >= wanted
        });
        Micros((bin.unwrap_or(0) as u64 + 1) * Self::BIN_US)
    }
}

/// A tick that was due then starts now. One that was due before a store ended counts as during it.
pub(crate) fn note_lateness(due: Micros, now: Micros) {
    let due_before_its_end = STORED.load(Ordering::Relaxed).wrapping_sub(due.0 as u32) < 1 << 31;
    let during = STORING.load(Ordering::Relaxed) || due_before_its_end;
    LATENESS[usize::from(during)].note(now - due);
}

/// The flash is written or erased from now on, or no more.
pub(crate) fn storing(begins: bool, now: Micros) {
    STORED.store(now.0 as u32, Ordering::Relaxed);
    STORING.store(begins, Ordering::Relaxed);
}
