//! The tests that a diagnosis rests on: is this more than chance?
//!
//! | question | test | level |
//! | --- | --- | --- |
//! | is there more than noise? | residuals against repeats: F, one-sided | [`STRUCTURE_LEVEL`] |
//! | does an effect predict words that it was not fitted to? | gain of the cross-validated loss, word by word: t, one-sided, times the number of effects tried (Bonferroni) | [`DISCOVERY_LEVEL`] |
//! | does it predict held-out words? | the same on the held-out words, once | [`CONFIRMATION_LEVEL`] |
//! | is another effect as good? | gain against the best, word by word: t, one-sided | [`RIVAL_LEVEL`] |

use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

/// Chance to see structure in pure noise.
pub const STRUCTURE_LEVEL: f64 = 1e-3;
/// Chance to discover any effect, of all that are tried, where there is none.
pub const DISCOVERY_LEVEL: f64 = 0.01;
/// Chance that an effect which is not there is confirmed.
pub const CONFIRMATION_LEVEL: f64 = 0.025;
/// An effect worse than the best one with at least this confidence is not its rival.
pub const RIVAL_LEVEL: f64 = 0.05;

/// The mean of some gains, word by word, and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// The mean gain.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
    /// Chance of at least this mean where there is no gain.
    pub p: f64,
}

/// By how much `after` is lower than `before`, pair by pair.
pub fn gain(before: &[f64], after: &[f64]) -> Gain {
    let n = before.len() as f64;
    let differences: Vec<f64> = before.iter().zip(after).map(|(b, a)| b - a).collect();
    let mean = differences.iter().sum::<f64>() / n.max(1.0);
    if differences.len() < 2 {
        return Gain { mean, error: f64::INFINITY, p: 1.0 };
    }
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / n).sqrt();
    if error == 0.0 {
        return Gain { mean, error, p: if mean > 0.0 { 0.0 } else { 1.0 } };
    }
    let p = StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |t| t.sf(mean / error));
    Gain { mean, error, p }
}

/// Chance that a mean square this many times the noise's is noise.
pub fn f_test(ratio: f64, dof: usize, noise_dof: usize) -> f64 {
    if dof == 0 || noise_dof == 0 {
        return 1.0;
    }
    FisherSnedecor::new(dof as f64, noise_dof as f64).map_or(1.0, |f| f.sf(ratio.max(0.0)))
}

/// How many standard errors wide 95 % of a mean's distribution reaches to one side.
pub fn quantile_975(dof: usize) -> f64 {
    StudentsT::new(0.0, 1.0, dof.max(1) as f64).map_or(1.96, |t| t.inverse_cdf(0.975))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_everywhere_is_certain() {
        assert_eq!(gain(&[3.0, 4.0, 5.0], &[1.0, 2.0, 3.0]), Gain { mean: 2.0, error: 0.0, p: 0.0 });
    }

    #[test]
    fn no_gain_is_chance() {
        assert!((gain(&[1.0, 0.0], &[0.0, 1.0]).p - 0.5).abs() < 1e-12);
    }

    #[test]
    fn table_values() {
        // Fisher's tables: F(0.99; 4, 10) = 5.994, t(0.975; 10) = 2.228.
        assert!((f_test(5.994, 4, 10) - 0.01).abs() < 1e-5);
        assert!((quantile_975(10) - 2.228).abs() < 1e-3);
    }
}
