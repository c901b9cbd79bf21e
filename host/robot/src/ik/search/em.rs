//! Electromagnetism-like search: points attract and repel each other as charges do.
//!
//! Equations (6) to (9) of the paper. Of n variables, point i bears the charge qᵢ = exp(−n (fᵢ − f_best) / Σₖ (fₖ −
//! f_best)), is drawn to better points and pushed by the others, Fᵢ = Σⱼ ± (xⱼ − xᵢ) qᵢ qⱼ / |xⱼ − xᵢ|², and moves by
//! λ Fᵢ/|Fᵢ|, λ drawn from (0, 1), times its room up to the bound that each component points to.
//!
//! What the paper leaves open is taken from Birbil, Fang, An electromagnetism-like mechanism for global optimization,
//! J. Global Optim. 25 (2003): the best point does not move. Points that coincide exert no force, and where all
//! values are equal all charges are 1: there the equations divide by zero.

use rand::RngExt as _;

use super::memr;
use super::{Point, Search};

/// Searches; `travels` improves every point by record-to-record travel first, in the order of the paper's Figure 4.
pub(super) fn search(search: &mut Search<'_>, travels: bool) {
    let mut points = search.population();
    while search.goes_on() {
        if travels {
            points.iter_mut().for_each(|point| *point = memr::travel(search, point));
        }
        let best = Point::best_of(&points);
        let forces = forces(&points, best);
        for (index, (point, force)) in points.iter_mut().zip(forces).enumerate() {
            if index != best {
                let x = moved(search, &point.x, &force);
                *point = search.evaluate(x);
            }
        }
    }
}

/// Equations (6) to (8).
fn forces(points: &[Point], best: usize) -> Vec<Vec<f64>> {
    let lowest = points[best].value;
    let n = points[best].x.len();
    let sum: f64 = points.iter().map(|point| point.value - lowest).sum();
    let charge = |point: &Point| {
        let share = (point.value - lowest) / sum;
        if share.is_finite() { (-(n as f64) * share).exp() } else { 1.0 }
    };
    let charges: Vec<_> = points.iter().map(charge).collect();
    let mut forces = vec![vec![0.0; n]; points.len()];
    for ((point, charge), force) in points.iter().zip(&charges).zip(&mut forces) {
        for (other, other_charge) in points.iter().zip(&charges) {
            let square: f64 = point.x.iter().zip(&other.x).map(|(a, b)| (b - a) * (b - a)).sum();
            if square > 0.0 {
                let size = charge * other_charge / square;
                let size = if other.value < point.value { size } else { -size };
                force.iter_mut().zip(point.x.iter().zip(&other.x)).for_each(|(force, (a, b))| *force += (b - a) * size);
            }
        }
    }
    forces
}

/// Equation (9).
fn moved(search: &mut Search<'_>, x: &[f64], force: &[f64]) -> Vec<f64> {
    let lambda: f64 = search.random.random();
    let length = force.iter().map(|force| force * force).sum::<f64>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return x.to_vec();
    }
    let step = |((x, force), [low, high]): ((&f64, &f64), &[f64; 2])| {
        let room = if *force > 0.0 { high - x } else { x - low };
        x + lambda * force / length * room
    };
    x.iter().zip(force).zip(search.bounds).map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::{Point, forces};

    fn point(x: f64, value: f64) -> Point {
        Point { x: vec![x], value }
    }

    #[test]
    fn the_better_attracts_and_the_worse_repels() {
        // Charges 1, e^(−1/4), e^(−3/4): f − f_best is 0, 1, 3 of a sum of 4.
        let points = [point(0.0, 1.0), point(1.0, 2.0), point(3.0, 4.0)];
        let forces = forces(&points, 0);
        let [a, b, c] = [1.0, (-0.25f64).exp(), (-0.75f64).exp()];
        // Unlike the charges of physics the best point is pushed, too: by the worse ones, away from them.
        assert!((forces[0][0] - (-a * b - a * c / 3.0)).abs() < 1e-15);
        assert!((forces[1][0] - (-a * b - b * c / 2.0)).abs() < 1e-15);
        assert!((forces[2][0] - (-a * c / 3.0 - b * c / 2.0)).abs() < 1e-15);
    }

    #[test]
    fn equal_and_coincident_points_exert_finite_forces() {
        let points = [point(0.0, 1.0), point(0.0, 1.0), point(1.0, 1.0), point(2.0, f64::INFINITY)];
        assert!(forces(&points[..3], 0).iter().chain(&forces(&points, 0)).flatten().all(|force| force.is_finite()));
    }
}
