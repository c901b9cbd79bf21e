//! The equations of a synthesis: unknowns, residual, derivatives and bounds.

mod bounds;
mod parameters;
mod target;

use darm_core::actuator::Stage;
use darm_core::chain::{ChainError, Parameter};
use darm_core::se::Pose;
use darm_core::units::Word;
use nalgebra::{DMatrix, DVector};

pub(super) use self::bounds::Bound;
use self::parameters::{anchors, is_leg, is_used, stops, turns, values};
use self::target::{Target, rows};
use super::needed_words::Needed;
use super::{Accuracy, Bounds, Method, SynthesisError};
use crate::arm::frames::{DesiredFrame, StopRange};
use crate::arm::{Arm, ArmModel, ArmScratch};

/// A servo is turned rather than metal altered: one radian weighs as this share of the arm's length scale.
const SERVO_WEIGHT: f64 = 0.1;

/// The unknowns are the stops in the order of actuators and states, the coordinates of the anchors where those may be
/// moved, then the servo angles frame by frame. Derivatives
/// are scaled, so that the sum of squares of an alteration is what is to be small.
pub(in crate::synthesis) struct Problem<'a> {
    base_line: &'a Arm,
    pub(in crate::synthesis) targets: Vec<Target>,
    /// What a person sets: stops, then anchors.
    pub(in crate::synthesis) stops: Vec<Parameter>,
    /// Metres that one unit of an unknown weighs.
    weights: DVector<f64>,
    start: DVector<f64>,
    pub(in crate::synthesis) bounds: Vec<Bound>,
    model: ArmModel,
    scratch: ArmScratch,
    n_servos: usize,
    /// Whether the servo angles stay as they are.
    pub(in crate::synthesis) servos_fixed: bool,
    /// What counts as met.
    pub(in crate::synthesis) accuracy: Accuracy,
    planar: bool,
    /// In which settings each module has to be assembled; in none until a search says so.
    pub(in crate::synthesis) needed: Needed,
}

impl<'a> Problem<'a> {
    pub(in crate::synthesis) fn new(
        base_line: &'a Arm,
        desired: &[DesiredFrame],
        bounds: &Bounds,
        ranges: &[StopRange],
    ) -> Self {
        let chain = &base_line.model.chain;
        let n_servos = chain.n_servos();
        let mut stops = stops(base_line);
        if bounds.anchor_m > 0.0 {
            stops.extend(anchors(base_line));
        }
        let mut start = values(base_line, &stops);
        let mut weights: Vec<f64> =
            stops.iter().map(|stop| if turns(base_line, stop) { base_line.length_scale_m } else { 1.0 }).collect();
        for frame in desired {
            start.extend(&frame.servos_rad);
            weights.resize(start.len(), SERVO_WEIGHT * base_line.length_scale_m);
        }
        let planar = chain.is_planar() && desired.iter().all(|frame| frame.pose_base_tool.is_planar());
        let mut problem = Self {
            base_line,
            targets: desired.iter().map(|frame| target(base_line, &stops, frame, planar)).collect(),
            weights: weights.into(),
            start: start.into(),
            bounds: Vec::new(),
            model: base_line.model.clone(),
            scratch: ArmScratch::default(),
            n_servos,
            servos_fixed: false,
            accuracy: Accuracy::of(Method::Newton),
            planar,
            needed: Needed::default(),
            stops,
        };
        problem.bound_stops(bounds, ranges);
        problem.bound_servos();
        problem
    }

    /// The unknowns of the initial arm.
    pub(in crate::synthesis) fn start(&self) -> DVector<f64> {
        self.start.clone()
    }

    /// The values of all stops of an arm.
    pub(in crate::synthesis) fn values(arm: &Arm) -> Vec<f64> {
        values(arm, &stops(arm))
    }

