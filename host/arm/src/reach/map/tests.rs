//! Laws of a density: no word is lost, and positions converge.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use darm_core::real::Vec3;

use super::cell::{amid, place};
use super::{Map, Place, Resolution, Spot, holes};
use crate::arm::Arm;
use crate::reach::ReachError;
use crate::reach::frames;

fn planar4() -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml")).unwrap()
}

/// Words in each square of 0.5 m.
fn coarse(positions: impl Iterator<Item = (Vec3<f64>, f64)>) -> HashMap<Place, f64> {
    let mut squares = HashMap::new();
    positions.for_each(|(position, words)| *squares.entry(place(&position, 0.5).unwrap()).or_default() += words);
    squares
}

#[test]
fn every_word_is_counted_and_lies_where_it_should() {
    let arm = planar4();
    let all = frames::product(&frames::of_stages(&arm, &[], |_, _| true).unwrap(), arm.rest());
    let exact = coarse(all.poses.iter().map(|pose| (pose.position, 1.0)));
    let mut apart = Vec::new();
    for cell_m in [0.1, 0.02, 0.004] {
        let resolution = Resolution { cell_m, cell_rad: 10.0 * cell_m, max_exact: 1 };
        let map = Map::with_layers(&arm, &[], resolution, |_| true, |_| ()).unwrap();
        assert_eq!((map.words(), map.orientations.values().sum()), (4096.0, 4096.0));
        assert_eq!(map.cells().map(|(_, _, words)| words).sum::<f64>(), 4096.0);
        let found = coarse(map.cells().map(|(at, _, words)| (amid(&at, cell_m), words)));
        let squares: HashSet<_> = exact.keys().chain(found.keys()).collect();
        let of = |squares: &HashMap<Place, f64>, at: &Place| squares.get(at).copied().unwrap_or(0.0);
        apart.push(squares.iter().map(|at| (of(&exact, at) - of(&found, at)).abs()).sum::<f64>());
    }
    assert!(apart[2] < 0.4 * apart[0] && apart[2] < 200.0, "{apart:?}");
}

#[test]
fn a_ring_has_a_hole() {
    let ring = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0], [0, 2, 0], [1, 2, 0], [2, 2, 0]];
    let spots: BTreeMap<Place, Spot> = ring.into_iter().map(|place| (place, Spot::default())).collect();
    assert_eq!(holes(&spots, true), [[1, 1, 0]]);
    assert!(holes(&spots, false).is_empty());
}

#[test]
fn cells_too_small_are_refused() {
    let resolution = Resolution::new(1e-6, 0.1);
    assert_eq!(Map::new(&planar4(), &[], resolution, |_| true), Err(ReachError::TooFine));
}

#[test]
fn a_map_that_is_given_up_while_it_is_counted_is_none() {
    let (arm, calls) = (planar4(), AtomicUsize::new(0));
    let resolution = Resolution { cell_m: 0.02, cell_rad: 0.2, max_exact: 1 };
    let until = |last: usize| {
        calls.store(0, Ordering::Relaxed);
        let go_on = |_| calls.fetch_add(1, Ordering::Relaxed) < last;
        Map::new(&arm, &[], resolution, go_on).map(|map| map.words())
    };
    assert_eq!(until(usize::MAX), Ok(4096.0));
    let all = calls.load(Ordering::Relaxed);
    assert!(all > 20, "it is asked {all} times");
    for last in [0, 1, all / 2, all - 1] {
        assert_eq!(until(last), Err(ReachError::GivenUp), "after {last} of {all}");
    }
}
