//! The search that a user should take: damped steps within the limits, from other starts when one leads nowhere.

use nalgebra::SMatrix;

use super::{Arm, damped_step, error, scale};
use crate::real::{Real, real};
use crate::se::{Pose, Twist};
use crate::tree::Frames;
use crate::trig;

/// μ per ε²: how strongly steps are damped far from the target.
const DAMPING: f64 = 0.1;
/// Damping is not below this, m²: steps stay finite at a singularity.
const MIN_DAMPING: f64 = 1e-9;
/// A descent in which the cost has not fallen by this factor in [`PATIENCE`] steps is given up.
const STALLED: f64 = 0.7;
const PATIENCE: usize = 5;
/// Two starts whose errors differ by less than this part have met the same nearest pose.
const SAME: f64 = 1e-3;
/// Restarts within ± this where a joint has no limit, rad or m.
const UNLIMITED: f64 = core::f64::consts::PI;

/// What is asked of [`solve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options<T> {
    /// Position tolerance, m; infinite when the position does not count.
    pub position_m: T,
    /// Orientation tolerance, rad; infinite when the orientation does not count.
    pub orientation_rad: T,
    /// ℓ: how many metres one radian is held equal to.
    pub length_scale_m: T,
    /// Most steps from one start.
    pub steps: usize,
    /// Most starts.
    pub starts: usize,
    /// Draws the starts after the first: the same seed, the same answer.
    pub seed: u64,
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The tool is within both tolerances of the target.
    Reached,
    /// The target is farther than the arm is long, or several starts ended at the same nearest pose: take it as out of reach.
    OutOfReach,
    /// No start came near enough, and they ended differently: more starts or steps may help.
    NotConverged,
}

/// The joint positions that came closest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution<T: Real, const N: usize> {
    /// How the search ended.
    pub status: Status,
    /// Joint positions within the limits, rad or m.
    pub q: [T; N],
    /// Where they bring the tool in the base, by forward kinematics.
    pub pose: Pose<T>,
    /// Distance from the target, m.
    pub error_m: T,
    /// Angle from the target, rad.
    pub error_rad: T,
    /// Steps of all starts.
    pub steps: usize,
    /// Starts.
    pub starts: usize,
}

impl<T: Real> Default for Options<T> {
    /// 1e-5 m, 1e-5 rad, ℓ = 0.5 m, 30 steps from each of 100 starts.
    fn default() -> Self {
        let tolerance = real(1e-5);
        Self {
            position_m: tolerance,
            orientation_rad: tolerance,
            length_scale_m: real(0.5),
            steps: 30,
            starts: 100,
            seed: 1,
        }
    }
}

impl<T: Real> Options<T> {
    /// Whether an error (rad, m) is within both tolerances.
    pub fn accepts(&self, error: &Twist<T>) -> bool {
        error.linear.norm_squared() <= self.position_m * self.position_m
            && error.angular.norm_squared() <= self.orientation_rad * self.orientation_rad
    }

    /// What the angular and the linear part of an error are multiplied by, (ℓ, 1); zero for a part that does not count.
    pub fn weights(&self) -> [T; 2] {
        let counts = |tolerance: T, weight| if tolerance.is_finite() { weight } else { T::zero() };
        [counts(self.orientation_rad, self.length_scale_m), counts(self.position_m, T::one())]
    }
}

/// Positions of the joints, and how far the tool is from the target there.
#[derive(Clone, Copy)]
struct Place<T: Real, const N: usize> {
    q: [T; N],
    /// ε, given in rad and m.
    error: Twist<T>,
    /// ε², m².
    cost: T,
}

/// Joint positions within the limits that bring the tool to `target`, or as near as could be found; the first start is `q`.
///
/// Each start is followed by damped steps with μ in proportion to ε² (Chan, Lawrence 1988); a joint at a limit that a step would
/// leave is held there and the step taken with the others; a start that comes no nearer is left for another, drawn within
/// the limits. Never an error: [`Solution::status`] says how it ended.
pub fn solve<T: Real, const N: usize>(
    arm: &Arm<T, N>,
    target: &Pose<T>,
    q: &[T; N],
    options: &Options<T>,
) -> Solution<T, N> {
    solve_observed(arm, target, q, options, |_, _| ())
}

