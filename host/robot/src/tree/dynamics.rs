//! Dynamics of a [`LinkTree`]: torques of a motion, mass and Coriolis matrices, gravity, energies, centre of mass.

use std::ops::AddAssign;

use darm_core::real::{Mat6, Vec3, Vec6};
use nalgebra::{DMatrix, DVector, Matrix3xX, Matrix6xX};

use super::spatial::{Motion, PointMass, SpatialInertia, cross, halves};
use super::{LinkTree, Links};

/// Mass matrix of base and joints, in blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct MassMatrix {
    /// Spatial inertia of the base with all that it carries, about the world's origin, 6 × 6.
    pub base: Mat6<f64>,
    /// Momentum about the world's origin per unit of each joint, 6 × n.
    pub coupling: Matrix6xX<f64>,
    /// The joints alone, n × n.
    pub joints: DMatrix<f64>,
}

/// Coriolis matrix of base and joints, in blocks; velocities of the base are about the world's origin.
#[derive(Clone, Debug, PartialEq)]
pub struct CoriolisMatrix {
    /// The base alone, 6 × 6.
    pub base: Mat6<f64>,
    /// What the base takes per rate of each joint, 6 × n.
    pub by_joints: Matrix6xX<f64>,
    /// What each joint takes per velocity of the base, transposed, 6 × n.
    pub by_base: Matrix6xX<f64>,
    /// The joints alone, n × n.
    pub joints: DMatrix<f64>,
}

impl MassMatrix {
    /// ½ (V, q̇)ᵀ M (V, q̇), J, for a velocity of the base about the world's origin and rates of the joints.
    pub fn kinetic_energy(&self, base: &Vec6<f64>, qd: &[f64]) -> f64 {
        let joints = DVector::from_column_slice(qd);
        let of_base = 0.5 * base.dot(&(self.base * base)) + base.dot(&(&self.coupling * &joints));
        of_base + 0.5 * joints.dot(&(&self.joints * &joints))
    }
}

/// Centre of mass and how it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct CentreOfMass {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Its place in the world, m; the origin where there is no mass.
    pub position: Vec3<f64>,
    /// Its motion per unit of each joint, 3 × n.
    pub joints: Matrix3xX<f64>,
}

impl LinkTree {
    /// Inertia of each link alone about the world's origin.
    fn inertias(&self, links: &Links) -> Vec<SpatialInertia> {
        self.bodies.iter().zip(&links.poses).map(|(body, pose)| SpatialInertia::new(body, pose)).collect()
    }

    /// Mass and first moment of each link alone.
    fn masses(&self, links: &Links) -> Vec<PointMass> {
        self.bodies.iter().zip(&links.poses).map(|(body, pose)| PointMass::new(body, pose)).collect()
    }

    /// Adds to each link what it carries, and returns what the base carries.
    fn carry<T: Copy + AddAssign>(&self, links: &mut [T], nothing: T) -> T {
        let mut base = nothing;
        for k in (0..self.len()).rev() {
            let carried = links[k];
            match self.joints[k].parent {
                Some(parent) => links[parent] += carried,
                None => base += carried,
            }
        }
        base
    }

    /// The wrench on the base about the world's origin, moment first, with that of the base's own mass, and the torques
    /// (N·m) or forces (N) of the joints, which a motion takes. The motion of the base is without free fall.
    pub fn inverse_dynamics(&self, links: &Links, base: &Motion, [qd, qdd]: [&[f64]; 2]) -> (Vec6<f64>, Vec<f64>) {
        let falling = Motion::at_rest(&self.gravity).acceleration;
        let base = Motion { velocity: base.velocity, acceleration: base.acceleration + falling };
        let motions = self.motions(links, &base, qd, qdd);
        let mut wrenches: Vec<Vec6<f64>> =
            self.inertias(links).iter().zip(&motions).map(|(inertia, motion)| inertia.wrench(motion)).collect();
        let mut on_base = SpatialInertia::new(&self.base, &links.base).wrench(&base);
        let screws = self.screws(links);
        let mut torques = vec![0.0; self.len()];
        for k in (0..self.len()).rev() {
            let wrench = wrenches[k];
            torques[k] = screws[k].dot(&wrench);
            match self.joints[k].parent {
                Some(parent) => wrenches[parent] += wrench,
                None => on_base += wrench,
            }
        }
        (on_base, torques)
    }

    /// Mass matrix by composite bodies.
    pub fn mass_matrix(&self, links: &Links) -> MassMatrix {
        let (screws, mut composites) = (self.screws(links), self.inertias(links));
        let mut base = SpatialInertia::new(&self.base, &links.base);
        base += self.carry(&mut composites, SpatialInertia::none());
        let n = self.len();
        let (mut coupling, mut joints) = (Matrix6xX::zeros(n), DMatrix::zeros(n, n));
        for (k, composite) in composites.iter().enumerate() {
            let momentum = composite.times(&screws[k]);
            coupling.set_column(k, &momentum);
            for before in self.path(Some(k)) {
                let entry = screws[before].dot(&momentum);
                joints[(before, k)] = entry;
                joints[(k, before)] = entry;
            }
        }
        MassMatrix { base: base.to_matrix(), coupling, joints }
    }

