//! What the firmware's library asks of a board: the B-L475E-IOT01A.
use cortex_m::peripheral::SCB;
use darm_core::units::DeviceId;
use darm_core::wire::bootstrap::RebootTarget;
use darm_firmware::control::Inputs;
use darm_firmware::crash::Kept;
use darm_firmware::hardware::{Hardware, Pins};
use darm_firmware::solenoid::{self, Chain};
use stm32_metapac::{Interrupt, UID};

use crate::emulated::emulated;
use crate::flash::Flash;
use crate::gpio::{ChainClock, ChainData, ChainEnable, ChainLatch, Switches, user_button_pressed};
use crate::pins::{CHAIN_ENABLE, SWITCHES};
use crate::time::BoardClock;
use crate::{restart, watchdog};

/// Interrupt that the control tick borrows; its peripheral (touch sensing) is not used.
pub const CONTROL: Interrupt = Interrupt::TSC;
/// Interrupt that the executor of everything else borrows; its peripheral (single wire protocol) is not used.
pub const COMMON: Interrupt = Interrupt::SWPMI1;

/// Start-up code neither clears nor fills this section.
#[unsafe(link_section = ".uninit.KEPT")]
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

/// The pins of the control tick.
pub struct BoardPins {
    chain: solenoid::Pins<ChainData, ChainClock, ChainLatch, ChainEnable>,
    switches: Switches,
}

impl BoardPins {
    /// Takes over the pins, outputs disabled.
    pub fn new() -> Self {
        let chain = solenoid::Pins {
            data: ChainData::new(false),
            clock: ChainClock::new(false),
            latch: ChainLatch::new(false),
            enable: ChainEnable::new(true),
        };
        Self { chain, switches: Switches::new() }
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

    #[inline(always)]
    fn set_enabled(&mut self, enabled: bool) {
        self.chain.set_enabled(enabled);
    }
}

impl Pins for BoardPins {
    #[inline(always)]
    fn inputs(&self) -> Inputs {
        Inputs { switches: self.switches.read(), button: user_button_pressed() }
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
