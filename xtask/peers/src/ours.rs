//! Our side: all works of one arm.

use std::hint::black_box;

use darm_core::dynamics;
use darm_core::ik::{self, Options, Status};
use darm_core::tree::Frames;
use nalgebra::SMatrix;

use super::{Measured, time, time_inverse};
use crate::models::Arm;

pub(crate) fn measure<const N: usize>(into: &mut Measured, arm: &Arm<N>) {
    let (tree, tool) = (black_box(&arm.tree), black_box(&arm.tool));
    let mut frames = Frames::default();
    time(into, arm, "pose", |[q, ..]| black_box(tree.pose(tool, q)).position.sum());
    time(into, arm, "jacobian", |[q, ..]| {
        tree.place(q, &mut frames);
        let jacobian = black_box(tree.jacobian_base(tool, &frames));
        jacobian[(3, 0)] + jacobian[(2, N - 1)] + jacobian[(4, N / 2)]
    });
    time(into, arm, "inverse-dynamics", |[q, qd, qdd]| {
        black_box(dynamics::inverse_dynamics(tree, q, qd, qdd, None)).iter().sum()
    });
    time(into, arm, "gravity", |[q, ..]| {
        tree.place(q, &mut frames);
        black_box(dynamics::gravity(tree, &frames)).iter().sum()
    });
    let mut mass = SMatrix::<f64, N, N>::zeros();
    time(into, arm, "mass-matrix", |[q, ..]| {
        dynamics::mass_matrix_into(tree, q, &mut mass);
        let mass = black_box(&mass);
        mass[(0, 0)] + mass[(0, N - 1)] + mass[(N / 2, N / 2)]
    });
    time(into, arm, "com-jacobian", |[q, ..]| {
        tree.place(q, &mut frames);
        let (com, jacobian) = black_box(dynamics::com_jacobian(tree, &frames));
        com.sum() + jacobian[(0, 0)] + jacobian[(2, N - 1)]
    });
    time(into, arm, "forward-dynamics", |[q, qd, torque]| {
        black_box(dynamics::forward_dynamics(tree, q, qd, torque)).map_or(0.0, |qdd| qdd[0])
    });
    let mut y = [[[0.0; 10]; N]; N];
    time(into, arm, "regressor", |[q, qd, qdd]| {
        tree.place(q, &mut frames);
        dynamics::regressor(tree, &frames, [q, qd, qdd], &mut y);
        let y = black_box(&y);
        y[0][0][0] + y[0][N - 1][9] + y[N - 1][N - 1][6]
    });
    let (limits, options) = (ik::Arm { tree, tool, limits: &arm.limits }, Options::default());
    time_inverse(into, arm, 3, |index| {
        let (start, target) = &arm.targets[index];
        black_box(ik::solve(&limits, black_box(target), start, &options)).status == Status::Reached
    });
}
