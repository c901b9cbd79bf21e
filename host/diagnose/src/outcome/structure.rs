//! What a residual depends on, as data.

use std::fmt;

use darm_core::effect::Frame;
use darm_core::effect::fitted_term::Variable;
use serde::{Serialize, Serializer};

use crate::number::Number;
use darm_arm::arm::Arm;

/// The structure beyond the noise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Structure {
    /// Mean square of the residual over that of repeats; `None` without repeats.
    pub ratio: Option<f64>,
    /// Chance that this is noise; `None` without repeats.
    pub p: Option<f64>,
    /// Whether there is more than noise.
    pub beyond_noise: bool,
    /// Mean square beyond the noise, in units of the noise's own; without repeats what the dependences take.
    #[serde(skip)]
    pub(crate) excess: f64,
    /// Root mean square in units of the noise; without repeats the largest of a component in units of what the dependences leave of it.
    #[serde(skip)]
    pub(crate) over_noise: f64,
    /// What the residual depends on, each beside those before it, the strongest first; of signals axis by axis.
    pub depends_on: Vec<Dependence>,
}

/// A variable that the residual depends on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dependence {
    /// The axis of the residual; of a tool pose that which has at least three quarters of the squares, in units of the noise;
    /// `None`: several axes together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// What it depends on.
    #[serde(skip)]
    pub regressor: Regressor,
    /// Its name.
    pub variable: String,
    /// How.
    #[serde(serialize_with = "shape_name")]
    pub shape: Shape,
    /// The frame in whose directions a tool pose depends on it.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "frame_name")]
    pub frame: Option<Frame>,
    /// Share of the residual's mean square that it takes up.
    pub share: f64,
    /// Chance of such a share where there is none, times the number of terms tried.
    pub p: Option<f64>,
    /// By how much the held-out error falls when it is kept as a fitted term: its norm, of signals its axis; `None` where it is not worth it, or does not recur.
    pub held_out_gain: Option<Number>,
    /// Of signals: the variable, in SI units and radians, and what remains there; empty of a term of several variables.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<[f64; 2]>,
    /// What the model of an arm may keep of it: variables, and whether their squares.
    #[serde(skip)]
    pub terms: Vec<(Variable<f64>, bool)>,
}

impl Dependence {
    /// A straight one of several axes, of which nothing but its share is known.
    pub(crate) fn of_share(regressor: Regressor, share: f64) -> Self {
        Self {
            axis: None,
            variable: regressor.to_string(),
            regressor,
            shape: Shape::Straight,
            frame: None,
            share,
            p: None,
            held_out_gain: None,
            curve: Vec::new(),
            terms: Vec::new(),
        }
    }

    /// Its axis, of a tool pose with the frame, as `y of the base`.
    pub fn direction(&self) -> String {
        let of = self.frame.map_or(String::new(), |frame| format!(" of the {}", frame_name_of(frame)));
        format!("{}{of}", self.axis.as_deref().unwrap_or("several axes"))
    }
}

impl fmt::Display for Dependence {
    /// The variable, and how where it is not straight: `time (waves)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.shape {
            Shape::Straight => f.write_str(&self.variable),
            shape => write!(f, "{} ({shape})", self.variable),
        }
    }
}

/// What a residual can depend on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Regressor {
    /// The word of an arm.
    Word,
    /// The time in a run of an arm.
    Time,
    /// Supply.
    Supply,
    /// Temperature.
    Temperature,
    /// What the tool carries.
    Load,
    /// Where the tool is.
    ToolPosition,
    /// Position of a servo, counted from 0.
    Servo(usize),
    /// The digit of an actuator.
    Digit(usize),
    /// The digits of two actuators.
    Digits([usize; 2]),
    /// Whether an actuator stood the same in the word before.
    WordBefore(usize),
    /// Whether an actuator stood the same in the word before the last.
    WordBeforeLast(usize),
    /// One signal of a log, or the product of two.
    Signals(Vec<String>),
    /// The residual of the row before.
    RowBefore,
    /// Each condition of signals, such as a posture, by itself.
    Condition,
}

impl Regressor {
    /// Its name in a sentence, with the names that the arm gives to its actuators.
    pub(crate) fn name_in(&self, arm: &Arm) -> String {
        self.name(|actuator| arm.actuator_name(actuator))
    }

    fn name(&self, actuator: impl Fn(usize) -> String) -> String {
        match self {
            Self::Word => "word".into(),
            Self::Time => "time".into(),
            Self::Supply => "supply".into(),
            Self::Temperature => "temperature".into(),
            Self::Load => "load".into(),
            Self::ToolPosition => "position of the tool".into(),
            Self::Servo(servo) => format!("position of servo {servo}"),
            Self::Digit(of) => format!("digit of {}", actuator(*of)),
            Self::Digits([a, b]) => format!("digit of {} with digit of {}", actuator(*a), actuator(*b)),
            Self::WordBefore(of) => format!("word before, at {}", actuator(*of)),
            Self::WordBeforeLast(of) => format!("word before the last, at {}", actuator(*of)),
            Self::Signals(names) => names.join(" with "),
            Self::RowBefore => "its own value a row before".into(),
            Self::Condition => "each condition by itself".into(),
        }
    }

    /// Whether it is of this actuator.
    pub fn is_of_actuator(&self, actuator: usize) -> bool {
        match self {
            Self::Digit(of) | Self::WordBefore(of) | Self::WordBeforeLast(of) => *of == actuator,
            Self::Digits(both) => both.contains(&actuator),
            _ => false,
        }
    }
}

impl fmt::Display for Regressor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name(|actuator| format!("actuator {actuator}")))
    }
}

/// How a residual depends on a variable c.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Linearly.
    Straight,
    /// With c².
    Square,
    /// With |c|.
    Size,
    /// With the sign of c.
    Sign,
    /// Along a smooth curve.
    Curve,
    /// Periodically, with this number of periods in the range of c.
    Periods(u8),
    /// Slowly up and down in time.
    Waves,
    /// By a step at some time.
    Step,
    /// With the product of two variables.
    Together,
    /// By another amount at each word.
    EachWord,
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Straight => "straight",
            Self::Square => "square",
            Self::Size => "size",
            Self::Sign => "sign",
            Self::Curve => "curve",
            Self::Periods(1) => "1 wave",
            Self::Periods(periods) => return write!(f, "{periods} waves"),
            Self::Waves => "waves",
            Self::Step => "step",
            Self::Together => "together",
            Self::EachWord => "each word by itself",
        })
    }
}

fn shape_name<S: Serializer>(shape: &Shape, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(shape)
}

/// The frame's name.
fn frame_name_of(frame: Frame) -> &'static str {
    match frame {
        Frame::Base => "base",
        Frame::Tool => "tool",
    }
}

fn frame_name<S: Serializer>(frame: &Option<Frame>, serializer: S) -> Result<S::Ok, S::Error> {
    frame.map(frame_name_of).serialize(serializer)
}
