//! Whether tool poses agree with the arm's model, read as they are or in another way.
//!
//! Errors are distances d between predicted and measured poses after the best rigid motion of the measured ones (W. Kabsch,
//! Acta Cryst. A32 (1976) 922), since where the camera's base is says nothing about words; without the farthest tenth.

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp, rotation_log};
use darm_core::units::Word;

use super::{Agreement, FEW, MIN_EXPLAINED, trimmed_root_mean_square};
use crate::misreading::{LabelStep, Misreading};
use crate::outcome::{Number, OtherReading};
use crate::prepare::thinning::one_of_each_part;
use crate::progress::{Cancelled, Progress};
use darm_measure::rigid_motion::{distances_after, nearest_rotation, robust_nearest_motion};
use darm_measure::{Run, median};

/// A model whose error is below this share of the motion belongs to its log.
const NEAR: f64 = 0.03;
/// An error that is less than this share of that of the log as it is read shows another reading.
const MUCH_LESS: f64 = 0.25;
/// Lengths of model and log that differ by more than this share are of two arms or in two units; less is a camera's scale.
const OTHER_SIZE: f64 = 0.25;
/// Rows that readings are compared on.
const ROWS: usize = 64;
/// How many times too large the lengths in a column of another unit are, of m, cm, mm and inches; or too small.
const LENGTH_UNITS: [f64; 6] = [1000.0, 100.0, 10.0, 39.37, 25.4, 2.54];
/// Names of the axes of a position.
const AXES: [char; 3] = ['x', 'y', 'z'];
/// Actuators up to which all orders near the present one are tried.
const MAX_ORDERED: usize = 24;

/// The rows of a log, read in one way.
#[derive(Clone)]
struct ReadRows {
    words: Vec<Word>,
    poses: Vec<Pose<f64>>,
}

impl ReadRows {
    /// With other poses.
    fn with(&self, change: impl Fn(&Pose<f64>) -> Pose<f64>) -> Self {
        Self { words: self.words.clone(), poses: self.poses.iter().map(change).collect() }
    }

    /// With other positions.
    fn moved(&self, change: impl Fn(&mut Vec3<f64>)) -> Self {
        self.with(|pose| {
            let mut pose = *pose;
            change(&mut pose.position);
            pose
        })
    }
}

/// The arm, and what was commanded besides words.
struct Comparison<'a> {
    arm: &'a Arm,
    servos: Vec<&'a [f64]>,
    /// Numbers of the rows that are compared.
    rows: Vec<usize>,
    progress: &'a Progress,
}

/// How a run agrees with its arm, by the rows that fits see; words may be those of any row of the log.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn agreement(arm: &Arm, run: &Run, progress: &Progress) -> Result<Agreement, Cancelled> {
    let samples = &run.samples;
    let as_read = ReadRows {
        words: samples.iter().map(|sample| sample.word).collect(),
        poses: samples.iter().map(|sample| sample.pose).collect(),
    };
    let training: Vec<usize> = run.training().map(|(row, _)| row).collect();
    let rows = one_of_each_part(training.len(), ROWS).into_iter().map(|drawn| training[drawn]).collect();
    let servos = samples.iter().map(|sample| &sample.servos_rad[..]).collect();
    let comparison = Comparison { arm, servos, rows, progress };
    let Some(error_m) = comparison.error_m(&as_read) else { return Ok(Agreement::AsRead) };
    let poses: Vec<Pose<f64>> = training.iter().map(|&row| as_read.poses[row]).collect();
    let motion_m = motion_m(arm, &poses);
    if error_m < NEAR * motion_m {
        return Ok(Agreement::AsRead);
    }
    let is_much_less = |(_, other_m): &(Misreading, f64)| *other_m < MUCH_LESS * error_m;
    let mut best = comparison.best(&as_read, run, &training)?.filter(is_much_less);
    if best.is_none() {
        // Where no word is measured twice in turn, a word later is a row later.
        best = comparison.best_by_word(&as_read)?.filter(is_much_less);
    }
    Ok(match best {
        Some((misreading, other_m)) => {
            Agreement::Otherwise(OtherReading { misreading, as_read: None, error: Number::new(other_m, "m") })
        }
        None if 1.0 - (error_m / motion_m).powi(2) < MIN_EXPLAINED => Agreement::Hardly(FEW),
        None => Agreement::AsRead,
    })
}

