//! Flash in memory, stricter than the part: what outlives a power cut of a board in this process.
//!
//! A word is written once after an erase; the power can be made to fail at any written or erased word, which leaves that
//! word torn. Without power no operation completes.

use std::future::pending;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use darm_firmware::store::{FLASH_BYTES, Store};
use embassy_futures::{block_on, yield_now};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use darm_arm::image::UploadImage;

/// Pages and words of the board's chip.
const PAGE: usize = 2048;
const WORD: usize = 8;
/// An erase gives way to other tasks this many times; a page takes 22 ms on the part.
const ERASE_YIELDS: usize = 20;

/// The bytes of a board's flash. Clones share them, as two starts of one board do.
#[derive(Clone, Debug)]
pub struct MemoryFlash(Arc<Mutex<Cells>>);

#[derive(Debug)]
struct Cells {
    bytes: Vec<u8>,
    /// Words until the power fails; `None` if it does not.
    words_left: Option<u32>,
    noise: u64,
    /// Writes to words that were not erased.
    overwrites: u32,
}

/// Why the flash refuses an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Outside the flash, or not aligned.
    Bounds,
    /// The word is not erased.
    NotErased,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Bounds => NorFlashErrorKind::OutOfBounds,
            Self::NotErased => NorFlashErrorKind::Other,
        }
    }
}

impl Default for MemoryFlash {
    /// Erased.
    fn default() -> Self {
        let bytes = vec![0xff; FLASH_BYTES];
        Self(Arc::new(Mutex::new(Cells { bytes, words_left: None, noise: 1, overwrites: 0 })))
    }
}

impl Cells {
    /// One word of work. The noise when the power fails during it, `None` when it holds.
    fn spend(&mut self) -> Option<u64> {
        let left = self.words_left.as_mut()?;
        *left = left.saturating_sub(1);
        if *left > 0 {
            return None;
        }
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        Some(self.noise)
    }

    /// Erases a page. A power failure leaves noise in the rest of it.
    fn erase_page(&mut self, page: usize) {
        for word in (page..page + PAGE).step_by(WORD) {
            let torn = self.spend();
            self.bytes[word..word + WORD].fill(0xff);
            if let Some(noise) = torn {
                let rest = self.bytes[word..page + PAGE].iter_mut().zip(noise.to_le_bytes().into_iter().cycle());
                rest.for_each(|(cell, noise)| *cell |= noise);
                return;
            }
        }
    }

    /// Writes one word. A power failure leaves some of its bits unwritten.
    fn write_word(&mut self, at: usize, word: &[u8]) -> Result<(), FlashError> {
        let erased = self.bytes[at..at + WORD].iter().all(|cell| *cell == 0xff);
        if !erased && word.iter().any(|byte| *byte != 0) {
            self.overwrites += 1;
            return Err(FlashError::NotErased);
        }
        let unwritten = self.spend().unwrap_or(0).to_le_bytes();
        for ((cell, byte), keep) in self.bytes[at..at + WORD].iter_mut().zip(word).zip(unwritten) {
            *cell &= byte | keep;
        }
        Ok(())
    }
}

impl MemoryFlash {
    /// The flash of a board that holds this profile and nothing else.
    ///
    /// # Panics
    ///
    /// The image is empty or longer than its slot.
    pub fn with_profile(profile: &UploadImage) -> Self {
        let flash = Self::default();
        let stored = block_on(async {
            let mut store = Store::open(flash.clone()).await;
            store.begin(profile.image()).await?;
            store.chunk(0, profile.bytes()).await?;
            store.commit().await
        });
        stored.expect("an erased flash takes a profile");
        flash
    }

    /// All its bytes, as a file of an emulated board's flash holds them.
    pub fn bytes(&self) -> Vec<u8> {
        self.cells().bytes.clone()
    }

    fn cells(&self) -> MutexGuard<'_, Cells> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets the power fail during the `words`th written or erased word from now on, 1 for the next one; `noise` decides
    /// what that word holds afterwards.
    pub fn fail_after(&self, words: u32, noise: u64) {
        let mut cells = self.cells();
        cells.words_left = Some(words.max(1));
        cells.noise = noise | 1;
    }

    /// True once the power has failed.
    pub fn has_failed(&self) -> bool {
        self.cells().words_left == Some(0)
    }

    /// The power holds from now on.
    pub fn restore(&self) {
        self.cells().words_left = None;
    }

    /// Writes to words that were not erased, which the part refuses.
    pub fn overwrites(&self) -> u32 {
        self.cells().overwrites
    }

    /// Whether `image` is at the start of one of the flash's pages.
    pub fn holds(&self, image: &[u8]) -> bool {
        let cells = self.cells();
        (0..FLASH_BYTES).step_by(PAGE).any(|page| cells.bytes[page..].starts_with(image))
    }
}

fn range(offset: u32, len: usize, grain: usize) -> Result<std::ops::Range<usize>, FlashError> {
    let start = offset as usize;
    let fits = start + len <= FLASH_BYTES && start.is_multiple_of(grain) && len.is_multiple_of(grain);
    if fits { Ok(start..start + len) } else { Err(FlashError::Bounds) }
}

impl ErrorType for MemoryFlash {
    type Error = FlashError;
}

impl ReadNorFlash for MemoryFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.power().await;
        bytes.copy_from_slice(&self.cells().bytes[range(offset, bytes.len(), 1)?]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for MemoryFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        for page in range(from, to.saturating_sub(from) as usize, PAGE)?.step_by(PAGE) {
            self.power().await;
            self.cells().erase_page(page);
            for _ in 0..ERASE_YIELDS {
                yield_now().await;
            }
        }
        self.power().await;
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        for (at, word) in range(offset, bytes.len(), WORD)?.step_by(WORD).zip(bytes.chunks_exact(WORD)) {
            self.power().await;
            self.cells().write_word(at, word)?;
        }
        self.power().await;
        Ok(())
    }
}

impl MemoryFlash {
    /// Never completes once the power has failed.
    async fn power(&self) {
        if self.has_failed() {
            pending().await
        }
    }
}
