//! The step of a trajectory: one banded system over all frames.

use std::ops::AddAssign as _;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::constraints::split;
use super::cost::{Linear, second_difference, smoothness};
use super::{Posture, Problem};
use crate::motion::banded::Banded;

/// The step of all frames with some joints left out, for this damping.
fn step(
    problem: &Problem<'_>,
    (postures, frames): (&[Posture], &[Linear]),
    pinned: &[Vec<bool>],
    damping: f64,
) -> Option<Vec<DVector<f64>>> {
    let free = |k: usize| -> Vec<usize> { (0..6 + pinned[k].len()).filter(|&i| i < 6 || !pinned[k][i - 6]).collect() };
    let parts: Vec<(DVector<f64>, DMatrix<f64>)> =
        frames.par_iter().enumerate().map(|(k, frame)| split(&frame.off, &frame.jacobian, &free(k))).collect();
    let mut start = vec![0; parts.len() + 1];
    parts.iter().enumerate().for_each(|(k, (_, z))| start[k + 1] = start[k] + z.ncols());
    let width = (0..parts.len()).map(|k| start[(k + 3).min(parts.len())] - start[k]).max().unwrap_or(1);
    let n = start[parts.len()];
    let (mut matrix, mut right) = (Banded::zeros(n, width.saturating_sub(1).max(1)), DVector::zeros(n));
    let mut put = |(later, earlier): (usize, usize), block: &DMatrix<f64>| {
        for column in 0..block.ncols() {
            (0..block.nrows())
                .for_each(|row| matrix.add(start[later] + row, start[earlier] + column, block[(row, column)]));
        }
    };
    for (k, ((p, z), frame)) in parts.iter().zip(frames).enumerate() {
        let soft = &frame.soft;
        // Nothing is held: Z is the identity.
        let mut own = if z.is_square() { soft.matrix.clone() } else { z.transpose() * (&soft.matrix * z) };
        (0..own.nrows()).for_each(|i| own[(i, i)] += damping);
        put((k, k), &own);
        let pull = z.tr_mul(&(&soft.right - &soft.matrix * p));
        right.rows_mut(start[k], z.ncols()).add_assign(&pull);
    }
    let weight = smoothness(problem);
    for k in 1..parts.len().saturating_sub(1) {
        let near = [(k - 1, 1.0), (k, -2.0), (k + 1, 1.0)];
        let left = near.iter().fold(second_difference(postures, k), |sum, (j, factor)| sum + &parts[*j].0 * *factor);
        for (i, (a, of_a)) in near.iter().enumerate() {
            let pull = parts[*a].1.tr_mul(&left) * (-weight * of_a);
            right.rows_mut(start[*a], pull.len()).add_assign(&pull);
            for (b, of_b) in &near[..=i] {
                let (later, earlier) = (&parts[*a].1, &parts[*b].1);
                let both = later.is_square() && earlier.is_square();
                let shared = if both { later.clone() } else { later.transpose() * earlier };
                put((*a, *b), &(shared * (weight * of_a * of_b)));
            }
        }
    }
    let y = matrix.solve(right)?;
    Some(parts.iter().enumerate().map(|(k, (p, z))| p + z * y.rows(start[k], z.ncols())).collect())
}

/// Rounds in which joints are left out of one step.
const PINNINGS: usize = 4;

/// The step that pushes no joint beyond the limit that it is at.
pub(super) fn limited(
    problem: &Problem<'_>,
    postures: &[Posture],
    frames: &[Linear],
    damping: f64,
) -> Option<Vec<DVector<f64>>> {
    let mut pinned = vec![vec![false; problem.robot.joints.len()]; postures.len()];
    for _ in 0..PINNINGS {
        let steps = step(problem, (postures, frames), &pinned, damping)?;
        let mut more = false;
        for (k, posture) in postures.iter().enumerate() {
            for (i, joint) in problem.robot.joints.iter().enumerate() {
                let Some([low, high]) = joint.limits else { continue };
                let change = steps[k][6 + i];
                let out = posture.q[i] >= high && change > 0.0 || posture.q[i] <= low && change < 0.0;
                more |= out && !pinned[k][i];
                pinned[k][i] |= out;
            }
        }
        if !more {
            return Some(steps);
        }
    }
    step(problem, (postures, frames), &pinned, damping)
}
