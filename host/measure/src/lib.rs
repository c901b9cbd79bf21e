//! Measurements: where the tool stood in each visit of a word, under what conditions; read from and written to CSV, and
//! logs in MCAP ([`log`]).
//!
//! # Columns
//!
//! The header names quantity and unit; other units of the same kind serve as well, as `x_mm` or `angle_rad` (see
//! [`table`]), and a column of another name can be given one of these. Columns may stand in any order; a file that ends in
//! `.gz` is compressed, one that ends in `.mcap` has the same columns as keys of its messages.
//!
//! | column | meaning |
//! | --- | --- |
//! | `time_s` | when the pose was taken, on the board's clock |
//! | `word` | digits of all discrete actuators, base first |
//! | `previous` ? | the word before; without this column that of the row before in the same run; empty: not known |
//! | `servo0_deg`, `servo1_deg`, … | positions of the servo joints, as many as the arm has |
//! | `x_m`, `y_m`, `angle_deg` | pose of the tool in the base, of a planar arm |
//! | `x_m`, `y_m`, `z_m`, `rx_deg`, `ry_deg`, `rz_deg` | the same of any arm, with a rotation vector |
//! | `supply_bar`, `temperature_c` ? | supply and temperature of the arm |
//! | `load_kg` ? | what the tool carries in addition to the payload of the model, at its centre of mass |
//! | `run` ?, `visit` ? | number of the run and of the visit; without them 0 and the row's number |
//! | `held_out` ? | 1 where no fit may see the row, 0 elsewhere |
//!
//! Columns marked `?` may be missing, other columns are not read, with a note.
//!
//! # Comment lines
//!
//! Lines `# key value` before the table, in MCAP the metadata record `about`. `darm record` writes:
//!
//! | key | value |
//! | --- | --- |
//! | `model`, `geometry` | hash of the arm file that the table was made from; of the same without its effects (see [`origin`]) |
//! | `table`, `profile` | SHA-256 of the table and of the profile of the board; zeros for the built-in profile |
//! | `board`, `boot` | number of the device; how often it had started |
//! | `program_start_s` | when the program started, on the board's clock |
//! | `clock_…` | offset and rate of the board's clock with their uncertainties |

mod check;
pub mod column;
pub mod condition;
mod csv;
pub mod csv_text;
mod error;
pub mod even_grid;
mod finding;
pub mod foreign;
pub mod hold_out;
pub mod import;
pub mod log;
pub mod mcap;
pub mod origin;
pub mod poses;
pub mod rigid_motion;
pub mod select;
pub mod signal;
mod stream;
pub mod table;
pub mod unit;
pub mod visit_table;
pub mod visits;

use darm_arm::arm::{Arm, ZERO_CELSIUS};
use darm_core::se::Pose;
use darm_core::units::Word;

pub use check::check;
pub use column::Column;
pub use csv::{about, write, write_table, write_text};
pub use error::{ReadError, SelectError};
pub use finding::{Finding, FindingKind, Severity};
pub use stream::Stream;

/// The pose of the tool in one visit of a word.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// When the pose was taken, on the board's clock.
    pub time_s: f64,
    /// The digits of all discrete actuators.
    pub word: Word,
    /// The word before; `None` where it is not known.
    pub previous: Option<Word>,
    /// Positions of the servo joints.
    pub servos_rad: Vec<f64>,
    /// Measured pose of the tool in the base.
    pub pose: Pose<f64>,
    /// Supply, Pa; `None` where it was not measured.
    pub supply: Option<f64>,
    /// Temperature of the arm, °C; `None` where it was not measured.
    pub temperature_c: Option<f64>,
    /// What the tool carries in addition to the payload of the model, kg; `None` where the log does not say.
    pub load_kg: Option<f64>,
    /// Time of each actuator's stroke on the way, from its row to the change of its limit switch, s; `None` where it did not move
    /// or no switch showed it. Empty where the log has none.
    pub strokes_s: Vec<Option<f64>>,
    /// Number of the run.
    pub run: u32,
    /// Number of the visit.
    pub visit: u32,
    /// Whether no fit may see this sample.
    pub held_out: bool,
}

