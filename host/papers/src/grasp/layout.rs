//! How many fingers, joints and bodies a hand has, and how they are numbered.

use darm_core::se::Pose;

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
/// Bodies of the hand: its links finger by finger, then the palm.
pub const BODIES: usize = FINGERS * JOINTS + 1;
/// The palm among the bodies.
pub const PALM: usize = BODIES - 1;

/// Angles φᵢⱼ of all fingers, rad; that of finger i and joint j is at `COORDINATES·i + j`, both from 0.
pub type Angles = [f64; ANGLES];

/// Frames of all links in the palm, finger by finger.
pub type Links = [Pose<f64>; FINGERS * JOINTS];

/// Two bodies, by their numbers, the smaller one first.
pub type Pair = [usize; 2];

/// The finger that a body belongs to, and how many of its joints move the body in the palm; the palm has none.
pub fn joints_of(body: usize) -> Option<(usize, usize)> {
    (body < PALM).then_some((body / JOINTS, body % JOINTS + 1))
}

/// Whether a joint connects two bodies.
pub fn is_joined([a, b]: &Pair) -> bool {
    match (joints_of(*a), joints_of(*b)) {
        (Some((finger, one)), Some((other, next))) => finger == other && one.abs_diff(next) == 1,
        (Some((_, joints)), None) | (None, Some((_, joints))) => joints == 1,
        (None, None) => true,
    }
}
