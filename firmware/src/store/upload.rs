//! An upload: fills the slot that is not valid, block by block.

use darm_core::wire::message::Image;
use embedded_storage_async::nor_flash::NorFlash;

use super::Store;
use super::error::{StorageError, UploadError};
use super::layout::{RECORDS, Slot, slot_bytes};

/// Bytes of an upload that are written at once: a multiple of the flash's word, a divisor of its page.
pub(super) const BLOCK: usize = 256;

/// The upload that is under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Upload {
    pub(super) image: Image,
    pub(super) slot: Slot,
    /// Bytes that have arrived, in order.
    pub(super) next: u32,
    /// The last of them, not yet in flash; the block starts at a multiple of its length.
    pub(super) block: [u8; BLOCK],
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

impl<F: NorFlash> Store<F> {
    /// Starts an upload, or resumes the same one; the offset that is wanted next.
    ///
    /// # Errors
    ///
    /// [`UploadError::TooLong`]: the image is empty or longer than a slot. [`UploadError::Storage`]: records that
    /// cannot be read cannot be erased either.
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
    ///
    /// # Errors
    ///
    /// [`UploadError::NoUpload`]: no upload has begun. [`UploadError::Storage`]: the flash cannot be written, and the
    /// upload is dropped.
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
    pub fn is_complete(&self, image: Image) -> bool {
        self.upload.is_some_and(|upload| upload.image == image && upload.next == image.len)
    }

    /// Writes the block that ends the upload so far, and erases the page that it begins.
    async fn write_block(&mut self, upload: &mut Upload) -> Result<(), StorageError> {
        let last = upload.next.saturating_sub(1);
        let start = last.saturating_sub((last as usize % BLOCK) as u32);
        let used = (upload.next.saturating_sub(start) as usize).next_multiple_of(F::WRITE_SIZE);
        let at = upload.slot.start(upload.image.kind, F::ERASE_SIZE).saturating_add(start);
        let flash = self.records.flash();
        if at.is_multiple_of(F::ERASE_SIZE as u32) {
            flash.erase(at, at.saturating_add(F::ERASE_SIZE as u32)).await.map_err(|_| StorageError)?;
        }
        let due = upload.block.get(..used).unwrap_or_default();
        flash.write(at, due).await.map_err(|_| StorageError)?;
        upload.block = [0xff; BLOCK];
        Ok(())
    }
}