/// As [`solve`]; shows `visit` the number of the start and the error (rad, m) before each step and at each end.
pub fn solve_observed<T: Real, const N: usize>(
    arm: &Arm<T, N>,
    target: &Pose<T>,
    q: &[T; N],
    options: &Options<T>,
    mut visit: impl FnMut(usize, &Twist<T>),
) -> Solution<T, N> {
    let mut search = Search { arm, target, options, frames: Frames::default(), steps: 0 };
    let mut draw = Draw(options.seed);
    let mut best = search.descend(arm.within_limits(q), |error| visit(0, error));
    let mut starts = 1;
    let mut met_again = 0;
    while starts < options.starts && !options.accepts(&best.error) && met_again < options.starts / 4 {
        let place = search.descend(draw.start(arm), |error| visit(starts, error));
        starts += 1;
        if (place.cost - best.cost).abs() <= best.cost * real(SAME) {
            met_again += 1;
        } else if place.cost < best.cost {
            met_again = 0;
        }
        if place.cost < best.cost {
            best = place;
        }
    }
    search.solution(best, starts, met_again > 1)
}

struct Search<'a, T: Real, const N: usize> {
    arm: &'a Arm<'a, T, N>,
    target: &'a Pose<T>,
    options: &'a Options<T>,
    frames: Frames<T, N>,
    steps: usize,
}

impl<T: Real, const N: usize> Search<'_, T, N> {
    /// The nearest place on the way from one start.
    fn descend(&mut self, mut q: [T; N], mut visit: impl FnMut(&Twist<T>)) -> Place<T, N> {
        let mut best: Option<Place<T, N>> = None;
        let mut mark = T::zero();
        let weights = self.options.weights();
        for step in 0..=self.options.steps {
            let (error, mut jacobian) = self.arm.linearised(self.target, &q, &mut self.frames);
            visit(&error);
            let mut scaled = error;
            scale(&mut scaled, &mut jacobian, weights);
            let cost = scaled.angular.norm_squared() + scaled.linear.norm_squared();
            let place = Place { q, error, cost };
            if best.is_none_or(|best| cost < best.cost) {
                best = Some(place);
            }
            if self.options.accepts(&error) || step == self.options.steps {
                break;
            }
            if step % PATIENCE == 0 {
                if step > 0 && cost > mark * real(STALLED) {
                    break;
                }
                mark = cost;
            }
            q = self.stepped(place, &scaled, jacobian);
            self.steps += 1;
        }
        best.unwrap_or(Place { q, error: Twist::zero(), cost: T::zero() })
    }

    /// One damped step; joints that it would take out of their limits stay on them, and the others take their part.
    fn stepped(&self, from: Place<T, N>, error: &Twist<T>, mut jacobian: SMatrix<T, 6, N>) -> [T; N] {
        let damping = from.cost * real(DAMPING) + real(MIN_DAMPING);
        let mut step = damped_step(&jacobian, error, damping);
        let mut limited = false;
        for (((step, q), [low, high]), column) in
            step.iter().zip(&from.q).zip(self.arm.limits).zip(&mut jacobian.data.0)
        {
            if (*q <= *low && *step < T::zero()) || (*q >= *high && *step > T::zero()) {
                *column = [T::zero(); 6];
                limited = true;
            }
        }
        if limited {
            step = damped_step(&jacobian, error, damping);
        }
        let mut q = from.q;
        q.iter_mut().zip(&step).for_each(|(q, step)| *q += *step);
        self.arm.within_limits(&q)
    }

    fn solution(&self, best: Place<T, N>, starts: usize, met_again: bool) -> Solution<T, N> {
        let pose = self.arm.tree.pose(self.arm.tool, &best.q);
        let error = error(self.target, &pose);
        let status = if self.options.accepts(&error) {
            Status::Reached
        } else if met_again || self.arm.is_beyond_reach(&self.target.position, self.options.position_m) {
            Status::OutOfReach
        } else {
            Status::NotConverged
        };
        let (error_m, error_rad) = (trig::sqrt(error.linear.norm_squared()), trig::sqrt(error.angular.norm_squared()));
        Solution { status, q: best.q, pose, error_m, error_rad, steps: self.steps, starts }
    }
}

/// Numbers from a seed (SplitMix64).
struct Draw(u64);

impl Draw {
    /// A number within 0..1.
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Positions within the limits.
    fn start<T: Real, const N: usize>(&mut self, arm: &Arm<T, N>) -> [T; N] {
        let unlimited: T = real(UNLIMITED);
        let mut q = [T::zero(); N];
        for (q, [low, high]) in q.iter_mut().zip(arm.limits) {
            let low = if low.is_finite() { *low } else { -unlimited };
            let high = if high.is_finite() { *high } else { unlimited };
            *q = low + (high - low) * real(self.part());
        }
        arm.within_limits(&q)
    }
}
