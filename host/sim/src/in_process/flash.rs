//! Flash in memory, stricter than the part: what outlives a power cut of a board in this process.
//!
//! A word is written once after an erase; the power can be made to fail at any written or erased word, which leaves that
//! word torn. Without power no operation completes. Sizes and times are those of a [`Chip`].

use std::future::pending;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use darm_core::units::Micros;
use darm_firmware::store::{SLOT_BYTES, Store, flash_bytes};
use embassy_futures::{block_on, yield_now};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use darm_arm::image::UploadImage;

use super::chip::Chip;

/// Bytes at which the power can fail.
const WORD: usize = 8;

/// The records, behind the two slots of tables.
const RECORDS: Range<usize> = 2 * SLOT_BYTES..2 * SLOT_BYTES + 16 * 1024;
/// Bytes before the data of a record: their sum, their number, and the sum of that number (`sequential-storage`, `item.rs`).
const HEADER_BYTES: usize = 8;

/// The bytes of a board's flash. Clones share them, as two starts of one board do.
#[derive(Clone, Debug)]
pub struct MemoryFlash(Arc<Mutex<Cells>>);

#[derive(Debug)]
struct Cells {
    chip: Chip,
    bytes: Vec<u8>,
    /// Time for which operations since it was taken last let no control tick run.
    paused: Micros,
    /// The board's time, where operations during which the control tick runs take the time of the part.
    timed: Option<Micros>,
    /// Words until the power fails; `None` if it does not.
    words_left: Option<u32>,
    noise: u64,
    /// Writes to words that were not erased.
    overwrites: u32,
    /// Erasures of each page, and bytes written among the records, since [`MemoryFlash::forget_wear`].
    erasures: Vec<u32>,
    record_bytes: usize,
    /// The last byte written among the records.
    last_record: usize,
}

/// What a flash has borne.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wear {
    /// Erasures of that page of the slots of tables which was erased most often.
    pub table_erasures: u32,
    /// Bytes written among the records.
    pub record_bytes: usize,
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
    /// That of the first board's chip, erased.
    fn default() -> Self {
        Self::new(Chip::default())
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
        if let Some(count) = self.erasures.get_mut(page / self.chip.erase_bytes()) {
            *count += 1;
        }
        let end = page + self.chip.erase_bytes();
        for word in (page..end).step_by(WORD) {
            let torn = self.spend();
            self.bytes[word..word + WORD].fill(0xff);
            if let Some(noise) = torn {
                let rest = self.bytes[word..end].iter_mut().zip(noise.to_le_bytes().into_iter().cycle());
                rest.for_each(|(cell, noise)| *cell |= noise);
                return;
            }
        }
    }

    /// Writes one word, or part of it. A power failure leaves some of its bits unwritten.
    fn write_word(&mut self, at: usize, word: &[u8]) -> Result<(), FlashError> {
        let range = at..at + word.len();
        let erased = self.bytes[range.clone()].iter().all(|cell| *cell == 0xff);
        if !erased && word.iter().any(|byte| *byte != 0) {
            self.overwrites += 1;
            return Err(FlashError::NotErased);
        }
        let unwritten = self.spend().unwrap_or(0).to_le_bytes();
        for ((cell, byte), keep) in self.bytes[range].iter_mut().zip(word).zip(unwritten) {
            *cell &= byte | keep;
        }
        Ok(())
    }
}

impl Cells {
    /// Writes bytes of one page, word by word; nothing more once the power has failed.
    fn write_page(&mut self, mut at: usize, bytes: &[u8]) -> Result<(), FlashError> {
        if RECORDS.contains(&at) {
            self.record_bytes += bytes.len();
            self.last_record = at + bytes.len().saturating_sub(1);
        }
        let mut rest = bytes;
        while !rest.is_empty() && self.words_left != Some(0) {
            let (word, later) = rest.split_at(rest.len().min(WORD - at % WORD));
            self.write_word(at, word)?;
            (at, rest) = (at + word.len(), later);
        }
        Ok(())
    }
}

impl Cells {
    /// The data of the records in the page that was written last, in their order.
    fn last_records(&self) -> Vec<Range<usize>> {
        let page_bytes = self.chip.erase_bytes();
        let page = self.last_record / page_bytes * page_bytes;
        let word = self.chip.word_bytes();
        let mut records = Vec::new();
        // A page begins with a word that marks it.
        let mut at = page + word;
        while at + HEADER_BYTES <= self.last_record {
            let length = usize::from(u16::from_le_bytes([self.bytes[at + 4], self.bytes[at + 5]]));
            let data = at + HEADER_BYTES..at + HEADER_BYTES + length;
            if length == 0 || data.end > page + page_bytes {
                break;
            }
            at = data.start + length.next_multiple_of(word);
            records.push(data);
        }
        records
    }
}

