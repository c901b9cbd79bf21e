//! The two ports of the board: the console on USART1 and the servo bus on USART2, with their pins and interrupts.
use cortex_m::peripheral::NVIC;
use darm_core::wire::frame::MAX_FRAME;
use darm_firmware::port::QUEUE;
use embedded_io_async::{Read, Write};
use stm32_metapac::gpio::vals::{Ot, Pupdr};
use stm32_metapac::{Interrupt, USART1, USART2, interrupt};

use crate::dma::Channel;
use crate::emulated::emulated;
use crate::gpio::alternate;
use crate::pins::{CONSOLE_RX, CONSOLE_TX, SERVO_BUS};
use crate::usart::{Line, Port, Reception};

/// Both USARTs are alternate function 7 on these pins (DS10969, table 17).
const AF_USART: u8 = 7;

/// USART1, the console: receives the three frames that a host sends ahead in an upload, a stop frame and a line.
pub static CONSOLE: Port<{ 4 * MAX_FRAME + 128 }, QUEUE> = Port::new(USART1, Channel::Usart1);
/// USART2, the servo bus: one packet at a time, of 16 bytes at most, its echo, and what of a late answer may precede it.
pub static SERVOS: Port<128, 64> = Port::new(USART2, Channel::Usart2);

/// Starts the console at 115 200 baud.
pub fn start_console() -> (impl Read, impl Write) {
    alternate(CONSOLE_TX, AF_USART, Ot::PUSH_PULL, Pupdr::FLOATING);
    alternate(CONSOLE_RX, AF_USART, Ot::PUSH_PULL, Pupdr::PULL_UP);
    let halves = CONSOLE.start(Line { baud: 115_200, is_half_duplex: false, reception: reception() });
    unmask([Interrupt::USART1, Interrupt::DMA1_CHANNEL5]);
    halves
}

/// Starts the servo bus at 1 Mbaud on one wire.
pub fn start_servo_bus() -> (impl Read, impl Write) {
    alternate(SERVO_BUS, AF_USART, Ot::OPEN_DRAIN, Pupdr::PULL_UP);
    let halves = SERVOS.start(Line { baud: 1_000_000, is_half_duplex: true, reception: reception() });
    unmask([Interrupt::USART2, Interrupt::DMA1_CHANNEL6]);
    halves
}

/// QEMU has no DMA controller.
fn reception() -> Reception {
    if emulated() { Reception::Interrupts } else { Reception::Dma }
}

fn unmask(interrupts: [Interrupt; 2]) {
    for interrupt in interrupts {
        // SAFETY: the handlers below use only a port's atomics and registers, which are ready.
        unsafe { NVIC::unmask(interrupt) };
    }
}

#[interrupt]
fn USART1() {
    CONSOLE.on_interrupt();
}

#[interrupt]
fn DMA1_CHANNEL5() {
    CONSOLE.on_dma_interrupt();
}

#[interrupt]
fn USART2() {
    SERVOS.on_interrupt();
}

#[interrupt]
fn DMA1_CHANNEL6() {
    SERVOS.on_dma_interrupt();
}
