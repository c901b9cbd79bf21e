//! In how many orientations each position of a density is reached.

use super::cell::Place;
use super::layer::{BITS, Counts, Layer};
use crate::reach::ReachError;

/// How many layers have words at each position, in a box with a cell of room around the positions.
pub(super) struct Tally {
    low: Place,
    size: [usize; 3],
    layers: Vec<u32>,
}

impl Tally {
    pub(super) fn of(positions: &Layer, layers: &[Layer]) -> Self {
        let (low, size) = (positions.low.map(|low| low - 1), positions.size.map(|length| length + 2));
        let mut tally = Self { low, size, layers: vec![0; size.iter().product()] };
        layers.iter().for_each(|layer| tally.count(layer));
        tally
    }

    pub(super) fn count(&mut self, layer: &Layer) {
        for (place, _) in layer.cells() {
            let [x, y, z] = std::array::from_fn(|axis| (place[axis] - self.low[axis]) as usize);
            if let Some(layers) = self.layers.get_mut((x * self.size[1] + y) * self.size[2] + z) {
                *layers += 1;
            }
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.layers.iter_mut().zip(&other.layers).for_each(|(layers, more)| *layers += more);
    }

    pub(super) fn into_layer(self, positions: &Layer) -> Result<Layer, ReachError> {
        let mut words: Vec<f64> = self.layers.into_iter().map(f64::from).collect();
        let counts = Counts { orientation: positions.orientation, low: self.low, size: self.size, words: &mut words };
        let fits = self.size.iter().zip(BITS).all(|(length, bits)| *length <= 1 << bits);
        if fits { Ok(counts.to_layer()) } else { Err(ReachError::TooFine) }
    }
}
