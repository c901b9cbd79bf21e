//! Kinematic synthesis: the lengths at which the legs have to stop, so that the arm reaches desired frames.
//!
//! # Problem
//!
//! log(T_k(a)⁻¹ · T_k*) = 0 for every desired frame k, with |a − a₀| as small as it can be
//!
//! | symbol | meaning                                                                                      |
//! |--------|----------------------------------------------------------------------------------------------|
//! | a      | the unknowns: every stop of every discrete actuator (m, rad), the servo angles of each frame |
//! | a₀     | the same of the initial arm                                                                |
//! | T_k(a) | where the model, with its effects, predicts the tool for the word of frame k                 |
//! | T_k*   | the desired frame k                                                                          |
//!
//! Where stops alone do not meet the frames, the coordinates of the legs' anchors join the unknowns, within
//! [`Bounds::anchor_m`].
//!
//! Rows in rad are weighted by the arm's length scale. How many frames can be met is given by ranks, see [`Case`].
//!
//! - [`Method::Newton`] (default): Gauss–Newton on the group with analytic derivatives, damped where a full step does
//!   not help, along the way from the base-line's own frames where that fails, from several starts after that. Bounds
//!   hold all the way.
//! - [`Method::Paper`]: the incremental scheme of the paper, for comparison.
//!
//! Stops that no frame uses are set so that every module can be assembled in every word, see `assembly`.
//!
//! Servo angles are free at first; then each is fixed at the nearest angle that the servo can keep, and the stops take up
//! what that leaves.
//!
//! Source: Miyahara, Chirikjian, General Kinematic Synthesis Method for a Discretely Actuated Robotic Manipulator.

mod accuracy;
mod assembly;
mod case;
mod catalogue;
mod closest;
mod few_actuators;
mod infeasibility;
mod lift;
mod needed_words;
mod newton;
mod paper;
mod problem;
mod repair;
mod search;
mod search_handle;
mod stroke;
mod tolerance;
mod words;

use std::fmt;
use std::time::{Duration, Instant};

use darm_core::chain::ChainError;
use darm_core::output::SERVO_STEPS_PER_TURN;
use darm_core::se::Pose;
use darm_core::units::Word;
use serde::Serialize;

use crate::arm::frames::{self, DesiredFrame, StopRange};
use crate::arm::{Arm, FrameFault, reason_of};
pub use accuracy::Accuracy;
pub use assembly::{NearestSingular, WithoutPose, assembled_share, digits, nearest_singular, without_pose};
pub use case::{BoundFrame, Case, CaseKind, CompleteModules};
pub use catalogue::{Bought, CatalogueError, Part, buy, read_catalogue};
pub use few_actuators::synthesize_by_few;
pub use infeasibility::Infeasibility;
use needed_words::Needed;
pub use needed_words::NeededWords;
pub use paper::{Feedback, Scheme};
use problem::Problem;
pub use repair::{Cost, StuckActuator, repair};
pub use search_handle::SearchHandle;
pub use stroke::{MinStroke, equal_stops, min_strokes, short_strokes, stops_as_they_are};
pub use tolerance::{Expected, Tolerance, expected, minimize_sensitivity};
pub use words::choose_words;

/// How to look for the geometry.
#[derive(Clone, Debug)]
pub struct Options {
    /// The scheme.
    pub method: Method,
    /// What the stops may be set to.
    pub bounds: Bounds,
    /// What the stops of single actuators may be set to besides.
    pub ranges: Vec<StopRange>,
    /// The words that have to be assembled besides those of the frames.
    pub words: NeededWords,
    /// How many starts are tried, the base-line included, before the nearest is returned.
    pub starts: u32,
    /// Seed of the starts.
    pub seed: u64,
    /// Shows how far the search is, and ends it early.
    pub handle: SearchHandle,
}

/// The scheme of a synthesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Gauss–Newton on the group, analytic derivatives, several ways and starts.
    Newton,
    /// Undamped Gauss–Newton from the base-line, without bounds and other starts: what the rest is measured by.
    Plain,
    /// The paper's: frames interpolated in steps, derivatives by differences.
    Paper(Scheme),
}

/// What the stops may be set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Shortest length of a leg, as a share of its shortest length in the initial arm.
    pub shortest: f64,
    /// Longest length of a leg, as a share of its longest length in the initial arm.
    pub longest: f64,
    /// Least difference of a state and the one before it, m (rad of a revolute joint).
    pub stroke: f64,
    /// A revolute joint stops within plus and minus this angle, rad.
    pub turn_rad: f64,
    /// By how much each coordinate of an anchor may be moved where stops alone do not meet the frames, m; 0 keeps them.
    pub anchor_m: f64,
}

impl Bounds {
    /// Any number goes.
    pub fn none() -> Self {
        Self {
            shortest: f64::NEG_INFINITY,
            longest: f64::INFINITY,
            stroke: f64::NEG_INFINITY,
            turn_rad: f64::INFINITY,
            anchor_m: 0.0,
        }
    }
}

