//! Markers and force plates of one motion, read from a table.
//!
//! | column | holds |
//! | --- | --- |
//! | `t` | time, s |
//! | `MARKER_x`, `MARKER_y`, `MARKER_z` | place of a marker in the world, m; empty where nobody saw it |
//! | `Fz`, `Mx`, `My` (`_n`, `_nm`) | what all plates together exert on the person, about the world's origin |
//! | `floor_Fz` … `floor_My` | instead: the plate under the feet alone; `chair_` and `hands_` are added to it |
//! | `chair_Fz` … `chair_My` | the plate under the chair, which gives lift-off; next to `Fz` its force is enough |
//! | `hands_Fz` … `hands_My` | arm rests or whatever else hands push on |
//!
//! The world has z up and the ground at z = 0.

use std::path::Path;

use darm_core::real::Vec3;

use darm_measure::ReadError;
use darm_measure::table::{Names, Table};

/// A gap longer than this share of the frames cannot be bridged by the other frames.
const LONGEST_GAP: f64 = 0.5;
/// Markers that must be seen in every frame.
const FEWEST: usize = 3;

/// What the plates measured in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plate {
    /// Centre of pressure on the ground, x and y, m.
    pub cop: [f64; 2],
    /// Vertical force, N.
    pub force_n: f64,
}

/// A motion as cameras and plates saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// Names of the markers.
    pub names: Vec<String>,
    /// Time of each frame, s.
    pub time_s: Vec<f64>,
    /// Places frame by frame, in the order of the names; `None`: not seen.
    pub places: Vec<Vec<Option<Vec3<f64>>>>,
    /// All plates together, frame by frame.
    pub plates: Vec<Plate>,
    /// Vertical force of the chair's plate, frame by frame, N; `None`: it was not measured separately.
    pub chair_n: Option<Vec<f64>>,
    /// The same of what hands push on.
    pub hands_n: Option<Vec<f64>>,
    /// What the owner of the data should know.
    pub findings: Vec<String>,
}

/// Why a table is no motion.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The table cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A marker of the person is not in the table.
    #[error("no marker {marker} (columns {marker}_x, {marker}_y, {marker}_z); there are {present}")]
    NoMarker {
        /// The marker.
        marker: String,
        /// Those that there are.
        present: String,
    },
    /// A marker is missing for too long.
    #[error(
        "marker {marker} is missing in {missing} of {frames} frames, first in frame {frame}: leave it out or repair it"
    )]
    Missing {
        /// The marker.
        marker: String,
        /// In how many frames.
        missing: usize,
        /// Of how many.
        frames: usize,
        /// The first, from 1.
        frame: usize,
    },
    /// Too few markers in a frame.
    #[error("{seen} markers are seen in frame {frame}; give at least {FEWEST}, {missing} are missing")]
    TooFew {
        /// The frame, from 1.
        frame: usize,
        /// Its line.
        line: usize,
        /// How many are seen.
        seen: usize,
        /// Those that are not.
        missing: String,
    },
    /// The plates pull, or a value is not a number.
    #[error(
        "the plates' vertical force is {force_n} N in frame {frame}; give what the ground exerts on the person, z up"
    )]
    Pulls {
        /// The frame, from 1.
        frame: usize,
        /// Its line.
        line: usize,
        /// Fz, N.
        force_n: f64,
    },
    /// Too short.
    #[error("{frames} frame(s) are no motion: {MIN_FRAMES} at least, at even steps of time, are needed")]
    TooShort {
        /// Frames.
        frames: usize,
    },
    /// Time does not run.
    #[error("the time step before frame {frame} differs from the others; resample to even steps")]
    Time {
        /// The frame, from 1.
        frame: usize,
        /// Its line.
        line: usize,
    },
}

impl CaptureError {
    /// Line of the file, where the error is in one row.
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::TooFew { line, .. } | Self::Pulls { line, .. } | Self::Time { line, .. } => Some(*line),
            _ => None,
        }
    }
}

/// Frames below which there is no motion.
const MIN_FRAMES: usize = 10;

impl Capture {
    /// Reads the markers with these names, and the plates.
    ///
    /// # Errors
    ///
    /// The file is not a table; or as [`of`](Self::of).
    pub fn read(path: &Path, markers: &[String]) -> Result<Self, CaptureError> {
        let (table, findings) = Table::read(path, &Names::new())?;
        let mut capture = Self::of(&table, markers)?;
        capture.findings.splice(0..0, findings.iter().map(ToString::to_string));
        Ok(capture)
    }

