//! Words that can be assembled: a constraint on the stops of every module.
//!
//! The frames say nothing of most words. Where the stops have moved far, a module may have no pose at rest, which is no arm, or in
//! words that a table could otherwise use.
//!
//! # Model
//!
//! d(l)·|d(l)| >= MARGIN²   for each module in each setting of its actuators that is needed
//!
//! | symbol | meaning                                                                                                |
//! |--------|--------------------------------------------------------------------------------------------------------|
//! | l      | lengths of the module's legs in this setting, m                                                        |
//! | X(l)   | pose of the top that gives the legs their lengths, in the assembly mode of home                        |
//! | d      | scaled determinant of D at X, positive in the assembly mode of home, see [`darm_core::actuator`]       |
//! | e      | by how much the legs miss their lengths where X does not exist, at the pose where |e| is least, m      |
//!
//! Towards a singular posture d falls with the root of the distance in l, hence its square: that falls linearly. Where X does not exist,
//! |e| falls by as much as l is moved along −e/|e|, since no motion of the top changes it to first order. Both are linear inequalities
//! on the stops at each step, as bounds are.

use darm_core::actuator::{MIN_DETERMINANT, Stage};
use darm_core::chain::Parameter;
use darm_core::se::{Pose, Twist};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::newton::{Damping, damped_inverse};
use super::problem::{Bound, Problem};
use crate::arm::Arm;
use crate::stage_settings::{pose, settings};

/// The scaled determinant that a step aims at: twice of what a module must have.
const MARGIN: f64 = 2.0 * MIN_DETERMINANT;
/// A module whose determinant is larger is too far from a singular posture for one step to reach it.
const FAR: f64 = 0.6;
/// By how much a step moves the legs past the point where they fit together, m: there the determinant is still 0.
const PAST_M: f64 = 1e-3;
/// Half the interval of the determinant's differences.
const HALF_INTERVAL: f64 = 1e-5;
/// Steps to the pose in which the legs miss their lengths least, and the longest of them, m and rad.
const CLOSING_STEPS: u32 = 20;
const LONGEST_STEP: f64 = 0.3;
/// A step as short as this changes what the legs miss by its square, m and rad.
const CLOSED: f64 = 1e-6;
/// What a setting without a pose weighs besides what its legs miss, so that none is given up for others, m.
const EACH_M: f64 = 1e-3;

/// The settings of one module in which it cannot be assembled: a digit for each of its actuators.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct WithoutPose {
    /// Number of the stage.
    pub stage: usize,
    /// The settings.
    pub settings: Vec<Vec<u8>>,
}

/// The module and the setting in which an arm is nearest to a singular posture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NearestSingular {
    /// Number of the stage.
    pub stage: usize,
    /// Its setting: a digit for each of its actuators.
    pub setting: Vec<u8>,
    /// The scaled determinant, without a unit: a module with less than [`MIN_DETERMINANT`] counts as singular.
    pub determinant: f64,
}

/// The modules of an arm with settings in which they cannot be assembled: no table can use words that contain them.
pub fn without_pose(arm: &Arm) -> Vec<WithoutPose> {
    let without = |stage: &Stage<f64>| settings(stage).filter(|digits| pose(stage, digits).is_none()).collect();
    platforms(arm).map(|(stage, of)| WithoutPose { stage, settings: without(of) }).filter(is_some).collect()
}

/// The share of all words that an arm can be assembled in.
pub fn assembled_share(arm: &Arm) -> f64 {
    let lost = without_pose(arm);
    let share = |module: &WithoutPose| {
        let n = settings(&arm.model.chain.stages[module.stage]).count();
        1.0 - module.settings.len() as f64 / n as f64
    };
    lost.iter().map(share).product()
}

