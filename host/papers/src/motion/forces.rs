//! What chair and feet bear in a plan, and the joint torques that go with it.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;
use nalgebra::{DVector, Matrix6, SVector};

use super::balance::{MARGIN_M, Polygon, zmp};
use super::mapping::{Mapped, ground_wrench};
use super::placed::Placed;
use super::setup::Setup;
use darm_robot::robot::Robot;

/// A foot's moment counts as its force at this distance, m.
const ARM_M: f64 = 0.1;
/// The feet bear this share of the weight at least.
const MIN_SHARE: f64 = 0.05;

/// Moment about the world's origin, and force.
type Six = SVector<f64, 6>;

/// Joint torques of a plan by the masses of `believed`, frame by frame, N·m or N.
///
/// The chair bears, straight up, what the zero-moment point lies outside the soles; the feet bear the rest, shared by least
/// forces and moments about their own middles.
///
/// # Errors
///
/// The joints of `believed` make no tree that can be computed.
pub fn feed_forward(believed: &Robot, setup: &Setup, plan: &Mapped) -> Result<Vec<Vec<f64>>, TreeError> {
    let mut placed = Placed::new(believed)?;
    let soles = Polygon::hull(&plan.sole);
    let wrenches = ground_wrench(believed, &plan.trajectory.postures, &plan.time_s);
    let mut torques = Vec::new();
    for (frame, (posture, bodies)) in plan.trajectory.postures.iter().zip(&wrenches).enumerate() {
        placed.place(posture);
        let mut load = DVector::zeros(6 + posture.q.len());
        for (joint, wrench) in crate::identify::bodies(believed).zip(bodies) {
            load += felt(&placed, joint, wrench);
        }
        let mut left: Six = bodies.iter().sum();
        if frame < plan.lift_off && !setup.seat.is_empty() {
            let each = on_chair(&left, &soles, setup, &placed) / setup.seat.len() as f64;
            for at in &setup.seat {
                let pushed = pushed(&placed.point(at), each);
                load -= felt(&placed, at.joint, &pushed);
                left -= pushed;
            }
        }
        for ((joint, _), wrench) in setup.feet.iter().zip(shared(&left, setup, &placed)) {
            load -= felt(&placed, *joint, &wrench);
        }
        torques.push(load.iter().skip(6).copied().collect());
    }
    Ok(torques)
}

/// What base and joints feel of a wrench on a link.
fn felt(placed: &Placed, joint: Option<usize>, wrench: &Six) -> DVector<f64> {
    let jacobian = placed.jacobian(joint, &Pose::identity());
    let at = placed.pose(joint, &Pose::identity()).position;
    let (moment, force): (Vec3<f64>, Vec3<f64>) = (wrench.fixed_rows::<3>(0).into(), wrench.fixed_rows::<3>(3).into());
    let moment = moment - at.cross(&force);
    let own = Six::new(moment.x, moment.y, moment.z, force.x, force.y, force.z);
    DVector::from_iterator(jacobian.ncols(), jacobian.column_iter().map(|column| column.dot(&own)))
}

/// A force straight up at a point.
fn pushed(at: &Vec3<f64>, up_n: f64) -> Six {
    Six::new(at.y * up_n, -at.x * up_n, 0.0, 0.0, 0.0, up_n)
}

/// What the chair bears so that the feet bear the rest within their soles, N.
fn on_chair(total: &Six, soles: &Polygon, setup: &Setup, placed: &Placed) -> f64 {
    let seat: Vec3<f64> = setup.seat.iter().map(|at| placed.point(at)).sum::<Vec3<f64>>() / setup.seat.len() as f64;
    let at = zmp(total);
    let on_feet = soles.pulled_in(at, MARGIN_M, [true; 2]);
    let (to_seat, out) = ([seat.x - on_feet[0], seat.y - on_feet[1]], [at[0] - on_feet[0], at[1] - on_feet[1]]);
    let away = to_seat[0].powi(2) + to_seat[1].powi(2);
    let share = (out[0] * to_seat[0] + out[1] * to_seat[1]) / away.max(f64::MIN_POSITIVE);
    total[5] * share.clamp(0.0, 1.0 - MIN_SHARE)
}

/// The wrench on each foot: together `total`, with the least forces, and moments about the middles of the soles.
fn shared(total: &Six, setup: &Setup, placed: &Placed) -> Vec<Six> {
    if setup.feet.is_empty() {
        return Vec::new();
    }
    let parts: Vec<Matrix6<f64>> = setup
        .feet
        .iter()
        .map(|(joint, points)| {
            let foot = placed.pose(*joint, &Pose::identity());
            let middle = points.iter().map(|point| foot * *point).sum::<Vec3<f64>>() / points.len().max(1) as f64;
            let mut about_origin = Matrix6::identity();
            about_origin.fixed_view_mut::<3, 3>(0, 3).copy_from(&middle.cross_matrix());
            let [f, m] = [1.0, ARM_M * ARM_M];
            about_origin * Matrix6::from_diagonal(&Six::new(m, m, m, f, f, f)) * about_origin.transpose()
        })
        .collect();
    let needed = parts
        .iter()
        .sum::<Matrix6<f64>>()
        .cholesky()
        .map(|factor| factor.solve(total))
        .expect("each foot adds a positive definite part");
    parts.iter().map(|part| part * needed).collect()
}
