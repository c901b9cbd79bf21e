//! The lecture's kinematics: differential drive, planar arm, Puma 560, Jacobians, inverse kinematics.

use std::f64::consts::{PI, TAU};

use darm_core::ik::{Options, Status};
use darm_core::odometry::{Drive, Estimate};
use darm_core::real::Vec3;
use darm_core::tree::TreeError;
use darm_core::tree::singular;
use darm_robot::dh;
use darm_robot::ik::Method;
use darm_robot::robot::euler::EulerAxes;
use darm_robot::robot::planar::planar_arm;
use darm_robot::robot::recursion::LinkState;
use darm_robot::robot::{Motion, Robot, Task, base_at_rest};

use super::draws::{DRAWS, apart, draw, random, row, worst};
use super::{PLANAR_M, Row};

/// Lengths of the Puma 560 in the lecture's modified table, m.
const A2: f64 = 0.4318;
const A3: f64 = 0.0203;
const D3: f64 = 0.15005;
const D4: f64 = 0.4318;
/// Targets of inverse kinematics, and how far each joint starts from one, rad.
const TARGETS: usize = 100;
const START_RAD: f64 = 0.3;

/// v = (v₁ + v₂)/2, ω = (v₂ − v₁)/(2b), vᵢ = 2π r f Δᵢ/(ticks per rev); (ẋ, ẏ, θ̇) = (v cos θ, v sin θ, ω).
pub(super) fn vacuum_cleaner(seed: u64) -> Vec<Row> {
    const SECTION: &str = "vacuum cleaner";
    let mut random = random(seed);
    let drive = Drive { radius_m: 0.033, half_track_m: 0.08, ticks_per_turn: 4096.0, variance_per_m: 0.0 };
    let (mut velocity, mut inverse, mut pose) = (0.0, 0.0, 0.0);
    for _ in 0..DRAWS {
        let ticks: [f64; 2] = draw(&mut random, 300.0);
        let [left, right] = ticks.map(|ticks| ticks.round() as i32);
        let [v1, v2] = [left, right].map(|ticks| TAU * 0.033 * 50.0 * f64::from(ticks) / 4096.0);
        let ours = drive.velocity(left, right, 50.0);
        let difference = (ours.linear_m_s - (v1 + v2) / 2.0).abs().max((ours.angular_rad_s - (v2 - v1) / 0.16).abs());
        velocity = worst(velocity, difference);
        let [a, b] = drive.speeds(&ours);
        inverse = worst(inverse, (a * 0.033 - v1).abs().max((b * 0.033 - v2).abs()));
        // A short time of the printed rates; what is left falls with the square of the time.
        let start = drive.advance_by(&Estimate::start(), draw(&mut random, 0.2));
        let (seconds, [s, c]) = (1e-6, [start.pose.angle_rad.sin(), start.pose.angle_rad.cos()]);
        let end = drive.advance_by(&start, [v1 * seconds, v2 * seconds]).pose;
        let moved = (end.position - start.pose.position) / seconds;
        let (v, w) = ((v1 + v2) / 2.0, (v2 - v1) / 0.16);
        let expected = [v * c - 0.5 * seconds * v * w * s, v * s + 0.5 * seconds * v * w * c];
        pose = worst(pose, (moved.x - expected[0]).abs().max((moved.y - expected[1]).abs()));
    }
    vec![
        row(SECTION, "v and ω", velocity, "m/s, rad/s"),
        row(SECTION, "speeds of the wheels, the inverse", inverse, "m/s"),
        row(SECTION, "rates of the pose, differences", pose, "m/s"),
    ]
}

