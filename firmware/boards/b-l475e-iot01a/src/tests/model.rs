//! What registers and memory of the STM32L475 do, for tests of the drivers on a PC.
//!
//! Written from RM0351 (sections are those of its revision 9; where another revision counts differently, the title decides)
//! and from the errata sheet. The bits are typed from the manual, not taken from the crate that the drivers use. An access
//! that the manual forbids panics with the section that forbids it; an access that the manual answers with an error flag sets
//! that flag.
//!
//! Each access takes one cycle of the core's clock as it is set. Interrupts are not taken: a test asks for the request lines
//! and calls the handlers. The NMI is, behind the read that raises it; an end of the start is a panic.
pub(crate) mod adc;
pub(crate) mod dma;
pub(crate) mod flash;
pub(crate) mod gpio;
pub(crate) mod rcc;
pub(crate) mod usart;
pub(crate) mod watchdog;

use std::cell::RefCell;
use std::sync::atomic::AtomicU8;

pub(crate) use flash::{BANK_2, Ecc};
pub(crate) use rcc::Crystal;

use crate::bank2::on_nmi;

/// First address that [`dma_address`] gives.
const RAM: u32 = 0x2000_0000;
/// Bytes of address space for one memory of the DMA controller.
const RAM_STEP: u32 = 0x1000;

/// The chip.
pub(crate) struct Chip {
    /// Time since power-on, ns.
    pub(crate) now_ns: u64,
    pub(crate) rcc: rcc::Rcc,
    pub(crate) flash: flash::Flash,
    pub(crate) watchdog: watchdog::Watchdog,
    /// USART1 and USART2.
    pub(crate) usarts: [usart::Usart; 2],
    pub(crate) dma: dma::Dma,
    pub(crate) gpio: gpio::Gpio,
    pub(crate) adc: adc::Adc,
    /// SYSCFG_MEMRMP (RM0351, 9.2.1).
    pub(crate) remap: u32,
    is_reading: bool,
    memories: Vec<&'static [AtomicU8]>,
    /// Parts of a ns that accesses have taken.
    cycle_rest: f64,
}

thread_local! {
    static CHIP: RefCell<Chip> = RefCell::new(Chip::new());
}

/// Does something with this test's chip.
pub(crate) fn with<T>(work: impl FnOnce(&mut Chip) -> T) -> T {
    CHIP.with_borrow_mut(work)
}

/// Power-on: everything as after reset. A test begins with it.
pub(crate) fn power_on() {
    with(|chip| *chip = Chip::new());
}

/// Lets time pass.
pub(crate) fn pass_us(us: u64) {
    with(|chip| chip.pass(us * 1000));
}

/// Time since power-on, µs.
pub(crate) fn now_us() -> u64 {
    with(|chip| chip.now_ns / 1000)
}

pub(crate) fn load<T: Copy>(address: usize) -> T {
    let value = with(|chip| chip.load(address));
    assert_eq!(size_of::<T>(), 4, "registers are read as words");
    // SAFETY: the types of registers are one word, of which every pattern is valid.
    unsafe { core::mem::transmute_copy(&value) }
}

pub(crate) fn store<T: Copy>(address: usize, value: T) {
    assert_eq!(size_of::<T>(), 4, "registers are written as words");
    // SAFETY: as above.
    let value = unsafe { core::mem::transmute_copy(&value) };
    with(|chip| chip.store(address, value));
}

pub(crate) fn load_byte(address: usize) -> u8 {
    let (byte, raises_nmi) = with(|chip| {
        chip.tick();
        let nmis = chip.flash.nmis;
        (chip.flash.read(address), chip.flash.nmis > nmis)
    });
    if raises_nmi {
        on_nmi().expect("the start ends");
    }
    byte
}

pub(crate) fn note_reading(is_reading: bool) {
    with(|chip| chip.is_reading = is_reading);
}

pub(crate) fn is_reading() -> bool {
    with(|chip| chip.is_reading)
}

pub(crate) fn dma_address(memory: &'static [AtomicU8]) -> u32 {
    with(|chip| {
        chip.memories.push(memory);
        RAM + RAM_STEP * (chip.memories.len() as u32 - 1)
    })
}

pub(crate) fn delay(cycles: u32) {
    with(|chip| chip.pass_cycles(cycles));
}

pub(crate) fn pause() {
    delay(2);
}

