//! The emulated Pico with its plant, without threads: somebody steps it, millisecond by millisecond.

use std::collections::VecDeque;
use std::io;
use std::path::Path;

use super::FLASH_FILE;
use super::emulator::{Emulator, Ended, Measured, PicoError, Report, hex};
use crate::in_process::Stepped;
use crate::plant::Plant;
use crate::plant::chain::{Chain, ChainPins};

/// Pins of the board; mirrors the table of the firmware's board.
const CHAIN: ChainPins = ChainPins { data: 2, clock: 3, latch: 4, enable: 5 };
const FIRST_INPUT: u8 = 6;
const INPUTS: u8 = 13;
const JUMPER: u8 = 22;
const SYNC: u8 = 19;
/// The chain: eight 74HC595.
const CHIPS: usize = 8;
/// Levels of the chain's pins while nothing drives them: the pull-up holds output enable high.
const RELEASED: u16 = 1 << CHAIN.enable;
/// One step.
const STEP_NS: u64 = 1_000_000;

/// When pins changed, in nanoseconds of [`Stepped::now_ns`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// Another level of an output line.
    pub lines: Vec<u64>,
    /// The pulse to a camera, with its level from then on.
    pub sync: Vec<(u64, bool)>,
}

/// The board with its plant.
pub struct PicoBench {
    emulator: Emulator,
    plant: Plant,
    chain: Chain,
    edges: Edges,
    to_host: VecDeque<u8>,
    now_ns: u64,
    /// Levels of the inputs as the emulator has them.
    shown: u32,
    ended: Option<Ended>,
    resets: u32,
    failure: Option<io::Error>,
}

impl PicoBench {
    /// Starts the image at `elf` on the flash in `folder`.
    ///
    /// # Errors
    ///
    /// The folder cannot be made, Node.js or the package is missing, or the emulator does not take the image.
    pub fn start(elf: &Path, folder: &Path, plant: Plant) -> Result<Self, PicoError> {
        std::fs::create_dir_all(folder)?;
        let mut emulator = Emulator::start(elf, &folder.join(FLASH_FILE))?;
        let levels = (0..INPUTS).map(|input| format!("pin {} 0\n", FIRST_INPUT + input)).collect::<String>();
        emulator.send(&format!("{levels}pin {JUMPER} 1\n"))?;
        let chain = Chain::new(CHAIN, CHIPS, RELEASED);
        let (to_host, failure) = (VecDeque::new(), None);
        Ok(Self {
            emulator,
            plant,
            chain,
            edges: Edges::default(),
            to_host,
            now_ns: 0,
            shown: 0,
            ended: None,
            resets: 0,
            failure,
        })
    }

    /// Lets the power fail within this operation of the flash from now on, 1 for the next; `noise` decides what it leaves.
    pub fn cut_within(&mut self, operation: u32, noise: u32) {
        self.command(&format!("cut {operation} {noise}\n"));
    }

    /// Presses the reset button: memory stays.
    pub fn press_reset(&mut self) {
        self.command("reset\n");
        self.ended = None;
    }

    /// Lets the watchdog reset the chip, as after a tick that does not end: memory stays.
    pub fn bite(&mut self) {
        self.command("bite\n");
        self.ended = None;
    }

    /// Closes or opens an input that the plant has nothing at.
    pub fn set_input(&mut self, input: u8, closed: bool) {
        self.command(&format!("pin {} {}\n", FIRST_INPUT + input, u8::from(closed)));
    }

    /// Lets the code that runs now panic.
    pub fn panic(&mut self) {
        self.command("panic\n");
    }

    /// Lets the code that runs now cause a hard fault while the stack pointer is there.
    pub fn hard_fault(&mut self, stack_pointer: u32) {
        self.command(&format!("fault {stack_pointer}\n"));
    }

    /// What a register of the chip holds; `None` where the emulator has failed.
    pub fn register(&mut self, address: u32) -> Option<u32> {
        let mut found = None;
        self.ask(&format!("peek {address}\n"), &mut |report| {
            if let Report::Word(word) = report {
                found = Some(word);
            }
        });
        found
    }

    /// Starts the image as the boot ROM does that has just written it: by its watchdog, with noise in memory.
    pub fn start_as_flashed(&mut self) {
        self.command("flashed\n");
        self.ended = None;
    }

    /// Connects output enable to ground, or removes that wire.
    pub fn short_enable(&mut self, shorted: bool) {
        self.command(&format!("short {} {}\n", CHAIN.enable, u8::from(shorted)));
    }

