//! A mass that the nominal model does not declare: on which link it is, on which side, how heavy.
//!
//! A point of mass Δm at c on a link adds Δm·(1, c) to the link's mass and first moment: as many columns of K as rows determine of
//! the link. Each link is tried beside what is named already; the one that explains most is named when chance would
//! not explain as much, with every link that explains the rows as well. Rows that no link explains raise the noise.
//!
//! Two links cannot be distinguished when the columns of the one lie in those of the other ([`separable`]), and a mass near
//! the joint between two links acts as one on either.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use super::equations::Equations;
use super::hold_out::rms_cop;
use super::{Unknown, bodies, body_name};
use darm_robot::robot::Robot;
use darm_robot::svd::svd;

/// Chance of naming a mass that is not there, for all links together.
const FALSE: f64 = 1e-3;
/// Chance that the true link is not in the set that is reported.
const LEFT_OUT: f64 = 1e-3;
/// Masses that are named at most.
const MAX_MASSES: usize = 6;
/// Below this share of its length a column adds nothing to others.
const NOTHING: f64 = 1e-8;

/// A mass that was named.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Named {
    /// The link that explains most, and after it those that explain as much.
    pub links: Vec<String>,
    /// The mass, kg.
    pub mass_kg: f64,
    /// Its standard deviation, kg.
    pub mass_sd_kg: f64,
    /// Its place in the frame of the first link, m; `None` where the rows do not determine it.
    pub place_m: [Option<f64>; 3],
    /// Before or behind the link's origin, and above or below, in words.
    pub side: String,
    /// Chance of explaining as much without a mass there.
    pub p: f64,
}

/// What is missing in the nominal masses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Missing {
    /// The masses, the one that explains most first.
    pub named: Vec<Named>,
    /// RMS error of the centre of pressure on held-out postures with the nominal masses, x and y, m.
    pub before_m: [f64; 2],
    /// The same with the named masses.
    pub after_m: [f64; 2],
    /// Nominal parameters and the named masses, in the order of [`Equations::unknowns`].
    #[serde(skip)]
    pub values: DVector<f64>,
}

/// Links that explain the rows as well as each other, and the chance of explaining as much without a mass.
struct Chosen {
    links: Vec<String>,
    p: f64,
}

/// What freed unknowns change.
struct Fitted {
    /// Of all unknowns.
    change: DVector<f64>,
    /// Of those that were free.
    covariance: DMatrix<f64>,
}

/// Rows, and what the masses that are named change.
struct Search {
    columns: DMatrix<f64>,
    residual: DVector<f64>,
    rows: usize,
}

/// Masses that the training rows identify beyond the nominal ones; errors are reported on `held_out`, which no fit has seen.
pub fn missing(robot: &Robot, equations: &Equations, held_out: &[usize]) -> Missing {
    let training: Vec<_> = (0..equations.samples.len()).filter(|k| !held_out.contains(k)).collect();
    let kept =
        Equations { samples: training.iter().map(|&k| equations.samples[k].clone()).collect(), ..equations.clone() };
    let (columns, right) = kept.stacked();
    let residual = &right - &columns * &kept.nominal;
    let search = Search { rows: right.len(), columns, residual };
    let identified = directions(&search.columns);
    let noise = search.noise(&identified);
    let (mut taken, mut chosen) = (Vec::<Option<usize>>::new(), Vec::new());
    while chosen.len() < MAX_MASSES {
        let Some((link, set)) = search.best(robot, &kept, &taken, noise) else { break };
        taken.push(link);
        chosen.push(set);
    }
    // Masses that were named later change those that were named before.
    let fitted = search.fitted(&indices(&kept, &taken));
    let values = &kept.nominal + &fitted.change;
    let mut first = 0;
    let named = taken.iter().zip(chosen).map(|(link, set)| {
        let own = kept.of_body(*link);
        first += own.len();
        search.named(&kept, &own, first - own.len(), &fitted, set)
    });
    let named: Vec<Named> = named.collect();
    let judged_on: Vec<usize> =
        if held_out.is_empty() { (0..equations.samples.len()).collect() } else { held_out.to_vec() };
    Missing {
        before_m: rms_cop(equations, &equations.nominal, &judged_on),
        after_m: rms_cop(equations, &values, &judged_on),
        named,
        values,
    }
}

/// The links on which a mass can be distinguished from one on any other link by these equations.
pub fn separable(robot: &Robot, equations: &Equations) -> Vec<Option<usize>> {
    let (columns, _) = equations.stacked();
    let of: Vec<(Option<usize>, DMatrix<f64>)> =
        bodies(robot).map(|body| (body, columns.select_columns(&equations.of_body(body)))).collect();
    let adds = |own: &DMatrix<f64>, other: &DMatrix<f64>| {
        let axes = directions(other);
        let rest = own - &axes * axes.tr_mul(own);
        rest.norm() > NOTHING * own.norm()
    };
    let alone = |k: &usize| of.iter().enumerate().all(|(j, (_, other))| j == *k || adds(&of[*k].1, other));
    (0..of.len()).filter(alone).map(|k| of[k].0).collect()
}

