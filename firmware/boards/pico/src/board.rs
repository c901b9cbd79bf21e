//! What the firmware's library asks of a board: the Raspberry Pi Pico.
//!
//! | what                 | pins         | notes                                                                   |
//! |----------------------|--------------|-------------------------------------------------------------------------|
//! | console              | USB          | a serial port of class CDC                                              |
//! | servo bus            | GP0, GP1     | UART0: GP0 sends through 1 kΩ to the one wire, GP1 hears it              |
//! | output chain         | GP2 to GP5   | data, clock, latch, output enable (active low)                          |
//! | inputs 0 to 12       | GP6 to GP18  | pull-down, closed is high                                               |
//! | pulse to a camera    | GP19         | high for 1 ms at each row, where the profile has it                     |
//! | supply               | GP29         | a third of VSYS, by the board's own divider                             |
//! | jumper               | GP22         | pull-up, connected to ground is pressed                                 |
//!
//! After a reset every pin has a pull-down: output enable needs an external pull-up of 4.7 kΩ or less to hold the outputs
//! off until [`super::chain`] takes over.

use darm_core::profile::PICO;
use darm_core::units::{DeviceId, Micros};
use darm_core::wire::bootstrap::RebootTarget;
use darm_core::wire::health::Health;
use darm_firmware::clock::Clock;
use darm_firmware::control::Inputs;
use darm_firmware::cortex;
use darm_firmware::crash::Kept;
use darm_firmware::hardware::{Converted, Hardware, Pins};
use embassy_rp::pac;
use embassy_rp::rom_data::reset_to_usb_boot;
use embassy_time::{Instant, Timer};

use crate::chain::{Chain, ENABLE};
use crate::flash::{Flash, unique_id};
use crate::{adc, servos, watchdog};

const FIRST_INPUT: usize = 6;
const INPUTS: usize = 13;
const JUMPER: usize = 22;
/// Pulse to a camera.
const SYNC: usize = 19;

/// The number in the name of a pin, `GP5`; none where it is named otherwise.
const fn number(name: &str) -> usize {
    let digits = match name.as_bytes() {
        [b'G', b'P', digits @ ..] => digits,
        _ => return usize::MAX,
    };
    let (mut number, mut index) = (0, 0);
    while index < digits.len() {
        number = 10 * number + (digits[index] - b'0') as usize;
        index += 1;
    }
    number
}

/// A host knows the pins that this firmware drives.
const _: () = {
    assert!(PICO.inputs.len() == INPUTS);
    let mut input = 0;
    while input < INPUTS {
        assert!(number(PICO.inputs[input]) == FIRST_INPUT + input);
        input += 1;
    }
    // Those of the chain and of the bus are types of the hardware layer: `main` takes PIN_2 to PIN_5 and PIN_0.
    assert!(
        number(PICO.enable) == ENABLE
            && number(PICO.button) == JUMPER
            && number(PICO.sync) == SYNC
            && number(PICO.servo_bus) == 0
    );
    assert!(number(PICO.data) == 2 && number(PICO.clock) == 3 && number(PICO.latch) == 4);
};

/// Start-up code neither clears nor fills this section.
#[unsafe(link_section = ".uninit.KEPT")]
static KEPT: Kept = Kept::new();

/// The board.
pub(crate) struct Board;

/// The clock of the tasks.
#[derive(Clone, Copy)]
pub(crate) struct BoardClock;

impl Clock for BoardClock {
    fn now(&self) -> Micros {
        Micros(Instant::now().as_micros())
    }

    async fn wait_until(&self, at: Micros) {
        Timer::at(Instant::from_micros(at.0)).await;
    }
}

impl Hardware for Board {
    const NAME: &'static str = "Pico";
    const INPUTS: u8 = INPUTS as u8;
    /// The loader is a drive on the console's own cable.
    const GUARDS_LOADER: bool = true;
    type Clock = BoardClock;
    const CLOCK: BoardClock = BoardClock;
    type Pins = BoardPins;
    type Flash = Flash;

    /// The number of the flash chip, which every Pico has its own of.
    fn device() -> DeviceId {
        let mut id = DeviceId(*b"rp20\0\0\0\0\0\0\0\0");
        id.0.iter_mut().skip(4).zip(unique_id()).for_each(|(to, from)| *to = from);
        id
    }

    fn health() -> Health {
        Health { servo_bus: Some(servos::errors()), ..cortex::health() }
    }

