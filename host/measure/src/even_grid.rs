//! Channels on an even grid of time, stretch by stretch: where filters and differences count rows, and rows were lost or
//! sampled unevenly. Values between rows are those of the cubic through the four nearest.

use std::borrow::Cow;
use std::ops::Range;

use super::signal::stretches;

/// Share of a step within which a row is on a point of the grid.
const ON_POINT: f64 = 1e-6;
/// Weights of the sixth difference, and the sum of their squares.
const SIXTH: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
const NOISE_IN_SIXTH: f64 = 924.0;
/// Mean square by which narrow and wide differences are apart, in that of the noise, where the wide ones are as near to the
/// truth: what these have more of the noise, 0.403 and 0.884, and what it sets between them, 0.069 and 0.287.
const APART_IN_FIRST: f64 = 0.472;
const APART_IN_SECOND: f64 = 1.172;
/// A cubic through points whose spacings differ by more than this swings: a line is drawn instead.
const MAX_UNEVENNESS: f64 = 6.0;

/// An even grid over the rows of each stretch.
#[derive(Clone, Debug, PartialEq)]
pub struct EvenGrid {
    /// From one point to the next, s.
    pub step_s: f64,
    parts: Vec<Part>,
}

/// One stretch.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    rows: Range<usize>,
    /// Where each row is on the grid, in steps; `None` where rows and points are the same.
    places: Option<Vec<f64>>,
}

impl EvenGrid {
    /// The grid of these times; rows of a step of 0 are taken as even.
    pub fn new(time_s: &[f64], series: &[usize], step_s: f64) -> Self {
        let part = |rows| Part::new(time_s, rows, step_s);
        Self { step_s, parts: stretches(series).into_iter().map(part).collect() }
    }

    /// Changes a channel of rows as `change` changes the points of each stretch.
    pub fn apply(&self, values: &mut [f64], change: impl Fn(&mut [f64])) {
        for part in &self.parts {
            let own = &mut values[part.rows.clone()];
            let Some(places) = &part.places else {
                change(own);
                continue;
            };
            let mut on_grid = part.points(own).into_owned();
            change(&mut on_grid);
            let points: Vec<f64> = (0..on_grid.len()).map(|point| point as f64).collect();
            own.iter_mut().zip(places).for_each(|(own, place)| *own = between(&points, &on_grid, *place));
        }
    }

    /// The first and the second rate of a channel, in its unit per s and per s².
    ///
    /// Differences over two steps pass less noise on; those over four stay nearer to a channel that turns within a few steps.
    /// They are taken for a rate in which both are farther apart than noise makes them.
    pub fn rates(&self, values: &[f64]) -> [Vec<f64>; 2] {
        let noise = self.noise_squared(values) / self.step_s.powi(2);
        let [first, second] = self.rates_of_smooth(values);
        let [of_first, of_second] = self.rates_by(values, wide);
        [
            nearer(first, of_first, APART_IN_FIRST * noise),
            nearer(second, of_second, APART_IN_SECOND * noise / self.step_s.powi(2)),
        ]
    }

    /// The same by the differences over two steps alone: noise that a low-pass has passed shows in no sixth difference.
    pub fn rates_of_smooth(&self, values: &[f64]) -> [Vec<f64>; 2] {
        self.rates_by(values, narrow)
    }

    fn rates_by(&self, values: &[f64], difference: Difference) -> [Vec<f64>; 2] {
        let first = self.rate(values, difference);
        let second = self.rate(&first, difference);
        [first, second]
    }

    fn rate(&self, values: &[f64], difference: Difference) -> Vec<f64> {
        let mut rates = values.to_vec();
        self.apply(&mut rates, |part| {
            let of = |k| if self.step_s > 0.0 { difference(part, k) / self.step_s } else { 0.0 };
            let all: Vec<f64> = (0..part.len()).map(of).collect();
            part.copy_from_slice(&all);
        });
        rates
    }

    /// The mean square of the noise on points, by their sixth differences, in which a smooth channel leaves nothing.
    fn noise_squared(&self, values: &[f64]) -> f64 {
        let mut squares = (0.0, 0usize);
        for part in &self.parts {
            let points = part.points(&values[part.rows.clone()]);
            let sixth =
                points.windows(7).map(|of| of.iter().zip(SIXTH).map(|(value, weight)| weight * value).sum::<f64>());
            squares = sixth.fold(squares, |(sum, n), difference| (sum + difference * difference, n + 1));
        }
        squares.0 / (NOISE_IN_SIXTH * squares.1.max(1) as f64)
    }
}

