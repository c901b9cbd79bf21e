//! Where the board's pins are in the emulated machine; mirrors the pin table of the firmware's board.
//!
//! | what           | pins                                                                                     |
//! |----------------|------------------------------------------------------------------------------------------|
//! | output chain   | data PA7, clock PA5, latch PA4, output enable PA15                                         |
//! | limit switches | 0..5 = PC0..PC5, 6 = PB0, 7 = PB1, 8 = PB2, 9 = PB4, 10 = PB8, 11 = PB9, 12 = PD14; high when closed |
//! | user button    | PC13, low when pressed                                                                   |

use super::qtest::{Qtest, QtestError};
use crate::plant::chain::ChainPins;

/// The bank whose pins drive the output chain.
pub const CHAIN_BANK: &str = "/machine/soc/gpioa";
/// The chain's pins within the bank.
pub const CHAIN: ChainPins = ChainPins { data: 7, clock: 5, latch: 4, enable: 15 };

/// Registers of the bank: mode, levels in, levels out.
const MODER: u32 = 0x4800_0000;
const IDR: u32 = 0x4800_0010;
const ODR: u32 = 0x4800_0014;

/// Intercepts the chain's pins on a machine that does not run yet, and returns their levels.
///
/// The emulator takes every intercepted pin for low and reports only what differs from that. So a pin that is high
/// already, as output enable is by its pull-up, is driven low and high once, and the registers are put back.
///
/// # Errors
///
/// The emulator has ended, does not answer in time, or refuses a command.
pub fn intercept_chain(qtest: &mut Qtest) -> Result<u16, QtestError> {
    qtest.intercept_outputs(CHAIN_BANK)?;
    let (mode, out) = (qtest.read_u32(MODER)?, qtest.read_u32(ODR)?);
    let levels = qtest.read_u32(IDR)?;
    let pins = [CHAIN.data, CHAIN.clock, CHAIN.latch, CHAIN.enable];
    let high = pins.into_iter().filter(|pin| levels >> pin & 1 == 1).collect::<Vec<_>>();
    let as_output = high.iter().fold(mode, |mode, pin| mode & !(0b11 << (2 * pin)) | 0b01 << (2 * pin));
    let bits = high.iter().fold(0, |bits, pin| bits | 1 << pin);
    qtest.write_u32(MODER, as_output)?;
    qtest.write_u32(ODR, out & !bits)?;
    qtest.write_u32(ODR, out | bits)?;
    qtest.write_u32(MODER, mode)?;
    qtest.write_u32(ODR, out)?;
    Ok(levels as u16)
}

const PB: &str = "/machine/soc/gpiob";
const PC: &str = "/machine/soc/gpioc";
const PD: &str = "/machine/soc/gpiod";

/// Bank and pin of the user button, low when it is pressed.
pub const BUTTON: (&str, u8) = (PC, 13);

/// Bank and pin of each limit switch by its number.
pub const SWITCHES: [(&str, u8); 13] = [
    (PC, 0),
    (PC, 1),
    (PC, 2),
    (PC, 3),
    (PC, 4),
    (PC, 5),
    (PB, 0),
    (PB, 1),
    (PB, 2),
    (PB, 4),
    (PB, 8),
    (PB, 9),
    (PD, 14),
];