/// The samples of one measurement, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// The samples.
    pub samples: Vec<Sample>,
    /// The line of the file that each sample stood in, the header being 1; empty when they come from no file.
    pub lines: Vec<usize>,
    /// Which of them count.
    pub choice: Choice,
    /// Whether the columns of the orientation are in degrees; `None` where they come from no file.
    pub angles_in_degrees: Option<bool>,
}

/// Which samples of a run count, and how those that no fit sees are chosen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// Samples that only say what came before; empty where there are none.
    pub unused: Vec<bool>,
    /// The part that each sample is left out with in turn, where nothing is held out for good; `None`: words by seed.
    pub parts: Option<Vec<usize>>,
    /// How those were chosen that are held out, in words; empty where nothing was said.
    pub description: String,
}

impl Choice {
    /// The part of each sample where these are few enough to be left out one at a time.
    pub fn parts_in_turn(&self) -> Option<&[usize]> {
        self.parts.as_deref().filter(|parts| hold_out::are_few(parts))
    }
}

impl Run {
    /// Whether a sample is fitted or judged, not only what came before.
    pub fn counts(&self, sample: usize) -> bool {
        !self.choice.unused.get(sample).is_some_and(|unused| *unused)
    }

    /// The line of the file that has a sample, or will have it when it is written.
    pub fn line(&self, sample: usize) -> usize {
        self.lines.get(sample).copied().unwrap_or(sample + 2)
    }

    /// The samples that a fit may see, with their indices.
    pub fn training(&self) -> impl Iterator<Item = (usize, &Sample)> {
        self.samples.iter().enumerate().filter(|(index, sample)| !sample.held_out && self.counts(*index))
    }

    /// When the first sample was taken, s.
    pub fn start_s(&self) -> f64 {
        self.samples.iter().map(|sample| sample.time_s).reduce(f64::min).unwrap_or_default()
    }

    /// The median supply and temperature (°C) of the last fifth of the samples: the conditions that the arm has
    /// settled to. `None` where they were not measured.
    pub fn settled(&self) -> (Option<f64>, Option<f64>) {
        let last = &self.samples[self.samples.len() - self.samples.len().div_ceil(5)..];
        (median(last.iter().filter_map(|s| s.supply)), median(last.iter().filter_map(|s| s.temperature_c)))
    }

    /// The same, the temperature in K; those of the model where they were not measured.
    pub fn settled_or_nominal(&self, arm: &Arm) -> (f64, f64) {
        let (supply, temperature_c) = self.settled();
        let temperature_k = temperature_c.map_or(arm.model.reference_temperature_k, |celsius| celsius + ZERO_CELSIUS);
        (supply.unwrap_or(arm.model.nominal_supply), temperature_k)
    }
}

/// The middle one of some numbers; `None` without any.
pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let (low, high) = ((values.len() - 1) / 2, values.len() / 2);
    Some((values[low] + values[high]) / 2.0)
}

/// A channel less its mean.
pub fn demean(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|value| value - mean).collect()
}

/// Sizes without the largest hundredth of them, at least one.
pub fn without_farthest(mut sizes: Vec<f64>) -> Vec<f64> {
    sizes.sort_unstable_by(f64::total_cmp);
    sizes.truncate(sizes.len().saturating_sub(sizes.len().div_ceil(100)));
    sizes
}

/// √(mean of squares).
pub fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Share of the numbers, the largest, that do not count.
const TRIMMED: f64 = 0.1;

/// Root mean square without the largest.
pub fn trimmed_root_mean_square(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
    numbers.truncate(numbers.len() - (numbers.len() as f64 * TRIMMED) as usize);
    root_mean_square(&numbers)
}
