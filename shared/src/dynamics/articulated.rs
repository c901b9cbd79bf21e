//! Forward dynamics by articulated bodies: the motion of torques in as many steps as there are joints.
//!
//! Unlike [`forward_dynamics`](super::forward_dynamics), which solves with the mass matrix, it grows with N and not with N³;
//! for short arms it is the slower of the two. All is given along the axes of the base about the base's origin.
//!
//! Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, table 7.1, and table 9.4 for the floating base.

use super::Vec3;
use super::coriolis::{cross, spatial};
use super::mass::solve;
use crate::real::{Mat6, Real, Vec6};
use crate::se::{Twist, Wrench};
use crate::tree::{Frames, Tree};

/// A link with all that it carries, whose joints further out are free to move.
#[derive(Clone, Copy)]
struct Articulated<T: Real> {
    /// Inertia, and the load that it takes to hold it without acceleration.
    inertia: Mat6<T>,
    load: Vec6<T>,
    /// The joint's unit motion, and the acceleration that its velocity brings.
    screw: Vec6<T>,
    drift: Vec6<T>,
    /// Inertia times screw, the inertia that acts on the joint, and the torque that is left to accelerate it.
    carried: Vec6<T>,
    felt: T,
    left: T,
}

impl<T: Real> Articulated<T> {
    fn none() -> Self {
        let (zero, six) = (T::zero(), Vec6::zeros());
        Self { inertia: Mat6::zeros(), load: six, screw: six, drift: six, carried: six, felt: zero, left: zero }
    }
}

fn six<T: Real>(angular: &Vec3<T>, linear: &Vec3<T>) -> Vec6<T> {
    Vec6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z)
}

/// q̈ of `torque` (N·m or N) at positions `q` and velocities `qd` on a fixed base; the same as
/// [`forward_dynamics`](super::forward_dynamics). `None` when a joint moves no mass.
pub fn articulated_dynamics<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    [q, qd, torque]: [&[T; N]; 3],
) -> Option<[T; N]> {
    let mut frames = Frames::default();
    tree.place(q, &mut frames);
    let (mut bodies, _) = bodies(tree, &frames, &Twist::zero(), qd, None);
    inward(tree, &mut bodies, torque, &mut Articulated::none())?;
    Some(outward(tree, &bodies, &six(&Vec3::zeros(), &-tree.gravity)))
}

/// The rate of a floating base's twist and q̈; see [`floating::forward_dynamics`](super::floating::forward_dynamics).
pub(super) fn on_floating_base<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    (twist, gravity): (&Twist<T>, &Vec3<T>),
    [q, qd, torque]: [&[T; N]; 3],
    on_base: &Wrench<T>,
    loads: Option<&[Wrench<T>; N]>,
) -> Option<(Twist<T>, [T; N])> {
    let mut frames = Frames::default();
    tree.place(q, &mut frames);
    let (mut bodies, mut base) = bodies(tree, &frames, twist, qd, loads);
    inward(tree, &mut bodies, torque, &mut base)?;
    let free = six(&on_base.moment, &on_base.force) - base.load;
    let acceleration @ [a, b, c, x, y, z] = solve(&base.inertia, &free.into())?;
    let joints = outward(tree, &bodies, &Vec6::from(acceleration));
    Some((Twist { angular: Vec3::new(a, b, c), linear: Vec3::new(x, y, z) + gravity }, joints))
}

/// Every link alone, and the base: inertia, load of its velocity less those given, and how its joint moves it.
fn bodies<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
    base: &Twist<T>,
    qd: &[T; N],
    loads: Option<&[Wrench<T>; N]>,
) -> ([Articulated<T>; N], Articulated<T>) {
    let twists = tree.twists(base, qd, frames);
    let mut bodies = [Articulated::none(); N];
    for (index, body) in bodies.iter_mut().enumerate() {
        let (Some(link), Some(frame), Some(twist), Some(rate)) =
            (tree.links.get(index), frames.links().get(index), twists.get(index), qd.get(index))
        else {
            continue;
        };
        let at_origin = Twist { angular: twist.angular, linear: twist.linear + frame.origin.cross(&twist.angular) };
        let (angular, linear) = link.screw(frame);
        let (moving, velocity) = (cross(&at_origin), at_origin.to_vector());
        body.screw = six(&angular, &linear);
        body.drift = moving * (body.screw * *rate);
        body.inertia = spatial(&link.body.in_base(frame));
        body.load = -moving.tr_mul(&(body.inertia * velocity));
        if let Some(given) = loads.and_then(|loads| loads.get(index)) {
            let turn = |v: &Vec3<T>| frame.turn(&link.turned.tr_mul(v));
            let force = turn(&given.force);
            body.load -= six(&(turn(&given.moment) + frame.origin.cross(&force)), &force);
        }
    }
    let inertia = spatial(&tree.base);
    let load = -cross(base).tr_mul(&(inertia * base.to_vector()));
    (bodies, Articulated { inertia, load, ..Articulated::none() })
}

/// Joins every link to its parent through the joint between them; `None` when no inertia acts on a joint.
fn inward<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    bodies: &mut [Articulated<T>; N],
    torque: &[T; N],
    base: &mut Articulated<T>,
) -> Option<()> {
    for index in (0..N).rev() {
        let (link, torque, body) = (tree.links.get(index)?, torque.get(index)?, bodies.get_mut(index)?);
        body.carried = body.inertia * body.screw;
        body.felt = body.screw.dot(&body.carried);
        body.left = *torque - body.screw.dot(&body.load);
        if body.felt.partial_cmp(&T::zero()) != Some(core::cmp::Ordering::Greater) {
            return None;
        }
        let inertia = body.inertia - body.carried * body.carried.transpose() / body.felt;
        let load = body.load + inertia * body.drift + body.carried * (body.left / body.felt);
        let parent = bodies.get_mut(usize::from(link.parent)).unwrap_or(base);
        parent.inertia += inertia;
        parent.load += load;
    }
    Some(())
}

/// The accelerations of the joints when the base accelerates so.
fn outward<T: Real, const N: usize>(tree: &Tree<T, N>, bodies: &[Articulated<T>; N], base: &Vec6<T>) -> [T; N] {
    let mut accelerations = [*base; N];
    let mut joints = [T::zero(); N];
    for (index, ((link, body), joint)) in tree.links.iter().zip(bodies).zip(&mut joints).enumerate() {
        let behind = accelerations.get(usize::from(link.parent)).unwrap_or(base) + body.drift;
        *joint = (body.left - body.carried.dot(&behind)) / body.felt;
        if let Some(acceleration) = accelerations.get_mut(index) {
            *acceleration = behind + body.screw * *joint;
        }
    }
    joints
}
