//! Gauss–Newton on the group, within bounds, from one start.
//!
//! A step d is the smallest with J·d = r, found by singular values. Where it breaks bounds, those are kept as
//! equations and the step is taken in what is left; where it does not lower |r|, it is damped.
//! When all frames are met, the alteration is made small in the directions that they leave free.

use nalgebra::{DMatrix, DVector};

use super::SynthesisError;
use super::case::RANK_TOLERANCE;
use super::problem::{Bound, Problem};
use darm_core::se::Pose;
use darm_robot::svd::svd;

/// Steps from one start to one set of frames.
const MAX_STEPS: u32 = 60;
/// A residual as small as this is rounding.
pub(super) const EXACT: f64 = 2e-15;
/// Frames on the way to the desired ones count as met at this residual.
const ON_THE_WAY: f64 = 1e-6;
/// A residual below this is a solution that the last steps will make exact.
pub(super) const SOLVED: f64 = 1e-9;
/// A bound that is missed by less is kept, m or rad.
const KEPT: f64 = 1e-12;
/// Each projection leaves at most half of what two bounds of one unknown miss: 64 leave rounding.
const MAX_PROJECTIONS: u32 = 64;
/// The least share of the way that is worth a step.
const MIN_ADVANCE: f64 = 1.0 / 64.0;
/// Steps towards the least alteration.
const MINIMISING_STEPS: u32 = 8;
/// A step as small as this changes the alteration by its square only.
const SETTLED_CHANGE: f64 = 1e-5;
/// Steps until every needed word can be assembled, the shares of a step that are tried, and the share of what is missed that one may
/// leave.
const COMPLETING_STEPS: u32 = 60;
const SHARES: [f64; 5] = [1.0, 0.5, 0.25, 0.125, 0.0625];
const WORTH: f64 = 0.99;
/// The least ratio of pivots at which the normal equations lose no more digits than a later step brings back.
const WELL_POSED: f64 = 1e-4;

/// By how much a step is damped: not at all as long as full steps lower the residual.
#[derive(Clone, Copy, Default)]
pub(super) struct Damping(f64);

impl Damping {
    /// What is added to the diagonal.
    pub(super) fn value(self) -> f64 {
        self.0
    }

    /// After a step that lowers the residual.
    pub(super) fn lower(&mut self) {
        self.0 = if self.0 > 1e-4 { self.0 / 16.0 } else { 0.0 };
    }

    /// After a step that does not.
    pub(super) fn raise(&mut self) {
        self.0 = (self.0 * 8.0).max(1e-3);
    }

    /// Whether a shorter step would be none.
    pub(super) fn is_exhausted(self) -> bool {
        self.0 > 10.0
    }
}

/// What an alteration for the words is to keep.
#[derive(Clone, Copy)]
pub(super) enum Keep {
    /// The frames, to first order.
    Frames,
    /// Nothing: the alteration is the smallest.
    Little,
}

pub(super) struct Search<'p, 'a> {
    pub(super) problem: &'p mut Problem<'a>,
    pub(super) iterations: u32,
    /// Whether every needed word has to be assembled all the way.
    pub(super) keeps_words: bool,
}

impl Search<'_, '_> {
    /// Lowers the residual from `start` until it is below `enough` or does not fall any more.
    pub(super) fn descend(&mut self, start: &DVector<f64>, enough: f64) -> Result<(f64, DVector<f64>), SynthesisError> {
        let has_settled =
            |before: f64, after: f64, damping: Damping| before - after < 1e-12 * before && damping.value() == 0.0;
        let (residual, unknowns) = self.lower(start, MAX_STEPS, enough, has_settled)?;
        Ok((residual.amax(), unknowns))
    }