/// The planar arm: velocities link by link, the Jacobian, its singularity and manipulability.
pub(super) fn planar(seed: u64) -> Result<Vec<Row>, TreeError> {
    const SECTION: &str = "planar arm";
    let mut random = random(seed);
    let (arm, tip) = planar_arm(&PLANAR_M, &[[-PI, PI]; 2]);
    let [l1, l2] = PLANAR_M;
    let (mut links, mut tool, mut matrix, mut manipulability) = (0.0, 0.0, 0.0, 0.0);
    for _ in 0..DRAWS {
        let (q, qd): ([f64; 2], [f64; 2]) = (draw(&mut random, PI), draw(&mut random, 2.0));
        let (s1, c1, s12, c12) = (q[0].sin(), q[0].cos(), (q[0] + q[1]).sin(), (q[0] + q[1]).cos());
        let (s2, c2) = q[1].sin_cos();
        let states = arm.recursion(&base_at_rest(), &Motion { state: [&q, &qd, &[]], load: None })?;
        let second = Vec3::new(l1 * s2 * qd[0], l1 * c2 * qd[0], 0.0);
        for (state, w, v) in [(&states[0], qd[0], Vec3::zeros()), (&states[1], qd[0] + qd[1], second)]
            as [(&LinkState, f64, Vec3<f64>); 2]
        {
            links =
                worst(links, apart(&state.angular_velocity, &Vec3::new(0.0, 0.0, w)).max(apart(&state.velocity, &v)));
        }
        let kinematics = arm.kinematics(&tip, &q)?;
        let sum = qd[0] + qd[1];
        let printed = Vec3::new(-l1 * s1 * qd[0] - l2 * s12 * sum, l1 * c1 * qd[0] + l2 * c12 * sum, 0.0);
        tool = worst(tool, apart(&kinematics.twist(&qd).linear, &printed));
        let expected = [[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]];
        let jacobian = &kinematics.jacobian_base;
        for (r, row) in expected.iter().enumerate() {
            for (c, entry) in row.iter().enumerate() {
                matrix = worst(matrix, (jacobian[(3 + r, c)] - entry).abs());
            }
        }
        let w = singular::manipulability(&singular::rows(&kinematics.compact_jacobian(), &[3, 4]));
        manipulability = worst(manipulability, (w - (l1 * l2 * s2).abs()).abs());
    }
    let straight = arm.kinematics(&tip, &[0.0, 0.0])?;
    let along = straight.jacobian_base.row(3).amax();
    Ok(vec![
        row(SECTION, "ω and v of both links", links, "rad/s, m/s"),
        row(SECTION, "v of the tip along the base", tool, "m/s"),
        row(SECTION, "Jacobian", matrix, "m"),
        row(SECTION, "both angles 0: motion along x", along, "m"),
        row(SECTION, "manipulability less l₁ l₂ |sin θ₂|", manipulability, "m²"),
    ])
}

/// Difference of two angles that are known up to half turns.
fn half_turns(a: f64, b: f64) -> f64 {
    let apart = (a - b).rem_euclid(PI);
    apart.min(PI - apart)
}

/// The Puma 560 of the printed pose: the modified table that its equations belong to.
fn modified_puma() -> Robot {
    let row = |alpha: f64, a: f64, d: f64| format!("[[row]]\nalpha_deg = {alpha:?}\na_m = {a:?}\nd_m = {d:?}\n");
    let rows =
        [(0.0, 0.0, 0.0), (-90.0, 0.0, 0.0), (0.0, A2, D3), (-90.0, A3, D4), (90.0, 0.0, 0.0), (-90.0, 0.0, 0.0)];
    let rows: String = rows.map(|(alpha, a, d)| row(alpha, a, d)).concat();
    let text = format!("format = 1\nname = \"puma\"\nnotation = \"modified\"\n{rows}");
    dh::parse(std::path::Path::new("puma.toml"), &text).expect("the table is valid")
}

