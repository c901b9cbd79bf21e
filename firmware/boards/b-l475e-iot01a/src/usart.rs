//! A USART with queues, as embedded-io-async `Read` and `Write`: what comes arrives by DMA, what leaves by interrupts.
//!
//! | | reception | a full queue |
//! |---|---|---|
//! | [`Reception::Dma`] | into a ring, taken out at its middle, its end, and when the line is idle | bytes are dropped and counted |
//! | [`Reception::Interrupts`] | byte by byte | stops the interrupt, so that QEMU holds its sender back |
//!
//! The USART has no FIFO: at 1 Mbaud a byte comes each 10 µs, less than a control tick takes; only DMA keeps up. QEMU has no
//! DMA controller. On a half-duplex bus the receiver stays on while bytes leave, and hears them: who reads drops that echo.
//! RM0351, chapter 40.
use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use darm_firmware::pipe::Pipe;
use embedded_io_async::{ErrorType, Read, Write};
use stm32_metapac::usart::Usart;
use stm32_metapac::usart::regs::{Cr1, Icr, Isr};

use crate::clocks::HCLK_HZ;
use crate::{bus, dma};

/// How bytes come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reception {
    /// By DMA.
    Dma,
    /// By interrupts.
    Interrupts,
}

/// What a line is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Its rate, baud.
    pub baud: u32,
    /// One wire for both directions.
    pub is_half_duplex: bool,
    /// How bytes come in.
    pub reception: Reception,
}

/// What went wrong on a line since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineErrors {
    /// Bytes that came while the one before had not been fetched.
    pub overruns: u32,
    /// Bytes without a stop bit: another rate, a break.
    pub framing: u32,
    /// Bytes with a disturbed bit.
    pub noise: u32,
    /// Bytes that no queue had room for.
    pub dropped: u32,
    /// Bus errors of the DMA channel.
    pub dma: u32,
}

/// One USART with its queues: for `RX - 1` bytes that came in and `TX - 1` bytes that wait to leave.
pub struct Port<const RX: usize, const TX: usize> {
    registers: Usart,
    channel: dma::Receiver,
    by_dma: AtomicBool,
    /// What came in.
    pub received: Pipe<RX>,
    waiting: Pipe<TX>,
    /// Bytes are on their way out; cleared when the last stop bit has left.
    sending: AtomicBool,
    overruns: AtomicU32,
    framing: AtomicU32,
    noise: AtomicU32,
    dropped: AtomicU32,
    dma_errors: AtomicU32,
}

impl<const RX: usize, const TX: usize> Port<RX, TX> {
    /// A port with the channel that serves its receiver.
    pub const fn new(registers: Usart, channel: dma::Channel) -> Self {
        Self {
            registers,
            channel: dma::Receiver::new(channel),
            by_dma: AtomicBool::new(false),
            received: Pipe::new(),
            waiting: Pipe::new(),
            sending: AtomicBool::new(false),
            overruns: AtomicU32::new(0),
            framing: AtomicU32::new(0),
            noise: AtomicU32::new(0),
            dropped: AtomicU32::new(0),
            dma_errors: AtomicU32::new(0),
        }
    }

    /// Sets the line up and opens the receiver. The caller then unmasks the interrupts of the USART and of the DMA channel.
    pub fn start(&'static self, line: Line) -> (Receiver<RX, TX>, Sender<RX, TX>) {
        let by_dma = line.reception == Reception::Dma;
        self.by_dma.store(by_dma, Ordering::Relaxed);
        bus::write(self.registers.brr(), |w| w.0 = HCLK_HZ / line.baud);
        bus::modify(self.registers.cr3(), |w| {
            w.set_hdsel(line.is_half_duplex);
            w.set_dmar(by_dma);
            // Without it errors raise no interrupt where bytes do not.
            w.set_eie(by_dma);
        });
        if by_dma {
            self.channel.start(self.registers.rdr().as_ptr() as u32);
        }
        bus::write(self.registers.cr1(), |w| {
            w.set_ue(true);
            w.set_te(true);
            w.set_re(true);
            w.set_rxneie(!by_dma);
            w.set_idleie(by_dma);
        });
        (Receiver(self), Sender(self))
    }

    /// What went wrong since the start.
    pub fn errors(&self) -> LineErrors {
        let read = |counter: &AtomicU32| counter.load(Ordering::Relaxed);
        LineErrors {
            overruns: read(&self.overruns),
            framing: read(&self.framing),
            noise: read(&self.noise),
            dropped: read(&self.dropped),
            dma: read(&self.dma_errors),
        }
    }

