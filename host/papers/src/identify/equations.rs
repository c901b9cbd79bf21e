//! The rows K φ = Sᵀ τ + J_Cᵀ λ of all samples, weighted by the noise of the sensors.

use darm_core::actuator::JointKind;
use darm_core::se::Wrench;
use darm_core::tree::Body;
use nalgebra::{DMatrix, DVector, Matrix6xX, SVector};

use super::{Contact, Kind, Noise, Sample, Unknown, bodies, unknowns};
use darm_robot::rigid_body::inertia::prior_deviations;
use darm_robot::rigid_body::regressor::{BodyMotion, WrenchRegressor, joint_regressor, link_motions, wrench_regressor};
use darm_robot::robot::Robot;
use darm_robot::robot::base_parameters::{BaseParameters, Inertial, grouped};
use darm_robot::svd::svd;

/// Below this share of the largest singular value a direction of the parameters is not identified.
const IDENTIFIED: f64 = 1e-8;
/// What an exactly known row counts as, in its own unit.
const EXACT: f64 = 1e-6;

/// Components of a wrench, in the order of [`Rows::wrench`].
pub const WRENCH_COMPONENTS: [&str; 6] = ["Mx", "My", "Mz", "Fx", "Fy", "Fz"];

/// Which components are measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rows {
    /// Of the [`WRENCH_COMPONENTS`] of the contacts together: in the sagittal plane My, Fx and Fz.
    pub wrench: [bool; 6],
    /// The torque of each joint.
    pub torque: Vec<bool>,
}

/// Why there are no equations, or why they determine too little.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// Fewer than two different postures.
    #[error(
        "{samples} posture(s) determine {rank} of {parameters} parameters: measure at least {FEWEST} different postures"
    )]
    TooFew {
        /// Postures.
        samples: usize,
        /// How many sums of parameters they determine.
        rank: usize,
        /// How many parameters there are.
        parameters: usize,
    },
    /// The ground pulls.
    #[error(
        "the contacts pull the robot down (Fz = {force_n:.1} N), in {count} of {of} postures; give what the ground exerts on the robot, z up"
    )]
    Pulls {
        /// Line of the first.
        line: usize,
        /// Its force, N.
        force_n: f64,
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
    },
    /// A torque that opposes gravity's on the nominal robot.
    #[error(
        "the torque of {joint} is the opposite of what the nominal masses need (correlation {correlation:.2}): turn its sign round"
    )]
    Opposite {
        /// The joint.
        joint: String,
        /// Between measured and nominal torque.
        correlation: f64,
    },
    /// A number that is none.
    #[error("the equations hold no finite number; fill empty cells, and give the robot its masses")]
    NoNumber {
        /// Line of the file.
        line: usize,
    },
}

impl IdentifyError {
    /// Line of the file, where the error is in one row.
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::Pulls { line, .. } | Self::NoNumber { line } => Some(*line),
            _ => None,
        }
    }
}

/// Postures below which nothing can be identified and held out.
const FEWEST: usize = 10;
/// A measured torque that runs this much against the nominal one has the wrong sign.
const OPPOSITE: f64 = -0.8;

/// The rows of one sample.
#[derive(Clone, Debug)]
pub struct Equation {
    /// Line of the file.
    pub line: usize,
    /// K of the measured rows over their noise.
    pub columns: DMatrix<f64>,
    /// Sᵀ τ + J_Cᵀ λ over its noise.
    pub right: DVector<f64>,
    /// The wrench on the world's origin per unknown, moment first: 6 × p.
    pub wrench: Matrix6xX<f64>,
    /// The measured wrench of all contacts, moment first.
    pub measured: SVector<f64, 6>,
}

/// The equations of all samples.
#[derive(Clone, Debug)]
pub struct Equations {
    /// What is unknown.
    pub unknowns: Vec<Unknown>,
    /// The unknowns as the robot's file has them.
    pub nominal: DVector<f64>,
    /// How far each may be off before anything is measured.
    pub prior: DVector<f64>,
    /// Sample by sample.
    pub samples: Vec<Equation>,
    /// Which components are measured.
    pub rows: Rows,
    /// Noise of the sensors.
    pub noise: Noise,
}

