//! Is there anything beyond the noise, and what does it depend on?
//!
//! A sparse regression over the dictionary of [`dictionary`](crate::judge::pose_dictionary): the term that explains most for the
//! columns that it takes (Bayesian information criterion) is listed and taken out, then the next, while each is no chance (F
//! test on all axes together, times the number of terms). Each is tried in the frame of the tool and in that of the base.
//! Outliers are brought near first.

use darm_core::effect::Frame;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::judge::pose_dictionary::dictionary;
use crate::judge::regression::{Design, Taken, Term, of_axis, squares};
use crate::judge::selected::SelectedPoses;
use crate::least_squares::{size, weights};
use crate::outcome::{Dependence, Structure, axis_name};
use crate::progress::Cancelled;
use crate::select::problem::RegressionProblem as _;
use crate::select::significance::f_test;
use darm_measure::median;

/// Terms that are listed at most.
const MAX_TERMS: usize = 4;
/// Share of what a term takes from here on which it is of one axis.
const MAIN_SHARE: f64 = 0.75;
/// Share of the rows, the farthest off, that do not count in how much there is beyond the noise.
const TRIMMED: f64 = 0.1;

/// The structure in the residuals of some rows, after `fitted` values were fitted to them.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn structure(selected: &SelectedPoses, residuals: &[f64], fitted: usize) -> Result<Structure, Cancelled> {
    let (observations, noise) = (&selected.problem.training, selected.repeats());
    let n_axes = observations.n_axes();
    let winsorized = winsorized(residuals, n_axes);
    let dof = winsorized.len().saturating_sub(fitted);
    let ratio = winsorized.iter().map(|r| r * r).sum::<f64>() / dof.max(1) as f64;
    let p = noise.map(|noise| f_test(ratio, dof, noise.dof * n_axes));
    let huberized = huberized(residuals, n_axes);
    let is_far = p.is_some_and(|p| p < selected.problem.levels.structure);
    let (depends_on, left) = match noise {
        // What rounding does to a pose depends on the word.
        Some(noise) if noise.is_rounded && !is_far => (Vec::new(), huberized.clone()),
        _ => dependences(selected, &huberized)?,
    };
    let beyond_noise = is_far || !depends_on.is_empty();
    let square = trimmed_mean_square(residuals, n_axes);
    let (excess, over_noise) = match noise {
        Some(_) => ((square - 1.0).max(0.0), square.sqrt()),
        None => {
            let share = depends_on.iter().map(|term| term.share).sum::<f64>().min(1.0);
            (square * share, over_rest(&huberized, &left, n_axes))
        }
    };
    Ok(Structure { ratio: noise.map(|_| ratio), p, beyond_noise, excess, over_noise, depends_on })
}

/// Mean square of a component, without the rows that are farthest off, in units of what it is of normal noise.
fn trimmed_mean_square(residuals: &[f64], n_axes: usize) -> f64 {
    let mut squares: Vec<f64> = residuals.chunks(n_axes).map(|row| size(row).powi(2)).collect();
    squares.sort_unstable_by(f64::total_cmp);
    squares.truncate(squares.len() - (squares.len() as f64 * TRIMMED) as usize);
    let mean = squares.iter().sum::<f64>() / (squares.len().max(1) * n_axes) as f64;
    // Of χ² with n degrees of freedom, the mean of what lies below a quantile is n·F(n + 2)/F(n) there.
    let [Ok(chi), Ok(next)] = [0, 2].map(|more| ChiSquared::new((n_axes + more) as f64)) else { return mean };
    mean / (next.cdf(chi.inverse_cdf(1.0 - TRIMMED)) / (1.0 - TRIMMED))
}

/// The residuals with those brought near that are far off among themselves: a residual much larger than the noise keeps its
/// shape.
fn huberized(residuals: &[f64], n_axes: usize) -> Vec<f64> {
    let usual = median(residuals.chunks(n_axes).map(size)).unwrap_or(1.0) / (n_axes as f64).sqrt();
    let scale = usual.max(1.0);
    let scaled: Vec<f64> = residuals.iter().map(|r| r / scale).collect();
    winsorized(&scaled, n_axes).into_iter().map(|r| r * scale).collect()
}

