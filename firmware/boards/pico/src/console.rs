//! The console as a serial port over USB.
//!
//! No packet is full: a host waits for more after a full one. A host that reads nothing for a second loses what is sent,
//! so that a closed port never blocks the console.

use core::convert::Infallible;
use core::ops::Range;

use darm_firmware::hardware::Hardware as _;
use darm_firmware::pipe::Pipe;
use darm_firmware::port::QUEUE;
use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_rp::peripherals::USB;
use embassy_rp::usb::{Driver, InterruptHandler};
use embassy_rp::{Peri, bind_interrupts};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer, with_timeout};
use embassy_usb::class::cdc_acm::{self, CdcAcmClass, State};
use embassy_usb::{Builder, Config, UsbDevice};
use embedded_io_async::{ErrorType, Read, Write};
use static_cell::StaticCell;

use crate::board::Board;

bind_interrupts!(struct Irqs {
    USBCTRL_IRQ => InterruptHandler<USB>;
});

const PACKET: usize = 64;
/// Longest wait for the host to fetch a packet.
const PATIENCE: Duration = Duration::from_secs(1);
/// A host that polls fetches the empty packet within this time.
const FETCHED: Duration = Duration::from_millis(5);
/// Numbers of pid.codes for devices that are not sold.
const VENDOR_PRODUCT: (u16, u16) = (0x1209, 0x0001);

/// What the console says, on its way to the cable: two packets.
static SAID: Pipe<QUEUE> = Pipe::new();
/// Somebody waits until the host has all of it, and it has.
static FLUSH: Signal<CriticalSectionRawMutex, ()> = Signal::new();
static FLUSHED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

type Bus = Driver<'static, USB>;
/// The device on the bus.
pub(crate) type Usb = UsbDevice<'static, Bus>;

/// Both directions of the port.
pub(crate) struct UsbConsole {
    /// What the host sends.
    pub(crate) receiver: Receiver,
    /// What the host gets.
    pub(crate) sender: Sender,
}

static DESCRIPTORS: StaticCell<([u8; 128], [u8; 32], [u8; 64])> = StaticCell::new();
static STATE: StaticCell<State> = StaticCell::new();
static SERIAL: StaticCell<[u8; 24]> = StaticCell::new();

/// The device, which a task runs, and the port.
pub(crate) fn start(usb: Peri<'static, USB>) -> (Usb, UsbConsole) {
    let mut config = Config::new(VENDOR_PRODUCT.0, VENDOR_PRODUCT.1);
    (config.manufacturer, config.product) = (Some("darm"), Some("darm on Pico"));
    config.serial_number = core::str::from_utf8(SERIAL.init(serial())).ok();
    let (configuration, bos, control) = DESCRIPTORS.init(([0; 128], [0; 32], [0; 64]));
    let mut builder = Builder::new(Driver::new(usb, Irqs), config, configuration, bos, &mut [], control);
    let class = CdcAcmClass::new(&mut builder, STATE.init(State::new()), PACKET as u16);
    let (sender, receiver) = class.split();
    (
        builder.build(),
        UsbConsole { receiver: Receiver { port: receiver, packet: [0; PACKET], unread: 0..0 }, sender: Sender(sender) },
    )
}

/// The chip's number in hexadecimal digits.
fn serial() -> [u8; 24] {
    let mut serial = [0; 24];
    for (digits, byte) in serial.chunks_exact_mut(2).zip(Board::device().0) {
        for (digit, nibble) in digits.iter_mut().zip([byte >> 4, byte & 15]) {
            *digit = if nibble < 10 { b'0' + nibble } else { b'a' + nibble - 10 };
        }
    }
    serial
}

/// Waits for packets, and for the cable where there is none.
pub(crate) struct Receiver {
    port: cdc_acm::Receiver<'static, Bus>,
    /// The last packet, and what of it nobody has read: the driver keeps one that does not fit, and is then deaf.
    packet: [u8; PACKET],
    unread: Range<usize>,
}
/// Sends packets, where somebody fetches them.
pub(crate) struct Sender(cdc_acm::Sender<'static, Bus>);

impl ErrorType for Receiver {
    type Error = Infallible;
}
impl ErrorType for Sender {
    type Error = Infallible;
}

impl Read for Receiver {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        while self.unread.is_empty() {
            // Before a host has configured the device the driver reads whatever its registers hold.
            self.port.wait_connection().await;
            match self.port.read_packet(&mut self.packet).await {
                Ok(count) => self.unread = 0..count,
                Err(_) => yield_now().await,
            }
        }
        let unread = self.packet.get(self.unread.clone()).unwrap_or_default();
        let count = unread.len().min(bytes.len());
        bytes.iter_mut().zip(unread).for_each(|(to, from)| *to = *from);
        self.unread.start = if unread.is_empty() { self.unread.end } else { self.unread.start.saturating_add(count) };
        Ok(count)
    }
}

impl Write for Sender {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let packet = bytes.get(..PACKET - 1).unwrap_or(bytes);
        // A host that is not there or does not read has nobody behind it.
        let _ = with_timeout(PATIENCE, self.0.write_packet(packet)).await;
        Ok(packet.len())
    }

    /// Waits until the host has fetched the last packet: an empty one can follow it.
    async fn flush(&mut self) -> Result<(), Infallible> {
        let _ = with_timeout(PATIENCE, self.0.write_packet(&[])).await;
        Timer::after(FETCHED).await;
        Ok(())
    }
}

/// Sends what [`Outlet`] says, for ever.
pub(crate) async fn send_said(sender: &mut Sender) -> ! {
    let mut bytes = [0; PACKET - 1];
    loop {
        match select(SAID.read(&mut bytes), FLUSH.wait()).await {
            Either::First(count) => {
                let Ok(_) = sender.write(bytes.get(..count).unwrap_or_default()).await;
            }
            Either::Second(()) => {
                let Ok(()) = sender.flush().await;
                FLUSHED.signal(());
            }
        }
    }
}

/// What the console says, from any executor: the driver of the cable stays in one.
pub(crate) struct Outlet;

impl ErrorType for Outlet {
    type Error = Infallible;
}

impl Write for Outlet {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        Ok(SAID.write(bytes).await)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        FLUSHED.reset();
        FLUSH.signal(());
        FLUSHED.wait().await;
        Ok(())
    }
}
