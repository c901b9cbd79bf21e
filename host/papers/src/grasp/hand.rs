//! The hand: four fingers of four joints on a palm, spherical fingertips, and the capsules that may not touch.

use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_about};

use super::segments::nearest_points;

/// Fingers of the hand; the last is the thumb.
pub const FINGERS: usize = 4;
/// The thumb among the fingers.
pub const THUMB: usize = FINGERS - 1;
/// Joints of a finger that move.
pub const JOINTS: usize = 4;
/// Joints of a finger with the two virtual ones that place the contact on the fingertip.
pub const COORDINATES: usize = JOINTS + 2;
/// Angles of the hand: φ₁₁, …, φ₄₆ of the paper, finger by finger.
pub const ANGLES: usize = FINGERS * COORDINATES;

/// Angles φᵢⱼ of all fingers, rad; that of finger i and joint j is at `COORDINATES·i + j`, both from 0.
pub type Angles = [f64; ANGLES];

/// Frames of all links in the palm, finger by finger.
pub type Links = [Pose<f64>; FINGERS * JOINTS];

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

/// A segment with a radius, fixed to a link or to the palm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// The link, numbered finger by finger; `None`: the palm.
    pub link: Option<usize>,
    /// One end of the segment in the frame of the link, m.
    pub from: Vec3<f64>,
    /// The other end.
    pub to: Vec3<f64>,
    /// Radius, m.
    pub radius_m: f64,
}

/// Two capsules, by their numbers, that must not touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The one.
    pub first: usize,
    /// The other.
    pub second: usize,
}

/// A hand of four fingers, the thumb last.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    /// Its name.
    pub name: String,
    /// Its fingers: index, medium, ring, thumb.
    pub fingers: [Finger; FINGERS],
    /// Least and greatest of every angle, rad.
    pub limits: [[f64; 2]; ANGLES],
    /// The shapes of palm and links.
    pub capsules: Vec<Capsule>,
    /// Pairs of capsules that must not touch.
    pub pairs: Vec<Pair>,
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

impl Capsule {
    /// The ends of the segment in the palm, for one posture.
    pub fn ends(&self, links: &Links) -> [Vec3<f64>; 2] {
        let pose = self.link.map_or(Pose::identity(), |link| links[link]);
        [pose * self.from, pose * self.to]
    }

    /// The finger that it belongs to, and its joints between the palm and the capsule; the palm has none.
    pub fn joints(&self) -> Option<(usize, usize)> {
        self.link.map(|link| (link / JOINTS, link % JOINTS + 1))
    }
}

impl Hand {
    /// A hand of these parts; pairs of capsules that touch in its middle posture are neighbours and never checked.
    pub fn new(name: String, fingers: [Finger; FINGERS], limits: [[f64; 2]; ANGLES], capsules: Vec<Capsule>) -> Self {
        let mut hand = Self { name, fingers, limits, capsules, pairs: Vec::new() };
        hand.pairs = pairs(&hand.capsules, &hand.place(&hand.middle()).links);
        hand
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

/// The pairs of capsules of different links that are apart in this posture.
fn pairs(capsules: &[Capsule], links: &Links) -> Vec<Pair> {
    let apart = |a: &Capsule, b: &Capsule| {
        let ([p, q], [r, s]) = (a.ends(links), b.ends(links));
        let [x, y] = nearest_points(&p, &q, &r, &s);
        (x - y).norm() > a.radius_m + b.radius_m
    };
    let all = (0..capsules.len()).flat_map(|second| (0..second).map(move |first| Pair { first, second }));
    all.filter(|pair| {
        let (a, b) = (&capsules[pair.first], &capsules[pair.second]);
        a.link != b.link && apart(a, b)
    })
    .collect()
}