/// The residuals with those that are far off brought near.
fn winsorized(residuals: &[f64], n_axes: usize) -> Vec<f64> {
    let weights = weights(residuals, n_axes);
    residuals.iter().enumerate().map(|(k, r)| r * weights[k / n_axes]).collect()
}

/// The largest root mean square of a component in units of what the dependences leave of it: what is on one component
/// is little beside the noise of all.
fn over_rest(residuals: &[f64], left: &[f64], n_axes: usize) -> f64 {
    let rows: Vec<usize> = (0..residuals.len() / n_axes).collect();
    let square = |all: &[f64], axis| squares(&of_axis(all, n_axes, axis), &rows).max(f64::MIN_POSITIVE);
    (0..n_axes).map(|axis| (square(residuals, axis) / square(left, axis)).sqrt()).fold(1.0, f64::max)
}

/// What residuals depend on, and what is left of them without that.
fn dependences(selected: &SelectedPoses, residuals: &[f64]) -> Result<(Vec<Dependence>, Vec<f64>), Cancelled> {
    let SelectedPoses { arm, run, problem, .. } = *selected;
    let (observations, level) = (&problem.training, problem.levels.structure);
    let terms = dictionary(arm, run, observations);
    let rows: Vec<usize> = (0..observations.rows.len()).collect();
    let designs: Vec<Design> = terms.iter().filter_map(|term| Design::new(term, &rows)).collect();
    let n_tried = 2.0 * designs.len() as f64;
    let n_axes = observations.n_axes();
    let of_axes = (0..n_axes).map(|axis| squares(&of_axis(residuals, n_axes, axis), &rows));
    let total = of_axes.sum::<f64>().max(f64::MIN_POSITIVE);
    let mut found: Vec<Dependence> = Vec::new();
    let mut left = residuals.to_vec();
    while found.len() < MAX_TERMS {
        let turned = observations.in_base(&left);
        let mut first: Option<(Frame, &Design, Taken)> = None;
        for design in &designs {
            for (frame, rows) in [(Frame::Tool, &left), (Frame::Base, &turned)] {
                problem.progress().check()?;
                let taken = design.take(rows);
                if first.as_ref().is_none_or(|(.., first)| taken.criterion.total_cmp(&first.criterion).is_lt()) {
                    first = Some((frame, design, taken));
                }
            }
        }
        let Some((frame, design, taken)) = first else { break };
        let p = (taken.p(1.0) * n_tried).min(1.0);
        if p >= level || taken.criterion >= 0.0 {
            break;
        }
        let before = if frame == Frame::Base { &turned } else { &left };
        let axis = main_axis(before, &taken.left, &rows).map(|k| axis_name(observations.axes[k]).to_owned());
        left = if frame == Frame::Base { observations.in_tool(&taken.left) } else { taken.left };
        let Term { regressor, shape, kept, .. } = design.term;
        found.push(Dependence {
            axis,
            regressor: regressor.clone(),
            variable: regressor.name_in(arm),
            shape: *shape,
            frame: Some(frame),
            share: taken.square / total,
            p: Some(p),
            held_out_gain: None,
            curve: Vec::new(),
            terms: kept.clone(),
        });
    }
    Ok((found, left))
}

/// The axis that a term takes most of its squares from, in units of the noise.
fn main_axis(before: &[f64], left: &[f64], rows: &[usize]) -> Option<usize> {
    let n_axes = before.len() / rows.len();
    let square = |all: &[f64], axis| squares(&of_axis(all, n_axes, axis), rows);
    let taken: Vec<f64> = (0..n_axes).map(|axis| square(before, axis) - square(left, axis)).collect();
    let total: f64 = taken.iter().sum();
    taken.iter().position(|&of_axis| of_axis > MAIN_SHARE * total)
}
