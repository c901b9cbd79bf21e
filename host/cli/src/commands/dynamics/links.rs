//! `darm dynamics --links`: the recursion of Newton and Euler, link by link.

use darm_core::dynamics::floating::BaseMotion;
use darm_core::real::Vec3;
use darm_core::se::Twist;
use darm_robot::robot::recursion::LinkState;
use darm_robot::robot::{Accelerations, Motion, Robot};
use serde::Serialize;

use crate::ui::{columns, number};

/// A link, along its own axes and about its own origin, which lies on the axis of its joint.
#[derive(Serialize)]
pub(super) struct LinkRow {
    link: String,
    angular_velocity_rad_s: [f64; 3],
    velocity_m_s: [f64; 3],
    angular_acceleration_rad_s2: [f64; 3],
    /// Without gravity.
    acceleration_m_s2: [f64; 3],
    com_acceleration_m_s2: [f64; 3],
    /// m (v̇_C − g).
    force_n: [f64; 3],
    /// I ω̇ + ω × I ω about the centre of mass.
    moment_nm: [f64; 3],
    /// What the link before exerts on this one.
    joint_force_n: [f64; 3],
    joint_moment_nm: [f64; 3],
}

/// The links of a state; with the accelerations that torques cause where there are any.
pub(super) fn rows(
    robot: &Robot,
    base: &BaseMotion<f64>,
    motion: &Motion<'_>,
    found: Option<&Accelerations>,
) -> anyhow::Result<Vec<LinkRow>> {
    let [q, qd, qdd] = motion.state;
    let qdd = found.map_or(qdd, |found| &found.joints);
    let twist_rate = found.map_or(base.twist_rate, |found| found.base.unwrap_or(Twist::zero()));
    let links =
        robot.recursion(&BaseMotion { twist_rate, ..*base }, &Motion { state: [q, qd, qdd], load: motion.load })?;
    Ok(links.iter().map(|state| row(robot, state)).collect())
}

fn row(robot: &Robot, state: &LinkState) -> LinkRow {
    let base = || robot.frames.first().map_or_else(|| "base".to_owned(), |frame| frame.name.clone());
    let of = |vector: &Vec3<f64>| (*vector).into();
    LinkRow {
        link: state.joint.map_or_else(base, |joint| robot.joints[joint].link.clone()),
        angular_velocity_rad_s: of(&state.angular_velocity),
        velocity_m_s: of(&state.velocity),
        angular_acceleration_rad_s2: of(&state.angular_acceleration),
        acceleration_m_s2: of(&state.acceleration),
        com_acceleration_m_s2: of(&state.com_acceleration),
        force_n: of(&state.force),
        moment_nm: of(&state.moment),
        joint_force_n: of(&state.joint_force),
        joint_moment_nm: of(&state.joint_moment),
    }
}

/// Three tables, of velocities, of accelerations and of forces and moments.
pub(super) fn text(links: &[LinkRow]) -> String {
    let table = |head, is_angular| table(links, head, is_angular);
    let outward = [
        table([("ω, deg/s", |l| l.angular_velocity_rad_s), ("v, m/s", |l| l.velocity_m_s)], true),
        table(
            [("rate of ω, deg/s²", |l| l.angular_acceleration_rad_s2), ("rate of v, m/s²", |l| l.acceleration_m_s2)],
            true,
        ),
        table(
            [("acceleration of the centre of mass, m/s²", |l| l.com_acceleration_m_s2), ("F, N", |l| l.force_n)],
            false,
        ),
        table([("N, N m", |l| l.moment_nm), ("f at the joint, N", |l| l.joint_force_n)], false),
    ];
    let inward = links.iter().map(|link| {
        let moment = link.joint_moment_nm.map(|x| number(x, 3));
        std::iter::once(link.link.clone()).chain(moment).collect::<Vec<_>>()
    });
    let head = ["link", "n at the joint, N m", "", ""].map(str::to_owned).to_vec();
    let inward = columns(&std::iter::once(head).chain(inward).collect::<Vec<_>>());
    format!(
        "\n\nlinks, each along its own axes; accelerations without gravity, F with the weight\n{}\n\n{inward}",
        outward.join("\n\n")
    )
}

/// A vector of a link, with its name and unit.
type Column = (&'static str, fn(&LinkRow) -> [f64; 3]);

/// A table of two vectors of each link; where the first is angular, in degrees.
fn table(links: &[LinkRow], head: [Column; 2], is_angular: bool) -> String {
    let title = std::iter::once("link").chain(head.iter().flat_map(|(name, _)| [*name, "", ""]));
    let rows = links.iter().map(|link| {
        let [first, second] = head.map(|(_, of)| of(link));
        let first = if is_angular { first.map(f64::to_degrees) } else { first };
        let numbers = first.into_iter().chain(second).map(|x| number(x, 3));
        std::iter::once(link.link.clone()).chain(numbers).collect::<Vec<_>>()
    });
    columns(&std::iter::once(title.map(str::to_owned).collect()).chain(rows).collect::<Vec<_>>())
}
