//! Desired frames as a file: where the tool is to stand, and for which word.
//!
//! # Format
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `[[frame]]` | one frame |
//! | `name` ? | its name |
//! | `word` | the digits of all actuators, base first; commas between modules are for the eye; not needed where words are chosen |
//! | `previous` ? | the word before it, where that matters; all zeros |
//! | `pose` | of the tool in the base: `{ position_m = [x, y], angle_deg = a }`, in space `{ position_m = [x, y, z], rotation_deg = [..] }` |
//! | `servo_deg` ? | where the servos start, all 0; a synthesis may turn them within their range |
//! | `orientation` ? | `fixed`, or `free` where any orientation will do |
//! | `position_weight`, `orientation_weight` ? | what an error counts where not all frames can be met, 1 |
//! | `[[bound]]` ? | what the stops of one actuator may be set to in a synthesis |
//! | `actuator` | its number, from 0 at the base |
//! | `state` ? | the state that the bound is about; every state |
//! | `least_m`, `most_m`, `least_deg`, `most_deg` ? | of the state; degrees of a revolute joint |
//! | `least_stroke_m`, `most_stroke_m`, `least_stroke_deg`, `most_stroke_deg` ? | between a state and the one before it |

use std::ops::Range;
use std::path::Path;

use darm_core::se::Pose;
use darm_core::units::Word;
use serde::Deserialize;
use toml::Spanned;

use super::quantities::pose;
use super::raw::RawPose;
use super::{Arm, FileError, FrameFault, write};
use darm_robot::source::Number;
use darm_robot::source::Source;

/// The version of the file format.
pub const FORMAT: u32 = 1;

/// Why a file gives no desired frames.
pub type FramesError = FileError<FrameFault>;

/// Where the tool is to stand for one word.
#[derive(Clone, Debug, PartialEq)]
pub struct DesiredFrame {
    /// What it is called.
    pub name: String,
    /// The word that is to bring the tool there.
    pub word: Word,
    /// The word before it.
    pub previous: Word,
    /// Angles of the servo joints, rad: where a synthesis starts, and what it may change.
    pub servos_rad: Vec<f64>,
    /// Pose of the tool in the base.
    pub pose_base_tool: Pose<f64>,
    /// What its errors count.
    pub weights: Weights,
}

/// What the errors of a frame count in a synthesis that cannot meet all frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Of the position, above zero.
    pub position: f64,
    /// Of the orientation; zero leaves it free.
    pub orientation: f64,
}

impl DesiredFrame {
    /// As far as one radian counts in the distance to a pose of `arm`, m: nothing where the orientation is free.
    pub fn length_scale_m(&self, arm: &Arm) -> f64 {
        if self.weights.orientation == 0.0 { 0.0 } else { arm.length_scale_m }
    }

    /// Distance from a pose of the tool of `arm`, m; of the positions where the orientation is free.
    pub fn distance_m(&self, arm: &Arm, pose_base_tool: &Pose<f64>) -> f64 {
        pose_base_tool.distance(&self.pose_base_tool, self.length_scale_m(arm))
    }
}

impl Default for Weights {
    fn default() -> Self {
        Self { position: 1.0, orientation: 1.0 }
    }
}

/// What the stops of one actuator may be set to; m, of a revolute joint rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopRange {
    /// Its number.
    pub actuator: usize,
    /// The state that it is about; `None` for every state.
    pub state: Option<u8>,
    /// Least and most of the state.
    pub value: (f64, f64),
    /// Least and most difference of the state and the one before it.
    pub stroke: (f64, f64),
}