    /// Steps that lower |r|, at most `max_steps`, until r is below `enough` or no step lowers it any more, or `has_settled` by
    /// the norms before and after a step and its damping; the last residual and the unknowns.
    pub(super) fn lower(
        &mut self,
        start: &DVector<f64>,
        max_steps: u32,
        enough: f64,
        mut has_settled: impl FnMut(f64, f64, Damping) -> bool,
    ) -> Result<(DVector<f64>, DVector<f64>), SynthesisError> {
        let mut unknowns = start.clone();
        let (mut residual, mut jacobian) = self.problem.linearise(&unknowns)?;
        let mut words = self.word_bounds(&unknowns);
        let mut damping = Damping::default();
        for _ in 0..max_steps {
            if residual.amax() < enough {
                break;
            }
            self.iterations += 1;
            let next = &unknowns + self.step(&jacobian, &residual, &unknowns, None, damping.value(), &words);
            let next = if self.keeps_words { self.with_words(&next, Keep::Little) } else { Some(next) };
            let lower = next.and_then(|next| {
                let (lower, steeper) = self.problem.linearise(&next).ok()?;
                (lower.norm() < residual.norm()).then_some((next, lower, steeper))
            });
            let Some((next, lower, steeper)) = lower else {
                if damping.is_exhausted() || residual.amax() < SOLVED {
                    break;
                }
                damping.raise();
                continue;
            };
            let settled = has_settled(residual.norm(), lower.norm(), damping);
            (unknowns, residual, jacobian) = (next, lower, steeper);
            words = self.word_bounds(&unknowns);
            damping.lower();
            if settled {
                break;
            }
        }
        Ok((residual, unknowns))
    }

    /// Leads the frames from where the arm at `start` holds them to where they are desired.
    pub(super) fn follow(&mut self, start: &DVector<f64>) -> Result<(f64, DVector<f64>), SynthesisError> {
        let from = self.problem.poses(start)?;
        let to: Vec<Pose<f64>> = self.problem.targets.iter().map(|target| target.pose).collect();
        let mut unknowns = start.clone();
        let (mut done, mut advance) = (0.0, 0.25);
        while done < 1.0 && advance >= MIN_ADVANCE {
            let share = f64::min(done + advance, 1.0);
            for ((target, from), to) in self.problem.targets.iter_mut().zip(&from).zip(&to) {
                target.pose = *from * Pose::exp(&(from.to(to).log() * share));
            }
            match self.descend(&unknowns, ON_THE_WAY) {
                Ok((error, next)) if error < ON_THE_WAY => {
                    unknowns = next;
                    done = share;
                    advance *= 2.0;
                }
                _ => advance /= 2.0,
            }
        }
        self.problem.targets.iter_mut().zip(&to).for_each(|(target, to)| target.pose = *to);
        self.descend(&unknowns, EXACT)
    }

    /// Makes the alteration small where the frames leave it free, and the residual exact again.
    pub(super) fn minimise_change(&mut self, solved: DVector<f64>) -> DVector<f64> {
        let anchor = self.problem.start();
        let mut unknowns = solved.clone();
        for _ in 0..MINIMISING_STEPS {
            let Ok((residual, jacobian)) = self.problem.linearise(&unknowns) else { return solved };
            self.iterations += 1;
            let words = self.word_bounds(&unknowns);
            let step = self.step(&jacobian, &residual, &unknowns, Some(&anchor), 0.0, &words);
            let next = &unknowns + &step;
            if !self.has_words(&next) {
                break;
            }
            unknowns = next;
            if step.norm() < SETTLED_CHANGE {
                break;
            }
        }
        match self.descend(&unknowns, EXACT) {
            Ok((error, tidied))
                if error < SOLVED && self.altered(&tidied, &anchor) <= self.altered(&solved, &anchor) + 1e-12 =>
            {
                tidied
            }
            _ => solved,
        }
    }

    /// The unknowns nearest to `wanted` that the frames do not distinguish from `unknowns`, to first order.
    pub(super) fn nearest(
        &mut self,
        unknowns: &DVector<f64>,
        wanted: &DVector<f64>,
    ) -> Result<DVector<f64>, SynthesisError> {
        let (residual, jacobian) = self.problem.linearise(unknowns)?;
        self.iterations += 1;
        let words = self.word_bounds(unknowns);
        Ok(unknowns + self.step(&jacobian, &residual, unknowns, Some(wanted), 0.0, &words))
    }

    /// The unknowns altered until every needed word can be assembled, the frames kept to first order, bounds exactly. `None` where
    /// no step leads on.
    pub(super) fn with_words(&mut self, start: &DVector<f64>, keep: Keep) -> Option<DVector<f64>> {
        let mut unknowns = start.clone();
        let mut missed_m = self.problem.missed_m(&unknowns);
        for _ in 0..COMPLETING_STEPS {
            if missed_m == 0.0 {
                break;
            }
            let (residual, jacobian) = match keep {
                Keep::Frames => self.problem.linearise(&unknowns).ok()?,
                Keep::Little => (DVector::zeros(0), DMatrix::zeros(0, unknowns.len())),
            };
            self.iterations += 1;
            let words = self.problem.assembly_bounds(&unknowns);
            let step = self.step(&jacobian, &residual, &unknowns, None, 0.0, &words);
            let shorter = SHARES.iter().find_map(|share| {
                let next = &unknowns + &step * *share;
                let next_m = self.problem.missed_m(&next);
                (next_m < WORTH * missed_m && self.problem.residual(&next).is_ok()).then_some((next_m, next))
            });
            (missed_m, unknowns) = shorter?;
        }
        (missed_m == 0.0).then_some(unknowns)
    }

