//! Zero offsets of the servos: stored, applied, and needed before a table with servos is loaded.

use darm_core::sequencer::ServoSeen;
use darm_core::table::Table;
use darm_core::wire::message::{Answer, Calibration, Refusal};
use embedded_storage_async::nor_flash::NorFlash;

use super::{Dispatcher, Write};
use crate::clock::Clock;

impl<F: NorFlash, C: Clock> Dispatcher<'_, '_, F, C> {
    /// What a servo answered last, with the angle of its joint.
    pub(crate) fn joint_seen(&self, index: usize) -> ServoSeen {
        let seen = self.shared.servo_seen(index);
        let offset_rad = self.offsets().offsets_rad().get(index).copied().unwrap_or(0.0);
        ServoSeen { angle_rad: seen.angle_rad - offset_rad, ..seen }
    }

    pub(super) fn offsets(&self) -> Calibration {
        self.calibration.ok().flatten().unwrap_or_default()
    }

    pub(super) async fn calibrate(&mut self, calibration: Calibration) -> Result<Answer, Refusal> {
        self.require_idle().await?;
        // It may have waited for servos to hold.
        self.check_connection()?;
        // What is stored already wears no flash.
        if self.calibration == Ok(Some(calibration)) {
            return self.apply_calibration().await;
        }
        self.store()?;
        self.take_write(Write::Calibration)?;
        let store = self.store()?;
        let stored = store.set_calibration(calibration).await.map_err(|_| Refusal::Storage);
        // After an error only the flash knows which offsets are valid: the next start has those.
        self.calibration = store.calibration().await.map_err(|_| Refusal::NoCalibration);
        let applied = self.apply_calibration().await;
        stored.and(applied)
    }

    /// Gives the offsets to the control tick, which refuses them only while a program runs.
    pub(super) async fn apply_calibration(&self) -> Result<Answer, Refusal> {
        self.shared.calibrate(self.offsets()).await.map(|()| Answer::Done).map_err(|_| Refusal::Busy)
    }

    /// Offsets that are lost are not zero: no table that has servos is loaded with them.
    pub(super) fn check_calibration(&self, table: &Table) -> Result<(), Refusal> {
        if table.wiring().servos.is_empty() { Ok(()) } else { self.calibration.map(|_| ()) }
    }
}
