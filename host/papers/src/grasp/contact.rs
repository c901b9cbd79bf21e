//! What a grasp asks for: four contacts, and random ones that the hand can surely make.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::hand::{Finger, Hand, Placed};
use super::layout::{Angles, FINGERS, THUMB};

/// One radian of a contact's direction counts as this many metres of its point: about the length of a last phalanx.
pub(super) const RADIAN_M: f64 = 0.03;

/// A contact of a fingertip with the object: five constraints, for the fingertip may turn about the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Where the fingertip touches: p* of the paper, m, in the world.
    pub point: Vec3<f64>,
    /// Which way it pushes, normal to the object's boundary and into the object; a unit vector in the world.
    pub direction: Vec3<f64>,
}

/// The contact of each finger, in the order of the hand's fingers.
pub type Contacts = [Contact; FINGERS];

/// A configuration of the hand: C of the paper, 30 numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    /// Pose of the palm in the world: W.
    pub pose_world_palm: Pose<f64>,
    /// φ₁₁, …, φ₄₆, rad.
    pub angles: Angles,
}

/// How far a contact is from the requested one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactError {
    /// |p* − p|, m.
    pub point_m: f64,
    /// |r* − r|, m, of the centre of the fingertip.
    pub center_m: f64,
}

impl Contact {
    /// Centre of the fingertip that makes this contact: r* = p* − ρ·n*, m.
    pub fn center(&self, tip_radius_m: f64) -> Vec3<f64> {
        self.point - self.direction * tip_radius_m
    }

    /// The contact expressed in the frame whose pose in the present one is given.
    pub fn seen_from(&self, pose: &Pose<f64>) -> Self {
        Self {
            point: pose.rotation.tr_mul(&(self.point - pose.position)),
            direction: pose.rotation.tr_mul(&self.direction),
        }
    }
}

impl Hand {
    /// The contacts that the fingertips make in a posture, expressed in the palm.
    pub fn contacts(&self, placed: &Placed) -> Contacts {
        std::array::from_fn(|i| {
            let direction = placed.normal(i);
            Contact { point: placed.tips[i].position + direction * self.fingers[i].tip_radius_m, direction }
        })
    }

    /// How far the contacts of a configuration are from the requested ones.
    pub fn errors(&self, configuration: &Configuration, contacts: &Contacts) -> [ContactError; FINGERS] {
        let reached = self.contacts(&self.place(&configuration.angles));
        std::array::from_fn(|i| {
            let (wanted, rho) = (contacts[i].seen_from(&configuration.pose_world_palm), self.fingers[i].tip_radius_m);
            ContactError {
                point_m: (wanted.point - reached[i].point).norm(),
                center_m: (wanted.center(rho) - reached[i].center(rho)).norm(),
            }
        })
    }

    /// The pose of the palm that puts the thumb's contact at its requested place, with the hand turned by `turn_rad`
    /// about the contact's direction (φ_T of the paper, from another direction for each contact).
    pub fn on_thumb(&self, placed: &Placed, contacts: &Contacts, turn_rad: f64) -> Pose<f64> {
        let thumb = contacts[THUMB];
        let (s, c) = turn_rad.sin_cos();
        let (x, y) = across(&thumb.direction);
        let rotation = Mat3::from_columns(&[x * c + y * s, y * c - x * s, thumb.direction]);
        let center = thumb.center(self.fingers[THUMB].tip_radius_m);
        Pose { rotation, position: center } * placed.tips[THUMB].inverse()
    }

    /// Two fingers that can never make their contacts together, the distance of these, and the most that the links
    /// between them bridge when stretched, m. Where the fingers are not assigned, any two are compared with the best two.
    pub fn out_of_reach(&self, contacts: &Contacts, is_assigned: bool) -> Option<(usize, usize, f64, f64)> {
        let length = |finger: &Finger| {
            let joints = finger.joints.iter().skip(1).map(|joint| joint.placement.position.norm()).sum::<f64>();
            joints + finger.tip.position.norm() + finger.tip_radius_m
        };
        let bridge = |a: &Finger, b: &Finger| {
            let bases = (a.joints[0].placement.position - b.joints[0].placement.position).norm();
            length(a) + length(b) + bases
        };
        let pairs = || (0..FINGERS).flat_map(|b| (0..b).map(move |a| (a, b)));
        let span = |(a, b): (usize, usize)| bridge(&self.fingers[a], &self.fingers[b]);
        let widest = pairs().map(span).fold(0.0, f64::max);
        pairs().find_map(|(a, b)| {
            let apart = (contacts[a].point - contacts[b].point).norm();
            let span = if is_assigned { span((a, b)) } else { widest };
            (apart > span || apart.is_nan()).then_some((a, b, apart, span))
        })
    }

    /// A posture within the limits in which nothing touches, drawn evenly, and the contacts that it makes.
    ///
    /// The paper's random constraints: "generating a random hand configuration" and "choosing a contact point on each
    /// fingertip"; the palm is anywhere. `None` when a thousand draws all collide.
    pub fn draw(&self, random: &mut impl Rng) -> Option<(Configuration, Contacts)> {
        for _ in 0..1000 {
            let angles = self.random_angles(random);
            let placed = self.place(&angles);
            if self.shapes.collision(&placed.links).is_some() {
                continue;
            }
            let mut vector = || Vec3::from_fn(|_, _| 2.0 * random.random::<f64>() - 1.0);
            let pose_world_palm = Pose::new(&(vector() * std::f64::consts::PI), vector() * 0.5);
            let contacts = self.contacts(&placed).map(|contact| contact.seen_from(&pose_world_palm.inverse()));
            return Some((Configuration { pose_world_palm, angles }, contacts));
        }
        None
    }

    /// `count` constraints that the hand can meet; the same for the same seed, whatever the number of cores.
    pub fn draw_many(&self, count: usize, seed: u64) -> Vec<Contacts> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map_while(|_| Some(self.draw(&mut random)?.1)).collect()
    }
}

/// Two unit vectors that make a right-handed frame with the unit vector z.
pub(super) fn across(z: &Vec3<f64>) -> (Vec3<f64>, Vec3<f64>) {
    let shortest = z.iamin();
    let x = Vec3::from_fn(|k, _| if k == shortest { 1.0 } else { 0.0 });
    let x = (x - z * z.dot(&x)).normalize();
    (x, z.cross(&x))
}
