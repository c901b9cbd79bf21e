//! A layer of a density: the cells of one orientation, and how it is counted.

use nalgebra::Matrix3;

use super::cell::{Place, each};
use crate::reach::ReachError;

/// Bits of a cell's number along each axis of its layer.
const BITS: [u32; 3] = [11, 11, 10];
/// Most cells of a layer's box.
const MAX_BOX: usize = 1 << 28;
/// Bits behind the point of a position in fractions of a cell: with 11 before it, three of them add up to an `i32`.
const FRACTION: i32 = 18;
/// Cells that are moved side by side.
const ABREAST: usize = 64;

/// The cells of one orientation that words end in.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// The rotation vector, in cells.
    pub orientation: Place,
    /// The least number of a position along each axis, and how many there are.
    pub(super) low: Place,
    pub(super) size: [usize; 3],
    /// Numbers of positions above the least ones, packed.
    positions: Vec<u32>,
    /// How many words end at each.
    pub(super) words: Vec<f64>,
}

impl Layer {
    /// Cells in the order of their positions, which are packed and begin at `low`; the layer keeps the least box about them.
    pub(super) fn new(orientation: Place, low: Place, cells: impl Iterator<Item = (u32, f64)>) -> Self {
        let (mut positions, words): (Vec<u32>, Vec<f64>) = cells.unzip();
        let (mut min, mut max) = ([u16::MAX; 3], [0; 3]);
        for place in positions.iter().map(|position| unpacked(*position)) {
            (min, max) = (each(min, place, u16::min), each(max, place, u16::max));
        }
        if positions.is_empty() {
            return Self { orientation, low, size: [0; 3], positions, words };
        }
        let corner = packed(min);
        positions.iter_mut().for_each(|place| *place -= corner);
        let low = each(low, min.map(|number| number as i16), |low, min| low + min);
        let size = each(max, min, |max, min| max - min + 1).map(usize::from);
        Self { orientation, low, size, positions, words }
    }

    /// Every position after a rigid motion, and its words: the motion begins at `start`, both in fractions of a cell.
    pub(super) fn moved(&self, start: [i32; 3], turn: Matrix3<i32>) -> impl Iterator<Item = ([i32; 3], f64)> {
        let along = move |row: usize, [x, y, z]: [i32; 3]| {
            (start[row] + turn[(row, 0)] * x + turn[(row, 1)] * y + turn[(row, 2)] * z) >> FRACTION
        };
        self.positions.iter().zip(&self.words).map(move |(packed, words)| {
            let place = unpacked(*packed).map(i32::from);
            ([0, 1, 2].map(|row| along(row, place)), *words)
        })
    }

    /// Every position that words end at, and how many.
    pub fn cells(&self) -> impl Iterator<Item = (Place, f64)> {
        self.positions.iter().zip(&self.words).map(|(packed, words)| {
            let above = unpacked(*packed);
            (std::array::from_fn(|axis| self.low[axis] + above[axis] as i16), *words)
        })
    }
}

/// A layer while it is counted: every position of its box.
pub(super) struct Counts<'r> {
    pub(super) orientation: Place,
    pub(super) low: Place,
    pub(super) size: [usize; 3],
    pub(super) words: &'r mut [f64],
}

impl<'r> Counts<'r> {
    /// Nothing yet, in a part of `room`.
    pub(super) fn new(
        orientation: Place,
        low: Place,
        size: [usize; 3],
        room: &'r mut Vec<f64>,
    ) -> Result<Self, ReachError> {
        let cells = size.iter().product();
        if !fits(size) || cells > MAX_BOX {
            return Err(ReachError::TooFine);
        }
        room.resize(room.len().max(cells), 0.0);
        let words = &mut room[..cells];
        words.fill(0.0);
        Ok(Self { orientation, low, size, words })
    }

    /// Adds the words of a layer that is turned and begins at `start`, both in fractions of a cell: integers, which
    /// a processor works on side by side.
    pub(super) fn add(&mut self, layer: &Layer, start: [i32; 3], turn: &Matrix3<i32>) {
        let [_, wide, deep] = self.size.map(|length| length as i32);
        let row = |row: usize, x: i32, y: i32, z: i32| {
            (start[row] + turn[(row, 0)] * x + turn[(row, 1)] * y + turn[(row, 2)] * z) >> FRACTION
        };
        let mut at = [0; ABREAST];
        for (positions, words) in layer.positions.chunks(ABREAST).zip(layer.words.chunks(ABREAST)) {
            for (at, packed) in at.iter_mut().zip(positions) {
                let [x, y, z] = unpacked(*packed).map(i32::from);
                *at = (row(0, x, y, z) * wide + row(1, x, y, z)) * deep + row(2, x, y, z);
            }
            at.iter().zip(words).for_each(|(at, words)| self.words[*at as usize] += words);
        }
    }

    /// The positions that words end at, in the least box: a layer turned with room about it would grow and grow.
    pub(super) fn to_layer(&self) -> Layer {
        let Self { orientation, low, size, ref words } = *self;
        let rows = words.chunks(size[2].max(1)).enumerate();
        let cells = rows.flat_map(|(row, words)| {
            let (x, y) = (row / size[1], row % size[1]);
            let at = move |z: usize| packed([x, y, z].map(|number| number as u16));
            words.iter().enumerate().filter(|(_, words)| **words > 0.0).map(move |(z, words)| (at(z), *words))
        });
        Layer::new(orientation, low, cells)
    }
}

/// A number of cells in fractions of one.
pub(super) fn fixed(cells: f64) -> i32 {
    (cells * f64::from(1 << FRACTION)).round() as i32
}

/// Whether a box has numbers for all its positions.
pub(super) fn fits(size: [usize; 3]) -> bool {
    size.iter().zip(BITS).all(|(length, bits)| *length <= 1 << bits)
}

/// A position in its box as one number; those of two differ by that of what is between.
pub(super) fn packed([x, y, z]: [u16; 3]) -> u32 {
    (u32::from(x) << BITS[1] | u32::from(y)) << BITS[2] | u32::from(z)
}

fn unpacked(packed: u32) -> [u16; 3] {
    let low = |number: u32, bits: u32| (number & ((1 << bits) - 1)) as u16;
    [(packed >> (BITS[1] + BITS[2])) as u16, low(packed >> BITS[2], BITS[1]), low(packed, BITS[2])]
}
