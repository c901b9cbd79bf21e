//! Actuators from a list of parts that can be bought; stops shorten their strokes.
//!
//! # Format
//!
//! CSV with the header `part,stroke_mm,retracted_mm,force_n,price`. A part can be a leg when the leg's shortest stop is no
//! shorter than the retracted part, its longest no longer than part and stroke, and the force bears what the leg bears in
//! the desired frames at rest. Joints are not bought.
//!
//! # Method
//!
//! Each leg takes the cheapest part that fits the synthesis. Where none fits, the part that fits but for the
//! least change of its stops gives the leg's bounds, and the synthesis is done again within the bounds of all parts: by
//! the stops, and where those do not suffice by the anchors, as far as [`Bounds::anchor_m`](super::Bounds) lets them go.

use std::path::Path;

use darm_robot::csv_table::{CsvError, CsvFault, CsvRow, CsvTable};
use serde::Serialize;

use super::stroke::stops;
use super::{Options, Status, Synthesis, SynthesisError, synthesize};
use crate::arm::frames::{DesiredFrame, StopRange};
use crate::arm::{Arm, ArmScratch};

/// Rounds of choosing parts and synthesis within their bounds.
const ROUNDS: usize = 6;
/// A stop may be off its bound by as much as rounding, m.
const ROUNDING_M: f64 = 1e-9;

/// A part that can be bought.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// What to order.
    pub part: String,
    /// Its stroke, mm.
    pub stroke_mm: f64,
    /// Distance of its ends when retracted, mm.
    pub retracted_mm: f64,
    /// The most that it bears, N.
    pub force_n: f64,
    /// What it costs, in the list's own currency.
    pub price: f64,
}

/// The part of one leg.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bought {
    /// The actuator, by its name.
    pub actuator: String,
    /// What to order.
    pub part: String,
    /// What it costs.
    pub price: f64,
    /// Its lengths from retracted to extended, m.
    pub lengths_m: (f64, f64),
    /// The stops in it, m.
    pub stops_m: (f64, f64),
    /// What it bears at most in the desired frames, N.
    pub load_n: f64,
}

