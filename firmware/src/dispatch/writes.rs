//! How often a host may have the flash written: see [`crate::wear`].

use darm_core::wire::message::Refusal;
use embedded_storage_async::nor_flash::NorFlash;

use super::Dispatcher;
use crate::clock::Clock;
use crate::wear::{Bucket, CALIBRATIONS, TABLES};

/// What is to be written.
#[derive(Clone, Copy)]
pub(super) enum Write {
    Table,
    Calibration,
}

impl<F: NorFlash, C: Clock> Dispatcher<'_, '_, F, C> {
    /// Continues with what the writes before a reset have used up.
    pub(super) fn recall_writes(&mut self) {
        if let Some([tables_ms, calibrations_ms]) = self.board.kept.and_then(|kept| kept.missing_ms()) {
            self.table_writes = Bucket::with_missing(TABLES, tables_ms);
            self.calibration_writes = Bucket::with_missing(CALIBRATIONS, calibrations_ms);
        }
    }

    /// Allows one more write, or says when.
    pub(super) fn take_write(&mut self, write: Write) -> Result<(), Refusal> {
        let now = self.clock.now();
        let bucket = match write {
            Write::Table => &mut self.table_writes,
            Write::Calibration => &mut self.calibration_writes,
        };
        bucket.take(now).map_err(|wait_ms| Refusal::TooSoon { wait_ms })?;
        if let Some(kept) = self.board.kept {
            kept.set_missing_ms([&self.table_writes, &self.calibration_writes].map(|bucket| bucket.missing_ms(now)));
        }
        Ok(())
    }
}
