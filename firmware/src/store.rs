//! What survives power: two slots for table images, and a few small records.
//!
//! | bytes from the start           | holds                                                                |
//! |--------------------------------|----------------------------------------------------------------------|
//! | 0 to 64 KiB                    | slot A: a table image                                                |
//! | 64 to 128 KiB                  | slot B: a table image                                                |
//! | 128 to 144 KiB                 | records: valid slots, calibration, number of starts, newest versions |
//! | 144 to 148 KiB                 | slots A and B of the board profile, a page each                      |
//!
//! Where a page is longer than 2 KiB, a profile's slot is as long as a page.
//!
//! An upload fills the slot that is not valid. Writing the record that names it is the commit: before, the old image
//! is there, after it the new one, and the records survive a power cut at any byte. The record carries length, digest
//! and model of the image, so a slot is believed only when its bytes agree. Each record is written twice: one that is damaged
//! reads as none, and would leave the board with no offsets or no profile. Where both copies are, the record is lost, and no older
//! one is taken for it (`newest.rs`).
//!
//! Records that cannot be read (a failed part, or what another program has left) are erased by the next upload of a profile. Until
//! then there is no table and no profile. What is erased with them is the calibration: it counts as lost from then on, not as zero.
//!
//! A board has never had a profile where its records are readable and name none, and both slots of profiles are blank: every
//! byte is 0xff. Everything else that is not a valid profile is a [lost](Store::is_profile_lost) one. The slots are the marker
//! apart from the records: the first upload fills one, and from then on one of them is never blank, also while the other is
//! erased, since an upload takes a slot that is not blank only where the other one is not blank either. Earlier firmware filled
//! them in the same way, so that nothing has to be brought over.
//!
//! None of these futures may be dropped half-way: never put one into a `select!`.
mod doubled;
mod error;
mod layout;
mod newest;
mod read;
mod upload;

use darm_core::profile::Profile;
use darm_core::table::{Board, Table};
use darm_core::units::Digest;
use darm_core::wire::message::{Calibration, Image, ImageKind};
use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};
use serde::{Deserialize, Serialize};

pub use error::{LoadError, StorageError, UploadError};
pub use layout::{FLASH_BYTES, PROFILE_BYTES, SLOT_BYTES, flash_bytes, slot_bytes};
use layout::{KEY_CALIBRATION, KEY_NEWEST, RECORDS, Slot, valid_key};
use newest::Newest;
use upload::{BLOCK, Upload};

/// The record that makes a slot valid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Valid {
    slot: Slot,
    image: Image,
}

/// The flash with its slots and records.
pub struct Store<F: NorFlash> {
    records: MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>,
    table: Option<Valid>,
    profile: Option<Valid>,
    upload: Option<Upload>,
    newest: Newest,
    /// The records could not be read: a new upload erases them.
    unreadable: bool,
    /// There was a profile, or may have been one, and none is valid.
    is_profile_lost: bool,
}

impl<F: NorFlash> Store<F> {
    /// Opens the store and finds which slots are valid. Nothing is written: a start does that once its servos are held.
    pub async fn open(flash: F) -> Self {
        const { assert!(F::READ_SIZE == 1 && BLOCK.is_multiple_of(F::WRITE_SIZE)) };
        const { assert!(SLOT_BYTES.is_multiple_of(F::ERASE_SIZE) && F::ERASE_SIZE.is_multiple_of(BLOCK)) };
        const { assert!(PROFILE_BYTES.is_multiple_of(F::ERASE_SIZE) || F::ERASE_SIZE.is_multiple_of(PROFILE_BYTES)) };
        let records = MapStorage::new(flash, const { MapConfig::new(RECORDS) }, Cache::new_uncached());
        let (unreadable, is_profile_lost) = (false, false);
        let newest = Newest::default();
        let mut store = Self { records, table: None, profile: None, upload: None, newest, unreadable, is_profile_lost };
        match store.fetch_doubled::<Newest>(KEY_NEWEST).await {
            Ok(newest) => store.newest = newest.unwrap_or_default(),
            Err(StorageError) => store.unreadable = true,
        }
        for kind in [ImageKind::Table, ImageKind::Profile] {
            match store.fetch_doubled::<Valid>(valid_key(kind)).await {
                Ok(valid) => *store.valid_mut(kind) = valid,
                Err(StorageError) => store.unreadable = true,
            }
        }
        store.is_profile_lost = store.profile.is_none() && (store.unreadable || !store.has_blank_profiles().await);
        if store.is_profile_lost {
            // Offsets may be lost with it, and none would count as zero.
            store.newest.calibration = store.newest.calibration.max(1);
        }
        store
    }

    /// Whether the board has, or may have, had a profile of which no valid record is left. Only a board that has
    /// verifiably never had one may have the limits that are built in.
    pub fn is_profile_lost(&self) -> bool {
        self.is_profile_lost
    }

