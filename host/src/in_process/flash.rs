//! Flash in memory: what outlives a power cut of a board in this process.

use std::convert::Infallible;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use darm_firmware::store::FLASH_BYTES;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// Pages and words of the board's chip.
const PAGE: usize = 2048;
const WORD: usize = 8;

/// The bytes of a board's flash. Clones share them, as two starts of one board do.
#[derive(Clone, Debug)]
pub struct MemoryFlash(Arc<Mutex<Vec<u8>>>);

impl Default for MemoryFlash {
    /// Erased.
    fn default() -> Self {
        Self(Arc::new(Mutex::new(vec![0xff; FLASH_BYTES])))
    }
}

impl MemoryFlash {
    fn with<T>(&self, from: u32, len: usize, act: impl FnOnce(&mut [u8]) -> T) -> T {
        let mut bytes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let range: Range<usize> = from as usize..from as usize + len;
        act(&mut bytes[range])
    }
}

impl ErrorType for MemoryFlash {
    type Error = Infallible;
}

impl ReadNorFlash for MemoryFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        self.with(offset, bytes.len(), |cells| bytes.copy_from_slice(cells));
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for MemoryFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.with(from, (to - from) as usize, |cells| cells.fill(0xff));
        Ok(())
    }

    /// Clears bits and sets none, as flash does.
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        self.with(offset, bytes.len(), |cells| cells.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte));
        Ok(())
    }
}
