//! Least squares over the inertial parameters of bodies that are kept physically consistent.
//!
//! # Method
//!
//! A body is consistent when its pseudo-inertia is positive definite, which is linear in its inertial parameters: the least
//! squares are solved in the cone by an interior-point method, −μ·log det for each body, with μ falling until it does not
//! matter. Source: P. M. Wensing, S. Kim, J.-J. Slotine, IEEE Robotics and Automation Letters 3 (2018) 60.

use nalgebra::{DMatrix, DVector, Matrix4, SMatrix, SVector};

use super::inertia::{self, project_physically_consistent};

/// The first μ where the optimum is near, the first one at most, and by how much it falls.
const MAX_WEIGHT: f64 = 1e2;
const LARGEST_WEIGHT: f64 = 1e12;
const WEIGHT_RATIO: f64 = 0.1;
/// Steps of Newton's method for each μ, and halvings of one.
const NEWTON: usize = 40;
const MAX_HALVINGS: i32 = 40;
/// The fall below which Newton's method ends, for μ from [`LARGE_WEIGHT`] on, and in proportion below.
const MIN_FALL: f64 = 1e-6;
const LARGE_WEIGHT: f64 = 1e-3;
/// Share of a body's inertia that is added to begin inside the cone.
const INSIDE: f64 = 1e-2;
/// A body of 1 kg, 0.1 m large.
const SOME_BODY: [f64; 10] = [1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.01, 0.0, 0.0, 0.01];
/// Share of its diagonal that is added to a Hessian, so that what nothing determines stays.
const RIDGE: f64 = 1e-14;

/// A body among the values x: its ten inertial parameters are `offset` plus ten values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Where its values begin.
    pub first: usize,
    /// Its inertial parameters where these values are zero.
    pub offset: [f64; 10],
    /// What its mass is above, kg.
    pub min_mass_kg: f64,
}

/// A value among x that is above a least one: `offset` plus the value is positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Its number.
    pub index: usize,
    /// What is added to it.
    pub offset: f64,
}

/// ½uᵀAu + gᵀu, with bodies consistent and some values above their floors.
#[derive(Clone, Debug)]
pub struct ConicLeastSquares {
    /// A: n × n, symmetric, in units of the log-likelihood.
    pub information: DMatrix<f64>,
    /// g.
    pub gradient: DVector<f64>,
    /// T of x = T·u; `None`: x = u.
    pub map: Option<DMatrix<f64>>,
    /// The bodies among x.
    pub cones: Vec<Cone>,
    /// Values of x with a least one.
    pub floors: Vec<Floor>,
}

impl Cone {
    /// A body whose values are changes of its nominal parameters, with a mass of at least
    /// [`MIN_MASS_SHARE`](inertia::MIN_MASS_SHARE) of the nominal one.
    pub fn around(first: usize, nominal: [f64; 10]) -> Self {
        Self { first, offset: nominal, min_mass_kg: inertia::MIN_MASS_SHARE * nominal[0] }
    }

    /// Whether the body is consistent with these values.
    pub fn is_consistent(&self, values: &DVector<f64>) -> bool {
        let body = self.body(values);
        project_physically_consistent(&body, &self.offset) == body
    }

    /// Sets the values to those of the body at its offset, made consistent, so far inside that Newton's method can begin; without
    /// a mass to those of a body of 1 kg.
    pub fn start(&self, values: &mut DVector<f64>) {
        let nominal = if self.offset[0] > 0.0 { &self.offset } else { &SOME_BODY };
        let mut body = project_physically_consistent(nominal, nominal);
        let inside = INSIDE * (body[4] + body[6] + body[9] + f64::MIN_POSITIVE);
        [4, 6, 9].iter().for_each(|&k| body[k] += inside);
        (0..10).for_each(|k| values[self.first + k] = body[k] - self.offset[k]);
    }