    /// The constraint on the words as bounds, where it is kept.
    fn word_bounds(&mut self, unknowns: &DVector<f64>) -> Vec<Bound> {
        if self.keeps_words { self.problem.assembly_bounds(unknowns) } else { Vec::new() }
    }

    /// Whether every needed word can be assembled, or need not be.
    fn has_words(&mut self, unknowns: &DVector<f64>) -> bool {
        !self.keeps_words || self.problem.missed_m(unknowns) == 0.0
    }

    fn altered(&self, unknowns: &DVector<f64>, anchor: &DVector<f64>) -> f64 {
        (unknowns - anchor).component_mul(self.problem.weights()).norm()
    }

    /// The step from `unknowns` that takes the residual away within the bounds; the smallest one, or the one that ends
    /// nearest to `anchor`.
    fn step(
        &self,
        jacobian: &DMatrix<f64>,
        residual: &DVector<f64>,
        unknowns: &DVector<f64>,
        anchor: Option<&DVector<f64>>,
        damping: f64,
        words: &[Bound],
    ) -> DVector<f64> {
        let weights = self.problem.weights();
        let away = anchor.map(|anchor| (unknowns - anchor).component_mul(weights));
        let mut active: Vec<usize> = Vec::new();
        let bounds: Vec<&Bound> = self.problem.bounds.iter().chain(words).collect();
        loop {
            let kept: Vec<&Bound> = active.iter().map(|&index| bounds[index]).collect();
            let face = Face::new(&kept, unknowns, weights);
            let step = smallest_step(jacobian, residual, away.as_ref(), &face, damping).component_div(weights);
            let next = unknowns + &step;
            let n_active = active.len();
            active.extend((0..bounds.len()).filter(|&index| bounds[index].slack(&next) < -1e-12));
            active.sort_unstable();
            active.dedup();
            if active.len() == n_active {
                let step = step * allowed_share(&bounds, &active, unknowns, &next);
                let next = unknowns + &step;
                let breaks = |bound: &Bound| bound.slack(&next) < bound.slack(unknowns).min(0.0) - KEPT;
                // Words and bounds that contradict each other are both missed by their least squares: bounds come first.
                if !words.is_empty() && self.problem.bounds.iter().any(breaks) {
                    return self.step(jacobian, residual, unknowns, anchor, damping, &[]);
                }
                return step;
            }
        }
    }
}

/// The directions that bounds kept as equations leave, in scaled unknowns, and the step onto those bounds.
struct Face {
    /// Columns are orthonormal directions; `None` where no bound is kept and all are free.
    free: Option<DMatrix<f64>>,
    onto: DVector<f64>,
}

impl Face {
    fn new(kept: &[&Bound], unknowns: &DVector<f64>, weights: &DVector<f64>) -> Self {
        let n = unknowns.len();
        if kept.is_empty() {
            return Self { free: None, onto: DVector::zeros(n) };
        }
        // Square, so that the right singular vectors span all directions.
        let mut rows = DMatrix::zeros(n.max(kept.len()), n);
        let mut shortfall = DVector::zeros(n.max(kept.len()));
        for (row, bound) in kept.iter().enumerate() {
            shortfall[row] = -bound.slack(unknowns);
            bound.terms.iter().for_each(|&(index, factor)| rows[(row, index)] = factor / weights[index]);
        }
        let Some(parts) = svd(&rows) else {
            // Nothing is free: no step.
            return Self { free: Some(DMatrix::zeros(n, 0)), onto: DVector::zeros(n) };
        };
        let tolerance = RANK_TOLERANCE * parts.singular_values.max();
        let free: Vec<usize> = (0..n).filter(|&k| parts.singular_values[k] <= tolerance).collect();
        let free = parts.v_t.as_ref().map(|v_t| v_t.select_rows(&free).transpose());
        let onto = parts.solve(&shortfall, tolerance).unwrap_or_else(|_| DVector::zeros(n));
        Self { free, onto }
    }
}

