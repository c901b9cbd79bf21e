//! Pins as the drivers want them: outputs of the solenoid chain, limit switches as one number, the user button.
use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};
use stm32_metapac::gpio::Gpio;
use stm32_metapac::gpio::vals::{Moder, Ot, Pupdr};

use crate::pins::{CHAIN, Pin, SWITCHES, USER_BUTTON};

/// A push-pull output: the pin of [`CHAIN`] with this number. The pin is in the type, so that an edge is one store.
pub struct Output<const LINE: usize>(());

/// Serial data into the chain.
pub type ChainData = Output<0>;
/// Shift clock of the chain.
pub type ChainClock = Output<1>;
/// Latch of the chain.
pub type ChainLatch = Output<2>;
/// Output enable of the chain, active low.
pub type ChainEnable = Output<3>;

impl<const LINE: usize> Output<LINE> {
    const PIN: Pin = CHAIN[LINE];

    /// Takes over the pin at the given level, without a glitch: the level is set before the direction.
    pub fn new(high: bool) -> Self {
        let mut output = Self(());
        output.drive(high);
        let (port, n) = (Self::PIN.port, usize::from(Self::PIN.index));
        port.otyper().modify(|w| w.set_ot(n, Ot::PUSH_PULL));
        port.moder().modify(|w| w.set_moder(n, Moder::OUTPUT));
        output
    }

    fn drive(&mut self, high: bool) {
        // Bits 0 to 15 set, bits 16 to 31 reset.
        let set = 1 << (Self::PIN.index & 15);
        Self::PIN.port.bsrr().write(|w| w.0 = if high { set } else { set << 16 });
        // A 74HC595 at 3.3 V wants a clock pulse of about 40 ns; two stores follow each other in 25 ns.
        cortex_m::asm::nop();
        cortex_m::asm::nop();
    }
}

impl<const LINE: usize> ErrorType for Output<LINE> {
    type Error = Infallible;
}
impl<const LINE: usize> OutputPin for Output<LINE> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.drive(false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.drive(true);
        Ok(())
    }
}

/// The limit switches of [`SWITCHES`] with their pull-downs.
pub struct Switches(());

impl Switches {
    /// Makes the pins inputs that read open when nothing is connected.
    pub fn new() -> Self {
        SWITCHES.into_iter().for_each(|pin| make_input(pin, Pupdr::PULL_DOWN));
        Self(())
    }

    /// Closed switches, bit by bit in the order of the table.
    pub fn read(&self) -> u32 {
        SWITCHES.iter().enumerate().fold(0, |closed, (bit, pin)| {
            let level = pin.port.idr().read().0 >> pin.index & 1;
            closed | level << bit
        })
    }
}

impl Default for Switches {
    fn default() -> Self {
        Self::new()
    }
}

/// Makes the user button readable. Once, at start: before that its pin is analog, which reads as pressed.
pub fn start_user_button() {
    make_input(USER_BUTTON, Pupdr::PULL_UP);
}

/// Whether a person presses the user button now. Not debounced: a caller that waits for a press reads it for 20 ms.
pub fn user_button_pressed() -> bool {
    USER_BUTTON.port.idr().read().0 >> USER_BUTTON.index & 1 == 0
}

fn make_input(Pin { port, index }: Pin, pull: Pupdr) {
    let n = usize::from(index);
    port.pupdr().modify(|w| w.set_pupdr(n, pull));
    port.moder().modify(|w| w.set_moder(n, Moder::INPUT));
}

/// Hands a pin to its alternate function.
pub(crate) fn alternate(pin: Pin, function: u8, kind: Ot, pull: Pupdr) {
    let (port, n): (Gpio, usize) = (pin.port, usize::from(pin.index));
    port.otyper().modify(|w| w.set_ot(n, kind));
    port.pupdr().modify(|w| w.set_pupdr(n, pull));
    port.afr(n / 8).modify(|w| w.set_afr(n % 8, function));
    port.moder().modify(|w| w.set_moder(n, Moder::ALTERNATE));
}
