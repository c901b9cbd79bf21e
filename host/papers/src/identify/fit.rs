//! Weighted least squares over the directions that the rows tell, and the nearest parameters that a body can have.

use nalgebra::{DMatrix, DVector};

use super::equations::Equations;
use super::{Kind, Unknown};
use darm_robot::rigid_body::inertia::project_physically_consistent;

/// Rounds in which impossible bodies are made possible along what the rows do not tell.
const ROUNDS: usize = 500;
/// The least mass of a body as a share of the nominal one, as for [`project_physically_consistent`].
const LEAST_MASS: f64 = 0.1;

/// Rows agree far better when the mean square of their residuals falls by this.
const FAR: f64 = 25.0;

/// Identified parameters.
#[derive(Clone, Debug)]
pub struct Fit {
    /// In the order of [`Equations::unknowns`].
    pub values: DVector<f64>,
    /// Sums of parameters that the rows tell.
    pub rank: usize,
    /// Their covariance, in the unknowns; what is not told adds nothing.
    pub covariance: DMatrix<f64>,
    /// Sum of squared weighted residuals, over the rows less the rank: 1 when the noise is as it was said to be.
    pub scatter: f64,
    /// Whether every body has a positive mass, and of motions a positive definite pseudo-inertia, without a worse fit.
    pub is_possible: bool,
}

/// Equations in the directions that they tell, ready to be fitted to any of the samples.
#[derive(Clone, Debug)]
pub(super) struct Reduced<'a> {
    equations: &'a Equations,
    /// Directions of the unknowns, in their own units: p × r.
    basis: DMatrix<f64>,
    /// AᵀA and Aᵀr of every sample, with the residual r of the nominal parameters.
    normal: Vec<(DMatrix<f64>, DVector<f64>)>,
}

impl<'a> Reduced<'a> {
    pub(super) fn new(equations: &'a Equations) -> Self {
        let (_, mut basis) = equations.directions();
        for (mut row, prior) in basis.row_iter_mut().zip(&equations.prior) {
            row *= *prior;
        }
        let of = |sample: &super::equations::Equation| {
            let columns = &sample.columns * &basis;
            let residual = &sample.right - &sample.columns * &equations.nominal;
            (columns.tr_mul(&columns), columns.tr_mul(&residual))
        };
        let normal = equations.samples.iter().map(of).collect();
        Self { equations, basis, normal }
    }

    /// The parameters that these samples tell, and their covariance.
    pub(super) fn solve(&self, which: &[usize]) -> (DVector<f64>, DMatrix<f64>) {
        let r = self.basis.ncols();
        let (mut matrix, mut right) = (DMatrix::zeros(r, r), DVector::zeros(r));
        for &sample in which {
            matrix += &self.normal[sample].0;
            right += &self.normal[sample].1;
        }
        // A direction that these few samples do not tell stays as it is.
        let eigen = matrix.symmetric_eigen();
        let floor = 1e-14 * eigen.eigenvalues.max();
        let inverse = eigen.eigenvalues.map(|value| if value > floor { 1.0 / value } else { 0.0 });
        let inverse = &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
        let values = &self.equations.nominal + &self.basis * (&inverse * right);
        (values, &self.basis * inverse * self.basis.transpose())
    }
}

/// Sum of squared residuals over the rows less the rank.
fn scatter((columns, right): (&DMatrix<f64>, &DVector<f64>), values: &DVector<f64>, rank: usize) -> f64 {
    (right - columns * values).norm_squared() / right.len().saturating_sub(rank).max(1) as f64
}

impl Equations {
    /// The parameters that all samples tell, with bodies as possible as the rows leave them.
    pub fn fit(&self, kind: Kind) -> Fit {
        let all: Vec<usize> = (0..self.samples.len()).collect();
        let reduced = Reduced::new(self);
        let (fitted, covariance) = reduced.solve(&all);
        let rank = reduced.basis.ncols();
        let (columns, right) = self.stacked();
        let scatter = |values: &DVector<f64>| scatter((&columns, &right), values, rank);
        let values = self.possible(&fitted, kind);
        let is_possible = scatter(&values) <= scatter(&fitted) * (1.0 + 1e-6) + 1e-12;
        Fit { scatter: scatter(&values), values, rank, covariance, is_possible }
    }

    /// The component of the contacts' wrench (index in [`WRENCH_COMPONENTS`](super::equations::WRENCH_COMPONENTS)) with whose sign turned the rows agree far better, and the residual
    /// over the noise that they then have. Contacts beyond joints are in those joints' rows too: what they hide is not seen.
    pub fn turned(&self, fit: &Fit) -> Option<(usize, f64)> {
        let all: Vec<usize> = (0..self.samples.len()).collect();
        let turned = |row: usize| {
            let mut other = self.clone();
            other.samples.iter_mut().for_each(|sample| sample.right[row] = -sample.right[row]);
            let (values, _) = Reduced::new(&other).solve(&all);
            let (columns, right) = other.stacked();
            scatter((&columns, &right), &values, fit.rank)
        };
        let measured = (0..6).filter(|&component| self.rows.wrench[component]).enumerate();
        let far =
            measured.map(|(row, component)| (component, turned(row))).filter(|(_, left)| left * FAR < fit.scatter);
        far.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(component, left)| (component, left.sqrt()))
    }

    /// The nearest possible bodies, along what the rows do not tell as far as that goes: projections onto the one and the
    /// other in turn.
    fn possible(&self, fitted: &DVector<f64>, kind: Kind) -> DVector<f64> {
        let (_, told) = self.directions();
        let mut values = fitted.clone();
        for _ in 0..ROUNDS {
            let nearest = self.nearest(&values, kind);
            if (&nearest - &values).component_div(&self.prior).amax() < 1e-9 {
                return nearest;
            }
            let change = (&nearest - fitted).component_div(&self.prior);
            let untold = &change - &told * told.tr_mul(&change);
            values = fitted + untold.component_mul(&self.prior);
        }
        self.nearest(&values, kind)
    }

    /// Every body alone made possible, and friction that does not push.
    fn nearest(&self, values: &DVector<f64>, kind: Kind) -> DVector<f64> {
        let mut nearest = values.clone();
        for (k, unknown) in self.unknowns.iter().enumerate() {
            match unknown {
                Unknown::Inertial(inertial) if inertial.number == 0 => match kind {
                    Kind::Static => nearest[k] = values[k].max(LEAST_MASS * self.nominal[k]),
                    Kind::Moving => {
                        let ten = std::array::from_fn(|i| values[k + i]);
                        let named = std::array::from_fn(|i| self.nominal[k + i]);
                        project_physically_consistent(&ten, &named)
                            .iter()
                            .enumerate()
                            .for_each(|(i, value)| nearest[k + i] = *value);
                    }
                },
                Unknown::Inertial(_) => {}
                Unknown::Coulomb(_) | Unknown::Viscous(_) => nearest[k] = values[k].max(0.0),
            }
        }
        nearest
    }
}
