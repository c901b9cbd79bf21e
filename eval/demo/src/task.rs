//! What a course starts from: the arm, where its tool is to go, and the design that brings it there.

use std::path::Path;

use anyhow::Result;
use darm_arm::arm::{Arm, frames, frames::DesiredFrame};
use darm_arm::synthesis::{self, Synthesis, synthesize};
use darm_core::units::Word;
use darm_diagnose::truth::Kind;

/// What one course starts from.
pub struct Task {
    /// The initial arm.
    pub(crate) base_line: Arm,
    /// Where its tool is to go.
    pub(crate) desired: Vec<DesiredFrame>,
    /// Of everything that is drawn.
    pub(crate) seed: u64,
    /// The effect that the true arm is given; drawn where `None`.
    pub(crate) effect: Option<Kind>,
}

/// The arm that is built, and the desired frames with the words that bring its tool there.
pub struct Design {
    /// The arm.
    pub arm: Arm,
    /// The frames.
    pub wanted: Vec<DesiredFrame>,
    /// Where the geometry is made for the frames; `None` where the arm stays as it is.
    pub synthesis: Option<Synthesis>,
}

impl Task {
    /// Reads an arm file and its desired frames.
    pub(crate) fn read(arm: &Path, desired: &Path, seed: u64, effect: Option<Kind>) -> Result<Self> {
        let base_line = Arm::read(arm)?;
        let desired = in_turn(frames::read(desired, &base_line)?);
        Ok(Self { base_line, desired, seed, effect })
    }

    /// Finds the geometry that meets the desired frames. Where they are positions with words, the arm stays as it is.
    ///
    /// # Errors
    ///
    /// The synthesis fails.
    pub fn design(&self) -> Result<Design> {
        if self.is_for_positions() {
            return Ok(Design { arm: self.base_line.clone(), wanted: self.desired.clone(), synthesis: None });
        }
        let synthesis = self.synthesis(&self.base_line, &self.desired)?;
        let wanted = synthesis.frames.iter().map(|reached| reached.frame.clone()).collect();
        Ok(Design { arm: synthesis.arm.clone(), wanted, synthesis: Some(synthesis) })
    }

    /// A synthesis with the seed of the course.
    pub(crate) fn synthesis(&self, arm: &Arm, frames: &[DesiredFrame]) -> Result<Synthesis> {
        let options = synthesis::Options { seed: self.seed, ..synthesis::Options::default() };
        Ok(synthesize(arm, frames, &options)?)
    }

    /// Whether the orientation is free in every frame: the loop is then closed by better words alone.
    pub(crate) fn is_for_positions(&self) -> bool {
        self.desired.iter().all(|frame| frame.weights.orientation == 0.0)
    }

    /// As far as one radian counts in an error at the frames, m.
    pub(crate) fn length_scale_m(&self) -> f64 {
        if self.is_for_positions() { 0.0 } else { self.base_line.length_scale_m }
    }
}

/// The frames as a program that goes round and round visits them: each is reached from the one before it.
fn in_turn(mut frames: Vec<DesiredFrame>) -> Vec<DesiredFrame> {
    let words: Vec<Word> = frames.iter().map(|frame| frame.word).collect();
    for (frame, &before) in frames.iter_mut().zip(words.iter().cycle().skip(words.len().saturating_sub(1))) {
        frame.previous = before;
    }
    frames
}
