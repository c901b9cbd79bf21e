//! Weighted least squares over the directions that the rows determine, and the nearest parameters that a body can have.

use nalgebra::{DMatrix, DVector};

use super::equations::Equations;
use super::{Kind, Unknown};
use darm_robot::rigid_body::cone::{Cone, ConicLeastSquares, Floor};
use darm_robot::rigid_body::inertia::{MIN_MASS_SHARE, project_physically_consistent};
use darm_robot::robot::base_parameters::Inertial;

/// Rounds in which masses are raised along what the rows do not determine.
const ROUNDS: usize = 500;
/// Share of its prior by which a value begins inside what is possible.
const INSIDE: f64 = 1e-2;
/// The information of priors falls by this ratio until it is at most this share of the least that the rows determine.
const PRIOR_RATIO: f64 = 1e-2;
const MAX_PRIOR_SHARE: f64 = 1e-6;
/// The last weight of the barriers, in units of the log-likelihood.
const MIN_WEIGHT: f64 = 1e-9;
/// The weight of barriers that keeps values in the middle of what is possible, in units of the priors; how often identified
/// ones move, and halvings of a move.
const MIDDLE: f64 = 1.0;
const MOVES: usize = 60;
const HALVINGS: i32 = 20;

/// Rows agree far better when the mean square of their residuals falls by this.
const FAR: f64 = 25.0;

/// Identified parameters.
#[derive(Clone, Debug)]
pub struct Fit {
    /// In the order of [`Equations::unknowns`].
    pub values: DVector<f64>,
    /// Sums of parameters that the rows determine.
    pub rank: usize,
    /// Their covariance, in the unknowns; what is not identified adds nothing.
    pub covariance: DMatrix<f64>,
    /// Sum of squared weighted residuals, over the rows less the rank: 1 when the noise is as it was said to be.
    pub scatter: f64,
    /// Whether every body has a positive mass, and of motions a positive definite pseudo-inertia, without a worse fit.
    pub is_possible: bool,
}

/// Equations in the directions that they determine, ready to be fitted to any of the samples.
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

    /// The parameters that these samples determine, and their covariance.
    pub(super) fn solve(&self, which: &[usize]) -> (DVector<f64>, DMatrix<f64>) {
        let (matrix, right) = self.summed(which);
        // A direction that these few samples do not determine stays as it is.
        let eigen = matrix.symmetric_eigen();
        let floor = 1e-14 * eigen.eigenvalues.max();
        let inverse = eigen.eigenvalues.map(|value| if value > floor { 1.0 / value } else { 0.0 });
        let inverse = &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
        let values = &self.equations.nominal + &self.basis * (&inverse * right);
        (values, &self.basis * inverse * self.basis.transpose())
    }

    /// AᵀA and Aᵀr of these samples together.
    fn summed(&self, which: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let r = self.basis.ncols();
        let (mut matrix, mut right) = (DMatrix::zeros(r, r), DVector::zeros(r));
        for &sample in which {
            matrix += &self.normal[sample].0;
            right += &self.normal[sample].1;
        }
        (matrix, right)
    }

    /// An orthonormal basis of the unknowns in units of their priors, n × n: first the directions that these samples
    /// identify, one for each information returned, then the others.
    fn principal_directions(&self, which: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.equations.unknowns.len();
        let eigen = self.summed(which).0.symmetric_eigen();
        let mut identified = &self.basis * eigen.eigenvectors;
        identified.row_iter_mut().zip(&self.equations.prior).for_each(|(mut row, prior)| row /= *prior);
        // The projector onto what is not identified has the eigenvalues 0 and 1.
        let rest = (DMatrix::identity(n, n) - &identified * identified.transpose()).symmetric_eigen();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| rest.eigenvalues[b].total_cmp(&rest.eigenvalues[a]));
        let n_identified = identified.ncols();
        let mut directions = identified.resize_horizontally(n, 0.0);
        for (column, &own) in (n_identified..n).zip(&order) {
            directions.set_column(column, &rest.eigenvectors.column(own));
        }
        (directions, eigen.eigenvalues.map(|value| value.max(f64::MIN_POSITIVE)))
    }
}