    fn body(&self, values: &DVector<f64>) -> [f64; 10] {
        std::array::from_fn(|k| self.offset[k] + values[self.first + k])
    }

    /// −log det of the pseudo-inertia −log of what the mass is above the least; `None` outside.
    fn barrier(&self, values: &DVector<f64>) -> Option<f64> {
        let body = self.body(values);
        let root = inertia::pseudo_inertia(&body).cholesky()?;
        let spare = body[0] - self.min_mass_kg;
        (spare > 0.0).then(|| -2.0 * root.l().diagonal().map(f64::ln).sum() - spare.ln())
    }

    /// Its gradient and Hessian.
    fn slopes(&self, values: &DVector<f64>) -> Option<(SVector<f64, 10>, SMatrix<f64, 10, 10>)> {
        let body = self.body(values);
        let root = inertia::pseudo_inertia(&body).cholesky()?;
        let of_mass = 1.0 / (body[0] - self.min_mass_kg);
        let unit =
            |k: usize| root.solve(&inertia::pseudo_inertia(&std::array::from_fn(|j| f64::from(u8::from(j == k)))));
        let units: [Matrix4<f64>; 10] = std::array::from_fn(unit);
        let mut gradient = SVector::from_fn(|k, _| -units[k].trace());
        let mut hessian = SMatrix::from_fn(|a, b| (units[a] * units[b]).trace());
        gradient[0] -= of_mass;
        hessian[(0, 0)] += of_mass * of_mass;
        Some((gradient, hessian))
    }
}

impl ConicLeastSquares {
    /// The least values u, from values inside all cones and floors, with μ down to `min_weight`.
    pub fn solve(&self, start: DVector<f64>, min_weight: f64) -> DVector<f64> {
        let (mut values, mut weight) = (start, MAX_WEIGHT);
        // With a smaller μ the first step would end at the border of a cone, and all later ones near it.
        while weight < LARGEST_WEIGHT && self.fall(weight, &values).is_some_and(|fall| fall > weight) {
            weight /= WEIGHT_RATIO;
        }
        while weight > 0.9 * min_weight {
            values = self.solve_at(weight, values);
            weight *= WEIGHT_RATIO;
        }
        values
    }

    /// The same for one μ, from values near those of a larger one.
    pub fn solve_at(&self, weight: f64, start: DVector<f64>) -> DVector<f64> {
        let mut values = start;
        for _ in 0..NEWTON {
            let Some(next) = self.newton(weight, &values) else { break };
            values = next;
        }
        values
    }

    /// x of u.
    pub fn mapped(&self, values: &DVector<f64>) -> DVector<f64> {
        self.map.as_ref().map_or_else(|| values.clone(), |map| map * values)
    }

    /// Whether values u are inside all cones and above all floors.
    pub fn is_inside(&self, values: &DVector<f64>) -> bool {
        self.barrier(values).is_some()
    }

    /// All barriers at these values; `None` outside.
    fn barrier(&self, values: &DVector<f64>) -> Option<f64> {
        let x = self.mapped(values);
        let cones: Option<f64> = self.cones.iter().map(|cone| cone.barrier(&x)).sum();
        let above = |floor: &Floor| Some(x[floor.index] + floor.offset).filter(|above| *above > 0.0);
        let floors: Option<f64> = self.floors.iter().map(|floor| above(floor).map(|above| -above.ln())).sum();
        Some(cones? + floors?)
    }

    /// Gradient and Hessian of all barriers over u.
    fn slopes(&self, values: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let x = self.mapped(values);
        let (mut slope, mut curvature) = (DVector::zeros(x.len()), DMatrix::zeros(x.len(), x.len()));
        for cone in &self.cones {
            let (of_slope, of_curvature) = cone.slopes(&x)?;
            let mut slope = slope.fixed_rows_mut::<10>(cone.first);
            slope += of_slope;
            let mut curvature = curvature.fixed_view_mut::<10, 10>(cone.first, cone.first);
            curvature += of_curvature;
        }
        for floor in &self.floors {
            let above = x[floor.index] + floor.offset;
            slope[floor.index] -= 1.0 / above;
            curvature[(floor.index, floor.index)] += 1.0 / (above * above);
        }
        Some(match &self.map {
            Some(map) => (map.tr_mul(&slope), map.tr_mul(&(curvature * map))),
            None => (slope, curvature),
        })
    }