/// Where an arm is nearest to a singular posture, of all settings in which its modules can be assembled; `None` without platforms.
pub fn nearest_singular(arm: &Arm) -> Option<NearestSingular> {
    let of_stage = |(stage, of): (usize, &Stage<f64>)| {
        let determinants = settings(of).filter_map(|setting| {
            let determinant = determinant(of, &pose(of, &setting)?);
            Some(NearestSingular { stage, setting, determinant })
        });
        determinants.min_by(|a, b| a.determinant.total_cmp(&b.determinant))
    };
    platforms(arm).filter_map(of_stage).min_by(|a, b| a.determinant.total_cmp(&b.determinant))
}

/// A setting as a word has it.
pub fn digits(setting: &[u8]) -> String {
    setting.iter().map(u8::to_string).collect()
}

fn is_some(module: &WithoutPose) -> bool {
    !module.settings.is_empty()
}

fn platforms(arm: &Arm) -> impl Iterator<Item = (usize, &Stage<f64>)> {
    let stages = arm.model.chain.stages.iter().enumerate();
    stages.filter(|(_, stage)| matches!(stage, Stage::Planar(_) | Stage::Spatial(_)))
}

impl Problem<'_> {
    /// By how much the legs miss their lengths in the needed settings, m; 0 where every module can be assembled in each.
    pub(super) fn missed_m(&mut self, unknowns: &DVector<f64>) -> f64 {
        let mut missed_m = 0.0;
        let needed = self.needed.clone();
        for (stage, settings) in needed.stages.iter().enumerate().filter(|(_, settings)| !settings.is_empty()) {
            let of = self.stage(unknowns, stage);
            let without = settings.iter().filter(|digits| pose(of, digits).is_none());
            missed_m += without.map(|digits| EACH_M + closed(of, digits).missing.norm()).sum::<f64>();
        }
        missed_m
    }

    /// The stage and the needed setting that a step nearer would lose first, if one is near to it.
    pub(super) fn nearly_lost(&mut self, unknowns: &DVector<f64>) -> Option<(usize, Vec<u8>)> {
        let needed = self.needed.clone();
        let mut nearest = (2.0 * MARGIN, None);
        for (stage, settings) in needed.stages.iter().enumerate().filter(|(_, settings)| !settings.is_empty()) {
            let of = self.stage(unknowns, stage);
            for setting in settings {
                let d = pose(of, setting).map_or(0.0, |at| determinant(of, &at));
                if d < nearest.0 {
                    nearest = (d, Some((stage, setting.clone())));
                }
            }
        }
        nearest.1
    }

    /// The constraint as linear inequalities at `unknowns`, of the settings that a step may lose or win.
    pub(super) fn assembly_bounds(&mut self, unknowns: &DVector<f64>) -> Vec<Bound> {
        let mut bounds = Vec::new();
        let needed = self.needed.clone();
        for (stage, settings) in needed.stages.iter().enumerate().filter(|(_, settings)| !settings.is_empty()) {
            let parameters = self.parameters_of(stage);
            let of = self.stage(unknowns, stage);
            for digits in settings {
                let at = pose(of, digits);
                let (growth, gain) = match &at {
                    Some(at) => {
                        let d = determinant(of, at);
                        if d > FAR {
                            continue;
                        }
                        // What is nearer already is not moved: its frame may need it so.
                        (by_lengths(of, at) * (2.0 * d.abs()), (MARGIN * MARGIN - d * d.abs()).min(0.0))
                    }
                    None => {
                        let Closed { missing, .. } = closed(of, digits);
                        let missed_m = missing.norm();
                        if missed_m < 1e-9 {
                            continue;
                        }
                        (missing / -missed_m, missed_m + PAST_M)
                    }
                };
                let at = at.unwrap_or_else(|| closed(of, digits).pose);
                let grows = |&(unknown, parameter, leg): &(usize, Parameter, usize)| match parameter {
                    Parameter::Stop { state, .. } => (digits[leg] == state).then(|| (unknown, growth[leg])),
                    Parameter::BaseAnchor { axis, .. } => {
                        Some((unknown, growth[leg] * line(of, leg, &at)[usize::from(axis)]))
                    }
                    Parameter::TopAnchor { axis, .. } => {
                        let seen = at.rotation.tr_mul(&line(of, leg, &at));
                        Some((unknown, -growth[leg] * seen[usize::from(axis)]))
                    }
                    _ => None,
                };
                let terms: Vec<(usize, f64)> = parameters.iter().filter_map(grows).collect();
                let now: f64 = terms.iter().map(|&(unknown, factor)| factor * unknowns[unknown]).sum();
                bounds.push(Bound { terms, min: now + gain });
            }
        }
        bounds
    }

    /// Stops and anchors of one stage: unknown, parameter, leg.
    fn parameters_of(&self, stage: usize) -> Vec<(usize, Parameter, usize)> {
        let chain = &self.base_line().model.chain;
        let own = |(unknown, parameter): (usize, &Parameter)| {
            let (Parameter::Stop { actuator, .. }
            | Parameter::BaseAnchor { actuator, .. }
            | Parameter::TopAnchor { actuator, .. }) = *parameter
            else {
                return None;
            };
            let (of, leg) = chain.actuator(actuator.into())?;
            (of == stage).then_some((unknown, *parameter, leg))
        };
        self.stops.iter().enumerate().filter_map(own).collect()
    }
}