impl Equations {
    /// The equations of these samples of a robot.
    ///
    /// # Errors
    ///
    /// There are too few samples; the ground pulls in one; a torque opposes that of gravity on the nominal robot; or a
    /// number is not finite.
    pub fn new(
        robot: &Robot,
        samples: &[Sample],
        rows: &Rows,
        noise: Noise,
        kind: Kind,
    ) -> Result<Self, IdentifyError> {
        pulls(samples)?;
        let unknowns = unknowns(robot, kind);
        let assembly = Assembly { robot, rows, noise, unknowns: &unknowns, paths: paths(robot) };
        let equations: Vec<Equation> = samples.iter().map(|sample| assembly.equation(sample)).collect();
        let finite = |e: &&Equation| !e.columns.iter().chain(e.right.iter()).all(|x| x.is_finite());
        if let Some(bad) = equations.iter().find(finite) {
            return Err(IdentifyError::NoNumber { line: bad.line });
        }
        let (nominal, prior) = nominal(robot, &unknowns);
        let all = Self { unknowns, nominal, prior, samples: equations, rows: rows.clone(), noise };
        all.signs(robot, samples)?;
        if samples.len() < FEWEST {
            let (rank, parameters) = (all.directions().0, all.unknowns.len());
            return Err(IdentifyError::TooFew { samples: samples.len(), rank, parameters });
        }
        Ok(all)
    }

    /// All rows, one sample under the other.
    pub fn stacked(&self) -> (DMatrix<f64>, DVector<f64>) {
        let count: usize = self.samples.iter().map(|sample| sample.right.len()).sum();
        let (mut columns, mut right) = (DMatrix::zeros(count, self.unknowns.len()), DVector::zeros(count));
        let mut at = 0;
        for sample in &self.samples {
            let n = sample.right.len();
            columns.rows_mut(at, n).copy_from(&sample.columns);
            right.rows_mut(at, n).copy_from(&sample.right);
            at += n;
        }
        (columns, right)
    }

    /// Rank of the equations, and the directions of the scaled unknowns that they determine, as columns.
    pub fn directions(&self) -> (usize, DMatrix<f64>) {
        let (mut columns, _) = self.stacked();
        for (mut column, prior) in columns.column_iter_mut().zip(&self.prior) {
            column *= *prior;
        }
        let none = || (0, DMatrix::zeros(self.unknowns.len(), 0));
        let Some((values, Some(v_t))) = svd(&columns).map(|parts| (parts.singular_values, parts.v_t)) else {
            return none();
        };
        let largest = values.max();
        let identified: Vec<usize> = (0..values.len()).filter(|&k| values[k] > IDENTIFIED * largest).collect();
        (identified.len(), v_t.transpose().select_columns(&identified))
    }

    /// Which sums of inertial parameters the rows determine.
    pub fn base_parameters(&self) -> BaseParameters {
        let inertial = |(k, unknown): (usize, &Unknown)| match unknown {
            Unknown::Inertial(inertial) => Some((k, *inertial)),
            _ => None,
        };
        let (indices, parameters): (Vec<usize>, Vec<Inertial>) =
            self.unknowns.iter().enumerate().filter_map(inertial).unzip();
        grouped(&parameters, &self.stacked().0.select_columns(&indices))
    }

    /// Indices of the unknowns of a body's mass and first moment.
    pub fn of_body(&self, joint: Option<usize>) -> Vec<usize> {
        let own = |k: &usize| matches!(self.unknowns[*k], Unknown::Inertial(i) if i.joint == joint && i.number < 4);
        (0..self.unknowns.len()).filter(own).collect()
    }

    /// Torques that run against those of the nominal robot.
    fn signs(&self, robot: &Robot, samples: &[Sample]) -> Result<(), IdentifyError> {
        let n_wrench = self.rows.wrench.iter().filter(|measured| **measured).count();
        let joints = (0..robot.joints.len()).filter(|&joint| self.rows.torque[joint]);
        for (row, joint) in joints.enumerate() {
            let (mut across, mut own, mut other) = (0.0, 0.0, 0.0);
            for (equation, sample) in self.samples.iter().zip(samples) {
                let needed = equation.columns.row(n_wrench + row).dot(&self.nominal.transpose());
                let measured = equation.right[n_wrench + row];
                if sample.contacts.iter().all(|contact| contact.joint.is_none()) {
                    across += needed * measured;
                    own += needed * needed;
                    other += measured * measured;
                }
            }
            let correlation = across / (own * other).sqrt();
            if correlation < OPPOSITE {
                return Err(IdentifyError::Opposite { joint: robot.joints[joint].name.clone(), correlation });
            }
        }
        Ok(())
    }
}

