//! The driver on a chain of 74HC595, with and without its far end wired back.

use super::{Pins, REFRESH_TICKS, RETRIES, ReadBack, Solenoids};
use core::cell::Cell;
use core::convert::Infallible;
use darm_core::sequencer::{EnableLevel, FarEnd};
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

/// What a chain of 74HC595 does with the four wires.
#[derive(Default)]
struct Chain {
    levels: [Cell<bool>; 4],
    shifted: Cell<u64>,
    latched: Cell<u64>,
    edges: Cell<u32>,
    /// Lines that were high for a moment at least.
    shown: Cell<u64>,
    /// Shift registers up to the far end; 0 while nothing is wired to it.
    chips: Cell<u32>,
    /// The level that output enable has whatever drives it.
    shorted: Cell<Option<bool>>,
}

impl Chain {
    fn edge(&self, wire: usize, high: bool) {
        let rises = !self.levels[wire].replace(high) && high;
        self.edges.set(self.edges.get() + 1);
        if wire == 1 && rises {
            self.shifted.set(self.shifted.get() << 1 | u64::from(self.levels[0].get()));
        }
        if wire == 2 && rises {
            self.latched.set(self.shifted.get());
        }
        self.shown.set(self.shown.get() | self.outputs(64));
    }

    fn is_disabled(&self) -> bool {
        self.shorted.get().unwrap_or(self.levels[3].get())
    }

    fn outputs(&self, lines: u32) -> u64 {
        if self.is_disabled() { 0 } else { self.latched.get() & (u64::MAX >> (64 - lines)) }
    }
}

struct Wire<'a>(&'a Chain, usize);
impl ErrorType for Wire<'_> {
    type Error = Infallible;
}
impl OutputPin for Wire<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.edge(self.1, false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.edge(self.1, true);
        Ok(())
    }
}

impl InputPin for Wire<'_> {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        if self.1 == 3 {
            return Ok(self.0.is_disabled());
        }
        let chips = self.0.chips.get();
        Ok(chips > 0 && self.0.shifted.get() >> (8 * chips - 1) & 1 == 1)
    }
    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

/// A chain of this many chips with its far end wired back.
fn read_back(chain: &Chain, chips: u32) -> ReadBack<Wire<'_>, Wire<'_>, Wire<'_>, Wire<'_>, Wire<'_>> {
    chain.chips.set(chips);
    let wire = |index| Wire(chain, index);
    ReadBack::new(Pins { data: wire(0), clock: wire(1), latch: wire(2), enable: wire(3) }, wire(4))
}

#[test]
fn the_chips_of_a_chain_are_counted_with_the_outputs_disabled() {
    for chips in 1..=8 {
        let chain = Chain::default();
        assert_eq!(read_back(&chain, chips).chips(), Some(chips as u8));
        assert!(chain.levels[3].get() && chain.shifted.get() == 0);
    }
    assert_eq!(read_back(&Chain::default(), 0).chips(), None);
}

#[test]
fn a_chain_that_breaks_is_found_at_the_second_refresh_and_one_that_heals_is_whole() {
    for chips in [1, 2, 5, 8] {
        let chain = Chain::default();
        let mut solenoids = Solenoids::new(read_back(&chain, chips));
        let ticks = |solenoids: &mut Solenoids<_>, ticks: u8| (0..ticks).for_each(|_| solenoids.apply(0x5a, true));
        ticks(&mut solenoids, 2 * REFRESH_TICKS + 1);
        assert!(!solenoids.is_broken() && solenoids.errors() == 0);
        chain.chips.set(0);
        ticks(&mut solenoids, REFRESH_TICKS);
        assert!(!solenoids.is_broken() && solenoids.errors() == 1);
        ticks(&mut solenoids, 1);
        assert!(solenoids.is_broken());
        chain.chips.set(chips);
        ticks(&mut solenoids, 1);
        assert!(!solenoids.is_broken());
    }
}

#[test]
fn a_chip_that_is_missing_later_is_found() {
    let chain = Chain::default();
    let mut solenoids = Solenoids::new(read_back(&chain, 3));
    chain.chips.set(2);
    (0..=REFRESH_TICKS + 1).for_each(|_| solenoids.apply(0x01_00_5a, true));
    assert!(solenoids.is_broken());
}

