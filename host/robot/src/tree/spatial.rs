//! Spatial vectors and inertias about the world's origin, in the axes of the world, angular part first.

use std::ops::AddAssign;

use darm_core::real::{Mat3, Mat6, Vec3, Vec6};
use darm_core::se::Pose;
use darm_core::tree::Body;

/// Velocity of a body and its spatial acceleration: the rate of the velocity's six numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Angular velocity, and velocity of the point of the body at the world's origin: rad/s and m/s.
    pub velocity: Vec6<f64>,
    /// Rate of the velocity, rad/s² and m/s².
    pub acceleration: Vec6<f64>,
}

impl Motion {
    /// Rest in this field of free fall (m/s²), which counts as an acceleration the other way.
    pub fn at_rest(gravity: &Vec3<f64>) -> Self {
        Self { velocity: Vec6::zeros(), acceleration: six(&Vec3::zeros(), &-gravity) }
    }
}

/// Mass, first moment and moments of inertia of a body about the world's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpatialInertia {
    /// m, kg.
    pub mass: f64,
    /// m·c, kg·m.
    pub moment: Vec3<f64>,
    /// Moments of inertia, kg·m².
    pub inertia: Mat3<f64>,
}

impl SpatialInertia {
    /// No mass.
    pub fn none() -> Self {
        Self { mass: 0.0, moment: Vec3::zeros(), inertia: Mat3::zeros() }
    }

    /// The inertia of a body whose frame has this pose in the world.
    pub fn new(body: &Body<f64>, pose: &Pose<f64>) -> Self {
        let (r, p) = (&pose.rotation, &pose.position);
        let moment = r * body.moment;
        let across = p * moment.transpose();
        let shift = (across + across.transpose() + p * p.transpose() * body.mass) * -1.0;
        let inertia = r * body.inertia.to_matrix() * r.transpose() + shift - Mat3::from_diagonal_element(shift.trace());
        Self { mass: body.mass, moment: moment + p * body.mass, inertia }
    }

    /// Momentum, angular part first, of a body with this velocity.
    pub fn times(&self, velocity: &Vec6<f64>) -> Vec6<f64> {
        let (w, v) = halves(velocity);
        six(&(self.inertia * w + self.moment.cross(&v)), &(v * self.mass - self.moment.cross(&w)))
    }

    /// The wrench that a motion takes, moment first.
    pub fn wrench(&self, motion: &Motion) -> Vec6<f64> {
        self.times(&motion.acceleration) + cross_dual(&motion.velocity, &self.times(&motion.velocity))
    }

    /// The same inertia as a matrix.
    pub fn to_matrix(&self) -> Mat6<f64> {
        let mut matrix = Mat6::zeros();
        let skew = self.moment.cross_matrix();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.inertia);
        matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew);
        matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&-skew);
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&Mat3::from_diagonal_element(self.mass));
        matrix
    }
}

/// Mass and first moment of a body about the world's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMass {
    /// m, kg.
    pub mass: f64,
    /// m·c, kg·m.
    pub moment: Vec3<f64>,
}

impl PointMass {
    /// No mass.
    pub fn none() -> Self {
        Self { mass: 0.0, moment: Vec3::zeros() }
    }

    /// The mass of a body whose frame has this pose in the world.
    pub fn new(body: &Body<f64>, pose: &Pose<f64>) -> Self {
        Self { mass: body.mass, moment: pose.rotation * body.moment + pose.position * body.mass }
    }

    /// Linear momentum of the body with this velocity.
    pub fn momentum(&self, velocity: &Vec6<f64>) -> Vec3<f64> {
        let (w, v) = halves(velocity);
        v * self.mass + w.cross(&self.moment)
    }
}

impl AddAssign for PointMass {
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.moment += other.moment;
    }
}

impl AddAssign for SpatialInertia {
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.moment += other.moment;
        self.inertia += other.inertia;
    }
}

/// Six numbers, the angular three or the moment first.
pub fn six(angular: &Vec3<f64>, linear: &Vec3<f64>) -> Vec6<f64> {
    Vec6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z)
}

/// The angular part or moment, and the linear part or force.
pub fn halves(vector: &Vec6<f64>) -> (Vec3<f64>, Vec3<f64>) {
    (Vec3::new(vector[0], vector[1], vector[2]), Vec3::new(vector[3], vector[4], vector[5]))
}

/// Rate of a velocity `moved` that is fixed to a body with this velocity.
pub fn cross(velocity: &Vec6<f64>, moved: &Vec6<f64>) -> Vec6<f64> {
    let ((w, v), (a, b)) = (halves(velocity), halves(moved));
    six(&w.cross(&a), &(w.cross(&b) + v.cross(&a)))
}

/// Rate of a momentum or wrench that is fixed to a body with this velocity.
pub fn cross_dual(velocity: &Vec6<f64>, moved: &Vec6<f64>) -> Vec6<f64> {
    let ((w, v), (n, f)) = (halves(velocity), halves(moved));
    six(&(w.cross(&n) + v.cross(&f)), &w.cross(&f))
}
