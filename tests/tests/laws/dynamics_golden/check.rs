//! Compares numbers with those of a golden file.

use darm_core::real::Real;
use darm_core::se::Pose;

pub(crate) const F64: f64 = 1e-12;

pub(crate) const ROUNDINGS: f64 = 24.0;

/// Compares numbers, and says which sample and quantity differ.
pub(crate) struct Check<'a> {
    pub(crate) place: &'a str,
    /// Allowed error as a part of the largest term.
    pub(crate) part: f64,
}

impl Check<'_> {
    pub(crate) fn near<T: Real>(&self, what: &str, ours: impl IntoIterator<Item = T>, theirs: &[f64], largest: f64) {
        let ours: Vec<f64> = ours.into_iter().map(|x| nalgebra::convert_unchecked(x)).collect();
        assert_eq!(ours.len(), theirs.len(), "{}: {what}", self.place);
        let scale = theirs.iter().fold(largest, |scale, x| scale.max(x.abs()));
        for (index, (a, b)) in ours.iter().zip(theirs).enumerate() {
            let error = (a - b).abs();
            assert!(
                error <= self.part * scale,
                "{}: {what}[{index}]: {a} is not {b}, off by {error:e} of {scale}",
                self.place
            );
        }
    }
}

/// Row by row, as the golden files are.
pub(crate) fn by_rows<T: Real, const R: usize, const C: usize>(matrix: &nalgebra::SMatrix<T, R, C>) -> Vec<T> {
    (0..R).flat_map(|row| (0..C).map(move |column| matrix[(row, column)])).collect()
}

pub(crate) fn numbers<T: Real>(pose: &Pose<T>) -> Vec<T> {
    by_rows(&pose.rotation).into_iter().chain(pose.position.iter().copied()).collect()
}