#[test]
fn nothing_is_enabled_before_all_lines_were_shifted_low() {
    let chain = Chain::default();
    // What the registers hold after power-on.
    chain.latched.set(u64::MAX);
    let mut solenoids = solenoids(&chain);
    assert_eq!((chain.latched.get(), chain.outputs(64)), (0, 0));
    assert!(chain.levels[3].get() && solenoids.enable_stuck().is_none());
    solenoids.apply(0, true);
    assert_eq!((chain.levels[3].get(), chain.outputs(64)), (false, 0));
}

/// The supply of the chain comes back with anything in the registers.
#[test]
fn a_chain_that_loses_its_supply_while_no_line_is_high_shows_none_of_what_it_holds_then() {
    let chain = Chain::default();
    let mut solenoids = solenoids(&chain);
    for lines in [0b01, 0, 0b10] {
        if lines != 0 {
            chain.shifted.set(u64::MAX);
            chain.latched.set(u64::MAX);
        }
        chain.shown.set(0);
        solenoids.apply(lines, lines != 0);
        assert_eq!((chain.outputs(64), chain.shown.get()), (lines, lines), "not for a moment");
    }
    solenoids.apply(0, false);
    (0..2 * REFRESH_TICKS).for_each(|_| {
        chain.latched.set(u64::MAX);
        solenoids.apply(0, false);
        assert_eq!(chain.outputs(64), 0);
    });
}

/// The level that is found while lines are applied for some ticks and something holds output enable at a level.
fn stuck_after(
    chain: &Chain,
    solenoids: &mut OnChain<'_>,
    level: Option<bool>,
    lines: u64,
    ticks: u8,
) -> Option<EnableLevel> {
    chain.shorted.set(level);
    (0..ticks).for_each(|_| solenoids.apply(lines, lines != 0));
    solenoids.enable_stuck()
}

#[test]
fn output_enable_that_does_not_follow_is_found_at_either_level_in_the_second_tick() {
    let chain = Chain::default();
    chain.shorted.set(Some(false));
    assert_eq!(solenoids(&chain).enable_stuck(), Some(EnableLevel::Low), "at the start");
    chain.shorted.set(None);
    let mut solenoids = solenoids(&chain);
    let mut look = |level, lines, ticks| stuck_after(&chain, &mut solenoids, level, lines, ticks);
    assert_eq!(look(None, 0, 200), None);
    assert_eq!(look(Some(false), 0, 1), None, "a disturbance");
    assert_eq!(look(None, 0, 1), None);
    assert_eq!(look(Some(false), 0, 2), Some(EnableLevel::Low));
    assert_eq!(look(None, 0, 1), None, "it follows again");
    assert_eq!(look(None, 1, 1), None, "the first tick with a line drives the other level");
    assert_eq!(look(Some(true), 1, 2), Some(EnableLevel::High));
    assert_eq!(look(None, 1, 200), None);
    assert_eq!(look(Some(false), 1, 200), None, "that is the level that is driven");
}

#[test]
fn a_far_end_that_is_silent_at_the_start_is_asked_again_three_times_and_then_as_long_as_no_line_is_high() {
    let chain = Chain::default();
    let mut solenoids = Solenoids::new(read_back(&chain, 0));
    let mut refreshes = |count: u8, chips, lines: u64| {
        chain.chips.set(chips);
        // A tick for the pattern, and one for the begin.
        (0..count).for_each(|_| (0..REFRESH_TICKS + 2).for_each(|_| solenoids.apply(lines, lines != 0)));
        assert_eq!(chain.latched.get(), lines, "no pattern reaches the outputs");
        solenoids.far_end()
    };
    assert_eq!(refreshes(RETRIES - 1, 0, 0), FarEnd::Trying);
    assert_eq!(refreshes(1, 0, 0), FarEnd::Silent);
    assert_eq!(refreshes(2, 3, 1), FarEnd::Silent, "no count while a line is high");
    assert_eq!(refreshes(1, 3, 0), FarEnd::Chips(3));
    assert_eq!(refreshes(2, 0, 0), FarEnd::Chips(3), "one that breaks later is an error of the chain");
}

