//! Sets of effects that rows do not distinguish: whether their members are alike anywhere.

use anyhow::Result;
use darm_diagnose::measurement::root_mean_square;
use darm_diagnose::outcome::{Alternative, Diagnosis};
use nalgebra::{DMatrix, DVector};

use super::judge::Named;
use super::signals::{Added, Bench, law_of};

/// Members of a set are alike where what they add differs by no more than this share of the noise, root mean square.
const SAME: f64 = 0.5;
/// Directions of a law's values with less than this share of the largest are not reported.
const MIN_SHARE: f64 = 1e-9;

/// Whether all that is named is there, and of the rest each is in a separate set whose members are alike elsewhere.
pub(super) fn are_right(bench: &Bench, named: &[Named], diagnosis: &Diagnosis) -> Result<bool> {
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
        let holds = |added: &&Added| {
            members.iter().any(|other| added.cause.named() == Some((law_of(other.law), other.site.place)))
        };
        let Some(found) = rest.iter().position(holds) else { return Ok(false) };
        if !alike(bench, rest.remove(found), &members)? {
            return Ok(false);
        }
    }
    Ok(rest.is_empty())
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

/// What a law, fitted to the run, adds elsewhere, in units of the noise.
fn predicted(bench: &Bench, other: &Alternative, wanted: &DVector<f64>) -> Result<Option<DVector<f64>>> {
    let Some(elsewhere) = &bench.elsewhere else { return Ok(None) };
    let columns = |is_elsewhere| elsewhere.columns(other.law, &other.site, is_elsewhere);
    let (n_axes, noise) = (bench.noise.len(), &bench.noise);
    let in_noise = |mut columns: DMatrix<f64>, spoiled: &[usize]| {
        for (k, mut row) in columns.row_iter_mut().enumerate() {
            row *= if spoiled.contains(&(k / n_axes)) { 0.0 } else { 1.0 / noise[k % n_axes] };
        }
        columns
    };
    let (Some(here), Some(there)) = (columns(false)?, columns(true)?) else {
        return Ok(None);
    };
    let here = in_noise(here, &bench.spoiled);
    let scale = here.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect::<Vec<f64>>();
    let scaled = |mut columns: DMatrix<f64>| {
        columns.column_iter_mut().zip(&scale).for_each(|(mut column, by)| column /= *by);
        columns
    };
    let values = scaled(here).svd(true, true).solve(wanted, MIN_SHARE).map_err(anyhow::Error::msg)?;
    Ok(Some(scaled(in_noise(there, &[])) * values))
}
