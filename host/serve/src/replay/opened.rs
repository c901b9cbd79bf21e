//! A recording that was opened: its rows, and where the model has the tool in each.
//!
//! The prediction is that of the diagnosis: under the word before, supply, temperature and load of the row, and with what came to the arm
//! since the recording began, as far as the model has effects of it.

use std::collections::BTreeMap;
use std::path::Path;

use darm_arm::arm::{Arm, ArmScratch};
use darm_diagnose::prepare::observations::Observations;
use darm_measure::origin::Origin;
use darm_measure::poses::{self, Which};
use darm_measure::table::Names;
use darm_measure::{ReadError, Run, about};
use darm_robot::files::{Files, Limits};
use serde::Serialize;
use serde_json::Value;

use super::curves::{Curve, curves};
use crate::history::Played;
use crate::job_queue::Work;
use crate::measured::Residual;
use crate::refusal::{Kind, Refused};
use crate::samples::Series;

/// Notes on rows and columns that are shown.
const MAX_NOTES: usize = 8;
/// Rows after which a page that has left is noticed.
const ROWS_BETWEEN_CHECKS: usize = 4096;

/// A recording as it was when it was read.
pub(super) struct Opened {
    pub(super) name: String,
    /// Bytes of the file.
    pub(super) n_bytes: usize,
    /// Its rows, in the order of their times.
    pub(super) run: Run,
    /// The same with what came to the arm; `None` where the server has no arm that they are of.
    pub(super) observations: Option<Observations>,
    pub(super) is_planar: bool,
    about: BTreeMap<String, String>,
    /// Why there is no prediction.
    problem: Option<String>,
    notes: Vec<String>,
    curves: Vec<Curve>,
}

/// What a page gets before the numbers.
#[derive(Serialize)]
struct Head<'a> {
    name: &'a str,
    bytes: usize,
    rows: usize,
    is_planar: bool,
    /// Why there is no prediction.
    problem: Option<&'a str>,
    notes: &'a [String],
    series: Vec<&'a Series>,
    /// What the history has of the board at that time, in order of time.
    events: &'a [Value],
}

impl Opened {
    /// Reads a recording and predicts each of its rows.
    pub(super) fn read(name: &str, bytes: Vec<u8>, arm: Option<&Arm>, work: &Work) -> Result<Self, Refused> {
        let n_bytes = bytes.len();
        let files = Files::handed([(name.to_owned(), bytes)], Limits::SERVER);
        let data = files.file(Path::new(name));
        let refused = |error: ReadError| Refused::new(Kind::Invalid, sentence(name, &error));
        let about = about(&data).map_err(refused)?;
        work.check()?;
        let (mut run, findings) = poses::read(&data, &Names::new(), &Which::default()).map_err(refused)?;
        work.check()?;
        if run.samples.is_empty() {
            return Err(Refused::new(Kind::Invalid, no_rows(name)));
        }
        let mut notes: Vec<String> = findings.iter().take(MAX_NOTES).map(ToString::to_string).collect();
        if !run.samples.is_sorted_by(|a, b| a.time_s <= b.time_s) {
            sort_by_time(&mut run);
            notes.push("the times run back: the rows are shown in the order of their times".to_owned());
        }
        let origin = Origin::find(&about);
        let other = |arm: &Arm| origin.filter(|origin| !origin.fits(arm)).and_then(|origin| origin.finding(arm));
        let problem = match arm {
            None => Some("the server has no arm; start it with one: `darm serve arm.toml`".to_owned()),
            Some(arm) => other(arm).map(|finding| finding.text),
        };
        let fitting = arm.filter(|_| problem.is_none());
        if let Some(finding) = fitting.zip(origin).and_then(|(arm, origin)| origin.finding(arm)) {
            notes.push(finding.text);
        }
        let observations = fitting.map(|arm| Observations::new(arm, &run, [1.0; 6], |_| true));
        let residuals = match fitting.zip(observations.as_ref()) {
            Some((arm, observations)) => residuals(arm, &run, observations, work)?,
            None => vec![None; run.samples.len()],
        };
        let is_planar = arm.map_or_else(
            || run.samples.iter().all(|sample| sample.pose.is_planar()),
            |arm| arm.model.chain.is_planar(),
        );
        let curves = curves(&run.samples, &residuals, is_planar);
        Ok(Self { name: name.to_owned(), n_bytes, run, observations, is_planar, about, problem, notes, curves })
    }

    /// Which program of which board was recorded; `None` where the file does not say it.
    pub(super) fn played(&self) -> Option<Played<'_>> {
        let about = |key: &str| self.about.get(key).map(String::as_str);
        let [first, last] = [self.run.samples.first()?, self.run.samples.last()?].map(|sample| sample.time_s);
        Some(Played {
            device: about("board")?,
            boots: about("boot")?.parse().ok()?,
            table: about("table")?,
            from_s: about("program_start_s").and_then(|text| text.parse().ok()).unwrap_or(first),
            to_s: last,
        })
    }

    /// The answer to a page that opens it.
    pub(super) fn body(&self, events: &[Value]) -> serde_json::Result<Vec<u8>> {
        let head = Head {
            name: &self.name,
            bytes: self.n_bytes,
            rows: self.run.samples.len(),
            is_planar: self.is_planar,
            problem: self.problem.as_deref(),
            notes: &self.notes,
            series: self.curves.iter().map(|curve| &curve.series).collect(),
            events,
        };
        let mut body = serde_json::to_vec(&head)?;
        body.push(b'\n');
        body.extend(self.run.samples.iter().flat_map(|sample| sample.time_s.to_le_bytes()));
        self.curves.iter().for_each(|curve| body.extend(curve.values.iter().flat_map(|value| value.to_le_bytes())));
        Ok(body)
    }
}

/// Rows whose times run back, in the order of their times.
fn sort_by_time(run: &mut Run) {
    let mut rows: Vec<_> = std::mem::take(&mut run.samples).into_iter().zip(std::mem::take(&mut run.lines)).collect();
    rows.sort_by(|(a, _), (b, _)| a.time_s.total_cmp(&b.time_s));
    (run.samples, run.lines) = rows.into_iter().unzip();
}

/// That of each row; `None` where the model has no pose for it.
fn residuals(arm: &Arm, run: &Run, observations: &Observations, work: &Work) -> Result<Vec<Option<Residual>>, Refused> {
    let mut scratch = ArmScratch::default();
    let mut all = Vec::with_capacity(run.samples.len());
    for (index, (row, sample)) in observations.rows.iter().zip(&run.samples).enumerate() {
        if index % ROWS_BETWEEN_CHECKS == 0 {
            work.check()?;
        }
        let predicted = observations.predicted_row(row, &arm.model, &mut scratch).ok();
        all.push(predicted.map(|predicted| Residual::of(&predicted, &sample.pose)));
    }
    Ok(all)
}

fn no_rows(name: &str) -> String {
    format!("{name} has no complete row yet; open it again when the first visit has ended")
}

/// Why a file cannot be replayed, without what the command line would do.
fn sentence(name: &str, error: &ReadError) -> String {
    match error {
        ReadError::Empty { .. } => no_rows(name),
        ReadError::NoQuantity { column, .. } => {
            format!(
                "{name} has no column {column}: only recordings of tool poses are replayed, as `darm record` writes them"
            )
        }
        error => error.to_string(),
    }
}
