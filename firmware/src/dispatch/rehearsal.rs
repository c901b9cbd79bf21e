//! Rehearses a program before it is played: the limits of all outputs judge its rows after what has flowed before.

use darm_core::sequencer::{Command, Phase};
use darm_core::table::{RowError, Table, TableError};
use darm_core::wire::message::Refusal;
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

use super::Dispatcher;
use crate::clock::Clock;

/// Rows that are rehearsed at once: the console is heard in between.
const REHEARSED: usize = 16;

impl<F: NorFlash, C: Clock> Dispatcher<'_, '_, F, C> {
    /// Refuses a program that would exceed the limit of an output because of what has flowed before.
    pub(super) async fn rehearse(&mut self) -> Result<(), Refusal> {
        let now = self.shared.snapshot().await;
        match now.phase {
            Phase::Idle if !now.is_moving => {}
            // Nobody looks after a servo that moves while the table is away: it is held first.
            Phase::Idle | Phase::Manual => {
                let _ = self.shared.command(Command::Stop, self.stops).await;
            }
            // The control tick refuses, and says why.
            Phase::Approaching { .. } | Phase::Playing { .. } | Phase::Safe(_) => return Ok(()),
        }
        let Some(table) = self.shared.rehearse().await else { return Ok(()) };
        let rehearsed = rehearse(table).await;
        self.hand_over(table).await;
        match rehearsed {
            Err(TableError::Row { row, error: RowError::OnTooLong { output } | RowError::Duty { output } }) => {
                let wait_ms = self.shared.output_state(output).await.map_or(0, |state| state.recovery_ms);
                Err(Refusal::Recovering { row, output, wait_ms })
            }
            rehearsed => rehearsed.map_err(Refusal::Table),
        }
    }
}

/// Lets the limits of all outputs judge the rows, a few at a time.
async fn rehearse(table: &mut Table) -> Result<(), TableError> {
    let n_rows = table.rows().len();
    for first in (0..n_rows.max(1)).step_by(REHEARSED) {
        table.rehearse(first..first.saturating_add(REHEARSED).min(n_rows))?;
        yield_now().await;
    }
    Ok(())
}