impl StopRange {
    /// Any stops of an actuator.
    pub fn any(actuator: usize) -> Self {
        let any = (f64::NEG_INFINITY, f64::INFINITY);
        Self { actuator, state: None, value: any, stroke: any }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFrames {
    format: Spanned<u32>,
    #[serde(default)]
    frame: Vec<RawFrame>,
    #[serde(default)]
    bound: Vec<RawBound>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFrame {
    name: Option<String>,
    word: Option<Spanned<String>>,
    previous: Option<Spanned<String>>,
    pose: Spanned<RawPose>,
    servo_deg: Option<Spanned<Vec<Number>>>,
    orientation: Option<RawOrientation>,
    position_weight: Option<Spanned<Number>>,
    orientation_weight: Option<Spanned<Number>>,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RawOrientation {
    Fixed,
    Free,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBound {
    actuator: Spanned<usize>,
    state: Option<Spanned<u8>>,
    #[serde(rename = "least_m")]
    min_m: Option<Number>,
    #[serde(rename = "most_m")]
    max_m: Option<Number>,
    #[serde(rename = "least_deg")]
    min_deg: Option<Number>,
    #[serde(rename = "most_deg")]
    max_deg: Option<Number>,
    #[serde(rename = "least_stroke_m")]
    min_stroke_m: Option<Number>,
    #[serde(rename = "most_stroke_m")]
    max_stroke_m: Option<Number>,
    #[serde(rename = "least_stroke_deg")]
    min_stroke_deg: Option<Number>,
    #[serde(rename = "most_stroke_deg")]
    max_stroke_deg: Option<Number>,
}

/// What a frames file asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// The desired frames.
    pub frames: Vec<DesiredFrame>,
    /// What the stops of single actuators may be set to.
    pub ranges: Vec<StopRange>,
}

/// Reads desired frames of an arm.
///
/// # Errors
///
/// As [`read_task`].
pub fn read(path: &Path, arm: &Arm) -> Result<Vec<DesiredFrame>, FramesError> {
    Ok(read_task(path, arm)?.frames)
}

/// Reads desired frames of an arm, and the bounds that stand beside them.
///
/// # Errors
///
/// The file cannot be read or is not TOML of this format, a key is missing or unknown, or as [`check`]. The error
/// names line and column.
pub fn read_task(path: &Path, arm: &Arm) -> Result<Task, FramesError> {
    task(&Source::read(path)?, arm, Words::Given)
}

/// The same where words are still to be chosen: those in the file do not matter, the frames have that of rest.
///
/// # Errors
///
/// As [`read_task`], but for missing and repeated words.
pub fn read_task_without_words(path: &Path, arm: &Arm) -> Result<Task, FramesError> {
    task(&Source::read(path)?, arm, Words::Open)
}

/// The desired frames that `text` describes; `path` only serves messages.
///
/// # Errors
///
/// As [`read_task`], but for a file that cannot be read.
pub fn parse(path: &Path, text: &str, arm: &Arm) -> Result<Vec<DesiredFrame>, FramesError> {
    Ok(task(&Source::of_text(path, text), arm, Words::Given)?.frames)
}

/// The text of a frames file.
pub fn to_toml(frames: &[DesiredFrame]) -> String {
    let mut text = format!("format = {FORMAT}\n");
    for frame in frames {
        let servos: Vec<_> = frame.servos_rad.iter().map(|angle| format!("{:?}", angle.to_degrees())).collect();
        text += &format!("\n[[frame]]\nname = {}\n", toml::Value::String(frame.name.clone()));
        text += &format!("word = \"{}\"\nprevious = \"{}\"\n", frame.word, frame.previous);
        text += &format!("pose = {}\nservo_deg = [{}]\n", write::pose(&frame.pose_base_tool), servos.join(", "));
        text += &weight_lines(&frame.weights);
    }
    text
}

/// Only what differs from the default is written.
fn weight_lines(weights: &Weights) -> String {
    let line = |key, value: f64| if value == 1.0 { String::new() } else { format!("{key} = {value:?}\n") };
    let orientation = match weights.orientation {
        0.0 => "orientation = \"free\"\n".to_owned(),
        weight => line("orientation_weight", weight),
    };
    line("position_weight", weights.position) + &orientation
}

/// Refuses frames that do not fit the arm, with the index of the frame.
///
/// # Errors
///
/// There is no frame; a word does not fit the arm or serves two frames; a frame has not one position for each servo
/// joint; or the arm is planar and a frame is not.
pub fn check(frames: &[DesiredFrame], arm: &Arm) -> Result<(), (usize, FrameFault)> {
    check_all(frames, arm, Words::Given)
}

fn check_all(frames: &[DesiredFrame], arm: &Arm, words: Words) -> Result<(), (usize, FrameFault)> {
    for (index, frame) in frames.iter().enumerate() {
        for word in [frame.word, frame.previous] {
            check_word(&word, arm).map_err(|fault| (index, fault))?;
        }
        if frame.servos_rad.len() != arm.n_servos() {
            let fault = FrameFault::ServoCount { servos: arm.n_servos(), found: frame.servos_rad.len() };
            return Err((index, fault));
        }
        if arm.model.chain.is_planar() && !frame.pose_base_tool.is_planar() {
            return Err((index, FrameFault::Coordinates { expected: 2, found: 3 }));
        }
        let same = frames[..index].iter().find(|other| other.word == frame.word);
        if let Some(other) = same.filter(|_| words == Words::Given) {
            return Err((index, FrameFault::SameWord { word: frame.word, other: other.name.clone() }));
        }
    }
    if frames.is_empty() { Err((0, FrameFault::Empty)) } else { Ok(()) }
}

/// Refuses a word that the arm cannot take.
///
/// # Errors
///
/// The word has not one digit for each actuator, or a digit asks for a state that its actuator does not have.
pub fn check_word(word: &Word, arm: &Arm) -> Result<(), FrameFault> {
    let actuators = arm.n_actuators();
    if word.len() != actuators {
        return Err(FrameFault::WordLength { word: *word, actuators });
    }
    for (actuator, digit) in word.iter().enumerate() {
        let states = arm.model.chain.n_states(actuator);
        if usize::from(digit) >= states {
            return Err(FrameFault::Digit { word: *word, actuator: arm.actuator_name(actuator), states });
        }
    }
    Ok(())
}

/// Whether frames have words.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Words {
    Given,
    Open,
}

fn task(source: &Source, arm: &Arm, words: Words) -> Result<Task, FramesError> {
    let raw: RawFrames = source.parse()?;
    if *raw.format.get_ref() != FORMAT {
        return Err(source.wrong(raw.format.span(), FrameFault::Format { found: *raw.format.get_ref() }));
    }
    let mut frames = Vec::new();
    for raw in &raw.frame {
        let frame = frame(raw, frames.len(), arm, words).map_err(|(span, fault)| source.wrong(span, fault))?;
        frames.push(frame);
    }
    check_all(&frames, arm, words).map_err(|(index, fault)| {
        let span = match (raw.frame.get(index), &fault) {
            (Some(raw), FrameFault::ServoCount { .. }) => raw.servo_deg.as_ref().map_or(raw.pose.span(), Spanned::span),
            (Some(raw), FrameFault::Coordinates { .. }) => raw.pose.span(),
            (Some(raw), _) => raw.word.as_ref().map_or(raw.pose.span(), Spanned::span),
            (None, _) => raw.format.span(),
        };
        source.wrong(span, fault)
    })?;
    let ranges = raw.bound.iter().map(|raw| range(raw, arm).map_err(|(span, fault)| source.wrong(span, fault)));
    Ok(Task { frames, ranges: ranges.collect::<Result<_, _>>()? })
}

/// The range of one actuator's stops; what is left out is unbounded.
fn range(raw: &RawBound, arm: &Arm) -> Result<StopRange, (Range<usize>, FrameFault)> {
    let actuator = *raw.actuator.get_ref();
    let wrong = |fault| (raw.actuator.span(), fault);
    if actuator >= arm.n_actuators() {
        return Err(wrong(FrameFault::NoSuchActuator { actuator, actuators: arm.n_actuators() }));
    }
    let metres = [raw.min_m, raw.max_m, raw.min_stroke_m, raw.max_stroke_m];
    let degrees = [raw.min_deg, raw.max_deg, raw.min_stroke_deg, raw.max_stroke_deg];
    let turns = arm.turns(actuator);
    let (given, useless) = if turns { (degrees, metres) } else { (metres, degrees) };
    if useless.iter().any(Option::is_some) {
        return Err(wrong(FrameFault::BoundUnit { actuator: arm.actuator_name(actuator), turns }));
    }
    let [min, max, min_stroke, max_stroke] =
        given.map(|value| value.map(|value| if turns { value.0.to_radians() } else { value.0 }));
    let pair = |min: Option<f64>, max: Option<f64>| (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
    let state = raw.state.as_ref().map(|state| (*state.get_ref(), state.span()));
    let states = arm.model.chain.n_states(actuator);
    if let Some((state, span)) = state.clone().filter(|(state, _)| usize::from(*state) >= states) {
        return Err((span, FrameFault::NoSuchState { actuator: arm.actuator_name(actuator), state, states }));
    }
    let state = state.map(|(state, _)| state);
    let range = StopRange { actuator, state, value: pair(min, max), stroke: pair(min_stroke, max_stroke) };
    if range.value.0 > range.value.1 || range.stroke.0 > range.stroke.1 {
        return Err(wrong(FrameFault::EmptyBound { actuator: arm.actuator_name(actuator) }));
    }
    Ok(range)
}

fn weights(raw: &RawFrame) -> Result<Weights, (Range<usize>, FrameFault)> {
    let weight = |raw: &Option<Spanned<Number>>| match raw {
        Some(weight) if weight.get_ref().0 <= 0.0 => Err((weight.span(), FrameFault::Weight(weight.get_ref().0))),
        Some(weight) => Ok(weight.get_ref().0),
        None => Ok(1.0),
    };
    let orientation = weight(&raw.orientation_weight)?;
    let free = raw.orientation == Some(RawOrientation::Free);
    Ok(Weights { position: weight(&raw.position_weight)?, orientation: if free { 0.0 } else { orientation } })
}

fn frame(raw: &RawFrame, index: usize, arm: &Arm, words: Words) -> Result<DesiredFrame, (Range<usize>, FrameFault)> {
    let word = |text: &Spanned<String>| text.get_ref().parse().map_err(|error| (text.span(), FrameFault::Word(error)));
    let servos =
        raw.servo_deg.as_ref().map(|servos| servos.get_ref().iter().map(|angle| angle.0.to_radians()).collect());
    Ok(DesiredFrame {
        name: raw.name.clone().unwrap_or_else(|| format!("frame {}", index + 1)),
        word: match (&raw.word, words) {
            (_, Words::Open) => arm.rest(),
            (Some(text), Words::Given) => word(text)?,
            (None, Words::Given) => return Err((raw.pose.span(), FrameFault::NoWord)),
        },
        previous: raw.previous.as_ref().map_or(Ok(arm.rest()), word)?,
        servos_rad: servos.unwrap_or_else(|| vec![0.0; arm.n_servos()]),
        pose_base_tool: pose(raw.pose.get_ref())
            .map_err(|(expected, found)| (raw.pose.span(), FrameFault::Coordinates { expected, found }))?,
        weights: weights(raw)?,
    })
}
