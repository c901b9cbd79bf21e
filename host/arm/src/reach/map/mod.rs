//! The density of an arm's frames over position and orientation, without forming every word.
//!
//! # Method
//!
//! The frames of stages i to n are those of stage i times those behind it: their density is a convolution on the
//! group. It is carried from the tool to the base on cells: a cell is a cube of positions times a cube of rotation
//! vectors, represents all frames in it by its centre, and holds how many words end there, an integer. The cells of
//! one orientation are a layer; a pose in front of a layer turns it rigidly into one other layer, so that the cells of
//! a new layer are counted in one box of memory, by one thread, or sorted where the box would be mostly empty. The work grows
//! with cells and poses, not with words.
//!
//! Where a pose in front takes a position does not depend on the orientation there, nor the reverse: the densities over
//! positions alone and over orientations alone are convolutions of their own, and cost little. They are always there.
//! The joint density is carried as long as it fits: the last convolution is counted layer by layer, each shown and
//! forgotten, where it is too large to be kept, so that the memory is that of the density of one stage less.
//!
//! # Error
//!
//! The last stages, up to 2¹⁸ frames, are exact. A convolution moves a frame to its cell's centre: by δ ≤ h√3/2 for
//! cells of size h. What comes before it is a rigid motion and does not stretch δ, and the centre's orientation does not
//! act on its position; after m convolutions a position is off by m·h√3/2 at most, and likewise the orientation. Words
//! change places only where they lie as near to a wall: summed over coarser cells of fixed size H, the L1 distance of
//! the density falls with h in the first order. Words are neither lost nor made: counts are integers below 2⁵³, which
//! an `f64` adds without error.

mod cell;
mod holes;
mod layer;
mod runs;
mod tally;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp, rotation_log};
use rayon::prelude::*;

pub use self::cell::Place;
use self::cell::{amid, each, place};
pub use self::holes::holes;
pub use self::layer::Layer;
use self::layer::{Counts, fixed};
use self::runs::Runs;
use self::tally::{SPARSE, Tally};
use super::ReachError;
use super::frames::{self, Frames};
use crate::arm::Arm;

/// Most frames of the last stages that are formed one by one.
const MAX_EXACT: usize = 1 << 18;
/// Most cells, by poses in front, that one convolution of the joint density may move: about a minute.
const MAX_MOVED: usize = 1 << 34;
/// Most cells of the joint density that are kept, 12 bytes each.
const MAX_KEPT: usize = 3 << 26;
/// Of the complete arm, which is kept only to be looked at again.
const MAX_KEPT_AT_LAST: usize = 1 << 24;
/// How finely frames are distinguished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Edge of a cell of positions, m.
    pub cell_m: f64,
    /// Edge of a cell of rotation vectors, rad.
    pub cell_rad: f64,
    /// Most frames of the last stages that are formed one by one; one stage is, whatever its size.
    pub max_exact: usize,
}

impl Resolution {
    /// Cells with edges of `cell_m` m and `cell_rad` rad, as exact as takes little time.
    pub fn new(cell_m: f64, cell_rad: f64) -> Self {
        Self { cell_m, cell_rad, max_exact: MAX_EXACT }
    }
}

/// The density of an arm's frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// How finely frames are distinguished.
    pub resolution: Resolution,
    /// The joint density; nothing where it would be too large.
    layers: Vec<Layer>,
    /// In how many orientations each position is reached, in place of words; `None` where that was not counted.
    crowd: Option<Layer>,
    /// The density over positions, whatever the orientation.
    positions: Layer,
    /// The density over rotation vectors, in cells, whatever the position.
    pub orientations: BTreeMap<Place, f64>,
    /// Cells of the joint density that all convolutions together have moved.
    pub moved: f64,
}

/// The positions of one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spot {
    /// Words that end there.
    pub words: f64,
    /// In how many cells of orientations; `None` where the joint density was too large to be counted.
    pub orientations: Option<usize>,
}