/// The search for possible parameters x = fitted + map·u, of whose coordinates u the rows identify the first ones.
struct InCones<'a> {
    equations: &'a Equations,
    fitted: &'a DVector<f64>,
    map: DMatrix<f64>,
    /// Of the coordinates that are identified.
    informations: &'a DVector<f64>,
    /// u of the nominal parameters.
    to_nominal: DVector<f64>,
}

impl InCones<'_> {
    /// Identified coordinates all zero, from others inside the cones: they move to zero as far as the rest, which stays in the
    /// middle of what is possible, lets them, and again. `None` where they do not get there.
    fn with_identified(&self, start: &DVector<f64>) -> Option<DVector<f64>> {
        let n_identified = self.informations.len();
        let mut identified = start.rows(0, n_identified).into_owned();
        let mut free = start.rows(n_identified, start.len() - n_identified).into_owned();
        for _ in 0..MOVES {
            free = self.free_problem(&identified).solve_at(MIDDLE, free);
            let nearer = (0..HALVINGS).map(|k| &identified * (1.0 - 0.5f64.powi(k)));
            identified = nearer.into_iter().find(|nearer| self.free_problem(nearer).is_inside(&free))?;
            if identified.amax() == 0.0 {
                let problem = self.free_problem(&identified);
                return Some(self.fitted + problem.mapped(&problem.solve(free, MIN_WEIGHT)));
            }
        }
        None
    }

    /// The free coordinates beside these identified ones: as near to nominal as the priors ask.
    fn free_problem(&self, identified: &DVector<f64>) -> ConicLeastSquares {
        let (n, n_identified) = (self.to_nominal.len(), identified.len());
        let n_free = n - n_identified;
        let at = self.fitted + self.map.columns(0, n_identified) * identified;
        let (cones, floors) = self.equations.cones_and_floors(&at);
        ConicLeastSquares {
            information: DMatrix::identity(n_free, n_free),
            gradient: -self.to_nominal.rows(n_identified, n_free),
            map: Some(self.map.columns(n_identified, n_free).into_owned()),
            cones,
            floors,
        }
    }

    /// Identified coordinates as near to zero as their information asks.
    fn near_identified(&self, start: DVector<f64>) -> DVector<f64> {
        let (n, n_identified) = (start.len(), self.informations.len());
        let (cones, floors) = self.equations.cones_and_floors(self.fitted);
        let mut problem = ConicLeastSquares {
            information: DMatrix::from_diagonal(&self.informations.clone().resize_vertically(n, 1.0)),
            gradient: DVector::from_fn(n, |k, _| if k < n_identified { 0.0 } else { -self.to_nominal[k] }),
            map: Some(self.map.clone()),
            cones,
            floors,
        };
        let mut found = problem.solve(start, MIN_WEIGHT);
        // What the rows identify comes before priors and barriers, however little that is.
        let min_information = self.informations.min();
        let mut of_priors = 1.0;
        while of_priors > MAX_PRIOR_SHARE * min_information {
            of_priors *= PRIOR_RATIO;
            for k in n_identified..n {
                problem.information[(k, k)] = of_priors;
                problem.gradient[k] = -of_priors * self.to_nominal[k];
            }
            found = problem.solve_at(of_priors * MIN_WEIGHT, found);
        }
        problem.mapped(&found) + self.fitted
    }
}

/// Sum of squared residuals over the rows less the rank.
fn scatter((columns, right): (&DMatrix<f64>, &DVector<f64>), values: &DVector<f64>, rank: usize) -> f64 {
    (right - columns * values).norm_squared() / right.len().saturating_sub(rank).max(1) as f64
}