    /// The handler of the channel's interrupt, which has the priority of the USART's.
    pub fn on_dma_interrupt(&self) {
        self.receive_by_dma();
    }

    /// The handler of the USART's interrupt.
    pub fn on_interrupt(&self) {
        let status = bus::read(self.registers.isr());
        self.count_errors(status);
        if self.by_dma.load(Ordering::Relaxed) {
            self.receive_by_dma();
        } else if status.rxne() {
            self.receive();
        }
        let enabled = bus::read(self.registers.cr1());
        if enabled.txeie() && status.txe() {
            self.transmit();
        } else if enabled.txeie() {
            // QEMU leaves the interrupt raised when its host does not read; writing the register makes it look again.
            bus::write_value(self.registers.cr1(), enabled);
        } else if enabled.tcie() && status.tc() {
            bus::modify(self.registers.cr1(), |w| w.set_tcie(false));
            self.sending.store(false, Ordering::Release);
            self.waiting.wake_writer();
        }
    }

    /// Counts the errors of this status and clears them, and that the line is idle (RM0351, 40.8.9).
    fn count_errors(&self, status: Isr) {
        let mut clear = Icr(0);
        for (is_set, counter) in
            [(status.ore(), &self.overruns), (status.fe(), &self.framing), (status.ne(), &self.noise)]
        {
            add(counter, u32::from(is_set));
        }
        clear.set_ore(status.ore());
        clear.set_fe(status.fe());
        clear.set_ne(status.ne());
        clear.set_pe(status.pe());
        clear.set_idle(status.idle());
        if clear.0 != 0 {
            bus::write_value(self.registers.icr(), clear);
        }
    }

    fn receive_by_dma(&self) {
        match self.channel.look() {
            dma::Brought::Bytes(count) => {
                let full = (0..count).filter(|_| !self.received.push(self.channel.take())).count();
                add(&self.dropped, full as u32);
                if count > 0 {
                    self.received.wake_reader();
                }
            }
            dma::Brought::Lapped => add(&self.dropped, dma::RING as u32),
            dma::Brought::Failed => add(&self.dma_errors, 1),
        }
    }

    fn receive(&self) {
        if self.received.is_full() {
            bus::modify(self.registers.cr1(), |w| w.set_rxneie(false));
            return;
        }
        self.received.push(bus::read(self.registers.rdr()).0 as u8);
        self.received.wake_reader();
    }

    fn transmit(&self) {
        match self.waiting.pop() {
            Some(byte) => bus::write(self.registers.tdr(), |w| w.0 = u32::from(byte)),
            None => bus::modify(self.registers.cr1(), |w| {
                w.set_txeie(false);
                w.set_tcie(true);
            }),
        }
        if self.waiting.is_empty() {
            self.waiting.wake_writer();
        }
    }

    /// Changes CR1 from a task; the interrupt changes it too.
    fn enable(&self, change: impl FnOnce(&mut Cr1)) {
        critical_section::with(|_| bus::modify(self.registers.cr1(), change));
    }
}

/// Counts. The handler alone writes the counters.
fn add(counter: &AtomicU32, count: u32) {
    counter.store(counter.load(Ordering::Relaxed).saturating_add(count), Ordering::Relaxed);
}

/// Receiving half of a port.
pub struct Receiver<const RX: usize, const TX: usize>(&'static Port<RX, TX>);
/// Sending half of a port.
pub struct Sender<const RX: usize, const TX: usize>(&'static Port<RX, TX>);

impl<const RX: usize, const TX: usize> ErrorType for Receiver<RX, TX> {
    type Error = Infallible;
}
impl<const RX: usize, const TX: usize> ErrorType for Sender<RX, TX> {
    type Error = Infallible;
}

impl<const RX: usize, const TX: usize> Read for Receiver<RX, TX> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let n = self.0.received.read(bytes).await;
        if !self.0.by_dma.load(Ordering::Relaxed) {
            self.0.enable(|w| w.set_rxneie(true));
        }
        Ok(n)
    }
}

impl<const RX: usize, const TX: usize> Write for Sender<RX, TX> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let port = self.0;
        let n = port.waiting.write(bytes).await;
        port.sending.store(true, Ordering::Release);
        port.enable(|w| w.set_txeie(true));
        Ok(n)
    }

    /// Waits until the last stop bit has left, not only until the queue is empty.
    async fn flush(&mut self) -> Result<(), Infallible> {
        let port = self.0;
        port.waiting.until(|| (!port.sending.load(Ordering::Acquire)).then_some(())).await;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
