//! Flash bank 2 as NOR flash: pages of 2 KiB, words of 8 bytes, all that is written is read back.
//!
//! The code runs from bank 1, so nothing stalls while bank 2 erases (RM0351, 3.3.5). A word torn by a power cut
//! may fail its error check: that raises the NMI, which notes it; the reader then gets the bytes as they are,
//! and their checksum shows the damage. Such a word can still be overwritten with zeros (RM0351, 3.3.7). An error
//! anywhere else is in the code, and fatal.
//!
//! While bank 2 is written or erased the data cache is off, and it is reset before it is on again: reads during a write
//! to the other bank can corrupt it (erratum of the STM32L475, "data cache might be corrupted during flash memory
//! read-while-write operation").
//!
//! QEMU models no flash controller. There the bytes live in `flash.img` in QEMU's folder, through semihosting,
//! and survive the end of the emulator.
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_semihosting::syscall;
use darm_core::units::Micros;
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use stm32_metapac::FLASH;

use crate::emulated::emulated;
use crate::time::BoardClock;
use darm_firmware::clock::Clock as _;
use darm_firmware::store::FLASH_BYTES;

/// First byte of bank 2.
const BANK_2: usize = 0x0808_0000;
const PAGE_BYTES: usize = 2048;
const WORD_BYTES: usize = 8;
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

enum Backend {
    Silicon,
    File { handle: usize },
}

/// The part of bank 2 that holds slots and records.
pub struct Flash(Backend);

impl Flash {
    /// Takes the flash; in QEMU opens its file, or creates it erased.
    ///
    /// # Errors
    ///
    /// [`FlashError::File`]: in QEMU the file can be neither opened nor created, or not written. The chip's flash does
    /// not fail here.
    pub fn open() -> Result<Self, FlashError> {
        if !emulated() {
            return Ok(Self(Backend::Silicon));
        }
        const READ_WRITE: usize = 3;
        const CREATE: usize = 7;
        if let Some(handle) = open_file(READ_WRITE) {
            return Ok(Self(Backend::File { handle }));
        }
        let handle = open_file(CREATE).ok_or(FlashError::File)?;
        for page in 0..FLASH_BYTES / PAGE_BYTES {
            write_file(handle, page * PAGE_BYTES, &[0xff; PAGE_BYTES])?;
        }
        Ok(Self(Backend::File { handle }))
    }

