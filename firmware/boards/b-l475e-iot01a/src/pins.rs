//! Pin table of the board. Connector names as printed on the Arduino headers (UM2153, table "Arduino connector pinout").
//!
//! | what                         | pin  | header | kind                                           |
//! |------------------------------|------|--------|------------------------------------------------|
//! | console, transmit            | PB6  | –      | USART1, AF7, to the ST-LINK virtual COM port   |
//! | console, receive             | PB7  | –      | USART1, AF7                                    |
//! | servo bus                    | PA2  | D10    | USART2, AF7, half duplex, open drain, pull-up  |
//! | chain, data                  | PA7  | D11    | output, to SER of the first 74HC595            |
//! | chain, clock                 | PA5  | D13    | output, SRCLK; LED1 flickers with it           |
//! | chain, latch                 | PA4  | D7     | output, RCLK                                   |
//! | chain, output enable         | PA15 | D9     | output, OE, active low; high = all outputs off |
//! | chain, far end               | PA6  | D12    | input with pull-down, from Q7S of the last 74HC595; may be left open |
//! | pulse to a camera            | PA0  | D1     | output, high for 1 ms at each row, where the profile has it |
//! | limit switches 0..12         | see [`SWITCHES`] | | inputs with pull-down, closed = high       |
//! | user button                  | PC13 | –      | blue button B2, pull-up, pressed = low         |
//!
//! PA15 is JTDI after reset: its pull-up holds the outputs off until [`crate::gpio::Output`] takes over.
use stm32_metapac::gpio::Gpio;
use stm32_metapac::{GPIOA, GPIOB, GPIOC, GPIOD};

/// One pin of one port.
#[derive(Clone, Copy)]
pub struct Pin {
    /// The port.
    pub port: Gpio,
    /// Its number in the port, 0..=15.
    pub index: u8,
}

const fn pin(port: Gpio, index: u8) -> Pin {
    Pin { port, index }
}

/// USART1 to the ST-LINK.
pub const CONSOLE_TX: Pin = pin(GPIOB, 6);
/// USART1 from the ST-LINK.
pub const CONSOLE_RX: Pin = pin(GPIOB, 7);
/// The one wire of the servo bus.
pub const SERVO_BUS: Pin = pin(GPIOA, 2);
/// Serial data into the solenoid chain.
pub const CHAIN_DATA: Pin = pin(GPIOA, 7);
/// Shift clock of the solenoid chain.
pub const CHAIN_CLOCK: Pin = pin(GPIOA, 5);
/// Latch of the solenoid chain.
pub const CHAIN_LATCH: Pin = pin(GPIOA, 4);
/// Output enable of the solenoid chain, active low.
pub const CHAIN_ENABLE: Pin = pin(GPIOA, 15);

/// Pulse to a camera.
pub const SYNC: Pin = pin(GPIOA, 0);

/// The chain's four pins and that of the pulse, as [`crate::gpio::Output`] numbers them.
pub const OUTPUTS: [Pin; 5] = [CHAIN_DATA, CHAIN_CLOCK, CHAIN_LATCH, CHAIN_ENABLE, SYNC];

/// Serial output of the last chip of the solenoid chain.
pub const CHAIN_END: Pin = pin(GPIOA, 6);

/// The blue button B2 on the board (UM2153, "Buttons and LEDs"), low while it is pressed.
pub const USER_BUTTON: Pin = pin(GPIOC, 13);

/// Limit switches: the position is the bit in `Seen::switches`.
pub const SWITCHES: [Pin; 13] = [
    pin(GPIOC, 0),  // A5
    pin(GPIOC, 1),  // A4
    pin(GPIOC, 2),  // A3
    pin(GPIOC, 3),  // A2
    pin(GPIOC, 4),  // A1
    pin(GPIOC, 5),  // A0
    pin(GPIOB, 0),  // D3
    pin(GPIOB, 1),  // D6
    pin(GPIOB, 2),  // D8
    pin(GPIOB, 4),  // D5
    pin(GPIOB, 8),  // D15
    pin(GPIOB, 9),  // D14
    pin(GPIOD, 14), // D2
];

#[cfg(test)]
mod tests {
    use darm_core::profile::B_L475E_IOT01A;

    use super::*;

    /// As printed in the reference manual: `PA7`. The ports lie 0x400 apart (RM0351, 2.2.2).
    fn name(pin: Pin) -> String {
        let port = (pin.port.as_ptr() as usize - GPIOA.as_ptr() as usize) / 0x400;
        format!("P{}{}", char::from(b'A' + port as u8), pin.index)
    }

    #[test]
    fn a_host_knows_the_pins_that_the_firmware_drives() {
        let table = &B_L475E_IOT01A;
        let expected = [table.data, table.clock, table.latch, table.enable, table.sync];
        assert_eq!(OUTPUTS.map(name), expected);
        let others = [table.far_end, table.servo_bus, table.button];
        assert_eq!([CHAIN_END, SERVO_BUS, USER_BUTTON].map(name), others);
        assert_eq!(SWITCHES.map(name), table.inputs);
    }
}