impl Chip {
    fn new() -> Self {
        Self {
            now_ns: 0,
            rcc: rcc::Rcc::new(),
            flash: flash::Flash::new(),
            watchdog: watchdog::Watchdog::new(),
            usarts: [usart::Usart::new(), usart::Usart::new()],
            dma: dma::Dma::new(),
            gpio: gpio::Gpio::new(),
            adc: adc::Adc::new(),
            remap: 0,
            is_reading: false,
            memories: Vec::new(),
            cycle_rest: 0.0,
        }
    }

    fn tick(&mut self) {
        self.pass_cycles(1);
    }

    fn pass_cycles(&mut self, cycles: u32) {
        let ns = self.cycle_rest + f64::from(cycles) * 1e9 / self.rcc.hclk_hz();
        self.cycle_rest = ns.fract();
        self.pass(ns as u64);
    }

    /// Lets everything run that is not the core.
    fn pass(&mut self, ns: u64) {
        let end = self.now_ns + ns;
        loop {
            let due = self.usarts.iter().filter_map(usart::Usart::next_ns).min().filter(|due| *due <= end);
            self.now_ns = due.unwrap_or(end).max(self.now_ns);
            let now_ns = self.now_ns;
            self.rcc.pass(now_ns);
            self.flash.pass(now_ns);
            self.adc.pass(now_ns);
            self.watchdog.pass(now_ns);
            for usart in &mut self.usarts {
                usart.pass(now_ns);
            }
            self.serve_dma();
            if due.is_none() {
                return;
            }
        }
    }

    /// Moves what the receivers have to memory (RM0351, 11.4.3).
    fn serve_dma(&mut self) {
        for (usart, receiver) in self.usarts.iter_mut().zip(dma::RECEIVERS) {
            if usart.requests_dma()
                && let Some(address) = self.dma.take(receiver)
            {
                let (memory, offset) = ((address - RAM) / RAM_STEP, (address - RAM) % RAM_STEP);
                let byte = usart.read_data() as u8;
                self.memories[memory as usize][offset as usize].store(byte, core::sync::atomic::Ordering::Relaxed);
            }
        }
    }

    fn load(&mut self, address: usize) -> u32 {
        self.tick();
        let (block, offset) = (address & !0x3ff, address & 0x3ff);
        self.rcc.require_clock(block);
        match block {
            0x4000_3000 => self.watchdog.load(offset),
            0x4000_4400 => self.usarts[1].load(offset),
            0x4000_7000 => self.rcc.load_power(offset),
            0x4001_0000 if offset == 0 => self.remap,
            0x4001_3800 => self.usarts[0].load(offset),
            0x4002_0000 => self.dma.load(offset),
            0x4002_1000 => self.rcc.load(offset),
            0x4002_2000 => self.flash.load(offset),
            0x4800_0000..=0x4800_0c00 => self.gpio.load(address & 0xfff),
            0x5004_0000 => self.adc.load(offset),
            _ => panic!("read of {address:#010x}, which no model has"),
        }
    }

    fn store(&mut self, address: usize, value: u32) {
        self.tick();
        let (block, offset) = (address & !0x3ff, address & 0x3ff);
        self.rcc.require_clock(block);
        let now_ns = self.now_ns;
        match block {
            0x4000_3000 => self.watchdog.store(offset, value, now_ns),
            0x4000_4400 => self.usarts[1].store(offset, value, now_ns, self.rcc.hclk_hz()),
            0x4000_7000 => self.rcc.store_power(offset, value),
            0x4001_0000 if offset == 0 => self.remap = value,
            0x4001_3800 => self.usarts[0].store(offset, value, now_ns, self.rcc.hclk_hz()),
            0x4002_0000 => self.dma.store(offset, value),
            0x4002_1000 => self.rcc.store(offset, value, now_ns, self.flash.latency()),
            0x4002_2000 => self.flash.store(offset, value, now_ns),
            0x0800_0000..=0x080f_fc00 => self.flash.program(address, value, now_ns),
            0x4800_0000..=0x4800_0c00 => self.gpio.store(address & 0xfff, value),
            0x5004_0000 => self.adc.store(offset, value, now_ns),
            _ => panic!("write of {address:#010x}, which no model has"),
        }
        self.serve_dma();
    }
}

/// The clock of the tasks: each look at it takes a microsecond.
#[derive(Clone, Copy)]
pub(crate) struct ModelClock;

impl darm_firmware::clock::Clock for ModelClock {
    fn now(&self) -> darm_core::units::Micros {
        pass_us(1);
        darm_core::units::Micros(now_us())
    }

    async fn wait_until(&self, at: darm_core::units::Micros) {
        pass_us(at.0.saturating_sub(now_us()));
    }
}
