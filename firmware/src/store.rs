//! What survives power: two slots for table images, and a few small records.
//!
//! | bytes from the start of bank 2 | holds                                                                |
//! |--------------------------------|----------------------------------------------------------------------|
//! | 0 to 64 KiB                    | slot A: a table image                                                |
//! | 64 to 128 KiB                  | slot B: a table image                                                |
//! | 128 to 144 KiB                 | records: which slots are valid, calibration, number of starts        |
//! | 144 to 148 KiB                 | slots A and B of the board profile, a page each                      |
//!
//! An upload fills the slot that is not valid. Writing the record that names it is the commit: before, the old image
//! is there, after it the new one, and the records survive a power cut at any byte. The record carries length, digest
//! and model of the image, so a slot is believed only when its bytes agree. These records and the calibration are written
//! twice: one that is damaged reads as none, and would leave the board with no offsets or the limits that are built in.
//!
//! Records that cannot be read (a failed part, or what another program has left) are erased by the next upload. Until
//! then there is no table and no profile; what is erased with them is the calibration.
//!
//! None of these futures may be dropped half-way: never put one into a `select!`.
use core::cell::Cell;
use core::ops::Range;

use darm_core::profile::{Profile, ProfileError, ProfileReader, ProfileRecord};
use darm_core::table::{Board, Record, Table, TableError};
use darm_core::units::Digest;
use darm_core::wire::message::{Calibration, Image, ImageKind, Refusal};
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage, PostcardValue};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// Bytes of one slot: the longest image.
pub const SLOT_BYTES: usize = 64 * 1024;
const RECORDS_BYTES: usize = 16 * 1024;
const RECORDS: Range<u32> = 2 * SLOT_BYTES as u32..(2 * SLOT_BYTES + RECORDS_BYTES) as u32;
/// Bytes of one slot of a profile.
pub const PROFILE_BYTES: usize = 2 * 1024;
/// Bytes of flash in use.
pub const FLASH_BYTES: usize = RECORDS.end as usize + 2 * PROFILE_BYTES;

const KEY_CALIBRATION: u8 = 6;
const KEY_BOOTS: u8 = 3;
/// This bit marks the key of a second copy.
const SECOND: u8 = 0x10;

/// The record that names the valid slot. Keys 1 and 2 held records of protocol 1.
const fn valid_key(kind: ImageKind) -> u8 {
    match kind {
        ImageKind::Table => 4,
        ImageKind::Profile => 5,
    }
}

/// Longest image of a kind.
pub const fn slot_bytes(kind: ImageKind) -> usize {
    match kind {
        ImageKind::Table => SLOT_BYTES,
        ImageKind::Profile => PROFILE_BYTES,
    }
}

/// Bytes of an upload that are written at once: a multiple of the flash's word, a divisor of its page.
const BLOCK: usize = 256;
/// Bytes of the image in memory while it is checked: what one record can need, and a read of a useful size.
const WINDOW: usize = 256;

/// One of the two places for an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Slot {
    A,
    B,
}

impl Slot {
    fn start(self, kind: ImageKind) -> u32 {
        let first = match kind {
            ImageKind::Table => 0,
            ImageKind::Profile => RECORDS.end,
        };
        match self {
            Self::A => first,
            Self::B => first.saturating_add(slot_bytes(kind) as u32),
        }
    }

    fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

/// The record that makes a slot valid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Valid {
    slot: Slot,
    image: Image,
}

/// A record that is written twice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Doubled<V> {
    value: V,
    /// How often it was written: where one copy is damaged or a power cut came between, the larger number holds.
    version: u32,
}

impl<'a, V: Serialize + Deserialize<'a>> PostcardValue<'a> for Doubled<V> {}

fn newer<V>([first, second]: [Option<Doubled<V>>; 2]) -> Option<Doubled<V>> {
    match (first, second) {
        (Some(first), Some(second)) => Some(if first.version < second.version { second } else { first }),
        (first, second) => first.or(second),
    }
}

/// The upload that is under way.
#[derive(Clone, Copy, Debug)]
struct Upload {
    image: Image,
    slot: Slot,
    /// Bytes that have arrived, in order.
    next: u32,
    /// The last of them, not yet in flash; the block starts at a multiple of its length.
    block: [u8; BLOCK],
}

