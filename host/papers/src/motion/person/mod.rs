//! A person from markers and force plates: a general tree scaled to the person who moved.
//!
//! Lengths come from the markers: for given angles the markers are linear in the scales of the links, so angles and lengths are
//! found in turn over frames of the complete motion. Masses come from the plates: for a given motion the wrench is
//! linear in the scales of the masses, so one regularised least squares finds those whose centre of pressure is the
//! measured one. Both are repeated until the simulated centre of pressure lies within [`WITHIN_M`] of the measured
//! one, where the paper did it by hand. A left and a right link share their scale.

mod groups;
mod lengths;
mod pressure;

use darm_core::real::Vec3;
use serde::Serialize;

pub(super) use self::groups::Groups;
use self::lengths::{Average, follow};
pub use self::pressure::measured_cop;
use self::pressure::simulated;
use super::markers::Capture;
use super::placed::Placed;
use super::smooth::Smooth;
use super::trajectory::{Trajectory, TrajectoryError};
use super::{BodyPoint, Posture};
use darm_robot::robot::Robot;

/// How near the simulated centre of pressure shall come to the measured one, m (the paper's 2 cm).
pub const WITHIN_M: f64 = 0.02;
/// Corner of the low-pass on the motion and on the plates, Hz.
pub const CORNER_HZ: f64 = 4.0;
/// How far the lengths and masses of people lie from the average, as a share.
const SPREAD: (f64, f64) = (0.1, 0.25);
/// Rounds of masses.
const MASS_ROUNDS: i32 = 5;

/// A link's scale.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scale {
    /// Name of the link, without its side.
    pub link: String,
    /// Length over that of the general tree.
    pub length: f64,
    /// Mass over that of the general tree.
    pub mass: f64,
}

/// How far the simulated centre of pressure is from the measured one, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CopError {
    /// RMS over the frames.
    pub rms_m: f64,
    /// Largest of the frames.
    pub worst_m: f64,
}

/// A person who moved.
#[derive(Clone, Debug)]
pub struct Person {
    /// The tree with the person's lengths and masses.
    pub tree: Robot,
    /// The markers on it.
    pub markers: Vec<BodyPoint>,
    /// How it moved.
    pub motion: Trajectory,
    /// Its centre of mass, low-passed, m.
    pub com: Vec<Vec3<f64>>,
    /// Its simulated centre of pressure, m.
    pub cop: Vec<[f64; 2]>,
    /// Scales of the links.
    pub scales: Vec<Scale>,
    /// Centre of pressure before anything was scaled.
    pub before: CopError,
    /// And after.
    pub after: CopError,
}

/// Fits a tree with markers to a motion.
///
/// # Errors
///
/// The joints of `tree` make no tree, a frame has no posture that meets the markers within the limits, or the moment of
/// the plates has the wrong sign.
pub fn person(tree: &Robot, markers: &[BodyPoint], capture: &Capture) -> Result<Person, TrajectoryError> {
    let groups = Groups::new(tree);
    let average = follow(tree, markers, capture)?;
    let simulated_before = simulated(tree, &groups, &average, capture);
    simulated_before.agrees(capture)?;
    let before = simulated_before.error;
    let lengths = Average { tree, markers, groups: &groups }.lengths(capture)?;
    let even = vec![1.0; groups.names.len()];
    let long = groups.scaled(tree, &lengths, &even);
    let placed_on = groups.markers(markers, &lengths);
    let motion = follow(&long, &placed_on, capture)?;
    let mut masses = even;
    let mut scaled = groups.scaled(tree, &lengths, &masses);
    let mut now = simulated(&scaled, &groups, &motion, capture);
    // As near to the average as it can be: the masses get more room only while the centre of pressure is not met.
    for round in 0..MASS_ROUNDS {
        if now.error.worst_m <= WITHIN_M {
            break;
        }
        let next = now.masses(&masses, capture, SPREAD.1 * 2f64.powi(round));
        let tree_next = groups.scaled(tree, &lengths, &next);
        let tried = simulated(&tree_next, &groups, &motion, capture);
        if tried.error.rms_m >= now.error.rms_m {
            break;
        }
        (masses, scaled, now) = (next, tree_next, tried);
    }
    let com = com(&scaled, &motion.postures, &capture.time_s)?;
    let scales = groups.names.iter().zip(lengths.iter().zip(&masses));
    let scales = scales.map(|(link, (length, mass))| Scale { link: link.clone(), length: *length, mass: *mass });
    Ok(Person {
        scales: scales.collect(),
        tree: scaled,
        markers: placed_on,
        motion,
        com,
        cop: now.cop,
        before,
        after: now.error,
    })
}

/// The centre of mass along a motion, low-passed.
///
/// # Errors
///
/// The joints of `tree` make no tree that can be computed.
pub fn com(tree: &Robot, postures: &[Posture], time_s: &[f64]) -> Result<Vec<Vec3<f64>>, TrajectoryError> {
    let mut placed = Placed::new(tree)?;
    let raw: Vec<Vec3<f64>> = postures
        .iter()
        .map(|posture| {
            placed.place(posture);
            placed.com().0
        })
        .collect();
    let smooth = Smooth::new(time_s, CORNER_HZ);
    let [x, y, z]: [Vec<f64>; 3] = std::array::from_fn(|k| smooth.pass(raw.iter().map(|c| c[k]).collect()));
    Ok((0..raw.len()).map(|k| Vec3::new(x[k], y[k], z[k])).collect())
}