    /// The actuators, by their names, with a stop as near to a bound as `near`.
    pub(in crate::synthesis) fn at_bounds(&self, unknowns: &DVector<f64>, near: f64) -> Vec<String> {
        let at_bound = self.bounds.iter().filter(|bound| bound.slack(unknowns) < near);
        let mut actuators: Vec<u8> = at_bound
            .filter_map(|bound| match self.stops.get(bound.terms.first()?.0)? {
                Parameter::Stop { actuator, .. }
                | Parameter::BaseAnchor { actuator, .. }
                | Parameter::TopAnchor { actuator, .. } => Some(*actuator),
                _ => None,
            })
            .collect();
        actuators.sort_unstable();
        actuators.dedup();
        actuators.into_iter().map(|actuator| self.base_line.actuator_name(actuator.into())).collect()
    }

    /// The unknowns of another arm of this kind, its servos as the frames have them.
    pub(in crate::synthesis) fn unknowns_of(&self, arm: &Arm) -> DVector<f64> {
        let mut unknowns = self.start();
        unknowns.iter_mut().zip(values(arm, &self.stops)).for_each(|(unknown, value)| *unknown = value);
        unknowns
    }

    /// Equations of all frames.
    pub(in crate::synthesis) fn n_rows(&self) -> usize {
        self.targets.iter().map(|target| target.rows.len()).sum()
    }

    pub(in crate::synthesis) fn n_frames(&self) -> usize {
        self.targets.len()
    }

    pub(in crate::synthesis) fn n_stops(&self) -> usize {
        self.stops.len()
    }

    pub(in crate::synthesis) fn n_servos(&self) -> usize {
        self.n_servos
    }

    pub(in crate::synthesis) fn is_planar(&self) -> bool {
        self.planar
    }

    /// Whether an unknown is the length of a leg.
    pub(in crate::synthesis) fn is_leg(&self, unknown: usize) -> bool {
        self.stops.get(unknown).is_some_and(|stop| is_leg(self.base_line, stop))
    }

    /// Whether an unknown is a coordinate of an anchor.
    pub(in crate::synthesis) fn is_anchor(&self, unknown: usize) -> bool {
        self.stops.get(unknown).is_some_and(|stop| !matches!(stop, Parameter::Stop { .. }))
    }

    /// Whether an unknown is an angle.
    pub(in crate::synthesis) fn is_angle(&self, unknown: usize) -> bool {
        self.stops.get(unknown).is_none_or(|stop| turns(self.base_line, stop))
    }

    pub(in crate::synthesis) fn weights(&self) -> &DVector<f64> {
        &self.weights
    }

    pub(in crate::synthesis) fn base_line(&self) -> &Arm {
        self.base_line
    }

