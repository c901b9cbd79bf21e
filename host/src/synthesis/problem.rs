//! The equations of a synthesis: unknowns, residual, derivatives and bounds.

use darm_core::actuator::{JointKind, Stage};
use darm_core::chain::{ChainError, Parameter};
use darm_core::se::{Pose, Twist};
use darm_core::units::Word;
use nalgebra::{DMatrix, DVector};

use super::{Bounds, SynthesisError};
use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmModel, ArmScratch};

/// A servo is turned rather than metal altered: one radian weighs as this share of the arm's length scale.
const SERVO_WEIGHT: f64 = 0.1;

/// A desired frame, or any word, whose pose is part of the problem.
pub(super) struct Target {
    name: String,
    pub(super) word: Word,
    previous: Word,
    pub(super) pose: Pose<f64>,
}

/// What one linear inequality on the unknowns says: the sum of the terms is at least this.
#[derive(Clone, Debug)]
pub(super) struct Bound {
    /// Unknown and factor.
    pub(super) terms: Vec<(usize, f64)>,
    pub(super) least: f64,
}

/// The unknowns are the stops in the order of actuators and states, then the servo angles frame by frame. They are
/// scaled, so that the sum of squares of an alteration is what is to be small.
pub(super) struct Problem<'a> {
    base_line: &'a Arm,
    pub(super) targets: Vec<Target>,
    stops: Vec<Parameter>,
    /// Metres that one unit of an unknown weighs.
    weights: DVector<f64>,
    start: DVector<f64>,
    pub(super) bounds: Vec<Bound>,
    model: ArmModel,
    scratch: ArmScratch,
    n_servos: usize,
    /// Whether the servo angles stay as they are.
    pub(super) servos_held: bool,
    planar: bool,
}

impl<'a> Problem<'a> {
    pub(super) fn new(base_line: &'a Arm, desired: &[DesiredFrame], bounds: Bounds) -> Self {
        let chain = &base_line.model.chain;
        let n_servos = chain.n_servos();
        let stops = stops(base_line);
        let mut start: Vec<f64> = stops.iter().map(|stop| chain.get(*stop).unwrap_or(0.0)).collect();
        let mut weights: Vec<f64> = stops
            .iter()
            .map(|stop| if is_leg(base_line, stop) { 1.0 } else { joint_weight(base_line, stop) })
            .collect();
        for frame in desired {
            start.extend(&frame.servos_rad);
            weights.resize(start.len(), SERVO_WEIGHT * base_line.length_scale_m);
        }
        let target = |frame: &DesiredFrame| Target {
            name: frame.name.clone(),
            word: frame.word,
            previous: frame.previous,
            pose: frame.pose_base_tool,
        };
        let mut problem = Self {
            base_line,
            targets: desired.iter().map(target).collect(),
            weights: weights.into(),
            start: start.into(),
            bounds: Vec::new(),
            model: base_line.model.clone(),
            scratch: ArmScratch::default(),
            n_servos,
            servos_held: false,
            planar: chain.is_planar() && desired.iter().all(|frame| frame.pose_base_tool.is_planar()),
            stops,
        };
        problem.bound_stops(bounds);
        problem.bound_servos();
        problem
    }

    /// The unknowns of the base-line arm.
    pub(super) fn start(&self) -> DVector<f64> {
        self.start.clone()
    }

    /// Equations that one frame gives: 3 in the plane, 6 in space.
    pub(super) fn n_rows(&self) -> usize {
        if self.planar { 3 } else { 6 }
    }

    pub(super) fn n_stops(&self) -> usize {
        self.stops.len()
    }

    pub(super) fn n_servos(&self) -> usize {
        self.n_servos
    }

    pub(super) fn weights(&self) -> &DVector<f64> {
        &self.weights
    }

    pub(super) fn base_line(&self) -> &Arm {
        self.base_line
    }