impl Map {
    /// The density of the frames of `arm` with its servos at `servos_rad`, while `go_on` says so. It gets the share of the
    /// stages that are done, 0 to 1, and is called for every layer, by all threads.
    ///
    /// # Errors
    ///
    /// [`ReachError::NoSetting`]: a stage cannot be assembled in any setting. [`ReachError::TooFine`]: the cells are so
    /// small that the arm is some thousand of them long. [`ReachError::GivenUp`]: `go_on` said no.
    pub fn new(
        arm: &Arm,
        servos_rad: &[f64],
        resolution: Resolution,
        go_on: impl Fn(f64) -> bool + Sync,
    ) -> Result<Self, ReachError> {
        Self::with_layers(arm, servos_rad, resolution, go_on, |_| ())
    }

    /// The same; where the joint density is not too large `see` is shown each layer of it, in any order.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn with_layers(
        arm: &Arm,
        servos_rad: &[f64],
        resolution: Resolution,
        go_on: impl Fn(f64) -> bool + Sync,
        see: impl Fn(&Layer) + Sync,
    ) -> Result<Self, ReachError> {
        let check = |share: f64| go_on(share).then_some(()).ok_or(ReachError::GivenUp);
        check(0.0)?;
        let stages = frames::of_stages(arm, servos_rad, |_, _| true)?;
        let mut frames = 1;
        let last = stages.iter().rev().take_while(|stage| {
            frames *= stage.len();
            frames <= resolution.max_exact
        });
        let (before, last) = stages.split_at(stages.len() - last.count().max(1));
        let mut map = Self::exact(&frames::product(last, arm.rest()), resolution)?;
        for (convolved, stage) in before.iter().enumerate().rev() {
            let share = 1.0 - (convolved + 1) as f64 / stages.len() as f64;
            let check = || check(share);
            check()?;
            map = if convolved == 0 { map.at_last(stage, check, &see)? } else { map.after(stage, check)? };
        }
        if before.is_empty() {
            map.layers.iter().for_each(see);
            let cells = map.layers.iter().map(|layer| layer.words.len()).sum();
            let mut tally = Tally::new(&map.positions, cells)?;
            map.layers.iter().for_each(|layer| tally.count(layer));
            map.crowd = Some(tally.into_layer());
        }
        Ok(map)
    }

    /// How many words the arm has.
    pub fn words(&self) -> f64 {
        self.positions.words.iter().sum()
    }

    /// How many cells of position and orientation words end in; `None` where they are too many to be counted.
    pub fn n_cells(&self) -> Option<f64> {
        self.crowd.as_ref().map(|crowd| crowd.words.iter().sum())
    }

    /// Every cell that words end in: its position, its rotation vector, and how many words; none where they are too many
    /// to be kept.
    pub fn cells(&self) -> impl Iterator<Item = (Place, Place, f64)> {
        let cells = |layer| Layer::cells(layer).map(|(position, words)| (position, layer.orientation, words));
        self.layers.iter().flat_map(cells)
    }

    /// What ends at each position, in the order of the positions.
    pub fn spots(&self) -> BTreeMap<Place, Spot> {
        let spot = |(place, words)| (place, Spot { words, orientations: None });
        let mut spots: BTreeMap<Place, Spot> = self.positions.cells().map(spot).collect();
        for (position, count) in self.crowd.iter().flat_map(Layer::cells) {
            // Rounded in another order a position of the joint density may lie one cell off that of the positions alone.
            spots.entry(position).or_default().orientations = Some(count as usize);
        }
        spots
    }

    /// The density of frames that stand where they are.
    fn exact(frames: &Frames, resolution: Resolution) -> Result<Self, ReachError> {
        let cell = |pose: &Pose<f64>| {
            let orientation = place(&rotation_log(&pose.rotation), resolution.cell_rad)?;
            Some((orientation, place(&pose.position, resolution.cell_m)?))
        };
        let mut cells: Vec<(Place, Place)> =
            frames.poses.par_iter().map(cell).collect::<Option<_>>().ok_or(ReachError::TooFine)?;
        cells.par_sort_unstable();
        let layer = |cells: &[(Place, Place)]| {
            let places = || cells.iter().map(|(_, position)| position);
            let mut runs = Runs::around(places())?;
            places().for_each(|position| runs.add(*position, 1.0));
            Ok(runs)
        };
        let groups: Vec<&[(Place, Place)]> = cells.chunk_by(|a, b| a.0 == b.0).collect();
        let layers =
            groups.par_iter().map(|cells| Ok(layer(cells)?.into_layer(cells[0].0))).collect::<Result<_, _>>()?;
        let orientations = groups.iter().map(|cells| (cells[0].0, cells.len() as f64)).collect();
        let positions = layer(&cells)?.into_layer([0; 3]);
        Ok(Self { resolution, layers, crowd: None, positions, orientations, moved: 0.0 })
    }

    /// The density of the frames of `stage` times those of this map, its layers kept.
    fn after(&self, stage: &Frames, check: impl Fn() -> Result<(), ReachError> + Sync) -> Result<Self, ReachError> {
        let map = self.apart_after(stage)?;
        let sources = self.sources(stage)?;
        let moved = self.moved + if sources.is_empty() { 0.0 } else { self.n_moved(stage) as f64 };
        let kept = AtomicUsize::new(0);
        let layer = |room: &mut Vec<f64>, (orientation, sources): &(Place, Vec<_>)| {
            check()?;
            let is_kept = kept.load(Ordering::Relaxed) <= MAX_KEPT;
            let layer = is_kept.then(|| self.layer(*orientation, sources, room)).transpose()?;
            kept.fetch_add(layer.as_ref().map_or(0, |layer| layer.words.len()), Ordering::Relaxed);
            Ok(layer)
        };
        let layers: Vec<Option<Layer>> = sources.par_iter().map_init(Vec::new, layer).collect::<Result<_, _>>()?;
        Ok(Self { layers: layers.into_iter().collect::<Option<_>>().unwrap_or_default(), moved, ..map })
    }

    /// The same of the first stage: each layer is shown, and kept where all are few.
    fn at_last(
        &self,
        stage: &Frames,
        check: impl Fn() -> Result<(), ReachError> + Sync,
        see: &(impl Fn(&Layer) + Sync),
    ) -> Result<Self, ReachError> {
        let map = self.apart_after(stage)?;
        let sources = self.sources(stage)?;
        if sources.is_empty() {
            return Ok(map);
        }
        let keep = self.n_moved(stage) <= MAX_KEPT_AT_LAST;
        let none = Tally::new(&map.positions, self.n_moved(stage))?;
        let start = || (none.clone(), Vec::new(), Vec::new());
        let (tally, layers, _) = sources
            .par_iter()
            .try_fold(start, |(mut tally, mut layers, mut room), (orientation, sources)| {
                check()?;
                let layer = self.layer(*orientation, sources, &mut room)?;
                see(&layer);
                tally.count(&layer);
                layers.extend(keep.then_some(layer));
                Ok((tally, layers, room))
            })
            .try_reduce(start, |(mut tally, mut layers, room), (other, more, _)| {
                tally.add(&other);
                layers.extend(more);
                Ok((tally, layers, room))
            })?;
        Ok(Self { layers, crowd: Some(tally.into_layer()), moved: self.moved + self.n_moved(stage) as f64, ..map })
    }

    /// Cells of the joint density by poses of a stage in front.
    fn n_moved(&self, stage: &Frames) -> usize {
        stage.len() * self.layers.iter().map(|layer| layer.words.len()).sum::<usize>()
    }

    /// For each layer of the next joint density the poses of `stage` and the layers behind them that make it; nothing
    /// where that would be too much work.
    #[allow(clippy::type_complexity, reason = "a list of layers, each with its poses and the layers behind them")]
    fn sources<'a>(&'a self, stage: &'a Frames) -> Result<Vec<(Place, Vec<(&'a Pose<f64>, &'a Layer)>)>, ReachError> {
        let mut sources: BTreeMap<Place, Vec<(&Pose<f64>, &Layer)>> = BTreeMap::new();
        if self.n_moved(stage) > MAX_MOVED {
            return Ok(Vec::new());
        }
        for layer in &self.layers {
            let rotation = rotation_exp(&amid(&layer.orientation, self.resolution.cell_rad));
            for pose in &stage.poses {
                sources.entry(self.turned(pose, &rotation)?).or_default().push((pose, layer));
            }
        }
        Ok(sources.into_iter().collect())
    }

    /// The cell of an orientation behind a pose.
    fn turned(&self, pose: &Pose<f64>, rotation: &Mat3<f64>) -> Result<Place, ReachError> {
        place(&rotation_log(&(pose.rotation * rotation)), self.resolution.cell_rad).ok_or(ReachError::TooFine)
    }

    /// The densities over positions alone and over orientations alone of the frames of `stage` times those of this map.
    fn apart_after(&self, stage: &Frames) -> Result<Self, ReachError> {
        let size = self.resolution.cell_rad;
        let mut orientations = BTreeMap::new();
        for (turn, words) in &self.orientations {
            let rotation = rotation_exp(&amid(turn, size));
            for pose in &stage.poses {
                *orientations.entry(self.turned(pose, &rotation)?).or_default() += words;
            }
        }
        let positions: Vec<_> = stage.poses.iter().map(|pose| (pose, &self.positions)).collect();
        let positions = self.layer([0; 3], &positions, &mut Vec::new())?;
        Ok(Self {
            resolution: self.resolution,
            layers: Vec::new(),
            crowd: None,
            positions,
            orientations,
            moved: self.moved,
        })
    }

    /// One layer: every source layer behind its pose, counted in `room`.
    fn layer(
        &self,
        orientation: Place,
        sources: &[(&Pose<f64>, &Layer)],
        room: &mut Vec<f64>,
    ) -> Result<Layer, ReachError> {
        let cell_m = self.resolution.cell_m;
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for (pose, layer) in sources {
            for corner in 0..8 {
                let along = |axis: usize| layer.low[axis] + (corner >> axis & 1) * (layer.size[axis] as i16 - 1);
                let moved =
                    pose.position / cell_m + pose.rotation * Vec3::new(along(0), along(1), along(2)).map(f64::from);
                (low, high) = (each(low, moved.into(), f64::min), each(high, moved.into(), f64::max));
            }
        }
        if low.iter().chain(&high).any(|number| number.abs() > f64::from(i16::MAX) - 3.0) {
            return Err(ReachError::TooFine);
        }
        // One cell of room on all sides for rounding.
        let low = low.map(|number| number.round() as i16 - 1);
        let size = each(high.map(|number| number.round() as i16), low, |h, l| h - l + 2);
        let start = |pose: &Pose<f64>, layer: &Layer| -> [i32; 3] {
            let start = pose.position / cell_m + pose.rotation * Vec3::from(layer.low).map(f64::from);
            (start - Vec3::from(low).map(f64::from)).add_scalar(0.5).map(fixed).into()
        };
        let moved: usize = sources.iter().map(|(_, layer)| layer.words.len()).sum();
        let lengths = size.map(|length| length.max(0) as usize);
        if lengths.iter().product::<usize>() / SPARSE > moved {
            let mut runs = Runs::new(low, lengths)?;
            for (pose, layer) in sources {
                let cells = layer.moved(start(pose, layer), pose.rotation.map(fixed));
                cells.for_each(|(place, words)| runs.add_inside(place.map(|number| number as u16), words));
            }
            return Ok(runs.into_layer(orientation));
        }
        let mut counts = Counts::new(orientation, low, lengths, room)?;
        for (pose, layer) in sources {
            counts.add(layer, start(pose, layer), &pose.rotation.map(fixed));
        }
        Ok(counts.to_layer())
    }
}

#[cfg(test)]
mod tests;
