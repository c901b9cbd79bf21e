//! What the firmware's library asks of a board: the B-L475E-IOT01A.
use core::sync::atomic::{AtomicU8, Ordering};

use cortex_m::peripheral::SCB;
use darm_core::units::DeviceId;
use darm_core::wire::bootstrap::RebootTarget;
use darm_core::wire::health::{ChainHealth, ClockSource, FlashErrors, Health, LineErrors, ResetCause};
use darm_firmware::control::Inputs;
use darm_firmware::cortex;
use darm_firmware::crash::Kept;
use darm_firmware::hardware::{Converted, Hardware, Pins};
use darm_firmware::solenoid::{self, Chain, ReadBack};
use embedded_hal::digital::OutputPin as _;
use stm32_metapac::{Interrupt, UID};

use crate::emulated::emulated;
use crate::flash::{self, Flash};
use crate::gpio::{ChainClock, ChainData, ChainEnable, ChainEnd, ChainLatch, Switches, Sync, user_button_pressed};
use crate::pins::{CHAIN_ENABLE, SWITCHES};
use crate::time::BoardClock;
use crate::watchdog::Cause;
use crate::{adc, bank2, clocks, options, restart, uart, usart, watchdog};

/// Interrupt that the control tick borrows; its peripheral (touch sensing) is not used.
pub const CONTROL: Interrupt = Interrupt::TSC;
/// Interrupt that the executor of everything else borrows; its peripheral (single wire protocol) is not used.
pub const COMMON: Interrupt = Interrupt::SWPMI1;

/// Start-up code neither clears nor fills this section. A reset leaves it alone unless the option byte SRAM2_RST has it erased.
#[unsafe(link_section = ".above.KEPT")]
static KEPT: Kept = Kept::new();

/// The board.
pub struct Board;

impl Hardware for Board {
    const NAME: &'static str = "B-L475E-IOT01A";
    const INPUTS: u8 = SWITCHES.len() as u8;
    /// The loader does not listen on the pins of the console.
    const GUARDS_LOADER: bool = false;
    type Clock = BoardClock;
    const CLOCK: BoardClock = BoardClock;
    type Pins = BoardPins;
    type Flash = Flash;

    /// In QEMU, which has none, it spells what it is.
    fn device() -> DeviceId {
        if emulated() {
            return DeviceId(*b"qemu-stm32l4");
        }
        let mut id = DeviceId::default();
        for (bytes, word) in id.0.chunks_exact_mut(4).zip(0..) {
            bytes.copy_from_slice(&UID.uid(word).read().to_le_bytes());
        }
        id
    }

    /// Where its far end is wired back, the chain says how long it is.
    fn lines() -> u8 {
        chips().map_or(Self::LINES, |chips| 8 * chips)
    }

    fn health() -> Health {
        let (damaged, _) = bank2::double_errors();
        flash::log_double_errors();
        Health {
            clock: (!emulated()).then(clock_source),
            reset: reset_cause(),
            console: Some(line_errors(uart::CONSOLE.errors())),
            servo_bus: Some(line_errors(uart::SERVOS.errors())),
            flash: Some(FlashErrors { corrected: bank2::corrected_errors(), damaged }),
            chain: chips().map(|chips| ChainHealth { chips, errors: 0 }),
            options: (!emulated()).then(options::read),
            ..cortex::health()
        }
    }

    fn open_flash() -> Option<Flash> {
        let flash = Flash::open();
        if let Err(error) = &flash {
            defmt::error!("no storage: {}", defmt::Debug2Format(error));
        }
        flash.ok()
    }

    fn feed_watchdog() {
        watchdog::feed();
    }

    /// Before start the output enable is an input with a pull-up, and stays so.
    fn disable_outputs() {
        cortex_m::interrupt::disable();
        CHAIN_ENABLE.port.bsrr().write(|w| w.set_bs(usize::from(CHAIN_ENABLE.index), true));
    }

    fn reset() -> ! {
        SCB::sys_reset()
    }

    fn is_button_closed() -> bool {
        user_button_pressed()
    }

    fn restart(into: RebootTarget) -> ! {
        restart::restart(into)
    }

    fn kept() -> &'static Kept {
        &KEPT
    }
}

/// Chips of the chain, 0 where its far end does not show it.
static CHIPS: AtomicU8 = AtomicU8::new(0);
/// What caused the reset, from [`note_cause`]; 0 before.
static CAUSE: AtomicU8 = AtomicU8::new(0);
const CAUSES: [ResetCause; 4] = [ResetCause::Supply, ResetCause::Watchdog, ResetCause::Firmware, ResetCause::Pin];

