//! The servo bus by UART0 at 1 Mbaud: a request fits the transmit FIFO, what comes is taken by the interrupt.
use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};

use darm_core::wire::health::LineErrors;
use darm_firmware::pipe::Pipe;
use embassy_futures::yield_now;
use embassy_rp::interrupt::InterruptExt as _;
use embassy_rp::peripherals::{PIN_0, PIN_1, UART0};
use embassy_rp::uart::{Blocking, Config, Uart, UartTx};
use embassy_rp::{Peri, interrupt, pac};
use embedded_io_async::{ErrorType, Read, Write};

/// One packet of 16 bytes, its echo, and what of a late answer may precede it.
static RECEIVED: Pipe<128> = Pipe::new();

/// Overruns, framing errors, disturbed and dropped bytes, since the start.
static ERRORS: [AtomicU32; 4] = [const { AtomicU32::new(0) }; 4];

/// Errors of the line, since the start.
pub(crate) fn errors() -> LineErrors {
    let [overruns, framing, noise, dropped] = ERRORS.each_ref().map(|count| count.load(Ordering::Relaxed));
    LineErrors { overruns, framing, noise, dropped }
}

/// The sending half.
pub(crate) struct Port(UartTx<'static, Blocking>);
/// The receiving half.
pub(crate) struct Receiver;

/// Takes the UART and its pins.
pub(crate) fn start(uart: Peri<'static, UART0>, tx: Peri<'static, PIN_0>, rx: Peri<'static, PIN_1>) -> Port {
    let mut config = Config::default();
    config.baudrate = 1_000_000;
    let (sender, receiver) = Uart::new_blocking(uart, tx, rx, config).split();
    // Its registers stay as they are; the interrupt below reads them.
    core::mem::forget(receiver);
    pac::UART0.uartimsc().modify(|w| {
        w.set_rxim(true);
        w.set_rtim(true);
    });
    // SAFETY: the handler uses the queue and the registers, which are ready.
    unsafe { interrupt::UART0_IRQ.enable() };
    Port(sender)
}

#[cold]
fn count(errors: [bool; 4]) {
    for (count, _) in ERRORS.iter().zip(errors).filter(|(_, has_failed)| *has_failed) {
        count.store(count.load(Ordering::Relaxed).saturating_add(1), Ordering::Relaxed);
    }
}

#[interrupt]
fn UART0_IRQ() {
    // First: a byte that comes while the queue is emptied requests the interrupt again. Cleared afterwards its request would be
    // lost; the chip asks again when no byte follows for 32 bits, the emulator does not, and a servo's answer stays behind.
    pac::UART0.uarticr().write(|w| {
        w.set_rxic(true);
        w.set_rtic(true);
    });
    while !pac::UART0.uartfr().read().rxfe() {
        let received = pac::UART0.uartdr().read();
        // A byte that finds the queue full is lost, and the packet with it: the bus asks again.
        let dropped = !RECEIVED.push(received.data());
        let [overrun, framing] = [received.oe(), received.fe() || received.be()];
        if overrun || framing || received.pe() || dropped {
            count([overrun, framing, received.pe(), dropped]);
        }
    }
    RECEIVED.wake_reader();
}

impl ErrorType for Receiver {
    type Error = Infallible;
}
impl ErrorType for Port {
    type Error = Infallible;
}

impl Read for Receiver {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        Ok(RECEIVED.read(bytes).await)
    }
}

impl Write for Port {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Ok(()) = self.0.blocking_write(bytes).or(Ok::<_, Infallible>(()));
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        while self.0.busy() {
            yield_now().await;
        }
        Ok(())
    }
}
