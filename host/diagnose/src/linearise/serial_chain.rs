//! The kinematics of a serial robot with the errors that a calibration finds: joints, links, compliances, tool.
//!
//! | law | of a joint or the tool | values |
//! | --- | --- | --- |
//! | `joint-offset` | q + δ | rad |
//! | `axis-error` | its frame turned about the two axes across its own, before it turns | rad |
//! | `link-error` | its frame moved in the frame that carries it | m |
//! | `joint-compliance` | q + c·τ with τ the torque of the links' weight; where the robot has no masses, of 1 kg at each later joint and at the tool | rad/(N·m) |
//! | `link-compliance` | its frame turned about the two axes across by their moments, alike | rad/(N·m) |
//! | `encoder-periodic` | q + s·sin q + k·cos q + s₂·sin 2q + k₂·cos 2q: a disc off its centre, and one that is bent or read by two heads | rad |
//! | `encoder-scale` | q + g·q: another gear ratio, or another number of counts a turn | 1 |
//! | `tool-frame` | the tool moved in its link, and turned where its orientation is measured | m, rad |
//!
//! Every value has a prior: the standard deviation of what it may be before anything is measured.

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, Twist, rotation_exp, rotation_jacobian};

use crate::effect::{LawName, Place, Site};
use crate::linearise::experiment::{Candidate, CandidateValue};
use crate::prepare::signals::{PrepareError, Prepared};
use darm_measure::{Finding, FindingKind};
use darm_robot::robot::{Robot, RobotFrame};

/// How far each kind of value may be off before anything is measured; that of twice the angle is an order of the disc's error
/// smaller. The last one is that of an encoder's scale.
const PRIORS: [f64; 6] = [0.02, 0.005, 1e-4, 0.005, 1e-3, 1e-3];
/// How far the tool's place, m, and its turn, rad, may be off before anything is measured.
const TOOL_PRIORS: [f64; 2] = [0.02, 0.05];
/// The names of the values of `joint-offset`, of `axis-error`, of `link-error`, and of `tool-frame`.
pub(super) const OFFSET: [&str; 1] = ["offset"];
pub(super) const TURNS: [&str; 2] = ["first turn across", "second turn across"];
pub(super) const SHIFT: [&str; 3] = ["x", "y", "z"];
pub(super) const TOOL: [&str; 6] = ["x", "y", "z", "turn about x", "turn about y", "turn about z"];
pub(super) const PERIODIC: [&str; 4] = ["sine", "cosine", "sine of twice the angle", "cosine of twice the angle"];
/// Where those of a joint begin, and the scale after them.
const FIRST_PERIODIC: usize = 9;
const SCALE: usize = FIRST_PERIODIC + PERIODIC.len();
/// Values of one joint: offset, two turns, three shifts, compliance, two of the link, the periodic ones, and the scale.
pub(super) const PER_JOINT: usize = SCALE + 1;

/// One posture.
struct Posture {
    q: Vec<f64>,
    /// Torque of the weight about each joint's axis and the two axes across.
    moments: Vec<Vec3<f64>>,
}

/// A serial robot up to its tool, in the postures of the rows of a table.
pub(super) struct SerialChain {
    robot: Robot,
    /// The joints up to the tool, the innermost first.
    path: Vec<usize>,
    tool: Pose<f64>,
    postures: Vec<Posture>,
    /// Whether the tool may be turned, besides moved.
    turns_tool: bool,
}

/// The frames along the robot in one posture, in its base frame: before each joint turns, and the tool.
pub(super) struct FrameChain {
    pub(super) before: Vec<Pose<f64>>,
    pub(super) tool: Pose<f64>,
}

/// A mass, and the last joint that carries it.
struct PointMass {
    on: usize,
    place: Vec3<f64>,
    kg: f64,
}

/// The place of the joint of this index, which comes after `k` others on the way to the tool.
pub(super) fn site_of_joint(robot: &Robot, k: usize, joint: usize) -> Site {
    Site::new(Place::Joint(k), format!("joint {} ({})", k + 1, robot.joints[joint].name))
}