/// The pose in which the legs of a module miss their lengths least, and by how much each misses, m.
struct Closed {
    pose: Pose<f64>,
    missing: DVector<f64>,
}

fn closed(stage: &Stage<f64>, digits: &[u8]) -> Closed {
    let lengths = DVector::from_iterator(
        digits.len(),
        digits.iter().enumerate().map(|(leg, &digit)| stage.leg(leg).map_or(0.0, |of| of.length_m[usize::from(digit)])),
    );
    let missing =
        |pose: &Pose<f64>| &lengths - DVector::from_fn(digits.len(), |leg, _| across(stage, leg, pose).norm());
    let mut at = home(stage);
    let mut missed = missing(&at);
    let mut damping = Damping::default();
    for _ in 0..CLOSING_STEPS {
        let step = damped_inverse(&rows(stage, &at), &missed, damping.value());
        if step.amax() < CLOSED || damping.is_exhausted() {
            break;
        }
        let next = moved(stage, &at, &(&step * (LONGEST_STEP / step.amax()).min(1.0)));
        let next_missed = missing(&next);
        if next_missed.norm() < missed.norm() {
            (at, missed) = (next, next_missed);
            damping.lower();
        } else {
            damping.raise();
        }
    }
    Closed { pose: at, missing: missed }
}

/// How the determinant grows with the length of each leg.
fn by_lengths(stage: &Stage<f64>, at: &Pose<f64>) -> DVector<f64> {
    let n = stage.n_actuators();
    let growth = |motion: usize, _| {
        let by = |by: f64| {
            determinant(stage, &moved(stage, at, &DVector::from_fn(n, |k, _| if k == motion { by } else { 0.0 })))
        };
        (by(HALF_INTERVAL) - by(-HALF_INTERVAL)) / (2.0 * HALF_INTERVAL)
    };
    damped_inverse(&rows(stage, at).transpose(), &DVector::from_fn(n, growth), 0.0)
}

/// How the length of each leg grows with each motion of the top, expressed in its own frame: a row for each leg.
fn rows(stage: &Stage<f64>, at: &Pose<f64>) -> DMatrix<f64> {
    let n = stage.n_actuators();
    let mut rows = DMatrix::zeros(n, n);
    for leg in 0..n {
        let along = at.rotation.tr_mul(&line(stage, leg, at));
        let moment = stage.leg(leg).map_or(along, |leg| leg.top.cross(&along));
        let six = [moment.x, moment.y, moment.z, along.x, along.y, along.z];
        motions(stage).iter().enumerate().for_each(|(column, &motion)| rows[(leg, column)] = six[motion]);
    }
    rows
}

