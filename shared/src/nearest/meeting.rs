//! A wider search than a beam in little memory: the last two modules are tried completely behind thousands of
//! beginnings.
//!
//! A beam chooses by the pose that the modules behind are nearest to on average, and its last choices are bound by the
//! first. Here a beginning counts as good when the modules behind are likely to meet what it leaves: the pose x that
//! remains to be reached, seen from K, what they typically do, is ξ = (2ℓ·vec q, p) of K⁻¹x, and the score is
//! (ξ − μ)ᵀ·C⁻¹·(ξ − μ) with mean and covariance of what they do, both summed over the modules to first order:
//! ξ of a module at the tool is Ad(B⁻¹) of its ξ at the module, B what is behind it. `WIDTH` beginnings are kept
//! after each module; behind each, the best of the third last module are met with all pairs of the last two. Of the
//! last one only those are looked at whose place along x is closer than the best word so far, after a look at the box
//! of their places.
//!
//! The search runs in pieces of at most some hundred thousand instructions: [`Search::step`]. Its room is `FRAMES`
//! frames of 16 bytes, whose numbers of 16 bits are off by some 2·10⁻⁵ rad and of the module's size, and 12 bytes for
//! each of `WIDTH`. Where the modules have more frames, or the last one more than 64, the beam alone answers; it always
//! runs, so the word is never worse than the beam's.

mod pairs;
mod small;
mod spread;

use heapless::Vec;

use super::shortlist::{Shortlist, refill};
use super::sort::sort_by;
use super::{Beam, Found, Frame, Module};
use crate::real::{Mat6, Vec3, Vec6};
use crate::se::Pose;
use crate::units::Word;
use small::{Motion, Small, motion};

/// Most modules.
const MODULES: usize = 8;
/// Most frames of a module, and most choices of the third last behind one beginning: a module of six binary legs. The
/// beam alone answers for an arm with a larger one.
const LAST: usize = 64;
/// Frames that one step scores, and frames of the last but one that it meets with those of the last: what bounds the
/// time of a step, whatever the table.
const SCORED: usize = 16;
const MET: usize = 4;
/// Beginnings with the third last module, for each of the beginnings without.
const FOLLOWED: usize = 24;

/// A module as it is kept.
#[derive(Clone, Copy, Debug)]
struct Part {
    /// What the modules behind it typically do.
    behind: Motion,
    /// Its frames.
    first: usize,
    count: usize,
    actuators: u8,
    /// No coordinate of its frames is larger, m.
    size_m: f32,
    /// What the number of a frame counts in the number of a beginning.
    stride: u32,
}

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The modules come.
    Answered,
    /// What a module behind the present one does is added to the mean and the covariance.
    Spread {
        part: usize,
    },
    /// A beginning is followed by every frame of the present module.
    Grow {
        beginning: usize,
        frame: usize,
    },
    /// The best frames of the third last module behind a beginning are chosen.
    Choose {
        beginning: usize,
        frame: usize,
    },
    /// One of them is met with the pairs of the last two modules.
    Meet {
        beginning: usize,
        follower: usize,
        second: usize,
        /// The pose of the target behind the follower.
        remaining: Motion,
    },
    Done,
}

/// A search that begins with a beam of `BEAM` choices and continues with `WIDTH` beginnings, and the room that it
/// needs.
#[derive(Clone, Debug)]
pub struct Search<const BEAM: usize, const WIDTH: usize, const FRAMES: usize> {
    beam: Beam<f32, BEAM>,
    frames: Vec<Small, FRAMES>,
    parts: Vec<Part, MODULES>,
    target: Motion,
    digits: usize,
    length_scale_m: f32,
    /// Every module and frame has found room.
    complete: bool,
    phase: Phase,
    /// The module that is chosen now.
    level: usize,
    beginnings: Vec<u32, WIDTH>,
    next: Shortlist<f32, u32, WIDTH>,
    followers: Shortlist<f32, u32, LAST>,
    mean: Vec6<f32>,
    /// The covariance, and its inverse once every module is in it.
    spread: Mat6<f32>,
    /// Places of the last module's frames, sorted along x, and the corners of their box, m.
    ends: Vec<Vec3<f32>, LAST>,
    corners: [Vec3<f32>; 2],
    /// The least distance so far, m, and the numbers of a beginning and of the frames of the last three modules.
    nearest_m: f32,
    best: Option<(u32, [usize; 3])>,
}

