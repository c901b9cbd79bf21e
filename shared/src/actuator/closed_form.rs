//! A planar platform of which two legs share an anchor, without iteration.
//!
//! Seen from the plate on which the two legs have an anchor each, the shared anchor is where two circles about those meet;
//! the third leg's anchor is where that leg's circle meets the one about the shared anchor whose radius is the distance of the
//! two anchors on the other plate. Which of two points it is each time is the assembly mode.
//! Source: Merlet, Parallel Robots, Springer, 2006, chapter 4 (direct kinematics of planar robots).

use super::{MAX_LEGS, Platform, Setting};
use crate::real::{Mat3, Real, Vec2, Vec3, real};
use crate::se::Pose;

/// How the legs of a platform meet, and on which sides their circles do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClosedForm {
    /// Whether the shared anchor is on the top plate; else it is on the base plate.
    is_on_top: bool,
    /// The two legs that share an anchor, and the third.
    legs: [usize; 3],
    /// Whether each point is to the left of the way from the first centre to the second.
    is_left: [bool; 2],
}

impl<T: Real> Setting<T> {
    /// The anchor on the plate from which the others are seen, and the one on the other plate.
    fn anchors(&self, is_on_top: bool) -> (Vec2<T>, Vec2<T>) {
        let (base, top) = (self.base.xy(), self.top.xy());
        if is_on_top { (base, top) } else { (top, base) }
    }
}

impl Platform<f64, 3> {
    /// How the pose follows without iteration, in the assembly mode of `home`; `None` where no two of `legs` share an anchor.
    pub fn closed_form(&self, legs: &[Setting<f64>; MAX_LEGS]) -> Option<ClosedForm> {
        let pairs = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];
        let plates = [true, false].into_iter().flat_map(|is_on_top| pairs.map(|legs| (is_on_top, legs)));
        let (is_on_top, order) = plates.into_iter().find(|(is_on_top, [i, j, k])| {
            let [(own, shared), (other, end), (_, third)] = [*i, *j, *k].map(|leg| legs[leg].anchors(*is_on_top));
            shared == end && own != other && third != shared
        })?;
        // The points of the other plate at home, seen from this one.
        let pose = if is_on_top { self.home } else { self.home.inverse() };
        let seen = |point: Vec2<f64>| (pose * Vec3::new(point.x, point.y, 0.0)).xy();
        let [(first, shared), (second, _), (last, third)] = order.map(|leg| legs[leg].anchors(is_on_top));
        let is_left = |from: Vec2<f64>, to: Vec2<f64>, point: Vec2<f64>| (to - from).perp(&(point - from)) > 0.0;
        let shared = seen(shared);
        let is_left = [is_left(first, second, shared), is_left(last, shared, seen(third))];
        Some(ClosedForm { is_on_top, legs: order, is_left })
    }
}

impl ClosedForm {
    /// The pose of the top; not a number where the legs do not meet. The top stays at the height of `home`.
    pub fn pose<T: Real>(&self, legs: &[Setting<T>; MAX_LEGS], home: &Pose<T>) -> Pose<T> {
        let [a, b, c] = self.legs.map(|leg| legs.get(leg).copied().unwrap_or(Setting::of_joint(T::zero())));
        let [(first, own), (second, _), (last, third)] = [a, b, c].map(|leg| leg.anchors(self.is_on_top));
        let [left, left_of_third] = self.is_left;
        let shared = meeting((first, a.value), (second, b.value), left);
        let (arm, length) = (third - own, (third - own).norm());
        let end = meeting((last, c.value), (shared, length), left_of_third);
        // The arm from the shared anchor to the third, turned: its cosine and sine.
        let across = (end - shared) / arm.norm_squared();
        let (cosine, sine) = (arm.dot(&across), arm.perp(&across));
        let (zero, one) = (T::zero(), T::one());
        let rotation = Mat3::new(cosine, -sine, zero, sine, cosine, zero, zero, zero, one);
        let own = rotation * Vec3::new(own.x, own.y, zero);
        let seen = Pose { rotation, position: Vec3::new(shared.x - own.x, shared.y - own.y, zero) };
        let mut pose = if self.is_on_top { seen } else { seen.inverse() };
        pose.position.z = home.position.z;
        pose
    }
}

/// Where two circles (centre, radius) meet, to the left or to the right of the way between their centres.
fn meeting<T: Real>((from, radius): (Vec2<T>, T), (to, other): (Vec2<T>, T), is_left: bool) -> Vec2<T> {
    let way = to - from;
    let per_square = T::one() / way.norm_squared();
    let along = (radius * radius - other * other) * per_square * real(0.5) + real(0.5);
    let height = (radius * radius * per_square - along * along).sqrt();
    let height = if is_left { height } else { -height };
    Vec2::new(from.x + way.x * along - way.y * height, from.y + way.y * along + way.x * height)
}
