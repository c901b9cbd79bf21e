//! Desired frames as a file: where the tool is to stand, and for which word.
//!
//! # Format
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `[[frame]]` | one frame |
//! | `name` ? | its name |
//! | `word` | the digits of all actuators, base first; commas between modules are for the eye |
//! | `previous` ? | the word before it, where that matters; all zeros |
//! | `pose` | of the tool in the base: `{ position_m = [x, y], angle_deg = a }`, in space `{ position_m = [x, y, z], rotation_deg = [..] }` |
//! | `servo_deg` ? | where the servos start, all 0; a synthesis may turn them within their range |

use std::ops::Range;
use std::path::Path;

use darm_core::se::Pose;
use darm_core::units::Word;
use serde::Deserialize;
use toml::Spanned;

use super::build::pose;
use super::raw::{Number, RawPose};
use super::source::Source;
use super::{Arm, FORMAT, FileError, FrameFault, write};

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
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFrames {
    format: Spanned<u32>,
    #[serde(default)]
    frame: Vec<RawFrame>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFrame {
    name: Option<String>,
    word: Spanned<String>,
    previous: Option<Spanned<String>>,
    pose: Spanned<RawPose>,
    servo_deg: Option<Spanned<Vec<Number>>>,
}

/// Reads desired frames of an arm.
pub fn read(path: &Path, arm: &Arm) -> Result<Vec<DesiredFrame>, FramesError> {
    frames(&Source::read(path)?, arm)
}

/// The desired frames that `text` describes; `path` only serves messages.
pub fn parse(path: &Path, text: &str, arm: &Arm) -> Result<Vec<DesiredFrame>, FramesError> {
    frames(&Source::of_text(path, text), arm)
}

/// The text of a frames file.
pub fn to_toml(frames: &[DesiredFrame]) -> String {
    let mut text = format!("format = {FORMAT}\n");
    for frame in frames {
        let servos: Vec<_> = frame.servos_rad.iter().map(|angle| format!("{:?}", angle.to_degrees())).collect();
        text += &format!("\n[[frame]]\nname = {}\n", toml::Value::String(frame.name.clone()));
        text += &format!("word = \"{}\"\nprevious = \"{}\"\n", frame.word, frame.previous);
        text += &format!("pose = {}\nservo_deg = [{}]\n", write::pose(&frame.pose_base_tool), servos.join(", "));
    }
    text
}

/// Refuses frames that do not fit the arm, with the index of the frame.
pub fn check(frames: &[DesiredFrame], arm: &Arm) -> Result<(), (usize, FrameFault)> {
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
        if let Some(other) = frames[..index].iter().find(|other| other.word == frame.word) {
            return Err((index, FrameFault::SameWord { word: frame.word, other: other.name.clone() }));
        }
    }
    if frames.is_empty() { Err((0, FrameFault::Empty)) } else { Ok(()) }
}

/// Refuses a word that the arm cannot take.
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

fn frames(source: &Source, arm: &Arm) -> Result<Vec<DesiredFrame>, FramesError> {
    let raw: RawFrames = source.parse()?;
    if *raw.format.get_ref() != FORMAT {
        return Err(source.wrong(raw.format.span(), FrameFault::Format { found: *raw.format.get_ref() }));
    }
    let mut frames = Vec::new();
    for raw in &raw.frame {
        let frame = frame(raw, frames.len(), arm).map_err(|(span, fault)| source.wrong(span, fault))?;
        frames.push(frame);
    }
    check(&frames, arm).map_err(|(index, fault)| {
        let span = match (raw.frame.get(index), &fault) {
            (Some(raw), FrameFault::ServoCount { .. }) => raw.servo_deg.as_ref().map_or(raw.word.span(), Spanned::span),
            (Some(raw), FrameFault::Coordinates { .. }) => raw.pose.span(),
            (Some(raw), _) => raw.word.span(),
            (None, _) => raw.format.span(),
        };
        source.wrong(span, fault)
    })?;
    Ok(frames)
}

fn frame(raw: &RawFrame, index: usize, arm: &Arm) -> Result<DesiredFrame, (Range<usize>, FrameFault)> {
    let word = |text: &Spanned<String>| text.get_ref().parse().map_err(|error| (text.span(), FrameFault::Word(error)));
    let servos =
        raw.servo_deg.as_ref().map(|servos| servos.get_ref().iter().map(|angle| angle.0.to_radians()).collect());
    Ok(DesiredFrame {
        name: raw.name.clone().unwrap_or_else(|| format!("frame {}", index + 1)),
        word: word(&raw.word)?,
        previous: raw.previous.as_ref().map_or(Ok(arm.rest()), word)?,
        servos_rad: servos.unwrap_or_else(|| vec![0.0; arm.n_servos()]),
        pose_base_tool: pose(raw.pose.get_ref())
            .map_err(|(expected, found)| (raw.pose.span(), FrameFault::Coordinates { expected, found }))?,
    })
}