fn chips() -> Option<u8> {
    Some(CHIPS.load(Ordering::Relaxed)).filter(|chips| *chips > 0)
}

/// Notes what caused the reset, once at the start. The pin is low in every reset: it counts where nothing else does.
pub fn note_cause(cause: Cause) {
    let flags = [cause.supply, cause.watchdog, cause.firmware, true];
    let number = flags.iter().position(|is_set| *is_set).map_or(0, |index| index as u8 + 1);
    CAUSE.store(number, Ordering::Relaxed);
}

fn reset_cause() -> Option<ResetCause> {
    CAUSES.get(usize::from(CAUSE.load(Ordering::Relaxed)).wrapping_sub(1)).copied()
}

fn clock_source() -> ClockSource {
    match clocks::source() {
        clocks::Source::Crystal => ClockSource::Crystal,
        clocks::Source::Hsi16 => ClockSource::Internal,
        clocks::Source::Msi => ClockSource::CrystalLost,
    }
}

/// A bus error of the DMA channel loses what its ring has.
fn line_errors(errors: usart::LineErrors) -> LineErrors {
    let usart::LineErrors { overruns, framing, noise, dropped, dma } = errors;
    LineErrors { overruns, framing, noise, dropped: dropped.saturating_add(dma) }
}

fn note_chips(chain: &BoardChain) {
    CHIPS.store(chain.chips().unwrap_or(0), Ordering::Relaxed);
}

type BoardChain = ReadBack<ChainData, ChainClock, ChainLatch, ChainEnable, ChainEnd>;

/// The pins of the control tick.
pub struct BoardPins {
    chain: BoardChain,
    /// An output from the first pulse on.
    sync: Option<Sync>,
    switches: Switches,
    /// QEMU has none: there a profile with a threshold of the supply latches the safe state.
    converter: Option<adc::Converter>,
}

impl BoardPins {
    /// Takes over the pins, outputs disabled, and counts the chips of the chain.
    pub fn new() -> Self {
        let pins = solenoid::Pins {
            data: ChainData::new(false),
            clock: ChainClock::new(false),
            latch: ChainLatch::new(false),
            enable: ChainEnable::new(true),
        };
        let chain = ReadBack::new(pins, ChainEnd::new());
        note_chips(&chain);
        let converter = (!emulated()).then(|| adc::Converter::new(adc::factory()));
        Self { chain, sync: None, switches: Switches::new(), converter }
    }
}

impl Default for BoardPins {
    fn default() -> Self {
        Self::new()
    }
}

impl Chain for BoardPins {
    #[inline(always)]
    fn shift(&mut self, lines: u64) {
        self.chain.shift(lines);
    }

    fn verify(&mut self, lines: u64) -> Option<bool> {
        self.chain.verify(lines)
    }

    fn prime(&mut self) {
        self.chain.prime();
    }

    fn count(&mut self) -> Option<u8> {
        let chips = self.chain.count();
        note_chips(&self.chain);
        chips
    }

    #[inline(always)]
    fn set_enabled(&mut self, enabled: bool) {
        self.chain.set_enabled(enabled);
    }

    fn reads_disabled(&mut self) -> Option<bool> {
        self.chain.reads_disabled()
    }
}

impl Pins for BoardPins {
    #[inline(always)]
    fn inputs(&self) -> Inputs {
        Inputs { switches: self.switches.read(), button: user_button_pressed(), ..Inputs::default() }
    }

    fn convert(&mut self) -> Option<Converted> {
        self.converter.as_mut().map_or(Some(Converted::SupplyMv(0)), adc::Converter::convert)
    }

    fn set_sync(&mut self, high: bool) {
        let sync = self.sync.get_or_insert_with(|| Sync::new(high));
        let Ok(()) = if high { sync.set_high() } else { sync.set_low() };
    }
}

/// Sets the priorities of all interrupts in use. Call once, before any of them is unmasked.
pub fn prioritise() {
    use cortex_m::peripheral::scb::SystemHandler;
    // SAFETY: called once at start, with interrupts of these numbers still masked; nothing else owns the NVIC or SCB.
    unsafe {
        let mut core = cortex_m::Peripherals::steal();
        core.SCB.set_priority(SystemHandler::SysTick, 0x20);
        core.NVIC.set_priority(CONTROL, 0x40);
        for port in [Interrupt::USART1, Interrupt::DMA1_CHANNEL5, Interrupt::USART2, Interrupt::DMA1_CHANNEL6] {
            core.NVIC.set_priority(port, 0x80);
        }
        core.NVIC.set_priority(COMMON, 0xE0);
    }
}
