//! Measurements beside predictions: residuals in units of the noise, and how they change with a model's values.
//!
//! A residual is predicted minus measured on the group of motions: the twist log(`T_base_measured`⁻¹ · `T_base_predicted`),
//! in the measured tool frame. It does not depend on the choice of the base frame. Each axis is divided by the
//! noise of that axis, so a residual of an exact model has three (six) components of size 1.

use darm_core::chain::ChainError;
use darm_core::effect::End;
use darm_core::model::Condition;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::units::Word;

use darm_arm::arm::{Arm, ArmModel, ArmScratch, ZERO_CELSIUS};
use darm_measure::rigid_motion::robust_nearest_motion;
use darm_measure::{Run, Sample, median};

/// Components of a twist that a planar arm moves along.
const PLANAR: [usize; 3] = [2, 3, 4];
const SPATIAL: [usize; 6] = [0, 1, 2, 3, 4, 5];

/// A value of an effect in a model: the number of the effect and of the value.
pub type ValueIndex = (usize, usize);

/// One measured pose and what was commanded.
#[derive(Clone, Debug)]
pub struct PoseRow {
    /// Index of the sample in the run.
    pub sample: usize,
    /// Number of the word among the words of these observations: rows of one word stay together.
    pub group: usize,
    word: Word,
    previous: Option<Word>,
    servos: Vec<f64>,
    supply: f64,
    temperature_k: f64,
    /// Time since the run began, s.
    pub time_s: f64,
    switches: Vec<f64>,
    dwell_s: Vec<f64>,
    load_kg: f64,
    inverse: Pose<f64>,
}

/// Some rows of a run, and the noise that their residuals are scaled by.
#[derive(Clone, Debug)]
pub struct Observations {
    /// The rows.
    pub rows: Vec<PoseRow>,
    /// How many different words they have.
    pub n_groups: usize,
    /// The components of a twist that the arm moves along.
    pub axes: &'static [usize],
    /// The noise of each component of a twist, rad and m.
    pub sigma: [f64; 6],
    length_scale_m: f64,
}

/// The model has no pose for a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoPose {
    /// Index of the sample.
    pub sample: usize,
    /// Why.
    pub error: ChainError,
}

/// The components of a twist that an arm moves along, ω first.
pub fn axes(arm: &Arm) -> &'static [usize] {
    if arm.model.chain.is_planar() { &PLANAR } else { &SPATIAL }
}

impl Observations {
    /// The samples that count and that `choose` takes; `sigma` is the noise of each component of a twist.
    #[expect(clippy::missing_panics_doc, reason = "a word is searched among the words of the same samples")]
    pub fn new(arm: &Arm, run: &Run, sigma: [f64; 6], choose: impl Fn(&Sample) -> bool) -> Self {
        let choose = |&(index, s): &(usize, &Sample)| run.counts(index) && choose(s);
        let mut words: Vec<Word> = run.samples.iter().enumerate().filter(choose).map(|(_, s)| s.word).collect();
        words.sort();
        words.dedup();
        let start_s = run.start_s();
        let arrivals = arrivals(run);
        let histories = histories(arm, run);
        let mut rows = Vec::new();
        for ((sample, s), history) in run.samples.iter().enumerate().zip(histories).filter(|(of, _)| choose(of)) {
            rows.push(PoseRow {
                time_s: s.time_s - start_s,
                switches: history.switches,
                dwell_s: history.switched_s.iter().map(|switched_s| s.time_s - switched_s).collect(),
                load_kg: s.load_kg.unwrap_or(0.0),
                sample,
                group: words.binary_search(&s.word).expect("words has the word of every chosen sample"),
                word: s.word,
                previous: arrivals[sample],
                servos: s.servos_rad.clone(),
                supply: s.supply.unwrap_or(arm.model.nominal_supply),
                temperature_k: s.temperature_c.map_or(arm.model.reference_temperature_k, |c| c + ZERO_CELSIUS),
                inverse: s.pose.inverse(),
            });
        }
        Self { rows, n_groups: words.len(), axes: axes(arm), sigma, length_scale_m: arm.length_scale_m }
    }

