//! Sets of effects that rows do not distinguish: whether their members are alike anywhere, or in the rows.

use anyhow::{Context as _, Result};
use darm_diagnose::effect::{LawName, Place, Site};
use darm_diagnose::outcome::{Alternative, Diagnosis};
use darm_measure::root_mean_square;
use darm_robot::svd::svd;
use nalgebra::{DMatrix, DVector};

use super::judge::Named;
use super::signals::{Added, Bench, law_of};

/// Members of a set are alike where what they add differs by no more than this share of the noise, root mean square.
const SAME: f64 = 0.5;
/// Noises that the effect and a member of its set must be apart, over all rows, so that a test at 1 % finds the difference
/// in 19 of 20 logs: 2.326 + 1.645.
const DISTINCT: f64 = 3.97;
/// Directions of a law's values with less than this share of the largest are not reported.
const MIN_SHARE: f64 = 1e-9;

/// Whether all that is named is there, and of the rest each is in a separate set whose members are alike elsewhere.
pub(super) fn are_right(bench: &Bench, named: &[Named], diagnosis: &Diagnosis) -> Result<bool> {
    all_sets(bench, named, diagnosis, alike)
}

/// The same where the kept rows do not distinguish members from the effect, though they differ elsewhere.
pub(super) fn are_indistinct(bench: &Bench, named: &[Named], diagnosis: &Diagnosis, kept: &[bool]) -> Result<bool> {
    all_sets(bench, named, diagnosis, |bench, added, members| are_near(bench, added, members, kept))
}

/// Whether all that is named is there, and of the rest each is in a separate set of which this holds.
fn all_sets(
    bench: &Bench,
    named: &[Named],
    diagnosis: &Diagnosis,
    holds: impl Fn(&Bench, &Added, &[&Alternative]) -> Result<bool>,
) -> Result<bool> {
    let mut rest: Vec<&Added> = bench.added.iter().collect();
    for name in named {
        let Some(found) = rest.iter().position(|added| added.cause.named() == Some(*name)) else {
            return Ok(false);
        };
        rest.remove(found);
    }
    let mut sets: Vec<usize> = diagnosis.alternatives.iter().map(|other| other.instead_of).collect();
    sets.dedup();
    for set in &sets {
        let members: Vec<&Alternative> =
            diagnosis.alternatives.iter().filter(|other| other.instead_of == *set).collect();
        let Some(found) = rest.iter().position(|added| members.iter().any(|other| is_of(other, added))) else {
            return Ok(false);
        };
        if !holds(bench, rest.remove(found), &members)? {
            return Ok(false);
        }
    }
    Ok(rest.is_empty())
}

fn is_of(other: &Alternative, added: &Added) -> bool {
    added.cause.named() == Some((law_of(other.law), other.site.place))
}

