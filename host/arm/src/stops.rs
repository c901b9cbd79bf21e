//! What no upload can change, reported for a person with a screwdriver: which stop or anchor is to be moved, and by how much.

use std::fmt;

use darm_core::actuator::{JointKind, Stage};
use darm_core::chain::Parameter;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use serde::{Deserialize, Serialize};

use crate::arm::Arm;

/// Changes below this are rounding, m or rad.
const NOTHING: f64 = 1e-9;

/// One stop or anchor, and what it is to be set to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Index of the actuator: of its digit in a word.
    pub actuator: usize,
    /// The actuator as a person would call it, its module first.
    pub name: String,
    /// What is to be moved.
    pub part: Part,
    /// Where it is, m (rad of a revolute joint).
    pub from: f64,
    /// Where it is to be, m (rad of a revolute joint).
    pub to: f64,
    /// Whether `from` and `to` are angles.
    pub is_angle: bool,
}

/// What can be moved with a screwdriver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Part {
    /// The stop that an actuator rests on in one state.
    Stop {
        /// The state.
        digit: u8,
    },
    /// The anchor of a leg on the plate that it is on, along x (0), y (1) or z (2) of that plate.
    BaseAnchor {
        /// The direction.
        axis: u8,
    },
    /// The anchor of a leg on the plate that it carries, along x (0), y (1) or z (2) of that plate.
    TopAnchor {
        /// The direction.
        axis: u8,
    },
}

/// Why one arm cannot be set to be the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopsError {
    /// They differ in more than stops and anchors.
    OtherArm,
    /// The arm has no such stop or anchor.
    NoSuchPart {
        /// Index of the actuator.
        actuator: usize,
        /// What was to be moved.
        part: Part,
    },
}

impl fmt::Display for StopsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherArm => {
                write!(f, "the arms differ in more than stops and anchors; compare two models of the same arm")
            }
            Self::NoSuchPart { actuator, part } => write!(f, "actuator {actuator} has no {part}"),
        }
    }
}

impl std::error::Error for StopsError {}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let direction = |axis: u8| ["x", "y", "z"].get(usize::from(axis)).copied().unwrap_or("?");
        match *self {
            Self::Stop { digit } => write!(f, "stop of digit {digit}"),
            Self::BaseAnchor { axis } => write!(f, "base anchor along {}", direction(axis)),
            Self::TopAnchor { axis } => write!(f, "top anchor along {}", direction(axis)),
        }
    }
}

impl Setting {
    /// By how much the part is to be moved: mm, or degrees of a revolute joint. Positive makes an actuator longer, and
    /// moves an anchor along its axis.
    pub fn change(&self) -> f64 {
        let change = self.to - self.from;
        if self.is_angle { change.to_degrees() } else { change * 1e3 }
    }

    /// The unit of [`change`](Self::change).
    pub fn unit(&self) -> &'static str {
        if self.is_angle { "°" } else { "mm" }
    }

    /// Which way the part goes.
    pub fn direction(&self) -> &'static str {
        match (self.part, self.change() < 0.0) {
            (Part::Stop { .. }, false) => "out",
            (Part::Stop { .. }, true) => "in",
            (_, false) => "forward",
            (_, true) => "back",
        }
    }

    fn parameter(&self) -> Parameter {
        parameter(self.actuator, self.part)
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |value: f64| if self.is_angle { value.to_degrees() } else { value * 1e3 };
        let (from, to, unit) = (shown(self.from), shown(self.to), self.unit());
        let (by, direction) = (self.change().abs(), self.direction());
        write!(f, "{}, {}: from {from:.3} to {to:.3} {unit}, {by:.3} {unit} {direction}", self.name, self.part)
    }
}

/// What is to be set on the arm `from` to make it the arm `to`, along the chain.
///
/// # Errors
///
/// [`StopsError::OtherArm`]: the arms differ in more than stops and anchors.
pub fn differences(from: &Arm, to: &Arm) -> Result<Vec<Setting>, StopsError> {
    let (old, new) = (&from.model.chain, &to.model.chain);
    let mut settings = Vec::new();
    let mut same = new.clone();
    for (actuator, part) in parts(from) {
        let parameter = parameter(actuator, part);
        let (Some(before), Some(after)) = (old.get(parameter), new.get(parameter)) else {
            return Err(StopsError::OtherArm);
        };
        same.set(parameter, before).map_err(|_| StopsError::OtherArm)?;
        if (after - before).abs() > NOTHING {
            let (name, is_angle) = (from.actuator_name(actuator), is_angle(from, actuator));
            settings.push(Setting { actuator, name, part, from: before, to: after, is_angle });
        }
    }
    if same == *old { Ok(settings) } else { Err(StopsError::OtherArm) }
}

