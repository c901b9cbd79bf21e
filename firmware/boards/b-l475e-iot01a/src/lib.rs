//! B-L475E-IOT01A: the one place that knows the chip. The same image is used on silicon and in QEMU's machine of that
//! name.
//!
//! | file       | holds                                                             |
//! |------------|-------------------------------------------------------------------|
//! | `adc`      | supply and temperature of the chip                                |
//! | `board`    | what the firmware's library asks of a board; priorities           |
//! | `emulated` | whether the image runs in QEMU                                    |
//! | `pins`     | the pin table                                                     |
//! | `clocks`   | 80 MHz from the crystal or the internal oscillator, peripheral clocks |
//! | `gpio`     | outputs of the solenoid chain, limit switches                     |
//! | `uart`     | the console and the servo bus                                     |
//! | `usart`    | a USART with queues: reception by DMA, sending by interrupts      |
//! | `dma`      | a DMA channel that fills a ring                                   |
//! | `time`     | SysTick as the clock of all tasks                                 |
//! | `systick`  | the handler of SysTick: counts time, requests the control tick    |
//! | `flash`    | where slots and records are: bank 2, or a file of the host in QEMU |
//! | `bank2`    | bank 2 as NOR flash                                               |
//! | `bus`      | access to registers: volatile on the chip, a model in tests       |
//! | `ecc`      | what a failed error check of the flash means                      |
//! | `watchdog` | resets the chip when the control tick, or a task it looks after, stops |
//! | `fault`    | handlers of panic, hard fault and unknown interrupts              |
//! | `options`  | the option bytes that matter here                                  |
//! | `restart`  | reset into the firmware or into the chip's loader                 |
//! | `loader`   | the way into that loader                                          |
//! | `tasks`    | the control tick, the two tasks, and what they own                |
//! | `mask`     | the critical section                                              |
//! | `measure`  | longest tick and longest masked stretch, in the bench image only  |
//!
//! Priorities, most urgent first: SysTick, control tick, USARTs, the executor of all else.
#![cfg_attr(not(test), no_std)]
#![cfg_attr(not(test), deny(clippy::unwrap_used))]

#[cfg(any(feature = "chip", test))]
pub mod adc;
#[cfg(any(feature = "chip", test))]
pub mod bank2;
#[cfg(feature = "chip")]
pub mod board;
#[cfg(any(feature = "chip", test))]
pub mod bus;
#[cfg(any(feature = "chip", test))]
pub mod clocks;
#[cfg(any(feature = "chip", test))]
pub mod dma;
pub mod ecc;
#[cfg(feature = "chip")]
pub mod emulated;
#[cfg(feature = "chip")]
mod fault;
#[cfg(feature = "chip")]
pub mod flash;
#[cfg(any(feature = "chip", test))]
pub mod gpio;
#[cfg(any(feature = "chip", test))]
pub mod loader;
#[cfg(feature = "chip")]
mod mask;
#[cfg(feature = "bench")]
pub mod measure;
#[cfg(any(feature = "chip", test))]
pub mod options;
#[cfg(any(feature = "chip", test))]
pub mod pins;
#[cfg(feature = "chip")]
pub mod restart;
#[cfg(feature = "chip")]
mod systick;
#[cfg(feature = "chip")]
pub mod tasks;
#[cfg(test)]
mod tests;
#[cfg(feature = "chip")]
pub mod time;
#[cfg(feature = "chip")]
pub mod uart;
#[cfg(any(feature = "chip", test))]
pub mod usart;
#[cfg(any(feature = "chip", test))]
pub mod watchdog;