/// x, y, z and the three angles as printed, and corrected where that is needed.
pub(super) fn puma(seed: u64) -> Result<Vec<Row>, TreeError> {
    const SECTION: &str = "Puma 560, pose";
    let (robot, mut random) = (modified_puma(), random(seed));
    let zyz: EulerAxes = "zyz".parse().expect("a convention");
    let Some(tool) = robot.tool() else { return Ok(Vec::new()) };
    let mut worst_of = [0.0; 8];
    for _ in 0..DRAWS {
        let q: [f64; 6] = draw(&mut random, PI);
        let pose = robot.kinematics(tool, &q)?.pose_base_frame;
        let angles = zyz.angles(&pose.rotation);
        let [s1, s2, s4, s5, s6] = [q[0], q[1], q[3], q[4], q[5]].map(f64::sin);
        let [c1, c2, c4, c5, c6] = [q[0], q[1], q[3], q[4], q[5]].map(f64::cos);
        let (s23, c23) = (q[1] + q[2]).sin_cos();
        let reach = A2 * c2 + A3 * c23 - D4 * s23;
        let (x, y) = (c1 * reach - D3 * s1, s1 * reach + D3 * c1);
        let z = -A3 * s23 + A2 * s2 - D4 * c23;
        let inner = c23 * c4 * s5 + s23 * c5;
        let (up, down) = (s1 * inner - c1 * s4 * s5, c1 * inner + s1 * s4 * s5);
        let height = s23 * c4 * s5 - c23 * c5;
        let t_printed = (-up / ((-up - down).atan().sin() * height)).atan();
        let t = (-up / ((-up / -down).atan().sin() * height)).atan();
        let denominator = s23 * (s4 * s6 - c4 * c5 * c6) - c23 * s5 * c6;
        let a_printed = (-(s23 * (s4 * c6 - c4 * c5 * s6) + c23 * s5 * c6) / denominator).atan();
        let a = (-(s23 * (s4 * c6 + c4 * c5 * s6) + c23 * s5 * s6) / denominator).atan();
        let position = pose.position;
        // The arc tangent gives the first angle or that half a turn away, with which the second has the other sign.
        let second = angles.y * ((up / down).atan() - angles.x).cos().signum();
        let differences = [
            (position.x - x).abs().max((position.y - y).abs()),
            (position.z - z).abs(),
            (position.z - (z - 2.0 * A2 * s2)).abs(),
            half_turns((up / down).atan(), angles.x),
            half_turns(t_printed, second),
            half_turns(t, second),
            half_turns(a_printed, angles.z),
            half_turns(a, angles.z),
        ];
        worst_of.iter_mut().zip(differences).for_each(|(so_far, difference)| *so_far = worst(*so_far, difference));
    }
    let names = [
        ("x and y", "m"),
        ("z, as printed, wrong", "m"),
        ("z with -a₂ s₂", "m"),
        ("first angle of Z-Y-Z", "rad"),
        ("second angle, as printed, wrong", "rad"),
        ("second angle with the fraction", "rad"),
        ("third angle, as printed, wrong", "rad"),
        ("third angle, corrected", "rad"),
    ];
    Ok(names.iter().zip(worst_of).map(|((what, unit), value)| row(SECTION, what, value, unit)).collect())
}

