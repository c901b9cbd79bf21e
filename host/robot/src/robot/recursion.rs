//! The Newton–Euler recursion, link by link: velocities and accelerations outwards, forces and moments inwards.
//!
//! Every vector is along the axes of the link that it belongs to, whose origin lies on the axis of its joint:
//!
//! | | joint that turns | joint that slides |
//! | --- | --- | --- |
//! | ωᵢ₊₁ | R ωᵢ + θ̇ ẑ | R ωᵢ |
//! | vᵢ₊₁ | R (vᵢ + ωᵢ × P) | R (vᵢ + ωᵢ × P) + ḋ ẑ |
//! | ω̇ᵢ₊₁ | R ω̇ᵢ + R ωᵢ × θ̇ ẑ + θ̈ ẑ | R ω̇ᵢ |
//! | v̇ᵢ₊₁ | R (ω̇ᵢ × P + ωᵢ × (ωᵢ × P) + v̇ᵢ) | the same + 2 ωᵢ₊₁ × ḋ ẑ + d̈ ẑ |
//!
//! v̇_C = ω̇ × P_C + ω × (ω × P_C) + v̇, F = m (v̇_C − g), N = I ω̇ + ω × I ω; f = F + Σ R f′ and
//! n = N + P_C × F + Σ (R n′ + P′ × R f′) over the links that it carries, τ = n·ẑ or f·ẑ. Accelerations are those of the motion,
//! without gravity: the textbook adds −g to all of them, by letting the base accelerate upwards. It is computed here apart from
//! [`Robot::dynamics`], which works with spatial vectors in the axes of the world; tests compare both.
//!
//! Source: J. J. Craig, Introduction to Robotics: Mechanics and Control, sections 5.6, 6.3 and 6.5.

use darm_core::actuator::JointKind;
use darm_core::dynamics::floating::BaseMotion;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::{Inertia, TreeError};

use super::state::Motion;
use super::{Robot, RobotJoint};
use crate::tree::joint_pose;

/// What the recursion gives of one link, along the axes of the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkState {
    /// The joint that moves the link; `None`: a floating base.
    pub joint: Option<usize>,
    /// ω, rad/s.
    pub angular_velocity: Vec3<f64>,
    /// v of the link's origin, m/s.
    pub velocity: Vec3<f64>,
    /// ω̇, rad/s².
    pub angular_acceleration: Vec3<f64>,
    /// v̇ of the link's origin, m/s².
    pub acceleration: Vec3<f64>,
    /// v̇_C of the link's centre of mass, m/s².
    pub com_acceleration: Vec3<f64>,
    /// F = m (v̇_C − g), N.
    pub force: Vec3<f64>,
    /// N, about the centre of mass, N·m.
    pub moment: Vec3<f64>,
    /// f, which the link before exerts on this one, N.
    pub joint_force: Vec3<f64>,
    /// n, about the link's origin, N·m.
    pub joint_moment: Vec3<f64>,
}

/// A link while the recursion runs outwards: its state, its pose in the link before, and gravity in its axes.
struct Outward {
    state: LinkState,
    pose: Pose<f64>,
    gravity: Vec3<f64>,
}

