//! Channels on an even grid of time, stretch by stretch: where filters and differences count rows, and rows were lost or
//! sampled unevenly. Values between rows are those of the cubic through the four nearest.

use std::ops::Range;

use super::signal::stretches;

/// Share of a step within which a row is on a point of the grid.
const ON_POINT: f64 = 1e-6;
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
        for Part { rows, places } in &self.parts {
            let own = &mut values[rows.clone()];
            let Some(places) = places else {
                change(own);
                continue;
            };
            let n_points = places.last().map_or(0, |last| last.ceil() as usize + 1);
            let points: Vec<f64> = (0..n_points).map(|point| point as f64).collect();
            let mut on_grid: Vec<f64> = points.iter().map(|point| between(places, own, *point)).collect();
            change(&mut on_grid);
            own.iter_mut().zip(places).for_each(|(own, place)| *own = between(&points, &on_grid, *place));
        }
    }

    /// The rate of a channel, in its unit per s, by central differences; at the ends of a stretch that of the parabola through
    /// three points.
    pub fn rate(&self, values: &[f64]) -> Vec<f64> {
        let mut rates = values.to_vec();
        self.apply(&mut rates, |part| {
            let rate = |k: usize| if self.step_s > 0.0 { difference(part, k) / self.step_s } else { 0.0 };
            let rates: Vec<f64> = (0..part.len()).map(rate).collect();
            part.copy_from_slice(&rates);
        });
        rates
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
}

/// The change of values from one point to the next, at one of them.
fn difference(values: &[f64], k: usize) -> f64 {
    match *values {
        [] | [_] => 0.0,
        [a, b] => b - a,
        [a, b, c, ..] if k == 0 => 2.0 * b - 0.5 * c - 1.5 * a,
        [.., a, b, c] if k + 1 == values.len() => 1.5 * c + 0.5 * a - 2.0 * b,
        _ => 0.5 * (values[k + 1] - values[k - 1]),
    }
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
            let rates = grid.rate(&values);
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
        let rates = grid.rate(&time_s.iter().map(|t| wave(*t)).collect::<Vec<f64>>());
        for k in [0, time_s.len() - 1] {
            let rate = std::f64::consts::TAU * (std::f64::consts::TAU * time_s[k]).cos();
            assert!((rates[k] - rate).abs() < 8.3e-3, "{k}: {}", rates[k] - rate);
        }
    }

    #[test]
    fn nothing_crosses_a_border() {
        let (values, series) = ([0.0, 1.0, 2.0, 10.0, 10.0, 10.0], [0, 0, 0, 1, 1, 1]);
        let grid = EvenGrid::new(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], &series, 1.0);
        assert_eq!(grid.rate(&values), [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn stamps_that_are_the_same_or_single_are_no_trouble() {
        let grid = EvenGrid::new(&[0.0, 0.0, 1.0, 7.0], &[0, 0, 0, 1], 1.0);
        assert!(grid.rate(&[1.0, 2.0, 3.0, 4.0]).iter().all(|rate| rate.is_finite()));
    }
}
