//! Rotations and rigid motions nearest to measured ones, in closed form: exact at any angle.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_log};

use super::median;

/// Times that rows are weighed again: each divides what a blunder moves by about the number of rows.
const REWEIGHTINGS: usize = 8;

/// A pose where it is predicted, and where it was measured.
pub type Pair = (Pose<f64>, Pose<f64>);

/// The motion D that brings the first pose of each pair nearest to the second, D·first ≈ second: weighted least squares of
/// positions, m, and of orientations at the distance `length_scale_m` from the tool. The identity where nothing weighs.
///
/// Source: W. Kabsch, Acta Cryst. A32 (1976) 922.
pub fn nearest_motion(pairs: &[Pair], weights: &[f64], length_scale_m: f64) -> Pose<f64> {
    let weighted = || pairs.iter().zip(weights);
    let sum: f64 = weights.iter().sum();
    if sum <= 0.0 {
        return Pose::identity();
    }
    let middle =
        |of: fn(&Pair) -> Vec3<f64>| weighted().map(|(pair, weight)| of(pair) * *weight).sum::<Vec3<f64>>() / sum;
    let (own_middle, seen_middle) = (middle(|pair| pair.0.position), middle(|pair| pair.1.position));
    let turns = weighted().map(|((own, seen), weight)| {
        let turned = seen.rotation * own.rotation.transpose() * (length_scale_m * length_scale_m);
        ((seen.position - seen_middle) * (own.position - own_middle).transpose() + turned) * *weight
    });
    let rotation = nearest_rotation(&turns.sum());
    Pose { rotation, position: seen_middle - rotation * own_middle }
}

/// The same, with rows that are farther off than most weighing less (Huber, at the median): a blunder of any size moves it by about
/// what one more row would.
pub fn robust_nearest_motion(pairs: &[Pair], length_scale_m: f64) -> Pose<f64> {
    let mut weights = vec![1.0; pairs.len()];
    let mut motion = nearest_motion(pairs, &weights, length_scale_m);
    for _ in 0..REWEIGHTINGS {
        let left = distances_after(&motion, pairs, length_scale_m);
        let Some(usual) = median(left.iter().copied()).filter(|usual| *usual > 0.0) else { break };
        weights = left.iter().map(|distance| (usual / distance).min(1.0)).collect();
        motion = nearest_motion(pairs, &weights, length_scale_m);
    }
    motion
}

/// What is left of each pair after a motion, as a distance d, m.
pub fn distances_after(motion: &Pose<f64>, pairs: &[Pair], length_scale_m: f64) -> Vec<f64> {
    let left = |(own, seen): &Pair| {
        let moved = *motion * *own;
        let angle = rotation_log(&(moved.rotation.transpose() * seen.rotation)).norm();
        (moved.position - seen.position).norm().hypot(length_scale_m * angle)
    };
    pairs.iter().map(left).collect()
}

/// The rotation R that makes tr(Rᵀ·sum) largest.
///
/// Source: W. Kabsch, Acta Cryst. A32 (1976) 922.
pub fn nearest_rotation(sum: &Mat3<f64>) -> Mat3<f64> {
    let svd = sum.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Mat3::identity() };
    let mut signs = Vec3::repeat(1.0);
    signs[svd.singular_values.imin()] = (u * vt).determinant().signum();
    u * Mat3::from_diagonal(&signs) * vt
}
