//! What survives power: two slots for table images, and a few small records.
//!
//! | bytes from the start of bank 2 | holds                                                                |
//! |--------------------------------|----------------------------------------------------------------------|
//! | 0 to 64 KiB                    | slot A: a table image                                                |
//! | 64 to 128 KiB                  | slot B: a table image                                                |
//! | 128 to 144 KiB                 | records: which slot is valid, calibration, number of starts          |
//!
//! An upload fills the slot that is not valid. Writing the record that names it is the commit: before, the old table
//! is there, after it the new one, and the records survive a power cut at any byte. The record carries length,
//! checksum and model of the image, so a slot is believed only when its bytes agree.
//!
//! None of these futures may be dropped half-way: never put one into a `select!`.
use core::ops::Range;

use darm_core::table::{Record, Table, TableError};
use darm_core::units::DeviceId;
use darm_core::wire::frame::CRC;
use darm_core::wire::message::{Calibration, Image};
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage, PostcardValue};
use serde::{Deserialize, Serialize};

/// Bytes of one slot: the longest image.
pub const SLOT_BYTES: usize = 64 * 1024;
const RECORDS_BYTES: usize = 16 * 1024;
/// Bytes of flash in use.
pub const FLASH_BYTES: usize = 2 * SLOT_BYTES + RECORDS_BYTES;
const RECORDS: Range<u32> = 2 * SLOT_BYTES as u32..FLASH_BYTES as u32;

const KEY_VALID: u8 = 1;
const KEY_CALIBRATION: u8 = 2;
const KEY_BOOTS: u8 = 3;

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
    fn start(self) -> u32 {
        match self {
            Self::A => 0,
            Self::B => SLOT_BYTES as u32,
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

impl PostcardValue<'_> for Valid {}

/// A calibration as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Stored(Calibration);

impl PostcardValue<'_> for Stored {}

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
        let at = self.next as usize % BLOCK;
        let n = bytes.len().min(BLOCK - at);
        self.block[at..at + n].copy_from_slice(&bytes[..n]);
        self.next += n as u32;
        &bytes[n..]
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
    TooLong,
    /// No upload has begun.
    NoUpload,
    /// The flash could not be written.
    Storage,
}

/// Why an image is not a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadError {
    /// Length, checksum or model differ from what was announced.
    Damaged,
    /// The table breaks a limit.
    Table(TableError),
    /// The flash could not be read.
    Storage,
}

impl From<StorageError> for UploadError {
    fn from(_: StorageError) -> Self {
        Self::Storage
    }
}

/// The flash with its slots and records.
pub struct Store<F: NorFlash> {
    records: MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>,
    valid: Option<Valid>,
    upload: Option<Upload>,
}

impl<F: NorFlash> Store<F> {
    /// Opens the store and finds which slot is valid.
    pub async fn open(flash: F) -> Result<Self, StorageError> {
        const { assert!(F::READ_SIZE == 1 && BLOCK.is_multiple_of(F::WRITE_SIZE)) };
        const { assert!(SLOT_BYTES.is_multiple_of(F::ERASE_SIZE) && F::ERASE_SIZE.is_multiple_of(BLOCK)) };
        let records = MapStorage::new(flash, const { MapConfig::new(RECORDS) }, Cache::new_uncached());
        let mut store = Self { records, valid: None, upload: None };
        store.valid = store.fetch(KEY_VALID).await?;
        Ok(store)
    }

    /// Counts this start and returns how many there were.
    pub async fn count_boot(&mut self) -> Result<u32, StorageError> {
        let boots = self.fetch::<u32>(KEY_BOOTS).await?.unwrap_or(0).saturating_add(1);
        self.put(KEY_BOOTS, &boots).await?;
        Ok(boots)
    }

    /// The stored zero offsets.
    pub async fn calibration(&mut self) -> Result<Option<Calibration>, StorageError> {
        Ok(self.fetch::<Stored>(KEY_CALIBRATION).await?.map(|stored| stored.0))
    }

    /// Stores the zero offsets.
    pub async fn set_calibration(&mut self, calibration: Calibration) -> Result<(), StorageError> {
        self.put(KEY_CALIBRATION, &Stored(calibration)).await
    }

    /// Starts an upload, or resumes the same one; the offset that is wanted next.
    pub fn begin(&mut self, image: Image) -> Result<u32, UploadError> {
        if image.len == 0 || image.len as usize > SLOT_BYTES {
            return Err(UploadError::TooLong);
        }
        match self.upload {
            Some(upload) if upload.image == image => Ok(upload.next),
            _ => {
                let slot = self.valid.map_or(Slot::A, |valid| valid.slot.other());
                self.upload = Some(Upload { image, slot, next: 0, block: [0xff; BLOCK] });
                Ok(0)
            }
        }
    }

