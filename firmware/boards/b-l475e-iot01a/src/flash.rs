//! Where slots and records are: bank 2 of the chip, or a file of the host in QEMU.
//!
//! QEMU models no flash controller. There the bytes live in `flash.img` in QEMU's folder, through semihosting,
//! and survive the end of the emulator.
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_semihosting::syscall;
use darm_firmware::store::FLASH_BYTES;
use embedded_storage_async::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, ReadNorFlash};

use crate::bank2::{self, Bank2, FlashError, PAGE_BYTES, WORD_BYTES};
use crate::emulated::emulated;
use crate::time::BoardClock;

enum Backend {
    Silicon(Bank2<BoardClock>),
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
            return Ok(Self(Backend::Silicon(Bank2::new(BoardClock))));
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
}

impl ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        match &mut self.0 {
            Backend::Silicon(bank) => bank.read(offset, bytes).await,
            Backend::File { handle } => read_file(*handle, offset as usize, bytes),
        }
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let _measured = Measured::begin();
        match &mut self.0 {
            Backend::Silicon(bank) => bank.erase(from, to).await,
            Backend::File { handle } => {
                for offset in (from as usize..to as usize).step_by(PAGE_BYTES) {
                    write_file(*handle, offset, &[0xff; PAGE_BYTES])?;
                }
                Ok(())
            }
        }
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let _measured = Measured::begin();
        match &mut self.0 {
            Backend::Silicon(bank) => bank.write(offset, bytes).await,
            Backend::File { handle } => write_file(*handle, offset as usize, bytes),
        }
    }
}

/// A written word may be written again with zeros only, which is all that the storage above asks for.
impl MultiwriteNorFlash for Flash {}

/// While it lives the measurement counts ticks as during a store.
struct Measured;

impl Measured {
    fn begin() -> Self {
        #[cfg(feature = "bench")]
        crate::measure::storing(true, darm_firmware::clock::Clock::now(&BoardClock));
        Self
    }
}

impl Drop for Measured {
    fn drop(&mut self) {
        #[cfg(feature = "bench")]
        crate::measure::storing(false, darm_firmware::clock::Clock::now(&BoardClock));
    }
}

/// Logs the double errors since the last call. From one task, and not from a read: the deepest stack of the board ends there.
pub(crate) fn log_double_errors() {
    static LOGGED: AtomicU32 = AtomicU32::new(0);
    let (count, offset) = bank2::double_errors();
    if count != LOGGED.load(Ordering::Relaxed) {
        LOGGED.store(count, Ordering::Relaxed);
        defmt::warn!("{=u32} double ECC errors in the data, the last at offset {=u32:#x} of bank 2", count, offset);
    }
}

fn open_file(mode: usize) -> Option<usize> {
    let name = c"flash.img";
    // SAFETY: semihosting SYS_OPEN of a string with its length; in QEMU only.
    let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, name.to_bytes().len()) };
    (handle != usize::MAX).then_some(handle)
}

/// A range outside the device fails: no page of it is written.
fn check(offset: usize, len: usize) -> Result<(), FlashError> {
    if offset.checked_add(len).is_some_and(|end| end <= FLASH_BYTES) { Ok(()) } else { Err(FlashError::Bounds) }
}

fn read_file(handle: usize, offset: usize, bytes: &mut [u8]) -> Result<(), FlashError> {
    check(offset, bytes.len())?;
    // SAFETY: semihosting SYS_SEEK and SYS_READ into a slice of the given length; in QEMU only.
    let left = unsafe { syscall!(SEEK, handle, offset) | syscall!(READ, handle, bytes.as_mut_ptr(), bytes.len()) };
    if left == 0 { Ok(()) } else { Err(FlashError::File) }
}

fn write_file(handle: usize, offset: usize, bytes: &[u8]) -> Result<(), FlashError> {
    check(offset, bytes.len())?;
    // SAFETY: semihosting SYS_SEEK and SYS_WRITE of a slice of the given length; in QEMU only.
    let left = unsafe { syscall!(SEEK, handle, offset) | syscall!(WRITE, handle, bytes.as_ptr(), bytes.len()) };
    if left == 0 { Ok(()) } else { Err(FlashError::File) }
}