impl Robot {
    /// The recursion at a state, on a base that moves; the links in the order of the joints, a floating base first. The
    /// inertia of rotors is not in the moments of joints.
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn recursion(&self, base: &BaseMotion<f64>, motion: &Motion<'_>) -> Result<Vec<LinkState>, TreeError> {
        let placed = self.placed_on(&base.pose, motion.state[0])?;
        let [q, qd, qdd] = motion.state;
        let (q, [qd, qdd]) = (placed.coupling.positions(q), [qd, qdd].map(|rates| placed.coupling.rates(rates)));
        let root = self.root(base);
        let mut links: Vec<Outward> = Vec::new();
        for (k, joint) in self.joints.iter().enumerate() {
            let before = joint.joint.parent.map_or(&root, |parent| &links[parent]);
            links.push(outward(k, joint, before, [q[k], qd[k], qdd[k]]));
        }
        if let Some((frame, load)) = &motion.load {
            let pose = placed.links.pose(frame.joint, &frame.pose);
            if let Some(joint) = frame.joint {
                let link = placed.links.poses[joint];
                let turned = |v: &Vec3<f64>| link.rotation.tr_mul(&(base.pose.rotation * v));
                let arm = link.rotation.tr_mul(&(pose.position - link.position));
                let state = &mut links[joint].state;
                state.joint_force -= turned(&load.force);
                state.joint_moment -= turned(&load.moment) + arm.cross(&turned(&load.force));
            }
        }
        let mut on_base = root.state;
        if let Some((frame, load)) = motion.load.as_ref().filter(|(frame, _)| frame.joint.is_none()) {
            on_base.joint_force -= load.force;
            on_base.joint_moment -= load.moment + frame.pose.position.cross(&load.force);
        }
        for k in (0..links.len()).rev() {
            let Outward { state, pose, .. } = &links[k];
            let force = pose.rotation * state.joint_force;
            let moment = pose.rotation * state.joint_moment + pose.position.cross(&force);
            let before = self.joints[k].joint.parent.map_or(&mut on_base, |parent| &mut links[parent].state);
            before.joint_force += force;
            before.joint_moment += moment;
        }
        Ok(self.floating.then_some(on_base).into_iter().chain(links.iter().map(|link| link.state)).collect())
    }

    fn root(&self, base: &BaseMotion<f64>) -> Outward {
        let (twist, rate) = (&base.twist, &base.twist_rate);
        // The rate of the six numbers is that of the velocity along axes which turn.
        let acceleration = rate.linear + twist.angular.cross(&twist.linear);
        let gravity = base.pose.rotation.tr_mul(&self.gravity);
        let moving = [twist.angular, twist.linear, rate.angular, acceleration];
        let body = if self.floating { self.base } else { Inertia::none() };
        Outward { state: with_forces(None, moving, &body, &gravity), pose: base.pose, gravity }
    }
}

/// The link of a joint from that before it.
fn outward(k: usize, joint: &RobotJoint, before: &Outward, [q, qd, qdd]: [f64; 3]) -> Outward {
    let pose = joint_pose(&joint.joint, &Pose::identity(), q);
    let LinkState { angular_velocity: w, velocity: v, angular_acceleration: dw, acceleration: dv, .. } = before.state;
    let (p, z) = (pose.position, joint.joint.axis.direction);
    let in_link = |vector: Vec3<f64>| pose.rotation.tr_mul(&vector);
    let (w_link, v_link) = (in_link(w), in_link(v + w.cross(&p)));
    let (dw_link, dv_link) = (in_link(dw), in_link(dw.cross(&p) + w.cross(&w.cross(&p)) + dv));
    let moving = match joint.joint.axis.kind {
        JointKind::Revolute => [w_link + z * qd, v_link, dw_link + w_link.cross(&(z * qd)) + z * qdd, dv_link],
        JointKind::Prismatic => [w_link, v_link + z * qd, dw_link, dv_link + w_link.cross(&(z * qd)) * 2.0 + z * qdd],
    };
    let gravity = in_link(before.gravity);
    Outward { state: with_forces(Some(k), moving, &joint.joint.inertia, &gravity), pose, gravity }
}

/// F and N of a link that moves so, and with them what its joint bears of it alone.
fn with_forces(
    joint: Option<usize>,
    [w, v, dw, dv]: [Vec3<f64>; 4],
    body: &Inertia<f64>,
    gravity: &Vec3<f64>,
) -> LinkState {
    let com_acceleration = dw.cross(&body.com) + w.cross(&w.cross(&body.com)) + dv;
    let force = (com_acceleration - gravity) * body.mass;
    let moment = body.about_com * dw + w.cross(&(body.about_com * w));
    LinkState {
        joint,
        angular_velocity: w,
        velocity: v,
        angular_acceleration: dw,
        acceleration: dv,
        com_acceleration,
        force,
        moment,
        joint_force: force,
        joint_moment: moment + body.com.cross(&force),
    }
}