/// Orthonormal directions of the columns.
fn directions(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let parts = svd(columns);
    let directions = parts.and_then(|parts| {
        let floor = NOTHING * parts.singular_values.max();
        let kept: Vec<usize> = (0..parts.singular_values.len()).filter(|&k| parts.singular_values[k] > floor).collect();
        Some(parts.u?.select_columns(&kept))
    });
    directions.unwrap_or_else(|| DMatrix::zeros(columns.nrows(), 0))
}

fn indices(equations: &Equations, links: &[Option<usize>]) -> Vec<usize> {
    links.iter().flat_map(|link| equations.of_body(*link)).collect()
}

impl Search {
    /// Variance of a row that no parameters explain, at least what the sensors were said to have.
    fn noise(&self, explained: &DMatrix<f64>) -> f64 {
        let rest = self.residual.norm_squared() - explained.tr_mul(&self.residual).norm_squared();
        (rest / (self.rows - explained.ncols().min(self.rows - 1)) as f64).max(1.0)
    }

    /// What is left of the squares when these unknowns are free.
    fn left(&self, free: &[usize]) -> (f64, usize) {
        if free.is_empty() {
            return (self.residual.norm_squared(), 0);
        }
        let axes = directions(&self.columns.select_columns(free));
        (self.residual.norm_squared() - axes.tr_mul(&self.residual).norm_squared(), axes.ncols())
    }

    /// With these unknowns free.
    fn fitted(&self, free: &[usize]) -> Fitted {
        if free.is_empty() {
            return Fitted { change: DVector::zeros(self.columns.ncols()), covariance: DMatrix::zeros(0, 0) };
        }
        let mut change = DVector::zeros(self.columns.ncols());
        let mut covariance = DMatrix::zeros(free.len(), free.len());
        let Some(parts) = svd(&self.columns.select_columns(free)) else { return Fitted { change, covariance } };
        let floor = NOTHING * parts.singular_values.max();
        if let (Ok(values), Some(v_t)) = (parts.solve(&self.residual, floor), &parts.v_t) {
            free.iter().zip(&values).for_each(|(&k, value)| change[k] = *value);
            for (size, row) in parts.singular_values.iter().zip(v_t.row_iter()).filter(|(size, _)| **size > floor) {
                covariance += row.transpose() * row / (size * size);
            }
        }
        Fitted { change, covariance }
    }

    /// The link that explains most of what is left, if chance would not.
    fn best(
        &self,
        robot: &Robot,
        equations: &Equations,
        taken: &[Option<usize>],
        noise: f64,
    ) -> Option<(Option<usize>, Chosen)> {
        let known = indices(equations, taken);
        let (before, rank) = self.left(&known);
        let with =
            |link: &Option<usize>| -> Vec<usize> { known.iter().copied().chain(equations.of_body(*link)).collect() };
        let mut tried: Vec<(Option<usize>, f64, usize)> = bodies(robot)
            .filter(|link| !taken.contains(link))
            .filter_map(|link| {
                let free = with(&link);
                let (left, of) = self.left(&free);
                let mass = self.fitted(&free).change[*free.get(known.len())?];
                (mass > 0.0 && of > rank).then_some((link, left, of - rank))
            })
            .collect();
        tried.sort_by(|a, b| a.1.total_cmp(&b.1));
        let &(link, smallest, degrees) = tried.first()?;
        let chance =
            |gain: f64, degrees: usize| ChiSquared::new(degrees as f64).map_or(1.0, |law| law.sf(gain / noise));
        let p = chance(before - smallest, degrees);
        if p * tried.len() as f64 > FALSE {
            return None;
        }
        let as_well = tried.iter().filter(|(_, left, _)| chance(left - smallest, 3) > LEFT_OUT);
        let links = as_well.map(|(link, ..)| body_name(robot, *link)).collect();
        Some((link, Chosen { links, p }))
    }

    /// The mass whose unknowns are `own`, from `first` on among those that were free.
    fn named(
        &self,
        equations: &Equations,
        own: &[usize],
        first: usize,
        fitted: &Fitted,
        Chosen { links, p }: Chosen,
    ) -> Named {
        let Fitted { change, covariance } = fitted;
        let mass_kg = own.first().map_or(0.0, |&k| change[k]);
        let mut place_m = [None; 3];
        for &k in own {
            if let Unknown::Inertial(inertial) = equations.unknowns[k]
                && (1..4).contains(&inertial.number)
                && self.columns.column(k).norm() > NOTHING * self.columns.norm()
            {
                place_m[inertial.number - 1] = Some(change[k] / mass_kg);
            }
        }
        let mass_sd_kg = covariance.get((first, first)).map_or(0.0, |variance| variance.sqrt());
        Named { links, mass_kg, mass_sd_kg, side: side(&place_m), place_m, p }
    }
}

/// A place in words: x forward, y to the left, z up, as the frames of a standing robot are.
fn side(place_m: &[Option<f64>; 3]) -> String {
    const WORDS: [[&str; 2]; 3] = [["behind", "before"], ["right", "left"], ["below", "above"]];
    let words = place_m.iter().zip(WORDS).filter_map(|(place, words)| {
        let place = (*place)?;
        (place.abs() > 5e-3).then(|| format!("{:.0} mm {}", 1e3 * place.abs(), words[usize::from(place > 0.0)]))
    });
    words.collect::<Vec<_>>().join(", ")
}