/// Share of the variance of the poses of a run that a model with these errors, m, explains.
pub(crate) fn explained(arm: &Arm, run: &Run, errors_m: Vec<f64>) -> f64 {
    let poses: Vec<Pose<f64>> = run.training().map(|(_, sample)| sample.pose).collect();
    1.0 - (trimmed_root_mean_square(errors_m) / motion_m(arm, &poses)).powi(2)
}

impl Comparison<'_> {
    /// The reading with the smallest error, m.
    fn best(&self, as_read: &ReadRows, run: &Run, training: &[usize]) -> Result<Option<(Misreading, f64)>, Cancelled> {
        let mut all: Vec<(Misreading, ReadRows)> = self.of_poses(as_read);
        all.extend(self.of_words(as_read));
        let mut tried: Vec<(Misreading, f64)> = self.judged(all)?;
        self.progress.check()?;
        tried.extend(self.out_of_step(as_read, run, training));
        self.progress.check()?;
        tried.extend(self.other_size(as_read));
        tried.extend(self.of_units(as_read)?);
        if self.arm.n_actuators() <= MAX_ORDERED {
            tried.extend(self.other_order(as_read)?);
        }
        Ok(tried.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)))
    }

    /// The reading of late or early digits by words with the smallest error, m.
    fn best_by_word(&self, as_read: &ReadRows) -> Result<Option<(Misreading, f64)>, Cancelled> {
        let judged = self.judged(self.late_digits(as_read, LabelStep::Word))?;
        Ok(judged.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)))
    }

    /// Readings of the words, the poses as they are.
    fn of_words(&self, as_read: &ReadRows) -> Vec<(Misreading, ReadRows)> {
        let with = |words: Vec<Word>| ReadRows { words, poses: as_read.poses.clone() };
        let n = self.arm.n_actuators();
        let shifted =
            [1, -1, 2, -2].map(|rows| (Misreading::ShiftedWords { rows }, with(shifted(&as_read.words, 0, rows))));
        let inverted = |of: Option<usize>| {
            let words = as_read.words.iter().map(|word| self.inverted(word, of));
            words.collect::<Option<Vec<Word>>>().map(with)
        };
        let reversed = as_read.words.iter().map(|word| word_of((0..n).rev().map(|k| word.digit(k))));
        let all = inverted(None).map(|reading| (Misreading::InvertedDigits, reading));
        let each = (0..n).filter_map(|k| Some((Misreading::InvertedActuator { actuator: k }, inverted(Some(k))?)));
        let reversed = reversed.collect::<Option<Vec<Word>>>().map(|words| (Misreading::ReversedDigits, with(words)));
        shifted
            .into_iter()
            .chain(self.late_digits(as_read, LabelStep::Row))
            .chain(all)
            .chain(each)
            .chain(reversed)
            .collect()
    }

    /// Readings in which the digits of one module, of one actuator or of all are a row or a word late or early, as those are that a module
    /// delivers over a separate bus.
    fn late_digits(&self, as_read: &ReadRows, by: LabelStep) -> Vec<(Misreading, ReadRows)> {
        let n = self.arm.n_actuators();
        let stage_of: Vec<usize> = self.arm.model.chain.actuators().map(|(stage, _)| stage).collect();
        let mut parts: Vec<Vec<usize>> = (0..n).map(|k| vec![k]).collect();
        parts.extend(stage_of.chunk_by(|a, b| a == b).scan(0, |first, stage| {
            *first += stage.len();
            Some((*first - stage.len()..*first).collect())
        }));
        parts.push((0..n).collect());
        parts.dedup();
        let mut all = Vec::new();
        for later in [1, -1] {
            let moved = match by {
                LabelStep::Row => shifted(&as_read.words, 0, later),
                LabelStep::Word => shifted_by_word(&as_read.words, later),
            };
            for actuators in &parts {
                let pairs = as_read.words.iter().zip(&moved);
                let digit =
                    |k, own: &Word, moved: &Word| if actuators.contains(&k) { moved.digit(k) } else { own.digit(k) };
                let words = pairs.map(|(own, moved)| word_of((0..n).map(|k| digit(k, own, moved))));
                let Some(words) = words.collect() else { continue };
                let actuators = if actuators.len() < n { actuators.clone() } else { Vec::new() };
                let reading = ReadRows { words, poses: as_read.poses.clone() };
                all.push((Misreading::ShiftedDigits { actuators, by, later }, reading));
            }
        }
        all
    }

    /// The word with the digit of one actuator inverted, or with all.
    fn inverted(&self, word: &Word, actuator: Option<usize>) -> Option<Word> {
        let digit = |(k, digit): (usize, u8)| match actuator.is_none_or(|actuator| actuator == k) {
            true => self.last_state(k).saturating_sub(digit),
            false => digit,
        };
        word_of(word.iter().enumerate().map(digit))
    }

    /// Readings of the poses, the words as they are.
    fn of_poses(&self, as_read: &ReadRows) -> Vec<(Misreading, ReadRows)> {
        let mirrored =
            self.axes().map(|(k, axis)| (Misreading::MirroredAxis { axis }, as_read.moved(|p| p[k] = -p[k])));
        let n_axes = self.axes().count();
        let pairs = [(0, 1), (1, 2), (0, 2)].into_iter().filter(|pair| pair.1 < n_axes);
        let exchanged = pairs.map(|(a, b)| {
            let axes = [AXES[a], AXES[b]];
            (Misreading::ExchangedAxes { axes }, as_read.moved(|p| p.swap_rows(a, b)))
        });
        let left_handed = self.axes().map(|(k, axis)| {
            let mut mirror = Mat3::identity();
            mirror[(k, k)] = -1.0;
            let seen =
                |pose: &Pose<f64>| Pose { rotation: mirror * pose.rotation * mirror, position: mirror * pose.position };
            (Misreading::LeftHanded { axis }, as_read.with(seen))
        });
        let turned = as_read.with(|pose| Pose { rotation: pose.rotation.transpose(), position: pose.position });
        let inverted = as_read.with(Pose::inverse);
        let both = [(Misreading::InvertedAngles, turned), (Misreading::InvertedPoses, inverted)];
        mirrored.chain(left_handed).chain(exchanged).chain(both).collect()
    }

    /// Readings of one column of the poses in another unit, with their errors.
    fn of_units(&self, as_read: &ReadRows) -> Result<Vec<(Misreading, f64)>, Cancelled> {
        let turned = |times: f64| {
            as_read.with(|pose| Pose {
                rotation: rotation_exp(&(rotation_log(&pose.rotation) * times)),
                position: pose.position,
            })
        };
        let in_rad = [(Misreading::AnglesInRadians, turned(1f64.to_degrees()))];
        let mut all = Vec::new();
        for (k, axis) in self.axes() {
            all.extend(self.of_length_units(as_read, k, axis)?);
        }
        all.extend(self.better_than(&turned(0.0), in_rad)?);
        Ok(all)
    }

    /// Readings of one axis of the positions in another unit of length, with their errors.
    fn of_length_units(&self, as_read: &ReadRows, k: usize, axis: char) -> Result<Vec<(Misreading, f64)>, Cancelled> {
        let read = LENGTH_UNITS.into_iter().flat_map(|times| [times, 1.0 / times]).map(|factor| {
            let misreading = Misreading::ColumnScale { columns: vec![format!("{axis} of the poses")], factor };
            (misreading, as_read.moved(|p| p[k] /= factor))
        });
        self.better_than(&as_read.moved(|p| p[k] = 0.0), read)
    }

    /// The readings that leave much less than poses in which this column does not change: dividing a column by much removes its
    /// error as well where the model hardly moves along it, and says nothing of its unit.
    fn better_than(
        &self,
        still: &ReadRows,
        readings: impl IntoIterator<Item = (Misreading, ReadRows)>,
    ) -> Result<Vec<(Misreading, f64)>, Cancelled> {
        let still_m = self.error_m(still).unwrap_or(0.0);
        let mut better = self.judged(readings)?;
        better.retain(|(_, error_m)| *error_m < MUCH_LESS * still_m);
        Ok(better)
    }

    /// Readings with their errors, m.
    fn judged(
        &self,
        readings: impl IntoIterator<Item = (Misreading, ReadRows)>,
    ) -> Result<Vec<(Misreading, f64)>, Cancelled> {
        let mut judged = Vec::new();
        for (misreading, reading) in readings {
            self.progress.check()?;
            judged.extend(self.error_m(&reading).map(|error_m| (misreading, error_m)));
        }
        Ok(judged)
    }

    /// The axes that the arm moves along, with their numbers.
    fn axes(&self) -> impl Iterator<Item = (usize, char)> + use<> {
        let n_axes = if self.arm.model.chain.is_planar() { 2 } else { 3 };
        AXES.into_iter().enumerate().take(n_axes)
    }

    /// Words that are one row late or early from some row on.
    fn out_of_step(&self, as_read: &ReadRows, run: &Run, training: &[usize]) -> Vec<(Misreading, f64)> {
        let all = Comparison { rows: training.to_vec(), servos: self.servos.clone(), ..*self };
        let Some(errors_m) = all.errors_m(as_read) else { return Vec::new() };
        let mut tried = Vec::new();
        for rows in [1, -1] {
            let shifted_all = ReadRows { words: shifted(&as_read.words, 0, rows), poses: as_read.poses.clone() };
            let Some(later_m) = all.errors_m(&shifted_all) else { continue };
            // What the rows up to each gain as they are read: the step is where that is most.
            let gains = errors_m.iter().zip(&later_m).scan(0.0, |sum, (own, later)| {
                *sum += later.min(10.0 * own) - own.min(10.0 * later);
                Some(*sum)
            });
            let Some((last, _)) = gains.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
            let Some(&first) = training.get(last + 1) else { continue };
            let words = shifted(&as_read.words, first, rows);
            if let Some(error_m) = self.error_m(&ReadRows { words, poses: as_read.poses.clone() }) {
                tried.push((Misreading::WordsOutOfStep { line: run.line(first), rows }, error_m));
            }
        }
        tried
    }

    /// Lengths of another size.
    fn other_size(&self, as_read: &ReadRows) -> Option<(Misreading, f64)> {
        // A blunder is as large as it likes.
        let successive = self.pairs(as_read)?;
        let ratios = successive.windows(2).map(|pair| {
            let ((from, seen_from), (to, seen_to)) = (pair[0], pair[1]);
            (seen_to.position - seen_from.position).norm() / (to.position - from.position).norm()
        });
        let factor = median(ratios.filter(|ratio| ratio.is_finite()))?;
        let reading = as_read.moved(|p| *p /= factor);
        let is_other = factor.is_normal() && (factor.ln()).abs() > OTHER_SIZE.ln_1p();
        Some((Misreading::LengthScale { factor }, self.error_m(&reading)?)).filter(|_| is_other)
    }

    /// The order of actuators that is reached by exchanging two at a time as long as that lowers the error.
    fn other_order(&self, as_read: &ReadRows) -> Result<Option<(Misreading, f64)>, Cancelled> {
        let n = self.arm.n_actuators();
        let mut order: Vec<usize> = (0..n).collect();
        let mut best_m = f64::INFINITY;
        for _ in 0..n {
            self.progress.check()?;
            let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
            let tried = pairs.filter_map(|(a, b)| {
                let mut order = order.clone();
                order.swap(a, b);
                Some((self.error_m(&ordered(as_read, &order)?)?, order))
            });
            let Some((error_m, next)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            if error_m >= best_m {
                break;
            }
            (best_m, order) = (error_m, next);
        }
        Ok(best_m.is_finite().then_some((Misreading::ExchangedActuators { order }, best_m)))
    }

    fn last_state(&self, actuator: usize) -> u8 {
        (self.arm.model.chain.n_states(actuator).max(1) - 1) as u8
    }

    /// Root mean square error of the rows compared, m; `None` where the model has no pose for a word.
    fn error_m(&self, reading: &ReadRows) -> Option<f64> {
        Some(trimmed_root_mean_square(self.errors_m(reading)?))
    }

    /// What the model predicts and what was measured in each row compared.
    fn pairs(&self, reading: &ReadRows) -> Option<Vec<(Pose<f64>, Pose<f64>)>> {
        let mut scratch = ArmScratch::default();
        let predicted = self.rows.iter().map(|&row| {
            let condition = self.arm.working_condition(reading.words[row], self.servos[row]);
            Some((self.arm.model.predict(&condition, &mut scratch).ok()?, reading.poses[row]))
        });
        predicted.collect::<Option<Vec<_>>>().filter(|pairs| !pairs.is_empty())
    }

    /// The error of each row compared, m.
    fn errors_m(&self, reading: &ReadRows) -> Option<Vec<f64>> {
        let pairs = self.pairs(reading)?;
        let motion = robust_nearest_motion(&pairs, self.arm.length_scale_m);
        Some(distances_after(&motion, &pairs, self.arm.length_scale_m))
    }
}