/// Two axes across a unit vector.
pub(super) fn across(axis: &Vec3<f64>) -> [Vec3<f64>; 2] {
    let aside = if axis.z.abs() > 0.9 { Vec3::x() } else { Vec3::z() };
    let first = (aside - axis * axis.dot(&aside)).normalize();
    [first, axis.cross(&first)]
}

impl SerialChain {
    /// The chain to `tool`, without it to the robot's end; joint k of it is in the column `qk` or in that of its name.
    pub(super) fn new(
        data: &Prepared,
        robot: &Robot,
        tool: Option<&str>,
        turns_tool: bool,
    ) -> Result<Self, PrepareError> {
        let none =
            || PrepareError::Nothing("the robot has no end that is its tool: name it as tool in the model".into());
        let tool = robot.frame_or_tool(tool).ok_or_else(none)?;
        let path = robot.path(tool);
        let slides = path.iter().find(|&&joint| robot.joints[joint].joint.axis.kind == JointKind::Prismatic);
        if let Some(&joint) = slides {
            let name = &robot.joints[joint].name;
            let why = format!("joint {name} before the tool slides: only revolute joints are calibrated");
            return Err(PrepareError::Nothing(why));
        }
        let columns = columns(data, robot, &path);
        let q = columns.iter().map(|column| data.channel(column)).collect::<Result<Vec<_>, _>>()?;
        let posture = |row: usize| q.iter().map(|channel| channel[row]).collect();
        Ok(Self::in_postures(robot, tool, (0..data.rows.len()).map(posture), turns_tool))
    }

    /// The chain to a frame, at these positions of its joints, rad.
    pub(super) fn in_postures(
        robot: &Robot,
        tool: &RobotFrame,
        postures: impl Iterator<Item = Vec<f64>>,
        turns_tool: bool,
    ) -> Self {
        let (robot, path) = (robot.clone(), robot.path(tool));
        let postures = postures.map(|q| Posture { q, moments: vec![Vec3::zeros(); path.len()] }).collect();
        let mut chain = Self { robot, path, tool: tool.pose, postures, turns_tool };
        chain.load();
        chain
    }

    /// How many values there are.
    pub(super) fn n_values(&self) -> usize {
        self.path.len() * PER_JOINT + if self.turns_tool { 6 } else { 3 }
    }

    /// The position of each joint along the rows, rad, with its name in reports.
    pub(super) fn channels(&self) -> Vec<(String, Vec<f64>)> {
        let position = |k: usize| self.postures.iter().map(|posture| posture.q[k]).collect();
        (0..self.path.len()).map(|k| (format!("position of joint {}", k + 1), position(k))).collect()
    }

    /// The axis of the first joint in the base frame, where its frame is `first`.
    pub(super) fn first_axis(&self, first: &Pose<f64>) -> Vec3<f64> {
        first.rotation * self.robot.joints[self.path[0]].joint.axis.direction
    }

    /// What the owner of the model should know.
    pub(super) fn finding(&self) -> Option<Finding> {
        let text =
            "the robot has no masses: its compliance is computed as if it had 1 kg at each joint and at the tool";
        self.is_without_masses().then(|| Finding::note(FindingKind::IncompleteModel, text))
    }

