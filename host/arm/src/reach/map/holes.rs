//! Holes of a workspace.

use std::collections::BTreeMap;

use super::cell::each;
use super::{Place, Spot};

/// The box about all cells with a cell of room, and which of its cells no way from outside may enter.
struct Room {
    low: Place,
    size: [usize; 3],
    /// One bit for each cell, along z first: those that words end in, then those that are outside too.
    closed: Vec<u64>,
}

impl Room {
    fn new(spots: &BTreeMap<Place, Spot>, planar: bool) -> Self {
        let pad = [1, 1, if planar { 0 } else { 1 }];
        let low = spots.keys().fold([i16::MAX; 3], |low, place| each(low, *place, i16::min));
        let high = spots.keys().fold([i16::MIN; 3], |high, place| each(high, *place, i16::max));
        let size = each(high, low, |high, low| usize::try_from(i32::from(high) - i32::from(low) + 1).unwrap_or(0));
        let size = each(size, pad, |length, pad| length + 2 * pad as usize);
        let low = each(low, pad, |low, pad| low.saturating_sub(pad));
        let mut room = Self { low, size, closed: vec![0; size.iter().product::<usize>().div_ceil(64)] };
        for place in spots.keys() {
            room.close(room.at(each(*place, low, |number, low| (i32::from(number) - i32::from(low)) as usize)));
        }
        room
    }

    fn at(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.size[1] + y) * self.size[2] + z
    }

    fn place(&self, at: usize) -> [usize; 3] {
        let [_, wide, deep] = self.size;
        [at / deep / wide, at / deep % wide, at % deep]
    }

    fn is_closed(&self, at: usize) -> bool {
        self.closed[at / 64] >> (at % 64) & 1 == 1
    }

    fn close(&mut self, at: usize) {
        self.closed[at / 64] |= 1 << (at % 64);
    }

    /// Closes every cell that a way leads to from the corner.
    fn flood(&mut self) {
        let steps = [self.size[1] * self.size[2], self.size[2], 1];
        let mut open = vec![0];
        self.close(0);
        while let Some(at) = open.pop() {
            let place = self.place(at);
            for (axis, step) in steps.into_iter().enumerate() {
                let below = (place[axis] > 0).then(|| at - step);
                let above = (place[axis] + 1 < self.size[axis]).then(|| at + step);
                for next in below.into_iter().chain(above) {
                    if !self.is_closed(next) {
                        self.close(next);
                        open.push(next);
                    }
                }
            }
        }
    }
}

/// Cells of positions within the reach that no word ends in and that no way leads to from outside.
pub fn holes(spots: &BTreeMap<Place, Spot>, planar: bool) -> Vec<Place> {
    if spots.is_empty() {
        return Vec::new();
    }
    let mut room = Room::new(spots, planar);
    room.flood();
    let cells = room.size.iter().product();
    let enclosed = (0..cells).filter(|at| !room.is_closed(*at));
    enclosed.map(|at| each(room.place(at), room.low, |number, low| low + number as i16)).collect()
}