impl Upload {
    /// Takes what fits the block; the rest.
    fn take<'b>(&mut self, bytes: &'b [u8]) -> &'b [u8] {
        let free = self.block.get_mut(self.next as usize % BLOCK..).unwrap_or_default();
        let (now, rest) = bytes.split_at(bytes.len().min(free.len()));
        free.iter_mut().zip(now).for_each(|(to, from)| *to = *from);
        self.next = self.next.saturating_add(now.len() as u32);
        rest
    }

    /// The block is full, or the image is.
    fn is_due(&self) -> bool {
        (self.next as usize).is_multiple_of(BLOCK) || self.next == self.image.len
    }
}

/// The flash could not be read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StorageError;

/// Why an upload does not go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadError {
    /// The image is longer than a slot, or empty.
    TooLong {
        /// Longest image of its kind in bytes.
        max: u32,
    },
    /// No upload has begun.
    NoUpload,
    /// The flash could not be written.
    Storage,
}

/// Why an image is not a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadError {
    /// Length, digest or model differ from what was announced.
    Damaged,
    /// The table breaks a limit.
    Table(TableError),
    /// The profile cannot be run safely.
    Profile(ProfileError),
    /// The flash could not be read.
    Storage,
}

impl From<UploadError> for Refusal {
    fn from(error: UploadError) -> Self {
        match error {
            UploadError::TooLong { max } => Self::TooLong { max },
            UploadError::NoUpload => Self::NoUpload,
            UploadError::Storage => Self::Storage,
        }
    }
}

impl From<LoadError> for Refusal {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Damaged => Self::Damaged,
            LoadError::Table(error) => Self::Table(error),
            LoadError::Profile(error) => Self::Profile(error),
            LoadError::Storage => Self::Storage,
        }
    }
}

impl From<StorageError> for UploadError {
    fn from(_: StorageError) -> Self {
        Self::Storage
    }
}

/// The flash with its slots and records.
pub struct Store<F: NorFlash> {
    records: MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>,
    table: Option<Valid>,
    profile: Option<Valid>,
    upload: Option<Upload>,
    /// The records could not be read: a new upload erases them.
    unreadable: bool,
}

impl<F: NorFlash> Store<F> {
    /// Opens the store and finds which slots are valid.
    pub async fn open(flash: F) -> Self {
        const { assert!(F::READ_SIZE == 1 && BLOCK.is_multiple_of(F::WRITE_SIZE)) };
        const { assert!(SLOT_BYTES.is_multiple_of(F::ERASE_SIZE) && F::ERASE_SIZE.is_multiple_of(BLOCK)) };
        const { assert!(PROFILE_BYTES.is_multiple_of(F::ERASE_SIZE)) };
        let records = MapStorage::new(flash, const { MapConfig::new(RECORDS) }, Cache::new_uncached());
        let mut store = Self { records, table: None, profile: None, upload: None, unreadable: false };
        for kind in [ImageKind::Table, ImageKind::Profile] {
            match store.mend::<Valid>(valid_key(kind)).await {
                Ok(valid) => *store.valid_mut(kind) = valid,
                Err(StorageError) => store.unreadable = true,
            }
        }
        store
    }

    /// Whether the records can be read. If not, a new upload erases them, and the profile with them.
    pub fn is_readable(&self) -> bool {
        !self.unreadable
    }

    fn valid(&self, kind: ImageKind) -> Option<Valid> {
        match kind {
            ImageKind::Table => self.table,
            ImageKind::Profile => self.profile,
        }
    }

    fn valid_mut(&mut self, kind: ImageKind) -> &mut Option<Valid> {
        match kind {
            ImageKind::Table => &mut self.table,
            ImageKind::Profile => &mut self.profile,
        }
    }

    /// Digest of the image in the valid slot.
    pub fn digest(&self, kind: ImageKind) -> Option<Digest> {
        self.valid(kind).map(|valid| valid.image.digest)
    }

    /// Counts this start and returns how many there were.
    pub async fn count_boot(&mut self) -> Result<u32, StorageError> {
        let boots = self.fetch::<u32>(KEY_BOOTS).await?.unwrap_or(0).saturating_add(1);
        self.put(KEY_BOOTS, &boots).await?;
        Ok(boots)
    }

