//! Masses and centres of mass of a robot on a floating base, identified from joint torques and contact wrenches.
//!
//! # Equations
//!
//! K(q, q̇, q̈) φ = Sᵀ τ + J_Cᵀ λ, equations (1) to (8) of the paper: linear in the inertial parameters φ of all links, of
//! static postures (m, m·c) of each, of motions all ten and the joint's friction f_c, f_v besides. The six rows of
//! the base are expressed in the world about its origin, so that the wrench of a force plate enters as it is measured; a joint's row
//! is its torque plus what the contacts beyond it exert along it. Every row counts by the noise of its sensors:
//! rows that share the wrench of a contact beyond a joint are weighted by their covariance, not one by one.
//!
//! What the rows cannot separate stays as the nominal parameters have it: the least change of them in shares of each
//! (`prior`), by the singular values. [`Equations::base_parameters`] says in words what can be identified.
//!
//! The centre of pressure of a contact wrench is given in the plane z = 0 of the world, z up.
//!
//! Source: M. Mistry, A. Murai, K. Yamane, J. Hodgins, Sit-to-Stand Task on a Humanoid Robot from Human Demonstration,
//! IEEE-RAS Int. Conf. on Humanoid Robots, 2010, section II.

mod equations;
mod fit;
mod hold_out;
mod missing;
mod read;
mod simulated;

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use darm_core::se::Wrench;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use darm_robot::rigid_body::regressor::BodyMotion;
use darm_robot::robot::Robot;
use darm_robot::robot::base_parameters::{Inertial, PARAMETER_SYMBOLS};

pub use equations::{Equations, IdentifyError, Rows, WRENCH_COMPONENTS};
pub use fit::Fit;
pub use hold_out::{HeldOut, hold_out, rms_cop};
pub use missing::{Missing, Named, missing, separable};
pub use read::{Measurement, ReadSamplesError, read};
pub use simulated::simulated;

/// One posture, or one moment of a motion, with what was measured in it.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Line of its file, by which it is reported.
    pub line: usize,
    /// The base: where it is and how it moves in the world.
    pub base: BodyMotion,
    /// Positions, velocities and accelerations of the joints, rad and m.
    pub state: [Vec<f64>; 3],
    /// τ of every joint, N·m or N; 0 where it is not measured.
    pub torque: Vec<f64>,
    /// What the environment exerts.
    pub contacts: Vec<Contact>,
}

/// A contact of the robot with its environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The joint whose link is touched; `None`: the base.
    pub joint: Option<usize>,
    /// What the environment exerts on the link, along the axes of the world about its origin.
    pub wrench: Wrench<f64>,
}

/// Standard deviations of the sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of a joint's torque, N·m.
    pub torque_nm: f64,
    /// Of a component of a contact's force, N.
    pub force_n: f64,
    /// Of a component of a contact's moment, N·m.
    pub moment_nm: f64,
}

/// What an equation is linear in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// An inertial parameter of a link.
    Inertial(Inertial),
    /// f_c of a joint, N·m or N.
    Coulomb(usize),
    /// f_v of a joint, N·m·s or N·s/m.
    Viscous(usize),
}

/// Whether the samples rest or move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// At rest: masses and first moments.
    Static,
    /// Moving: all ten parameters of each link and friction.
    Moving,
}

impl Unknown {
    /// The unknown in words: `mx thigh`.
    pub fn words(&self, robot: &Robot) -> String {
        let joint = |k: &usize| robot.joints.get(*k).map_or("?", |joint| joint.name.as_str());
        match self {
            Self::Inertial(inertial) => inertial.words(robot),
            Self::Coulomb(k) => format!("fc {}", joint(k)),
            Self::Viscous(k) => format!("fv {}", joint(k)),
        }
    }

    /// Its unit.
    pub fn unit(&self, robot: &Robot) -> &'static str {
        let turns = |k: &usize| robot.joints[*k].joint.axis.kind == JointKind::Revolute;
        match self {
            Self::Inertial(inertial) => inertial.unit(),
            Self::Coulomb(k) => {
                if turns(k) {
                    "N·m"
                } else {
                    "N"
                }
            }
            Self::Viscous(k) => {
                if turns(k) {
                    "N·m·s"
                } else {
                    "N·s/m"
                }
            }
        }
    }
}

/// Mass and centre of mass of a link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkMass {
    /// The link.
    pub link: String,
    /// kg.
    pub mass_kg: f64,
    /// In the link's frame, m.
    pub com_m: [f64; 3],
}

/// Masses of all links by these values of the unknowns; where single links cannot be identified, one choice of many that act alike.
pub fn link_masses(robot: &Robot, equations: &Equations, values: &DVector<f64>) -> Vec<LinkMass> {
    let of = |joint: Option<usize>| {
        let own = equations.of_body(joint);
        let mass_kg = values[own[0]];
        let com_m = std::array::from_fn(|k| if mass_kg > 0.0 { values[own[1 + k]] / mass_kg } else { 0.0 });
        LinkMass { link: body_name(robot, joint), mass_kg, com_m }
    };
    bodies(robot).map(of).collect()
}

/// The robot with these masses; moments of inertia about the centres of mass grow with them. Links that are not named stay.
pub fn with_masses(robot: &Robot, masses: &[LinkMass]) -> Robot {
    let mut with = robot.clone();
    for (joint, named) in
        bodies(robot).filter_map(|j| Some((j, masses.iter().find(|m| m.link == body_name(robot, j))?)))
    {
        let inertia = match joint {
            Some(joint) => &mut with.joints[joint].joint.inertia,
            None => &mut with.base,
        };
        if inertia.mass > 0.0 {
            inertia.about_com *= named.mass_kg / inertia.mass;
        }
        (inertia.mass, inertia.com) = (named.mass_kg, Vec3::from(named.com_m));
    }
    with
}

/// Name of a body: the base, or the link that a joint moves.
pub fn body_name(robot: &Robot, joint: Option<usize>) -> String {
    let base = || robot.frames.first().map_or("the base", |frame| frame.name.as_str());
    joint.and_then(|joint| robot.joints.get(joint)).map_or_else(base, |joint| joint.link.as_str()).to_owned()
}

/// The bodies of a robot: the base, and the link of every joint.
pub fn bodies(robot: &Robot) -> impl Iterator<Item = Option<usize>> + Clone + use<> {
    std::iter::once(None).chain((0..robot.joints.len()).map(Some))
}

/// The unknowns of a robot, link by link and then joint by joint.
fn unknowns(robot: &Robot, kind: Kind) -> Vec<Unknown> {
    let numbers = if kind == Kind::Static { 4 } else { PARAMETER_SYMBOLS.len() };
    let inertial = bodies(robot).flat_map(|joint| (0..numbers).map(move |number| Inertial { joint, number }));
    let mut all: Vec<Unknown> = inertial.map(Unknown::Inertial).collect();
    if kind == Kind::Moving {
        all.extend((0..robot.joints.len()).flat_map(|k| [Unknown::Coulomb(k), Unknown::Viscous(k)]));
    }
    all
}

#[cfg(test)]
mod motion_tests;
#[cfg(test)]
mod tests;
