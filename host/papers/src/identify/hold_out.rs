//! How well identified parameters predict the centre of pressure of postures that no fit saw.

use nalgebra::DVector;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::equations::Equations;
use super::fit::Reduced;

/// Errors of the centre of pressure on held-out postures, over all splits. RMS, m.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// How many splits were drawn.
    pub splits: usize,
    /// Postures held out in each.
    pub held_out: usize,
    /// Along x and y, where they are measured: with the identified parameters.
    pub identified_m: [Option<f64>; 2],
    /// With the nominal ones.
    pub nominal_m: [Option<f64>; 2],
    /// Noise of the measured centre of pressure itself.
    pub noise_m: [Option<f64>; 2],
    /// The error of the worst split along x, with the identified parameters.
    pub worst_m: Option<f64>,
}

/// Fits to `share` of the postures and predicts the others, over as many random splits.
pub fn hold_out(equations: &Equations, share: f64, splits: usize, seed: u64) -> HeldOut {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let reduced = Reduced::new(equations);
    let mut order: Vec<usize> = (0..equations.samples.len()).collect();
    let fitted = ((order.len() as f64 * share).round() as usize).clamp(1, order.len().saturating_sub(1).max(1));
    let (mut squares, mut worst) = ([0.0; 2], 0.0f64);
    for _ in 0..splits {
        order.shuffle(&mut random);
        let (values, _) = reduced.solve(&order[..fitted]);
        let errors = rms_cop(equations, &values, &order[fitted..]);
        squares.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error * error);
        worst = worst.max(errors[0]);
    }
    let measured = axes(equations);
    let only = |numbers: [f64; 2]| std::array::from_fn(|k| measured[k].then_some(numbers[k]));
    let noise = |k: usize| {
        let square = |e: &super::equations::Equation| e.cop_noise(&equations.noise)[k].powi(2);
        (equations.samples.iter().map(square).sum::<f64>() / equations.samples.len() as f64).sqrt()
    };
    HeldOut {
        splits,
        held_out: order.len() - fitted,
        identified_m: only(squares.map(|sum| (sum / splits.max(1) as f64).sqrt())),
        nominal_m: only(rms_cop(equations, &equations.nominal, &order)),
        noise_m: only([noise(0), noise(1)]),
        worst_m: measured[0].then_some(worst),
    }
}

/// RMS of predicted less measured centre of pressure along x and y, over these samples, m.
pub fn rms_cop(equations: &Equations, values: &DVector<f64>, which: &[usize]) -> [f64; 2] {
    let mut squares = [0.0; 2];
    for equation in which.iter().map(|&k| &equations.samples[k]) {
        let apart = equation.predicted_cop(values).into_iter().zip(equation.measured_cop());
        squares.iter_mut().zip(apart).for_each(|(sum, (a, b))| *sum += (a - b).powi(2));
    }
    squares.map(|sum| (sum / which.len().max(1) as f64).sqrt())
}

/// Whether x and y of the centre of pressure are measured.
fn axes(equations: &Equations) -> [bool; 2] {
    let [mx, my, _, _, _, fz] = equations.rows.wrench;
    [fz && my, fz && mx]
}
