//! Differential kinematics in both directions: ẋ = J q̇, and joint velocities for a twist.

use darm_core::real::Vec3;
use darm_core::se::Twist;
use nalgebra::DVector;

use super::state::Kinematics;
use crate::svd::svd;

/// A singular value below this share of the largest counts as zero.
const MIN_SHARE: f64 = 1e-9;

/// Which rows of a twist count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// All six.
    Pose,
    /// The three of the linear part: the orientation is free.
    Position,
}

/// Joint velocities for a twist.
#[derive(Clone, Debug, PartialEq)]
pub struct Rates {
    /// Velocities of the coordinates, rad/s or m/s: of all that come closest to the twist, those of least norm.
    pub qd: Vec<f64>,
    /// Rank of the rows that count: below their number and that of the columns the posture is singular.
    pub rank: usize,
    /// The twist less J q̇ in the rows that count: what the joints cannot do, along the axes of the base, rad/s and m/s.
    pub residual: Twist<f64>,
}

impl Kinematics {
    /// ẋ = J q̇: the twist of the frame along the axes of the base, at its own origin, for velocities of the coordinates in
    /// rad/s or m/s; missing ones are 0.
    pub fn twist(&self, qd: &[f64]) -> Twist<f64> {
        let columns = self.jacobian_base.column_iter().zip(qd);
        Twist::from_vector(&columns.map(|(column, qd)| column * *qd).sum())
    }

    /// q̇ = J⁺ ẋ: joint velocities for a twist of the frame along the axes of the base, at its own origin; of a
    /// [`Task::Position`] only its linear part counts.
    ///
    /// With as many joints as rows this is the inverse; with more it is the solution of least norm; in a singular posture,
    /// or with fewer joints, least squares. There, rad and m count alike.
    #[expect(clippy::missing_panics_doc, reason = "both factors are requested")]
    pub fn rates(&self, twist: &Twist<f64>, task: Task) -> Rates {
        let (n, first) = (self.jacobian_base.ncols(), 6 - task.rows());
        let missed = |qd: &[f64]| {
            let reached = self.twist(qd);
            let angular = if task == Task::Pose { twist.angular - reached.angular } else { Vec3::zeros() };
            Twist { angular, linear: twist.linear - reached.linear }
        };
        let jacobian = self.jacobian_base.rows(first, task.rows());
        let Some(parts) = (n > 0).then(|| svd(&jacobian)).flatten() else {
            let still = vec![0.0; n];
            return Rates { residual: missed(&still), qd: still, rank: 0 };
        };
        let wanted = DVector::from_iterator(task.rows(), twist.to_vector().iter().skip(first).copied());
        let tolerance = MIN_SHARE * parts.singular_values.max();
        let rank = parts.singular_values.iter().filter(|value| **value > tolerance).count();
        let (u, v) = parts.u.zip(parts.v_t).expect("both were requested");
        let mut qd = DVector::zeros(n);
        for (k, value) in parts.singular_values.iter().enumerate().filter(|(_, value)| **value > tolerance) {
            qd += v.row(k).transpose() * (u.column(k).dot(&wanted) / value);
        }
        let qd: Vec<f64> = qd.iter().copied().collect();
        Rates { residual: missed(&qd), qd, rank }
    }
}

impl Task {
    /// Number of rows of the Jacobian that count.
    pub fn rows(self) -> usize {
        match self {
            Self::Pose => 6,
            Self::Position => 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::puma560;

    #[test]
    fn joint_velocities_and_twists_are_inverse_to_each_other() {
        let robot = puma560();
        let frame = robot.tool().unwrap();
        let (q, qd) = ([0.2, 0.4, -1.1, 0.6, 0.9, -0.3], [0.5, -0.2, 0.8, 0.1, -0.9, 0.4]);
        let kinematics = robot.kinematics(frame, &q).unwrap();
        let back = kinematics.rates(&kinematics.twist(&qd), Task::Pose);
        assert_eq!(back.rank, 6);
        assert!(back.qd.iter().zip(&qd).all(|(a, b)| (a - b).abs() < 1e-12), "{back:?}");
        assert!(back.residual.to_vector().norm() < 1e-12);
    }

    /// The twist is the derivative of the pose along the motion.
    #[test]
    fn a_twist_is_a_difference_of_poses() {
        let robot = puma560();
        let frame = robot.tool().unwrap();
        let (q, qd, step) = ([0.2, 0.4, -1.1, 0.6, 0.9, -0.3], [0.5, -0.2, 0.8, 0.1, -0.9, 0.4], 1e-6);
        let pose = |t: f64| {
            let q: Vec<f64> = q.iter().zip(&qd).map(|(q, qd)| q + t * qd).collect();
            robot.kinematics(frame, &q).unwrap().pose_base_frame
        };
        let twist = robot.kinematics(frame, &q).unwrap().twist(&qd);
        let linear = (pose(step).position - pose(-step).position) / (2.0 * step);
        assert!((linear - twist.linear).norm() < 1e-9);
        let spin = (pose(step).rotation - pose(-step).rotation) / (2.0 * step) * pose(0.0).rotation.transpose();
        assert!((spin - twist.angular.cross_matrix()).amax() < 1e-9);
    }

    /// With the wrist straight, axes 4 and 6 coincide: one direction of rotation is lost, and what is left is orthogonal to
    /// what the joints can do.
    #[test]
    fn what_a_singular_posture_cannot_do_is_left() {
        let robot = puma560();
        let kinematics = robot.kinematics(robot.tool().unwrap(), &[0.2, 0.4, -1.1, 0.6, 0.0, -0.3]).unwrap();
        let wanted = Twist { angular: Vec3::new(0.3, 0.5, -0.2), linear: Vec3::new(0.1, 0.2, 0.3) };
        let found = kinematics.rates(&wanted, Task::Pose);
        assert_eq!(found.rank, 5);
        let left = found.residual.to_vector();
        assert!(left.norm() > 1e-3 && kinematics.jacobian_base.tr_mul(&left).norm() < 1e-12, "{left}");
    }

    /// The stretched planar arm of the lecture cannot move along itself; across, it can.
    #[test]
    fn a_stretched_arm_loses_a_direction() {
        let (arm, tip) = crate::robot::planar::planar_arm(&[0.5, 0.35], &[[-3.0, 3.0]; 2]);
        let kinematics = arm.kinematics(&tip, &[0.0, 0.0]).unwrap();
        let rates = |x: f64, y: f64| {
            let twist = Twist { angular: Vec3::zeros(), linear: Vec3::new(x, y, 0.0) };
            kinematics.rates(&twist, Task::Position)
        };
        let (along, across) = (rates(1.0, 0.0), rates(0.0, 1.0));
        assert_eq!((along.rank, across.rank), (1, 1));
        assert!((along.residual.linear.x - 1.0).abs() < 1e-12 && across.residual.linear.norm() < 1e-12);
        assert!((0.85 * across.qd[0] + 0.35 * across.qd[1] - 1.0).abs() < 1e-12);
    }
}