    /// By how much a step of Newton's method would lower all; a fall of μ is as far as the barriers are about quadratic.
    fn fall(&self, weight: f64, values: &DVector<f64>) -> Option<f64> {
        let (slope, step) = self.step(weight, values)?;
        Some(-slope.dot(&step))
    }

    /// The slope of ½uᵀAu + gᵀu + μ·barriers, and the step of Newton's method.
    fn step(&self, weight: f64, values: &DVector<f64>) -> Option<(DVector<f64>, DVector<f64>)> {
        let (of_barriers, curvature) = self.slopes(values)?;
        let slope = &self.information * values + &self.gradient + of_barriers * weight;
        let step = -solved(&self.information + curvature * weight, &slope);
        Some((slope, step))
    }

    /// One step of Newton's method on ½uᵀAu + gᵀu + μ·barriers, short enough to stay inside and to fall; `None` at the end.
    fn newton(&self, weight: f64, values: &DVector<f64>) -> Option<DVector<f64>> {
        let (slope, step) = self.step(weight, values)?;
        let fall = -slope.dot(&step);
        if fall < MIN_FALL * (weight / LARGE_WEIGHT).min(1.0) {
            return None;
        }
        let at = |values: &DVector<f64>| -> Option<f64> {
            let square = 0.5 * values.dot(&(&self.information * values)) + values.dot(&self.gradient);
            Some(square + weight * self.barrier(values)?)
        };
        let height = at(values)?;
        let mut steps = (0..MAX_HALVINGS).map(|k| (0.5f64.powi(k), values + &step * 0.5f64.powi(k)));
        let lower = |(share, next): &(f64, DVector<f64>)| at(next).is_some_and(|new| new < height - 0.1 * share * fall);
        steps.find(lower).map(|(_, next)| next)
    }
}