/// How far poses are from their mean, root mean square, m.
fn motion_m(arm: &Arm, poses: &[Pose<f64>]) -> f64 {
    let position = poses.iter().map(|pose| pose.position).sum::<Vec3<f64>>() / poses.len().max(1) as f64;
    let mean = Pose { rotation: nearest_rotation(&poses.iter().map(|pose| pose.rotation).sum()), position };
    trimmed_root_mean_square(poses.iter().map(|pose| mean.distance(pose, arm.length_scale_m)).collect())
}

/// Words of rows that are `rows` later, from row `from` on; at an end as they are.
fn shifted(words: &[Word], from: usize, rows: isize) -> Vec<Word> {
    let of = |(k, word): (usize, &Word)| match k.checked_add_signed(rows) {
        Some(other) if k >= from => *words.get(other).unwrap_or(word),
        _ => *word,
    };
    words.iter().enumerate().map(of).collect()
}

/// Words of the next or last stretch of rows that have one word; at an end as they are.
fn shifted_by_word(words: &[Word], later: isize) -> Vec<Word> {
    let stays: Vec<&[Word]> = words.chunk_by(|a, b| a == b).collect();
    let of = |stay: usize| {
        let other = stays[stay.saturating_add_signed(later).min(stays.len() - 1)];
        std::iter::repeat_n(other[0], stays[stay].len())
    };
    (0..stays.len()).flat_map(of).collect()
}

/// Words whose digit k moves the actuator `order[k]` of the model.
fn ordered(as_read: &ReadRows, order: &[usize]) -> Option<ReadRows> {
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(k, &of)| place[of] = k);
    let words = as_read.words.iter().map(|word| word_of(place.iter().map(|&k| word.digit(k))));
    Some(ReadRows { words: words.collect::<Option<_>>()?, poses: as_read.poses.clone() })
}

fn word_of(digits: impl Iterator<Item = u8>) -> Option<Word> {
    Word::new(&digits.collect::<Vec<u8>>()).ok()
}

#[cfg(test)]
mod tests;
