//! What each look may spend of the chance of a false alarm.
//!
//! The looks are fixed before the first one. When a share t of all visits is made the loop has spent the share
//! ln(1 + (e − 1)·t), Pocock's boundary as a spending function; a look may spend what was added since the one before. The
//! effects that a calibration is to find are many times the noise, and with Pocock's boundary such effects are found in the
//! first looks; that of O'Brien and Fleming spends next to nothing there.
//!
//! The shares are added (Bonferroni): no joint distribution of the looks is assumed. The exact boundaries need one with
//! independent increments, and there is none here: the words depend on the looks before, and each look may test another
//! effect. With a dozen looks that costs little, since a level enters the limit of a test by its logarithm.
//!
//! Source: K. K. G. Lan, D. L. DeMets, Biometrika 70 (1983) 659.

/// The share of the chance of a false alarm that each look may spend, by the number of visits of each; they add up to one.
pub fn shares(visits: &[usize]) -> Vec<f64> {
    let all = visits.iter().sum::<usize>().max(1) as f64;
    let spent = |visits: usize| (1.0 + (std::f64::consts::E - 1.0) * visits as f64 / all).ln();
    let mut made = 0;
    let share = |&more: &usize| {
        made += more;
        spent(made) - spent(made - more)
    };
    visits.iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::shares;

    #[test]
    fn the_shares_add_up_to_one_and_an_early_visit_spends_most() {
        for visits in [&[40][..], &[1, 1], &[62, 31, 31, 31]] {
            let shares = shares(visits);
            assert_eq!(shares.len(), visits.len());
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let of_visit = |(share, visits): (&f64, &usize)| share / *visits as f64;
            assert!(shares.iter().zip(visits).map(of_visit).is_sorted_by(|a, b| a > b));
        }
        // Half of the visits spend ln(1 + (e − 1)/2) = 0.6201.
        assert!((shares(&[5, 5])[0] - 0.6201).abs() < 1e-4);
    }
}
