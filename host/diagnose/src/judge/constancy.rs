//! Whether a value is the same from the first row to the last. An interval says where one number lies: of a value that changes it would
//! exclude what the value was in most of the rows.
//!
//! The residual is fitted with the column of a value times what grows with time, or settles in an eighth of it, beside all columns of
//! the model. A value changes where that is no chance and its change, from the first row to the last, is wider than its interval. A
//! single bad row shows no change: it is the scatter of the test as well.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::least_squares::pseudo_inverse;
use crate::outcome::{Dependence, Effect, Regressor, Shape};
use crate::select::significance::{chance_beyond, dof_of_groups};

/// A column is that of others where no more than this share of its square is its own.
const OWN_SHARE: f64 = 1e-6;
/// A value that settles does so in this share of the rows' time.
const SETTLING: f64 = 0.125;

/// A fitted model.
pub(crate) struct Fitted<'a> {
    /// Residuals in units of the noise, rows × axes.
    pub(crate) residuals: &'a [f64],
    /// How they change with each value that was fitted.
    pub(crate) columns: &'a [Vec<f64>],
    /// When each row was measured, s.
    pub(crate) time_s: &'a [f64],
    /// The group of each row: rows of one may share an error.
    pub(crate) groups: &'a [usize],
    /// Chance to see any change where there is none.
    pub(crate) level: f64,
}

/// How a value changes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    /// From the first row to the last, in the unit of the value.
    size: f64,
    /// Share of the residual's mean square that it takes up.
    share: f64,
    /// Chance of such a share where the value is constant, times the number of tests.
    p: f64,
}

