//! Positions of the servo joints of an arm, for the commands of words.

use darm_arm::arm::Arm;

use super::subject::{listed, servo_joints};
use crate::failure::Usage;

/// The positions.
#[derive(clap::Args, Debug)]
pub(crate) struct ServoArgs {
    /// Positions of the servo joints, base first, in deg, or with a unit: 0.5rad
    #[arg(long, value_name = "Q,Q,…", allow_hyphen_values = true)]
    q: Option<String>,
}

impl ServoArgs {
    /// Whether any are given.
    pub(crate) fn are_given(&self) -> bool {
        self.q.is_some()
    }

    /// The given positions, rad; `None` where none are given.
    pub(crate) fn given_rad(&self, arm: &Arm) -> Result<Option<Vec<f64>>, Usage> {
        self.q.as_deref().map(|text| listed(text, &servo_joints(arm), "--q")).transpose()
    }

    /// The same, all 0 by default.
    pub(crate) fn rad(&self, arm: &Arm) -> Result<Vec<f64>, Usage> {
        Ok(self.given_rad(arm)?.unwrap_or_else(|| vec![0.0; arm.n_servos()]))
    }
}
