//! The tests that a diagnosis rests on: is this more than chance?
//!
//! | question | test | level |
//! | --- | --- | --- |
//! | is there more than noise? | residuals against repeats: F, one-sided | [`STRUCTURE_LEVEL`] |
//! | does an effect predict words that it was not fitted to? | reduction of the cross-validated squares, word by word: t, one-sided, times the number of effects tried (Bonferroni) | [`DISCOVERY_LEVEL`] |
//! | do all effects together predict held-out words? | reduction of the squares on the held-out words, once, for the verdict: t, one-sided | [`CONFIRMATION_LEVEL`] |
//! | is another effect as good? | reduction from it to the best, word by word: t, one-sided | [`RIVAL_LEVEL`], of signals at another place [`SIGNAL_RIVAL_LEVEL`] |

use std::collections::BTreeMap;

use statrs::distribution::{Beta, ContinuousCDF, FisherSnedecor, StudentsT};

use crate::least_squares::weights;

/// Chance to see structure in pure noise.
pub const STRUCTURE_LEVEL: f64 = 1e-3;
/// Chance to discover any effect, of all that are tried, where there is none.
pub const DISCOVERY_LEVEL: f64 = 0.01;
/// Chance that effects which are not there lower the error on rows that no fit has seen.
pub const CONFIRMATION_LEVEL: f64 = 0.025;
/// An effect worse than the best one with at least this confidence is not its rival.
pub const RIVAL_LEVEL: f64 = 0.05;
/// Takes the place of [`RIVAL_LEVEL`] between effects of signals at different places. Two such effects often add the same to the signals,
/// a weight at an elbow for example; the wrong one is named with this chance.
pub const SIGNAL_RIVAL_LEVEL: f64 = 0.01;

/// The levels of the tests on tool poses: those of one diagnosis, or of one of several on the same measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Instead of [`STRUCTURE_LEVEL`].
    pub structure: f64,
    /// Instead of [`DISCOVERY_LEVEL`].
    pub discovery: f64,
    /// Instead of [`CONFIRMATION_LEVEL`].
    pub confirmation: f64,
    /// Whether rows left out in turn may confirm an effect that is too small to show in the held-out ones. They have chosen
    /// the effect, so that this confirms nothing new.
    pub confirms_in_turn: bool,
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            structure: STRUCTURE_LEVEL,
            discovery: DISCOVERY_LEVEL,
            confirmation: CONFIRMATION_LEVEL,
            confirms_in_turn: true,
        }
    }
}

impl Levels {
    /// The levels of a diagnosis that may spend this share (0 to 1) of the chance of a false alarm; only held-out rows
    /// confirm.
    pub fn share(share: f64) -> Self {
        Self {
            structure: share * STRUCTURE_LEVEL,
            discovery: share * DISCOVERY_LEVEL,
            confirmation: share * CONFIRMATION_LEVEL,
            confirms_in_turn: false,
        }
    }
}

/// By how much the loss of one model is lower than that of another, and how certain that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossReduction {
    /// Σ w·(|before|² − |after|²).
    pub sum: f64,
    /// Its standard error, by the noise in `after`; `None` of a test that needs none.
    pub error: Option<f64>,
    /// Degrees of freedom that the test rests on.
    pub dof: f64,
    /// Chance of at least this reduction where there is none.
    pub p: f64,
}

/// The reduction from the residuals `before` to those `after`; `groups` has the word of each row.
///
/// With Δ = before − after it is Σ w·(|Δ|² + 2·after·Δ); what of it is chance is the second part, whose terms are
/// independent from word to word. A row far off by `after` has the weight w that a fit gives it. The degrees of
/// freedom are those of v = Σ w·|Δ|² of each word.
pub fn clustered_t_test(before: &[f64], after: &[f64], groups: &[usize]) -> LossReduction {
    let n_axes = after.len() / groups.len().max(1);
    let row_weights = weights(after, n_axes.max(1));
    let mut of_groups: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
    let mut sum = 0.0;
    for (row, (group, weight)) in groups.iter().zip(row_weights).enumerate() {
        let range = row * n_axes..(row + 1) * n_axes;
        for (b, a) in before[range.clone()].iter().zip(&after[range]) {
            sum += weight * (b * b - a * a);
            let [cross, change] = of_groups.entry(*group).or_default();
            *cross += 2.0 * weight * a * (b - a);
            *change += weight * (b - a).powi(2);
        }
    }
    let error = of_groups.values().map(|[cross, _]| cross * cross).sum::<f64>().sqrt();
    let dof = dof_of_groups(of_groups.values().map(|[_, change]| *change));
    if error == 0.0 || dof.is_nan() || dof <= 0.0 {
        return LossReduction { sum, error: Some(error), dof, p: if sum > 0.0 && dof > 0.0 { 0.0 } else { 1.0 } };
    }
    let p = StudentsT::new(0.0, 1.0, dof).map_or(1.0, |t| t.sf(sum / error));
    LossReduction { sum, error: Some(error), dof, p }
}

