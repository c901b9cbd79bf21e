//! The two USARTs: queues that interrupts fill and empty, as embedded-io-async `Read` and `Write`.
//!
//! A full receive queue stops the interrupt instead of dropping the byte: QEMU then holds its sender back,
//! and silicon counts an overrun. On the half-duplex bus the receiver is off while bytes leave, because the
//! one wire would echo them; QEMU has no such wire, and there the receiver stays on.
use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use darm_core::wire::frame::MAX_FRAME;
use embedded_io_async::{ErrorType, Read, Write};
use stm32_metapac::gpio::vals::{Ot, Pupdr};
use stm32_metapac::usart::Usart;
use stm32_metapac::{Interrupt, USART1, USART2, interrupt};

use crate::clocks::HCLK_HZ;
use crate::emulated::emulated;
use crate::gpio::alternate;
use crate::pins::{CONSOLE_RX, CONSOLE_TX, SERVO_BUS};
use darm_firmware::pipe::Pipe;

/// Both USARTs are alternate function 7 on these pins (DS10969, table 17).
const AF_USART: u8 = 7;

/// One USART with its queues: for `RX - 1` bytes that came in and `TX - 1` bytes that wait to leave.
pub struct Port<const RX: usize, const TX: usize> {
    registers: Usart,
    /// What came in.
    pub received: Pipe<RX>,
    waiting: Pipe<TX>,
    /// Bytes are on their way out; cleared when the last stop bit has left.
    sending: AtomicBool,
    mute_receiver: AtomicBool,
    overruns: AtomicU32,
}

/// USART1, the console: receives the three frames that a host sends ahead in an upload, a stop frame and a line.
pub static CONSOLE: Port<{ 4 * MAX_FRAME + 128 }, 512> = Port::new(USART1);
/// USART2, the servo bus: one packet at a time, of 16 bytes at most, and what of a late answer may precede it.
pub static SERVOS: Port<128, 64> = Port::new(USART2);

/// Starts the console at 115 200 baud.
pub fn start_console() -> (impl Read, impl Write) {
    alternate(CONSOLE_TX, AF_USART, Ot::PUSH_PULL, Pupdr::FLOATING);
    alternate(CONSOLE_RX, AF_USART, Ot::PUSH_PULL, Pupdr::PULL_UP);
    CONSOLE.start(115_200, Interrupt::USART1)
}

/// Starts the servo bus at 1 Mbaud on one wire.
pub fn start_servo_bus() -> (impl Read, impl Write) {
    alternate(SERVO_BUS, AF_USART, Ot::OPEN_DRAIN, Pupdr::PULL_UP);
    USART2.cr3().modify(|w| w.set_hdsel(true));
    SERVOS.mute_receiver.store(!emulated(), Ordering::Relaxed);
    SERVOS.start(1_000_000, Interrupt::USART2)
}

impl<const RX: usize, const TX: usize> Port<RX, TX> {
    const fn new(registers: Usart) -> Self {
        Self {
            registers,
            received: Pipe::new(),
            waiting: Pipe::new(),
            sending: AtomicBool::new(false),
            mute_receiver: AtomicBool::new(false),
            overruns: AtomicU32::new(0),
        }
    }

    fn start(&'static self, baud: u32, interrupt: Interrupt) -> (Receiver<RX, TX>, Sender<RX, TX>) {
        self.registers.brr().write(|w| w.0 = HCLK_HZ / baud);
        self.registers.cr1().write(|w| {
            w.set_ue(true);
            w.set_te(true);
            w.set_re(true);
            w.set_rxneie(true);
        });
        // SAFETY: the handlers below use only this port's atomics and registers, which are ready.
        unsafe { NVIC::unmask(interrupt) };
        (Receiver(self), Sender(self))
    }

    fn on_interrupt(&self) {
        let status = self.registers.isr().read();
        if status.rxne() {
            self.receive();
        }
        if status.ore() {
            self.registers.icr().write(|w| w.set_ore(true));
            self.overruns.fetch_add(1, Ordering::Relaxed);
        }
        let enabled = self.registers.cr1().read();
        if enabled.txeie() && status.txe() {
            self.transmit();
        } else if enabled.txeie() {
            // QEMU leaves the interrupt raised when its host does not read; writing the register makes it look again.
            self.registers.cr1().write_value(enabled);
        } else if enabled.tcie() && status.tc() {
            self.registers.cr1().modify(|w| {
                w.set_tcie(false);
                w.set_re(true);
            });
            self.sending.store(false, Ordering::Release);
            self.waiting.wake_writer();
        }
    }

    fn receive(&self) {
        if self.received.is_full() {
            self.registers.cr1().modify(|w| w.set_rxneie(false));
            return;
        }
        self.received.push(self.registers.rdr().read().0 as u8);
        self.received.wake_reader();
    }

    fn transmit(&self) {
        match self.waiting.pop() {
            Some(byte) => self.registers.tdr().write(|w| w.0 = u32::from(byte)),
            None => self.registers.cr1().modify(|w| {
                w.set_txeie(false);
                w.set_tcie(true);
            }),
        }
        if self.waiting.is_empty() {
            self.waiting.wake_writer();
        }
    }

    /// Changes CR1 from a task; the interrupt changes it too.
    fn enable(&self, change: impl FnOnce(&mut stm32_metapac::usart::regs::Cr1)) {
        critical_section::with(|_| self.registers.cr1().modify(change));
    }
}

/// Receiving half of a port.
pub struct Receiver<const RX: usize, const TX: usize>(&'static Port<RX, TX>);
/// Sending half of a port.
pub struct Sender<const RX: usize, const TX: usize>(&'static Port<RX, TX>);

impl<const RX: usize, const TX: usize> Receiver<RX, TX> {
    /// Bytes lost because nobody fetched them in time.
    pub fn overruns(&self) -> u32 {
        self.0.overruns.load(Ordering::Relaxed)
    }
}

impl<const RX: usize, const TX: usize> ErrorType for Receiver<RX, TX> {
    type Error = Infallible;
}
impl<const RX: usize, const TX: usize> ErrorType for Sender<RX, TX> {
    type Error = Infallible;
}

impl<const RX: usize, const TX: usize> Read for Receiver<RX, TX> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let n = self.0.received.read(bytes).await;
        self.0.enable(|w| w.set_rxneie(true));
        Ok(n)
    }
}

impl<const RX: usize, const TX: usize> Write for Sender<RX, TX> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let port = self.0;
        let n = port.waiting.write(bytes).await;
        port.sending.store(true, Ordering::Release);
        let mute = port.mute_receiver.load(Ordering::Relaxed);
        port.enable(|w| {
            w.set_txeie(true);
            w.set_re(!mute);
        });
        Ok(n)
    }

    /// Waits until the last stop bit has left, not only until the queue is empty.
    async fn flush(&mut self) -> Result<(), Infallible> {
        let port = self.0;
        port.waiting.until(|| (!port.sending.load(Ordering::Acquire)).then_some(())).await;
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
