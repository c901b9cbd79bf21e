//! In how many orientations each position of a density is reached.

use super::cell::Place;
use super::layer::{Layer, fits, packed};
use super::runs::Runs;
use crate::reach::ReachError;

/// A box of more cells than this times those that are counted is mostly empty.
pub(super) const SPARSE: usize = 8;

/// How many layers have words at each position, in a box with a cell of room around the positions.
#[derive(Clone)]
pub(super) enum Tally {
    /// Every position of the box.
    Dense { low: Place, size: [usize; 3], layers: Vec<u32> },
    /// The positions that were counted.
    Sparse(Runs),
}

impl Tally {
    /// Nothing yet; `expected` positions are going to be counted at most.
    pub(super) fn new(positions: &Layer, expected: usize) -> Result<Self, ReachError> {
        let (low, size) = (positions.low.map(|low| low - 1), positions.size.map(|length| length + 2));
        let cells: usize = size.iter().product();
        if cells / SPARSE > expected {
            return Runs::new(low, size).map(Self::Sparse);
        }
        if fits(size) { Ok(Self::Dense { low, size, layers: vec![0; cells] }) } else { Err(ReachError::TooFine) }
    }

    pub(super) fn count(&mut self, layer: &Layer) {
        match self {
            Self::Sparse(runs) => layer.cells().for_each(|(place, _)| runs.add(place, 1.0)),
            Self::Dense { low, size, layers } => {
                for (place, _) in layer.cells() {
                    let [x, y, z] = std::array::from_fn(|axis| (place[axis] - low[axis]) as usize);
                    if let Some(layers) = layers.get_mut((x * size[1] + y) * size[2] + z) {
                        *layers += 1;
                    }
                }
            }
        }
    }

    /// Adds another one of the same positions.
    pub(super) fn add(&mut self, other: &Self) {
        match (self, other) {
            (Self::Sparse(runs), Self::Sparse(more)) => runs.add_all(more),
            (Self::Dense { layers, .. }, Self::Dense { layers: more, .. }) => {
                layers.iter_mut().zip(more).for_each(|(layers, more)| *layers += more);
            }
            // Both are made for the same positions.
            _ => {}
        }
    }

    pub(super) fn into_layer(self) -> Layer {
        match self {
            Self::Sparse(runs) => runs.into_layer([0; 3]),
            Self::Dense { low, size: [_, wide, deep], layers } => {
                let reached = layers.iter().enumerate().filter(|(_, layers)| **layers > 0);
                let place = |at: usize| [at / deep / wide, at / deep % wide, at % deep].map(|number| number as u16);
                Layer::new([0; 3], low, reached.map(|(at, layers)| (packed(place(at)), f64::from(*layers))))
            }
        }
    }
}
