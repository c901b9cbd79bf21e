//! The nearest word to a pose out of frame look-ups: what a board without a host can answer.
//!
//! # Model
//!
//! Each module of an arm is in one of a few poses, 64 for six binary legs, which are constants: no platform is
//! solved on the chip. `T_base_tool = M_0 · M_1 ⋯ M_(n−1)`, with M_i the frame that the digits of module i name; the
//! mount is in the frames of the first module, the tool in those of the last.
//!
//! # Search
//!
//! From the base on, the `WIDTH` best choices are kept after each module (a beam search). A choice is as good as the
//! pose that it leaves to be reached, R = (M_0 ⋯ M_i)⁻¹·T, is near to what the modules behind it typically do, K:
//! s² = |p_R' − p_K|² + ℓ²·(3 − tr(R_K⁻¹ R_R)), with p_R' − p_K measured from the tool's end; 3 − tr = 2(1 − cos θ) ≈ θ²
//! needs neither root nor arc. A wider search follows: [`Search`]. The word found is near, not proven to be the nearest:
//! that takes the host, `darm nearest`.
//!
//! Memory and time are bounded: two beams of `WIDTH` entries, and `WIDTH` times the number of all frames of looks. A
//! frame is looked at once, so the frames may come one after the other from where they are stored: [`Beam::begin`], for
//! each module from the base on [`Beam::module`] and its frames by [`Beam::offer`], and [`Beam::found`].
#![allow(non_snake_case)]

mod meeting;
mod shortlist;
mod sort;

use serde::{Deserialize, Serialize};

use crate::actuator::{MAX_LEGS, Setting, Stage};
use crate::real::{Mat3, Real, Vec3, real};
use crate::se::Pose;
use crate::units::Word;
pub use meeting::Search;
use shortlist::Shortlist;

/// No coordinate of a pose that travels is larger than this, m or rad.
const MAX_NUMBER: f32 = 1e3;

/// A pose as it travels and is stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coordinates {
    /// Rotation vector, rad.
    pub turn_rad: [f32; 3],
    /// Position, m.
    pub position_m: [f32; 3],
}

impl Coordinates {
    /// The coordinates of a pose.
    pub fn of(pose: &Pose<f64>) -> Self {
        let single = |x: &Vec3<f64>| [x.x, x.y, x.z].map(|x| x as f32);
        Self { turn_rad: single(&pose.log().angular), position_m: single(&pose.position) }
    }

    /// Whether every coordinate is a number of a size that an arm may have: a kilometre, or as many radians.
    pub fn is_sound(&self) -> bool {
        self.turn_rad.iter().chain(&self.position_m).all(|x| x.abs() <= MAX_NUMBER)
    }

    /// The pose with these coordinates.
    pub fn pose(&self) -> Pose<f32> {
        Pose::new(&self.turn_rad.into(), self.position_m.into())
    }
}

/// One pose of a module, and the digits that name it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<T: Real> {
    /// Two bits for each actuator of the module, the first in the lowest.
    pub digits: u16,
    /// Pose of the module's top in its base.
    pub pose: Pose<T>,
}

/// A module as a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Module<'a, T: Real> {
    /// Every pose that it can take, in the order of their digits.
    pub frames: &'a [Frame<T>],
    /// How many actuators it has.
    pub actuators: u8,
    /// A pose amid the others.
    pub typical: Pose<T>,
}

/// A choice for the modules so far.
#[derive(Clone, Copy, Debug)]
struct Choice<T: Real> {
    /// Pose of the target in the top of the last module chosen.
    remaining: Pose<T>,
    word: Word,
}

/// A search, and the room that it needs.
#[derive(Clone, Debug)]
pub struct Beam<T: Real, const WIDTH: usize> {
    /// By the squares of their scores, m².
    choices: Shortlist<T, Choice<T>, WIDTH>,
    next: Shortlist<T, Choice<T>, WIDTH>,
    /// Digits of the word, those of the modules so far, and those before the module whose frames come.
    digits: usize,
    placed: usize,
    first: usize,
    /// What the modules behind typically do.
    behind: Pose<T>,
    length_scale_m: T,
}

/// A word, and how near it brings the tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found<T> {
    /// The word.
    pub word: Word,
    /// Distance d of the tool from the target, m.
    pub distance_m: T,
    /// Distance of the positions, m.
    pub error_m: T,
    /// Angle between the orientations, rad.
    pub error_rad: T,
}

impl<T: Real, const WIDTH: usize> Default for Beam<T, WIDTH> {
    fn default() -> Self {
        Self {
            choices: Shortlist::default(),
            next: Shortlist::default(),
            digits: 0,
            placed: 0,
            first: 0,
            behind: Pose::identity(),
            length_scale_m: T::zero(),
        }
    }
}

/// Pose of the tool in the base for `word`, a product of look-ups; `None` where a module has no frame for its digits.
pub fn pose_base_tool<T: Real>(modules: &[Module<T>], word: &Word) -> Option<Pose<T>> {
    let mut pose = Pose::identity();
    let mut first = 0;
    for module in modules {
        let actuators = usize::from(module.actuators);
        let digits = (0..actuators).fold(0, |bits, k| bits | u16::from(word.digit(first + k)) << (2 * k));
        let at = module.frames.binary_search_by_key(&digits, |frame| frame.digits).ok()?;
        pose = pose * module.frames.get(at)?.pose;
        first += actuators;
    }
    (first == word.len()).then_some(pose)
}