    /// C of Christoffel's symbols, for which Ṁ − 2C is skew, of a base with this velocity about the world's origin.
    ///
    /// Source: S. Echeandia, P. M. Wensing, J. of Computational and Nonlinear Dynamics 16 (2021) 091004, algorithm 1; the
    /// base is its first body.
    pub fn coriolis_matrix(&self, links: &Links, base: &Vec6<f64>, qd: &[f64]) -> CoriolisMatrix {
        let moving = Motion { velocity: *base, acceleration: Vec6::zeros() };
        let (motions, screws) = (self.motions(links, &moving, qd, &[]), self.screws(links));
        let mut inertias: Vec<Mat6<f64>> = self.inertias(links).iter().map(SpatialInertia::to_matrix).collect();
        let mut couplings: Vec<Mat6<f64>> =
            inertias.iter().zip(&motions).map(|(inertia, motion)| body_coriolis(inertia, &motion.velocity)).collect();
        let rate = |k: usize| cross(&motions[k].velocity, &screws[k]);
        let mut base_inertia = SpatialInertia::new(&self.base, &links.base).to_matrix();
        let mut base_coupling = body_coriolis(&base_inertia, base);
        let moved = across(base);
        let n = self.len();
        let (mut by_joints, mut by_base, mut joints) = (Matrix6xX::zeros(n), Matrix6xX::zeros(n), DMatrix::zeros(n, n));
        for j in (0..n).rev() {
            let (inertia, coupling) = (inertias[j], couplings[j]);
            let along = inertia * rate(j) + coupling * screws[j];
            let (carried, crossed) = (inertia * screws[j], coupling.tr_mul(&screws[j]));
            for i in self.path(Some(j)) {
                joints[(j, i)] = rate(i).dot(&carried) + screws[i].dot(&crossed);
                joints[(i, j)] = screws[i].dot(&along);
            }
            by_joints.set_column(j, &along);
            by_base.set_column(j, &(moved.tr_mul(&carried) + crossed));
            let (of_inertia, of_coupling) = match self.joints[j].parent {
                Some(parent) => (&mut inertias[parent], &mut couplings[parent]),
                None => (&mut base_inertia, &mut base_coupling),
            };
            *of_inertia += inertia;
            *of_coupling += coupling;
        }
        CoriolisMatrix { base: base_inertia * moved + base_coupling, by_joints, by_base, joints }
    }

    /// Torques (N·m) or forces (N) of the joints that hold the tree against gravity.
    pub fn gravity_torque(&self, links: &Links) -> Vec<f64> {
        let (screws, mut carried) = (self.screws(links), self.masses(links));
        self.carry(&mut carried, PointMass::none());
        carried.iter().zip(&screws).map(|(carried, screw)| -carried.momentum(screw).dot(&self.gravity)).collect()
    }

    /// Potential energy of the links, and of the base where it floats, −Σ m g·c, J.
    pub fn potential_energy(&self, links: &Links, floats: bool) -> f64 {
        let base = floats.then(|| PointMass::new(&self.base, &links.base));
        -self.masses(links).iter().chain(&base).map(|mass| mass.moment.dot(&self.gravity)).sum::<f64>()
    }

    /// Centre of mass of the links, and of the base where it floats.
    pub fn centre_of_mass(&self, links: &Links, floats: bool) -> CentreOfMass {
        let (screws, mut carried) = (self.screws(links), self.masses(links));
        let mut total = self.carry(&mut carried, PointMass::none());
        if floats {
            total += PointMass::new(&self.base, &links.base);
        }
        let mut joints = Matrix3xX::zeros(self.len());
        if total.mass <= 0.0 {
            return CentreOfMass { mass_kg: total.mass, position: Vec3::zeros(), joints };
        }
        for (k, (carried, screw)) in carried.iter().zip(&screws).enumerate() {
            joints.set_column(k, &(carried.momentum(screw) / total.mass));
        }
        CentreOfMass { mass_kg: total.mass, position: total.moment / total.mass, joints }
    }
}

/// ½ (V ×* I + (I V) ×̄* − I V ×) of one body with the velocity V.
fn body_coriolis(inertia: &Mat6<f64>, velocity: &Vec6<f64>) -> Mat6<f64> {
    let moving = across(velocity);
    let (n, f) = halves(&(inertia * velocity));
    let mut bar = Mat6::zeros();
    bar.fixed_view_mut::<3, 3>(0, 0).copy_from(&-n.cross_matrix());
    bar.fixed_view_mut::<3, 3>(0, 3).copy_from(&-f.cross_matrix());
    bar.fixed_view_mut::<3, 3>(3, 0).copy_from(&-f.cross_matrix());
    (bar - moving.transpose() * inertia - inertia * moving) * 0.5
}

/// V ×: the rate of a velocity that is fixed to a body with the velocity V, as a matrix.
fn across(velocity: &Vec6<f64>) -> Mat6<f64> {
    let (w, v) = halves(velocity);
    let mut moving = Mat6::zeros();
    moving.fixed_view_mut::<3, 3>(0, 0).copy_from(&w.cross_matrix());
    moving.fixed_view_mut::<3, 3>(3, 3).copy_from(&w.cross_matrix());
    moving.fixed_view_mut::<3, 3>(3, 0).copy_from(&v.cross_matrix());
    moving
}
