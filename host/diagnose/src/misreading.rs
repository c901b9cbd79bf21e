//! Ways in which a model or a log can be read wrongly.

use std::fmt;

use serde::Serialize;

/// Columns that are listed by name.
const MAX_NAMES: usize = 4;

/// One way.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "misreading", rename_all = "kebab-case")]
pub enum Misreading {
    /// Rows have the words of rows that are `rows` later; earlier where it is negative.
    ShiftedWords {
        /// Rows.
        rows: isize,
    },
    /// Rows have digits of the row or word after; before where it is negative.
    ShiftedDigits {
        /// Numbers of the actuators, from 0; empty: all.
        actuators: Vec<usize>,
        /// What they are shifted by.
        by: LabelStep,
        /// How many.
        later: isize,
    },
    /// One row of words is missing, or one too many, from this line on.
    WordsOutOfStep {
        /// The first line with the word of another row.
        line: usize,
        /// Rows by which the words are later from there on.
        rows: isize,
    },
    /// 0 is written as 1 and 1 as 0, at every actuator.
    InvertedDigits,
    /// Digits are in the order from the tool to the base.
    ReversedDigits,
    /// Actuators are wired in another order: each digit of the log is of the actuator of the model with the number in its
    /// place.
    ExchangedActuators {
        /// Numbers of the model's actuators, from 0.
        order: Vec<usize>,
    },
    /// One actuator does the contrary of its digit.
    InvertedActuator {
        /// Its number, from 0.
        actuator: usize,
    },
    /// Two axes of the measured positions are exchanged.
    ExchangedAxes {
        /// Their names.
        axes: [char; 2],
    },
    /// An axis of the measured positions has the other sign.
    MirroredAxis {
        /// Its name.
        axis: char,
    },
    /// The frame of the poses is left-handed: one axis of the positions has the other sign, and so have the turns about both others.
    LeftHanded {
        /// Its name.
        axis: char,
    },
    /// Measured angles have the other sign.
    InvertedAngles,
    /// The angles of the poses are radians, and read as degrees.
    AnglesInRadians,
    /// Temperatures are in degrees Fahrenheit, and read as °C.
    Fahrenheit,
    /// The pose of the base in the tool was measured, not that of the tool in the base.
    InvertedPoses,
    /// Lengths are in another unit, or the model is of another size.
    LengthScale {
        /// What the log's lengths are to be divided by.
        factor: f64,
    },
    /// Two columns, or two groups of columns, are exchanged.
    ExchangedColumns {
        /// Their names.
        columns: [String; 2],
    },
    /// Columns have the other sign.
    InvertedColumns {
        /// Their names.
        columns: Vec<String>,
    },
    /// Columns are in another unit.
    ColumnScale {
        /// Their names.
        columns: Vec<String>,
        /// What they are to be divided by.
        factor: f64,
    },
    /// The columns qx, qy, qz and qw hold other parts of the quaternion.
    Quaternion {
        /// Which.
        hold: [char; 4],
        /// Whether it is that of the inverse turn.
        inverse: bool,
    },
    /// A joint counts from another zero.
    OtherZero {
        /// Its column.
        column: String,
        /// What is to be taken from the column, rad or m.
        zero: f64,
    },
    /// Measured columns are late against the commanded or moving ones; early where it is negative.
    Delay {
        /// By how much, s.
        delay_s: f64,
    },
    /// The robot is mounted in another way than its model says.
    Mounting {
        /// Direction of free fall in the base, of length 1.
        down: [f64; 3],
    },
}

/// What labels of rows are late by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LabelStep {
    /// A row of the log.
    Row,
    /// A word, of one row or more.
    Word,
}

