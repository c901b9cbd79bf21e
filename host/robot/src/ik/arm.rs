//! What inverse kinematics moves: the joints between a base and a tool, in series, and the variables that move them.

use darm_core::actuator::{Axis, JointKind};
use darm_core::ik::{Options, error};
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist, rotation_about};
use nalgebra::{DMatrix, DVector, Matrix6xX};

use crate::tree::spatial::six;

/// Width that is searched where a limit is missing, rad or m.
const UNLIMITED: f64 = std::f64::consts::TAU;

/// A serial arm of any number of joints, some of which may move together.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// From the base on.
    pub joints: Vec<ArmJoint>,
    /// The tool in the frame of the last link.
    pub tool: Pose<f64>,
    /// What can be changed.
    pub variables: Vec<Variable>,
}

/// What is asked of a search.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// What is moved.
    pub arm: &'a Arm,
    /// Where its tool is to be, in the base.
    pub target: &'a Pose<f64>,
    /// How near, and for how long to try.
    pub options: &'a Options<f64>,
}

/// A joint, whose position is factor · variable + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmJoint {
    /// Its axis in the frame of its link.
    pub axis: Axis<f64>,
    /// Pose of the link in the one before at position zero.
    pub placement: Pose<f64>,
    /// The variable that moves it; `None`: it keeps the offset.
    pub variable: Option<usize>,
    /// rad or m per rad or m of the variable.
    pub factor: f64,
    /// rad or m.
    pub offset: f64,
}

/// A position that can be changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variable {
    /// Lowest and highest, rad or m; infinite where there is no limit.
    pub limits: [f64; 2],
    /// Whether an angle, which is the same after a turn where the limits are that wide.
    pub is_angle: bool,
}

/// Half the squared distance of a tool from its target, ½(|Δp|² + ℓ²θ²), at one point, and how it changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Curvature {
    /// The error, rad and m.
    pub error: Twist<f64>,
    /// Half the squared distance, m².
    pub cost: f64,
    /// Per unit of each variable.
    pub gradient: DVector<f64>,
    /// Per unit of each two variables.
    pub hessian: DMatrix<f64>,
}

impl Variable {
    /// Finite bounds: 2π (rad or m) where a limit is missing.
    pub fn bounds(&self) -> [f64; 2] {
        match self.limits.map(f64::is_finite) {
            [true, true] => self.limits,
            [true, false] => [self.limits[0], self.limits[0] + UNLIMITED],
            [false, true] => [self.limits[1] - UNLIMITED, self.limits[1]],
            [false, false] => [-0.5 * UNLIMITED, 0.5 * UNLIMITED],
        }
    }

    /// Whether it can turn by 360 degrees, up to a `slack` (rad).
    pub fn turns(&self, slack: f64) -> bool {
        self.is_angle && self.limits[1] - self.limits[0] >= UNLIMITED - slack
    }
}

impl Arm {
    /// The positions with each variable brought within its limits.
    pub fn within_limits(&self, x: &[f64]) -> Vec<f64> {
        // Not `clamp`, which panics where limits are no numbers.
        x.iter().zip(&self.variables).map(|(x, Variable { limits: [low, high], .. })| x.max(*low).min(*high)).collect()
    }