    /// The same from a table.
    ///
    /// # Errors
    ///
    /// The column of time, a marker or a column of the plates is missing; time is uneven or too short; a marker is
    /// missing for too long, or too many in one frame; or the plates pull.
    pub fn of(table: &Table, markers: &[String]) -> Result<Self, CaptureError> {
        let time_s = table.required("time")?.numbers.clone();
        if time_s.len() < MIN_FRAMES {
            return Err(CaptureError::TooShort { frames: time_s.len() });
        }
        even(&time_s, &table.lines)?;
        let mut axes = Vec::new();
        for marker in markers {
            let of = |axis: &str| table.column(&format!("{marker}_{axis}"));
            let (Some(x), Some(y), Some(z)) = (of("x"), of("y"), of("z")) else {
                let names = table.columns.iter().filter_map(|column| column.name.strip_suffix("_x"));
                let present = names.collect::<Vec<_>>().join(", ");
                return Err(CaptureError::NoMarker { marker: marker.clone(), present });
            };
            axes.push([&x.numbers, &y.numbers, &z.numbers]);
        }
        let place = |frame: usize, axes: &[&Vec<f64>; 3]| {
            let place = Vec3::from_fn(|k, _| axes[k][frame]);
            place.iter().all(|x| x.is_finite()).then_some(place)
        };
        let places: Vec<Vec<_>> =
            (0..time_s.len()).map(|frame| axes.iter().map(|axes| place(frame, axes)).collect()).collect();
        let findings = seen(markers, &places, &table.lines)?;
        let plates = plates(table)?;
        let [chair_n, hands_n] = ["chair", "hands"].map(|plate| vertical(table, plate));
        let [chair_n, hands_n] = [chair_n?, hands_n?];
        Ok(Self { names: markers.to_vec(), time_s, places, plates, chair_n, hands_n, findings })
    }

    /// Time between two frames, s.
    pub fn step_s(&self) -> f64 {
        let frames = self.time_s.len();
        match (self.time_s.first(), self.time_s.last()) {
            (Some(first), Some(last)) if frames > 1 => (last - first) / (frames - 1) as f64,
            _ => 1.0,
        }
    }
}

/// Steps of time are even to a tenth.
fn even(time_s: &[f64], lines: &[usize]) -> Result<(), CaptureError> {
    let mean = (time_s[time_s.len() - 1] - time_s[0]) / (time_s.len() - 1) as f64;
    let off = |pair: &[f64]| (pair[1] - pair[0] - mean).abs();
    let uneven = |pair: &[f64]| mean <= 0.0 || off(pair).is_nan() || off(pair) > 0.1 * mean;
    match time_s.windows(2).position(uneven) {
        Some(frame) => Err(CaptureError::Time { frame: frame + 2, line: lines[frame + 1] }),
        None => Ok(()),
    }
}

/// Gaps: reported when they are short, refused when they are long.
fn seen(names: &[String], places: &[Vec<Option<Vec3<f64>>>], lines: &[usize]) -> Result<Vec<String>, CaptureError> {
    let mut findings = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let gaps: Vec<usize> = (0..places.len()).filter(|&frame| places[frame][k].is_none()).collect();
        let Some(first) = gaps.first() else { continue };
        if gaps.len() as f64 > LONGEST_GAP * places.len() as f64 {
            let (missing, frames) = (gaps.len(), places.len());
            return Err(CaptureError::Missing { marker: name.clone(), missing, frames, frame: first + 1 });
        }
        findings.push(format!(
            "marker {name} is missing in {} of {} frames, first in frame {} (line {}): the other markers lead there",
            gaps.len(),
            places.len(),
            first + 1,
            lines[*first]
        ));
    }
    for (frame, row) in places.iter().enumerate() {
        let seen = row.iter().flatten().count();
        if seen < FEWEST {
            let lost = names.iter().zip(row).filter(|(_, place)| place.is_none());
            let missing = lost.map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(CaptureError::TooFew { frame: frame + 1, line: lines[frame], seen, missing });
        }
    }
    Ok(findings)
}

/// The vertical force of one plate, where there are columns of it; every cell has to be a number.
fn vertical(table: &Table, plate: &str) -> Result<Option<Vec<f64>>, CaptureError> {
    let Some(column) = table.quantity(&format!("{plate}_fz")) else { return Ok(None) };
    match column.numbers.iter().position(|force| !force.is_finite()) {
        Some(frame) => {
            let force_n = column.numbers[frame];
            Err(CaptureError::Pulls { frame: frame + 1, line: table.lines[frame], force_n })
        }
        None => Ok(Some(column.numbers.clone())),
    }
}

/// A part of the wrench of all plates: as one column, or the sum of those of floor, chair and hands.
fn summed(table: &Table, part: &str) -> Result<Vec<f64>, CaptureError> {
    if table.quantity("floor_fz").is_none() {
        return Ok(table.required(part)?.numbers.clone());
    }
    let mut sum = table.required(&format!("floor_{part}"))?.numbers.clone();
    for plate in ["chair", "hands"].iter().filter(|plate| table.quantity(&format!("{plate}_fz")).is_some()) {
        let own = &table.required(&format!("{plate}_{part}"))?.numbers;
        sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
    }
    Ok(sum)
}

fn plates(table: &Table) -> Result<Vec<Plate>, CaptureError> {
    let (fz, mx, my) = (summed(table, "fz")?, summed(table, "mx")?, summed(table, "my")?);
    let plate = |frame: usize| {
        let force_n = fz[frame];
        let cop = [-my[frame] / force_n, mx[frame] / force_n];
        let presses = force_n > 0.0 && cop.iter().all(|x| x.is_finite());
        let pulls = || CaptureError::Pulls { frame: frame + 1, line: table.lines[frame], force_n };
        presses.then_some(Plate { cop, force_n }).ok_or_else(pulls)
    };
    (0..fz.len()).map(plate).collect()
}