    async fn has_blank_profiles(&mut self) -> bool {
        self.is_blank(Slot::A, ImageKind::Profile).await && self.is_blank(Slot::B, ImageKind::Profile).await
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

    /// Counts this start, returns how many there were, and writes again what is damaged of a record whose other copy is good.
    ///
    /// # Errors
    ///
    /// The flash cannot be read or written.
    pub async fn count_boot(&mut self) -> Result<u32, StorageError> {
        if self.unreadable {
            return Err(StorageError);
        }
        let newest = Newest { starts: self.newest.starts.saturating_add(1), ..self.newest };
        self.put_doubled(KEY_NEWEST, newest).await?;
        self.newest = newest;
        for kind in [ImageKind::Table, ImageKind::Profile] {
            self.repair::<Valid>(valid_key(kind)).await;
        }
        self.repair::<Calibration>(KEY_CALIBRATION).await;
        Ok(newest.starts)
    }

    /// The stored zero offsets.
    ///
    /// # Errors
    ///
    /// The flash cannot be read, or the newest offsets are lost: older ones would turn the joints.
    pub async fn calibration(&mut self) -> Result<Option<Calibration>, StorageError> {
        let stored = self.fetch_doubled(KEY_CALIBRATION).await?;
        if stored.is_none() && *self.newest.version(KEY_CALIBRATION) > 0 { Err(StorageError) } else { Ok(stored) }
    }

    /// Stores the zero offsets.
    ///
    /// # Errors
    ///
    /// The flash cannot be written.
    pub async fn set_calibration(&mut self, calibration: Calibration) -> Result<(), StorageError> {
        self.replace(KEY_CALIBRATION, calibration).await
    }

    /// Checks the complete image that has arrived and fills `table` from it. Nothing is committed yet.
    ///
    /// # Errors
    ///
    /// [`LoadError::Damaged`]: there is no upload, or its length, digest or model differ from what was announced.
    /// [`LoadError::Table`]: the table breaks a limit. [`LoadError::Storage`]: the flash cannot be read. The upload is
    /// dropped then.
    pub async fn load_upload(&mut self, table: &mut Table, board: &Board<'_>) -> Result<(), LoadError> {
        let Upload { slot, image, .. } = self.upload.ok_or(LoadError::Damaged)?;
        let loaded = self.load(slot, image, table, board).await;
        if loaded.is_err() {
            self.upload = None;
        }
        loaded
    }

    /// The same of a profile.
    ///
    /// # Errors
    ///
    /// As [`load_upload`](Self::load_upload), but for [`LoadError::Profile`]: the board could not run the profile
    /// safely.
    pub async fn load_profile_upload(&mut self, profile: &mut Profile) -> Result<(), LoadError> {
        let Upload { slot, image, .. } = self.upload.ok_or(LoadError::Damaged)?;
        let loaded = self.load_profile(slot, image, profile).await;
        if loaded.is_err() {
            self.upload = None;
        }
        loaded
    }

    /// Makes the uploaded image the valid one: the one write that replaces it.
    ///
    /// # Errors
    ///
    /// [`UploadError::NoUpload`]: no upload has begun. [`UploadError::Storage`]: the flash cannot be written; which
    /// image is valid is read from it again.
    pub async fn commit(&mut self) -> Result<(), UploadError> {
        let upload = self.upload.take().ok_or(UploadError::NoUpload)?;
        let kind = upload.image.kind;
        let stored = self.replace(valid_key(kind), Valid { slot: upload.slot, image: upload.image }).await;
        // After an error only the flash knows whether the record is valid.
        *self.valid_mut(kind) = self.fetch_doubled(valid_key(kind)).await?;
        self.is_profile_lost &= self.profile.is_none();
        stored?;
        Ok(())
    }

    /// Fills `table` from the valid slot; false, and an empty table, when there is none.
    ///
    /// # Errors
    ///
    /// The image in the slot is damaged, the table breaks a limit, or the flash cannot be read.
    pub async fn load_valid(&mut self, table: &mut Table, board: &Board<'_>) -> Result<bool, LoadError> {
        table.clear();
        let Some(Valid { slot, image }) = self.table else { return Ok(false) };
        self.load(slot, image, table, board).await.map(|()| true)
    }

    /// Fills `profile` from its valid slot; false when there is none.
    ///
    /// # Errors
    ///
    /// The image in the slot is damaged, the board could not run the profile safely, or the flash cannot be read.
    pub async fn load_valid_profile(&mut self, profile: &mut Profile) -> Result<bool, LoadError> {
        let Some(Valid { slot, image }) = self.profile else { return Ok(false) };
        self.load_profile(slot, image, profile).await.map(|()| true)
    }

    /// Puts in the place of the calibration what cannot be read as one.
    #[cfg(test)]
    pub(crate) async fn spoil_calibration(&mut self) {
        for key in [KEY_CALIBRATION, KEY_CALIBRATION | layout::SECOND] {
            assert_eq!(self.put(key, &7u8).await, Ok(()));
        }
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

#[cfg(test)]
mod tests;
