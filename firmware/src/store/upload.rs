//! An upload: fills the slot that is not valid, block by block.
//!
//! A complete block that comes ahead of the one that is wanted is written to its place at once, so that a lost chunk costs
//! its sender one chunk and not all that were under way behind it.

use darm_core::wire::message::{Image, ImageKind};
use embedded_storage_async::nor_flash::NorFlash;

use super::Store;
use super::error::{StorageError, UploadError};
use super::layout::{KEY_NEWEST, RECORDS, SLOT_BYTES, Slot, slot_bytes};

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
    written: Blocks,
}

/// Blocks of a slot that are in flash, a bit each.
#[derive(Clone, Copy, Debug, Default)]
struct Blocks([u32; SLOT_BYTES / BLOCK / 32]);

impl Blocks {
    /// Whether the block at an offset is written.
    fn has(&self, offset: u32) -> bool {
        let block = offset as usize / BLOCK;
        self.0.get(block / 32).is_some_and(|bits| bits >> (block % 32) & 1 == 1)
    }

    fn add(&mut self, offset: u32) {
        let block = offset as usize / BLOCK;
        if let Some(bits) = self.0.get_mut(block / 32) {
            *bits |= 1 << (block % 32);
        }
    }

    /// Whether some block is written in the page of `page_bytes` that holds an offset.
    fn has_any_in_page(&self, offset: u32, page_bytes: u32) -> bool {
        let first = offset.saturating_sub(offset.checked_rem(page_bytes).unwrap_or(0));
        (first..first.saturating_add(page_bytes)).step_by(BLOCK).any(|block| self.has(block))
    }
}

impl Upload {
    fn new(image: Image, slot: Slot) -> Self {
        Self { image, slot, next: 0, block: [0xff; BLOCK], written: Blocks::default() }
    }

    /// Whether these bytes are a block behind the one that is wanted, which can be written now.
    fn is_ahead(&self, offset: u32, len: usize, end: u32) -> bool {
        let [next, start] = [self.next, offset].map(|at| at as usize);
        let is_block = len == BLOCK || len > 0 && len < BLOCK && end == self.image.len;
        offset > self.next && next.is_multiple_of(BLOCK) && start.is_multiple_of(BLOCK) && is_block
    }

    /// Passes blocks that came ahead.
    fn skip_written(&mut self) {
        while (self.next as usize).is_multiple_of(BLOCK) && self.next < self.image.len && self.written.has(self.next) {
            self.next = self.next.saturating_add(BLOCK as u32).min(self.image.len);
        }
    }

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
                if self.is_profile_lost && image.kind == ImageKind::Profile {
                    // What is lost with it has to be written down before a profile says that nothing is.
                    self.put_doubled(KEY_NEWEST, self.newest).await?;
                }
                let slot = match self.valid(image.kind) {
                    Some(valid) => valid.slot.other(),
                    // The slot that is not erased keeps saying that the board has had a profile.
                    None if image.kind == ImageKind::Profile && !self.is_blank(Slot::A, image.kind).await => Slot::B,
                    None => Slot::A,
                };
                self.upload = Some(Upload::new(image, slot));
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

    /// Takes bytes of the image; the offset wanted next. What has arrived already changes nothing, and what comes too early
    /// only if it is a complete `BLOCK`.
    ///
    /// # Errors
    ///
    /// [`UploadError::NoUpload`]: no upload has begun. [`UploadError::Storage`]: the flash cannot be written, and the
    /// upload is dropped.
    pub async fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<u32, UploadError> {
        let mut upload = self.upload.ok_or(UploadError::NoUpload)?;
        let end = offset.saturating_add(bytes.len() as u32);
        let is_ahead = upload.is_ahead(offset, bytes.len(), end);
        if end > upload.image.len || !is_ahead && offset != upload.next {
            return Ok(upload.next);
        }
        // Until all bytes are in flash the upload counts as lost: a failed write must not be resumed in mid-word.
        self.upload = None;
        if is_ahead {
            upload.block.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
            self.write_block(&mut upload, offset, bytes.len()).await?;
        } else {
            self.append(&mut upload, bytes).await?;
        }
        self.upload = Some(upload);
        Ok(upload.next)
    }

    /// Takes the bytes that are wanted next.
    async fn append(&mut self, upload: &mut Upload, bytes: &[u8]) -> Result<(), StorageError> {
        let mut rest = bytes;
        while !rest.is_empty() {
            rest = upload.take(rest);
            if upload.is_due() {
                let last = upload.next.saturating_sub(1);
                let start = last.saturating_sub((last as usize % BLOCK) as u32);
                self.write_block(upload, start, upload.next.saturating_sub(start) as usize).await?;
            }
        }
        upload.skip_written();
        Ok(())
    }

    /// Whether the upload of this image is under way.
    pub fn is_begun(&self, image: Image) -> bool {
        self.upload.is_some_and(|upload| upload.image == image)
    }

    /// True when every byte of this image has arrived.
    pub fn is_complete(&self, image: Image) -> bool {
        self.upload.is_some_and(|upload| upload.image == image && upload.next == image.len)
    }

    /// Writes the block at an offset, unless it is written, and erases the page before its first block.
    async fn write_block(&mut self, upload: &mut Upload, start: u32, len: usize) -> Result<(), StorageError> {
        if !upload.written.has(start) {
            let page_bytes = F::ERASE_SIZE as u32;
            let at = upload.slot.start(upload.image.kind, F::ERASE_SIZE).saturating_add(start);
            let flash = self.records.flash();
            if !upload.written.has_any_in_page(start, page_bytes) {
                let page = at.saturating_sub(at.checked_rem(page_bytes).unwrap_or(0));
                flash.erase(page, page.saturating_add(page_bytes)).await.map_err(|_| StorageError)?;
            }
            let due = upload.block.get(..len.next_multiple_of(F::WRITE_SIZE)).unwrap_or_default();
            flash.write(at, due).await.map_err(|_| StorageError)?;
            upload.written.add(start);
        }
        upload.block = [0xff; BLOCK];
        Ok(())
    }
}

#[cfg(test)]
mod tests;