/// x with H·x = b for a Hessian H, scaled to its diagonal and made safe by a share of [`RIDGE`] of it.
fn solved(mut hessian: DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    let scale = hessian.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    for (column, by) in scale.iter().enumerate() {
        hessian.column_mut(column).component_mul_assign(&(&scale * *by));
        hessian[(column, column)] += if *by > 0.0 { 0.0 } else { 1.0 };
    }
    // Rounding can take what is nearly singular below zero: then a larger share of the diagonal is added.
    let mut ridge = RIDGE;
    while ridge < 1.0 {
        let mut safe = hessian.clone();
        safe.set_diagonal(&hessian.diagonal().map(|d| d + ridge));
        if let Some(root) = safe.cholesky() {
            return root.solve(&right.component_mul(&scale)).component_mul(&scale);
        }
        ridge *= 100.0;
    }
    DVector::zeros(right.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of 2 kg.
    const BALL: [f64; 10] = [2.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.02, 0.0, 0.0, 0.02];

    #[test]
    fn the_nearest_body_in_the_cone_is_on_its_border() {
        // The data want its first inertia at −1 kg·m² and all else as it is, each to 0.01 of its unit.
        let cone = Cone::around(0, BALL);
        let information = DMatrix::identity(10, 10) * 1e4;
        let mut wanted = DVector::zeros(10);
        wanted[4] = -1.02;
        let gradient = &information * &wanted * -1.0;
        let mut values = DVector::zeros(10);
        cone.start(&mut values);
        let problem = ConicLeastSquares { information, gradient, map: None, cones: vec![cone], floors: Vec::new() };
        let body = cone.body(&problem.solve(values, 1e-3));
        // Nearest to (−1, 0.02, 0.02) with Iyy ≤ Ixx + Izz, Izz ≤ Ixx + Iyy and Ixx ≥ 0 is (0, 0.02, 0.02).
        assert!(body[4].abs() < 1e-4 && (body[6] - 0.02).abs() < 1e-4 && (body[9] - 0.02).abs() < 1e-4, "{body:?}");
        assert!(inertia::pseudo_inertia(&body).cholesky().is_some());
    }

    #[test]
    fn a_consistent_optimum_is_met_in_other_coordinates_and_a_floor_holds() {
        // The data want 3 kg, which is consistent, and −1 of a friction that is at least 0. The coordinates are turned.
        let n = 11;
        let turned = DMatrix::from_fn(n, n, |a, b| ((a * n + b) as f64).sin()).qr().q();
        let mut wanted = DVector::zeros(n);
        (wanted[0], wanted[10]) = (1.0, -1.0);
        let information = DMatrix::identity(n, n) * 1e4;
        let gradient = turned.tr_mul(&wanted) * -1e4;
        let cone = Cone::around(0, BALL);
        let mut start = DVector::zeros(n);
        cone.start(&mut start);
        start[10] = 0.5;
        let floors = vec![Floor { index: 10, offset: 0.0 }];
        let map = Some(turned.clone());
        let problem = ConicLeastSquares { information, gradient, map, cones: vec![cone], floors };
        let found = &turned * problem.solve(turned.tr_mul(&start), 1e-9);
        // μ/λ over the distance to the border is 1e-9/1e4/0.01 = 1e-11 inside, √(μ/λ) = 3e-7 on the border.
        assert!((found[0] - 1.0).abs() < 1e-6 && (0.0..1e-5).contains(&found[10]), "{found}");
    }

    #[test]
    fn a_body_far_heavier_than_the_nominal_one_is_found() {
        // A wrist of 0.2 kg to which the data bolt 2 kg, with 0.1 kg·m² less about z than a body can have; they determine
        // combinations of the parameters to between 1e-2 and 1e-5 of their units.
        let wrist = [0.2, 0.0, 0.0, 0.0084, 3.5e-4, 0.0, 3.5e-4, 0.0, 0.0, 4e-5];
        let bolted = [2.0, 0.06, 0.0, 0.2, 0.02, 0.0, 0.0218, -0.006, 0.0, -0.1];
        let n = 10;
        let turned = DMatrix::from_fn(n, n, |a, b| ((3 * a + b * b) as f64).sin()).qr().q();
        let certain = DMatrix::from_diagonal(&DVector::from_fn(n, |k, _| 10f64.powf(4.0 + 6.0 * k as f64 / 9.0)));
        let information = turned.tr_mul(&certain) * &turned;
        let gradient = -(&information * DVector::from_row_slice(&bolted));
        let height = |values: &DVector<f64>| 0.5 * values.dot(&(&information * values)) + values.dot(&gradient);
        let cone = Cone::around(0, wrist);
        let solved_from = |start: &DVector<f64>| {
            let (information, gradient) = (information.clone(), gradient.clone());
            let problem = ConicLeastSquares { information, gradient, map: None, cones: vec![cone], floors: Vec::new() };
            height(&problem.solve(start.clone(), 1e-3))
        };
        let mut nominal = DVector::zeros(n);
        cone.start(&mut nominal);
        let mut near = DVector::zeros(n);
        let consistent = [2.2, 0.06, 0.0, 0.2084, 0.05, 0.0, 0.06, -0.006, 0.0, 0.03];
        (0..n).for_each(|k| near[k] = consistent[k] - wrist[k]);
        let (from_nominal, from_near) = (solved_from(&nominal), solved_from(&near));
        // Both are within 4·μ of the least, and that is far below a unit of the log-likelihood.
        assert!((from_nominal - from_near).abs() < 0.05, "{from_nominal} {from_near}");
    }
}