impl<const BEAM: usize, const WIDTH: usize, const FRAMES: usize> Default for Search<BEAM, WIDTH, FRAMES> {
    fn default() -> Self {
        Self {
            beam: Beam::default(),
            frames: Vec::new(),
            parts: Vec::new(),
            target: Motion::identity(),
            digits: 0,
            length_scale_m: 0.0,
            complete: true,
            phase: Phase::Done,
            level: 0,
            beginnings: Vec::new(),
            next: Shortlist::default(),
            followers: Shortlist::default(),
            mean: Vec6::zeros(),
            spread: Mat6::zeros(),
            ends: Vec::new(),
            corners: [Vec3::zeros(); 2],
            nearest_m: f32::MAX,
            best: None,
        }
    }
}

impl<const BEAM: usize, const WIDTH: usize, const FRAMES: usize> Search<BEAM, WIDTH, FRAMES> {
    /// Starts a search for a word of this many digits that brings the tool near `target`.
    pub fn begin(&mut self, target: &Pose<f32>, digits: usize) {
        self.beam.begin(target, digits);
        self.frames.clear();
        self.parts.clear();
        (self.target, self.digits, self.complete) = (motion(target), digits, true);
        (self.phase, self.best) = (Phase::Answered, None);
    }

    /// The frames of the next module come now, from the base on: see [`Beam::module`].
    pub fn module(&mut self, actuators: u8, behind: &Pose<f32>, length_scale_m: f32) {
        self.beam.module(actuators, behind, length_scale_m);
        self.length_scale_m = length_scale_m;
        let stride = self.parts.last().map_or(Some(1), |part| part.stride.checked_mul(part.count as u32));
        let part = Part {
            behind: motion(behind),
            first: self.frames.len(),
            count: 0,
            actuators,
            size_m: 1.0 / 64.0,
            stride: stride.unwrap_or(0),
        };
        self.complete &= self.parts.push(part).is_ok();
    }

    /// The next frame of the module.
    pub fn offer(&mut self, frame: &Frame<f32>) {
        self.beam.offer(frame);
        let Some(part) = self.parts.last_mut() else { return };
        let own = motion(&frame.pose);
        let max_m = own.translation.vector.amax();
        while part.size_m < max_m && part.size_m < f32::MAX / 4.0 {
            part.size_m *= 2.0;
            let earlier = self.frames.iter_mut().skip(part.first);
            earlier.for_each(|frame| frame.at = frame.at.map(|number| number / 2));
        }
        part.count += 1;
        self.complete &= self.frames.push(Small::of(&own, part.size_m, frame.digits)).is_ok();
    }

    /// Searches on for a while, once every frame has come; whether there is more to do.
    pub fn step(&mut self) -> bool {
        match self.phase {
            Phase::Answered => self.start(),
            Phase::Spread { part } => self.add_spread(part),
            Phase::Grow { beginning, frame } => self.grow(beginning, frame),
            Phase::Choose { beginning, frame } => self.choose(beginning, frame),
            Phase::Meet { beginning, follower, second, remaining } => {
                self.meet(beginning, follower, second, &remaining)
            }
            Phase::Done => {}
        }
        self.phase != Phase::Done
    }

    /// The word that brings the tool nearest of those that were looked at; `None` as [`Beam::found`].
    pub fn found(&self) -> Option<Found<f32>> {
        let beam = self.beam.found()?;
        match self.met() {
            Some(met) if met.word != beam.word && met.distance_m < beam.distance_m => Some(met),
            _ => Some(beam),
        }
    }

    /// Searches in one go; see [`super::nearest`].
    pub fn nearest(&mut self, modules: &[Module<f32>], target: &Pose<f32>, length_scale_m: f32) -> Option<Found<f32>> {
        self.begin(target, modules.iter().map(|module| usize::from(module.actuators)).sum());
        for (index, module) in modules.iter().enumerate() {
            let behind = modules.iter().skip(index + 1).fold(Pose::identity(), |tail, module| tail * module.typical);
            self.module(module.actuators, &behind, length_scale_m);
            module.frames.iter().for_each(|frame| self.offer(frame));
        }
        while self.step() {}
        self.found()
    }

    /// Prepares what is looked up, or leaves the answer to the beam.
    fn start(&mut self) {
        self.phase = Phase::Done;
        let (Some(found), Some(last)) = (self.beam.found(), self.parts.last().copied()) else { return };
        let n = self.parts.len();
        // Beginnings have the numbers below the stride of the module that follows them.
        let numbered = self.parts.iter().take(n.saturating_sub(2)).all(|part| part.stride > 0);
        if !self.complete || !numbered || n < 2 || self.parts.iter().any(|part| part.count > LAST) {
            return;
        }
        let frames = self.frames.get_mut(last.first..).unwrap_or_default();
        sort_by(frames, |a, b| a.at[0] < b.at[0]);
        refill(&mut self.ends, frames.iter().map(|frame| frame.motion(last.size_m).translation.vector));
        self.corners = [Vec3::repeat(f32::MAX), Vec3::repeat(f32::MIN)];
        for end in &self.ends {
            self.corners = [self.corners[0].inf(end), self.corners[1].sup(end)];
        }
        self.nearest_m = found.distance_m;
        self.beginnings.clear();
        let _ = self.beginnings.push(0);
        self.followers.clear();
        if n == 2 {
            self.followers.offer(0.0, || 0);
            self.phase = self.meeting(0, 0);
        } else {
            self.enter(0);
        }
    }

