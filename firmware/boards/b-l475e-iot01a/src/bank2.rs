//! Flash bank 2 as NOR flash: pages of 2 KiB, words of 8 bytes, all that is written is read back.
//!
//! The code runs from bank 1, so nothing stalls while bank 2 erases (RM0351, 3.3.8 "Read-while-write"). A word torn by a power
//! cut may fail its error check: that raises the NMI, which notes it; the reader then gets the bytes as they are,
//! and their checksum shows the damage. Such a word can still be overwritten with zeros (RM0351, 3.3.7). An error
//! anywhere else is in the code, and fatal.
//!
//! While bank 2 is written or erased the data cache is off, and it is reset before it is on again: reads during a write
//! to the other bank can corrupt it (erratum of the STM32L475, "data cache might be corrupted during flash memory
//! read-while-write operation"), and it does not notice what is written (RM0351, 3.3.4).
use core::sync::atomic::{AtomicU32, Ordering};

use darm_core::units::Micros;
use darm_firmware::clock::Clock;
use darm_firmware::store::FLASH_BYTES;
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use stm32_metapac::FLASH;
use stm32_metapac::flash::regs::{Eccr, Sr};

use crate::bus;
use crate::ecc::{DoubleError, double_error};

/// First byte of bank 2.
const BANK_2: usize = 0x0808_0000;
/// Bytes of a page, which is erased at once.
pub(crate) const PAGE_BYTES: usize = 2048;
/// Bytes of a double word, which is programmed at once.
pub(crate) const WORD_BYTES: usize = 8;
/// Longest wait for the controller: a page erase takes 25 ms at most (DS10969, "Flash memory characteristics").
const LONGEST_OPERATION: Micros = Micros::from_millis(100);
/// Bytes that are compared at once after writing.
const READ_BACK: usize = 64;
/// All error flags of the status register: OPERR, PROGERR, WRPERR, PGAERR, SIZERR, PGSERR, MISERR, FASTERR, RDERR, OPTVERR.
const SR_ERRORS: u32 = 0xC3FA;

/// Why an access failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FlashError {
    /// Outside the device, or not aligned to its words or pages.
    Bounds,
    /// The controller does not unlock.
    Locked,
    /// The controller reports these error flags.
    Controller {
        /// Bits of the status register.
        flags: u32,
    },
    /// The controller does not finish.
    Busy,
    /// What was written does not read back.
    ReadBack {
        /// About here.
        offset: u32,
    },
    /// The emulator's file cannot be opened, read or written.
    File,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Bounds => NorFlashErrorKind::OutOfBounds,
            _ => NorFlashErrorKind::Other,
        }
    }
}

/// The part of bank 2 that holds slots and records.
pub struct Bank2<C>(C);

impl<C: Clock> Bank2<C> {
    /// Takes the bank.
    pub const fn new(clock: C) -> Self {
        Self(clock)
    }

    fn read_now(&self, offset: usize, bytes: &mut [u8]) {
        bus::note_reading(true);
        for (byte, address) in bytes.iter_mut().zip(BANK_2 + offset..) {
            *byte = bus::load_byte(address);
        }
        bus::note_reading(false);
        note_corrected_errors();
    }

    /// RM0351, 3.3.6 "Page erase".
    async fn erase_page(&self, offset: usize) -> Result<(), FlashError> {
        unlock()?;
        bus::modify(FLASH.cr(), |w| {
            w.set_per(true);
            w.set_bker(true);
            w.set_pnb((offset / PAGE_BYTES) as u8);
        });
        bus::modify(FLASH.cr(), |w| w.set_start(true));
        self.finish().await
    }

    /// RM0351, 3.3.7 "Standard programming": a word is two stores of four bytes.
    async fn program(&self, offset: usize, word: &[u8]) -> Result<(), FlashError> {
        unlock()?;
        bus::modify(FLASH.cr(), |w| w.set_pg(true));
        for (half, address) in word.chunks_exact(4).zip((BANK_2 + offset..).step_by(4)) {
            let value = half.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
            bus::store_word(address, value);
        }
        self.finish().await
    }

    /// Lets other tasks run until the controller is done (an erase takes 22 ms), and locks it. One that never ends is left
    /// alone: a write of its register would stall the core (RM0351, 3.7.6).
    async fn finish(&self) -> Result<(), FlashError> {
        let deadline = self.0.now() + LONGEST_OPERATION;
        while is_busy() {
            if self.0.now() > deadline {
                return Err(FlashError::Busy);
            }
            yield_now().await;
        }
        let flags = bus::read(FLASH.sr()).0 & SR_ERRORS;
        bus::write_value(FLASH.sr(), Sr(flags));
        bus::modify(FLASH.cr(), |w| {
            w.set_pg(false);
            w.set_per(false);
            w.set_lock(true);
        });
        if flags == 0 { Ok(()) } else { Err(FlashError::Controller { flags }) }
    }
}

fn check(offset: u32, len: usize, grain: usize) -> Result<usize, FlashError> {
    let offset = offset as usize;
    let inside = offset.checked_add(len).is_some_and(|end| end <= FLASH_BYTES);
    if inside && offset.is_multiple_of(grain) && len.is_multiple_of(grain) {
        Ok(offset)
    } else {
        Err(FlashError::Bounds)
    }
}

