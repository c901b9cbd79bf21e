//! An order of switching between two words that keeps the tool near the straight line.

use darm_arm::arm::Arm;
use darm_arm::reach::path::{Limits, Rest, path_while};
use serde::{Deserialize, Serialize};

use super::check::{MAX_M, checked_servos, invalid, refused, word};
use crate::job_queue::Work;
use crate::refusal::Refused;

/// Two words.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OrderRequest {
    from: String,
    to: String,
    servos_rad: Vec<f64>,
    /// Largest distance of a resting tool from the straight line, m; any where it is missing.
    deviation_m: Option<f64>,
}

/// The words, both included.
#[derive(Debug, Serialize)]
pub(super) struct OrderView {
    at_once: u8,
    rests: Vec<RestView>,
}

#[derive(Debug, Serialize)]
struct RestView {
    word: String,
    position_m: [f64; 3],
    deviation_m: f64,
}

impl OrderRequest {
    /// Searches for an order that switches at most this many actuators at once.
    pub(super) fn answer(&self, arm: &Arm, at_once: u8, work: &Work) -> Result<OrderView, Refused> {
        checked_servos(arm, &self.servos_rad)?;
        let (from, to) = (word(arm, &self.from)?, word(arm, &self.to)?);
        let tube_m = self.deviation_m.unwrap_or(MAX_M);
        if !(0.0..=MAX_M).contains(&tube_m) {
            return Err(invalid("the deviation must be at least 0 mm"));
        }
        let limits = Limits { at_once: at_once.max(1).into(), tube_m, servos_rad: self.servos_rad.clone() };
        work.is_at("path", 0.0);
        let rests = path_while(arm, [&from, &to], &limits, || work.is_wanted()).map_err(refused)?;
        Ok(OrderView { at_once: at_once.max(1), rests: rests.iter().map(RestView::of).collect() })
    }
}

impl RestView {
    fn of(rest: &Rest) -> Self {
        Self { word: rest.word.to_string(), position_m: rest.pose_base_tool.position.into(), deviation_m: rest.off_m }
    }
}