    /// What had come to the arm in the last row; `None` without rows.
    pub fn end(&self) -> Option<End<'_, f64>> {
        let dwells = self.rows.iter().flat_map(|row| &row.dwell_s).copied().filter(|dwell_s| *dwell_s > 0.0);
        let dwell_s = median(dwells).unwrap_or(0.0);
        self.rows.last().map(|row| End { time_s: row.time_s, switches: &row.switches, dwell_s })
    }

    /// Time of each row since the run began, s.
    pub fn times_s(&self) -> impl Iterator<Item = f64> {
        self.rows.iter().map(|row| row.time_s)
    }

    /// Components of one residual.
    pub fn n_axes(&self) -> usize {
        self.axes.len()
    }

    /// The word of each row, as a number.
    pub fn groups(&self) -> Vec<usize> {
        self.rows.iter().map(|row| row.group).collect()
    }

    /// Scales the residuals by another noise.
    pub fn with_noise(mut self, sigma: [f64; 6]) -> Self {
        self.sigma = sigma;
        self
    }

    /// The components of the residual of one row, rad and m.
    pub fn components(&self, residuals: &[f64], row: usize) -> Vec<f64> {
        let n = self.axes.len();
        self.axes.iter().enumerate().map(|(k, &axis)| residuals[row * n + k] * self.sigma[axis]).collect()
    }

    /// The residuals of all rows, one after the other, in units of the noise.
    ///
    /// # Errors
    ///
    /// The model has no pose under the conditions of a row.
    pub fn residuals(&self, model: &ArmModel, scratch: &mut ArmScratch) -> Result<Vec<f64>, NoPose> {
        Ok(self.residuals_of(&self.predicted(model, scratch)?))
    }

    /// The residuals of all rows where the tool is predicted in these places.
    pub(crate) fn residuals_of(&self, predicted: &[Pose<f64>]) -> Vec<f64> {
        self.rows.iter().zip(predicted).flat_map(|(row, predicted)| self.residual(row, predicted)).collect()
    }

    /// Where the model has the tool in each row.
    ///
    /// # Errors
    ///
    /// The model has no pose under the conditions of a row.
    pub fn predicted(&self, model: &ArmModel, scratch: &mut ArmScratch) -> Result<Vec<Pose<f64>>, NoPose> {
        self.rows.iter().map(|row| self.predicted_row(row, model, scratch)).collect()
    }

    /// Where the model has the tool in one of the rows.
    ///
    /// # Errors
    ///
    /// The model has no pose under the conditions of the row.
    pub fn predicted_row(
        &self,
        row: &PoseRow,
        model: &ArmModel,
        scratch: &mut ArmScratch,
    ) -> Result<Pose<f64>, NoPose> {
        model.predict(&self.condition(row), scratch).map_err(|error| NoPose { sample: row.sample, error })
    }

    /// The motion that brings predicted poses nearest to the measured ones; blunders hardly count.
    pub(crate) fn nearest_motion(&self, predicted: &[Pose<f64>]) -> Pose<f64> {
        let measured = self.rows.iter().map(|row| row.inverse.inverse());
        let pairs: Vec<_> = predicted.iter().copied().zip(measured).collect();
        robust_nearest_motion(&pairs, self.length_scale_m)
    }

    /// The residual of one row, in units of the noise, when the tool is predicted there.
    pub fn residual(&self, row: &PoseRow, predicted: &Pose<f64>) -> impl Iterator<Item = f64> {
        let twist = (row.inverse * *predicted).log().to_vector();
        self.axes.iter().map(move |&axis| twist[axis] / self.sigma[axis])
    }

    /// Residuals, in units of the noise, in the directions of the base in place of those of the tool.
    pub fn in_base(&self, residuals: &[f64]) -> Vec<f64> {
        self.turned(residuals, |row, v| row.inverse.rotation.transpose() * v)
    }

    /// The way back from [`in_base`](Self::in_base).
    pub fn in_tool(&self, residuals: &[f64]) -> Vec<f64> {
        self.turned(residuals, |row, v| row.inverse.rotation * v)
    }

    fn turned(&self, residuals: &[f64], turn: impl Fn(&PoseRow, Vec3<f64>) -> Vec3<f64>) -> Vec<f64> {
        let rows = self.rows.iter().zip(residuals.chunks(self.axes.len()));
        rows.flat_map(|(row, parts)| self.turned_row(parts, |v| turn(row, v))).collect()
    }

    /// The residuals of one row, in units of the noise, with both vectors of its twist turned.
    fn turned_row(&self, parts: &[f64], turn: impl Fn(Vec3<f64>) -> Vec3<f64>) -> Vec<f64> {
        let mut twist = [0.0; 6];
        self.axes.iter().zip(parts).for_each(|(&axis, part)| twist[axis] = part * self.sigma[axis]);
        let [a, b, c, x, y, z] = twist;
        let (angular, linear) = (turn(Vec3::new(a, b, c)), turn(Vec3::new(x, y, z)));
        let twist = [angular.x, angular.y, angular.z, linear.x, linear.y, linear.z];
        self.axes.iter().map(|&axis| twist[axis] / self.sigma[axis]).collect()
    }

    /// The residual of each row as a distance d, m, from residuals in units of the noise.
    pub fn distances_m(&self, residuals: &[f64]) -> Vec<f64> {
        let size = |row: &[f64]| {
            let parts = row.iter().zip(self.axes).map(|(part, &axis)| {
                let part = part * self.sigma[axis];
                if axis < 3 { part * self.length_scale_m } else { part }
            });
            parts.map(|part| part * part).sum::<f64>().sqrt()
        };
        residuals.chunks(self.axes.len()).map(size).collect()
    }

    /// The root of the mean square of each component, rad and m.
    pub fn rms(&self, residuals: &[f64]) -> Vec<f64> {
        let n = self.axes.len();
        let of_axis = |(k, &axis): (usize, &usize)| {
            let squares: f64 = residuals.iter().skip(k).step_by(n).map(|r| r * r).sum();
            (squares / (residuals.len() / n).max(1) as f64).sqrt() * self.sigma[axis]
        };
        self.axes.iter().enumerate().map(of_axis).collect()
    }

    /// Word, the word that the arm came from, and conditions of a row.
    pub fn condition<'a>(&self, row: &'a PoseRow) -> Condition<'a, f64> {
        Condition {
            word: row.word,
            previous: row.previous,
            servos: &row.servos,
            supply: row.supply,
            temperature_k: row.temperature_k,
            time_s: Some(row.time_s),
            switches: &row.switches,
            dwell_s: &row.dwell_s,
            load_kg: row.load_kg,
        }
    }
}

