//! What the board does now, as a host asks: state, servos, on-times of the outputs.

use darm_core::output::MAX_COILS;
use darm_core::wire::health::{ChainHealth, Health};
use darm_core::wire::message::{OUTPUTS, OutputState, Status};
use embedded_storage_async::nor_flash::NorFlash;

use super::Dispatcher;
use crate::clock::Clock;

impl<F: NorFlash, C: Clock> Dispatcher<'_, '_, F, C> {
    pub(super) async fn outputs(&self, from: u8) -> heapless::Vec<OutputState, OUTPUTS> {
        let mut outputs = heapless::Vec::new();
        for number in from..MAX_COILS as u8 {
            if outputs.is_full() {
                break;
            }
            if let Some(output) = self.shared.output_state(number).await {
                let _ = outputs.push(output);
            }
        }
        outputs
    }

    /// What the board reports of itself, with what the tasks have counted.
    ///
    /// Not inlined: the analysis of the image knows this caller of a board's function, see `xtask/src/image/lists.rs`.
    #[inline(never)]
    pub(crate) fn health(&self) -> Health {
        let health = (self.board.health)();
        let chain = health.chain.map(|chain| ChainHealth { errors: self.shared.chain_errors(), ..chain });
        Health {
            chain,
            servos_unanswered: self.shared.servos_unanswered(),
            supply_mv: self.shared.supply_mv(),
            chip_celsius: self.shared.chip_celsius(),
            min_supply_mv: self.profile.min_supply_mv,
            ..health
        }
    }

    pub(super) async fn status(&mut self) -> Status {
        let now = self.shared.snapshot().await;
        let mut servos = heapless::Vec::new();
        for index in 0..now.n_servos.into() {
            // There is room for every servo of a table.
            let _ = servos.push(self.joint_seen(index));
        }
        Status {
            phase: now.phase,
            word: now.word,
            rows: now.rows,
            model: now.model,
            switches: now.switches,
            servos,
            bad_frames: self.bad_frames,
            worst_lateness_us: u32::try_from(now.worst_lateness.0).unwrap_or(u32::MAX),
        }
    }
}