/// From the base anchor of a leg to its top anchor, in the frame of the base.
fn across(stage: &Stage<f64>, leg: usize, at: &Pose<f64>) -> nalgebra::Vector3<f64> {
    stage.leg(leg).map_or_else(nalgebra::Vector3::zeros, |leg| *at * leg.top - leg.base)
}

fn line(stage: &Stage<f64>, leg: usize, at: &Pose<f64>) -> nalgebra::Vector3<f64> {
    let across = across(stage, leg, at);
    across / across.norm().max(f64::MIN_POSITIVE)
}

fn moved(stage: &Stage<f64>, at: &Pose<f64>, by: &DVector<f64>) -> Pose<f64> {
    let mut six = [0.0; 6];
    motions(stage).iter().zip(by.iter()).for_each(|(&motion, &by)| six[motion] = by);
    let [x, y, z, vx, vy, vz] = six;
    *at * Pose::exp(&Twist { angular: [x, y, z].into(), linear: [vx, vy, vz].into() })
}

/// Components of a twist that a platform is free to take.
pub(super) fn motions(stage: &Stage<f64>) -> &'static [usize] {
    match stage {
        Stage::Planar(_) => &[2, 3, 4],
        Stage::Spatial(_) => &[0, 1, 2, 3, 4, 5],
        _ => &[],
    }
}

fn home(stage: &Stage<f64>) -> Pose<f64> {
    match stage {
        Stage::Planar(platform) => platform.home,
        Stage::Spatial(platform) => platform.home,
        _ => Pose::identity(),
    }
}

/// det D over its scale, positive in the assembly mode of home; 1 of what is no platform.
pub(super) fn determinant(stage: &Stage<f64>, at: &Pose<f64>) -> f64 {
    match stage {
        Stage::Planar(platform) => platform.determinant(&platform.home).signum() * platform.determinant(at),
        Stage::Spatial(platform) => platform.determinant(&platform.home).signum() * platform.determinant(at),
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn module() -> Stage<f64> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml");
        Arm::read(&path).unwrap().model.chain.stages[0]
    }

    #[test]
    fn the_determinant_grows_with_the_legs_as_its_derivative_says() {
        let (mut stage, setting) = (module(), [1, 0, 1]);
        // Legs of unlike lengths: where two entries of a column are equally large, its scale has a kink.
        [1.21, 1.53, 1.12]
            .into_iter()
            .enumerate()
            .for_each(|(leg, m)| stage.leg_mut(leg).unwrap().length_m[usize::from(setting[leg])] = m);
        let with = |leg: usize, by: f64| {
            let mut longer = stage;
            longer.leg_mut(leg).unwrap().length_m[usize::from(setting[leg])] += by;
            determinant(&longer, &pose(&longer, &setting).unwrap())
        };
        let exact = by_lengths(&stage, &pose(&stage, &setting).unwrap());
        for leg in 0..3 {
            // Central differences over 2e-5 m: their own error is the square of that.
            assert!(((with(leg, 1e-5) - with(leg, -1e-5)) / 2e-5 - exact[leg]).abs() < 1e-7, "leg {leg}");
        }
    }

    /// Left leg, diagonal and plate are a triangle with sides 1, 2.1 and 1 m: 0.1 m too much for it.
    #[test]
    fn legs_that_do_not_fit_miss_by_as_much_as_they_have_to_move() {
        let mut stage = module();
        stage.leg_mut(1).unwrap().length_m[0] = 2.1;
        assert_eq!(pose(&stage, &[0, 0, 0]), None);
        let missing = closed(&stage, &[0, 0, 0]).missing;
        for (leg, short) in missing.iter().enumerate() {
            stage.leg_mut(leg).unwrap().length_m[0] -= (1.0 + 1e-3) * short;
        }
        assert!(closed(&stage, &[0, 0, 0]).missing.norm() < 1e-6);
    }
}
