//! What the firmware's library asks of a board: the Olimex STM32-H405.
//!
//! | what          | pins                   | notes                                                               |
//! |---------------|------------------------|---------------------------------------------------------------------|
//! | console       | PA9, PA10              | USART1, 115 200 baud                                                |
//! | servo bus     | PA2                    | USART2, one wire with a pull-up                                     |
//! | output chain  | PA7, PA5, PA4, PB0     | data, clock, latch, output enable (active low, external pull-up)    |
//! | inputs 0 to 7 | PC0 to PC7             | pull-down, closed is high                                           |
//! | user button   | PA0                    | pressed is high                                                     |
use cortex_m::peripheral::SCB;
use darm_core::units::DeviceId;
use darm_core::wire::health::Health;
use darm_firmware::control::Inputs;
use darm_firmware::cortex;
use darm_firmware::crash::{self, Kept};
use darm_firmware::hardware::{Hardware, Pins};
use darm_firmware::solenoid::Chain;
use darm_firmware::sparse_flash::{PageMemory, SparseFlash};
use stm32_metapac::flash::vals::Latency;
use stm32_metapac::gpio::Gpio;
use stm32_metapac::gpio::vals::{Moder, Ot, Pupdr};
use stm32_metapac::iwdg::vals::{Key, Pr};
use stm32_metapac::rcc::vals::{Pllm, Plln, Pllp, Pllq, Ppre, Sw};
use stm32_metapac::{FLASH, GPIOA, GPIOB, GPIOC, IWDG, RCC, UID};

use crate::time;

const INPUTS: usize = 8;
const DATA: (Gpio, usize) = (GPIOA, 7);
const CLOCK: (Gpio, usize) = (GPIOA, 5);
const LATCH: (Gpio, usize) = (GPIOA, 4);
const ENABLE: (Gpio, usize) = (GPIOB, 0);
/// USART1 and USART2 are alternate function 7 (DS8626, table 9).
const AF_USART: u8 = 7;

/// Start-up code neither clears nor fills this section.
#[unsafe(link_section = ".uninit.KEPT")]
static KEPT: Kept = Kept::new();

/// Pages of the flash that the core-coupled memory has room for.
const PAGES: usize = 23;

/// In place of the chip's own flash, which erases 16 to 128 KiB at once and stops the processor meanwhile.
#[unsafe(link_section = ".above.FLASH_MODEL")]
static FLASH_MODEL: PageMemory<PAGES> = PageMemory::new();

/// The board.
pub(crate) struct Board;

impl Hardware for Board {
    const NAME: &'static str = "STM32-H405";
    const INPUTS: u8 = INPUTS as u8;
    /// The loader starts by the jumper BOOT0 alone.
    const GUARDS_LOADER: bool = false;
    type Clock = time::BoardClock;
    const CLOCK: time::BoardClock = time::CLOCK;
    type Pins = BoardPins;
    type Flash = SparseFlash<PAGES>;

    /// In QEMU, which has none, it spells what it is.
    fn device() -> DeviceId {
        if emulated() {
            return DeviceId(*b"qemu-stm32f4");
        }
        let mut id = DeviceId::default();
        for (bytes, word) in id.0.chunks_exact_mut(4).zip(0..) {
            bytes.copy_from_slice(&UID.uid(word).read().to_le_bytes());
        }
        id
    }

    fn health() -> Health {
        cortex::health()
    }

    fn open_flash() -> Option<SparseFlash<PAGES>> {
        // SAFETY: the console task alone opens the flash, once.
        Some(unsafe { FLASH_MODEL.open() })
    }

    fn feed_watchdog() {
        IWDG.kr().write(|w| w.set_key(Key::RESET));
    }

    fn disable_outputs() {
        cortex_m::interrupt::disable();
        set(ENABLE, true);
    }

    fn reset() -> ! {
        SCB::sys_reset()
    }

    fn is_button_closed() -> bool {
        GPIOA.idr().read().0 & 1 == 1
    }

    fn kept() -> &'static Kept {
        &KEPT
    }
}

