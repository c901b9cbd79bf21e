//! Searches for the word that is nearest to a pose, in pieces between which the console is served.

use core::future::pending;

use darm_core::nearest::{Coordinates, Found};
use darm_core::table::nearest_search;
use darm_core::wire::bootstrap::ANSWER;
use darm_core::wire::frame::Header;
use darm_core::wire::message::{Answer, Refusal};
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

use super::encode::encode;
use super::{Dispatcher, Frame};
use crate::clock::Clock;

impl<F: NorFlash, C: Clock> Dispatcher<'_, '_, F, C> {
    /// A word that brings the tool near a pose in the base, by the frames in the stored table. A stop ends the search.
    pub(crate) async fn nearest(&mut self, target: &Coordinates) -> Result<Found<f32>, Refusal> {
        self.pending_search = None;
        self.begin_nearest(target).await?;
        while self.room.step() {
            yield_now().await;
            self.shared.check_stops(self.stops).map_err(Refusal::Command)?;
        }
        self.room.found().ok_or(Refusal::NoFrames)
    }

    /// Reads the frames.
    pub(super) async fn begin_nearest(&mut self, target: &Coordinates) -> Result<(), Refusal> {
        if !target.is_sound() {
            return Err(Refusal::NoPose);
        }
        let table = self.shared.summary().await.ok_or(Refusal::NoFrames)?;
        let store = self.store.as_mut().ok_or(Refusal::Storage)?;
        self.room.begin(&target.pose(), table.actuators.into());
        store.records(|record| nearest_search::feed(self.room, record)).await?;
        self.room.found().map(|_| ()).ok_or(Refusal::NoFrames)
    }

    /// Searches on for the nearest word that was last requested; the frame that answers, once it is found. Waits for
    /// ever where there is nothing to seek. It may be dropped at any time, and continues where it was.
    pub async fn seek(&mut self) -> Frame {
        while let Some(header) = self.pending_search {
            if !self.room.step() {
                self.pending_search = None;
                let reply = self.reply(self.room.found().map(Answer::Nearest).ok_or(Refusal::NoFrames));
                if let Some(frame) = encode(Header { tag: header.tag | ANSWER, ..header }, &reply) {
                    return frame;
                }
            }
            yield_now().await;
        }
        pending().await
    }
}