/// A word that brings the tool near `target`, with one radian held equal to `length_scale_m`; `None` where the modules
/// have more actuators than a word has digits, or one of them has no frame.
pub fn nearest<T: Real, const WIDTH: usize>(
    modules: &[Module<T>],
    target: &Pose<T>,
    length_scale_m: T,
    beam: &mut Beam<T, WIDTH>,
) -> Option<Found<T>> {
    beam.begin(target, modules.iter().map(|module| usize::from(module.actuators)).sum());
    for (index, module) in modules.iter().enumerate() {
        let behind = modules.iter().skip(index + 1).fold(Pose::identity(), |tail, module| tail * module.typical);
        beam.module(module.actuators, &behind, length_scale_m);
        module.frames.iter().for_each(|frame| beam.offer(frame));
    }
    beam.found()
}

impl<T: Real, const WIDTH: usize> Beam<T, WIDTH> {
    /// Starts a search for a word of this many digits that brings the tool near `target`.
    pub fn begin(&mut self, target: &Pose<T>, digits: usize) {
        (self.digits, self.placed, self.first) = (digits, 0, 0);
        self.next.clear();
        // A word of more digits than there can be is one that no search finds.
        if let Some(word) = u8::try_from(digits).ok().and_then(Word::zeros) {
            self.next.offer(T::zero(), || Choice { remaining: *target, word });
        }
    }

    /// The frames of the next module come now: this many actuators, with what the modules after it typically do `behind`,
    /// and one radian held equal to `length_scale_m`.
    pub fn module(&mut self, actuators: u8, behind: &Pose<T>, length_scale_m: T) {
        core::mem::swap(&mut self.choices, &mut self.next);
        self.next.clear();
        self.first = self.placed;
        self.placed += usize::from(actuators);
        (self.behind, self.length_scale_m) = (*behind, length_scale_m);
    }

    /// Tries a frame of the module behind every choice.
    pub fn offer(&mut self, frame: &Frame<T>) {
        let turn = self.length_scale_m * self.length_scale_m;
        let end = frame.pose * self.behind;
        for (_, choice) in &self.choices.list {
            let square = (end.position - choice.remaining.position).norm_squared();
            let score = square + turn * (real::<T>(3.0) - trace(&end.rotation, &choice.remaining.rotation));
            self.next.offer(score, || {
                let word = (self.first..self.placed).fold((choice.word, frame.digits), |(word, digits), actuator| {
                    (word.with_digit(actuator, (digits & 3) as u8), digits >> 2)
                });
                Choice { remaining: frame.pose.to(&choice.remaining), word: word.0 }
            });
        }
    }

    /// The word that brings the tool nearest of those that are left; `None` before every digit has had its module, and
    /// where a module has no frame, or there is none.
    pub fn found(&self) -> Option<Found<T>> {
        let of = |choice: &Choice<T>| Found {
            word: choice.word,
            distance_m: Pose::identity().distance(&choice.remaining, self.length_scale_m),
            error_m: choice.remaining.position.norm(),
            error_rad: choice.remaining.angle_rad(),
        };
        let left =
            self.next.list.iter().map(|(_, choice)| choice).filter(|_| self.placed == self.digits && self.placed > 0);
        left.map(of).reduce(|best, other| if other.distance_m < best.distance_m { other } else { best })
    }
}

/// The trace of aᵀ·b.
#[inline]
fn trace<T: Real>(a: &Mat3<T>, b: &Mat3<T>) -> T {
    a.iter().zip(b.iter()).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
}

/// The frames that `stage` can take, with `before` in front of each and `after` behind it: those of settings that
/// cannot be assembled are left out. In the order of their digits.
pub fn frames<'a, T: Real>(
    stage: &'a Stage<T>,
    before: &'a Pose<T>,
    after: &'a Pose<T>,
) -> impl Iterator<Item = Frame<T>> + 'a {
    (0..1u16 << (2 * stage.n_actuators())).filter_map(move |digits| {
        let mut settings = [Setting::of_joint(T::zero()); MAX_LEGS];
        for (leg, setting) in settings.iter_mut().enumerate().take(stage.n_actuators()) {
            *setting = stage.setting(leg, (digits >> (2 * leg) & 3) as u8)?;
        }
        Some(Frame { digits, pose: *before * stage.pose(&settings).ok()? * *after })
    })
}

/// Of some frames the pose whose place is nearest to their mean; the identity where there are none.
pub fn typical<T: Real>(frames: &[Frame<T>]) -> Pose<T> {
    let count = frames.iter().fold(T::zero(), |count, _| count + T::one()).max(T::one());
    let position = frames.iter().fold(Vec3::zeros(), |sum, frame| sum + frame.pose.position) / count;
    let rotation = frames.iter().fold(Mat3::zeros(), |sum, frame| sum + frame.pose.rotation) / count;
    let off = |frame: &Frame<T>| {
        (frame.pose.position - position).norm_squared() + (frame.pose.rotation - rotation).norm_squared()
    };
    let best = frames.iter().map(|frame| (off(frame), frame.pose)).reduce(|a, b| if b.0 < a.0 { b } else { a });
    best.map_or(Pose::identity(), |(_, pose)| pose)
}

#[cfg(test)]
mod tests;