impl Part {
    /// These rows, with their places in steps from the first one unless they are even.
    fn new(time_s: &[f64], rows: Range<usize>, step_s: f64) -> Self {
        let start_s = time_s[rows.start];
        let place = |time_s: &f64| {
            let place = (time_s - start_s) / step_s;
            if (place - place.round()).abs() < ON_POINT { place.round() } else { place }
        };
        let places: Vec<f64> = time_s[rows.clone()].iter().map(place).collect();
        let is_even = step_s <= 0.0 || places.iter().enumerate().all(|(k, place)| *place == k as f64);
        Self { rows, places: (!is_even).then_some(places) }
    }

    /// A channel of these rows on the points of the grid.
    fn points<'v>(&self, own: &'v [f64]) -> Cow<'v, [f64]> {
        let Some(places) = &self.places else { return Cow::Borrowed(own) };
        let n_points = places.last().map_or(0, |last| last.ceil() as usize + 1);
        Cow::Owned((0..n_points).map(|point| between(places, own, point as f64)).collect())
    }
}

/// The change of values from one point to the next, at one of them.
type Difference = fn(&[f64], usize) -> f64;

/// Over the two steps around a point; at an end that of the parabola through three points.
fn narrow(values: &[f64], k: usize) -> f64 {
    match *values {
        [] | [_] => 0.0,
        [a, b] => b - a,
        [a, b, c, ..] if k == 0 => 2.0 * b - 0.5 * c - 1.5 * a,
        [.., a, b, c] if k + 1 == values.len() => 1.5 * c + 0.5 * a - 2.0 * b,
        _ => 0.5 * (values[k + 1] - values[k - 1]),
    }
}

/// Over four steps, by the curve of fourth order; near an end the narrow one.
fn wide(values: &[f64], k: usize) -> f64 {
    match k.checked_sub(2).and_then(|first| values.get(first..first + 5)) {
        Some(&[a, b, _, d, e]) => (8.0 * (d - b) - (e - a)) / 12.0,
        _ => narrow(values, k),
    }
}

/// The rate by narrow differences, or that by wide ones where the mean square by which they are apart is more than this.
fn nearer(narrow: Vec<f64>, wide: Vec<f64>, apart: f64) -> Vec<f64> {
    let squares: f64 = narrow.iter().zip(&wide).map(|(narrow, wide)| (narrow - wide).powi(2)).sum();
    if squares > apart * narrow.len() as f64 { wide } else { narrow }
}

/// The value at a place between others in rising order.
fn between(places: &[f64], values: &[f64], at: f64) -> f64 {
    let after = places.partition_point(|place| *place < at);
    if places.get(after) == Some(&at) || places.len() == 1 {
        return values[after.min(places.len() - 1)];
    }
    let after = after.clamp(1, places.len() - 1);
    if let Some(first) = places.len().checked_sub(4).map(|last| after.saturating_sub(2).min(last)) {
        let [near, of] = [places, values].map(|all| std::array::from_fn(|k| all[first + k]));
        let steps = [near[1] - near[0], near[2] - near[1], near[3] - near[2]];
        let (short, long) = steps.iter().fold((f64::INFINITY, 0.0f64), |(s, l), step| (s.min(*step), l.max(*step)));
        if long <= MAX_UNEVENNESS * short {
            return through(near, of, at);
        }
    }
    let (a, b) = (after - 1, after);
    let share = if places[b] > places[a] { ((at - places[a]) / (places[b] - places[a])).clamp(0.0, 1.0) } else { 0.0 };
    values[a] + share * (values[b] - values[a])
}

