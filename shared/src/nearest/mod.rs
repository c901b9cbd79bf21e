//! The nearest word to a pose out of frame look-ups: what a board without a host can answer.
//!
//! # Model
//!
//! Each module of an arm stands in one of a few poses, 64 for six binary legs, which are constants: no platform is
//! solved on the chip. `T_base_tool = M_0 · M_1 ⋯ M_(n−1)`, with M_i the frame that the digits of module i name; the
//! mount stands in the frames of the first module, the tool in those of the last.
//!
//! # Search
//!
//! From the base on, the `WIDTH` best choices are kept after each module (a beam search). A choice is as good as the
//! pose that it leaves to be reached, R = (M_0 ⋯ M_i)⁻¹·T, is near to what the modules behind it typically do, K:
//! s² = |p_R' − p_K|² + ℓ²·(3 − tr(R_K⁻¹ R_R)), with p_R' − p_K told from the tool's end; 3 − tr = 2(1 − cos θ) ≈ θ²
//! needs neither root nor arc. The word found is near, not proven to be the nearest: that takes the host, `darm nearest`.
//!
//! Memory and time are bounded: two beams of `WIDTH` entries, and `WIDTH` times the number of all frames of looks.
#![allow(non_snake_case)]

use heapless::Vec;

use crate::actuator::{MAX_LEGS, Setting, Stage};
use crate::real::{Mat3, Real, Vec3, real};
use crate::se::Pose;
use crate::units::Word;

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
    /// The square of the score, m².
    score: T,
    /// Pose of the target in the top of the last module chosen.
    remaining: Pose<T>,
    word: Word,
}

/// The room that a search needs.
#[derive(Clone, Debug)]
pub struct Beam<T: Real, const WIDTH: usize> {
    choices: Vec<Choice<T>, WIDTH>,
    next: Vec<Choice<T>, WIDTH>,
}

/// A word, and how near it brings the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found<T: Real> {
    /// The word.
    pub word: Word,
    /// Distance d of the tool from the target, m.
    pub distance_m: T,
}

impl<T: Real, const WIDTH: usize> Default for Beam<T, WIDTH> {
    fn default() -> Self {
        Self { choices: Vec::new(), next: Vec::new() }
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
    let digits = modules.iter().map(|module| usize::from(module.actuators)).sum::<usize>();
    let word = Word::zeros(u8::try_from(digits).ok()?)?;
    beam.choices.clear();
    beam.choices.push(Choice { score: T::zero(), remaining: *target, word }).ok()?;
    let mut first = 0;
    for (index, module) in modules.iter().enumerate() {
        let behind = modules.iter().skip(index + 1).fold(Pose::identity(), |tail, module| tail * module.typical);
        beam.step(module, first, &behind, length_scale_m);
        first += usize::from(module.actuators);
    }
    let distance_m = |choice: &Choice<T>| Pose::identity().distance(&choice.remaining, length_scale_m);
    let found = beam.choices.iter().map(|choice| Found { word: choice.word, distance_m: distance_m(choice) });
    found.reduce(|best, other| if other.distance_m < best.distance_m { other } else { best })
}

impl<T: Real, const WIDTH: usize> Beam<T, WIDTH> {
    /// Tries every frame of `module` behind every choice, with `behind` what the modules after it typically do.
    fn step(&mut self, module: &Module<T>, first: usize, behind: &Pose<T>, length_scale_m: T) {
        self.next.clear();
        let turn = length_scale_m * length_scale_m;
        let mut worst = None;
        for choice in &self.choices {
            // R_M against the rotation that it had to have, and its place against the one that it had to have.
            let wanted = choice.remaining.rotation * behind.rotation.transpose();
            for frame in module.frames {
                let place = frame.pose.rotation * behind.position + frame.pose.position;
                let square = (place - choice.remaining.position).norm_squared();
                let score = square + turn * (real::<T>(3.0) - trace(&frame.pose.rotation, &wanted));
                if self.next.is_full() && worst.is_some_and(|(_, worst)| score >= worst) {
                    continue;
                }
                let word = (0..usize::from(module.actuators))
                    .fold(choice.word, |word, leg| word.with_digit(first + leg, (frame.digits >> (2 * leg) & 3) as u8));
                let next = Choice { score, remaining: frame.pose.to(&choice.remaining), word };
                let unplaced = self.next.push(next).err();
                let place = worst.and_then(|(at, _)| self.next.get_mut(at));
                if let (Some(next), Some(place)) = (unplaced, place) {
                    *place = next;
                }
                if self.next.is_full() {
                    let scores = self.next.iter().map(|choice| choice.score).enumerate();
                    worst = scores.reduce(|a, b| if b.1 > a.1 { b } else { a });
                }
            }
        }
        core::mem::swap(&mut self.choices, &mut self.next);
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
