//! What a start puts in force: the stored profile, calibration and table.

use darm_core::profile::Profile;
use darm_core::table::Table;
use darm_core::wire::message::Refusal;
use embedded_storage_async::nor_flash::NorFlash;

use super::Dispatcher;
use crate::clock::Clock;
use crate::store::Store;

impl<'t, F: NorFlash, C: Clock> Dispatcher<'_, 't, F, C> {
    /// Opens the store, puts the stored profile in force, loads the valid table and hands it to the control tick, which
    /// must be running. On a board that has verifiably never had a profile the one that is built in is in force; with one that
    /// is lost or cannot be read, and without a flash to read it from, nothing is driven.
    pub async fn open(&mut self, flash: Option<F>, table: &'t mut Table, profile: &'t mut Profile) {
        self.recall_writes();
        if let Some(flash) = flash {
            let mut store = Store::open(flash).await;
            match store.load_valid_profile(profile).await {
                Ok(true) => match self.board.caps.check(profile) {
                    Ok(()) => self.profile = profile,
                    // Written by the firmware of another board.
                    Err(error) => self.drive_nothing(profile, Refusal::Profile(error)),
                },
                // The built-in limits are for a board that never had a profile, not for one whose profile is damaged or lost.
                Ok(false) if !store.is_profile_lost() => {}
                Ok(false) => self.drive_nothing(profile, Refusal::Storage),
                Err(error) => self.drive_nothing(profile, error.into()),
            }
            self.calibration = store.calibration().await.map_err(|_| Refusal::NoCalibration);
            self.store = Some(store);
        } else {
            self.drive_nothing(profile, Refusal::Storage);
        }
        self.shared.configure(self.profile).await;
        // While the flash is written nobody looks after a servo that an earlier run left on its way.
        self.wait_until_stopped().await;
        if let Some(store) = &mut self.store {
            self.boots = store.count_boot().await.unwrap_or(0);
        }
        if self.apply_calibration().await.is_err() {
            self.calibration = Err(Refusal::NoCalibration);
        }
        self.restore(table).await;
    }

    fn drive_nothing(&mut self, profile: &'t mut Profile, reason: Refusal) {
        *profile = Profile::empty();
        self.profile = profile;
        self.shared.lose_servos();
        self.rejected = Some(reason);
    }
}
