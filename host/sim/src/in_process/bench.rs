//! The board with its plant, without threads: somebody steps it, tick by tick, and sees what its pins do.

use std::collections::VecDeque;
use std::future::Future;
use std::pin::Pin as Pinned;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use darm_core::units::Micros;
use darm_core::wire::bootstrap::RebootTarget;
use darm_firmware::control::TICK;

use super::Stepped;
use super::board::{self, ChainFaults, Outliving, Pin, Wires};
use super::flash::MemoryFlash;
use crate::plant::Plant;
use crate::plant::chain::{Chain, ChainPins};

/// The chain of this board: eight 74HC595, 64 lines.
const CHIPS: usize = 8;
const CHAIN: ChainPins =
    ChainPins { data: Pin::Data as u8, clock: Pin::Clock as u8, latch: Pin::Latch as u8, enable: Pin::Enable as u8 };
/// Levels of the chain's pins while nothing drives them.
const RELEASED: u16 = 1 << Pin::Enable as u8;
/// How often the tasks are polled within a tick: a search for a word works in pieces of a quarter of a millisecond.
const POLLS: usize = 4;
/// True time of one tick of a board whose clock is right.
const TICK_NS: u64 = TICK.0 * 1000;

/// What happened at the board's pins, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Physical {
    /// A pin of the chain changed.
    Edge(Pin, bool),
    /// Bytes on the servo bus.
    Bus {
        /// From the board to the servos.
        to_servos: bool,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// The firmware starts again: all pins are released, the registers of the chain stay as they are.
    Reset,
    /// The firmware enters the chip's loader; it starts again, for there is none here.
    Loader,
    /// The power goes off or comes back; what the registers of the chain hold then is undefined.
    Power(bool),
}

/// A board with its plant.
pub struct Bench {
    /// Nothing runs without power.
    firmware: Option<Pinned<Box<dyn Future<Output = RebootTarget>>>>,
    wires: Rc<Wires>,
    flash: MemoryFlash,
    memory: Outliving,
    button: bool,
    supply_mv: Option<u16>,
    plant: Plant,
    chain: Chain,
    /// Bytes from the host that the board has not fetched.
    to_board: VecDeque<u8>,
    to_host: VecDeque<u8>,
    now_ns: u64,
    tick_ns: u64,
    polls: usize,
    /// Bytes for the host that leave in a tick.
    pace: usize,
    chain_faults: ChainFaults,
    /// Chips of the chain.
    chips: u8,
    /// For this time the flash lets nothing run.
    paused: Micros,
    /// Switch inputs that read the opposite of the plant's switches.
    inverted: u32,
    edges: Vec<(Pin, bool)>,
    happened: Vec<Physical>,
}

impl Bench {
    /// A board that has just got its power. Its clock is right.
    pub fn new(plant: Plant, flash: MemoryFlash) -> Self {
        let (wires, memory) = (Rc::new(Wires::default()), Outliving::blank());
        Self {
            firmware: Some(Box::pin(board::run(wires.clone(), flash.clone(), memory.clone()))),
            wires,
            flash,
            memory,
            button: false,
            supply_mv: None,
            plant,
            chain: Chain::new(CHAIN, CHIPS, RELEASED),
            to_board: VecDeque::new(),
            to_host: VecDeque::new(),
            now_ns: 0,
            tick_ns: TICK_NS,
            polls: POLLS,
            pace: usize::MAX,
            chain_faults: ChainFaults::default(),
            chips: CHIPS as u8,
            paused: Micros(0),
            inverted: 0,
            edges: Vec::new(),
            happened: vec![Physical::Power(true)],
        }
    }

    /// Lets the board's clock run fast by this many parts per million, slow if negative; at most ±10 %.
    pub fn set_clock_error(&mut self, ppm: i32) {
        let ppm = i64::from(ppm.clamp(-100_000, 100_000));
        self.tick_ns = TICK_NS * 1_000_000 / (1_000_000 + ppm) as u64;
    }

    /// True time of one tick, ns.
    pub fn tick_ns(&self) -> u64 {
        self.tick_ns
    }