    fn read_now(&self, offset: usize, bytes: &mut [u8]) -> Result<(), FlashError> {
        match self.0 {
            Backend::Silicon => {
                for (byte, address) in bytes.iter_mut().zip(BANK_2 + offset..) {
                    // SAFETY: the caller has checked that the range lies in the device; flash is always readable.
                    *byte = unsafe { (address as *const u8).read_volatile() };
                }
                report_double_errors();
                Ok(())
            }
            Backend::File { handle } => read_file(handle, offset, bytes),
        }
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

impl ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let offset = check(offset, bytes.len(), 1)?;
        self.read_now(offset, bytes)
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let _storing = Storing::begin();
        let len = to.checked_sub(from).ok_or(FlashError::Bounds)? as usize;
        let start = check(from, len, PAGE_BYTES)?;
        for offset in (start..start + len).step_by(PAGE_BYTES) {
            match self.0 {
                Backend::Silicon => erase_page(offset).await?,
                Backend::File { handle } => write_file(handle, offset, &[0xff; PAGE_BYTES])?,
            }
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let _storing = Storing::begin();
        let start = check(offset, bytes.len(), WORD_BYTES)?;
        match self.0 {
            Backend::Silicon => {
                for (word, at) in bytes.chunks_exact(WORD_BYTES).zip((start..).step_by(WORD_BYTES)) {
                    program(at, word).await?;
                }
            }
            Backend::File { handle } => write_file(handle, start, bytes)?,
        }
        for (word, at) in bytes.chunks(READ_BACK).zip((start..).step_by(READ_BACK)) {
            let back = &mut [0; READ_BACK][..word.len()];
            self.read_now(at, back)?;
            if back != word {
                return Err(FlashError::ReadBack { offset: at as u32 });
            }
        }
        Ok(())
    }
}

/// While it lives the flash is written or erased: the data cache is off, and the measurement counts ticks apart.
struct Storing;

impl Storing {
    fn begin() -> Self {
        FLASH.acr().modify(|w| w.set_dcen(false));
        #[cfg(feature = "bench")]
        crate::measure::storing(true, BoardClock.now());
        Self
    }
}

impl Drop for Storing {
    fn drop(&mut self) {
        // The cache can be reset only while it is off (RM0351, 3.7.1).
        FLASH.acr().modify(|w| w.set_dcrst(true));
        FLASH.acr().modify(|w| w.set_dcrst(false));
        FLASH.acr().modify(|w| w.set_dcen(true));
        #[cfg(feature = "bench")]
        crate::measure::storing(false, BoardClock.now());
    }
}

/// A written word may be written again with zeros only, which is all that the storage above asks for.
impl MultiwriteNorFlash for Flash {}

/// RM0351, 3.3.6 "Page erase".
async fn erase_page(offset: usize) -> Result<(), FlashError> {
    unlock()?;
    FLASH.cr().modify(|w| {
        w.set_per(true);
        w.set_bker(true);
        w.set_pnb((offset / PAGE_BYTES) as u8);
    });
    FLASH.cr().modify(|w| w.set_start(true));
    let done = finish().await;
    FLASH.cr().modify(|w| {
        w.set_per(false);
        w.set_lock(true);
    });
    done
}

/// RM0351, 3.3.7 "Standard programming": a word is two stores of four bytes.
async fn program(offset: usize, word: &[u8]) -> Result<(), FlashError> {
    unlock()?;
    FLASH.cr().modify(|w| w.set_pg(true));
    for (half, address) in word.chunks_exact(4).zip((BANK_2 + offset..).step_by(4)) {
        let value = half.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
        // SAFETY: the address lies in bank 2 and is aligned; the controller is unlocked for programming.
        unsafe { (address as *mut u32).write_volatile(value) };
    }
    let done = finish().await;
    FLASH.cr().modify(|w| {
        w.set_pg(false);
        w.set_lock(true);
    });
    done
}

fn unlock() -> Result<(), FlashError> {
    FLASH.sr().write(|w| w.0 = SR_ERRORS);
    if FLASH.cr().read().lock() {
        FLASH.keyr().write_value(0x4567_0123);
        FLASH.keyr().write_value(0xCDEF_89AB);
    }
    if FLASH.cr().read().lock() { Err(FlashError::Locked) } else { Ok(()) }
}

/// Lets other tasks run until the controller is done: an erase takes 22 ms.
async fn finish() -> Result<(), FlashError> {
    let deadline = BoardClock.now() + LONGEST_OPERATION;
    while FLASH.sr().read().bsy() {
        if BoardClock.now() > deadline {
            return Err(FlashError::Busy);
        }
        yield_now().await;
    }
    let flags = FLASH.sr().read().0 & SR_ERRORS;
    FLASH.sr().write(|w| w.0 = flags);
    if flags == 0 { Ok(()) } else { Err(FlashError::Controller { flags }) }
}

/// Double errors in the data so far, and the offset of the last.
static DOUBLE_ERRORS: AtomicU32 = AtomicU32::new(0);
static LAST_DOUBLE_ERROR: AtomicU32 = AtomicU32::new(0);

/// Notes a double error in the data, which has checksums. From the NMI.
pub(crate) fn note_double_error(offset: u32) {
    FLASH.eccr().modify(|w| w.set_eccd(true));
    LAST_DOUBLE_ERROR.store(offset, Ordering::Relaxed);
    DOUBLE_ERRORS.fetch_add(1, Ordering::Relaxed);
}

/// Logs what the NMI has noted since the last call. From the one task that reads the flash.
fn report_double_errors() {
    let count = DOUBLE_ERRORS.swap(0, Ordering::Relaxed);
    if count > 0 {
        let offset = LAST_DOUBLE_ERROR.load(Ordering::Relaxed);
        defmt::warn!("{=u32} double ECC errors in the data, the last at offset {=u32:#x} of bank 2", count, offset);
    }
}

fn open_file(mode: usize) -> Option<usize> {
    let name = c"flash.img";
    // SAFETY: semihosting SYS_OPEN of a string with its length; in QEMU only.
    let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, name.to_bytes().len()) };
    (handle != usize::MAX).then_some(handle)
}

fn read_file(handle: usize, offset: usize, bytes: &mut [u8]) -> Result<(), FlashError> {
    // SAFETY: semihosting SYS_SEEK and SYS_READ into a slice of the given length; in QEMU only.
    let left = unsafe { syscall!(SEEK, handle, offset) | syscall!(READ, handle, bytes.as_mut_ptr(), bytes.len()) };
    if left == 0 { Ok(()) } else { Err(FlashError::File) }
}

fn write_file(handle: usize, offset: usize, bytes: &[u8]) -> Result<(), FlashError> {
    // SAFETY: semihosting SYS_SEEK and SYS_WRITE of a slice of the given length; in QEMU only.
    let left = unsafe { syscall!(SEEK, handle, offset) | syscall!(WRITE, handle, bytes.as_ptr(), bytes.len()) };
    if left == 0 { Ok(()) } else { Err(FlashError::File) }
}
