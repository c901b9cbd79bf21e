//! The last step of the search: pairs of frames of the last two modules.

use super::small::Motion;
use super::{MET, Phase, Search};
use crate::trig;

impl<const BEAM: usize, const WIDTH: usize, const FRAMES: usize> Search<BEAM, WIDTH, FRAMES> {
    /// The phase that meets a follower of a beginning, or what comes after the last of them.
    pub(super) fn meeting(&self, index: usize, follower: usize) -> Phase {
        let n = self.parts.len();
        let (Some(&beginning), Some(&(_, number))) = (self.beginnings.get(index), self.followers.list.get(follower))
        else {
            return if n == 2 { Phase::Done } else { Phase::Choose { beginning: index + 1, frame: 0 } };
        };
        let mut remaining = self.remaining(beginning, self.level.min(n - 2));
        if n > 2 {
            remaining = self.motion(n - 3, number as usize).inv_mul(&remaining);
        }
        Phase::Meet { beginning: index, follower, second: 0, remaining }
    }

    /// Meets a few frames of the last but one module, from `from` on, with those of the last that end near the target.
    pub(super) fn meet(&mut self, index: usize, follower: usize, from: usize, remaining: &Motion) {
        self.phase = Phase::Done;
        let (Some(&beginning), Some(&(_, number))) = (self.beginnings.get(index), self.followers.list.get(follower))
        else {
            return;
        };
        let [.., joint, last] = self.parts.as_slice() else { return };
        let second = from + MET;
        self.phase = if second >= joint.count {
            self.meeting(index, follower + 1)
        } else {
            Phase::Meet { beginning: index, follower, second, remaining: *remaining }
        };
        let frames = self.frames.iter().skip(joint.first).take(joint.count).enumerate();
        for (second, frame) in frames.skip(from).take(MET) {
            let own = frame.motion(joint.size_m);
            let at = own.rotation.inverse_transform_vector(&(remaining.translation.vector - own.translation.vector));
            let reach = self.nearest_m;
            let sides = self.corners[0].iter().zip(&self.corners[1]);
            if at.iter().zip(sides).any(|(x, (low, high))| *x < low - reach || *x > high + reach) {
                continue;
            }
            let turn = own.rotation.inverse() * remaining.rotation;
            let from = self.ends.partition_point(|end| end.x < at.x - self.nearest_m);
            for (third, end) in self.ends.iter().enumerate().skip(from) {
                if end.x > at.x + self.nearest_m {
                    break;
                }
                let square = (end - at).norm_squared();
                if square >= self.nearest_m * self.nearest_m {
                    continue;
                }
                let Some(frame) = self.frames.get(last.first + third) else { continue };
                // θ² = 4·arcsin²(s), s the sine of half the angle, by its series in s²: to 2 % up to a quarter turn, beyond
                // which no good word is.
                let sine2 = (frame.turn().conjugate() * turn.into_inner()).imag().norm_squared();
                let arc = 4.0 * sine2 * (1.0 + sine2 * (1.0 / 3.0 + sine2 * (8.0 / 45.0)));
                let square = square + self.length_scale_m * self.length_scale_m * arc;
                if square < self.nearest_m * self.nearest_m {
                    self.nearest_m = trig::sqrt(square);
                    self.best = Some((beginning, [number as usize, second, third]));
                }
            }
        }
    }
}