    fn open_flash() -> Option<Flash> {
        Some(Flash::open())
    }

    fn feed_watchdog() {
        watchdog::feed(watchdog::PERIOD);
    }

    fn disable_outputs() {
        cortex_m::interrupt::disable();
        pac::SIO.gpio_out(0).value_set().write_value(1 << ENABLE);
    }

    /// The watchdog resets all but the oscillators, which a reset of the core alone does not.
    fn reset() -> ! {
        watchdog::reset()
    }

    fn is_button_closed() -> bool {
        is_jumper_closed()
    }

    fn restart(into: RebootTarget) -> ! {
        Self::disable_outputs();
        if into == RebootTarget::Loader {
            reset_to_usb_boot(0, 0);
        }
        Self::reset()
    }

    fn kept() -> &'static Kept {
        &KEPT
    }
}

/// Forbids all accesses to the 16 MiB below the stack's memory, where nothing is in use: what overflows the stack faults, however far.
/// Without it such an access goes to an address of the flash interface that the data sheet does not describe.
pub(crate) fn guard_stack() {
    /// MPU_RASR (ARMv6-M, B3.5.9): no execution, no access, 2²⁴ bytes, enabled.
    const NOTHING: u32 = 1 << 28 | 23 << 1 | 1;
    /// MPU_RBAR: the base, and the region in the same write.
    const BELOW: u32 = 0x1f00_0000 | 1 << 4;
    /// MPU_CTRL: the other addresses are as without it; it is off in the handlers of hard fault and NMI.
    const ON: u32 = 1 << 2 | 1;
    // SAFETY: called once at the start; nothing else uses the MPU, and what lies in the region is never accessed on purpose.
    unsafe {
        let core = cortex_m::Peripherals::steal();
        core.MPU.rbar.write(BELOW);
        core.MPU.rasr.write(NOTHING);
        core.MPU.ctrl.write(ON);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Makes switches and jumper readable.
pub(crate) fn start_inputs() {
    for pin in (FIRST_INPUT..FIRST_INPUT + INPUTS).chain([JUMPER]) {
        pac::PADS_BANK0.gpio(pin).modify(|w| {
            w.set_ie(true);
            w.set_pue(pin == JUMPER);
            w.set_pde(pin != JUMPER);
        });
        pac::IO_BANK0.gpio(pin).ctrl().write(|w| w.set_funcsel(pac::io::vals::Gpio0ctrlFuncsel::SIO_0 as u8));
    }
}

fn is_jumper_closed() -> bool {
    pac::SIO.gpio_in(0).read() >> JUMPER & 1 == 0
}

/// The pins of the control tick.
pub(crate) struct BoardPins(Chain, adc::Converter);

impl BoardPins {
    /// Takes the chain, outputs disabled.
    pub(crate) fn new(chain: Chain) -> Self {
        Self(chain, adc::Converter::default())
    }
}

impl darm_firmware::solenoid::Chain for BoardPins {
    fn shift(&mut self, lines: u64) {
        self.0.shift(lines);
    }

    fn set_enabled(&mut self, enabled: bool) {
        self.0.set_enabled(enabled);
    }

    fn is_stuck(&self) -> bool {
        self.0.is_stuck()
    }

    fn reads_disabled(&mut self) -> Option<bool> {
        Some(pac::SIO.gpio_in(0).read() >> ENABLE & 1 != 0)
    }
}

impl Pins for BoardPins {
    fn inputs(&self) -> Inputs {
        let levels = pac::SIO.gpio_in(0).read();
        Inputs {
            switches: levels >> FIRST_INPUT & ((1 << INPUTS) - 1),
            button: is_jumper_closed(),
            ..Inputs::default()
        }
    }

    fn convert(&mut self) -> Option<Converted> {
        self.1.convert()
    }

    /// The pin becomes an output with the first pulse, which rises behind the lines of its row: the chain takes 25 µs.
    fn set_sync(&mut self, high: bool) {
        let sio = pac::SIO;
        if high {
            self.0.await_latch();
            sio.gpio_out(0).value_set().write_value(1 << SYNC);
            sio.gpio_oe(0).value_set().write_value(1 << SYNC);
            pac::IO_BANK0.gpio(SYNC).ctrl().write(|w| w.set_funcsel(pac::io::vals::Gpio0ctrlFuncsel::SIO_0 as u8));
        } else {
            sio.gpio_out(0).value_clr().write_value(1 << SYNC);
        }
    }
}