    /// Continues with the next module.
    fn enter(&mut self, level: usize) {
        self.level = level;
        (self.mean, self.spread) = (Vec6::zeros(), Mat6::zeros());
        self.next.clear();
        self.phase = Phase::Spread { part: level + 1 };
    }

    fn grow(&mut self, index: usize, from: usize) {
        let (Some(&beginning), Some(part)) = (self.beginnings.get(index), self.parts.get(self.level)) else { return };
        let remaining = self.remaining(beginning, self.level);
        let frames = self.frames.iter().skip(part.first).take(part.count).enumerate();
        for (number, frame) in frames.skip(from).take(SCORED) {
            let score = self.score(part, &frame.motion(part.size_m).inv_mul(&remaining));
            self.next.offer(score, || beginning + number as u32 * part.stride);
        }
        if from + SCORED < part.count {
            self.phase = Phase::Grow { beginning: index, frame: from + SCORED };
            return;
        }
        self.phase = Phase::Grow { beginning: index + 1, frame: 0 };
        if index + 1 == self.beginnings.len() {
            self.next.sort();
            refill(&mut self.beginnings, self.next.list.iter().map(|(_, number)| *number));
            self.enter(self.level + 1);
        }
    }

    fn choose(&mut self, index: usize, from: usize) {
        let Some(part) = self.parts.get(self.level) else { return };
        if from == 0 {
            self.followers.clear();
        }
        let Some(&beginning) = self.beginnings.get(index) else {
            self.phase = Phase::Done;
            return;
        };
        let remaining = self.remaining(beginning, self.level);
        let frames = self.frames.iter().skip(part.first).take(part.count).enumerate();
        for (number, frame) in frames.skip(from).take(SCORED) {
            let score = self.score(part, &frame.motion(part.size_m).inv_mul(&remaining));
            self.followers.offer(score, || number as u32);
        }
        if from + SCORED < part.count {
            self.phase = Phase::Choose { beginning: index, frame: from + SCORED };
            return;
        }
        self.followers.sort();
        self.followers
            .list
            .truncate((FOLLOWED * WIDTH).checked_div(self.beginnings.len()).map_or(1, |each| each.max(1)));
        self.phase = self.meeting(index, 0);
    }

    /// A frame of a module.
    fn motion(&self, part: usize, number: usize) -> Motion {
        let frame = self.parts.get(part).and_then(|part| Some((self.frames.get(part.first + number)?, part.size_m)));
        frame.map_or(Motion::identity(), |(frame, size_m)| frame.motion(size_m))
    }

    /// The pose of the target behind the first modules of a beginning.
    fn remaining(&self, beginning: u32, level: usize) -> Motion {
        let parts = self.parts.iter().take(level).enumerate();
        parts.fold(self.target, |rest, (index, part)| self.motion(index, part.number(beginning)).inv_mul(&rest))
    }

    /// The best of the words that were met.
    fn met(&self) -> Option<Found<f32>> {
        let (beginning, numbers) = self.best?;
        let (mut word, mut rest, mut actuator) = (Word::zeros(u8::try_from(self.digits).ok()?)?, self.target, 0);
        let n = self.parts.len();
        for (index, part) in self.parts.iter().enumerate() {
            // The last three, or both of two.
            let late = (index + 3).checked_sub(n).and_then(|late| numbers.get(late));
            let number = late.map_or_else(|| part.number(beginning), |number| *number);
            let frame = self.frames.get(part.first + number)?;
            rest = frame.motion(part.size_m).inv_mul(&rest);
            for leg in 0..usize::from(part.actuators) {
                word = word.with_digit(actuator, (frame.digits >> (2 * leg) & 3) as u8);
                actuator += 1;
            }
        }
        let rotation = rest.rotation.to_rotation_matrix().into_inner();
        let apart = Pose { rotation, position: rest.translation.vector };
        Some(Found {
            word,
            distance_m: Pose::identity().distance(&apart, self.length_scale_m),
            error_m: apart.position.norm(),
            error_rad: apart.angle_rad(),
        })
    }
}

impl Part {
    /// The number of its frame in a beginning.
    fn number(&self, beginning: u32) -> usize {
        beginning.checked_div(self.stride).unwrap_or(0) as usize % self.count.max(1)
    }
}

#[cfg(test)]
mod tests;