    /// The servo angles of one frame.
    pub(in crate::synthesis) fn servos<'x>(&self, unknowns: &'x DVector<f64>, frame: usize) -> &'x [f64] {
        let first = self.first_servo(frame);
        &unknowns.as_slice()[first..first + self.n_servos]
    }

    /// The column of the first servo angle of one frame.
    pub(in crate::synthesis) fn first_servo(&self, frame: usize) -> usize {
        self.n_stops() + frame * self.n_servos
    }

    /// The arm with these stops, under the next number.
    pub(in crate::synthesis) fn arm(&mut self, unknowns: &DVector<f64>) -> Arm {
        self.take(unknowns);
        let mut arm = self.base_line.clone();
        arm.model.chain = self.model.chain.clone();
        arm.model.number += 1;
        arm
    }

    /// One stage of the arm with these stops.
    pub(in crate::synthesis) fn stage(&mut self, unknowns: &DVector<f64>, stage: usize) -> &Stage<f64> {
        self.take(unknowns);
        &self.model.chain.stages[stage]
    }

    /// Root of the sum of squares of what the stops were altered by.
    pub(in crate::synthesis) fn alteration(&self, unknowns: &DVector<f64>) -> f64 {
        let n = self.n_stops();
        (unknowns - &self.start).rows(0, n).component_mul(&self.weights.rows(0, n)).norm()
    }

    /// The most that a coordinate of an anchor was moved by, m.
    pub(in crate::synthesis) fn anchors_moved_m(&self, unknowns: &DVector<f64>) -> f64 {
        let anchors = (0..self.n_stops()).filter(|&unknown| self.is_anchor(unknown));
        anchors.map(|anchor| (unknowns[anchor] - self.start[anchor]).abs()).fold(0.0, f64::max)
    }

    /// Where the tool is in each frame.
    pub(in crate::synthesis) fn poses(&mut self, unknowns: &DVector<f64>) -> Result<Vec<Pose<f64>>, SynthesisError> {
        self.take(unknowns);
        (0..self.n_frames()).map(|index| self.pose(unknowns, index)).collect()
    }

    /// The poses of all stages, each in its own base, in each frame.
    pub(in crate::synthesis) fn postures(
        &mut self,
        unknowns: &DVector<f64>,
    ) -> Result<Vec<Vec<Pose<f64>>>, SynthesisError> {
        self.take(unknowns);
        let n_stages = self.model.chain.stages.len();
        let n_frames = self.n_frames();
        let posture = |index| {
            self.pose(unknowns, index)?;
            Ok(self.scratch.stages[..n_stages].to_vec())
        };
        (0..n_frames).map(posture).collect()
    }

    /// Where the tool is in the frames that are sensitive to one unknown; `None` for the others.
    pub(in crate::synthesis) fn poses_with(
        &mut self,
        unknowns: &DVector<f64>,
        column: usize,
    ) -> Result<Vec<Option<Pose<f64>>>, SynthesisError> {
        self.take(unknowns);
        let n_frames = self.n_frames();
        let pose =
            |index| if self.is_sensitive(index, column) { self.pose(unknowns, index).map(Some) } else { Ok(None) };
        (0..n_frames).map(pose).collect()
    }

    /// Whether the tool moves with one unknown in one frame.
    fn is_sensitive(&self, frame: usize, column: usize) -> bool {
        let own = self.first_servo(frame);
        (own..own + self.n_servos).contains(&column) || self.targets[frame].used.iter().any(|&(used, _)| used == column)
    }

    /// The error of each frame, in the frame of the tool, each row by its weight.
    pub(in crate::synthesis) fn residual(&mut self, unknowns: &DVector<f64>) -> Result<DVector<f64>, SynthesisError> {
        self.take(unknowns);
        let mut residual = DVector::zeros(self.n_rows());
        let mut first = 0;
        for index in 0..self.targets.len() {
            let pose = self.pose(unknowns, index)?;
            first += self.targets[index].error(&pose, &mut residual.as_mut_slice()[first..]);
        }
        Ok(residual)
    }

    /// The residual, and how it falls with each scaled unknown, to first order in the residual. Exact but for what
    /// effects add: those bend a stop's influence by a share as small as they are.
    pub(in crate::synthesis) fn linearise(
        &mut self,
        unknowns: &DVector<f64>,
    ) -> Result<(DVector<f64>, DMatrix<f64>), SynthesisError> {
        self.take(unknowns);
        let mut residual = DVector::zeros(self.n_rows());
        let mut jacobian = DMatrix::zeros(residual.len(), self.start.len());
        let mut first = 0;
        for index in 0..self.targets.len() {
            let pose = self.pose(unknowns, index)?;
            let target = &self.targets[index];
            let n = target.error(&pose, &mut residual.as_mut_slice()[first..]);
            let chain = &self.model.chain;
            let stops = target.used.iter().map(|&(column, stop)| (column, chain.derivative(stop, &self.scratch)));
            let free = if self.servos_fixed { 0 } else { self.n_servos };
            let servos = self.first_servo(index)..;
            let servos = servos.zip(chain.servo_jacobian(&self.scratch).take(free));
            for (column, twist) in stops.chain(servos) {
                let twist = target.seen(&twist, &pose);
                for (row, &(component, weight)) in target.rows.iter().enumerate() {
                    jacobian[(first + row, column)] = weight * twist[component] / self.weights[column];
                }
            }
            first += n;
        }
        Ok((residual, jacobian))
    }

    /// The same arm without effects and bounds for other words, from rest and with the first frame's servo angles;
    /// where the frames are to go does not matter.
    pub(in crate::synthesis) fn ideal(&self, words: &[Word]) -> Problem<'a> {
        let servos_rad: Vec<f64> = self.start.iter().skip(self.n_stops()).take(self.n_servos).copied().collect();
        let frames: Vec<_> = words.iter().map(|word| self.frame_from_rest(word, &servos_rad)).collect();
        let anchors = (0..self.n_stops()).any(|stop| self.is_anchor(stop));
        let anchor_m = if anchors { f64::INFINITY } else { 0.0 };
        let mut ideal = Problem::new(self.base_line, &frames, &Bounds { anchor_m, ..Bounds::none() }, &[]);
        ideal.model.effects.clear();
        ideal
    }

    /// The first frame's pose for a word from rest; `servos_rad` are the servo angles.
    fn frame_from_rest(&self, word: &Word, servos_rad: &[f64]) -> DesiredFrame {
        DesiredFrame {
            name: word.to_string(),
            word: *word,
            previous: self.base_line.rest(),
            servos_rad: servos_rad.to_vec(),
            pose_base_tool: self.targets.first().map_or(Pose::identity(), |target| target.pose),
            weights: Default::default(),
        }
    }

    /// The derivatives at the initial arm without its effects: the rows of the desired frames, then those of `more`
    /// words.
    pub(in crate::synthesis) fn ideal_jacobian(&self, more: &[Word]) -> Result<DMatrix<f64>, SynthesisError> {
        let words: Vec<Word> = self.words().iter().chain(more).copied().collect();
        let mut ideal = self.ideal(&words);
        for (ideal, own) in ideal.targets.iter_mut().zip(&self.targets) {
            ideal.rows.clone_from(&own.rows);
        }
        Ok(ideal.linearise_start()?.1)
    }

    /// Stops that some desired word uses.
    pub(in crate::synthesis) fn n_used_stops(&self) -> usize {
        let uses = |stop: &usize| self.targets.iter().any(|target| target.used.iter().any(|(used, _)| used == stop));
        (0..self.n_stops()).filter(uses).count()
    }

    /// [`linearise`](Self::linearise) at the initial arm.
    pub(in crate::synthesis) fn linearise_start(&mut self) -> Result<(DVector<f64>, DMatrix<f64>), SynthesisError> {
        let start = self.start();
        self.linearise(&start)
    }

    /// The word of each desired frame.
    pub(in crate::synthesis) fn words(&self) -> Vec<Word> {
        self.targets.iter().map(|target| target.word).collect()
    }

    fn take(&mut self, unknowns: &DVector<f64>) {
        for (stop, value) in self.stops.iter().zip(unknowns.iter()) {
            // The stops are those of this very chain.
            let _ = self.model.chain.set(*stop, *value);
        }
    }

    fn pose(&mut self, unknowns: &DVector<f64>, index: usize) -> Result<Pose<f64>, SynthesisError> {
        let target = &self.targets[index];
        let condition = self.model.working(target.word, target.previous, self.servos(unknowns, index));
        self.model.predict(&condition, &mut self.scratch).map_err(|reason| SynthesisError::NoPose {
            frame: target.name.clone(),
            word: target.word,
            module: match reason {
                ChainError::Platform { stage, .. } => self.base_line.stage_name(stage),
                _ => self.base_line.name.clone(),
            },
            reason,
        })
    }
}

/// The target of a desired frame: how far each row counts, and which of `stops` its word uses.
fn target(base_line: &Arm, stops: &[Parameter], frame: &DesiredFrame, planar: bool) -> Target {
    Target {
        name: frame.name.clone(),
        word: frame.word,
        previous: frame.previous,
        pose: frame.pose_base_tool,
        rows: rows(frame, planar, base_line.length_scale_m),
        by_parts: frame.weights.orientation == 0.0,
        used: stops.iter().copied().enumerate().filter(|(_, stop)| is_used(stop, &frame.word)).collect(),
    }
}