/// What had come to each actuator of an arm in one sample.
#[derive(Clone, Debug, PartialEq)]
struct History {
    /// How often it had switched.
    switches: Vec<f64>,
    /// When the pose was taken of the sample that switched it last; of none, that of the first one.
    switched_s: Vec<f64>,
}

impl History {
    /// Adds a sample that follows `last` in the log.
    ///
    /// Where its word before is not that of `last`, rows between them are missing. What differs between the two switched
    /// in one of those: in the middle of the gap, as far as anyone knows.
    fn follow(&mut self, last: Option<&Sample>, sample: &Sample) {
        let last = last.filter(|last| last.run == sample.run);
        if last.is_some_and(|last| last.visit == sample.visit) {
            return;
        }
        let before = sample.previous.or(last.map(|last| last.word)).unwrap_or(sample.word);
        if let Some(last) = last {
            self.switch(last.word, before, f64::midpoint(last.time_s, sample.time_s));
        }
        self.switch(before, sample.word, sample.time_s);
    }

    fn switch(&mut self, from: Word, to: Word, time_s: f64) {
        for k in (0..self.switches.len()).filter(|&k| from.digit(k) != to.digit(k)) {
            self.switches[k] += 1.0;
            self.switched_s[k] = time_s;
        }
    }
}