    /// Lets the state machine that drives the output chain stop, until the next start.
    pub fn freeze_chain(&mut self) {
        self.command("freeze\n");
    }

    /// Pulls the USB cable out and plugs it in again: the host resets and enumerates the board.
    pub fn replug(&mut self) {
        self.command("replug\n");
    }

    /// What has been counted since the last call.
    pub fn measure(&mut self) -> Measured {
        let mut measured = Measured::default();
        self.ask("measure\n", &mut |report| match report {
            Report::Stack(bytes) => measured.stack_bytes = bytes,
            Report::Ticks([ticks, instructions, cycles, waiting, cold, operations]) => {
                measured.ticks = ticks;
                (measured.longest_instructions, measured.longest_cycles) = (instructions, cycles);
                (measured.waiting_cycles, measured.cold_cycles) = (waiting, cold);
                measured.flash_operations = operations;
            }
            _ => {}
        });
        measured
    }

    /// Edges of the output lines and of the pulse to a camera since the last call.
    pub fn take_edges(&mut self) -> Edges {
        std::mem::take(&mut self.edges)
    }

    /// Why the chip does not run, if it does not.
    pub fn ended(&self) -> Option<Ended> {
        self.ended
    }

    /// Resets that the firmware or the watchdog has caused.
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Why the emulator has failed, if it has.
    pub fn failure(&self) -> Option<&io::Error> {
        self.failure.as_ref()
    }

    fn command(&mut self, lines: &str) {
        if self.failure.is_none() {
            self.failure = self.emulator.send(lines).err();
        }
    }

    fn ask(&mut self, line: &str, take: &mut dyn FnMut(Report)) {
        if self.failure.is_none() {
            self.failure = self.emulator.ask(line, take).err();
        }
    }

    /// Shows the plant's switches at the inputs.
    fn show_switches(&mut self) {
        let switches = self.plant.switches();
        let changed = (0..INPUTS).filter(|input| (switches ^ self.shown) >> input & 1 == 1);
        let lines = changed.map(|input| format!("pin {} {}\n", FIRST_INPUT + input, switches >> input & 1));
        let lines: String = lines.collect();
        self.shown = switches;
        if !lines.is_empty() {
            self.command(&lines);
        }
    }

    fn take(&mut self, report: Report) {
        match report {
            Report::Edge { at_ns, pin: SYNC, high } => self.edges.sync.push((at_ns, high)),
            Report::Edge { at_ns, pin, high } => {
                let before = self.chain.lines();
                if let Some(lines) = self.chain.edge(pin, high) {
                    self.plant.set_lines(1e-9 * at_ns as f64, lines);
                    self.edges.lines.extend((lines != before).then_some(at_ns));
                }
            }
            Report::Console(bytes) => self.to_host.extend(bytes),
            Report::Bus(bytes) => {
                let answer = self.plant.servo_bytes(1e-9 * self.now_ns as f64, &bytes);
                if !answer.is_empty() {
                    self.command(&format!("bus {}\n", hex(&answer)));
                }
            }
            Report::Reset => self.resets += 1,
            Report::Ended(ended) => self.ended = Some(ended),
            Report::Done { at_ns } => self.now_ns = at_ns.max(self.now_ns),
            Report::Stack(_) | Report::Ticks(_) | Report::Word(_) => {}
        }
    }
}

impl Stepped for PicoBench {
    fn step(&mut self) {
        let before_ns = self.now_ns;
        self.show_switches();
        let mut reports = Vec::new();
        self.ask(&format!("run {STEP_NS}\n"), &mut |report| reports.push(report));
        reports.into_iter().for_each(|report| self.take(report));
        // A board whose emulator has ended stays as it is while time passes.
        self.now_ns = self.now_ns.max(before_ns + STEP_NS / 2);
        self.plant.advance(1e-9 * self.now_ns as f64);
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
        self.command(&format!("console {}\n", hex(bytes)));
    }

    fn received(&mut self) -> &mut VecDeque<u8> {
        &mut self.to_host
    }

    fn hold_button(&mut self, pressed: bool) {
        self.command(&format!("pin {JUMPER} {}\n", u8::from(!pressed)));
    }

    fn power_cycle(&mut self) {
        self.command("power\n");
        self.ended = None;
        self.to_host.clear();
    }

    fn has_failed(&self) -> bool {
        self.failure.is_some()
    }
}