impl Default for Bounds {
    fn default() -> Self {
        Self { shortest: 0.5, longest: 2.0, stroke: 0.0, turn_rad: std::f64::consts::PI, anchor_m: 0.0 }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::Newton,
            bounds: Bounds::default(),
            ranges: Vec::new(),
            words: NeededWords::All,
            starts: 256,
            seed: 1,
            handle: SearchHandle::default(),
        }
    }
}

/// The geometry that was found.
#[derive(Clone, Debug)]
pub struct Synthesis {
    /// The arm with this geometry; its model has the next number.
    pub arm: Arm,
    /// Whether every frame is met.
    pub status: Status,
    /// Whether the stops keep all bounds, as they do but for the paper's and the plain scheme.
    pub kept: bool,
    /// What keeps the nearest geometry from the frames; `None` where all are met.
    pub obstacle: Option<Infeasibility>,
    /// Whether the frames are few enough to be met.
    pub case: Case,
    /// What became of each desired frame.
    pub frames: Vec<Reached>,
    /// Steps taken, over all starts.
    pub iterations: u32,
    /// Starts that were needed.
    pub starts: u32,
    /// How long it took.
    pub time: Duration,
    /// Root of the sum of squares of what stops and anchors were altered by, m (a radian weighs as the arm's length scale).
    pub alteration_m: f64,
    /// The most that a coordinate of an anchor was moved by, m.
    pub anchors_moved_m: f64,
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Every frame is met to the [`Accuracy`] of the method.
    Reached,
    /// The frames cannot be met, or were not: the nearest that was found.
    Closest,
}

/// A bound missed by more than this, m or rad, is broken.
const BROKEN: f64 = 1e-9;

/// One desired frame after the synthesis.
#[derive(Clone, Debug)]
pub struct Reached {
    /// The frame, with the servo angles that were found.
    pub frame: DesiredFrame,
    /// Where the tool is predicted in the base.
    pub pose_base_tool: Pose<f64>,
    /// Distance of the positions, m.
    pub error_m: f64,
    /// Angle between the orientations, rad.
    pub error_rad: f64,
    /// Distance of the positions with the initial arm, m.
    pub error_before_m: f64,
    /// Angle between the orientations with the initial arm, rad.
    pub error_before_rad: f64,
    /// What the method counts as met.
    accuracy: Accuracy,
}

impl Reached {
    /// Whether the frame is met, a free orientation in any case.
    pub fn is_met(&self) -> bool {
        let free = self.frame.weights.orientation == 0.0;
        self.error_m <= self.accuracy.position_m && (free || self.error_rad <= self.accuracy.orientation_rad)
    }
}

/// Why there is nothing to start from.
#[derive(Clone, Debug, PartialEq)]
pub enum SynthesisError {
    /// A desired frame does not fit the arm.
    Frame {
        /// The frame's name.
        frame: String,
        /// What is wrong with it.
        fault: FrameFault,
    },
    /// The initial arm, or the arm on the paper's way, has no pose for the word of a frame.
    NoPose {
        /// The frame's name.
        frame: String,
        /// Its word.
        word: Word,
        /// The module at fault.
        module: String,
        /// Why.
        reason: ChainError,
    },
    /// There are not as many words that bring the tool near the frames.
    NoWords {
        /// Desired frames.
        frames: usize,
        /// Words that were looked at.
        words: usize,
    },
}

impl fmt::Display for SynthesisError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frame { frame, fault } => write!(f, "{frame}: {fault}"),
            Self::NoPose { frame, word, module, reason } => write!(
                f,
                "{frame}: {module} has no pose for the word {word}: {}; change its leg lengths, or the word",
                reason_of(reason)
            ),
            Self::NoWords { frames, words } => {
                write!(
                    f,
                    "{words} words cannot serve {frames} frames; ask for fewer frames, or give the arm more states"
                )
            }
        }
    }
}

impl std::error::Error for SynthesisError {}

/// Looks for the geometry with which `base_line` reaches `desired`.
///
/// # Errors
///
/// A desired frame does not fit the arm, or `base_line` has no pose for the word of one.
pub fn synthesize(base_line: &Arm, desired: &[DesiredFrame], options: &Options) -> Result<Synthesis, SynthesisError> {
    let started = Instant::now();
    frames::check(desired, base_line).map_err(|(index, fault)| SynthesisError::Frame {
        frame: desired.get(index).map_or_else(|| "the list of frames".into(), |frame| frame.name.clone()),
        fault,
    })?;
    let by_stops = Options { bounds: Bounds { anchor_m: 0.0, ..options.bounds }, ..options.clone() };
    let (mut best, mut by) = (solve(base_line, desired, &by_stops, false)?, &by_stops);
    if best.status == Status::Closest && options.bounds.anchor_m > 0.0 && !options.handle.is_ended() {
        let moved = solve(base_line, desired, options, false)?;
        if moved.status == Status::Reached || moved.is_nearer(&best) {
            (best, by) = (moved, options);
        }
    }
    if base_line.n_servos() > 0 && best.status == Status::Reached {
        let fixed: Vec<DesiredFrame> = best.frames.iter().map(|reached| on_steps(&reached.frame)).collect();
        let stepped = solve(base_line, &fixed, by, true)?;
        if stepped.status == Status::Reached {
            best = Synthesis { case: best.case, iterations: best.iterations + stepped.iterations, ..stepped };
        }
    }
    Ok(Synthesis { time: started.elapsed(), ..best })
}