    /// Takes bytes of the image. What has arrived already, or comes too early, changes nothing; the offset wanted next.
    pub async fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<u32, UploadError> {
        let mut upload = self.upload.ok_or(UploadError::NoUpload)?;
        let end = u64::from(offset) + bytes.len() as u64;
        if offset != upload.next || end > u64::from(upload.image.len) {
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
    pub async fn load_upload(&mut self, table: &mut Table, device: DeviceId) -> Result<(), LoadError> {
        let Upload { slot, image, .. } = self.upload.ok_or(LoadError::Damaged)?;
        let loaded = self.load(slot, image, table, device).await;
        if loaded.is_err() {
            self.upload = None;
        }
        loaded
    }

    /// Makes the uploaded image the valid one: the one write that replaces a table.
    pub async fn commit(&mut self) -> Result<(), UploadError> {
        let upload = self.upload.take().ok_or(UploadError::NoUpload)?;
        let valid = Valid { slot: upload.slot, image: upload.image };
        let stored = self.put(KEY_VALID, &valid).await;
        // After an error only the flash knows whether the record stands.
        self.valid = self.fetch(KEY_VALID).await?;
        stored?;
        Ok(())
    }

    /// Fills `table` from the valid slot; false, and an empty table, when there is none.
    pub async fn load_valid(&mut self, table: &mut Table, device: DeviceId) -> Result<bool, LoadError> {
        table.clear();
        let Some(Valid { slot, image }) = self.valid else { return Ok(false) };
        self.load(slot, image, table, device).await.map(|()| true)
    }

    async fn load(&mut self, slot: Slot, image: Image, table: &mut Table, device: DeviceId) -> Result<(), LoadError> {
        table.clear();
        if self.checksum(slot, image.len).await? != image.crc {
            return Err(LoadError::Damaged);
        }
        let push = |record: &Record| table.push(record, Some(device)).map(|()| true).map_err(LoadError::Table);
        self.each_record(slot, image.len, push).await?;
        if table.end().is_some() && table.model() == image.model {
            return Ok(());
        }
        table.clear();
        Err(LoadError::Damaged)
    }

    async fn checksum(&mut self, slot: Slot, len: u32) -> Result<u32, LoadError> {
        let mut window = [0; WINDOW];
        let mut crc = CRC.digest();
        let mut next = 0;
        while next < len {
            let part = &mut window[..WINDOW.min((len - next) as usize)];
            self.read(slot, next, part).await?;
            crc.update(part);
            next += part.len() as u32;
        }
        Ok(crc.finalize())
    }

    /// Hands the records of the valid image to `take`, in their order, until it says that it has enough; nothing without
    /// a valid image.
    pub async fn records(&mut self, mut take: impl FnMut(&Record) -> bool) -> Result<(), LoadError> {
        let Some(Valid { slot, image }) = self.valid else { return Ok(()) };
        self.each_record(slot, image.len, |record| Ok(take(record))).await
    }

    /// Hands record after record to `take` until it says that it has enough; a record may lie across two reads. Other
    /// tasks run between two reads.
    async fn each_record(
        &mut self,
        slot: Slot,
        len: u32,
        mut take: impl FnMut(&Record) -> Result<bool, LoadError>,
    ) -> Result<(), LoadError> {
        let mut window = [0; WINDOW];
        let (mut filled, mut next) = (0, 0);
        while next < len {
            let fresh = (WINDOW - filled).min((len - next) as usize);
            self.read(slot, next, &mut window[filled..filled + fresh]).await?;
            filled += fresh;
            next += fresh as u32;
            let Some(used) = take_records(&window[..filled], next == len, &mut take)? else { return Ok(()) };
            window.copy_within(used..filled, 0);
            filled -= used;
            yield_now().await;
        }
        Ok(())
    }

    async fn read(&mut self, slot: Slot, offset: u32, bytes: &mut [u8]) -> Result<(), LoadError> {
        self.records.flash().read(slot.start() + offset, bytes).await.map_err(|_| LoadError::Storage)
    }

    /// Writes the block that ends the upload so far, and erases the page that it begins.
    async fn write_block(&mut self, upload: &mut Upload) -> Result<(), StorageError> {
        let start = (upload.next - 1) / BLOCK as u32 * BLOCK as u32;
        let used = ((upload.next - start) as usize).next_multiple_of(F::WRITE_SIZE);
        let at = upload.slot.start() + start;
        let flash = self.records.flash();
        if at.is_multiple_of(F::ERASE_SIZE as u32) {
            flash.erase(at, at + F::ERASE_SIZE as u32).await.map_err(|_| StorageError)?;
        }
        flash.write(at, &upload.block[..used]).await.map_err(|_| StorageError)?;
        upload.block = [0xff; BLOCK];
        Ok(())
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

/// Takes the records that stand whole in `bytes`; how many bytes they took, or `None` when no more are wanted.
fn take_records(
    bytes: &[u8],
    last: bool,
    take: &mut impl FnMut(&Record) -> Result<bool, LoadError>,
) -> Result<Option<usize>, LoadError> {
    let mut rest = bytes;
    while !rest.is_empty() && (last || rest.len() >= Record::MAX_BYTES) {
        let (record, after) =
            postcard::take_from_bytes::<Record>(rest).map_err(|_| LoadError::Table(TableError::Malformed))?;
        if !take(&record)? {
            return Ok(None);
        }
        rest = after;
    }
    Ok(Some(bytes.len() - rest.len()))
}

#[cfg(test)]
mod tests;