/// The arm after a person has made these settings: each part moved by its change, and by a normal error of standard
/// deviation `error_m` (rad of a revolute joint: over the arm's length scale).
///
/// # Errors
///
/// [`StopsError::NoSuchPart`]: the arm has no such stop or anchor.
pub fn apply(arm: &Arm, settings: &[Setting], error_m: f64, seed: u64) -> Result<Arm, StopsError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut set = arm.clone();
    for setting in settings {
        let sigma = if setting.is_angle { error_m / arm.length_scale_m } else { error_m };
        let error = Normal::new(0.0, sigma).map_or(0.0, |normal| normal.sample(&mut rng));
        let missing = StopsError::NoSuchPart { actuator: setting.actuator, part: setting.part };
        let value = set.model.chain.get(setting.parameter()).ok_or(missing)?;
        set.model.chain.set(setting.parameter(), value + setting.to - setting.from + error).map_err(|_| missing)?;
    }
    Ok(set)
}

fn parameter(actuator: usize, part: Part) -> Parameter {
    let actuator = actuator as u8;
    match part {
        Part::Stop { digit } => Parameter::Stop { actuator, state: digit },
        Part::BaseAnchor { axis } => Parameter::BaseAnchor { actuator, axis },
        Part::TopAnchor { axis } => Parameter::TopAnchor { actuator, axis },
    }
}

/// Every stop and anchor of an arm, along the chain.
fn parts(arm: &Arm) -> Vec<(usize, Part)> {
    let mut parts = Vec::new();
    for (actuator, (stage, leg)) in arm.model.chain.actuators().enumerate() {
        let stage = &arm.model.chain.stages[stage];
        let stops = (0..stage.n_states(leg) as u8).map(|digit| Part::Stop { digit });
        let anchors = (0..3).flat_map(|axis| [Part::BaseAnchor { axis }, Part::TopAnchor { axis }]);
        let anchors = anchors.filter(|_| stage.leg(leg).is_some());
        parts.extend(stops.chain(anchors).map(|part| (actuator, part)));
    }
    parts
}

fn is_angle(arm: &Arm, actuator: usize) -> bool {
    let stage = arm.model.chain.actuator(actuator).map(|(stage, _)| &arm.model.chain.stages[stage]);
    matches!(stage, Some(Stage::Discrete(joint)) if joint.axis.kind == JointKind::Revolute)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn planar4() -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml")).unwrap()
    }

    fn altered() -> Arm {
        let mut arm = planar4();
        arm.model.chain.set(parameter(4, Part::Stop { digit: 1 }), 1.75).unwrap();
        arm.model.chain.set(parameter(6, Part::TopAnchor { axis: 0 }), -0.503).unwrap();
        arm
    }

    #[test]
    fn a_person_is_told_what_to_turn() {
        let texts: Vec<_> = differences(&planar4(), &altered()).unwrap().iter().map(Setting::to_string).collect();
        assert_eq!(
            texts,
            [
                "module 2, diagonal leg, stop of digit 1: from 1767.767 to 1750.000 mm, 17.767 mm in",
                "module 3, left leg, top anchor along x: from -500.000 to -503.000 mm, 3.000 mm back"
            ]
        );
    }

    #[test]
    fn settings_without_error_make_the_new_arm() {
        let settings = differences(&planar4(), &altered()).unwrap();
        let set = apply(&planar4(), &settings, 0.0, 1).unwrap();
        assert_eq!(differences(&set, &altered()), Ok(vec![]));
    }

    #[test]
    fn errors_of_setting_are_seeded_and_of_their_size() {
        let settings = differences(&planar4(), &altered()).unwrap();
        let set = |seed| apply(&planar4(), &settings, 1e-4, seed).unwrap();
        assert_eq!(set(3), set(3));
        let left = differences(&set(3), &altered()).unwrap();
        assert!(left.len() == 2 && left.iter().all(|setting| setting.change().abs() < 0.5), "{left:?}");
    }

    #[test]
    fn another_arm_is_refused() {
        let mut other = planar4();
        other.model.chain.tool.position.x = 0.1;
        assert_eq!(differences(&planar4(), &other), Err(StopsError::OtherArm));
    }
}
