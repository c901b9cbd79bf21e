//! The two USARTs: queues that interrupts fill and empty. RM0090, chapter 30.
//!
//! A full receive queue stops the interrupt instead of dropping the byte: QEMU then holds its sender back, and silicon counts
//! an overrun.
use core::convert::Infallible;

use cortex_m::peripheral::NVIC;
use darm_core::wire::frame::MAX_FRAME;
use darm_firmware::pipe::Pipe;
use darm_firmware::port::QUEUE;
use embedded_io_async::{ErrorType, Read, Write};
use stm32_metapac::usart::Usart;
use stm32_metapac::{Interrupt, USART1, USART2, interrupt};

use crate::time::HCLK_HZ;

/// One USART with its queues.
struct Port<const RX: usize> {
    registers: Usart,
    received: Pipe<RX>,
    waiting: Pipe<QUEUE>,
}

/// The console: receives the three frames that a host sends ahead in an upload, a stop frame and a line.
static CONSOLE: Port<{ 4 * MAX_FRAME + 128 }> = Port::new(USART1);
/// The servo bus: one packet at a time, and what of a late answer may precede it.
static SERVOS: Port<128> = Port::new(USART2);

/// Starts the console at 115 200 baud.
pub(crate) fn start_console() -> (impl Read, impl Write) {
    CONSOLE.start(HCLK_HZ / 2 / 115_200, Interrupt::USART1)
}

/// Starts the servo bus at 1 Mbaud on one wire; what is sent comes back on it.
pub(crate) fn start_servo_bus() -> (impl Read, impl Write) {
    USART2.cr3().modify(|w| w.set_hdsel(true));
    SERVOS.start(HCLK_HZ / 4 / 1_000_000, Interrupt::USART2)
}

impl<const RX: usize> Port<RX> {
    const fn new(registers: Usart) -> Self {
        Self { registers, received: Pipe::new(), waiting: Pipe::new() }
    }

    fn start(&'static self, divider: u32, interrupt: Interrupt) -> (Half<RX>, Half<RX>) {
        self.registers.brr().write(|w| w.0 = divider);
        self.registers.cr1().write(|w| {
            w.set_ue(true);
            w.set_te(true);
            w.set_re(true);
            w.set_rxneie(true);
        });
        // SAFETY: the handlers below use only this port's atomics and registers, which are ready.
        unsafe { NVIC::unmask(interrupt) };
        (Half(self), Half(self))
    }

    fn on_interrupt(&self) {
        let status = self.registers.sr().read();
        if (status.rxne() || status.ore()) && self.received.is_full() {
            self.registers.cr1().modify(|w| w.set_rxneie(false));
        } else if status.rxne() || status.ore() {
            // Reading the data after the status also clears an overrun.
            self.received.push(self.registers.dr().read().dr() as u8);
            self.received.wake_reader();
        }
        if self.registers.cr1().read().txeie() && status.txe() {
            match self.waiting.pop() {
                Some(byte) => self.registers.dr().write(|w| w.set_dr(byte.into())),
                None => self.registers.cr1().modify(|w| w.set_txeie(false)),
            }
            if self.waiting.is_empty() {
                self.waiting.wake_writer();
            }
        }
    }
}

/// A half of a port: one reads, the other writes.
struct Half<const RX: usize>(&'static Port<RX>);

impl<const RX: usize> ErrorType for Half<RX> {
    type Error = Infallible;
}

impl<const RX: usize> Read for Half<RX> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let n = self.0.received.read(bytes).await;
        critical_section::with(|_| self.0.registers.cr1().modify(|w| w.set_rxneie(true)));
        Ok(n)
    }
}

impl<const RX: usize> Write for Half<RX> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let n = self.0.waiting.write(bytes).await;
        critical_section::with(|_| self.0.registers.cr1().modify(|w| w.set_txeie(true)));
        Ok(n)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        self.0.waiting.until(|| self.0.waiting.is_empty().then_some(())).await;
        // The last byte leaves within 87 us.
        while !self.0.registers.sr().read().tc() {}
        Ok(())
    }
}

#[interrupt]
fn USART1() {
    CONSOLE.on_interrupt();
}

#[interrupt]
fn USART2() {
    SERVOS.on_interrupt();
}