impl<C> ErrorType for Bank2<C> {
    type Error = FlashError;
}

impl<C: Clock> ReadNorFlash for Bank2<C> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let offset = check(offset, bytes.len(), 1)?;
        if is_busy() {
            // The core would wait for the controller, and the control tick with it (RM0351, 3.3.8).
            return Err(FlashError::Busy);
        }
        self.read_now(offset, bytes);
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl<C: Clock> NorFlash for Bank2<C> {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let len = to.checked_sub(from).ok_or(FlashError::Bounds)? as usize;
        let start = check(from, len, PAGE_BYTES)?;
        let _uncached = Uncached::begin();
        for offset in (start..start + len).step_by(PAGE_BYTES) {
            self.erase_page(offset).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let start = check(offset, bytes.len(), WORD_BYTES)?;
        let _uncached = Uncached::begin();
        for (word, at) in bytes.chunks_exact(WORD_BYTES).zip((start..).step_by(WORD_BYTES)) {
            self.program(at, word).await?;
        }
        for (word, at) in bytes.chunks(READ_BACK).zip((start..).step_by(READ_BACK)) {
            let back = &mut [0; READ_BACK][..word.len()];
            self.read_now(at, back);
            if back != word {
                return Err(FlashError::ReadBack { offset: at as u32 });
            }
        }
        Ok(())
    }
}

/// A written word may be written again with zeros only, which is all that the storage above asks for.
impl<C: Clock> MultiwriteNorFlash for Bank2<C> {}

/// While it lives the data cache is off.
struct Uncached;

impl Uncached {
    fn begin() -> Self {
        bus::modify(FLASH.acr(), |w| w.set_dcen(false));
        Self
    }
}

impl Drop for Uncached {
    fn drop(&mut self) {
        if is_busy() {
            // An operation that never ends, or whose future was dropped: the cache stays off until the next one.
            return;
        }
        // The cache can be reset only while it is off (RM0351, 3.7.1).
        bus::modify(FLASH.acr(), |w| w.set_dcrst(true));
        bus::modify(FLASH.acr(), |w| w.set_dcrst(false));
        bus::modify(FLASH.acr(), |w| w.set_dcen(true));
    }
}

fn is_busy() -> bool {
    bus::read(FLASH.sr()).bsy()
}

/// Clears what earlier operations have left, and opens the controller (RM0351, 3.3.5 and steps 1 and 2 of 3.3.6 and 3.3.7).
fn unlock() -> Result<(), FlashError> {
    if is_busy() {
        return Err(FlashError::Busy);
    }
    bus::write_value(FLASH.sr(), Sr(SR_ERRORS));
    if bus::read(FLASH.cr()).lock() {
        bus::write_value(FLASH.keyr(), 0x4567_0123);
        bus::write_value(FLASH.keyr(), 0xCDEF_89AB);
    }
    if bus::read(FLASH.cr()).lock() {
        return Err(FlashError::Locked);
    }
    // A future that was dropped half-way leaves its mode selected.
    bus::modify(FLASH.cr(), |w| {
        w.set_pg(false);
        w.set_per(false);
    });
    Ok(())
}

/// Double errors in the data so far, and the offset of the last.
static DOUBLE_ERRORS: AtomicU32 = AtomicU32::new(0);
static LAST_DOUBLE_ERROR: AtomicU32 = AtomicU32::new(0);
/// Words of which one bit was wrong and corrected.
static CORRECTED: AtomicU32 = AtomicU32::new(0);

/// What the NMI has to do with a failed error check. One in the data, which has checksums, is noted; any other is fatal.
///
/// # Errors
///
/// The double error, if it is not in the data; `None` when the flash reports no double error.
pub fn on_nmi() -> Result<(), Option<DoubleError>> {
    match double_error(bus::read(FLASH.eccr()).0, bus::is_reading()) {
        Some(DoubleError::Data { offset }) => LAST_DOUBLE_ERROR.store(offset, Ordering::Relaxed),
        Some(DoubleError::Hidden) => {}
        fatal => return Err(fatal),
    }
    // Flags are cleared by writing 1: this one alone.
    let mut clear = Eccr(0);
    clear.set_eccd(true);
    bus::write_value(FLASH.eccr(), clear);
    // A write that is still on its way when the NMI ends would let it be entered again, without its flag.
    bus::read(FLASH.eccr());
    count(&DOUBLE_ERRORS);
    Ok(())
}

/// Double errors in the data since the start, and the offset of the last in bank 2.
pub fn double_errors() -> (u32, u32) {
    (DOUBLE_ERRORS.load(Ordering::Relaxed), LAST_DOUBLE_ERROR.load(Ordering::Relaxed))
}

/// Words of which one bit was wrong and corrected, since the start. They show that a cell wears out.
pub fn corrected_errors() -> u32 {
    CORRECTED.load(Ordering::Relaxed)
}

fn note_corrected_errors() {
    if bus::read(FLASH.eccr()).eccc() {
        let mut clear = Eccr(0);
        clear.set_eccc(true);
        bus::write_value(FLASH.eccr(), clear);
        count(&CORRECTED);
    }
}

/// Counts. Each counter has one writer.
fn count(counter: &AtomicU32) {
    counter.store(counter.load(Ordering::Relaxed).saturating_add(1), Ordering::Relaxed);
}

#[cfg(test)]
mod tests;