    /// The stored zero offsets.
    pub async fn calibration(&mut self) -> Result<Option<Calibration>, StorageError> {
        self.mend(KEY_CALIBRATION).await
    }

    /// Stores the zero offsets.
    pub async fn set_calibration(&mut self, calibration: Calibration) -> Result<(), StorageError> {
        self.put_doubled(KEY_CALIBRATION, calibration).await
    }

    /// Starts an upload, or resumes the same one; the offset that is wanted next.
    pub async fn begin(&mut self, image: Image) -> Result<u32, UploadError> {
        let max = slot_bytes(image.kind) as u32;
        if image.len == 0 || image.len > max {
            return Err(UploadError::TooLong { max });
        }
        match self.upload {
            Some(upload) if upload.image == image => Ok(upload.next),
            _ => {
                self.erase_unreadable().await?;
                let slot = self.valid(image.kind).map_or(Slot::A, |valid| valid.slot.other());
                self.upload = Some(Upload { image, slot, next: 0, block: [0xff; BLOCK] });
                Ok(0)
            }
        }
    }

    async fn erase_unreadable(&mut self) -> Result<(), StorageError> {
        if self.unreadable {
            let erased = self.records.flash().erase(RECORDS.start, RECORDS.end).await;
            erased.map_err(|_| StorageError)?;
            self.unreadable = false;
        }
        Ok(())
    }

    /// Takes bytes of the image. What has arrived already, or comes too early, changes nothing; the offset wanted next.
    pub async fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<u32, UploadError> {
        let mut upload = self.upload.ok_or(UploadError::NoUpload)?;
        let end = offset.checked_add(bytes.len() as u32);
        if offset != upload.next || end.is_none_or(|end| end > upload.image.len) {
            return Ok(upload.next);
        }
        // Until all bytes are in flash the upload counts as lost: a failed write must not be resumed in mid-word.
        self.upload = None;
        let mut rest = bytes;
        while !rest.is_empty() {
            rest = upload.take(rest);
            if upload.is_due() {
                self.write_block(&mut upload).await?;
            }
        }
        self.upload = Some(upload);
        Ok(upload.next)
    }

    /// True when every byte of this image has arrived.
    pub fn is_whole(&self, image: Image) -> bool {
        self.upload.is_some_and(|upload| upload.image == image && upload.next == image.len)
    }

    /// Checks the whole image that has arrived and fills `table` from it. Nothing is committed yet.
    pub async fn load_upload(&mut self, table: &mut Table, board: &Board<'_>) -> Result<(), LoadError> {
        let Upload { slot, image, .. } = self.upload.ok_or(LoadError::Damaged)?;
        let loaded = self.load(slot, image, table, board).await;
        if loaded.is_err() {
            self.upload = None;
        }
        loaded
    }

    /// The same of a profile.
    pub async fn load_profile_upload(&mut self, profile: &mut Profile) -> Result<(), LoadError> {
        let Upload { slot, image, .. } = self.upload.ok_or(LoadError::Damaged)?;
        let loaded = self.load_profile(slot, image, profile).await;
        if loaded.is_err() {
            self.upload = None;
        }
        loaded
    }

    /// Makes the uploaded image the valid one: the one write that replaces it.
    pub async fn commit(&mut self) -> Result<(), UploadError> {
        let upload = self.upload.take().ok_or(UploadError::NoUpload)?;
        let kind = upload.image.kind;
        let stored = self.put_doubled(valid_key(kind), Valid { slot: upload.slot, image: upload.image }).await;
        // After an error only the flash knows whether the record stands.
        *self.valid_mut(kind) = self.fetch_doubled(valid_key(kind)).await?;
        stored?;
        Ok(())
    }

    /// Fills `table` from the valid slot; false, and an empty table, when there is none.
    pub async fn load_valid(&mut self, table: &mut Table, board: &Board<'_>) -> Result<bool, LoadError> {
        table.clear();
        let Some(Valid { slot, image }) = self.table else { return Ok(false) };
        self.load(slot, image, table, board).await.map(|()| true)
    }

