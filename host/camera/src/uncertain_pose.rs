//! A pose with its covariance.
//!
//! The error of a pose T = (R, p) is (ω, v): the true pose is (exp(ω) R, p + v), with ω a rotation vector, rad, and v a
//! displacement, m, both along the axes of the frame in which the pose is given. Covariances have ω first.

use darm_core::real::{Mat3, Mat6, Vec3, Vec6};
use darm_core::se::{Pose, rotation_log};
use nalgebra::Cholesky;

/// A pose that was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UncertainPose {
    /// The estimate.
    pub pose: Pose<f64>,
    /// Covariance of its error (ω, v), in rad and m.
    pub covariance: Mat6<f64>,
}

impl UncertainPose {
    /// The pose of this frame in the other: of T_a_b that of T_b_a.
    ///
    /// With p' = −Rᵀ p: ω' = −Rᵀ ω, v' = Rᵀ (ω × p − v).
    pub fn inverse(&self) -> Self {
        let Pose { rotation, position } = self.pose;
        let back = rotation.transpose();
        let by_error = blocks(&-back, &Mat3::zeros(), &(-back * position.cross_matrix()), &-back);
        Self { pose: self.pose.inverse(), covariance: by_error * self.covariance * by_error.transpose() }
    }

    /// T_a_c of this T_a_b and T_b_c, whose errors are independent.
    ///
    /// With p = p₁ + R₁ p₂: ω = ω₁ + R₁ ω₂, v = v₁ + ω₁ × R₁ p₂ + R₁ v₂.
    pub fn then(&self, next: &Self) -> Self {
        let rotation = self.pose.rotation;
        let lever = rotation * next.pose.position;
        let by_first = blocks(&Mat3::identity(), &Mat3::zeros(), &-lever.cross_matrix(), &Mat3::identity());
        let by_next = blocks(&rotation, &Mat3::zeros(), &Mat3::zeros(), &rotation);
        let covariance =
            by_first * self.covariance * by_first.transpose() + by_next * next.covariance * by_next.transpose();
        Self { pose: self.pose * next.pose, covariance }
    }

    /// The error (ω, v) of this estimate if `truth` is the true pose.
    pub fn error(&self, truth: &Pose<f64>) -> Vec6<f64> {
        let angular = rotation_log(&(truth.rotation * self.pose.rotation.transpose()));
        let linear = truth.position - self.pose.position;
        Vec6::from_iterator(angular.iter().chain(linear.iter()).copied())
    }

    /// The square of the error in units of its covariance, χ² with 6 degrees of freedom; `None` of a singular covariance.
    pub fn chi_squared(&self, truth: &Pose<f64>) -> Option<f64> {
        let error = self.error(truth);
        Some(error.dot(&Cholesky::new(self.covariance)?.solve(&error)))
    }

    /// Standard deviation of the distance between this and the pose's other frame, m: along the line between them.
    pub fn distance_deviation_m(&self) -> f64 {
        let along = self.pose.position.try_normalize(0.0).unwrap_or_else(Vec3::x);
        let linear = self.covariance.fixed_view::<3, 3>(3, 3).into_owned();
        along.dot(&(linear * along)).max(0.0).sqrt()
    }
}

/// A matrix of four blocks.
fn blocks(a: &Mat3<f64>, b: &Mat3<f64>, c: &Mat3<f64>, d: &Mat3<f64>) -> Mat6<f64> {
    let mut all = Mat6::zeros();
    for (block, row, column) in [(a, 0, 0), (b, 0, 3), (c, 3, 0), (d, 3, 3)] {
        all.fixed_view_mut::<3, 3>(row, column).copy_from(block);
    }
    all
}

#[cfg(test)]
mod tests {
    use darm_core::real::{Mat6, Vec3, Vec6};
    use darm_core::se::Pose;
    use proptest::prelude::{ProptestConfig, prop_assert, proptest};

    use super::UncertainPose;

    fn pose(n: [f64; 6]) -> Pose<f64> {
        Pose::new(&Vec3::new(n[0], n[1], n[2]), Vec3::new(n[3], n[4], n[5]))
    }

    /// The pose with an error of 1e-6 in one of the six directions.
    fn moved(at: &Pose<f64>, axis: usize) -> Pose<f64> {
        let mut step = [0.0; 6];
        step[axis] = 1e-6;
        let turn = pose(step);
        Pose { rotation: turn.rotation * at.rotation, position: at.position + turn.position }
    }

    fn exact(pose: Pose<f64>) -> UncertainPose {
        UncertainPose { pose, covariance: Mat6::zeros() }
    }

    /// The covariance that an error of unit variance in one direction gives, from a difference of 1e-6.
    fn outer(change: &Vec6<f64>) -> Mat6<f64> {
        change * change.transpose() * 1e12
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(2), ..ProptestConfig::default() })]

        #[test]
        fn covariances_go_with_differences(a in proptest::array::uniform6(-1.0f64..1.0), b in proptest::array::uniform6(-1.0f64..1.0), axis in 0usize..6) {
            let (a, b) = (pose(a), pose(b));
            let mut covariance = Mat6::zeros();
            covariance[(axis, axis)] = 1.0;
            let (noisy_a, noisy_b) = (UncertainPose { pose: a, covariance }, UncertainPose { pose: b, covariance });
            let differences = [
                (noisy_a.inverse().covariance, exact(a.inverse()).error(&moved(&a, axis).inverse())),
                (noisy_a.then(&exact(b)).covariance, exact(a * b).error(&(moved(&a, axis) * b))),
                (exact(a).then(&noisy_b).covariance, exact(a * b).error(&(a * moved(&b, axis)))),
            ];
            for (covariance, change) in differences {
                prop_assert!((covariance - outer(&change)).abs().max() < 1e-4);
            }
        }
    }
}