/// The ground pushes in most samples.
fn pulls(samples: &[Sample]) -> Result<(), IdentifyError> {
    let force = |sample: &Sample| sample.contacts.iter().map(|contact| contact.wrench.force.z).sum::<f64>();
    let bad: Vec<&Sample> = samples.iter().filter(|sample| force(sample) < 0.0).collect();
    match bad.first() {
        Some(first) => {
            Err(IdentifyError::Pulls { line: first.line, force_n: force(first), count: bad.len(), of: samples.len() })
        }
        None => Ok(()),
    }
}

/// The joints between the base and each body, the base first.
fn paths(robot: &Robot) -> Vec<Vec<usize>> {
    let parent = |joint: &usize| robot.joints.get(*joint).and_then(|joint| joint.joint.parent);
    bodies(robot).map(|body| std::iter::successors(body, parent).collect()).collect()
}

/// The unknowns as the file has them, and how far they may be off.
fn nominal(robot: &Robot, unknowns: &[Unknown]) -> (DVector<f64>, DVector<f64>) {
    let robot_kg = robot.mass().max(f64::MIN_POSITIVE);
    let of = |unknown: &Unknown| match unknown {
        Unknown::Inertial(inertial) => nominal_of_body(robot, inertial, robot_kg),
        Unknown::Coulomb(joint) => (robot.joints[*joint].friction, 1.0),
        Unknown::Viscous(joint) => (robot.joints[*joint].damping, 1.0),
    };
    let (nominal, prior): (Vec<f64>, Vec<f64>) = unknowns.iter().map(of).unzip();
    (DVector::from_vec(nominal), DVector::from_vec(prior))
}

/// A parameter of a body as the file has it, and how far it may be off; `robot_kg` is the mass of the robot.
fn nominal_of_body(robot: &Robot, Inertial { joint, number }: &Inertial, robot_kg: f64) -> (f64, f64) {
    let body = joint.map_or(&robot.base, |joint| &robot.joints[joint].joint.inertia);
    let ten = Body::from(body).parameters();
    (ten[*number], prior_deviations(&ten, robot_kg)[*number])
}

struct Assembly<'a> {
    robot: &'a Robot,
    rows: &'a Rows,
    noise: Noise,
    unknowns: &'a [Unknown],
    paths: Vec<Vec<usize>>,
}

