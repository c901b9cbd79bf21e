//! What the sensors of a robot would measure: to try an identification where the truth is known.

use nalgebra::SVector;
use rand::{Rng, RngExt as _};
use rand_distr::StandardNormal;

use darm_core::real::Vec3;
use darm_core::se::Wrench;
use darm_core::tree::Body;

use super::{Contact, Noise, Sample};
use darm_robot::rigid_body::regressor::{BodyMotion, WrenchRegressor, joint_regressor, link_motions, wrench_regressor};
use darm_robot::robot::Robot;

/// One sample of a robot whose base is its only contact: torques with the joints' friction, and the wrench, with noise.
pub fn simulated(
    robot: &Robot,
    base: BodyMotion,
    state: [Vec<f64>; 3],
    noise: &Noise,
    random: &mut impl Rng,
) -> Sample {
    let [q, qd, qdd] = &state;
    let moving = link_motions(robot, &base, [q, qd, qdd]);
    let inertias = std::iter::once(&robot.base).chain(robot.joints.iter().map(|joint| &joint.joint.inertia));
    let tens: Vec<SVector<f64, 10>> = inertias.map(|inertia| Body::from(inertia).parameters().into()).collect();
    let loads: Vec<WrenchRegressor> = std::iter::once(&base).chain(&moving).map(wrench_regressor).collect();
    let mut any = |size: f64| size * random.sample::<f64, _>(StandardNormal);
    let mut torque: Vec<f64> = robot
        .joints
        .iter()
        .zip(qd)
        .map(|(joint, rate)| {
            let sliding = if *rate == 0.0 { 0.0 } else { rate.signum() };
            joint.friction * sliding + joint.damping * rate + any(noise.torque_nm)
        })
        .collect();
    for (body, (load, ten)) in loads.iter().zip(&tens).enumerate().skip(1) {
        let parent = |joint: &usize| robot.joints.get(*joint).and_then(|joint| joint.joint.parent);
        for joint in std::iter::successors(Some(body - 1), parent) {
            let row = SVector::<f64, 10>::from(joint_regressor(robot, joint, &moving[joint], load));
            torque[joint] += row.dot(ten);
        }
    }
    let total: SVector<f64, 6> = loads.iter().zip(&tens).map(|(load, ten)| load * ten).sum();
    let mut three = |at: usize, size: f64| Vec3::from_fn(|k, _| total[at + k] + any(size));
    let (force, moment) = (three(3, noise.force_n), three(0, noise.moment_nm));
    let wrench = Wrench { moment, force };
    Sample { line: 0, base, state, torque, contacts: vec![Contact { joint: None, wrench }] }
}
