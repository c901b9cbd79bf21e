//! What each actuator bears under gravity, in a word and at the most over all words, and what the arm can carry.
//!
//! # Model
//!
//! The arm is at rest in its geometry, without effects. An actuator bears f = a·m + b·F, where (m, F) is the load on the top of
//! its stage in the top's frame, and a, b follow from the posture of the stage alone ([`Stage::loads`]). The load is that of
//! the weights further out: F = M·g and m = c × g with their mass M, their first moment c = Σ m_i·p_i, and gravity g, so
//!
//! f = g·(a × c + M·b)
//!
//! | symbol | depends on | linear |
//! | --- | --- | --- |
//! | g | the stages before: they turn the frame | f in g |
//! | a, b | the digits of the stage | |
//! | c | the stages behind | f in c |
//!
//! # Search
//!
//! The largest f over all words is found without looking at each. As f is linear in c, only the vertices of the convex hull of
//! all c count, and as each stage moves c rigidly, the hull of a stage follows from the vertices of the next one:
//! `hull`. For each of them w = a × c + M·b is a vector, and the direction g with the largest g·w is found by branch
//! and bound over the stages before: `directions`. What is found is the largest to one part in 10⁶ ([`PRECISION`]).
//!
//! Force: N along a leg or prismatic joint, positive in compression; N·m about a revolute joint, positive when the joint drives
//! its angle up.

pub mod capacity;
mod directions;
mod hull;
mod support;

use darm_core::actuator::{MAX_LEGS, Stage};
use darm_core::chain::ChainError;
use darm_core::model::Mass;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, Wrench};
use darm_core::units::Word;
use rayon::prelude::*;

use self::directions::{Directions, Turn};
use self::hull::{Point, vertices};
use crate::arm::{Arm, ArmScratch};
use crate::stage_settings::{joined, setting, settings};

/// What the search leaves out is larger than what it finds by at most this share.
pub const PRECISION: f64 = 1e-6;

/// An arm whose servos are at rest, and what its tool carries.
#[derive(Clone, Debug, PartialEq)]
pub struct Laden<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// Angles of its servo joints, rad.
    pub servos_rad: Vec<f64>,
    /// What the tool carries in addition to its mass in the arm file, at the same centre, kg.
    pub payload_kg: f64,
}

/// What an actuator bears in a word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// N or N·m.
    pub force: f64,
    /// The word.
    pub word: Word,
}

/// The loads of an actuator in one of its states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadRange {
    /// The least over all words: the largest tension, where it is below zero.
    pub smallest: Load,
    /// The largest over all words.
    pub largest: Load,
}

/// Why there are no loads.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// None of the settings puts a stage together.
    #[error("stage {stage} cannot be assembled in any of its states: change its legs")]
    NoSetting {
        /// Index of the stage.
        stage: usize,
    },
    /// The arm has no posture.
    #[error("the arm has no posture: {0}")]
    NoPosture(#[from] ChainError),
}

