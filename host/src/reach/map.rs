//! The density of an arm's frames over position and orientation, without forming every word.
//!
//! # Method
//!
//! The frames of stages i to n are those of stage i times those behind it: their density is a convolution on the
//! group. It is carried from the tool to the base on cells: a cell is a cube of positions times a cube of rotation
//! vectors, stands for all frames in it by its centre, and holds how many words end there, a whole number. A stage
//! with s poses sends each cell to s cells, so the work grows with cells and poses, not with words.
//!
//! # Error
//!
//! A convolution moves a frame to its cell's centre: by δ ≤ h√3/2 for cells of size h. What comes before it is a rigid
//! motion and does not stretch δ, and the centre's orientation does not act on its position; after n stages a position
//! is off by (n − 1)·h√3/2 at most, and likewise the orientation. Words change places only where they lie as near to
//! a wall: told on coarser cells of fixed size H, the L1 distance of the density falls with h in the first order. Words
//! are neither lost nor made: counts are whole numbers below 2⁵³, which an `f64` adds without error.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::hash::{BuildHasherDefault, Hasher};

use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_exp, rotation_log};
use rayon::prelude::*;

use super::ReachError;
use super::frames::{self, Frames};
use crate::arm::Arm;

/// A cell by its number along each axis; that around 0 is 0.
pub type Place = [i16; 3];

/// How finely frames are told apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Edge of a cell of positions, m.
    pub cell_m: f64,
    /// Edge of a cell of rotation vectors, rad.
    pub cell_rad: f64,
}

/// Frames of about one position and orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Where, in cells of positions.
    pub position: Place,
    /// Which of [`Map::orientations`].
    orientation: u16,
    /// How many words.
    pub words: f64,
}

/// The density of an arm's frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// How finely frames are told apart.
    pub resolution: Resolution,
    /// The cells that words end in.
    pub cells: Vec<Cell>,
    /// The rotation vectors that occur, in cells.
    pub orientations: Vec<Place>,
}

/// The positions of one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spot {
    /// Words that end there.
    pub words: f64,
    /// In how many cells of orientations.
    pub orientations: usize,
}

impl Map {
    /// The density of the frames of `arm` with its servos at `servos_rad`; `done` hears the share of the stages behind.
    ///
    /// Fails where the arm has no pose, or more orientations or a longer reach in cells than 2¹⁵.
    pub fn new(
        arm: &Arm,
        servos_rad: &[f64],
        resolution: Resolution,
        mut done: impl FnMut(f64),
    ) -> Result<Self, ReachError> {
        let stages = frames::of_stages(arm, servos_rad, |_, _| true)?;
        let start = Cell { position: [0; 3], orientation: 0, words: 1.0 };
        let mut map = Self { resolution, cells: vec![start], orientations: vec![[0; 3]] };
        for (behind, stage) in stages.iter().rev().enumerate() {
            map = if behind == 0 { map.exact(stage)? } else { map.after(stage)? };
            done((behind + 1) as f64 / stages.len() as f64);
        }
        Ok(map)
    }

    /// How many words the arm has.
    pub fn words(&self) -> f64 {
        self.cells.iter().map(|cell| cell.words).sum()
    }

    /// The frame amid a cell.
    pub fn center(&self, cell: &Cell) -> Pose<f64> {
        let turn = self.orientations[usize::from(cell.orientation)];
        let rotation = rotation_exp(&amid(&turn, self.resolution.cell_rad));
        Pose { rotation, position: amid(&cell.position, self.resolution.cell_m) }
    }

    /// What ends at each position, in the order of the positions.
    pub fn spots(&self) -> BTreeMap<Place, Spot> {
        let mut spots: BTreeMap<Place, Spot> = BTreeMap::new();
        for cell in &self.cells {
            let spot = spots.entry(cell.position).or_default();
            spot.words += cell.words;
            spot.orientations += 1;
        }
        spots
    }

    /// The density of the frames of the last stage alone, each of which stands where it is.
    fn exact(&self, stage: &Frames) -> Result<Self, ReachError> {
        let mut counts = Counts::default();
        for pose in &stage.poses {
            *counts.entry(self.key(pose)?).or_default() += 1.0;
        }
        self.of_counts(vec![counts])
    }