    /// The servo angles of one frame.
    pub(super) fn servos<'x>(&self, unknowns: &'x DVector<f64>, frame: usize) -> &'x [f64] {
        let first = self.n_stops() + frame * self.n_servos;
        &unknowns.as_slice()[first..first + self.n_servos]
    }

    /// The arm with these stops, under the next number.
    pub(super) fn arm(&mut self, unknowns: &DVector<f64>) -> Arm {
        self.take(unknowns);
        let mut arm = self.base_line.clone();
        arm.model.chain = self.model.chain.clone();
        arm.model.number += 1;
        arm
    }

    /// Root of the sum of squares of what the stops were altered by.
    pub(super) fn alteration(&self, unknowns: &DVector<f64>) -> f64 {
        let n = self.n_stops();
        (unknowns - &self.start).rows(0, n).component_mul(&self.weights.rows(0, n)).norm()
    }

    /// Where the tool stands in each frame.
    pub(super) fn poses(&mut self, unknowns: &DVector<f64>) -> Result<Vec<Pose<f64>>, SynthesisError> {
        self.take(unknowns);
        (0..self.targets.len()).map(|index| self.pose(unknowns, index)).collect()
    }

    /// What each frame lacks, told in the tool's frame, the angles weighted by the length scale.
    pub(super) fn residual(&mut self, unknowns: &DVector<f64>) -> Result<DVector<f64>, SynthesisError> {
        let poses = self.poses(unknowns)?;
        let n = self.n_rows();
        let mut residual = DVector::zeros(poses.len() * n);
        for (index, (pose, target)) in poses.iter().zip(&self.targets).enumerate() {
            let row = self.row(&pose.to(&target.pose).log());
            residual.rows_mut(index * n, n).copy_from_slice(&row[..n]);
        }
        Ok(residual)
    }

    /// How the rows of the residual fall with each unknown, to first order in the residual. Exact but for what effects
    /// add: those bend a stop's influence by a share as small as they are.
    pub(super) fn jacobian(&mut self, unknowns: &DVector<f64>) -> Result<DMatrix<f64>, SynthesisError> {
        self.take(unknowns);
        let n = self.n_rows();
        let mut jacobian = DMatrix::zeros(self.targets.len() * n, self.start.len());
        for index in 0..self.targets.len() {
            self.pose(unknowns, index)?;
            let word = self.targets[index].word;
            let chain = &self.model.chain;
            let stops = self.stops.iter().enumerate().filter(|(_, stop)| is_used(stop, &word));
            let stops = stops.map(|(column, stop)| (column, chain.derivative(*stop, &self.scratch)));
            let first = self.n_stops() + index * self.n_servos;
            let free = if self.servos_held { 0 } else { self.n_servos };
            let servos =
                chain.servo_jacobian(&self.scratch).take(free).enumerate().map(|(servo, twist)| (first + servo, twist));
            for (column, twist) in stops.chain(servos) {
                jacobian.view_mut((index * n, column), (n, 1)).copy_from_slice(&self.row(&twist)[..n]);
            }
        }
        Ok(jacobian)
    }

    /// The components of a twist that a frame is judged by.
    pub(super) fn row(&self, twist: &Twist<f64>) -> [f64; 6] {
        let (w, v) = (twist.angular * self.base_line.length_scale_m, twist.linear);
        if self.planar { [w.z, v.x, v.y, 0.0, 0.0, 0.0] } else { [w.x, w.y, w.z, v.x, v.y, v.z] }
    }

    /// The same arm without effects and bounds for other words, from rest and with the first frame's servo angles;
    /// where the frames are to go does not matter.
    pub(super) fn ideal(&self, words: &[Word]) -> Problem<'a> {
        let servos_rad: Vec<f64> = self.start.iter().skip(self.n_stops()).take(self.n_servos).copied().collect();
        let frame = |word: &Word| DesiredFrame {
            name: word.to_string(),
            word: *word,
            previous: self.base_line.rest(),
            servos_rad: servos_rad.clone(),
            pose_base_tool: self.targets.first().map_or(Pose::identity(), |target| target.pose),
        };
        let frames: Vec<_> = words.iter().map(frame).collect();
        let unbounded = Bounds { shortest: 0.0, longest: f64::INFINITY, stroke: f64::NEG_INFINITY };
        let mut ideal = Problem::new(self.base_line, &frames, unbounded);
        ideal.model.effects.clear();
        ideal
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

    fn bound_stops(&mut self, bounds: Bounds) {
        for (index, stop) in self.stops.iter().enumerate() {
            let Parameter::Stop { actuator, state } = *stop else { continue };
            let mut bound = |terms, least| self.bounds.push(Bound { terms, least });
            if state > 0 {
                bound(vec![(index, 1.0), (index - 1, -1.0)], bounds.stroke);
            }
            if !is_leg(self.base_line, stop) {
                continue;
            }
            if state == 0 {
                bound(vec![(index, 1.0)], bounds.shortest * self.start[index]);
            }
            let last = usize::from(state) + 1 == self.base_line.model.chain.n_states(actuator.into());
            if last && bounds.longest.is_finite() {
                bound(vec![(index, -1.0)], -bounds.longest * self.start[index]);
            }
        }
    }

    fn bound_servos(&mut self) {
        for index in self.n_stops()..self.start.len() {
            let servo = (index - self.n_stops()) % self.n_servos;
            if let Some(wiring) = self.base_line.wiring.servos.get(servo) {
                self.bounds.push(Bound { terms: vec![(index, 1.0)], least: wiring.min_rad.into() });
                self.bounds.push(Bound { terms: vec![(index, -1.0)], least: (-wiring.max_rad).into() });
            }
        }
    }
}

impl Bound {
    /// By how much the bound is kept; below zero it is broken.
    pub(super) fn slack(&self, unknowns: &DVector<f64>) -> f64 {
        self.terms.iter().map(|&(index, factor)| factor * unknowns[index]).sum::<f64>() - self.least
    }
}

/// Every stop of every discrete actuator.
fn stops(arm: &Arm) -> Vec<Parameter> {
    let states = |actuator: usize| 0..arm.model.chain.n_states(actuator) as u8;
    let actuators = 0..arm.n_actuators();
    actuators
        .flat_map(|actuator| states(actuator).map(move |state| Parameter::Stop { actuator: actuator as u8, state }))
        .collect()
}

fn is_leg(arm: &Arm, stop: &Parameter) -> bool {
    let Parameter::Stop { actuator, .. } = *stop else { return false };
    let stage = arm.model.chain.actuator(actuator.into()).map(|(stage, _)| &arm.model.chain.stages[stage]);
    matches!(stage, Some(Stage::Planar(_) | Stage::Spatial(_)))
}

fn joint_weight(arm: &Arm, stop: &Parameter) -> f64 {
    let Parameter::Stop { actuator, .. } = *stop else { return 1.0 };
    let stage = arm.model.chain.actuator(actuator.into()).map(|(stage, _)| &arm.model.chain.stages[stage]);
    match stage {
        Some(Stage::Discrete(joint)) if joint.axis.kind == JointKind::Revolute => arm.length_scale_m,
        _ => 1.0,
    }
}

fn is_used(stop: &Parameter, word: &Word) -> bool {
    matches!(*stop, Parameter::Stop { actuator, state } if word.digit(actuator.into()) == state)
}
