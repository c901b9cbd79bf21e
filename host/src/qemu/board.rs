//! Where the board's pins are in the emulated machine; mirrors the pin table of the firmware's board.
//!
//! | what           | pins                                                                                     |
//! |----------------|------------------------------------------------------------------------------------------|
//! | output chain   | data PA7, clock PA5, latch PA4, output enable PA15                                         |
//! | limit switches | 0..5 = PC0..PC5, 6 = PB0, 7 = PB1, 8 = PB2, 9 = PB4, 10 = PB8, 11 = PB9, 12 = PD14; high when closed |

use crate::plant::chain::ChainPins;

/// The bank whose pins drive the output chain.
pub const CHAIN_BANK: &str = "/machine/soc/gpioa";
/// Its input data register: the levels of its pins.
pub const CHAIN_LEVELS: u32 = 0x4800_0010;
/// The chain's pins within the bank.
pub const CHAIN: ChainPins = ChainPins { data: 7, clock: 5, latch: 4, enable: 15 };

const PB: &str = "/machine/soc/gpiob";
const PC: &str = "/machine/soc/gpioc";
const PD: &str = "/machine/soc/gpiod";

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