/// A frame with the servo angles that the servos can hold, nearest to the requested ones.
fn on_steps(frame: &DesiredFrame) -> DesiredFrame {
    let step_rad = std::f64::consts::TAU / f64::from(SERVO_STEPS_PER_TURN);
    let servos_rad = frame.servos_rad.iter().map(|angle| (angle / step_rad).round() * step_rad).collect();
    DesiredFrame { servos_rad, ..frame.clone() }
}

/// One search, with the servo angles free or fixed as the frames say.
fn solve(
    base_line: &Arm,
    desired: &[DesiredFrame],
    options: &Options,
    servos_fixed: bool,
) -> Result<Synthesis, SynthesisError> {
    let mut problem = Problem::new(base_line, desired, &options.bounds, &options.ranges);
    problem.servos_fixed = servos_fixed;
    problem.accuracy = Accuracy::of(options.method);
    problem.needed = Needed::new(base_line, &options.words);
    let before = problem.start();
    let before_poses = problem.poses(&before)?;
    let case = case::of(&problem)?;
    let found = match options.method {
        Method::Newton => search::solve(&mut problem, options)?,
        Method::Plain => search::plain(&mut problem),
        Method::Paper(scheme) => {
            let is_regularised = case.kind == CaseKind::Insufficient;
            let regularisation = if is_regularised { scheme.regularisation } else { 0.0 };
            paper::solve(&mut problem, Scheme { regularisation, ..scheme })?
        }
    };
    answer(&mut problem, desired, &before_poses, case, &found)
}

/// What a search found, frame by frame.
fn answer(
    problem: &mut Problem,
    desired: &[DesiredFrame],
    before: &[Pose<f64>],
    case: Case,
    found: &Found,
) -> Result<Synthesis, SynthesisError> {
    let unknowns = problem.without_rounding(found.unknowns.clone(), BROKEN);
    let poses = problem.poses(&unknowns)?;
    let frames: Vec<Reached> = desired
        .iter()
        .enumerate()
        .map(|(index, frame)| {
            let servos_rad = problem.servos(&unknowns, index).to_vec();
            let frame = DesiredFrame { servos_rad, ..frame.clone() };
            reached(frame, &before[index], poses[index], problem.accuracy)
        })
        .collect();
    let met = frames.iter().all(Reached::is_met);
    Ok(Synthesis {
        arm: problem.arm(&unknowns),
        status: if met { Status::Reached } else { Status::Closest },
        obstacle: (!met).then(|| infeasibility::of(problem, &unknowns)),
        kept: problem.bounds.iter().all(|bound| bound.slack(&unknowns) > -BROKEN),
        case,
        frames,
        iterations: found.iterations,
        starts: found.starts,
        time: Duration::ZERO,
        alteration_m: problem.alteration(&unknowns),
        anchors_moved_m: problem.anchors_moved_m(&unknowns),
    })
}

impl Synthesis {
    /// The sum of squares of the errors of all frames, m²; a radian weighs as the arm's length scale, a free one
    /// nothing.
    pub fn error_m2(&self) -> f64 {
        let turn_m = |reached: &Reached| match reached.frame.weights.orientation {
            0.0 => 0.0,
            _ => reached.error_rad * self.arm.length_scale_m,
        };
        self.frames.iter().map(|reached| reached.error_m.powi(2) + turn_m(reached).powi(2)).sum()
    }

    /// Whether the error of this one is less than that of another.
    fn is_nearer(&self, other: &Self) -> bool {
        self.error_m2() < other.error_m2()
    }

    /// Stops that differ from those of another arm by more than a micrometre or microradian.
    fn stops_turned(&self, from: &Arm) -> usize {
        let (here, there) = (Problem::values(&self.arm), Problem::values(from));
        here.iter().zip(&there).filter(|(here, there)| (*here - *there).abs() > 1e-6).count()
    }
}

fn reached(frame: DesiredFrame, before: &Pose<f64>, pose: Pose<f64>, accuracy: Accuracy) -> Reached {
    let apart = |pose: &Pose<f64>| {
        let apart = pose.to(&frame.pose_base_tool);
        (apart.position.norm(), apart.angle_rad())
    };
    let ((error_m, error_rad), (error_before_m, error_before_rad)) = (apart(&pose), apart(before));
    Reached { frame, pose_base_tool: pose, error_m, error_rad, error_before_m, error_before_rad, accuracy }
}

/// Where a scheme ended.
struct Found {
    unknowns: nalgebra::DVector<f64>,
    iterations: u32,
    starts: u32,
}

#[cfg(test)]
mod tests;