impl Fitted<'_> {
    /// Takes the intervals from values that are not the same all the time. `places` has for each value that was fitted its effect and
    /// its number there, `None` where none reports it. Gives what the residual depends on, with the number of the value.
    pub(crate) fn withhold_intervals(
        &self,
        effects: &mut [Effect],
        places: &[Option<(usize, usize)>],
    ) -> Vec<(usize, Dependence)> {
        let width = |place: &Option<(usize, usize)>| {
            let ci95 = place.and_then(|(effect, number)| effects[effect].values[number].ci95);
            ci95.map_or(f64::INFINITY, |[low, high]| high - low)
        };
        let changes = self.changes(&places.iter().map(width).collect::<Vec<_>>());
        let mut depends_on = Vec::new();
        for (value, (place, change)) in places.iter().zip(changes).enumerate() {
            let Some(((effect, number), change)) = place.zip(change) else { continue };
            let Effect { law, site, values, .. } = &mut effects[effect];
            values[number].ci95 = None;
            let dependence = Dependence {
                variable: format!("time, by the size of {law} at {site}"),
                shape: Shape::Together,
                p: Some(change.p),
                ..Dependence::of_share(Regressor::Time, change.share)
            };
            depends_on.push((value, dependence));
        }
        depends_on
    }

    /// How each value changes; `None` where its interval, of this width, holds all the time.
    fn changes(&self, widths: &[f64]) -> Vec<Option<Change>> {
        let n_axes = self.residuals.len() / self.time_s.len().max(1);
        let (first, last) =
            self.time_s.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(*t), b.max(*t)));
        if self.columns.is_empty() || n_axes == 0 || last <= first {
            return vec![None; widths.len()];
        }
        let residuals = DVector::from_column_slice(self.residuals);
        let columns = DMatrix::from_fn(residuals.len(), self.columns.len(), |k, value| self.columns[value][k]);
        let inverse = pseudo_inverse(&columns.tr_mul(&columns));
        let passed = |k: usize| (self.time_s[k / n_axes] - first) / (last - first);
        // Each from 0 at the first row to 1 at the last.
        let grows = |k: usize| passed(k);
        let settles = |k: usize| (-passed(k) / SETTLING).exp_m1() / (-1.0 / SETTLING).exp_m1();
        let shapes: [&dyn Fn(usize) -> f64; 2] = [&grows, &settles];
        let change = |(value, width): (usize, &f64)| {
            let of_shape = |shape: &&dyn Fn(usize) -> f64| {
                let with_time = DVector::from_fn(residuals.len(), |k, _| shape(k) * columns[(k, value)]);
                let own = &with_time - &columns * (&inverse * columns.tr_mul(&with_time));
                let is_own = own.norm_squared() > OWN_SHARE * with_time.norm_squared();
                is_own.then(|| self.along(&own, &residuals, (widths.len() * 2) as f64))
            };
            let found = shapes.iter().filter_map(of_shape).min_by(|a, b| a.p.total_cmp(&b.p));
            found.filter(|change| change.p < self.level && change.size.abs() > *width)
        };
        widths.iter().enumerate().map(change).collect()
    }

    /// What a column takes of the residuals, with a test that takes each group for one draw, one of `n_tests`.
    fn along(&self, own: &DVector<f64>, residuals: &DVector<f64>, n_tests: f64) -> Change {
        let (n_axes, square) = (residuals.len() / self.time_s.len(), own.norm_squared());
        let along = own.dot(residuals);
        let slope = along / square;
        let mut of_groups: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
        for (k, (own, residual)) in own.iter().zip(residuals.iter()).enumerate() {
            let [score, weight] = of_groups.entry(self.groups[k / n_axes]).or_default();
            *score += own * (residual - slope * own);
            *weight += own * own;
        }
        let scores: f64 = of_groups.values().map(|[score, _]| score * score).sum();
        let dof = dof_of_groups(of_groups.values().map(|[_, weight]| *weight)).max(0.0) as usize;
        let p = n_tests * chance_beyond(along / scores.sqrt().max(f64::MIN_POSITIVE), dof);
        let total = residuals.norm_squared().max(f64::MIN_POSITIVE);
        Change { size: -slope, share: along * slope / total, p }
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{RngExt as _, SeedableRng as _};

    use super::{Change, Fitted};

    /// The changes of two values, fitted to rows in which the first changes by `size` from the first row to the last.
    fn changes(seed: u64, size: f64) -> Vec<Option<Change>> {
        let mut random = StdRng::seed_from_u64(seed);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let n = 200;
        let columns: Vec<Vec<f64>> = (0..2).map(|_| (0..n).map(|_| normal()).collect()).collect();
        let time_s: Vec<f64> = (0..n).map(|k| 3.0 * k as f64).collect();
        let at = |k: usize| k as f64 / (n - 1) as f64 - 0.5;
        let mut residuals: Vec<f64> = (0..n).map(|k| normal() - size * at(k) * columns[0][k]).collect();
        // As a fit of both constant values leaves them.
        for _ in 0..20 {
            for column in &columns {
                let square: f64 = column.iter().map(|c| c * c).sum();
                let along = column.iter().zip(&residuals).map(|(c, r)| c * r).sum::<f64>() / square;
                residuals.iter_mut().zip(column).for_each(|(r, c)| *r -= along * c);
            }
        }
        let groups: Vec<usize> = (0..n).collect();
        Fitted { residuals: &residuals, columns: &columns, time_s: &time_s, groups: &groups, level: 1e-3 }
            .changes(&[0.3, 0.3])
    }

    #[test]
    fn a_value_that_changes_is_seen_with_its_size_and_the_other_is_not() {
        for seed in 0..20 {
            let [first, second] = changes(seed, 3.0)[..] else { unreachable!() };
            let size = first.unwrap().size;
            // Its standard error is 1/√(200/12), a quarter; the first of many is a little larger than it is.
            assert!((size - 3.0).abs() < 1.2, "seed {seed}: {size}");
            assert_eq!(second, None, "seed {seed}");
        }
    }

    #[test]
    fn a_constant_value_is_left_alone_at_the_level_of_the_test() {
        let false_ones = (0..2_000).filter(|seed| changes(*seed, 0.0).iter().any(Option::is_some)).count();
        // 2 expected at a level of 1e-3; more than 8 come once in 4 000 times.
        assert!(false_ones <= 8, "{false_ones}");
    }

    #[test]
    fn a_bad_row_is_no_change() {
        let mut residuals = vec![0.0; 60];
        residuals[1] = 50.0;
        let time_s: Vec<f64> = (0..60).map(f64::from).collect();
        let (columns, groups) = ([vec![1.0; 60]], (0..60).collect::<Vec<_>>());
        let fitted = Fitted { residuals: &residuals, columns: &columns, time_s: &time_s, groups: &groups, level: 1e-3 };
        assert_eq!(fitted.changes(&[0.0]), [None]);
    }

    #[test]
    fn rows_of_one_moment_show_nothing() {
        let columns = [vec![1.0, 1.0]];
        let fitted =
            Fitted { residuals: &[1.0, 2.0], columns: &columns, time_s: &[5.0, 5.0], groups: &[0, 1], level: 0.01 };
        assert_eq!(fitted.changes(&[0.1]), [None]);
    }
}