    /// Fills `profile` from its valid slot; false when there is none.
    pub async fn load_valid_profile(&mut self, profile: &mut Profile) -> Result<bool, LoadError> {
        let Some(Valid { slot, image }) = self.profile else { return Ok(false) };
        self.load_profile(slot, image, profile).await.map(|()| true)
    }

    async fn load(&mut self, slot: Slot, image: Image, table: &mut Table, board: &Board<'_>) -> Result<(), LoadError> {
        table.clear();
        self.check_digest(slot, &image).await?;
        let push = |record: &Record| table.push(record, board).map(|()| true).map_err(LoadError::Table);
        let malformed = LoadError::Table(TableError::Malformed);
        let read = self.each_record(slot, &image, malformed, push).await;
        if read.is_ok() && table.end().is_some() && table.model() == image.model {
            return Ok(());
        }
        table.clear();
        read.and(Err(LoadError::Damaged))
    }

    async fn load_profile(&mut self, slot: Slot, image: Image, profile: &mut Profile) -> Result<(), LoadError> {
        self.check_digest(slot, &image).await?;
        let mut reader = ProfileReader::default();
        let push = |record: &ProfileRecord| match reader.push(record, profile) {
            Ok(()) => Ok(true),
            Err(error) => Err(LoadError::Profile(error)),
        };
        let malformed = LoadError::Profile(ProfileError::Malformed);
        self.each_record(slot, &image, malformed, push).await?;
        profile.digest = image.digest;
        if reader.is_complete() { Ok(()) } else { Err(LoadError::Profile(ProfileError::Order)) }
    }

    async fn check_digest(&mut self, slot: Slot, image: &Image) -> Result<(), LoadError> {
        let mut window = [0; WINDOW];
        let mut sha = Sha256::new();
        let mut next = 0u32;
        while next < image.len {
            let len = WINDOW.min(image.len.saturating_sub(next) as usize);
            let part = window.get_mut(..len).unwrap_or_default();
            self.read(slot, image.kind, next, part).await?;
            sha.update(&*part);
            next = next.saturating_add(len as u32);
            yield_now().await;
        }
        if sha.finalize()[..] == image.digest.0 { Ok(()) } else { Err(LoadError::Damaged) }
    }

    /// Hands the records of the valid table to `take`, in their order, until it says that it has enough; nothing without
    /// a valid table.
    pub async fn records(&mut self, mut take: impl FnMut(&Record) -> bool) -> Result<(), LoadError> {
        let Some(Valid { slot, image }) = self.table else { return Ok(()) };
        let malformed = LoadError::Table(TableError::Malformed);
        self.each_record(slot, &image, malformed, |record| Ok(take(record))).await
    }

    /// Hands record after record to `take` until it says that it has enough; a record may lie across two reads. Other
    /// tasks run between two reads.
    async fn each_record<R: for<'a> Deserialize<'a>>(
        &mut self,
        slot: Slot,
        image: &Image,
        malformed: LoadError,
        mut take: impl FnMut(&R) -> Result<bool, LoadError>,
    ) -> Result<(), LoadError> {
        let mut window = [0; WINDOW];
        let (mut filled, mut next) = (0usize, 0u32);
        while next < image.len {
            let fresh = WINDOW.saturating_sub(filled).min(image.len.saturating_sub(next) as usize);
            let free = window.get_mut(filled..).and_then(|free| free.get_mut(..fresh)).ok_or(LoadError::Damaged)?;
            self.read(slot, image.kind, next, free).await?;
            filled = filled.saturating_add(fresh);
            next = next.saturating_add(fresh as u32);
            let bytes = window.get(..filled).unwrap_or_default();
            let Some(used) = take_records(bytes, next == image.len, malformed, &mut take)? else { return Ok(()) };
            move_to_front(&mut window, used);
            filled = filled.saturating_sub(used);
            yield_now().await;
        }
        Ok(())
    }

    async fn read(&mut self, slot: Slot, kind: ImageKind, offset: u32, bytes: &mut [u8]) -> Result<(), LoadError> {
        let at = slot.start(kind).saturating_add(offset);
        self.records.flash().read(at, bytes).await.map_err(|_| LoadError::Storage)
    }