impl Laden<'_> {
    /// What each actuator bears in a word.
    ///
    /// # Errors
    ///
    /// The word or the servo positions do not fit the arm, or a platform cannot be assembled.
    pub fn loads(&self, word: &Word) -> Result<Vec<f64>, ChainError> {
        let (model, mut scratch) = (&self.arm.model, ArmScratch::default());
        model.chain.pose_base_tool(word, &self.servos_rad, &mut scratch)?;
        let loads = model.loads(&scratch, self.payload_kg);
        Ok(model.chain.actuators().map(|(stage, leg)| loads[stage][leg]).collect())
    }

    /// The least and the largest load of each actuator in each of its states, over all words that assemble the arm; `None` for a
    /// state that no word assembles.
    ///
    /// # Errors
    ///
    /// [`LoadError::NoSetting`]: a stage cannot be assembled in any of its states. [`LoadError::NoPosture`]: there is not one
    /// angle for each servo joint.
    pub fn ranges(&self) -> Result<Vec<Vec<Option<LoadRange>>>, LoadError> {
        self.ranges_in(&self.search()?)
    }

    /// What the search needs that no payload changes.
    fn search(&self) -> Result<Search, LoadError> {
        let stages = self.stages()?;
        let turns = stages.iter().map(|stage| stage.iter().map(Posture::turn).collect()).collect();
        let gravity = self.arm.model.chain.mount.rotation.tr_mul(&self.arm.model.gravity);
        Ok(Search { directions: Directions::new(gravity, turns, self.arm.rest()), stages })
    }

    fn ranges_in(&self, Search { stages, directions }: &Search) -> Result<Vec<Vec<Option<LoadRange>>>, LoadError> {
        let outer = self.loads_of_outer_stages(stages);
        let chain = &self.arm.model.chain;
        let cases: Vec<_> = chain.actuators().enumerate().collect();
        let of_actuator = |&(actuator, (stage, leg)): &(usize, (usize, usize))| {
            let of_state = |digit: usize| {
                let postures =
                    stages[stage].iter().filter(|posture| usize::from(posture.word.digit(actuator)) == digit);
                let vectors: Vec<Point> = postures.flat_map(|posture| posture.vectors(leg, &outer[stage])).collect();
                self.range(actuator, stage, &vectors, directions)
            };
            (0..chain.stages[stage].n_states(leg)).map(of_state).collect::<Result<Vec<_>, _>>()
        };
        Ok(cases.par_iter().map(of_actuator).collect::<Result<Vec<_>, ChainError>>()?)
    }

    /// The range of an actuator whose load is g·w for one of these `vectors` w and a direction g of its stage's base.
    fn range(
        &self,
        actuator: usize,
        stage: usize,
        vectors: &[Point],
        directions: &Directions,
    ) -> Result<Option<LoadRange>, ChainError> {
        let load = |word: Word| Ok::<_, ChainError>(Load { force: self.loads(&word)?[actuator], word });
        let opposite: Vec<Point> = vectors.iter().map(|point| Point { at: -point.at, ..*point }).collect();
        let [largest, smallest] =
            [vectors, opposite.as_slice()].map(|vectors| directions.largest_product(stage, vectors));
        match (smallest, largest) {
            (Some(smallest), Some(largest)) => {
                Ok(Some(LoadRange { smallest: load(smallest)?, largest: load(largest)? }))
            }
            _ => Ok(None),
        }
    }

    /// The postures of each stage.
    fn stages(&self) -> Result<Vec<Vec<Posture>>, LoadError> {
        let arm = self.arm;
        let chain = &arm.model.chain;
        // Checks the number of the servos' angles; a word that cannot be assembled is not looked at.
        let mut scratch = ArmScratch::default();
        chain.configure(&arm.rest(), &self.servos_rad, &mut scratch)?;
        let (mut first, mut stages) = (0, Vec::new());
        for (index, stage) in chain.stages.iter().enumerate() {
            let postures: Vec<Posture> = match stage {
                Stage::Servo(joint) => {
                    vec![Posture::unmoved(joint.axis.pose(scratch.settings[index][0].value), arm.rest())]
                }
                _ => settings(stage).filter_map(|digits| Posture::new(stage, &digits, first, arm.rest())).collect(),
            };
            if postures.is_empty() {
                return Err(LoadError::NoSetting { stage: index });
            }
            first += stage.n_actuators();
            stages.push(postures);
        }
        Ok(stages)
    }

    /// For each stage the weights that its top bears: their mass, and the vertices of all their first moments in its frame.
    fn loads_of_outer_stages(&self, stages: &[Vec<Posture>]) -> Vec<Outer> {
        let model = &self.arm.model;
        let carried = Mass { mass_kg: model.payload.mass_kg + self.payload_kg, ..model.payload };
        let moment = (model.chain.tool * carried.center) * carried.mass_kg;
        let mut beyond = Outer { mass_kg: carried.mass_kg, moments: vec![Point { at: moment, word: self.arm.rest() }] };
        let mut outer = Vec::new();
        for (postures, mass) in stages.iter().zip(&model.masses).rev() {
            let borne = beyond.with(mass);
            beyond = borne.seen_from_base(postures);
            outer.push(borne);
        }
        outer.reverse();
        outer
    }
}

