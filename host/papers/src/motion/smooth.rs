//! The zero-phase low-pass along one motion.

use darm_measure::signal::{LowPass, rate_hz};

/// A low-pass for channels of one time axis; what is too fast for the rate passes as it is.
pub(super) struct Smooth {
    filter: Option<LowPass>,
    series: Vec<usize>,
    settle: usize,
}

impl Smooth {
    pub(super) fn new(time_s: &[f64], corner_hz: f64) -> Self {
        let series = vec![0; time_s.len()];
        let rate = rate_hz(time_s, &series);
        Self { filter: LowPass::new(corner_hz, rate), settle: 2 * (rate / corner_hz).ceil() as usize, series }
    }

    pub(super) fn pass(&self, mut values: Vec<f64>) -> Vec<f64> {
        if let Some(filter) = &self.filter {
            filter.apply(&mut values, &self.series, self.settle);
        }
        values
    }
}
