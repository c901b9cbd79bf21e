//! A person's motion on a robot: markers on a tree, complete trajectories under hard constraints, balance, execution.
//!
//! ```text
//! markers and force plates ─► person: lengths from the markers, masses from the centre of pressure ─► centre of mass
//!                                                                                                         │ hard
//! markers overlaid on the robot's sitting posture ─► soft ─► trajectory of the robot ◄────────────────────┘
//!                                                                   │  feet and limits hard, smooth
//!                                                                   ▼
//!                       balance: zero-moment point kept over the support ─► execution by joint PD control
//! ```
//!
//! Everything is expressed in the world: z up, x forward, the ground at z = 0. The base of a tree moves by its twist, given in its own
//! frame, angular part first, before its joints.
//!
//! Source: M. Mistry, A. Murai, K. Yamane, J. Hodgins, Sit-to-Stand Task on a Humanoid Robot from Human Demonstration,
//! IEEE-RAS Int. Conf. on Humanoid Robots, 2010, section III.

mod balance;
mod banded;
pub mod demonstration;
pub mod execution;
mod forces;
mod lift_off;
pub mod mapping;
mod markers;
pub mod page;
pub mod person;
mod placed;
pub mod setup;
mod smooth;
pub mod trajectory;

pub use balance::{Balance, Polygon};
pub use forces::feed_forward;
pub use lift_off::{LiftOffBy, lift_off};
pub use markers::{Capture, CaptureError, Plate};

use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist, rotation_log};
use nalgebra::DVector;

/// The posture of a tree with a floating base.
#[derive(Clone, Debug, PartialEq)]
pub struct Posture {
    /// Pose of the base in the world.
    pub base: Pose<f64>,
    /// Positions of the joints, rad or m.
    pub q: Vec<f64>,
}

/// A point fixed to a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPoint {
    /// The joint that moves the link; `None`: the base.
    pub joint: Option<usize>,
    /// The point in the link's frame, m.
    pub point: Vec3<f64>,
}

impl Posture {
    /// Moved by the base's twist and the joints' changes.
    pub fn moved(&self, change: &DVector<f64>) -> Self {
        let twist = Twist {
            angular: Vec3::new(change[0], change[1], change[2]),
            linear: Vec3::new(change[3], change[4], change[5]),
        };
        let q = self.q.iter().zip(change.iter().skip(6)).map(|(q, change)| q + change).collect();
        Self { base: self.base * Pose::exp(&twist), q }
    }

    /// The change that moves this posture to another one: turn and shift of the base in its own axes, then the joints.
    pub fn to(&self, other: &Self) -> DVector<f64> {
        let apart = self.base.to(&other.base);
        let turn = rotation_log(&apart.rotation);
        let base = turn.iter().chain(&apart.position).copied();
        let joints = self.q.iter().zip(&other.q).map(|(from, to)| to - from);
        DVector::from_vec(base.chain(joints).collect())
    }
}

#[cfg(test)]
mod tests;
