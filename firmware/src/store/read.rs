//! Reads images: their digest, and record after record.

use core::cell::Cell;

use darm_core::profile::{Profile, ProfileError, ProfileReader, ProfileRecord};
use darm_core::table::{Board, Record, Table, TableError};
use darm_core::wire::message::{Image, ImageKind};
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;
use serde::Deserialize;
use sha2::{Digest as _, Sha256};

use super::error::LoadError;
use super::layout::{Slot, slot_pitch};
use super::{Store, Valid};

/// Bytes of the image in memory while it is checked: what one record can need, and a read of a useful size.
const WINDOW: usize = 256;

impl<F: NorFlash> Store<F> {
    pub(super) async fn load(
        &mut self,
        slot: Slot,
        image: Image,
        table: &mut Table,
        board: &Board<'_>,
    ) -> Result<(), LoadError> {
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

    pub(super) async fn load_profile(
        &mut self,
        slot: Slot,
        image: Image,
        profile: &mut Profile,
    ) -> Result<(), LoadError> {
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
    ///
    /// # Errors
    ///
    /// The image in the slot is damaged or has bytes that are not a record, or the flash cannot be read.
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

    /// Whether every byte of a slot, to the end of its pages, can be read and is erased.
    pub(super) async fn is_blank(&mut self, slot: Slot, kind: ImageKind) -> bool {
        let mut window = [0; WINDOW];
        for offset in (0..slot_pitch(kind, F::ERASE_SIZE) as u32).step_by(WINDOW) {
            if self.read(slot, kind, offset, &mut window).await.is_err() || window.iter().any(|byte| *byte != 0xff) {
                return false;
            }
            yield_now().await;
        }
        true
    }

    async fn read(&mut self, slot: Slot, kind: ImageKind, offset: u32, bytes: &mut [u8]) -> Result<(), LoadError> {
        let at = slot.start(kind, F::ERASE_SIZE).saturating_add(offset);
        self.records.flash().read(at, bytes).await.map_err(|_| LoadError::Storage)
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
