//! Servo angles that bring the tool nearer to a pose, by Gauss–Newton steps.

use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use nalgebra::{DMatrix, DVector};

use crate::arm::Arm;

/// Steps of the solution for the servos.
const SERVO_STEPS: usize = 12;

/// Makes servo angles better by Gauss–Newton steps, halved where they do not help, within the servos' ranges.
pub(super) fn refine(
    arm: &Arm,
    target: &Pose<f64>,
    mut angles_rad: Vec<f64>,
    mut look: impl FnMut(&[f64]) -> Option<(Pose<f64>, Vec<Twist<f64>>)>,
) -> Vec<f64> {
    let scale_m = arm.length_scale_m;
    let Some((mut pose, mut columns)) = look(&angles_rad) else { return angles_rad };
    for _ in 0..SERVO_STEPS {
        if angles_rad.is_empty() {
            break;
        }
        let step = servo_step(&pose.to(target), &columns, scale_m);
        let before = pose.distance(target, scale_m);
        let mut share = 1.0;
        let better = (0..5).find_map(|_| {
            let clamp = |(servo, angle): (usize, &f64)| {
                let (min, max) = range(arm, servo);
                (angle + share * step[servo]).clamp(min, max)
            };
            let next: Vec<f64> = angles_rad.iter().enumerate().map(clamp).collect();
            share *= 0.5;
            let (pose, columns) = look(&next)?;
            (pose.distance(target, scale_m) < before).then_some((next, pose, columns))
        });
        let Some((next, next_pose, next_columns)) = better else { break };
        let moved =
            next.iter().zip(&angles_rad).fold(0.0, |largest: f64, (next, angle)| largest.max((next - angle).abs()));
        (angles_rad, pose, columns) = (next, next_pose, next_columns);
        if moved < 1e-12 {
            break;
        }
    }
    angles_rad
}

/// The least-squares step of the angles for what the tool is off by.
fn servo_step(off: &Pose<f64>, columns: &[Twist<f64>], scale_m: f64) -> DVector<f64> {
    let six = |angular: Vec3<f64>, linear: Vec3<f64>| {
        let w = angular * scale_m;
        DVector::from_row_slice(&[w.x, w.y, w.z, linear.x, linear.y, linear.z])
    };
    let turn = off.log().angular;
    let columns: Vec<_> =
        columns.iter().map(|twist| six(twist.angular, twist.linear + twist.angular.cross(&off.position))).collect();
    let jacobian = DMatrix::from_columns(&columns);
    let normal = jacobian.tr_mul(&jacobian) + DMatrix::identity(columns.len(), columns.len()) * 1e-12;
    let right = jacobian.tr_mul(&six(turn, off.position));
    normal.cholesky().map_or_else(|| DVector::zeros(columns.len()), |cholesky| cholesky.solve(&right))
}

/// The range of a servo joint, rad.
pub(super) fn range(arm: &Arm, servo: usize) -> (f64, f64) {
    arm.servos.get(servo).map_or((0.0, 0.0), |servo| (servo.min_rad.into(), servo.max_rad.into()))
}