/// Whether members of a set that are not the effect, each fitted to what it adds without noise beside the other effects in
/// any size, come nearer to that than rows distinguish.
fn are_near(bench: &Bench, added: &Added, members: &[&Alternative], kept: &[bool]) -> Result<bool> {
    let (rows, n_axes) = (kept.len(), bench.noise.len());
    let counts = |row: usize| kept[row] && !bench.spoiled.contains(&row);
    let shape = |added: &Added| {
        let of = |k: usize| added.shape[k % n_axes][k / n_axes] / bench.noise[k % n_axes];
        let numbers = (0..rows * n_axes).map(|k| if counts(k / n_axes) { of(k) } else { 0.0 });
        DVector::from_iterator(rows * n_axes, numbers)
    };
    let wanted = shape(added);
    let left_out: Vec<usize> = (0..rows).filter(|row| !counts(*row)).collect();
    let mut others: Vec<DVector<f64>> = Vec::new();
    for other in bench.added.iter().filter(|other| !std::ptr::eq(*other, added)) {
        match of_plate(bench, other)? {
            None => others.push(shape(other)),
            Some(columns) => {
                let columns = in_noise(columns, bench, &left_out);
                others.extend(columns.column_iter().map(|column| column.into_owned()));
            }
        }
    }
    for other in members.iter().filter(|other| !is_of(other, added)) {
        let Some(columns) =
            bench.elsewhere.as_ref().map(|of| of.columns(other.law, &other.site, false)).transpose()?.flatten()
        else {
            return Ok(false);
        };
        let columns = in_noise(columns, bench, &left_out);
        let own: Vec<DVector<f64>> = columns.column_iter().map(|column| column.into_owned()).collect();
        let columns = DMatrix::from_columns(&[own, others.clone()].concat());
        let scale = scales(&columns);
        let columns = scaled(columns, &scale);
        let values = solved(&columns, &wanted)?;
        if (&wanted - columns * values).norm() > DISTINCT {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The columns of an effect that is one of the plate, which has several values.
fn of_plate(bench: &Bench, added: &Added) -> Result<Option<DMatrix<f64>>> {
    let is_plate = matches!(added.cause.named(), Some((_, Place::ForcePlate)));
    let Some(elsewhere) = bench.elsewhere.as_ref().filter(|_| is_plate) else { return Ok(None) };
    elsewhere.columns(LawName::SensorFrame, &Site::new(Place::ForcePlate, "the plate"), false)
}

/// Whether members of a set, each fitted to what an effect added, with the noise, add the same elsewhere.
fn alike(bench: &Bench, added: &Added, members: &[&Alternative]) -> Result<bool> {
    let (rows, n_axes) = (bench.nominal.first().map_or(0, Vec::len), bench.noise.len());
    let others = |axis: usize, row: usize| -> f64 {
        bench.added.iter().filter(|other| !std::ptr::eq(*other, added)).map(|other| other.shape[axis][row]).sum()
    };
    let left = |k: usize| {
        let (row, axis) = (k / n_axes, k % n_axes);
        let total = bench.measured[axis][row] - bench.nominal[axis][row] - others(axis, row);
        if bench.spoiled.contains(&row) { 0.0 } else { total / bench.noise[axis] }
    };
    let wanted = DVector::from_iterator(rows * n_axes, (0..rows * n_axes).map(left));
    let mut first: Option<DVector<f64>> = None;
    for other in members {
        let Some(there) = predicted(bench, other, &wanted)? else { return Ok(false) };
        let right = first.get_or_insert_with(|| there.clone());
        if root_mean_square((there - &*right).as_slice()) > SAME {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The values that make `wanted` of these columns as well as they can.
fn solved(columns: &DMatrix<f64>, wanted: &DVector<f64>) -> Result<DVector<f64>> {
    let parts = svd(columns).context("the columns have no singular values")?;
    parts.solve(wanted, MIN_SHARE).map_err(anyhow::Error::msg)
}

/// What a law, fitted to the run, adds elsewhere, in units of the noise.
fn predicted(bench: &Bench, other: &Alternative, wanted: &DVector<f64>) -> Result<Option<DVector<f64>>> {
    let Some(elsewhere) = &bench.elsewhere else { return Ok(None) };
    let columns = |is_elsewhere| elsewhere.columns(other.law, &other.site, is_elsewhere);
    let (Some(here), Some(there)) = (columns(false)?, columns(true)?) else {
        return Ok(None);
    };
    let here = in_noise(here, bench, &bench.spoiled);
    let scale = scales(&here);
    let values = solved(&scaled(here, &scale), wanted)?;
    Ok(Some(scaled(in_noise(there, bench, &[]), &scale) * values))
}

/// Columns in units of the noise, zero in rows that are left out.
fn in_noise(mut columns: DMatrix<f64>, bench: &Bench, left_out: &[usize]) -> DMatrix<f64> {
    let n_axes = bench.noise.len();
    for (k, mut row) in columns.row_iter_mut().enumerate() {
        row *= if left_out.contains(&(k / n_axes)) { 0.0 } else { 1.0 / bench.noise[k % n_axes] };
    }
    columns
}

/// The size of each column.
fn scales(columns: &DMatrix<f64>) -> Vec<f64> {
    columns.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect()
}

fn scaled(mut columns: DMatrix<f64>, scale: &[f64]) -> DMatrix<f64> {
    columns.column_iter_mut().zip(scale).for_each(|(mut column, by)| column /= *by);
    columns
}