/// The step on a face that takes the residual away: min |away + step| over `jacobian · step = residual`.
fn smallest_step(
    jacobian: &DMatrix<f64>,
    residual: &DVector<f64>,
    away: Option<&DVector<f64>>,
    face: &Face,
    damping: f64,
) -> DVector<f64> {
    let on_face = face.free.as_ref().map(|free| jacobian * free);
    let on_face = on_face.as_ref().unwrap_or(jacobian);
    let project = |full: DVector<f64>| face.free.as_ref().map_or(full.clone(), |free| free.tr_mul(&full));
    let pull = away.map(|away| project(away + &face.onto));
    let mut wanted = residual - jacobian * &face.onto;
    if let Some(pull) = &pull {
        wanted += on_face * pull;
    }
    let mut step = damped_inverse(on_face, &wanted, damping);
    if let Some(pull) = &pull {
        step -= pull;
    }
    &face.onto + face.free.as_ref().map_or(step.clone(), |free| free * &step)
}

/// The smallest x that makes |matrix · x − right|² + damping²·|matrix|²·|x|² least; 0 where there is nothing to solve, or a number
/// has overflowed.
pub(super) fn damped_inverse(matrix: &DMatrix<f64>, right: &DVector<f64>, damping: f64) -> DVector<f64> {
    let floor = damping * matrix.norm();
    if matrix.is_empty() || !(floor.is_finite() && matrix.norm().is_finite() && right.norm().is_finite()) {
        return DVector::zeros(matrix.ncols());
    }
    well_posed_inverse(matrix, right, floor).unwrap_or_else(|| truncated_inverse(matrix, right, floor))
}

/// Aᵀ(A·Aᵀ + f²)⁻¹ right, where A has more columns than rows and its rows are far from dependent.
fn well_posed_inverse(matrix: &DMatrix<f64>, right: &DVector<f64>, floor: f64) -> Option<DVector<f64>> {
    if matrix.ncols() < matrix.nrows() {
        return None;
    }
    let mut gram = matrix * matrix.transpose();
    (0..gram.nrows()).for_each(|k| gram[(k, k)] += floor * floor);
    let cholesky = gram.cholesky()?;
    let pivots = cholesky.l_dirty().diagonal();
    (pivots.min() > WELL_POSED * pivots.max()).then(|| matrix.tr_mul(&cholesky.solve(right)))
}

/// The same by singular values, those of rounding size left out.
fn truncated_inverse(matrix: &DMatrix<f64>, right: &DVector<f64>, floor: f64) -> DVector<f64> {
    let parts = svd(matrix);
    let Some((Some(u), Some(v_t), values)) = parts.map(|parts| (parts.u, parts.v_t, parts.singular_values)) else {
        return DVector::zeros(matrix.ncols());
    };
    let threshold = RANK_TOLERANCE * values.max();
    let mut along = u.tr_mul(right);
    for (component, &value) in along.iter_mut().zip(values.iter()) {
        *component *= if value > threshold { value / (value * value + floor * floor) } else { 0.0 };
    }
    v_t.tr_mul(&along)
}

/// The share of the step that breaks none of the bounds that are not kept as equations.
fn allowed_share(bounds: &[&Bound], kept: &[usize], unknowns: &DVector<f64>, next: &DVector<f64>) -> f64 {
    let shares = bounds.iter().enumerate().filter(|(index, _)| !kept.contains(index)).map(|(_, bound)| {
        let (before, after) = (bound.slack(unknowns).max(0.0), bound.slack(next));
        if after < -1e-12 { before / (before - after) } else { 1.0 }
    });
    shares.fold(1.0, f64::min)
}

/// The unknowns moved inside the bounds: by the first of a bound's unknowns, then, where that broke another bound, by projections
/// onto one after the other, which end inside all of them if anything is.
pub(super) fn within(problem: &Problem, mut unknowns: DVector<f64>) -> DVector<f64> {
    for bound in &problem.bounds {
        let slack = bound.slack(&unknowns);
        if slack < 0.0 {
            let (index, factor) = bound.terms[0];
            unknowns[index] -= slack / factor;
        }
    }
    for _ in 0..MAX_PROJECTIONS {
        let mut is_inside = true;
        for bound in &problem.bounds {
            let slack = bound.slack(&unknowns);
            if slack < -KEPT {
                is_inside = false;
                let size: f64 = bound.terms.iter().map(|(_, factor)| factor * factor).sum();
                bound.terms.iter().for_each(|&(index, factor)| unknowns[index] -= slack * factor / size);
            }
        }
        if is_inside {
            break;
        }
    }
    unknowns
}
