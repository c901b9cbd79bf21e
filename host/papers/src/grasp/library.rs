//! Postures to start a search from: the one that makes contacts most like the requested ones.
//!
//! A posture is kept as its contacts expressed in the frame of the thumb's. Laid on the thumb's contact of a query it can still
//! turn about the contact's normal; the turn that brings the other fingertips nearest is known in closed form, and so is
//! what is left. So thousands of postures are compared in the time of a few steps of the search.

use darm_core::real::Vec3;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::contact::{Contacts, RADIAN_M, across};
use super::hand::Hand;
use super::layout::{Angles, THUMB};
use super::paper::Variables;

/// Centres and directions of the three other contacts, expressed about the thumb's.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sight {
    /// In the plane across the thumb's normal as (x, y), then along it: centres in m, directions as long as they count.
    points: [Vec3<f64>; 2 * THUMB],
    /// Sum of their squares.
    size: f64,
}

/// Postures with what they touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    postures: Vec<(Sight, Angles)>,
}

impl Library {
    /// `count` postures that the hand can take without a collision, drawn from a seed.
    pub fn draw(hand: &Hand, count: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let one = |_| {
            let angles = hand.draw(&mut random)?.0.angles;
            let placed = hand.place(&angles);
            let axes = placed.tips[THUMB].rotation;
            let sight = Sight::of(hand, &hand.contacts(&placed), &axes.column(0).into(), &axes.column(1).into());
            Some((sight, angles))
        };
        Self { postures: (0..count).map_while(one).collect() }
    }

    /// Whether no posture without a collision was found.
    pub fn is_empty(&self) -> bool {
        self.postures.is_empty()
    }

    /// The starts nearest to the contacts, at most `count`, the nearest first, each with its squared distance, m².
    pub(super) fn nearest(&self, hand: &Hand, contacts: &Contacts, count: usize) -> Vec<(f64, Variables)> {
        let (x, y) = across(&contacts[THUMB].direction);
        let sight = Sight::of(hand, contacts, &x, &y);
        let mut found: Vec<_> = self.postures.iter().map(|posture| (sight.apart(&posture.0), posture)).collect();
        let nearer = |a: &(f64, _), b: &(f64, _)| a.0.total_cmp(&b.0);
        if count < found.len() {
            found.select_nth_unstable_by(count, nearer);
            found.truncate(count);
        }
        found.sort_by(nearer);
        let start = |(apart, (other, angles)): (f64, &(Sight, Angles))| {
            (apart, Variables { turn_rad: sight.turn_rad(other), angles: *angles })
        };
        found.into_iter().map(start).collect()
    }
}

impl Sight {
    /// Expressed along x and y, two unit vectors across the thumb's normal.
    fn of(hand: &Hand, contacts: &Contacts, x: &Vec3<f64>, y: &Vec3<f64>) -> Self {
        let thumb = contacts[THUMB];
        let in_frame = |v: Vec3<f64>| Vec3::new(x.dot(&v), y.dot(&v), thumb.direction.dot(&v));
        let mut points = [Vec3::zeros(); 2 * THUMB];
        for i in 0..THUMB {
            points[2 * i] = in_frame(contacts[i].center(hand.fingers[i].tip_radius_m) - thumb.point);
            points[2 * i + 1] = in_frame(contacts[i].direction * RADIAN_M);
        }
        Self { points, size: points.iter().map(Vec3::norm_squared).sum() }
    }

    /// The squared distance to another posture that is turned as well as it can be, m².
    fn apart(&self, other: &Self) -> f64 {
        let (along, across, rest) = self.products(other);
        self.size + other.size - 2.0 * (rest + (along * along + across * across).sqrt())
    }

    /// The turn that brings another posture nearest, rad.
    fn turn_rad(&self, other: &Self) -> f64 {
        let (along, across, _) = self.products(other);
        across.atan2(along)
    }

    /// Sums over all points of a·b across the normal, of a×b there, and of a·b along it.
    fn products(&self, other: &Self) -> (f64, f64, f64) {
        self.points.iter().zip(&other.points).fold((0.0, 0.0, 0.0), |(along, across, rest), (a, b)| {
            (along + a.x * b.x + a.y * b.y, across + a.y * b.x - a.x * b.y, rest + a.z * b.z)
        })
    }
}
