//! Uploads of tables and profiles: taken piece by piece, checked when complete, then made valid.

use darm_core::profile::Profile;
use darm_core::table::Table;
use darm_core::wire::bootstrap;
use darm_core::wire::message::{Answer, Image, ImageKind, Refusal};
use embedded_storage_async::nor_flash::NorFlash;

use super::{Dispatcher, Write};
use crate::clock::Clock;

impl<F: NorFlash, C: Clock> Dispatcher<'_, '_, F, C> {
    pub(super) async fn begin(&mut self, image: Image) -> Result<Answer, Refusal> {
        self.require_idle().await?;
        match image.kind {
            // An upload wears the flash, erases records that cannot be read, and leaves a board that never had a profile with a
            // lost one where it ends early. The upload that is under way continues without the button, up to its commit.
            ImageKind::Profile if self.store()?.is_begun(image) || self.shared.snapshot().await.button => {}
            ImageKind::Profile => return Err(Refusal::NobodyPresent),
            ImageKind::Table if self.store()?.is_profile_lost() => return Err(Refusal::Storage),
            ImageKind::Table if self.store()?.is_begun(image) => {}
            ImageKind::Table => self.take_write(Write::Table)?,
        }
        let next = self.store()?.begin(image).await?;
        Ok(Answer::Upload { next })
    }

    pub(super) async fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<Answer, Refusal> {
        self.require_idle().await?;
        let next = self.store()?.chunk(offset, bytes).await?;
        Ok(Answer::Upload { next })
    }

    /// Fills the one table in memory from the new image, and only then makes the image valid.
    pub(super) async fn commit(&mut self, image: Image) -> Result<Answer, Refusal> {
        self.require_idle().await?;
        if !self.store()?.is_complete(image) {
            return Err(Refusal::NoUpload);
        }
        if image.kind == ImageKind::Profile {
            return self.commit_profile().await;
        }
        let table = self.take_table().await?;
        let result = self.check_and_commit(table).await;
        match result {
            Ok(()) => {
                let rows = table.rows().len() as u16;
                self.rejected = None;
                self.hand_over(table).await;
                Ok(Answer::Committed { rows })
            }
            Err(refusal) => {
                self.restore(table).await;
                Err(refusal)
            }
        }
    }

    async fn check_and_commit(&mut self, table: &mut Table) -> Result<(), Refusal> {
        let board = self.board_of_tables();
        let store = self.store()?;
        store.load_upload(table, &board).await?;
        self.check_calibration(table)?;
        Ok(self.store()?.commit().await?)
    }

    /// Stores a profile if a person is at the board, and restarts with it: nothing of the old one stays in force.
    async fn commit_profile(&mut self) -> Result<Answer, Refusal> {
        let mut profile = Profile::empty();
        self.store()?.load_profile_upload(&mut profile).await?;
        self.board.caps.check(&profile).map_err(Refusal::Profile)?;
        if !self.shared.snapshot().await.button {
            return Err(Refusal::NobodyPresent);
        }
        self.store()?.commit().await?;
        self.is_profile_new = true;
        self.reboot = Some(bootstrap::RebootTarget::Application);
        Ok(Answer::Done)
    }
}
