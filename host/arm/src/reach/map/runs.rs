//! Few cells in a large box: sorted and summed where equal, so that the box itself takes neither time nor memory.

use super::cell::{Place, each};
use super::layer::{Layer, fits, packed};
use crate::reach::ReachError;

/// Cells that are added before they are summed.
const ROOM: usize = 1 << 16;

/// Cells of one box and what was added to them.
#[derive(Clone)]
pub(super) struct Runs {
    low: Place,
    size: [usize; 3],
    cells: Vec<(u32, f64)>,
    /// How many were left after the last sum.
    summed: usize,
}

impl Runs {
    /// Nothing yet, in a box that begins at `low`.
    pub(super) fn new(low: Place, size: [usize; 3]) -> Result<Self, ReachError> {
        if fits(size) { Ok(Self { low, size, cells: Vec::new(), summed: 0 }) } else { Err(ReachError::TooFine) }
    }

    /// The same, in the least box about some places.
    pub(super) fn around<'p>(places: impl Iterator<Item = &'p Place> + Clone) -> Result<Self, ReachError> {
        let low = places.clone().fold([i16::MAX; 3], |low, place| each(low, *place, i16::min));
        let high = places.fold([i16::MIN; 3], |high, place| each(high, *place, i16::max));
        Self::new(low, each(high, low, |high, low| (i32::from(high) - i32::from(low) + 1).max(0) as usize))
    }

    /// Adds to one place; one outside of the box does not count.
    pub(super) fn add(&mut self, place: Place, words: f64) {
        let above = each(place.map(i32::from), self.low.map(i32::from), |number, low| number - low);
        if above.iter().zip(self.size).all(|(above, length)| (0..length as i32).contains(above)) {
            self.add_inside(above.map(|number| number as u16), words);
        }
    }

    /// Adds to one place, by its numbers above the least ones.
    pub(super) fn add_inside(&mut self, above: [u16; 3], words: f64) {
        self.cells.push((packed(above), words));
        if self.cells.len() > 2 * self.summed + ROOM {
            self.sum();
        }
    }

    /// Adds all of another one of the same box.
    pub(super) fn add_all(&mut self, other: &Self) {
        self.cells.extend_from_slice(&other.cells);
        self.sum();
    }

    fn sum(&mut self) {
        self.cells.sort_unstable_by_key(|cell| cell.0);
        self.cells.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            kept.1 += if is_same { next.1 } else { 0.0 };
            is_same
        });
        self.summed = self.cells.len();
    }

    pub(super) fn into_layer(mut self, orientation: Place) -> Layer {
        self.sum();
        Layer::new(orientation, self.low, self.cells.into_iter())
    }
}