/// Brings the core to [`HCLK_HZ`](crate::time::HCLK_HZ) from the 16 MHz internal oscillator, and clocks what is in use. RM0090, chapter 7.
pub(crate) fn start_clocks() {
    RCC.ahb1enr().modify(|w| {
        w.set_gpioaen(true);
        w.set_gpioben(true);
        w.set_gpiocen(true);
    });
    RCC.apb2enr().modify(|w| w.set_usart1en(true));
    RCC.apb1enr().modify(|w| w.set_usart2en(true));
    if emulated() {
        return;
    }
    FLASH.acr().modify(|w| {
        w.set_latency(Latency::WS5);
        w.set_icen(true);
        w.set_dcen(true);
    });
    // What is not named stays 0: the source is the internal oscillator.
    RCC.pllcfgr().write(|w| {
        w.set_pllm(Pllm::DIV16);
        w.set_plln(Plln::MUL336);
        w.set_pllp(Pllp::DIV2);
        w.set_pllq(Pllq::DIV7);
    });
    RCC.cr().modify(|w| w.set_pllon(true));
    require(|| RCC.cr().read().pllrdy());
    RCC.cfgr().modify(|w| {
        w.set_ppre1(Ppre::DIV4);
        w.set_ppre2(Ppre::DIV2);
        w.set_sw(Sw::PLL1_P);
    });
    require(|| RCC.cfgr().read().sws() == Sw::PLL1_P);
}

/// True in QEMU, which models neither flash controller nor oscillator: the option register reads 0 there and never on silicon.
fn emulated() -> bool {
    FLASH.optcr().read().0 == 0
}

fn require(condition: impl Fn() -> bool) {
    if !(0..100_000).any(|_| condition()) {
        crash::give_up::<Board>(format_args!("the clock does not start"));
    }
}

/// Starts the watchdog: 400 counts of 32 kHz / 4 are 50 ms.
pub(crate) fn start_watchdog() {
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY4));
    IWDG.rlr().write(|w| w.set_rl(400));
}

/// Whether the watchdog caused the last reset; forgets it.
pub(crate) fn take_bite() -> bool {
    let bitten = RCC.csr().read().wdgrstf();
    RCC.csr().modify(|w| w.set_rmvf(true));
    bitten
}

/// Makes the pins what they are, outputs disabled.
pub(crate) fn start_pins() {
    set(ENABLE, true);
    for (port, pin) in [ENABLE, DATA, CLOCK, LATCH] {
        port.moder().modify(|w| w.set_moder(pin, Moder::OUTPUT));
    }
    for pin in 0..INPUTS {
        GPIOC.pupdr().modify(|w| w.set_pupdr(pin, Pupdr::PULL_DOWN));
    }
    for pin in [2, 9, 10] {
        GPIOA.pupdr().modify(|w| w.set_pupdr(pin, Pupdr::PULL_UP));
        GPIOA.afr(pin / 8).modify(|w| w.set_afr(pin % 8, AF_USART));
        GPIOA.moder().modify(|w| w.set_moder(pin, Moder::ALTERNATE));
    }
    GPIOA.otyper().modify(|w| w.set_ot(2, Ot::OPEN_DRAIN));
}

/// The pins of the control tick.
pub(crate) struct BoardPins;

fn set((port, pin): (Gpio, usize), high: bool) {
    port.bsrr().write(|w| if high { w.set_bs(pin, true) } else { w.set_br(pin, true) });
}

impl Chain for BoardPins {
    fn shift(&mut self, lines: u64) {
        for line in (0..u64::BITS).rev() {
            set(DATA, lines >> line & 1 == 1);
            set(CLOCK, true);
            set(CLOCK, false);
        }
        set(LATCH, true);
        set(LATCH, false);
    }

    fn set_enabled(&mut self, enabled: bool) {
        set(ENABLE, !enabled);
    }

    /// RM0090, 8.4.5: the input register has the level at the pin, of an output as well. The emulator has none.
    fn reads_disabled(&mut self) -> Option<bool> {
        let (port, pin) = ENABLE;
        (!emulated()).then(|| port.idr().read().0 >> pin & 1 == 1)
    }
}

impl Pins for BoardPins {
    fn inputs(&self) -> Inputs {
        Inputs {
            switches: GPIOC.idr().read().0 & ((1 << INPUTS) - 1),
            button: Board::is_button_closed(),
            ..Inputs::default()
        }
    }
}
