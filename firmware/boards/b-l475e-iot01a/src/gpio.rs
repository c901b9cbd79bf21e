//! Pins as the drivers want them: outputs of the solenoid chain, limit switches as one number, the user button.
use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use stm32_metapac::gpio::vals::{Moder, Ospeedr, Ot, Pupdr};

use crate::bus;
use crate::pins::{CHAIN_END, OUTPUTS, Pin, SWITCHES, USER_BUTTON};

/// A push-pull output: the pin of [`OUTPUTS`] with this number. The pin is in the type, so that an edge is one store.
pub struct Output<const LINE: usize>(());

/// Serial data into the chain.
pub type ChainData = Output<0>;
/// Shift clock of the chain.
pub type ChainClock = Output<1>;
/// Latch of the chain.
pub type ChainLatch = Output<2>;
/// Output enable of the chain, active low.
pub type ChainEnable = Output<3>;
/// Pulse to a camera.
pub type Sync = Output<4>;

impl<const LINE: usize> Output<LINE> {
    const PIN: Pin = OUTPUTS[LINE];

    /// Takes over the pin at the given level, without a glitch: the level is set before the direction.
    ///
    /// Medium speed: 25 MHz into 50 pF. At low speed an edge takes 25 ns, half of the clock's pulse; at a higher one it rings
    /// on the wires to the chain (DS10969, "I/O AC characteristics").
    pub fn new(high: bool) -> Self {
        let mut output = Self(());
        output.drive(high);
        let (port, n) = (Self::PIN.port, usize::from(Self::PIN.index));
        bus::modify(port.otyper(), |w| w.set_ot(n, Ot::PUSH_PULL));
        bus::modify(port.ospeedr(), |w| w.set_ospeedr(n, Ospeedr::MEDIUM_SPEED));
        bus::modify(port.moder(), |w| w.set_moder(n, Moder::OUTPUT));
        output
    }

    #[inline(always)]
    fn drive(&mut self, high: bool) {
        // Bits 0 to 15 set, bits 16 to 31 reset.
        let set = 1 << (Self::PIN.index & 15);
        bus::write(Self::PIN.port.bsrr(), |w| w.0 = if high { set } else { set << 16 });
        // A 74HC595 at 3.3 V wants a clock pulse of about 40 ns; two stores follow each other in 25 ns.
        bus::pause();
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

/// The level of the pin, whoever drives it: IDR of an output pin is sampled too (RM0351, 8.4.4).
impl<const LINE: usize> InputPin for Output<LINE> {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(bus::read(Self::PIN.port.idr()).0 >> Self::PIN.index & 1 == 1)
    }
    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|is_high| !is_high)
    }
}

/// The far end of the chain.
pub struct ChainEnd(());

impl ChainEnd {
    /// Makes the pin an input that reads low when nothing is connected.
    pub fn new() -> Self {
        make_input(CHAIN_END, Pupdr::PULL_DOWN);
        Self(())
    }
}

impl Default for ChainEnd {
    fn default() -> Self {
        Self::new()
    }
}

impl ErrorType for ChainEnd {
    type Error = Infallible;
}
impl InputPin for ChainEnd {
    #[inline(always)]
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(bus::read(CHAIN_END.port.idr()).0 >> CHAIN_END.index & 1 == 1)
    }
    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|is_high| !is_high)
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
            let level = bus::read(pin.port.idr()).0 >> pin.index & 1;
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
    bus::read(USER_BUTTON.port.idr()).0 >> USER_BUTTON.index & 1 == 0
}

fn make_input(Pin { port, index }: Pin, pull: Pupdr) {
    let n = usize::from(index);
    bus::modify(port.pupdr(), |w| w.set_pupdr(n, pull));
    bus::modify(port.moder(), |w| w.set_moder(n, Moder::INPUT));
}

/// Hands a pin to its alternate function.
pub(crate) fn alternate(pin: Pin, function: u8, kind: Ot, pull: Pupdr) {
    let (port, n) = (pin.port, usize::from(pin.index));
    bus::modify(port.otyper(), |w| w.set_ot(n, kind));
    bus::modify(port.pupdr(), |w| w.set_pupdr(n, pull));
    bus::modify(port.afr(n / 8), |w| w.set_afr(n % 8, function));
    bus::modify(port.moder(), |w| w.set_moder(n, Moder::ALTERNATE));
}

