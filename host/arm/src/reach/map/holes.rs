//! Holes of a workspace.

use std::collections::{BTreeMap, HashSet, VecDeque};

use super::{Place, Spot};

/// Cells of positions within the reach that no word ends in and that no way leads to from outside.
pub fn holes(spots: &BTreeMap<Place, Spot>, planar: bool) -> Vec<Place> {
    let bound = |axis: usize, pad: i16| {
        let along = || spots.keys().map(|place| place[axis]);
        let pad = if planar && axis == 2 { 0 } else { pad };
        along().min().unwrap_or(0) - pad..=along().max().unwrap_or(0) + pad
    };
    let bounds = [0, 1, 2].map(|axis| bound(axis, 1));
    let corner = [0, 1, 2].map(|axis| *bounds[axis].start());
    let mut outside = HashSet::from([corner]);
    let mut open = VecDeque::from([corner]);
    while let Some(place) = open.pop_front() {
        for (axis, step) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
            let mut next = place;
            next[axis] += step;
            if bounds[axis].contains(&next[axis]) && !spots.contains_key(&next) && outside.insert(next) {
                open.push_back(next);
            }
        }
    }
    let [x, y, z] = bounds;
    let all = x.flat_map(|x| {
        y.clone().flat_map({
            let z = z.clone();
            move |y| z.clone().map(move |z| [x, y, z])
        })
    });
    all.filter(|place| !spots.contains_key(place) && !outside.contains(place)).collect()
}