impl Equations {
    /// The parameters that all samples determine, with bodies as possible as the rows leave them.
    pub fn fit(&self, kind: Kind) -> Fit {
        let all: Vec<usize> = (0..self.samples.len()).collect();
        let reduced = Reduced::new(self);
        let (fitted, covariance) = reduced.solve(&all);
        let rank = reduced.basis.ncols();
        let (columns, right) = self.stacked();
        let scatter = |values: &DVector<f64>| scatter((&columns, &right), values, rank);
        let values = match kind {
            Kind::Static => self.with_min_masses(&fitted),
            Kind::Moving => self.in_cones(&fitted, reduced.principal_directions(&all)),
        };
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

    /// No mass below a share of the nominal one: along what the rows do not determine as far as that goes, by projections onto
    /// the one and the other in turn. Both are convex, and orthogonal in the unit of the priors.
    fn with_min_masses(&self, fitted: &DVector<f64>) -> DVector<f64> {
        let (_, identified) = self.directions();
        let mut values = fitted.clone();
        for _ in 0..ROUNDS {
            let nearest = self.with_raised_masses(&values);
            if (&nearest - &values).component_div(&self.prior).amax() < 1e-9 {
                return nearest;
            }
            let change = (&nearest - fitted).component_div(&self.prior);
            let unidentified = &change - &identified * identified.tr_mul(&change);
            values = fitted + unidentified.component_mul(&self.prior);
        }
        self.with_raised_masses(&values)
    }

    /// The same unknowns but for masses below a share of the nominal one, which are raised to it.
    fn with_raised_masses(&self, values: &DVector<f64>) -> DVector<f64> {
        let mut raised = values.clone();
        for (k, unknown) in self.unknowns.iter().enumerate() {
            if let Unknown::Inertial(Inertial { number: 0, .. }) = unknown {
                raised[k] = values[k].max(MIN_MASS_SHARE * self.nominal[k]);
            }
        }
        raised
    }

    /// Bodies with positive definite pseudo-inertias and friction that does not push: what the rows identify as it is where there
    /// are such, else as near to `fitted` as its information asks; the rest as near to the nominal parameters as the priors ask.
    fn in_cones(
        &self,
        fitted: &DVector<f64>,
        (directions, informations): (DMatrix<f64>, DVector<f64>),
    ) -> DVector<f64> {
        let n = self.unknowns.len();
        // x = fitted + D·Q·u, with Q orthonormal.
        let from_values = |values: &DVector<f64>| directions.tr_mul(&(values - fitted).component_div(&self.prior));
        let in_cones = InCones {
            equations: self,
            fitted,
            map: DMatrix::from_fn(n, n, |a, b| self.prior[a] * directions[(a, b)]),
            informations: &informations,
            to_nominal: from_values(&self.nominal),
        };
        let start = from_values(&self.inside_all_cones());
        in_cones.with_identified(&start).unwrap_or_else(|| in_cones.near_identified(start))
    }

    /// The bodies and the friction among the changes of `fitted`.
    fn cones_and_floors(&self, fitted: &DVector<f64>) -> (Vec<Cone>, Vec<Floor>) {
        let (mut cones, mut floors) = (Vec::new(), Vec::new());
        for (k, unknown) in self.unknowns.iter().enumerate() {
            match unknown {
                Unknown::Inertial(Inertial { number: 0, .. }) => {
                    let offset = std::array::from_fn(|i| fitted[k + i]);
                    cones.push(Cone { first: k, offset, min_mass_kg: MIN_MASS_SHARE * self.nominal[k] });
                }
                Unknown::Inertial(_) => {}
                Unknown::Coulomb(_) | Unknown::Viscous(_) => floors.push(Floor { index: k, offset: fitted[k] }),
            }
        }
        (cones, floors)
    }

    /// The nominal parameters, a little inside of what is possible.
    fn inside_all_cones(&self) -> DVector<f64> {
        let mut inside = self.nominal.clone();
        for (k, unknown) in self.unknowns.iter().enumerate() {
            match unknown {
                Unknown::Inertial(Inertial { number: 0, .. }) => {
                    let nominal: [f64; 10] = std::array::from_fn(|i| self.nominal[k + i]);
                    // A file may have moments of inertia without a mass.
                    let mut body = nominal;
                    body[0] += INSIDE * self.prior[k];
                    body = project_physically_consistent(&body, &nominal);
                    [4, 6, 9].iter().for_each(|&i| body[i] += INSIDE * self.prior[k + i]);
                    (0..10).for_each(|i| inside[k + i] = body[i]);
                }
                Unknown::Inertial(_) => {}
                Unknown::Coulomb(_) | Unknown::Viscous(_) => {
                    inside[k] = inside[k].max(0.0) + INSIDE * self.prior[k];
                }
            }
        }
        inside
    }
}