    /// The candidate effects, given a column for each value.
    pub(super) fn candidates(&self, mut columns: impl Iterator<Item = Vec<f64>>) -> Vec<Candidate> {
        let [turn, shift, compliance, periodic, of_twice, scale] = PRIORS;
        let mut candidates = Vec::new();
        let mut add = |law, site: &Site, values: &[(&str, &str, f64)]| {
            let values = values.iter().map(|of| value(*of, columns.next().expect("a column for each value")));
            candidates.push(Candidate { law, site: site.clone(), shape: None, values: values.collect() });
        };
        for (k, &joint) in self.path.iter().enumerate() {
            let site = site_of_joint(&self.robot, k, joint);
            add(LawName::JointOffset, &site, &OFFSET.map(|name| (name, "rad", turn)));
            add(LawName::AxisError, &site, &TURNS.map(|name| (name, "rad", turn)));
            add(LawName::LinkError, &site, &SHIFT.map(|name| (name, "m", shift)));
            add(LawName::JointCompliance, &site, &[("compliance", "rad/(N·m)", compliance)]);
            let across = [("first, across", "rad/(N·m)", compliance), ("second, across", "rad/(N·m)", compliance)];
            add(LawName::LinkCompliance, &site, &across);
            let priors = [periodic, periodic, of_twice, of_twice];
            add(LawName::EncoderPeriodic, &site, &std::array::from_fn::<_, 4, _>(|k| (PERIODIC[k], "rad", priors[k])));
            add(LawName::EncoderScale, &site, &[("scale", "1", scale)]);
        }
        let [shift, turn] = TOOL_PRIORS;
        let dimension = |(k, name)| if k < 3 { (name, "m", shift) } else { (name, "rad", turn) };
        let all: Vec<(&str, &str, f64)> = TOOL.into_iter().enumerate().map(dimension).collect();
        add(LawName::ToolFrame, &Site::new(Place::Tool, "the tool"), &all[..if self.turns_tool { 6 } else { 3 }]);
        candidates
    }

    /// The frames in each posture.
    pub(super) fn frames(&self, values: &[f64]) -> Vec<FrameChain> {
        self.postures.iter().map(|posture| self.chain(posture, values)).collect()
    }

    /// How the tool moves with each value, in each posture, in the base frame.
    pub(super) fn slopes(&self, values: &[f64], frames: &[FrameChain]) -> Vec<Vec<Twist<f64>>> {
        self.postures.iter().zip(frames).map(|(posture, chain)| self.slopes_in(posture, chain, values)).collect()
    }

    fn chain(&self, posture: &Posture, values: &[f64]) -> FrameChain {
        let mut pose = Pose::identity();
        let mut before = Vec::with_capacity(self.path.len());
        for (k, &joint) in self.path.iter().enumerate() {
            let joint = &self.robot.joints[joint].joint;
            let own = &values[k * PER_JOINT..(k + 1) * PER_JOINT];
            let [first, second] = across(&joint.axis.direction);
            let load = posture.moments[k];
            let shift = Vec3::new(own[3], own[4], own[5]);
            let turn = first * (own[1] + own[7] * load.y) + second * (own[2] + own[8] * load.z);
            pose = pose * Pose::at(shift) * joint.placement * Pose::new(&turn, Vec3::zeros());
            before.push(pose);
            let waves = periodic(posture.q[k]).into_iter().zip(&own[FIRST_PERIODIC..SCALE]);
            let periodic: f64 = waves.map(|(wave, size)| wave * size).sum();
            let angle = posture.q[k] * (1.0 + own[SCALE]) + own[0] + own[6] * load.x + periodic;
            pose = pose * Pose { rotation: rotation_exp(&(joint.axis.direction * angle)), position: Vec3::zeros() };
        }
        let last = self.path.len() * PER_JOINT;
        let three = |first: usize| Vec3::from_fn(|k, _| values.get(first + k).copied().unwrap_or(0.0));
        FrameChain { before, tool: pose * self.tool * Pose::new(&three(last + 3), three(last)) }
    }

    /// Moments of what each joint carries in the nominal postures.
    fn load(&mut self) {
        let zero = vec![0.0; self.n_values()];
        let gravity = self.robot.gravity;
        for index in 0..self.postures.len() {
            let chain = self.chain(&self.postures[index], &zero);
            let masses = self.masses(&self.postures[index], &chain);
            let moments = (0..self.path.len()).map(|k| {
                let at = &chain.before[k];
                let carried = masses.iter().filter(|mass| mass.on >= k);
                let moment: Vec3<f64> = carried.map(|mass| (mass.place - at.position).cross(&gravity) * mass.kg).sum();
                let own = at.rotation.tr_mul(&moment);
                let axis = self.robot.joints[self.path[k]].joint.axis.direction;
                let [first, second] = across(&axis);
                Vec3::new(axis.dot(&own), first.dot(&own), second.dot(&own))
            });
            self.postures[index].moments = moments.collect();
        }
    }

