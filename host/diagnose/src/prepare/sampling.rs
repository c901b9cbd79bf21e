//! When rows were really sampled: rate, jitter, rounding, lost and repeated rows, by the time stamps.
//!
//! # Method
//!
//! A logger that samples at an even clock writes stamps that are late by its own delays, rounded, or with rows missing. Each
//! row gets a number on an even clock: the next one, plus those by which its stamp is farther off than half a period. A line
//! through stamps over numbers gives period and phase, twice. There may be two such clocks (the median and the mean of the
//! steps differ where stamps are rounded or rows are lost), and the stamps may be right as they are. Of these that one is
//! taken in whose times the channels are smoothest: by how far each value is from the cubic through its four neighbours.

use std::f64::consts::TAU;
use std::ops::Range;

use darm_measure::even_grid::through;
use darm_measure::median;
use darm_measure::signal::stretches;

/// Stamps off an even clock by more than this share of a period (root mean square) are no jitter of that clock, unless they
/// are rounded as coarsely.
const MAX_JITTER: f64 = 0.3;
/// Share of a period below which stamps count as even: what double precision and decimal files leave.
const EVEN: f64 = 1e-3;
/// An even clock is taken where it makes channels rougher than the stamps do by no more than this share.
const AS_SMOOTH: f64 = 0.02;
/// Rows over which a period is measured, one after the other.
const SPANS: [usize; 3] = [4, 16, 64];
/// Rows that say where within a period rows are due.
const AT_FIRST: usize = 64;
/// Rows at the least from which a clock is found.
const MIN_ROWS: usize = 8;

/// How a table was sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// From one row to the next, s; 0 where no rate can be found.
    pub period_s: f64,
    /// Which times are used.
    pub clock: Clock,
    /// Root mean square of the stamps less those of an even clock, s; `None` where they follow none.
    pub jitter_s: Option<f64>,
    /// Rows that are missing between others.
    pub n_lost: usize,
}

/// Which times of rows are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The stamps as they are.
    Stamps,
    /// The even clock that the stamps are off by jitter, rounding or both.
    Even,
}

impl Sampling {
    /// Rows a second; 0 where no rate can be found.
    pub fn rate_hz(&self) -> f64 {
        if self.period_s > 0.0 { 1.0 / self.period_s } else { 0.0 }
    }

    /// What the owner of the log should know; `None` of even stamps without gaps.
    pub fn sentence(&self) -> Option<String> {
        let is_small = |jitter_s: f64| jitter_s < EVEN * self.period_s;
        let is_even = self.clock == Clock::Even && self.jitter_s.is_some_and(is_small);
        if is_even && self.n_lost == 0 {
            return None;
        }
        let mut parts = vec![format!("{:.1} rows a second", self.rate_hz())];
        if !is_even {
            let used = match self.clock {
                Clock::Even => "an even clock is used",
                Clock::Stamps => "the stamps are used, resampled to even steps for filters and rates",
            };
            let off = self.jitter_s.map_or("time stamps of no even clock".into(), |jitter_s| {
                format!("time stamps off an even clock by {:.3} ms rms", 1e3 * jitter_s)
            });
            parts.push(format!("{off}: {used}"));
        }
        if self.n_lost > 0 {
            parts.push(format!("{} rows missing between others, interpolated for filters and rates", self.n_lost));
        }
        Some(parts.join("; "))
    }
}

/// Finds how rows were sampled, and sets their times to those of the even clock where there is one. `motions` number the
/// stretches of rows between gaps, `channels` are what was measured.
pub fn find(time_s: &mut [f64], motions: &[usize], channels: &[&[f64]]) -> Sampling {
    let parts = stretches(motions);
    let steps: Vec<f64> =
        parts.iter().flat_map(|part| time_s[part.clone()].windows(2)).map(|pair| pair[1] - pair[0]).collect();
    let middle_s = usual_step_s(&steps);
    let mut found = Sampling { period_s: middle_s, clock: Clock::Stamps, jitter_s: None, n_lost: 0 };
    if time_s.len() < MIN_ROWS || middle_s <= 0.0 {
        return found;
    }
    let mean_s = steps.iter().sum::<f64>() / steps.len() as f64;
    let stamps = time_s.to_vec();
    let mut limit = roughness(&stamps, &parts, channels) + AS_SMOOTH;
    for period_s in [middle_s, mean_s] {
        let Some(even) = EvenClock::of(&stamps, &parts, period_s) else { continue };
        let rough = roughness(&even.times_s, &parts, channels);
        if rough <= limit {
            limit = rough;
            time_s.copy_from_slice(&even.times_s);
            let EvenClock { period_s, jitter_s, n_lost, .. } = even;
            found = Sampling { period_s, clock: Clock::Even, jitter_s: Some(jitter_s), n_lost };
        } else if found.clock == Clock::Stamps {
            found.jitter_s = Some(even.jitter_s);
        }
    }
    found
}

/// The median of the steps of time that are not zero, s; 0 without any.
pub fn usual_step_s(steps_s: &[f64]) -> f64 {
    median(steps_s.iter().copied().filter(|step| *step > 0.0)).unwrap_or(0.0)
}

/// Rows on an even clock.
struct EvenClock {
    period_s: f64,
    times_s: Vec<f64>,
    jitter_s: f64,
    n_lost: usize,
}

