//! The second MiB of the flash as NOR flash: sectors of 4 KiB, all that is written is read back.
//!
//! The code runs from the same chip: while it is erased (45 ms, at most 400 ms) or written (0.4 ms, at most 3 ms a page;
//! W25Q16JV, AC characteristics) interrupts are masked and no control tick runs. The dispatcher writes only while no
//! output is on, so what is late is a tick that has nothing to switch. A stop that comes meanwhile is obeyed after it, and
//! the watchdog waits as long.
use darm_core::units::Micros;
use darm_firmware::store::flash_bytes;
use embassy_futures::yield_now;
use embassy_rp::flash::{self, Blocking, ERASE_SIZE, Error};
use embassy_rp::peripherals::FLASH;
use embedded_storage_async::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, ReadNorFlash};

use crate::watchdog::feed;

/// All of the chip.
const CHIP_BYTES: usize = 2 * 1024 * 1024;
/// Where the part of this driver begins, behind the code.
const START: u32 = 1024 * 1024;
const LENGTH: usize = flash_bytes(ERASE_SIZE);
/// Bytes that are written at once: a page.
const PAGE: usize = 256;
/// Longest time of one operation.
const LONGEST: Micros = Micros::from_millis(500);

type Chip = flash::Flash<'static, FLASH, Blocking, CHIP_BYTES>;

/// The part of the flash that holds slots and records.
pub(crate) struct Flash(Chip);

impl Flash {
    /// Takes the flash.
    pub(crate) fn open() -> Self {
        // SAFETY: the number is read at start; afterwards the console alone has the flash.
        Self(flash::Flash::new_blocking(unsafe { FLASH::steal() }))
    }
}

/// The chip's own number; zeros where it has none. At start only: it masks interrupts.
pub(crate) fn unique_id() -> [u8; 8] {
    let mut id = [0; 8];
    // A chip without a number keeps the zeros.
    let _ = Flash::open().0.blocking_unique_id(&mut id);
    id
}

fn check(offset: u32, len: usize) -> Result<u32, Error> {
    let is_inside = (offset as usize).checked_add(len).is_some_and(|end| end <= LENGTH);
    if is_inside { Ok(START.saturating_add(offset)) } else { Err(Error::OutOfBounds) }
}

/// Does something during which no control tick runs.
fn masked<T>(work: impl FnOnce() -> T) -> T {
    critical_section::with(|_| {
        feed(LONGEST);
        work()
    })
}

impl ErrorType for Flash {
    type Error = Error;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        let at = check(offset, bytes.len())?;
        self.0.blocking_read(at, bytes)
    }

    fn capacity(&self) -> usize {
        LENGTH
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let len = to.checked_sub(from).ok_or(Error::OutOfBounds)?;
        let start = check(from, len as usize)?;
        for sector in (start..start.saturating_add(len)).step_by(ERASE_SIZE) {
            masked(|| self.0.blocking_erase(sector, sector.saturating_add(ERASE_SIZE as u32)))?;
            // The ticks that waited run now.
            yield_now().await;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        let mut at = check(offset, bytes.len())?;
        let mut rest = bytes;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(rest.len().min(PAGE - at as usize % PAGE));
            masked(|| self.0.blocking_write(at, now))?;
            let mut back = [0; PAGE];
            let back = back.get_mut(..now.len()).unwrap_or_default();
            self.0.blocking_read(at, back)?;
            if back != now {
                return Err(Error::Other);
            }
            (at, rest) = (at.saturating_add(now.len() as u32), later);
            yield_now().await;
        }
        Ok(())
    }
}

/// A written byte may be written again: bits go from 1 to 0.
impl MultiwriteNorFlash for Flash {}