/// Columns of the Jacobian as motions of the tool, ẋ = J q̇ and its inverse, and the Jacobian of Euler angles.
pub(super) fn jacobians(puma: &Robot, seed: u64) -> Result<Vec<Row>, TreeError> {
    const SECTION: &str = "Jacobian";
    let mut random = random(seed);
    let zyx: EulerAxes = "zyx".parse().expect("a convention");
    let Some(tool) = puma.tool() else { return Ok(Vec::new()) };
    let (mut propagated, mut back, mut angles) = (0.0, 0.0, 0.0);
    let mut compared = 0.0;
    for _ in 0..DRAWS {
        let (q, qd): ([f64; 6], [f64; 6]) = (draw(&mut random, PI), draw(&mut random, 1.0));
        let kinematics = puma.kinematics(tool, &q)?;
        let twist = kinematics.twist(&qd);
        // The last link's velocities of the recursion, turned into the base: ᴮR_E ᴱω, ᴮR_E ᴱv.
        let links = puma.recursion(&base_at_rest(), &Motion { state: [&q, &qd, &[]], load: None })?;
        if let Some(last) = links.last() {
            let turn = kinematics.pose_base_frame.rotation * tool.pose.rotation.transpose();
            let arm = tool.pose.position;
            let velocity = last.velocity + last.angular_velocity.cross(&arm);
            propagated = worst(propagated, apart(&(turn * velocity), &twist.linear));
            propagated = worst(propagated, apart(&(turn * last.angular_velocity), &twist.angular));
        }
        let condition = singular::singular_values(&kinematics.compact_jacobian());
        if condition[5] < 1e-2 {
            continue;
        }
        compared += 1.0;
        let rates = kinematics.rates(&twist, Task::Pose);
        back = worst(back, rates.qd.iter().zip(&qd).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        let analytic = kinematics.analytic(zyx);
        if let Some(jacobian) = analytic.jacobian.filter(|_| analytic.determinant.abs() > 1e-2) {
            let rates = jacobian * nalgebra::DVector::from_column_slice(&qd);
            let spin = zyx.axes(&analytic.angles_rad) * Vec3::new(rates[0], rates[1], rates[2]);
            angles = worst(angles, apart(&spin, &twist.angular));
        }
    }
    Ok(vec![
        row(SECTION, "velocities propagated to the tool less J q̇", propagated, "rad/s, m/s"),
        row(SECTION, "counted: postures away from singularities, of 1000", compared, ""),
        row(SECTION, "J⁻¹ J q̇ less q̇", back, "rad/s"),
        row(SECTION, "rates of Z-Y-X angles less ω", angles, "rad/s"),
    ])
}

/// Inverse kinematics by inverse, pseudo-inverse and transpose, from starts near the target.
pub(super) fn inverse(puma: &Robot, seed: u64) -> Result<Vec<Row>, TreeError> {
    const SECTION: &str = "inverse kinematics";
    const NAMES: [(&str, &str); 3] = [
        ("inverse: reached of 100", "inverse: steps, median"),
        ("pseudo-inverse: reached of 100", "pseudo-inverse: steps, median"),
        ("transpose: reached of 100", "transpose: steps, median"),
    ];
    let Some(tool) = puma.tool() else { return Ok(Vec::new()) };
    let mut rows = Vec::new();
    for (method, (reached, steps)) in [Method::Inverse, Method::PseudoInverse, Method::Transpose].into_iter().zip(NAMES)
    {
        let mut random = random(seed);
        let mut taken = Vec::new();
        for _ in 0..TARGETS {
            let (q, off) = near_target(&mut random);
            let start: Vec<f64> = q.iter().zip(off).map(|(q, off)| q + off).collect();
            let target = puma.kinematics(tool, &q)?.pose_base_frame;
            let options = Options { steps: 100_000, starts: 1, ..Options::default() };
            let found = puma.inverse(method, tool, &target, &start, &options)?;
            taken.extend((found.status == Status::Reached).then_some(found.steps));
        }
        taken.sort_unstable();
        let median = taken.get(taken.len() / 2).map_or(f64::NAN, |steps| *steps as f64);
        rows.extend([row(SECTION, reached, taken.len() as f64, ""), row(SECTION, steps, median, "")]);
    }
    Ok(rows)
}

/// A posture well within the limits, with the wrist and the elbow bent, and a start near it.
pub(crate) fn near_target(random: &mut rand_chacha::ChaCha8Rng) -> ([f64; 6], [f64; 6]) {
    let [a, b, c, d, e, f] = draw(random, 0.6);
    ([a, 0.8 + b, -1.6 + c, d, 0.9 + 0.4 * e, f], draw(random, START_RAD))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The modified table is that of the printed position: its zero has the wrist at (a₂ + a₃, d₃, −d₄).
    #[test]
    fn the_table_has_the_printed_zero() {
        let robot = modified_puma();
        let pose = robot.kinematics(robot.tool().unwrap(), &[0.0; 6]).unwrap().pose_base_frame;
        assert!((pose.position - Vec3::new(A2 + A3, D3, -D4)).norm() < 1e-12, "{}", pose.position);
    }
}
