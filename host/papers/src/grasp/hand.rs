//! The hand: four fingers of four joints on a palm, with spherical fingertips and shapes that may not touch.

use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_about};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::collision::{Body, Shapes};
use super::layout::{ANGLES, Angles, BODIES, COORDINATES, FINGERS, JOINTS, Links};

/// Postures in which it is looked which pairs touch.
const SAMPLED: usize = 300;
const SAMPLE_SEED: u64 = 1;
/// Pairs that touch in this share of them are not checked.
const NEARLY_ALL: f64 = 0.95;

/// A revolute joint of a finger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FingerJoint {
    /// Pose of the link that it moves in the link before, or in the palm, at angle zero.
    pub placement: Pose<f64>,
    /// Unit vector along the axis, in the frame of the link that it moves.
    pub axis: Vec3<f64>,
}

/// Four joints and a fingertip.
#[derive(Clone, Debug, PartialEq)]
pub struct Finger {
    /// Its name.
    pub name: String,
    /// Its joints from the palm outwards; the first is that of adduction and abduction.
    pub joints: [FingerJoint; JOINTS],
    /// The fingertip's frame in the last link: its origin is the centre of the sphere, z points outwards along the
    /// finger and x to the pad.
    pub tip: Pose<f64>,
    /// Radius of the fingertip, m.
    pub tip_radius_m: f64,
}

/// A hand of four fingers, the thumb last.
#[derive(Clone, Debug)]
pub struct Hand {
    /// Its name.
    pub name: String,
    /// Its fingers: index, medium, ring, thumb.
    pub fingers: [Finger; FINGERS],
    /// Least and greatest of every angle, rad.
    pub limits: [[f64; 2]; ANGLES],
    /// Its links, finger by finger, and its palm.
    pub bodies: [Body; BODIES],
    /// Their shapes, and which of them must not touch.
    pub shapes: Shapes,
}

/// A finger joint, virtual ones too, where it is in one posture: expressed in the palm.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Unit vector.
    pub direction: Vec3<f64>,
    /// A point on it, m.
    pub point: Vec3<f64>,
}

/// The hand in one posture, expressed in the palm.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Every joint.
    pub axes: [Axis; ANGLES],
    /// Every fingertip: the origin is the centre rᵢ of its sphere, z goes through the contact point pᵢ.
    pub tips: [Pose<f64>; FINGERS],
    /// Every link.
    pub links: Links,
}

impl Hand {
    /// A hand of these parts. `Err`: the link of a shape without volume.
    ///
    /// Pairs that touch in nearly all of a few hundred postures are not checked ([`Shapes::overlapping`]).
    ///
    /// # Errors
    ///
    /// The corners of a shape are in a plane: the name of its link.
    pub fn new(
        name: String,
        fingers: [Finger; FINGERS],
        limits: [[f64; 2]; ANGLES],
        bodies: [Body; BODIES],
    ) -> Result<Self, String> {
        let shapes = Shapes::new(&bodies)?;
        let mut hand = Self { name, fingers, limits, bodies, shapes };
        let mut random = ChaCha8Rng::seed_from_u64(SAMPLE_SEED);
        let postures: Vec<Links> = (0..SAMPLED).map(|_| hand.place(&hand.random_angles(&mut random)).links).collect();
        hand.shapes.leave_out(&postures, NEARLY_ALL);
        Ok(hand)
    }

    /// Angles drawn evenly within the limits.
    pub(super) fn random_angles(&self, random: &mut impl Rng) -> Angles {
        self.limits.map(|[low, high]| low + (high - low) * random.random::<f64>())
    }

    /// The names of links that touch in nearly all postures and are not checked.
    pub fn overlapping(&self) -> Vec<[String; 2]> {
        self.shapes.overlapping.iter().map(|pair| pair.map(|body| self.bodies[body].name.clone())).collect()
    }

    /// Every angle in the middle of its range.
    pub fn middle(&self) -> Angles {
        self.limits.map(|[low, high]| 0.5 * (low + high))
    }

    /// The angles brought back to their limits.
    pub fn within_limits(&self, angles: &Angles) -> Angles {
        std::array::from_fn(|k| angles[k].clamp(self.limits[k][0], self.limits[k][1]))
    }

    /// Where joints, links and fingertips are in the palm.
    pub fn place(&self, angles: &Angles) -> Placed {
        let nowhere = Axis { direction: Vec3::zeros(), point: Vec3::zeros() };
        let mut placed = Placed {
            axes: [nowhere; ANGLES],
            tips: [Pose::identity(); FINGERS],
            links: [Pose::identity(); FINGERS * JOINTS],
        };
        for (i, finger) in self.fingers.iter().enumerate() {
            let mut at = Pose::identity();
            for (j, joint) in finger.joints.iter().enumerate() {
                at = at * joint.placement;
                let k = COORDINATES * i + j;
                placed.axes[k] = Axis { direction: at.rotation * joint.axis, point: at.position };
                at.rotation *= rotation_about(&joint.axis, angles[k]);
                placed.links[JOINTS * i + j] = at;
            }
            let tip = at * finger.tip;
            let (first, second) = (COORDINATES * i + JOINTS, COORDINATES * i + JOINTS + 1);
            let bent = tip.rotation * rotation_about(&Vec3::y(), angles[first]);
            placed.axes[first] = Axis { direction: tip.rotation.column(1).into(), point: tip.position };
            placed.axes[second] = Axis { direction: -bent.column(0), point: tip.position };
            let rotation = bent * rotation_about(&Vec3::x(), -angles[second]);
            placed.tips[i] = Pose { rotation, position: tip.position };
        }
        placed
    }
}

impl Placed {
    /// The unit normal of a finger's contact, from the centre of the fingertip outwards, in the palm.
    pub fn normal(&self, finger: usize) -> Vec3<f64> {
        self.tips[finger].rotation.column(2).into()
    }
}