impl EvenClock {
    /// The even clock of about this period; `None` where the stamps follow none.
    fn of(stamps: &[f64], parts: &[Range<usize>], period_s: f64) -> Option<Self> {
        let mut period_s = refined(stamps, parts, period_s);
        let mut numbers = vec![0.0; stamps.len()];
        for _ in 0..2 {
            parts.iter().for_each(|part| number(&stamps[part.clone()], period_s, &mut numbers[part.clone()]));
            period_s = slope(stamps, parts, &numbers)?;
        }
        let mut times_s = stamps.to_vec();
        let (mut square, mut n_lost) = (0.0, 0);
        for part in parts {
            let (own, numbers) = (&stamps[part.clone()], &numbers[part.clone()]);
            let phase = own.iter().zip(numbers).map(|(stamp, n)| stamp - period_s * n).sum::<f64>() / own.len() as f64;
            for ((time_s, stamp), n) in times_s[part.clone()].iter_mut().zip(own).zip(numbers) {
                *time_s = phase + period_s * n;
                square += (*time_s - stamp).powi(2);
            }
            let steps = numbers.windows(2).map(|pair| pair[1] - pair[0]);
            n_lost += steps.map(|step| step as usize - 1).sum::<usize>();
        }
        let jitter_s = (square / stamps.len() as f64).sqrt();
        let is_rounded = stamps.windows(2).any(|pair| pair[1] == pair[0]);
        (is_rounded || jitter_s <= MAX_JITTER * period_s).then_some(Self { period_s, times_s, jitter_s, n_lost })
    }
}

/// The period by the time over more and more rows, in which jitter is a smaller and smaller share: a period that is a percent
/// off is taken for a lost row sooner or later.
fn refined(stamps: &[f64], parts: &[Range<usize>], mut period_s: f64) -> f64 {
    for rows in SPANS {
        let spans = parts.iter().flat_map(|part| stamps[part.clone()].windows(rows + 1));
        let periods = spans.filter_map(|span| {
            let span_s = span[rows] - span[0];
            let n = (span_s / period_s).round();
            (n > 0.0).then(|| span_s / n)
        });
        period_s = median(periods).unwrap_or(period_s);
    }
    period_s
}

/// When the first row was due, if it and those after it are late or early by less than half a period: by the mean of their
/// places within a period, on a circle.
fn phase_s(stamps: &[f64], period_s: f64) -> f64 {
    let Some(first_s) = stamps.first() else { return 0.0 };
    let angles = stamps.iter().take(AT_FIRST).map(|stamp| TAU * (stamp - first_s) / period_s);
    let (sine, cosine) = angles.fold((0.0, 0.0), |(sine, cosine), angle| (sine + angle.sin(), cosine + angle.cos()));
    first_s + period_s * sine.atan2(cosine) / TAU
}

/// The number of each row on an even clock of this period: the next one, or later where its stamp is.
fn number(stamps: &[f64], period_s: f64, numbers: &mut [f64]) {
    // Rounded stamps are late and early by their resolution, so that only more than that is a lost row.
    let steps: Vec<f64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let resolution_s = if steps.contains(&0.0) { usual_step_s(&steps) } else { 0.0 };
    let tolerance_s = f64::max(0.5 * period_s, resolution_s);
    let (mut phase_s, mut last) = (phase_s(stamps, period_s), -1.0);
    for (k, stamp) in stamps.iter().enumerate() {
        let mut late_s = stamp - (phase_s + period_s * (last + 1.0));
        if late_s < -tolerance_s {
            // The row before was so late that one seemed lost; or else the first ones were.
            if k > 1 && numbers[k - 1] > numbers[k - 2] + 1.0 {
                last -= 1.0;
                numbers[k - 1] = last;
            } else {
                phase_s -= period_s;
            }
            late_s += period_s;
        }
        let skipped = if late_s > tolerance_s { (late_s / period_s).round().max(0.0) } else { 0.0 };
        last += 1.0 + skipped;
        numbers[k] = last;
        // The phase follows slowly, so that an error of the period does not add up.
        phase_s += 0.02 * (stamp - (phase_s + period_s * last));
    }
}

/// The period that a line through the stamps over their numbers has, with a phase for each part.
fn slope(stamps: &[f64], parts: &[Range<usize>], numbers: &[f64]) -> Option<f64> {
    let (mut products, mut squares) = (0.0, 0.0);
    for part in parts {
        let (own, numbers) = (&stamps[part.clone()], &numbers[part.clone()]);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (middle_s, middle) = (mean(own), mean(numbers));
        products += own.iter().zip(numbers).map(|(s, n)| (s - middle_s) * (n - middle)).sum::<f64>();
        squares += numbers.iter().map(|n| (n - middle).powi(2)).sum::<f64>();
    }
    (squares > 0.0 && products > 0.0).then(|| products / squares)
}

/// Mean logarithm of how far the values of each channel are from the cubic through their four neighbours.
fn roughness(times_s: &[f64], parts: &[Range<usize>], channels: &[&[f64]]) -> f64 {
    let logs: Vec<f64> = channels.iter().filter_map(|channel| log_of_mean_error(times_s, parts, channel)).collect();
    if logs.is_empty() { 0.0 } else { logs.iter().sum::<f64>() / logs.len() as f64 }
}

/// The logarithm of how far the values of a channel are from those cubics in the mean; `None` where they are all on them.
fn log_of_mean_error(times_s: &[f64], parts: &[Range<usize>], channel: &[f64]) -> Option<f64> {
    let rows = parts.iter().flat_map(|part| (part.start + 2)..part.end.saturating_sub(2).max(part.start + 2));
    let errors = rows.map(|k| {
        let near = [k - 2, k - 1, k + 1, k + 2];
        (through(near.map(|j| times_s[j]), near.map(|j| channel[j]), times_s[k]) - channel[k]).abs()
    });
    let (sum, n) = errors.fold((0.0, 0usize), |(sum, n), error| (sum + error, n + 1));
    let mean = sum / n.max(1) as f64;
    if mean.is_finite() { (mean > 0.0).then(|| mean.ln()) } else { Some(f64::INFINITY) }
}

#[cfg(test)]
mod tests;