    /// The density of the frames of `stage` times those of this map.
    fn after(&self, stage: &Frames) -> Result<Self, ReachError> {
        let turned = self.turned(stage)?;
        let parts = rayon::current_num_threads().next_power_of_two();
        let counts = (0..parts).into_par_iter().map(|part| {
            let mut counts = Counts::with_capacity_and_hasher(self.cells.len() / parts, BuildHasherDefault::default());
            for (pose, turned) in stage.poses.iter().zip(turned.chunks(self.orientations.len())) {
                for cell in &self.cells {
                    let position = place(&(*pose * amid(&cell.position, self.resolution.cell_m)), self.resolution.cell_m);
                    let position = position.ok_or(ReachError::TooFine)?;
                    // A position belongs to one part, so that no two threads count in one map.
                    if (position[0] as usize ^ position[1] as usize ^ position[2] as usize) % parts == part {
                        let key = Key { position, orientation: turned[usize::from(cell.orientation)] };
                        *counts.entry(key).or_default() += cell.words;
                    }
                }
            }
            Ok(counts)
        });
        self.of_counts(counts.collect::<Result<_, ReachError>>()?)
    }

    /// The orientations of this map after each pose of `stage`, pose by pose.
    fn turned(&self, stage: &Frames) -> Result<Vec<Place>, ReachError> {
        let size = self.resolution.cell_rad;
        let rotations: Vec<_> = self.orientations.iter().map(|turn| rotation_exp(&amid(turn, size))).collect();
        let pairs = stage.poses.iter().flat_map(|pose| rotations.iter().map(|rotation| pose.rotation * rotation));
        let places: Option<_> = pairs.map(|rotation| place(&rotation_log(&rotation), size)).collect();
        places.ok_or(ReachError::TooFine)
    }

    fn key(&self, pose: &Pose<f64>) -> Result<Key, ReachError> {
        let position = place(&pose.position, self.resolution.cell_m).ok_or(ReachError::TooFine)?;
        let orientation = place(&rotation_log(&pose.rotation), self.resolution.cell_rad).ok_or(ReachError::TooFine)?;
        Ok(Key { position, orientation })
    }

    fn of_counts(&self, counts: Vec<Counts>) -> Result<Self, ReachError> {
        let mut orientations = Vec::new();
        let mut numbers = HashMap::new();
        let mut cells = Vec::with_capacity(counts.iter().map(HashMap::len).sum());
        // Part by part, so that no cell is held twice for long.
        for part in counts {
            for (key, words) in part {
                let number = *numbers.entry(key.orientation).or_insert_with(|| {
                    orientations.push(key.orientation);
                    orientations.len() - 1
                });
                let orientation = u16::try_from(number).map_err(|_| ReachError::TooFine)?;
                cells.push(Cell { position: key.position, orientation, words });
            }
        }
        Ok(Self { resolution: self.resolution, cells, orientations })
    }
}

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
    let all = x.flat_map(|x| y.clone().flat_map({ let z = z.clone(); move |y| z.clone().map(move |z| [x, y, z]) }));
    all.filter(|place| !spots.contains_key(place) && !outside.contains(place)).collect()
}

/// The vector amid a cell.
fn amid(place: &Place, size: f64) -> Vec3<f64> {
    Vec3::from(*place).map(|number| f64::from(number) * size)
}

/// The cell that a vector lies in; `None` where its number is too large.
fn place(vector: &Vec3<f64>, size: f64) -> Option<Place> {
    let cells = vector / size;
    let within = cells.amax() < f64::from(i16::MAX) - 1.0;
    within.then(|| [cells.x, cells.y, cells.z].map(|number| number.round() as i16))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Key {
    position: Place,
    orientation: Place,
}

impl std::hash::Hash for Key {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let pack = |place: &Place| place.iter().fold(0, |bits: u64, number| bits << 16 | u64::from(*number as u16));
        state.write_u64(pack(&self.position));
        state.write_u64(pack(&self.orientation));
    }
}

type Counts = HashMap<Key, f64, BuildHasherDefault<Mixer>>;

/// Mixes the few bits of a key by two multiplications: the default hasher of the library would cost most of the time.
#[derive(Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64(u64::from(*byte)));
    }

    fn write_u64(&mut self, number: u64) {
        let mixed = (self.0 ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ mixed >> 29;
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn planar4() -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/planar4.toml")).unwrap()
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
            let resolution = Resolution { cell_m, cell_rad: 10.0 * cell_m };
            let map = Map::new(&arm, &[], resolution, |_| ()).unwrap();
            assert_eq!(map.words(), 4096.0);
            let found = coarse(map.cells.iter().map(|cell| (map.center(cell).position, cell.words)));
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
        let resolution = Resolution { cell_m: 1e-6, cell_rad: 0.1 };
        assert_eq!(Map::new(&planar4(), &[], resolution, |_| ()), Err(ReachError::TooFine));
    }
}