#[cfg(test)]
mod tests {
    use super::{ChainClock, ChainData, ChainEnable, ChainLatch, Switches, Sync, alternate, user_button_pressed};
    use crate::pins::{OUTPUTS, SERVO_BUS};
    use crate::tests::model::{self, gpio::Edge};
    use crate::{bus, clocks};
    use embedded_hal::digital::{InputPin as _, OutputPin as _};
    use stm32_metapac::gpio::vals::{Ot, Pupdr};

    const PORT_A: usize = 0;

    fn start() {
        model::power_on();
        assert_eq!(clocks::start(), Ok(()));
    }

    fn edges() -> Vec<Edge> {
        model::with(|chip| core::mem::take(&mut chip.gpio.edges))
    }

    /// RM0351, 8.4.7: an output drives what ODR has at the moment its mode is set.
    #[test]
    fn output_enable_is_high_before_it_is_an_output() {
        start();
        ChainEnable::new(true);
        let [Edge::Level { port: PORT_A, odr }, Edge::Mode { port: PORT_A, moder }] = edges()[..] else {
            panic!("a level, then a mode")
        };
        assert_eq!((odr >> 15, moder >> 30), (1, 1));
    }

    /// RM0351, 8.5.3: OSPEEDR, 1 is medium speed.
    #[test]
    fn the_pins_of_the_chain_have_medium_speed() {
        start();
        let _chain = (ChainData::new(false), ChainClock::new(false), ChainLatch::new(false), ChainEnable::new(true));
        Sync::new(false);
        for pin in OUTPUTS {
            assert_eq!(model::with(|chip| chip.gpio.speed(PORT_A, pin.index.into())), 1, "PA{}", pin.index);
        }
    }

    /// RM0351, 8.4.4: the pin is read, not what it is to be.
    #[test]
    fn output_enable_reads_low_where_something_pulls_it_there() {
        start();
        let mut enable = ChainEnable::new(true);
        assert_eq!(enable.is_high(), Ok(false), "the model has no wire");
        model::with(|chip| chip.gpio.inputs[PORT_A] = 1 << 15);
        assert_eq!(enable.is_high(), Ok(true));
    }

    /// RM0351, 8.5.7: a 0 in BSRR changes nothing.
    #[test]
    fn an_edge_leaves_the_other_pins_alone() {
        start();
        let mut clock = ChainClock::new(false);
        ChainEnable::new(true);
        edges();
        let Ok(()) = clock.set_high();
        let Ok(()) = clock.set_low();
        let level = |odr| Edge::Level { port: PORT_A, odr };
        assert_eq!(edges(), [level(1 << 15 | 1 << 5), level(1 << 15)]);
    }

    /// 40.5.12: on one wire the pin is open drain, with a pull-up.
    #[test]
    fn the_servo_bus_is_open_drain() {
        start();
        alternate(SERVO_BUS, 7, Ot::OPEN_DRAIN, Pupdr::PULL_UP);
        let port = SERVO_BUS.port;
        let n = usize::from(SERVO_BUS.index);
        assert_eq!(bus::read(port.otyper()).0 >> n & 1, 1);
        assert_eq!(bus::read(port.pupdr()).0 >> (2 * n) & 3, 1);
        assert_eq!(bus::read(port.moder()).0 >> (2 * n) & 3, 2);
        assert_eq!(bus::read(port.afr(0)).0 >> (4 * n) & 0xf, 7);
    }

    /// RM0351, 8.5.5: IDR has the levels of the pins.
    #[test]
    fn inputs_are_numbered_as_the_table_says() {
        start();
        let switches = Switches::new();
        model::with(|chip| chip.gpio.inputs = [0, 1 << 9, 1 << 0, 1 << 14]);
        assert_eq!(switches.read(), 1 << 0 | 1 << 11 | 1 << 12);
        assert!(user_button_pressed(), "PC13 is low");
    }
}
