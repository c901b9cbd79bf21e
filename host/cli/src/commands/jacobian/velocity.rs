//! `darm jacobian --qd` and `--twist`: the twist of a frame from joint velocities, and joint velocities from a twist.

use darm_core::actuator::JointKind;
use darm_core::se::Twist;
use darm_robot::robot::{Kinematics, Rates, Task};
use serde::Serialize;

use crate::commands::subject::Coordinate;
use crate::ui::{columns, number};

/// A twist counts as reached when it is missed by less than this share of itself.
const REACHED: f64 = 1e-9;
/// Names of its six numbers, in the columns of --csv.
pub(super) const TWIST_COLUMNS: [&str; 6] = ["wx_rad_s", "wy_rad_s", "wz_rad_s", "vx_m_s", "vy_m_s", "vz_m_s"];

/// A twist, angular part first.
#[derive(Serialize)]
pub(super) struct TwistReport {
    angular_rad_s: [f64; 3],
    linear_m_s: [f64; 3],
}

/// The twist of the frame for given joint velocities.
#[derive(Serialize)]
pub(super) struct Forward {
    /// Along the axes of the base, at the origin of the frame.
    twist_base: TwistReport,
    /// The same along the axes of the frame.
    twist_tool: TwistReport,
}

/// Joint velocities for a given twist.
#[derive(Serialize)]
pub(super) struct Inverse {
    pub(super) joint_velocities: Vec<JointRate>,
    rank: usize,
    /// Rows of the Jacobian that count: 6, or 3 of a velocity whose orientation is free.
    rows: usize,
    /// Whether the Jacobian has less than the rank that its size allows.
    is_singular: bool,
    /// Whether the joints can do the twist.
    is_reached: bool,
    /// What the joints cannot do, along the axes of the base.
    residual_twist: TwistReport,
}

/// Velocity of one joint or actuator.
#[derive(Serialize)]
pub(super) struct JointRate {
    joint: String,
    #[serde(flatten)]
    velocity: Velocity,
}

#[derive(Clone, Copy, Serialize)]
#[serde(untagged)]
enum Velocity {
    Revolute { velocity_rad_s: f64 },
    Prismatic { velocity_m_s: f64 },
}

impl JointRate {
    /// In rad/s or m/s.
    pub(super) fn si(&self) -> f64 {
        match self.velocity {
            Velocity::Revolute { velocity_rad_s } => velocity_rad_s,
            Velocity::Prismatic { velocity_m_s } => velocity_m_s,
        }
    }
}

impl From<&Twist<f64>> for TwistReport {
    fn from(twist: &Twist<f64>) -> Self {
        Self { angular_rad_s: twist.angular.into(), linear_m_s: twist.linear.into() }
    }
}

impl TwistReport {
    pub(super) fn si(&self) -> impl Iterator<Item = f64> {
        self.angular_rad_s.into_iter().chain(self.linear_m_s)
    }

    /// In deg/s and mm/s.
    fn shown(&self) -> Vec<String> {
        let angular = self.angular_rad_s.map(f64::to_degrees);
        let linear = self.linear_m_s.map(|speed| 1e3 * speed);
        angular.into_iter().chain(linear).map(|speed| number(speed, 3)).collect()
    }
}

impl Forward {
    pub(super) fn new(kinematics: &Kinematics, qd: &[f64]) -> Self {
        let twist = kinematics.twist(qd);
        let turned = |v: &darm_core::real::Vec3<f64>| kinematics.pose_base_frame.rotation.tr_mul(v);
        let own = Twist { angular: turned(&twist.angular), linear: turned(&twist.linear) };
        Self { twist_base: (&twist).into(), twist_tool: (&own).into() }
    }

    pub(super) fn si(&self) -> impl Iterator<Item = f64> {
        self.twist_base.si()
    }

    pub(super) fn text(&self, frame: &str) -> String {
        let head = vec!["deg/s and mm/s", "ωx", "ωy", "ωz", "vx", "vy", "vz"].into_iter().map(str::to_owned).collect();
        let row = |axes: String, twist: &TwistReport| std::iter::once(axes).chain(twist.shown()).collect();
        let rows = [row("along the base".into(), &self.twist_base), row(format!("along {frame}"), &self.twist_tool)];
        let table: Vec<Vec<String>> = std::iter::once(head).chain(rows).collect();
        format!("twist of {frame} for the joint velocities, ẋ = J q̇\n{}", columns(&table))
    }
}

impl Inverse {
    pub(super) fn new(kinematics: &Kinematics, (wanted, task): &(Twist<f64>, Task), shown: &[Coordinate]) -> Self {
        let Rates { qd, rank, residual } = kinematics.rates(wanted, *task);
        let missed = residual.to_vector().norm();
        let rate = |(coordinate, rate): (&Coordinate, f64)| JointRate {
            joint: coordinate.name.clone(),
            velocity: match coordinate.kind {
                JointKind::Revolute => Velocity::Revolute { velocity_rad_s: rate },
                JointKind::Prismatic => Velocity::Prismatic { velocity_m_s: rate },
            },
        };
        Self {
            is_singular: rank < qd.len().min(task.rows()),
            rows: task.rows(),
            is_reached: missed <= REACHED * wanted.to_vector().norm(),
            joint_velocities: shown.iter().zip(qd).map(rate).collect(),
            rank,
            residual_twist: (&residual).into(),
        }
    }

    pub(super) fn text(&self, shown: &[Coordinate]) -> String {
        let n = self.joint_velocities.len();
        let method = if n == self.rows && self.rank == n { "q̇ = J⁻¹ ẋ" } else { "q̇ = J⁺ ẋ" };
        let rows = self.joint_velocities.iter().zip(shown).map(|(rate, coordinate)| {
            vec![rate.joint.clone(), number(coordinate.shown(rate.si()), 4), format!("{}/s", coordinate.unit())]
        });
        let table = columns(&rows.collect::<Vec<_>>());
        let mut text = format!("joint velocities for the twist, {method}\n{table}");
        if n > self.rank {
            text += &format!(
                "\nleast norm: the joints can move in {} direction(s) without moving the frame",
                n - self.rank
            );
        }
        if self.is_singular {
            text += &format!("\nthe posture is singular: the Jacobian has rank {} of {}", self.rank, n.min(self.rows));
        }
        if !self.is_reached {
            let missing = self.residual_twist.shown();
            text += &format!(
                "\nthe joints cannot do this twist; missing: {} deg/s, {} mm/s",
                missing[..3].join(" "),
                missing[3..].join(" ")
            );
        }
        text
    }
}