/// The word that the arm came from in each sample: where nothing moves since the sample before, it is where it has come to from
/// that one's word before.
fn arrivals(run: &Run) -> Vec<Option<Word>> {
    let mut last: Option<(&Sample, Option<Word>)> = None;
    let after = |sample| {
        let stays = last.filter(|(last, _)| is_same_rest(last, sample));
        let arrival = stays.map_or(sample.previous, |(_, arrival)| arrival);
        last = Some((sample, arrival));
        arrival
    };
    run.samples.iter().map(after).collect()
}

/// Whether the arm has not moved between two samples that follow each other.
fn is_same_rest(last: &Sample, sample: &Sample) -> bool {
    let stays = sample.previous.is_none_or(|previous| previous == sample.word);
    stays && last.run == sample.run && last.word == sample.word && last.servos_rad == sample.servos_rad
}

/// That of each sample of a run.
fn histories(arm: &Arm, run: &Run) -> Vec<History> {
    let n = arm.n_actuators();
    let mut history = History { switches: vec![0.0; n], switched_s: vec![run.start_s(); n] };
    let mut last = None;
    let after = |sample| {
        history.follow(last, sample);
        last = Some(sample);
        history.clone()
    };
    run.samples.iter().map(after).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use darm_measure::poses::{self, Which};

    fn row(visit: u32, previous: &str, word: &str) -> String {
        format!("{}.0,{visit},{word},{previous},0.1,0.2,3\n", 4 * visit)
    }

    fn run(rows: &[String]) -> Run {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        std::fs::write(&path, format!("time_s,visit,word,previous,x_m,y_m,angle_deg\n{}", rows.concat())).unwrap();
        poses::read(&path, &Default::default(), &Which::default()).unwrap().0
    }

    /// After the last of these rows.
    fn history(rows: &[String]) -> History {
        let text = include_str!("../../../../examples/planar4.toml");
        let arm = Arm::parse(Path::new("planar4.toml"), text).unwrap();
        histories(&arm, &run(rows)).pop().unwrap()
    }

    #[test]
    fn an_arm_that_keeps_its_word_stays_as_it_has_come() {
        let [rest, a, b] = ["000000000000", "100000000000", "110000000000"];
        let rows =
            [row(0, rest, a), row(1, a, a), row(2, a, a), row(3, a, b), row(4, b, b), row(5, a, b), row(6, a, a)];
        let word = |text: &str| Some(text.parse().unwrap());
        // The last row but one was left and come back to, the last one is after a row that is missing.
        assert_eq!(arrivals(&run(&rows)), [rest, rest, rest, a, a, a, a].map(word));
    }

    #[test]
    fn a_switch_in_a_missing_row_is_counted_and_dated_within_the_gap() {
        let mut rows = vec![
            row(0, "000000000000", "000000000000"),
            row(1, "000000000000", "100000000000"),
            row(2, "100000000000", "110000000000"),
            row(3, "110000000000", "010000000000"),
        ];
        let whole = history(&rows);
        assert_eq!((&whole.switches[..3], &whole.switched_s[..3]), (&[2.0, 1.0, 0.0][..], &[12.0, 8.0, 0.0][..]));
        rows.remove(2);
        assert_eq!(history(&rows), whole, "the missing row is in the middle of the gap");
    }

    #[test]
    fn rows_of_one_visit_count_one_switch() {
        let row = row(1, "000000000000", "100000000000");
        assert_eq!(history(&[row.clone(), row]).switches[0], 1.0);
    }
}