/// Degrees of freedom of a test to which groups contribute these `weights` v: (Σ v)² / Σ v² − 1. They count the groups
/// that carry it, and are their number less one where all carry the same.
///
/// Source: A. V. Carter, K. T. Schnepel, D. G. Steigerwald, Rev. Econ. Stat. 99 (2017) 698.
pub(crate) fn dof_of_groups(weights: impl Iterator<Item = f64>) -> f64 {
    let [sum, squares] = weights.fold([0.0; 2], |[sum, squares], weight| [sum + weight, squares + weight * weight]);
    sum * sum / squares - 1.0
}

/// The reduction of the loss from the losses of each group before and after it. Two t-tests ask whether the mean fall of the
/// groups, and their mean relative fall, which lies within ±1, is above zero; p is twice the smaller chance.
///
/// It holds where groups differ in size and what remains has separate structure in every group. What does not lower the
/// sum is no fall.
pub fn paired_t_test(losses: &[[f64; 2]]) -> LossReduction {
    let (sum, dof): (f64, f64) =
        (losses.iter().map(|[before, after]| before - after).sum(), losses.len().saturating_sub(1) as f64);
    let relative: Vec<f64> =
        losses.iter().map(|[before, after]| (before - after) / (before + after).max(f64::MIN_POSITIVE)).collect();
    let absolute: Vec<f64> = losses.iter().map(|[before, after]| before - after).collect();
    if losses.len() < 2 || !sum.is_finite() || sum <= 0.0 {
        return LossReduction { sum, error: None, dof, p: 1.0 };
    }
    LossReduction {
        sum,
        error: None,
        dof,
        p: (2.0 * chance_of_mean(&relative).min(chance_of_mean(&absolute))).min(1.0),
    }
}

/// Chance that the mean of these numbers is as far above zero where that of all such numbers is not: t, one-sided; 1 of fewer
/// than two.
pub fn chance_of_mean(numbers: &[f64]) -> f64 {
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    let variance = numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / n).sqrt();
    match mean / error {
        _ if error == 0.0 && mean > 0.0 => 0.0,
        size if !size.is_finite() => 1.0,
        size => StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |t| t.sf(size)),
    }
}

/// Chance that a mean square this many times the noise's is noise.
pub fn f_test(ratio: f64, dof: usize, noise_dof: usize) -> f64 {
    if dof == 0 || noise_dof == 0 {
        return 1.0;
    }
    FisherSnedecor::new(dof as f64, noise_dof as f64).map_or(1.0, |f| f.sf(ratio.max(0.0)))
}

/// The 95 % interval of a rate of which `hits` of `n` were seen.
///
/// Source: C. J. Clopper, E. S. Pearson, Biometrika 26 (1934) 404.
pub fn clopper_pearson(hits: usize, n: usize) -> [f64; 2] {
    let quantile =
        |a: usize, b: usize, p: f64| Beta::new(a as f64, b as f64).map_or(f64::NAN, |beta| beta.inverse_cdf(p));
    let misses = n.saturating_sub(hits);
    let low = if hits == 0 { 0.0 } else { quantile(hits, misses + 1, 0.025) };
    let high = if misses == 0 { 1.0 } else { quantile(hits + 1, misses, 0.975) };
    [low, high]
}

/// How many standard errors wide 95 % of a mean's distribution reaches to one side.
pub fn quantile_975(dof: usize) -> f64 {
    StudentsT::new(0.0, 1.0, dof.max(1) as f64).map_or(1.96, |t| t.inverse_cdf(0.975))
}

