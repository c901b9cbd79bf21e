//! A flash in memory, for a board whose driver of the real one is still to be written: all of it works but what must
//! survive a power cut.
//!
//! It has pages of 2 KiB and keeps those that are not blank, as many as there is memory for; one more is refused as a worn
//! page would be. In memory that start-up code does not clear it outlives a reset, and an emulator can load it.
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use embedded_storage_async::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, NorFlashErrorKind, ReadNorFlash};

use crate::store::flash_bytes;

/// Bytes of a page.
pub const PAGE: usize = 2048;
/// Bytes that are written at once.
const WORD: usize = 8;
/// Begins pages that are in use; distinguishes them from the noise after power-on.
pub const MAGIC: u32 = u32::from_le_bytes(*b"darm");
/// Number of a page that is kept nowhere.
const FREE: u16 = u16::MAX;
const LENGTH: usize = flash_bytes(PAGE);

#[derive(Clone, Copy)]
#[repr(C)]
struct Page {
    number: u16,
    bytes: [u8; PAGE],
}

/// Memory as an emulator loads it: [`MAGIC`], then for each page its number and its bytes; little endian, no gaps.
#[repr(C)]
struct Content<const N: usize> {
    magic: u32,
    pages: [Page; N],
}

/// Memory for `N` pages, with any content.
pub struct PageMemory<const N: usize>(UnsafeCell<MaybeUninit<Content<N>>>);

// SAFETY: whoever calls `open` promises that one `SparseFlash` refers to it.
unsafe impl<const N: usize> Sync for PageMemory<N> {}

impl<const N: usize> PageMemory<N> {
    /// Memory with any content.
    pub const fn new() -> Self {
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }

    /// The flash in it: blank, unless this memory holds one.
    ///
    /// # Safety
    ///
    /// It is called once. The memory is in a section that holds some bytes: start-up code neither has to clear nor to fill it.
    pub unsafe fn open(&'static self) -> SparseFlash<N> {
        // SAFETY: every bit pattern is valid; nothing else refers to it, as this is called once.
        let content = unsafe { (*self.0.get()).assume_init_mut() };
        if content.magic != MAGIC {
            content.magic = MAGIC;
            content.pages.iter_mut().for_each(|page| page.number = FREE);
        }
        SparseFlash(&mut content.pages)
    }
}

impl<const N: usize> Default for PageMemory<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// The flash.
pub struct SparseFlash<const N: usize>(&'static mut [Page; N]);

impl<const N: usize> SparseFlash<N> {
    fn page(&mut self, number: u16) -> Option<&mut Page> {
        self.0.iter_mut().find(|page| page.number == number)
    }

    fn cell(&mut self, at: usize) -> Option<&mut u8> {
        self.page((at / PAGE) as u16)?.bytes.get_mut(at % PAGE)
    }
}

/// The addresses of some bytes within the flash.
fn addresses(offset: u32, len: usize) -> Result<core::ops::Range<usize>, NorFlashErrorKind> {
    let start = offset as usize;
    let end = start.checked_add(len).filter(|end| *end <= LENGTH).ok_or(NorFlashErrorKind::OutOfBounds)?;
    Ok(start..end)
}

impl<const N: usize> ErrorType for SparseFlash<N> {
    type Error = NorFlashErrorKind;
}

impl<const N: usize> ReadNorFlash for SparseFlash<N> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        for (at, byte) in addresses(offset, bytes.len())?.zip(bytes) {
            *byte = self.cell(at).map_or(0xff, |cell| *cell);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        LENGTH
    }
}

impl<const N: usize> NorFlash for SparseFlash<N> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let len = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)?;
        for at in addresses(from, len as usize)?.step_by(PAGE) {
            if let Some(page) = self.page((at / PAGE) as u16) {
                page.number = FREE;
            }
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        if !(offset as usize).is_multiple_of(WORD) || !bytes.len().is_multiple_of(WORD) {
            return Err(NorFlashErrorKind::NotAligned);
        }
        for (at, byte) in addresses(offset, bytes.len())?.zip(bytes) {
            if self.cell(at).is_none() {
                let free = self.page(FREE).ok_or(NorFlashErrorKind::Other)?;
                *free = Page { number: (at / PAGE) as u16, bytes: [0xff; PAGE] };
            }
            if let Some(cell) = self.cell(at) {
                *cell &= byte;
            }
        }
        Ok(())
    }
}

/// A written byte may be written again: bits go from 1 to 0.
impl<const N: usize> MultiwriteNorFlash for SparseFlash<N> {}

#[cfg(test)]
mod tests {
    use embassy_futures::block_on;

    use super::*;

    fn blank<const N: usize>() -> SparseFlash<N> {
        let memory = Box::leak(Box::new(PageMemory(UnsafeCell::new(MaybeUninit::zeroed()))));
        // SAFETY: called once, on memory that holds zeros.
        unsafe { memory.open() }
    }

    #[test]
    fn it_keeps_what_a_flash_of_full_length_keeps() {
        let (mut sparse, mut full) = (blank::<4>(), vec![0xff_u8; LENGTH]);
        let places = [0, 8, PAGE - 8, 3 * PAGE + 16, LENGTH - 16, PAGE - 16];
        for (round, at) in places.into_iter().cycle().take(40).enumerate() {
            let bytes: [u8; 16] = core::array::from_fn(|k| (37 * round + 11 * k) as u8);
            block_on(sparse.write(at as u32, &bytes)).unwrap();
            full[at..at + 16].iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
            if round % 7 == 6 {
                let page = at / PAGE * PAGE;
                block_on(sparse.erase(page as u32, (page + PAGE) as u32)).unwrap();
                full[page..page + PAGE].fill(0xff);
            }
            let mut read = vec![0; LENGTH];
            block_on(sparse.read(0, &mut read)).unwrap();
            assert!(read == full, "round {round}");
        }
    }

    #[test]
    fn it_refuses_what_it_has_no_place_for() {
        let (mut flash, word) = (blank::<2>(), [0; WORD]);
        block_on(flash.write(0, &word)).unwrap();
        block_on(flash.write(PAGE as u32, &word)).unwrap();
        assert_eq!(block_on(flash.write(2 * PAGE as u32, &word)), Err(NorFlashErrorKind::Other));
        assert_eq!(block_on(flash.write(LENGTH as u32, &word)), Err(NorFlashErrorKind::OutOfBounds));
        assert_eq!(block_on(flash.write(4, &word)), Err(NorFlashErrorKind::NotAligned));
        block_on(flash.erase(0, PAGE as u32)).unwrap();
        block_on(flash.write(2 * PAGE as u32, &word)).unwrap();
    }
}