    fn is_without_masses(&self) -> bool {
        self.path.iter().all(|&joint| self.robot.joints[joint].joint.inertia.mass == 0.0)
    }

    /// The links up to the tool; of a robot without masses 1 kg at each joint after the first and at the tool.
    fn masses(&self, posture: &Posture, chain: &FrameChain) -> Vec<PointMass> {
        let inertia = |k: usize| self.robot.joints[self.path[k]].joint.inertia;
        if self.is_without_masses() {
            let places = chain.before[1..].iter().map(|pose| pose.position).chain([chain.tool.position]);
            return places.enumerate().map(|(on, place)| PointMass { on, place, kg: 1.0 }).collect();
        }
        let mass = |on: usize| {
            let turn = self.robot.joints[self.path[on]].joint.axis.direction * posture.q[on];
            let com = rotation_exp(&turn) * inertia(on).com;
            PointMass { on, place: chain.before[on] * com, kg: inertia(on).mass }
        };
        (0..self.path.len()).map(mass).collect()
    }

    fn slopes_in(&self, posture: &Posture, chain: &FrameChain, values: &[f64]) -> Vec<Twist<f64>> {
        let mut slopes = Vec::with_capacity(self.n_values());
        let moved = |linear: Vec3<f64>| Twist { angular: Vec3::zeros(), linear };
        let mut on = Mat3::identity();
        for (k, &joint) in self.path.iter().enumerate() {
            let at = &chain.before[k];
            let axis = self.robot.joints[joint].joint.axis.direction;
            let [first, second] = across(&axis);
            let turned = |about: &Vec3<f64>, size: f64| {
                let angular = at.rotation * about * size;
                Twist { angular, linear: angular.cross(&(chain.tool.position - at.position)) }
            };
            let load = posture.moments[k];
            slopes.extend([turned(&axis, 1.0), turned(&first, 1.0), turned(&second, 1.0)]);
            slopes.extend((0..3).map(|k| moved(on.column(k).into())));
            slopes.extend([turned(&axis, load.x), turned(&first, load.y), turned(&second, load.z)]);
            slopes.extend(periodic(posture.q[k]).map(|wave| turned(&axis, wave)));
            slopes.push(turned(&axis, posture.q[k]));
            on = at.rotation * rotation_exp(&(axis * posture.q[k]));
        }
        let last = self.path.len() * PER_JOINT;
        let turn = Vec3::from_fn(|k, _| values.get(last + 3 + k).copied().unwrap_or(0.0));
        let before_turn = chain.tool.rotation * rotation_exp(&turn).transpose();
        slopes.extend((0..3).map(|k| moved(before_turn.column(k).into())));
        if self.turns_tool {
            let turns = chain.tool.rotation * rotation_jacobian(&turn);
            slopes.extend((0..3).map(|k| Twist { angular: turns.column(k).into(), linear: Vec3::zeros() }));
        }
        slopes
    }
}

/// What the values of a periodic error add to an angle.
fn periodic(q: f64) -> [f64; PERIODIC.len()] {
    let ((sine, cosine), (of_twice, cosine_of_twice)) = (q.sin_cos(), (2.0 * q).sin_cos());
    [sine, cosine, of_twice, cosine_of_twice]
}

/// The columns of the joints on the way to the tool: `q1`, `q2`, …, or those with the joints' names.
pub(super) fn columns(data: &Prepared, robot: &Robot, path: &[usize]) -> Vec<String> {
    let column = |(k, &joint): (usize, &usize)| {
        let name = &robot.joints[joint].name;
        if data.raw(name).is_some() { name.clone() } else { format!("q{}", k + 1) }
    };
    path.iter().enumerate().map(column).collect()
}

/// A value of this name, unit and prior deviation, without a lower limit.
fn value((name, unit, prior): (&str, &str, f64), column: Vec<f64>) -> CandidateValue {
    CandidateValue { name: name.into(), unit: unit.into(), prior, min: f64::NEG_INFINITY, column }
}