/// The value at a place of the cubic through four points (Lagrange).
pub fn through(places: [f64; 4], values: [f64; 4], at: f64) -> f64 {
    let weight = |k: usize| -> f64 {
        let others = (0..4).filter(|other| *other != k);
        others.map(|other| (at - places[other]) / (places[k] - places[other])).product()
    };
    (0..4).map(|k| weight(k) * values[k]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(time_s: f64) -> f64 {
        (std::f64::consts::TAU * time_s).sin()
    }

    /// The cubic through points 10 ms apart is off a wave of 1 Hz by up to 3/128·(2π·0.01)⁴ = 3.7e-7; the rate over 20 ms by
    /// (2π)³/6·0.01² = 4.1e-3, and by the cubic's error over 10 ms where a row is missing.
    #[test]
    fn lost_rows_and_uneven_stamps_change_no_rate() {
        let even: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.01).collect();
        let lost: Vec<f64> = even.iter().copied().enumerate().filter(|(k, _)| k % 7 != 3).map(|(_, t)| t).collect();
        let uneven: Vec<f64> = even.iter().enumerate().map(|(k, t)| t + 0.002 * (k as f64).sin()).collect();
        for time_s in [even, lost, uneven] {
            let values: Vec<f64> = time_s.iter().map(|t| wave(*t)).collect();
            let grid = EvenGrid::new(&time_s, &vec![0; time_s.len()], 0.01);
            let [rates, _] = grid.rates(&values);
            let inner = 4..time_s.len() - 4;
            let rate = |t: f64| std::f64::consts::TAU * (std::f64::consts::TAU * t).cos();
            let worst = inner.map(|k| (rates[k] - rate(time_s[k])).abs()).fold(0.0, f64::max);
            assert!(worst < 4.1e-3 + 2.0 * 3.7e-7 / 0.01 * 4.0, "{worst}");
        }
    }

    /// At an end the rate by three points is off by (2π)³/3·0.01², twice as much as inside.
    #[test]
    fn rates_at_the_ends_are_nearly_as_good() {
        let time_s: Vec<f64> = (0..30).map(|k| f64::from(k) * 0.01).collect();
        let grid = EvenGrid::new(&time_s, &vec![0; time_s.len()], 0.01);
        let [rates, _] = grid.rates(&time_s.iter().map(|t| wave(*t)).collect::<Vec<f64>>());
        for k in [0, time_s.len() - 1] {
            let rate = std::f64::consts::TAU * (std::f64::consts::TAU * time_s[k]).cos();
            assert!((rates[k] - rate).abs() < 8.3e-3, "{k}: {}", rates[k] - rate);
        }
    }

    /// A wave of 0.5 Hz, 20 points a second: with ω·h = 0.157 wide differences are off by (ω·h)⁴/30 of a rate and twice that of
    /// the second one, narrow ones by (ω·h)²/6 and (ω·h)²/3. Noise of 1 % passes the narrow ones with 0.61 of itself over h²
    /// and would pass the wide ones with 1.12.
    #[test]
    fn wide_differences_follow_what_turns_and_narrow_ones_keep_noise_low() {
        let time_s: Vec<f64> = (0..400).map(|k| f64::from(k) * 0.05).collect();
        let grid = EvenGrid::new(&time_s, &vec![0; time_s.len()], 0.05);
        let error = |noise: f64| {
            let noise = |k: usize| noise * ((k * 7919 % 1013) as f64 / 1013.0 - 0.5) * 12f64.sqrt();
            let values: Vec<f64> = time_s.iter().enumerate().map(|(k, t)| wave(0.5 * t) + noise(k)).collect();
            let [_, second] = grid.rates(&values);
            let off = |k: usize| second[k] + std::f64::consts::PI.powi(2) * wave(0.5 * time_s[k]);
            ((4..396).map(|k| off(k).powi(2)).sum::<f64>() / 392.0).sqrt()
        };
        assert!(error(0.0) < std::f64::consts::PI.powi(2) * 5e-5, "{}", error(0.0));
        assert!(error(0.01) < 0.01 * 0.75 / 0.05f64.powi(2), "{}", error(0.01));
    }

    #[test]
    fn nothing_crosses_a_border() {
        let (values, series) = ([0.0, 1.0, 2.0, 10.0, 10.0, 10.0], [0, 0, 0, 1, 1, 1]);
        let grid = EvenGrid::new(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], &series, 1.0);
        assert_eq!(grid.rates(&values)[0], [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn stamps_that_are_the_same_or_single_are_no_trouble() {
        let grid = EvenGrid::new(&[0.0, 0.0, 1.0, 7.0], &[0, 0, 0, 1], 1.0);
        assert!(grid.rates(&[1.0, 2.0, 3.0, 4.0]).iter().flatten().all(|rate| rate.is_finite()));
    }
}
