//! Planes of the density map: how many words end in each cell of position.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::reach::map::{Map, Place, Resolution, Spot};
use serde::{Deserialize, Serialize};

use super::check::{checked_servos, invalid, refused};
use crate::job_queue::Work;
use crate::refusal::Refused;

/// Cells from the base to the tool at rest, about.
const CELLS: f64 = 40.0;

/// A plane, and the angles of the servo joints.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SliceRequest {
    plane: Plane,
    /// Where the plane is along the third axis, m.
    at_m: f64,
    servos_rad: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Plane {
    Xy,
    Xz,
    Yz,
}

/// The cells of a plane.
#[derive(Debug, Serialize)]
pub(super) struct SliceView {
    /// Edge of a cell, m.
    cell_m: f64,
    /// Middle of the plane along the third axis, m.
    at_m: f64,
    /// Number of a cell along the two axes, the cell around 0 being 0, and how many words end in it.
    cells: Vec<(i16, i16, f64)>,
    /// Most words in a cell, of the complete map.
    max_words: f64,
    /// Cells of the complete map between its ends along the two axes: the same in every plane.
    low: [i16; 2],
    high: [i16; 2],
}

/// The density map of an arm for angles of its servos.
pub(super) struct Density {
    servos_rad: Vec<f64>,
    cell_m: f64,
    spots: BTreeMap<Place, Spot>,
}

impl Plane {
    /// The two axes, and the one across: 0 is x.
    fn axes(self) -> [usize; 3] {
        match self {
            Self::Xy => [0, 1, 2],
            Self::Xz => [0, 2, 1],
            Self::Yz => [1, 2, 0],
        }
    }
}

impl SliceRequest {
    /// The plane. `known` is an earlier map, and then the one of this plane.
    pub(super) fn answer(&self, arm: &Arm, known: &mut Option<Density>, work: &Work) -> Result<SliceView, Refused> {
        checked_servos(arm, &self.servos_rad)?;
        if !self.at_m.is_finite() {
            return Err(invalid("the place of the plane is not a number"));
        }
        if known.as_ref().is_none_or(|known| known.servos_rad != self.servos_rad) {
            *known = None;
            *known = Some(Density::new(arm, &self.servos_rad, work)?);
        }
        known.as_ref().map(|density| density.slice(self.plane.axes(), self.at_m)).ok_or_else(|| refused("no map"))
    }
}

impl Density {
    fn new(arm: &Arm, servos_rad: &[f64], work: &Work) -> Result<Self, Refused> {
        let rest = arm.model.chain.pose_base_tool(&arm.rest(), servos_rad, &mut ArmScratch::default());
        let length_m = rest.map_err(refused)?.position.norm().max(1e-3);
        let cell_m = round_up(length_m / CELLS);
        // Orientations are not shown: few of their cells.
        let resolution = Resolution::new(cell_m, PI);
        let go_on = |share| {
            work.is_at("map", share);
            work.is_wanted()
        };
        let map = Map::new(arm, servos_rad, resolution, go_on).map_err(refused)?;
        Ok(Self { servos_rad: servos_rad.to_vec(), cell_m, spots: map.spots() })
    }

    fn slice(&self, [u, v, across]: [usize; 3], at_m: f64) -> SliceView {
        let layer = (at_m / self.cell_m).round().clamp(-1e4, 1e4) as i16;
        let spots = || self.spots.iter();
        let inside = spots().filter(|(place, _)| place[across] == layer);
        let end = |pick: fn(i16, i16) -> i16, start| {
            [u, v].map(|axis| spots().fold(start, |end, (place, _)| pick(end, place[axis])))
        };
        SliceView {
            cell_m: self.cell_m,
            at_m: f64::from(layer) * self.cell_m,
            cells: inside.map(|(place, spot)| (place[u], place[v], spot.words)).collect(),
            max_words: spots().fold(0.0, |max_words, (_, spot)| spot.words.max(max_words)),
            low: end(i16::min, 0),
            high: end(i16::max, 0),
        }
    }
}

/// The next of 1, 2 and 5 times a power of ten.
fn round_up(size: f64) -> f64 {
    let power = 10f64.powf(size.log10().floor());
    [1.0, 2.0, 5.0].map(|digit| digit * power).into_iter().find(|round| *round >= size).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_arm::arm::Arm;

    use super::{Density, round_up};
    use crate::job_queue::Work;

    #[test]
    fn a_map_that_nobody_waits_for_is_given_up() {
        let arm = Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/spatial3.toml")).unwrap();
        let refused = Density::new(&arm, &[], &Work::unwanted()).err().unwrap();
        assert!(refused.text.contains("given up"), "{}", refused.text);
    }

    #[test]
    fn cells_have_round_edges() {
        let edges = [0.011, 0.02, 0.049, 0.09].map(round_up);
        assert!(edges.iter().zip([0.02, 0.02, 0.05, 0.1]).all(|(a, b)| (a - b).abs() < 1e-12), "{edges:?}");
    }
}