/// Chance that a mean which is zero lies at least this many standard errors off, to either side.
pub fn chance_beyond(errors: f64, dof: usize) -> f64 {
    StudentsT::new(0.0, 1.0, dof.max(1) as f64).map_or(1.0, |t| 2.0 * t.sf(errors.abs()))
}

/// Which of these chances are discoveries, so that `share` of those is false at most.
///
/// Source: Y. Benjamini, Y. Hochberg, J. R. Statist. Soc. B 57 (1995) 289.
pub fn discoveries(chances: &[f64], share: f64) -> Vec<bool> {
    let mut sorted = chances.to_vec();
    sorted.sort_by(f64::total_cmp);
    let level = |rank: usize| share * (rank + 1) as f64 / sorted.len() as f64;
    let last = (0..sorted.len()).rev().find(|&rank| sorted[rank] <= level(rank));
    chances.iter().map(|chance| last.is_some_and(|rank| *chance <= sorted[rank])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_chances_few_are_discoveries() {
        // Levels 0.0125, 0.025, 0.0375, 0.05: the third is below its own, the second only below the third's.
        assert_eq!(discoveries(&[0.9, 0.001, 0.03, 0.035], 0.05), [false, true, true, true]);
        assert_eq!(discoveries(&[0.9, 0.02, 0.04, 0.8], 0.05), [false; 4]);
        assert!((chance_beyond(1.96, 100_000) - 0.05).abs() < 1e-4 && chance_beyond(-1.96, 100_000) < 0.051);
    }

    #[test]
    fn a_fall_to_nothing_is_certain() {
        assert_eq!(
            clustered_t_test(&[1.0, 2.0], &[0.0, 0.0], &[0, 1]),
            LossReduction { sum: 5.0, error: Some(0.0), dof: 25.0 / 17.0 - 1.0, p: 0.0 }
        );
    }

    #[test]
    fn no_fall_is_chance() {
        assert!((clustered_t_test(&[1.0, 0.5], &[0.5, 1.0], &[0, 1]).p - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_fall_in_one_word_proves_nothing_and_in_some_of_many_it_does() {
        // Words as before, and `n` in which five times the noise goes: 25·n of 2·5·√n standard errors.
        let fall = |n: usize| {
            let (mut before, after, groups) = ([1.0; 12], [1.0; 12], [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
            before[..n].fill(6.0);
            clustered_t_test(&before, &after, &groups)
        };
        assert_eq!((fall(1).sum, fall(1).error, fall(1).p), (35.0, Some(10.0), 1.0));
        // t = 35·4/(10·√4) = 7 with 3 degrees of freedom.
        assert!((fall(4).p - 0.003).abs() < 5e-4, "{}", fall(4).p);
    }

    #[test]
    fn a_small_fall_everywhere_is_no_chance_and_one_here_and_there_is() {
        let falls =
            |shares: &[f64]| paired_t_test(&shares.iter().map(|share| [100.0, 100.0 * share]).collect::<Vec<_>>()).p;
        assert!(falls(&[0.9, 0.91, 0.89, 0.9, 0.92, 0.88, 0.9, 0.9]) < 1e-6);
        assert!(falls(&[0.9, 1.1, 0.8, 1.15, 0.9, 1.05, 0.95, 1.1]) > 0.2);
        assert_eq!(falls(&[1.0, 1.1]), 1.0);
    }

    #[test]
    fn table_values() {
        // Fisher's tables: F(0.99; 4, 10) = 5.994, t(0.975; 10) = 2.228.
        assert!((f_test(5.994, 4, 10) - 0.01).abs() < 1e-5);
        assert!((quantile_975(10) - 2.228).abs() < 1e-3);
        // Of ten tries: none, and nine; the exact bounds are 1 − 0.025^(1/10) = 0.3085 and 0.555, 0.9975.
        assert!((clopper_pearson(0, 10)[1] - 0.3085).abs() < 1e-4);
        let [low, high] = clopper_pearson(9, 10);
        assert!((low - 0.5550).abs() < 1e-4 && (high - 0.9975).abs() < 1e-4);
    }
}