    /// Polls the tasks so often within a tick, at least once. Fewer are faster, and a search for a word takes longer.
    pub fn set_polls(&mut self, polls: usize) {
        self.polls = polls.max(1);
    }

    /// No more bytes for the host leave in a tick than this; 12 at 115 200 baud.
    pub fn set_pace(&mut self, bytes: usize) {
        self.pace = bytes;
    }

    /// The flash lets nothing run, for this tick at least.
    pub fn is_paused(&self) -> bool {
        self.paused >= TICK
    }

    /// True time since the beginning; a power cut does not set it back.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// The same in seconds.
    pub fn now_s(&self) -> f64 {
        1e-9 * self.now_ns as f64
    }

    /// What hangs on the board.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// What hangs on the board, to break or repair it.
    pub fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// Its flash.
    pub fn flash(&self) -> &MemoryFlash {
        &self.flash
    }

    /// True while the firmware runs.
    pub fn is_powered(&self) -> bool {
        self.firmware.is_some()
    }

    /// What has happened at the pins since it was taken last.
    pub fn take_happened(&mut self) -> std::vec::Drain<'_, Physical> {
        self.happened.drain(..)
    }

    /// Switch inputs that read the opposite of what the plant's switches say, from now on.
    pub fn invert_switches(&mut self, inputs: u32) {
        self.inverted = inputs;
    }

    /// A person holds the user button, or releases it.
    pub fn hold_button(&mut self, pressed: bool) {
        self.button = pressed;
        self.wires.button.set(pressed);
    }

    /// The board measures its supply, which is this from now on, mV. Before the first step: a board that never did so at its start
    /// takes no profile with a threshold.
    pub fn set_supply(&mut self, mv: u16) {
        self.supply_mv = Some(mv);
        self.wires.supply_mv.set(self.supply_mv);
    }

    /// Breaks or repairs what is between the board and its chain, from now on.
    pub fn break_chain(&mut self, faults: ChainFaults) {
        self.chain_faults = faults;
        self.wires.faults.set(faults);
    }

    /// The chain has this number of chips, 1 to 8, in place of 8: where its far end is wired back the board counts them.
    pub fn set_chips(&mut self, chips: u8) {
        self.chips = chips;
        self.wires.chips.set(chips);
    }

    /// What is wrong between the board and its chain.
    pub fn chain_faults(&self) -> ChainFaults {
        self.chain_faults
    }

    /// Limit switches as the board's pins show them: bit `i` is input `i`, set when closed.
    pub fn inputs(&self) -> u32 {
        self.wires.switches.get()
    }

    /// Whether the contact of the user button is closed.
    pub fn is_button_closed(&self) -> bool {
        self.button
    }

    /// Bytes from the host.
    pub fn send(&mut self, bytes: &[u8]) {
        self.to_board.extend(bytes);
    }

    /// Bytes for the host.
    pub fn received(&mut self) -> &mut VecDeque<u8> {
        &mut self.to_host
    }

    /// Bytes from the servos, or from whatever disturbs their bus.
    pub fn send_bus(&mut self, bytes: &[u8]) {
        self.wires.bus_in.push_slice(bytes);
        self.happened.push(Physical::Bus { to_servos: false, bytes: bytes.to_vec() });
    }

    /// Starts the firmware again on the same flash.
    pub fn reset(&mut self) {
        self.release();
        self.happened.push(Physical::Reset);
        self.start();
    }

    /// Cuts the power: RAM is lost, flash and plant stay.
    pub fn power_off(&mut self) {
        self.release();
        self.memory = Outliving::blank();
        self.happened.push(Physical::Power(false));
    }

    /// Gives the power back. `noise` is what the chain's registers hold.
    pub fn power_on(&mut self, noise: u64) {
        self.flash.restore();
        self.chain = Chain::new(CHAIN, CHIPS, RELEASED);
        for bit in (0..64).rev() {
            self.chain.edge(CHAIN.data, noise >> bit & 1 == 1);
            self.chain.edge(CHAIN.clock, true);
            self.chain.edge(CHAIN.clock, false);
        }
        self.chain.edge(CHAIN.data, false);
        self.chain.edge(CHAIN.latch, true);
        self.chain.edge(CHAIN.latch, false);
        self.happened.push(Physical::Power(true));
        self.start();
    }

    fn start(&mut self) {
        self.wires.button.set(self.button);
        self.wires.supply_mv.set(self.supply_mv);
        self.wires.faults.set(self.chain_faults);
        self.wires.chips.set(self.chips);
        let firmware = board::run(self.wires.clone(), self.flash.clone(), self.memory.clone());
        self.firmware = Some(Box::pin(firmware));
    }

    /// Nothing drives the pins any more.
    fn release(&mut self) {
        self.firmware = None;
        self.paused = Micros(0);
        self.flash.take_pause();
        self.wires = Rc::new(Wires::default());
        self.chain.edge(CHAIN.enable, true);
        self.to_board.clear();
        self.to_host.clear();
        let now_s = self.now_s();
        self.plant.set_lines(now_s, 0);
    }

    /// One tick of the board and of everything around it.
    pub fn step(&mut self) {
        self.now_ns += self.tick_ns;
        if self.firmware.is_some() {
            self.wires.clock.advance(TICK);
        }
        self.flash.advance(TICK);
        if self.firmware.is_none() {
            // What is sent to a board without power is lost.
            self.to_board.clear();
        } else if !self.to_board.is_empty() {
            let sent = self.to_board.make_contiguous();
            let taken = self.wires.console_in.push_slice(sent);
            self.to_board.drain(..taken);
        }
        let ended = self.poll();
        self.drive_plant();
        let wires = &self.wires;
        self.to_host.extend(std::iter::from_fn(|| wires.console_out.pop()).take(self.pace));
        if self.firmware.is_some() && self.flash.has_failed() {
            self.power_off();
        } else if let Some(into) = ended {
            // There is no chip's loader here: the firmware starts either way.
            if into == RebootTarget::Loader {
                self.happened.push(Physical::Loader);
            }
            let answers = std::mem::take(&mut self.to_host);
            self.reset();
            self.to_host = answers;
        }
    }

    /// What the firmware asks to be restarted into.
    fn poll(&mut self) -> Option<RebootTarget> {
        let firmware = self.firmware.as_mut()?;
        if self.paused >= TICK {
            self.paused = Micros(self.paused.0 - TICK.0);
            return None;
        }
        let mut context = Context::from_waker(Waker::noop());
        for _ in 0..self.polls {
            if let Poll::Ready(into) = firmware.as_mut().poll(&mut context) {
                return Some(into);
            }
            self.paused = self.paused + self.flash.take_pause();
            if self.paused >= TICK {
                break;
            }
        }
        None
    }

    fn drive_plant(&mut self) {
        let now_s = self.now_s();
        self.wires.take_edges(&mut self.edges);
        let mut lines = None;
        for (pin, high) in self.edges.drain(..) {
            lines = self.chain.edge(pin as u8, high).or(lines);
            self.happened.push(Physical::Edge(pin, high));
        }
        match lines {
            Some(lines) => self.plant.set_lines(now_s, lines),
            None => self.plant.advance(now_s),
        }
        self.wires.switches.set(self.plant.switches() ^ self.inverted);
        if self.wires.bus_out.is_empty() {
            return;
        }
        let wires = &self.wires;
        let bytes: Vec<u8> = std::iter::from_fn(|| wires.bus_out.pop()).collect();
        let answer = self.plant.servo_bytes(now_s, &bytes);
        self.happened.push(Physical::Bus { to_servos: true, bytes });
        if !answer.is_empty() {
            self.send_bus(&answer);
        }
    }
}

impl Stepped for Bench {
    /// Nobody looks at the pins.
    fn step(&mut self) {
        Bench::step(self);
        self.happened.clear();
    }

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    fn send(&mut self, bytes: &[u8]) {
        Bench::send(self, bytes);
    }

    fn received(&mut self) -> &mut VecDeque<u8> {
        &mut self.to_host
    }

    fn hold_button(&mut self, pressed: bool) {
        Bench::hold_button(self, pressed);
    }

    fn power_cycle(&mut self) {
        self.power_off();
        self.power_on(0);
    }
}
