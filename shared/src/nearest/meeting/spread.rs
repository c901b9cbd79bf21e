//! What the modules behind a beginning typically do: mean and covariance of their coordinates, and scores by them.

use super::small::Motion;
use super::{Part, Phase, Search};
use crate::real::{Mat6, Vec6};

/// Variance in every direction, as a share of the mean one: no direction counts as impossible.
const MIN_VARIANCE: f32 = 1e-4;

impl<const BEAM: usize, const WIDTH: usize, const FRAMES: usize> Search<BEAM, WIDTH, FRAMES> {
    pub(super) fn add_spread(&mut self, index: usize) {
        let (Some(before), Some(part)) = (self.parts.get(index - 1), self.parts.get(index)) else { return };
        let typical = before.behind * part.behind.inverse();
        let (mut sum, mut squares) = (Vec6::zeros(), Mat6::zeros());
        for frame in self.frames.iter().skip(part.first).take(part.count) {
            let own = self.coordinates(&typical, &frame.motion(part.size_m));
            let (turn, linear) = (own.fixed_rows::<3>(0).into_owned(), own.fixed_rows::<3>(3).into_owned());
            // Seen where the tool is.
            let linear =
                linear - part.behind.translation.vector.cross(&turn) / self.length_scale_m.max(f32::MIN_POSITIVE);
            let back = part.behind.rotation.inverse();
            let (turn, linear) = (back * turn, back * linear);
            let there = Vec6::new(turn.x, turn.y, turn.z, linear.x, linear.y, linear.z);
            sum += there;
            squares += there * there.transpose();
        }
        let count = part.count as f32;
        let mean = sum / count;
        self.mean += mean;
        self.spread += squares / count - mean * mean.transpose();
        self.phase = Phase::Spread { part: index + 1 };
        if index + 1 == self.parts.len() {
            let floor = MIN_VARIANCE * self.spread.trace() / 6.0 + f32::MIN_POSITIVE;
            let covariance = self.spread + Mat6::identity() * floor;
            self.spread = covariance.cholesky().map_or(Mat6::identity(), |factor| factor.inverse());
            let grows = self.level + 3 < self.parts.len();
            self.phase =
                if grows { Phase::Grow { beginning: 0, frame: 0 } } else { Phase::Choose { beginning: 0, frame: 0 } };
        }
    }

    /// ξ of a pose seen from `typical`.
    fn coordinates(&self, typical: &Motion, pose: &Motion) -> Vec6<f32> {
        let seen = typical.inv_mul(pose);
        let sign = if seen.rotation.w < 0.0 { -1.0 } else { 1.0 };
        let (turn, at) = (seen.rotation.imag() * (2.0 * sign * self.length_scale_m), seen.translation.vector);
        Vec6::new(turn.x, turn.y, turn.z, at.x, at.y, at.z)
    }

    /// How unlikely it is that the modules behind `part` reach what remains.
    pub(super) fn score(&self, part: &Part, remaining: &Motion) -> f32 {
        let off = self.coordinates(&part.behind, remaining) - self.mean;
        (self.spread * off).dot(&off)
    }
}