#[test]
fn a_far_end_that_answers_late_is_compared_from_then_on() {
    let chain = Chain::default();
    let mut solenoids = Solenoids::new(read_back(&chain, 0));
    chain.chips.set(2);
    (0..=REFRESH_TICKS).for_each(|_| solenoids.apply(0, false));
    assert_eq!(solenoids.far_end(), FarEnd::Chips(2));
    chain.chips.set(1);
    (0..=2 * REFRESH_TICKS).for_each(|_| solenoids.apply(0x5a, true));
    assert!(solenoids.is_broken());
}

/// A chain that something else than the processor drives.
#[derive(Default)]
struct Driven {
    stuck: bool,
    enabled: bool,
}

impl super::Chain for Driven {
    fn shift(&mut self, _: u64) {}
    fn is_stuck(&self) -> bool {
        self.stuck
    }
    fn set_enabled(&mut self, enabled: bool) {
        self.enabled = enabled;
    }
    fn reads_disabled(&mut self) -> Option<bool> {
        None
    }
}

#[test]
fn lines_that_do_not_reach_the_latch_are_an_error_in_the_second_tick() {
    let mut solenoids = Solenoids::new(Driven::default());
    solenoids.apply(1, true);
    solenoids.chain.stuck = true;
    solenoids.apply(2, true);
    assert!(!solenoids.is_broken());
    solenoids.apply(2, true);
    assert!(solenoids.is_broken() && solenoids.errors() == 2);
    (0..2 * u32::from(REFRESH_TICKS)).for_each(|_| solenoids.apply(2, true));
    assert!(solenoids.is_broken(), "no refresh hides it");
}

type OnChain<'a> = Solenoids<Pins<Wire<'a>, Wire<'a>, Wire<'a>, Wire<'a>>>;

fn solenoids(chain: &Chain) -> OnChain<'_> {
    let wire = |index| Wire(chain, index);
    Solenoids::new(Pins { data: wire(0), clock: wire(1), latch: wire(2), enable: wire(3) })
}

#[test]
fn lines_come_out_where_they_belong() {
    let chain = Chain::default();
    let mut solenoids = solenoids(&chain);
    solenoids.apply(0xa5_3c, true);
    assert_eq!(chain.outputs(16), 0xa5_3c);
    solenoids.apply(0x8000_0000_0000_0001, true);
    assert_eq!(chain.outputs(64), 0x8000_0000_0000_0001);
}

#[test]
fn nothing_is_driven_before_it_is_enabled() {
    let chain = Chain::default();
    let mut solenoids = solenoids(&chain);
    solenoids.apply(0xff, false);
    assert_eq!((chain.outputs(16), chain.latched.get() & 0xff), (0, 0xff));
}

#[test]
fn safe_takes_one_edge() {
    let chain = Chain::default();
    let mut solenoids = solenoids(&chain);
    solenoids.apply(0xff, true);
    let before = chain.edges.get();
    solenoids.safe();
    assert_eq!((chain.edges.get() - before, chain.outputs(16)), (1, 0));
}

#[test]
fn unchanged_lines_are_shifted_only_for_a_refresh() {
    let chain = Chain::default();
    let mut solenoids = solenoids(&chain);
    solenoids.apply(1, true);
    chain.shifted.set(u64::MAX);
    let before = chain.edges.get();
    (1..REFRESH_TICKS).for_each(|_| solenoids.apply(1, true));
    assert_eq!(chain.edges.get(), before);
    solenoids.apply(1, true);
    assert_eq!(chain.outputs(16), 1);
}

#[test]
fn no_line_beyond_the_table_ever_goes_high() {
    let chain = Chain::default();
    let mut solenoids = solenoids(&chain);
    (0..3).for_each(|_| {
        solenoids.apply(0xff, true);
        solenoids.apply(0x00, true);
        solenoids.apply(0xff, true);
    });
    assert_eq!(chain.outputs(24), 0xff, "a chain of three chips, a table of one");
}

#[test]
fn a_refresh_waits_for_the_tick_after_an_order_and_no_longer() {
    let chain = Chain::default();
    let mut solenoids = solenoids(&chain);
    solenoids.apply(1, true);
    let before = chain.edges.get();
    solenoids.set_busy(true);
    (0..REFRESH_TICKS).for_each(|_| solenoids.apply(1, true));
    assert_eq!(chain.edges.get(), before, "due, but the tick has obeyed an order");
    solenoids.apply(1, true);
    assert!(chain.edges.get() > before, "orders in every tick postpone it by one");
}
