//! Channels along time, stretch by stretch: differences, zero-phase low-pass, interpolation, thinning. Nothing crosses a
//! border between stretches.

use std::ops::Range;

/// The stretches of rows with the same number.
pub fn stretches(series: &[usize]) -> Vec<Range<usize>> {
    let mut all = Vec::new();
    let mut start = 0;
    for piece in series.chunk_by(|a, b| a == b) {
        all.push(start..start + piece.len());
        start += piece.len();
    }
    all
}

/// The rate of a channel, in its unit per s, by central differences, one-sided at borders.
pub fn rate(values: &[f64], time_s: &[f64], series: &[usize]) -> Vec<f64> {
    let mut rates = vec![0.0; values.len()];
    for stretch in stretches(series) {
        for k in stretch.clone() {
            let (a, b) = (k.saturating_sub(1).max(stretch.start), (k + 1).min(stretch.end - 1));
            let time = time_s[b] - time_s[a];
            rates[k] = if time > 0.0 { (values[b] - values[a]) / time } else { 0.0 };
        }
    }
    rates
}

/// One second-order section: y = b₀x + b₁x₁ + b₂x₂ − a₁y₁ − a₂y₂.
#[derive(Clone, Copy, Debug)]
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

/// A Butterworth low-pass of order 4 that runs forwards and backwards.
#[derive(Clone, Copy, Debug)]
pub struct LowPass {
    sections: [Section; 2],
}

impl LowPass {
    /// With its corner at `corner_hz` for rows at `rate_hz`; `None` where the corner is not below half the rate.
    pub fn new(corner_hz: f64, rate_hz: f64) -> Option<Self> {
        if !(corner_hz > 0.0 && corner_hz < 0.5 * rate_hz) {
            return None;
        }
        let warped = (std::f64::consts::PI * corner_hz / rate_hz).tan();
        let section = |angle: f64| {
            let damping = 2.0 * angle.cos();
            let scale = 1.0 / (1.0 + damping * warped + warped * warped);
            let b = warped * warped * scale;
            let a = [2.0 * (warped * warped - 1.0) * scale, (1.0 - damping * warped + warped * warped) * scale];
            Section { b: [b, 2.0 * b, b], a }
        };
        let eighth = std::f64::consts::PI / 8.0;
        Some(Self { sections: [section(eighth), section(3.0 * eighth)] })
    }

    /// Filters a channel without delay, each stretch by itself, continued by reflection at its ends.
    pub fn apply(&self, values: &mut [f64], series: &[usize], settle: usize) {
        for stretch in stretches(series) {
            self.smooth(&mut values[stretch], settle);
        }
    }

    /// Filters one stretch of rows at even steps.
    pub fn smooth(&self, part: &mut [f64], settle: usize) {
        if part.is_empty() {
            return;
        }
        let pad = settle.min(part.len().saturating_sub(1));
        let (first, last) = (part[0], part[part.len() - 1]);
        let before = (1..=pad).rev().map(|k| 2.0 * first - part[k]);
        let after = (1..=pad).map(|k| 2.0 * last - part[part.len() - 1 - k]);
        let mut long: Vec<f64> = before.chain(part.iter().copied()).chain(after).collect();
        self.once(&mut long);
        long.reverse();
        self.once(&mut long);
        long.reverse();
        let n = part.len();
        part.copy_from_slice(&long[pad..pad + n]);
    }

    fn once(&self, values: &mut [f64]) {
        for Section { b, a } in self.sections {
            let Some(&first) = values.first() else { return };
            let (mut x, mut y) = ([first; 2], [first; 2]);
            for value in values.iter_mut() {
                let now = b[0] * *value + b[1] * x[0] + b[2] * x[1] - a[0] * y[0] - a[1] * y[1];
                (x, y) = ([*value, x[0]], [now, y[0]]);
                *value = now;
            }
        }
    }
}

/// Rows a second, by the median of the steps of time.
pub fn rate_hz(time_s: &[f64], series: &[usize]) -> f64 {
    let steps = (1..time_s.len()).filter(|&k| series[k] == series[k - 1]).map(|k| time_s[k] - time_s[k - 1]);
    crate::median(steps).filter(|step| *step > 0.0).map_or(0.0, |step| 1.0 / step)
}

/// Values between the rows that are fresh, along straight lines; held at the ends.
pub fn interpolated(values: &[f64], time_s: &[f64], fresh: &[bool]) -> Vec<f64> {
    let known: Vec<usize> = (0..values.len()).filter(|&k| fresh[k]).collect();
    (0..values.len()).map(|k| between(values, time_s, &known, k)).collect()
}

/// The value in row `k` on the straight line between the `known` rows before and after it.
fn between(values: &[f64], time_s: &[f64], known: &[usize], k: usize) -> f64 {
    let after = known.partition_point(|&row| row < k);
    match (after.checked_sub(1).and_then(|before| known.get(before)), known.get(after)) {
        (_, Some(&b)) if b == k => values[k],
        (Some(&a), Some(&b)) => {
            let share = (time_s[k] - time_s[a]) / (time_s[b] - time_s[a]).max(f64::MIN_POSITIVE);
            values[a] + share * (values[b] - values[a])
        }
        (Some(&only), None) | (None, Some(&only)) => values[only],
        (None, None) => values[k],
    }
}

/// An angle without jumps of complete turns.
pub fn unwrapped(angles: &[f64]) -> Vec<f64> {
    let turn = std::f64::consts::TAU;
    let mut turns = 0.0;
    let mut all = Vec::with_capacity(angles.len());
    for (k, angle) in angles.iter().enumerate() {
        if k > 0 {
            turns -= ((angle - angles[k - 1]) / turn).round() * turn;
        }
        all.push(angle + turns);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_wave_passes_without_delay_and_a_fast_one_does_not() {
        let filter = LowPass::new(10.0, 1000.0).unwrap();
        let wave =
            |hz: f64| (0..2000).map(|k| (std::f64::consts::TAU * hz * f64::from(k) / 1000.0).sin()).collect::<Vec<_>>();
        let (slow, series) = (wave(1.0), vec![0; 2000]);
        let mut mixed: Vec<f64> = slow.iter().zip(wave(100.0)).map(|(a, b)| a + b).collect();
        filter.apply(&mut mixed, &series, 300);
        let worst = mixed[200..1800].iter().zip(&slow[200..1800]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-3, "{worst}");
        assert!(LowPass::new(500.0, 1000.0).is_none());
    }

    #[test]
    fn nothing_crosses_a_border() {
        let (values, series) = ([0.0, 1.0, 2.0, 10.0, 10.0, 10.0], [0, 0, 0, 1, 1, 1]);
        assert_eq!(rate(&values, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], &series), [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        let mut filtered = vec![1.0, 1.0, 1.0, 10.0, 10.0, 10.0];
        LowPass::new(1.0, 10.0).unwrap().apply(&mut filtered, &series, 9);
        assert!(filtered[2] < 1.0 + 1e-9 && filtered[3] > 10.0 - 1e-9);
    }

    #[test]
    fn old_rows_are_filled_from_fresh_ones() {
        let filled = interpolated(&[0.0, 0.0, 4.0], &[0.0, 1.0, 4.0], &[true, false, true]);
        assert_eq!(filled, [0.0, 1.0, 4.0]);
        assert!((unwrapped(&[3.0, -3.0])[1] - (std::f64::consts::TAU - 3.0)).abs() < 1e-12);
    }
}