impl MemoryFlash {
    /// The flash of a board that holds this profile and nothing else.
    ///
    /// # Panics
    ///
    /// The image is empty or longer than its slot.
    pub fn with_profile(profile: &UploadImage) -> Self {
        Self::with_profile_on(Chip::default(), profile)
    }

    /// The same of a board with this chip.
    ///
    /// # Panics
    ///
    /// The image is empty or longer than its slot.
    pub fn with_profile_on(chip: Chip, profile: &UploadImage) -> Self {
        let flash = Self::new(chip);
        match chip {
            Chip::Stm32l475 => block_on(put(Stm32l475(flash.clone()), profile)),
            Chip::Rp2040 => block_on(put(Rp2040(flash.clone()), profile)),
        }
        flash.take_pause();
        flash
    }

    /// Erased.
    pub fn new(chip: Chip) -> Self {
        let bytes = vec![0xff; flash_bytes(chip.erase_bytes())];
        let erasures = vec![0; bytes.len().div_ceil(chip.erase_bytes())];
        let paused = Micros(0);
        Self(Arc::new(Mutex::new(Cells {
            chip,
            bytes,
            paused,
            timed: None,
            words_left: None,
            noise: 1,
            overwrites: 0,
            erasures,
            record_bytes: 0,
            last_record: RECORDS.start,
        })))
    }

    /// The chip.
    pub fn chip(&self) -> Chip {
        self.cells().chip
    }

    /// Time for which operations since the last call let no control tick run.
    pub(super) fn take_pause(&self) -> Micros {
        std::mem::take(&mut self.cells().paused)
    }

    /// From now on operations during which the control tick runs take the part's own time, on the board's clock; otherwise
    /// they give way a few times and take none. For measurements.
    pub fn keep_times(&self) {
        self.cells().timed = Some(Micros(0));
    }

    /// The board's clock advances.
    pub(super) fn advance(&self, span: Micros) {
        if let Some(now) = &mut self.cells().timed {
            *now = *now + span;
        }
    }

    /// Gives way until an operation of this time has ended, or so often where operations take no time.
    async fn wait(&self, span: Micros, yields: usize) {
        let now = || self.cells().timed;
        match now() {
            Some(start) => {
                while now().is_some_and(|now| now - start < span) {
                    yield_now().await;
                }
            }
            None => {
                for _ in 0..yields {
                    yield_now().await;
                }
            }
        }
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

    /// Damages one bit of each copy of these bytes among the records, behind the two slots of tables; how many there were.
    pub fn damage_records(&self, bytes: &[u8]) -> usize {
        self.damage(RECORDS, bytes, 8 * (bytes.len() / 2))
    }

    /// The same with the bit of this number.
    pub fn damage_records_at(&self, bytes: &[u8], bit: usize) -> usize {
        self.damage(RECORDS, bytes, bit % (8 * bytes.len()))
    }

    /// The same of the images of profiles, behind the records.
    pub fn damage_profiles(&self, bytes: &[u8]) -> usize {
        let end = self.cells().bytes.len();
        self.damage(RECORDS.end..end, bytes, 8 * (bytes.len() / 2))
    }

    fn damage(&self, range: Range<usize>, bytes: &[u8], bit: usize) -> usize {
        let mut cells = self.cells();
        let copies = cells.bytes[range.clone()].windows(bytes.len()).enumerate();
        let places: Vec<usize> = copies.filter(|(_, copy)| *copy == bytes).map(|(at, _)| range.start + at).collect();
        for at in &places {
            cells.bytes[at + bit / 8] ^= 1 << (bit % 8);
        }
        places.len()
    }

    /// Damages one bit of the record that was written last, or of the one before it on the same page (`back` 1); whether there
    /// was one.
    pub fn damage_last_record(&self, back: usize, bit: usize) -> bool {
        let mut cells = self.cells();
        let records = cells.last_records();
        let Some(data) = records.len().checked_sub(1 + back).and_then(|index| records.get(index)) else { return false };
        let bit = bit % (8 * data.len().max(1));
        cells.bytes[data.start + bit / 8] ^= 1 << (bit % 8);
        true
    }

    /// What it has borne since the last call of [`forget_wear`](Self::forget_wear).
    pub fn wear(&self) -> Wear {
        let cells = self.cells();
        let table_pages = RECORDS.start / cells.chip.erase_bytes();
        let table_erasures = cells.erasures.iter().take(table_pages).copied().max().unwrap_or(0);
        Wear { table_erasures, record_bytes: cells.record_bytes }
    }

    /// Counts what it bears from now on.
    pub fn forget_wear(&self) {
        let mut cells = self.cells();
        cells.erasures.fill(0);
        cells.record_bytes = 0;
    }

    /// Writes to words that were not erased, which the part refuses.
    pub fn overwrites(&self) -> u32 {
        self.cells().overwrites
    }

    /// Whether `image` is at the start of one of the flash's pages.
    pub fn holds(&self, image: &[u8]) -> bool {
        let cells = self.cells();
        let pages = (0..cells.bytes.len()).step_by(cells.chip.erase_bytes());
        pages.into_iter().any(|page| cells.bytes[page..].starts_with(image))
    }
}

async fn put<F: NorFlash>(flash: F, profile: &UploadImage) {
    let stored = async {
        let mut store = Store::open(flash).await;
        store.begin(profile.image()).await?;
        store.chunk(0, profile.bytes()).await?;
        store.commit().await
    };
    stored.await.expect("an erased flash takes a profile");
}

impl MemoryFlash {
    /// Never completes once the power has failed.
    async fn power(&self) {
        if self.has_failed() {
            pending().await
        }
    }

