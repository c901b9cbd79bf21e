//! The table between store and control tick: taken back, loaded, handed over.

use darm_core::table::{self, Table};
use darm_core::units::Digest;
use darm_core::wire::message::{ImageKind, Refusal};
use embedded_storage_async::nor_flash::NorFlash;

use super::Dispatcher;
use crate::clock::Clock;

impl<'t, F: NorFlash, C: Clock> Dispatcher<'_, 't, F, C> {
    /// Digest of the table that was loaded.
    pub(crate) fn table_digest(&self) -> Option<Digest> {
        self.store.as_ref().and_then(|store| store.digest(ImageKind::Table))
    }

    /// Takes the table out of the control tick's hands.
    pub(super) async fn take_table(&mut self) -> Result<&'t mut Table, Refusal> {
        match self.table.take() {
            Some(table) => Ok(table),
            None => self.shared.unload().await.ok_or(Refusal::Busy),
        }
    }

    /// Loads the valid table, if there is one, and hands it over; else keeps the empty table.
    pub(super) async fn restore(&mut self, table: &'t mut Table) {
        let board = self.board_of_tables();
        let loaded = match &mut self.store {
            Some(store) if self.rejected != Some(Refusal::Storage) => store.load_valid(table, &board).await,
            _ => Ok(false),
        };
        let checked = match loaded {
            Ok(is_loaded) => self.check_calibration(table).map(|()| is_loaded),
            Err(error) => Err(error.into()),
        };
        match checked {
            Ok(true) => return self.hand_over(table).await,
            Ok(false) => {}
            Err(refusal) => {
                self.rejected.get_or_insert(refusal);
                table.clear();
            }
        }
        self.table = Some(table);
    }

    pub(super) fn board_of_tables(&self) -> table::Board<'t> {
        table::Board { device: Some(self.device()), profile: self.profile }
    }

    /// Gives the table to the control tick.
    pub(super) async fn hand_over(&mut self, table: &'t mut Table) {
        self.table = self.shared.load(table).await;
    }
}