    /// Finite bounds of all variables.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        self.variables.iter().map(Variable::bounds).collect()
    }

    /// Pose of the tool in the base.
    pub fn pose(&self, x: &[f64]) -> Pose<f64> {
        self.joints.iter().fold(Pose::identity(), |before, joint| joint.moved(&before, x)) * self.tool
    }

    /// ε (rad, m) from the tool to `target`, and the twist of the tool along the axes of the base per unit of each
    /// variable, angular rows first.
    pub fn linearised(&self, target: &Pose<f64>, x: &[f64]) -> (Twist<f64>, Matrix6xX<f64>) {
        let (pose, screws) = self.screws(x);
        let mut jacobian = Matrix6xX::zeros(self.variables.len());
        for (joint, [w, v]) in self.joints.iter().zip(&screws) {
            if let Some(variable) = joint.variable {
                let mut column = jacobian.column_mut(variable);
                column += six(w, v) * joint.factor;
            }
        }
        (error(target, &pose), jacobian)
    }

    /// Distance, gradient and Hessian at `x`; one radian is held equal to weights\[0\] metres.
    ///
    /// Of joints a before b with the twists (w, v) at the tool: ∂v_b/∂q_a = ∂v_a/∂q_b = w_a × v_b and ∂w_b/∂q_a = w_a × w_b;
    /// of the rotation vector e from the tool to its target, ė = −J_r⁻¹(e)·ω with
    /// J_r⁻¹(e) = 1 + ½\[e\] + (1 − ½θ cot ½θ)/θ²·\[e\]² (A. Müller, Mech. Mach. Theory 142 (2019) 103594).
    pub fn curvature(&self, target: &Pose<f64>, x: &[f64], weights: [f64; 2]) -> Curvature {
        let (pose, screws) = self.screws(x);
        let error = error(target, &pose);
        let [angular, linear] = weights.map(|weight| weight * weight);
        let (e, theta) = (error.angular, error.angular.norm());
        let half = 0.5 * theta;
        let second = if theta < 1e-4 { 1.0 / 12.0 } else { (1.0 - half / half.tan()) / (theta * theta) };
        let n = self.variables.len();
        let (mut gradient, mut hessian) = (DVector::zeros(n), DMatrix::zeros(n, n));
        let moved =
            || self.joints.iter().zip(&screws).filter_map(|(joint, s)| Some((joint.variable?, joint.factor, s)));
        for (number, (row, scale, [wa, va])) in moved().enumerate() {
            gradient[row] -= scale * (angular * e.dot(wa) + linear * error.linear.dot(va));
            let turned = e.cross(wa);
            for (later, (column, factor, [wb, vb])) in moved().enumerate().skip(number) {
                let turns = wa.dot(wb) - second * turned.dot(&e.cross(wb)) - 0.5 * e.dot(&wa.cross(wb));
                let moves = va.dot(vb) - error.linear.dot(&wa.cross(vb));
                let entry = scale * factor * (angular * turns + linear * moves);
                hessian[(row, column)] += entry;
                if later > number {
                    hessian[(column, row)] += entry;
                }
            }
        }
        let cost = 0.5 * (angular * e.norm_squared() + linear * error.linear.norm_squared());
        Curvature { error, cost, gradient, hessian }
    }

    /// Whether `position` (m, base) is farther by `tolerance_m` from the first joint than all links together are long.
    pub fn is_beyond_reach(&self, position: &Vec3<f64>, tolerance_m: f64) -> bool {
        let Some(first) = self.joints.first() else { return (self.tool.position - position).norm() > tolerance_m };
        let links = self.joints.iter().skip(1).map(|joint| joint.placement.position.norm()).sum::<f64>();
        let strokes = self.joints.iter().map(|joint| self.stroke_m(joint)).sum::<f64>();
        (position - first.placement.position).norm() > links + strokes + self.tool.position.norm() + tolerance_m
    }

    /// How far a joint moves what it carries along its axis at most, m; 0 of a joint that turns.
    fn stroke_m(&self, joint: &ArmJoint) -> f64 {
        match (joint.axis.kind, joint.variable) {
            (JointKind::Revolute, _) => 0.0,
            (JointKind::Prismatic, None) => joint.offset.abs(),
            (JointKind::Prismatic, Some(variable)) => {
                let ends = self.variables[variable].limits.map(|limit| (joint.factor * limit + joint.offset).abs());
                ends[0].max(ends[1])
            }
        }
    }

    /// Pose of the tool, and the angular and linear velocity at its origin per unit of each joint.
    fn screws(&self, x: &[f64]) -> (Pose<f64>, Vec<[Vec3<f64>; 2]>) {
        let mut at = Pose::identity();
        let mut screws = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            at = joint.moved(&at, x);
            screws.push([at.rotation * joint.axis.direction, at.position]);
        }
        let pose = at * self.tool;
        for (joint, [axis, other]) in self.joints.iter().zip(&mut screws) {
            match joint.axis.kind {
                JointKind::Revolute => *other = axis.cross(&(pose.position - *other)),
                JointKind::Prismatic => (*axis, *other) = (Vec3::zeros(), *axis),
            }
        }
        (pose, screws)
    }
}

impl ArmJoint {
    /// Pose of the link that the joint moves, on a link with the pose `before`.
    fn moved(&self, before: &Pose<f64>, x: &[f64]) -> Pose<f64> {
        let q = self.offset + self.factor * self.variable.map_or(0.0, |variable| x[variable]);
        let at = *before * self.placement;
        match self.axis.kind {
            JointKind::Revolute => Pose { rotation: at.rotation * rotation_about(&self.axis.direction, q), ..at },
            JointKind::Prismatic => Pose { position: at.position + at.rotation * self.axis.direction * q, ..at },
        }
    }
}