impl fmt::Display for Misreading {
    /// What would have to be so, as a clause: `two actuators are exchanged: …`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = |columns: &[String]| match columns {
            [first, .., last] if columns.len() > MAX_NAMES => format!("each of {first} to {last}"),
            _ => columns.join(", "),
        };
        match self {
            Self::ShiftedWords { rows } => write!(f, "each pose belongs to the word {}", away(*rows)),
            Self::WordsOutOfStep { line, rows } => {
                write!(f, "from line {line} on each pose belongs to the word {}", away(*rows))
            }
            Self::ShiftedDigits { actuators, by, later } => {
                let digits: Vec<String> = actuators.iter().map(usize::to_string).collect();
                let digits = match &digits[..] {
                    [] => "the word".into(),
                    [one] => format!("digit {one}"),
                    some => format!("digits {}", some.join(", ")),
                };
                let by = match by {
                    LabelStep::Row => "row",
                    LabelStep::Word => "word",
                };
                let side = if *later > 0 { "after" } else { "before" };
                write!(f, "each pose belongs to {digits} of the {by} {side}")
            }
            Self::InvertedDigits => write!(f, "digit 0 is written as 1 and 1 as 0"),
            Self::ReversedDigits => write!(f, "the digits of the words are in the order from the tool to the base"),
            Self::ExchangedActuators { order } => {
                let moved = order.iter().enumerate().filter(|(k, of)| k != *of);
                let pairs: Vec<String> = moved.map(|(k, of)| format!("digit {k} moves actuator {of}")).collect();
                write!(f, "actuators are wired or numbered in another order: {}", pairs.join(", "))
            }
            Self::InvertedActuator { actuator } => {
                write!(f, "actuator {actuator} moves to 0 where its digit is 1, and to 1 where it is 0")
            }
            Self::ExchangedAxes { axes: [a, b] } => write!(f, "{a} and {b} of the positions are exchanged"),
            Self::MirroredAxis { axis } => write!(f, "{axis} of the positions has the other sign"),
            Self::LeftHanded { axis } => {
                write!(f, "the frame of the poses is left-handed: {axis} has the other sign, in the turns too")
            }
            Self::InvertedAngles => write!(f, "the angles have the other sign"),
            Self::Fahrenheit => write!(f, "the temperatures are in degrees Fahrenheit (°C are (x - 32) / 1.8)"),
            Self::AnglesInRadians => write!(f, "the angles of the poses are in rad, and read as deg"),
            Self::InvertedPoses => write!(f, "the poses are those of the base in the tool"),
            Self::LengthScale { factor } => {
                write!(f, "the lengths of the log are {} times those of the model", rounded(*factor))
            }
            Self::ExchangedColumns { columns: [a, b] } => write!(f, "{a} and {b} are exchanged"),
            Self::InvertedColumns { columns } => write!(f, "{} has the other sign", names(columns)),
            Self::ColumnScale { columns, factor } if *factor < 1.0 => {
                write!(f, "{} is {} times too small", names(columns), rounded(1.0 / factor))
            }
            Self::ColumnScale { columns, factor } => {
                write!(f, "{} is {} times too large", names(columns), rounded(*factor))
            }
            Self::Quaternion { hold, inverse } => {
                let [a, b, c, d] = hold;
                match hold[0] {
                    'x' => write!(f, "the quaternion is that of the inverse turn")?,
                    _ => write!(f, "qx, qy, qz and qw hold {a}, {b}, {c} and {d} of the quaternion")?,
                }
                if *inverse && hold[0] != 'x' { write!(f, " of the inverse turn") } else { Ok(()) }
            }
            Self::OtherZero { column, zero } => {
                write!(f, "{column} counts from a zero that is {:.0} deg away", zero.to_degrees())
            }
            Self::Delay { delay_s } if *delay_s < 0.0 => {
                write!(f, "what was measured is {} s early", rounded(-delay_s))
            }
            Self::Delay { delay_s } => write!(f, "what was measured is {} s late", rounded(*delay_s)),
            Self::Mounting { down: [x, y, z] } => {
                write!(f, "the robot is mounted so that free fall is along ({x:.0}, {y:.0}, {z:.0}) of its base")
            }
        }
    }
}

/// Where a word is that is `rows` later.
fn away(rows: isize) -> String {
    match rows {
        1 => "of the row after".into(),
        -1 => "of the row before".into(),
        _ if rows > 0 => format!("{rows} rows after it"),
        _ => format!("{} rows before it", -rows),
    }
}

/// Two digits, of large numbers all.
fn rounded(number: f64) -> String {
    let places = (1.0 - number.abs().max(1e-12).log10().floor()).max(0.0) as usize;
    format!("{number:.places$}")
}