    /// The bytes at an address, which are multiples of `grain`.
    fn range(&self, offset: u32, len: usize, grain: usize) -> Result<Range<usize>, FlashError> {
        let start = offset as usize;
        let fits = start + len <= self.cells().bytes.len() && start.is_multiple_of(grain) && len.is_multiple_of(grain);
        if fits { Ok(start..start + len) } else { Err(FlashError::Bounds) }
    }

    async fn read(&self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.power().await;
        let range = self.range(offset, bytes.len(), 1)?;
        bytes.copy_from_slice(&self.cells().bytes[range]);
        Ok(())
    }

    async fn erase(&self, from: u32, to: u32) -> Result<(), FlashError> {
        let chip = self.chip();
        let pages = self.range(from, to.saturating_sub(from) as usize, chip.erase_bytes())?;
        for page in pages.step_by(chip.erase_bytes()) {
            self.power().await;
            self.pause(chip.erase_pause(), |cells| cells.erase_page(page));
            self.wait(chip.erase_time(), chip.erase_yields()).await;
        }
        self.power().await;
        Ok(())
    }

    async fn write(&self, offset: u32, bytes: &[u8], grain: usize) -> Result<(), FlashError> {
        let chip = self.chip();
        let (mut at, mut rest) = (self.range(offset, bytes.len(), grain)?.start, bytes);
        while !rest.is_empty() {
            self.power().await;
            let (now, later) = rest.split_at(rest.len().min(chip.page_bytes() - at % chip.page_bytes()));
            self.pause(chip.write_pause(), |cells| cells.write_page(at, now))?;
            (at, rest) = (at + now.len(), later);
            if chip.write_pause() > Micros(0) {
                yield_now().await;
            }
        }
        let words = bytes.len().div_ceil(chip.page_bytes()) as u64;
        self.wait(Micros(words * chip.write_time().0), 0).await;
        self.power().await;
        Ok(())
    }

    /// Does something during which no control tick runs for this time.
    fn pause<T>(&self, span: Micros, work: impl FnOnce(&mut Cells) -> T) -> T {
        let mut cells = self.cells();
        cells.paused = cells.paused + span;
        work(&mut cells)
    }
}

/// The flash of one chip, as the firmware sees it.
macro_rules! nor_flash {
    ($chip:ident) => {
        pub(super) struct $chip(pub(super) MemoryFlash);

        impl ErrorType for $chip {
            type Error = FlashError;
        }

        impl ReadNorFlash for $chip {
            const READ_SIZE: usize = 1;

            async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
                self.0.read(offset, bytes).await
            }

            fn capacity(&self) -> usize {
                flash_bytes(Self::ERASE_SIZE)
            }
        }

        impl NorFlash for $chip {
            const WRITE_SIZE: usize = Chip::$chip.word_bytes();
            const ERASE_SIZE: usize = Chip::$chip.erase_bytes();

            async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
                self.0.erase(from, to).await
            }

            async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
                self.0.write(offset, bytes, Self::WRITE_SIZE).await
            }
        }
    };
}

nor_flash!(Stm32l475);
nor_flash!(Rp2040);