/// Why a list of parts serves no purpose.
#[derive(Debug, thiserror::Error)]
pub enum CatalogueError {
    /// The list cannot be read, or a part's numbers make no sense.
    #[error(transparent)]
    List(#[from] CsvError),
    /// No part of the list bears what a leg bears.
    #[error("{actuator} bears {load_n:.1} N in the desired frames, more than any part of the list")]
    TooWeak {
        /// The leg.
        actuator: String,
        /// What it bears.
        load_n: f64,
    },
    /// There is no synthesis to begin with.
    #[error(transparent)]
    Synthesis(#[from] SynthesisError),
}

/// Reads a list of parts.
///
/// # Errors
///
/// The file cannot be read, is not a table of parts, or has a part with a length or force that is not above 0 or a
/// price that is not a number.
pub fn read_catalogue(path: &Path) -> Result<Vec<Part>, CatalogueError> {
    let table = CsvTable::read(path)?;
    let column = |name: &str| table.column(name).ok_or_else(|| table.no_column(name));
    let (name, price) = (column("part")?, column("price")?);
    let [stroke, retracted, force] = ["stroke_mm", "retracted_mm", "force_n"].map(column);
    let (stroke, retracted, force) = (stroke?, retracted?, force?);
    if table.rows().len() == 0 {
        return Err(table.wrong(CsvFault::Empty { what: "part" }).into());
    }
    let above_zero = |row: CsvRow, column: usize| match row.number(column)? {
        number if number > 0.0 => Ok(number),
        _ => Err(row.wrong_cell(column, "a number above 0")),
    };
    let part = |row: CsvRow| {
        let (stroke_mm, retracted_mm) = (above_zero(row, stroke)?, above_zero(row, retracted)?);
        let (force_n, price) = (above_zero(row, force)?, row.number(price)?);
        Ok(Part { part: row.cell(name).into(), stroke_mm, retracted_mm, force_n, price })
    };
    table.rows().map(part).collect()
}

/// Synthesis with legs of the list: the geometry, and the part of every leg. Where the frames cannot be met with such
/// parts, the nearest geometry.
///
/// # Errors
///
/// No part of the list bears what a leg bears, or as [`synthesize`].
pub fn buy(
    base_line: &Arm,
    desired: &[DesiredFrame],
    parts: &[Part],
    options: &Options,
) -> Result<(Synthesis, Vec<Bought>), CatalogueError> {
    let mut found = synthesize(base_line, desired, options)?;
    let mut round = 0;
    loop {
        let chosen = choose(&found, desired, parts)?;
        let fits = chosen.iter().all(|(_, bought)| fits(bought));
        if (fits && found.status == Status::Reached) || round == ROUNDS || options.handle.is_ended() {
            return Ok((found, chosen.into_iter().map(|(_, bought)| bought).collect()));
        }
        let own =
            chosen.iter().map(|(actuator, bought)| StopRange { value: bought.lengths_m, ..StopRange::any(*actuator) });
        let ranges = options.ranges.iter().copied().chain(own).collect();
        found = synthesize(base_line, desired, &Options { ranges, ..options.clone() })?;
        round += 1;
    }
}

/// For each leg its number and the part that fits it best: without change of its stops the cheapest.
fn choose(found: &Synthesis, desired: &[DesiredFrame], parts: &[Part]) -> Result<Vec<(usize, Bought)>, CatalogueError> {
    let arm = &found.arm;
    let loads = loads(arm, desired);
    let mut chosen = Vec::new();
    for (actuator, (stage, leg)) in arm.model.chain.actuators().enumerate() {
        if arm.model.chain.stages[stage].leg(leg).is_none() {
            continue;
        }
        let stops_m = stops(arm, actuator)
            .into_iter()
            .fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), at| (low.min(at), high.max(at)));
        let bought = parts.iter().filter(|part| part.force_n >= loads[actuator]).map(|part| Bought {
            actuator: arm.actuator_name(actuator),
            part: part.part.clone(),
            price: part.price,
            lengths_m: (1e-3 * part.retracted_mm, 1e-3 * (part.retracted_mm + part.stroke_mm)),
            stops_m,
            load_n: loads[actuator],
        });
        let rank = |bought: &Bought| if fits(bought) { (0.0, bought.price) } else { (shortfall(bought), bought.price) };
        let best = bought.min_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(std::cmp::Ordering::Equal));
        let too_weak = || CatalogueError::TooWeak { actuator: arm.actuator_name(actuator), load_n: loads[actuator] };
        chosen.push((actuator, best.ok_or_else(too_weak)?));
    }
    Ok(chosen)
}

fn fits(bought: &Bought) -> bool {
    shortfall(bought) < ROUNDING_M
}

/// By how much the stops lie outside the part, m.
fn shortfall(Bought { lengths_m, stops_m, .. }: &Bought) -> f64 {
    (lengths_m.0 - stops_m.0).max(0.0) + (stops_m.1 - lengths_m.1).max(0.0)
}

/// The most that each actuator bears at rest in the desired frames, N.
fn loads(arm: &Arm, desired: &[DesiredFrame]) -> Vec<f64> {
    let mut largest = vec![0.0; arm.n_actuators()];
    let mut scratch = ArmScratch::default();
    for frame in desired {
        let condition = arm.model.working(frame.word, frame.previous, &frame.servos_rad);
        if arm.model.predict(&condition, &mut scratch).is_err() {
            continue;
        }
        let loads = arm.model.loads(&scratch, 0.0);
        for (largest, (stage, leg)) in largest.iter_mut().zip(arm.model.chain.actuators()) {
            *largest = f64::max(*largest, loads[stage][leg].abs());
        }
    }
    largest
}