/// The postures of each stage, and the directions of gravity in its base.
struct Search {
    stages: Vec<Vec<Posture>>,
    directions: Directions,
}

/// Weights that a frame bears.
struct Outer {
    mass_kg: f64,
    /// First moments about the origin of the frame, expressed in it, kg·m, with the digits that bring each about.
    moments: Vec<Point>,
}

impl Outer {
    /// These weights and one more.
    fn with(&self, mass: &Mass<f64>) -> Self {
        let own = mass.center * mass.mass_kg;
        let moments = self.moments.iter().map(|point| Point { at: point.at + own, ..*point }).collect();
        Self { mass_kg: self.mass_kg + mass.mass_kg, moments }
    }

    /// The same weights borne by the base of a stage in any of its postures.
    fn seen_from_base(&self, postures: &[Posture]) -> Self {
        let moved = |posture: &Posture, point: &Point| Point {
            at: posture.pose.position * self.mass_kg + posture.pose.rotation * point.at,
            word: joined(&posture.word, &point.word),
        };
        let all = postures.iter().flat_map(|posture| self.moments.iter().map(move |point| moved(posture, point)));
        Self { mass_kg: self.mass_kg, moments: vertices(&all.collect::<Vec<_>>()) }
    }
}

/// A stage in one setting of its actuators.
struct Posture {
    /// Its digits; 0 for all other actuators of the arm.
    word: Word,
    /// Pose of its top in its base.
    pose: Pose<f64>,
    /// What each actuator bears of a unit moment (a) and of a unit force (b) on the top along each axis of its frame.
    of_moment: [Vec3<f64>; MAX_LEGS],
    of_force: [Vec3<f64>; MAX_LEGS],
}

impl Posture {
    /// `None` where the stage, whose first actuator is `first`, cannot be assembled.
    fn new(stage: &Stage<f64>, digits: &[u8], first: usize, rest: Word) -> Option<Self> {
        let settings = setting(stage, digits)?;
        let pose = stage.pose(&settings).ok()?;
        let mut posture = Self::unmoved(pose, rest);
        for (leg, &digit) in digits.iter().enumerate() {
            posture.word = posture.word.with_digit(first + leg, digit);
        }
        for axis in 0..3 {
            let unit = Vec3::ith(axis, 1.0);
            let moment = stage.loads(&settings, &pose, &Wrench { moment: unit, force: Vec3::zeros() });
            let force = stage.loads(&settings, &pose, &Wrench { moment: Vec3::zeros(), force: unit });
            for leg in 0..MAX_LEGS {
                (posture.of_moment[leg][axis], posture.of_force[leg][axis]) = (moment[leg], force[leg]);
            }
        }
        Some(posture)
    }

    /// A stage without discrete actuators.
    fn unmoved(pose: Pose<f64>, word: Word) -> Self {
        let zero = [Vec3::zeros(); MAX_LEGS];
        Self { word, pose, of_moment: zero, of_force: zero }
    }

    fn turn(&self) -> Turn {
        let rotation: Mat3<f64> = self.pose.rotation;
        Turn { rotation, word: self.word }
    }

    /// w = a × c + M·b of an actuator for each first moment c, in the frame of the stage's base.
    fn vectors<'a>(&'a self, leg: usize, outer: &'a Outer) -> impl Iterator<Item = Point> + 'a {
        let (a, b) = (self.of_moment[leg], self.of_force[leg]);
        outer.moments.iter().map(move |point| Point {
            at: self.pose.rotation * (a.cross(&point.at) + b * outer.mass_kg),
            word: joined(&self.word, &point.word),
        })
    }
}

#[cfg(test)]
mod tests;