    /// Writes the block that ends the upload so far, and erases the page that it begins.
    async fn write_block(&mut self, upload: &mut Upload) -> Result<(), StorageError> {
        let last = upload.next.saturating_sub(1);
        let start = last.saturating_sub((last as usize % BLOCK) as u32);
        let used = (upload.next.saturating_sub(start) as usize).next_multiple_of(F::WRITE_SIZE);
        let at = upload.slot.start(upload.image.kind).saturating_add(start);
        let flash = self.records.flash();
        if at.is_multiple_of(F::ERASE_SIZE as u32) {
            flash.erase(at, at.saturating_add(F::ERASE_SIZE as u32)).await.map_err(|_| StorageError)?;
        }
        let due = upload.block.get(..used).unwrap_or_default();
        flash.write(at, due).await.map_err(|_| StorageError)?;
        upload.block = [0xff; BLOCK];
        Ok(())
    }

    /// Puts in the place of the calibration what cannot be read as one.
    #[cfg(test)]
    pub(crate) async fn spoil_calibration(&mut self) {
        for key in [KEY_CALIBRATION, KEY_CALIBRATION | SECOND] {
            assert_eq!(self.put(key, &7u8).await, Ok(()));
        }
    }

    async fn fetch_doubled<V>(&mut self, key: u8) -> Result<Option<V>, StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        Ok(newer(self.copies::<V>(key).await?).map(|doubled| doubled.value))
    }

    /// Reads a record, and writes it again where one copy is damaged or older: after a power cut, for example.
    async fn mend<V>(&mut self, key: u8) -> Result<Option<V>, StorageError>
    where
        V: Copy + PartialEq + Serialize + for<'a> Deserialize<'a>,
    {
        let copies = self.copies::<V>(key).await?;
        let Some(newer) = newer(copies) else { return Ok(None) };
        for (key, copy) in [key, key | SECOND].into_iter().zip(copies) {
            if copy != Some(newer) {
                // The other copy is good: what cannot be written now is tried again at the next start.
                let _ = self.put(key, &newer).await;
            }
        }
        Ok(Some(newer.value))
    }

    async fn copies<V>(&mut self, key: u8) -> Result<[Option<Doubled<V>>; 2], StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        Ok([self.fetch(key).await?, self.fetch(key | SECOND).await?])
    }

    async fn put_doubled<V>(&mut self, key: u8, value: V) -> Result<(), StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        // What cannot be read is replaced.
        let old = self.copies::<V>(key).await.ok().and_then(newer);
        let version = old.map_or(0, |old| old.version.saturating_add(1));
        let doubled = Doubled { value, version };
        self.put(key, &doubled).await?;
        self.put(key | SECOND, &doubled).await
    }

    async fn fetch<V>(&mut self, key: u8) -> Result<Option<V>, StorageError>
    where
        V: for<'a> sequential_storage::map::Value<'a>,
    {
        let mut buffer = [0; 64];
        self.records.fetch_item(&mut buffer, &key).await.map_err(|_| StorageError)
    }

    async fn put<V>(&mut self, key: u8, value: &V) -> Result<(), StorageError>
    where
        V: for<'a> sequential_storage::map::Value<'a>,
    {
        let mut buffer = [0; 64];
        self.records.store_item(&mut buffer, &key, value).await.map_err(|_| StorageError)
    }
}

/// Takes the records that are complete in `bytes`; how many bytes they took, or `None` when no more are wanted.
fn take_records<R: for<'a> Deserialize<'a>>(
    bytes: &[u8],
    last: bool,
    malformed: LoadError,
    take: &mut impl FnMut(&R) -> Result<bool, LoadError>,
) -> Result<Option<usize>, LoadError> {
    let mut rest = bytes;
    while !rest.is_empty() && (last || rest.len() >= Record::MAX_BYTES) {
        let (record, after) = postcard::take_from_bytes::<R>(rest).map_err(|_| malformed)?;
        if !take(&record)? {
            return Ok(None);
        }
        rest = after;
    }
    Ok(Some(bytes.len().saturating_sub(rest.len())))
}

/// Moves the bytes from `used` on to the front.
fn move_to_front(window: &mut [u8], used: usize) {
    let cells = Cell::from_mut(window).as_slice_of_cells();
    cells.iter().zip(cells.iter().skip(used)).for_each(|(to, from)| to.set(from.get()));
}

#[cfg(test)]
mod tests;