impl Assembly<'_> {
    fn equation(&self, sample: &Sample) -> Equation {
        let [q, qd, qdd] = &sample.state;
        let moving = link_motions(self.robot, &sample.base, [q, qd, qdd]);
        let loads: Vec<WrenchRegressor> = std::iter::once(&sample.base).chain(&moving).map(wrench_regressor).collect();
        let base: Vec<usize> = (0..6).filter(|&row| self.rows.wrench[row]).collect();
        let joints: Vec<usize> = (0..moving.len()).filter(|&joint| self.rows.torque[joint]).collect();
        let mut wrench = Matrix6xX::zeros(self.unknowns.len());
        let mut columns = DMatrix::zeros(base.len() + joints.len(), self.unknowns.len());
        for (k, unknown) in self.unknowns.iter().enumerate() {
            match unknown {
                Unknown::Inertial(Inertial { joint, number }) => {
                    let body = joint.map_or(0, |joint| joint + 1);
                    wrench.set_column(k, &loads[body].column(*number));
                    base.iter().enumerate().for_each(|(row, &part)| columns[(row, k)] = wrench[(part, k)]);
                    for (row, &joint) in joints.iter().enumerate().filter(|(_, joint)| self.paths[body].contains(joint))
                    {
                        let along = joint_regressor(self.robot, joint, &moving[joint], &loads[body]);
                        columns[(base.len() + row, k)] = along[*number];
                    }
                }
                Unknown::Coulomb(joint) | Unknown::Viscous(joint) => {
                    let rate = qd[*joint];
                    let size = if matches!(unknown, Unknown::Viscous(_)) || rate == 0.0 { rate } else { rate.signum() };
                    if let Some(row) = joints.iter().position(|other| other == joint) {
                        columns[(base.len() + row, k)] = size;
                    }
                }
            }
        }
        let exerted = self.exerted(sample, &moving, &base, &joints);
        let measured = sample.contacts.iter().map(|contact| six(&contact.wrench)).sum();
        let mut right = DVector::zeros(columns.nrows());
        joints.iter().enumerate().for_each(|(row, &joint)| right[base.len() + row] = sample.torque[joint]);
        for (contact, block) in sample.contacts.iter().zip(&exerted) {
            right += block * six(&contact.wrench);
        }
        self.weigh(base.len(), &exerted, &mut columns, &mut right);
        Equation { line: sample.line, columns, right, wrench, measured }
    }

    /// J_Cᵀ of each contact, in the measured rows: rows × 6.
    fn exerted(&self, sample: &Sample, moving: &[BodyMotion], base: &[usize], joints: &[usize]) -> Vec<DMatrix<f64>> {
        sample.contacts.iter().map(|contact| self.exerted_by(contact, moving, base, joints)).collect()
    }

    /// J_Cᵀ of a contact, in the measured rows.
    fn exerted_by(&self, contact: &Contact, moving: &[BodyMotion], base: &[usize], joints: &[usize]) -> DMatrix<f64> {
        let mut block = DMatrix::zeros(base.len() + joints.len(), 6);
        base.iter().enumerate().for_each(|(row, &part)| block[(row, part)] = 1.0);
        let path = &self.paths[contact.joint.map_or(0, |joint| joint + 1)];
        for (row, &joint) in joints.iter().enumerate().filter(|(_, joint)| path.contains(joint)) {
            let axis = moving[joint].pose.rotation * self.robot.joints[joint].joint.axis.direction;
            let (moment, force) = match self.robot.joints[joint].joint.axis.kind {
                // axis·(m − o × f)
                JointKind::Revolute => (axis, -axis.cross(&moving[joint].pose.position)),
                JointKind::Prismatic => (nalgebra::Vector3::zeros(), axis),
            };
            let row = base.len() + row;
            (0..3).for_each(|k| (block[(row, k)], block[(row, 3 + k)]) = (moment[k], force[k]));
        }
        block
    }

    /// Rows over the Cholesky factor of their covariance.
    fn weigh(&self, n_base: usize, exerted: &[DMatrix<f64>], columns: &mut DMatrix<f64>, right: &mut DVector<f64>) {
        let Noise { torque_nm, force_n, moment_nm } = self.noise;
        let rows = right.len();
        let own = |row: usize| if row < n_base { EXACT } else { torque_nm.max(EXACT) };
        let mut covariance = DMatrix::from_fn(rows, rows, |a, b| if a == b { own(a).powi(2) } else { 0.0 });
        for block in exerted {
            for part in 0..6 {
                let column = block.column(part) * if part < 3 { moment_nm } else { force_n };
                covariance += &column * column.transpose();
            }
        }
        if let Some(factor) = covariance.cholesky() {
            let lower = factor.l();
            let _ = lower.solve_lower_triangular_mut(columns) && lower.solve_lower_triangular_mut(right);
        }
    }
}

/// Moment, then force.
fn six(wrench: &Wrench<f64>) -> SVector<f64, 6> {
    let (m, f) = (&wrench.moment, &wrench.force);
    SVector::from([m.x, m.y, m.z, f.x, f.y, f.z])
}

impl Equation {
    /// x and y where the contact wrench of these parameters passes through the plane z = 0, m.
    pub fn predicted_cop(&self, values: &DVector<f64>) -> [f64; 2] {
        cop(&(&self.wrench * values))
    }

    /// The same of the measured wrench.
    pub fn measured_cop(&self) -> [f64; 2] {
        cop(&self.measured)
    }

    /// Standard deviation of the measured centre of pressure with this noise, m.
    pub fn cop_noise(&self, noise: &Noise) -> [f64; 2] {
        let force = self.measured[5];
        self.measured_cop().map(|at| noise.moment_nm.hypot(at * noise.force_n) / force)
    }
}

fn cop(wrench: &SVector<f64, 6>) -> [f64; 2] {
    [-wrench[1] / wrench[5], wrench[0] / wrench[5]]
}
