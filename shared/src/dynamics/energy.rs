//! Kinetic and potential energy, and momentum.

use super::{MassMoment, Vec3};
use crate::real::{Real, real};
use crate::se::Twist;
use crate::tree::{Body, Frames, Tree};

/// Momentum of a complete tree, expressed along the axes of the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Momentum<T: Real> {
    /// About the centre of mass, N·m·s.
    pub angular: Vec3<T>,
    /// N·s.
    pub linear: Vec3<T>,
}

/// ½ q̇ᵀ M q̇, J: summed over the links of a tree on a fixed base, for joint velocities `qd`.
pub fn kinetic_energy<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>, qd: &[T; N]) -> T {
    let twists = tree.twists(&Twist::zero(), qd, frames);
    let mut twice = T::zero();
    for ((link, frame), twist) in tree.links.iter().zip(frames.links()).zip(&twists) {
        let (w, v) = (frame.turn_back(&twist.angular), frame.turn_back(&twist.linear));
        let (angular, linear) = link.body.momentum(&w, &v);
        twice += w.dot(&angular) + v.dot(&linear);
    }
    twice * real(0.5)
}

/// −Σ m g·c, J: zero when the centre of mass is level with the base's origin.
pub fn potential_energy<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> T {
    let mut moment = Vec3::zeros();
    for (link, frame) in tree.links.iter().zip(frames.links()) {
        moment += frame.origin * link.body.mass + frame.turn(&link.body.moment);
    }
    -moment.dot(&tree.gravity)
}

/// Momentum of a tree whose base moves with `base` (expressed along the axes of the reference frame, at the base's
/// origin) and whose joints move with `qd`. For a fixed base the twist is zero, and its own mass does not move.
pub fn momentum<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
    base: &Twist<T>,
    qd: &[T; N],
) -> Momentum<T> {
    let twists = tree.twists(base, qd, frames);
    let mut total = MassMoment { mass: T::zero(), moment: Vec3::zeros() };
    let (mut angular, mut linear) = (Vec3::zeros(), Vec3::zeros());
    let links = tree.links.iter().map(|link| &link.body).zip(frames.links()).zip(&twists);
    for ((body, frame), twist) in links.chain([((&tree.base, frames.base()), base)]) {
        let about: Body<T> = body.turned(&frame.rotation());
        let (spin, push) = about.momentum(&twist.angular, &twist.linear);
        angular += spin + frame.origin.cross(&push);
        linear += push;
        total.mass += body.mass;
        total.moment += about.moment + frame.origin * body.mass;
    }
    if total.mass > T::zero() {
        angular -= (total.moment / total.mass).cross(&linear);
    }
    Momentum { angular, linear }
}
