//! For tests: a robot with one fault, made by its kinematics and dynamics, not by the columns of a law.

use std::borrow::Cow;
use std::path::Path;

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_robot::robot::Robot;
use nalgebra::DMatrix;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::linearise::model::{Model, Predictor};
use crate::outcome::{Diagnosis, Verdict};

/// Joints up to the tool; two fingers come after them.
pub(super) const JOINTS: usize = 7;
/// The joint at fault, from 0.
const JOINT: usize = 3;

/// What is wrong with an arm.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fault {
    None,
    /// The joint is not where its encoder shows it: off by `offset`, and by `ripple` times the sine of its angle plus
    /// 0.5 rad; rad.
    Encoder {
        offset: f64,
        ripple: f64,
    },
    /// It has play, and lies on the one side of it or the other as it is on either side of −1.5 rad; half of the play, rad.
    Play(f64),
    /// Its encoder shows so much less of each turn.
    Gear(f64),
    /// Its frame is turned (rad) and moved (m).
    Frame {
        turn: [f64; 3],
        shift: [f64; 3],
    },
    /// What it carries turns it along its axis and bends it across, rad/(N·m).
    Soft {
        along: f64,
        across: f64,
    },
    /// The tool is moved, m.
    Tool([f64; 3]),
}

/// An arm with a fault.
pub(super) struct Faulty {
    pub(super) robot: Robot,
    fault: Fault,
}

impl Faulty {
    pub(super) fn new(robot: &Robot, fault: Fault) -> Self {
        let mut robot = robot.clone();
        if let Fault::Frame { turn, shift } = fault {
            let placement = &mut robot.joints[JOINT].joint.placement;
            *placement = Pose::at(shift.into()) * *placement * Pose::new(&turn.into(), Vec3::zeros());
        }
        Self { robot, fault }
    }

    /// The robot with the joint's frame turned by its moments, which are the slopes of the potential energy.
    fn bent(&self, q: &[f64], along: f64, across: f64) -> Robot {
        let turned = |turn: Vec3<f64>| {
            let mut robot = self.robot.clone();
            let placement = &mut robot.joints[JOINT].joint.placement;
            *placement = *placement * Pose::new(&turn, Vec3::zeros());
            robot
        };
        let falls = |turn| {
            let com = turned(turn).com(q).unwrap();
            com.mass_kg * self.robot.gravity.dot(&com.position)
        };
        let moment = Vec3::from_fn(|k, _| {
            let step = Vec3::ith(k, 1e-4);
            (falls(step) - falls(-step)) / 2e-4
        });
        let axis = self.robot.joints[JOINT].joint.axis.direction;
        let own = axis * axis.dot(&moment);
        turned(own * along + (moment - own) * across)
    }

    /// Where it touches with these positions of its encoders, and how that moves with each joint, nearly.
    pub(super) fn touch(&self, shown: &[f64]) -> (Vec3<f64>, DMatrix<f64>) {
        let (mut q, mut tip, mut robot) = (shown.to_vec(), Vec3::zeros(), Cow::Borrowed(&self.robot));
        match self.fault {
            Fault::None | Fault::Frame { .. } => {}
            Fault::Encoder { offset, ripple } => q[JOINT] += offset + ripple * (q[JOINT] + 0.5).sin(),
            Fault::Play(half) => q[JOINT] += half * (q[JOINT] + 1.5).sin().signum(),
            Fault::Gear(scale) => q[JOINT] *= 1.0 + scale,
            Fault::Soft { along, across } => robot = Cow::Owned(self.bent(shown, along, across)),
            Fault::Tool(shift) => tip = shift.into(),
        }
        let reached = robot.kinematics(self.robot.frame("ball_link").unwrap(), &q).unwrap();
        let moves = DMatrix::from_fn(3, JOINTS, |row, k| reached.jacobian_base[(3 + row, k)]);
        (reached.pose_base_frame * tip, moves)
    }
}

pub(super) fn normal(random: &mut impl Rng) -> Vec3<f64> {
    Vec3::from_fn(|_, _| StandardNormal.sample(random))
}

/// The Panda with masses; these do not say what its real ones are.
pub(super) fn panda() -> Robot {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/measured/panda.toml");
    let Predictor::PointContact(mut robot, _) = Model::read(&model).what else { panic!("no point contact") };
    for (joint, mass) in robot.joints.iter_mut().zip([3.5, 3.5, 2.5, 2.5, 2.0, 1.5, 1.0]) {
        joint.joint.inertia.mass = mass;
        joint.joint.inertia.com = Vec3::new(0.01, -0.03, 0.02);
    }
    robot
}

/// What is named: the laws, each with its place, and the verdict where it names none. No row is repeated, so that no verdict says that
/// nothing else is left.
pub(super) fn named(found: &Diagnosis) -> String {
    let effects =
        found.effects.iter().map(|effect| format!("{} {}", effect.law, effect.site.code.split(" (").next().unwrap()));
    let effects = effects.collect::<Vec<_>>().join(" + ");
    assert!(!matches!(found.verdict, Verdict::EffectFound | Verdict::NoEffect), "{:?}", found.plain);
    if found.verdict.names_effects() { effects } else { format!("{} {effects}", found.verdict) }
}

pub(super) fn cases() -> [(&'static str, Fault); 9] {
    [
        ("too-little-data ", Fault::None),
        ("joint-offset joint 4", Fault::Encoder { offset: 0.01, ripple: 0.0 }),
        ("encoder-periodic joint 4", Fault::Encoder { offset: 0.0, ripple: 0.005 }),
        ("encoder-scale joint 4", Fault::Gear(0.002)),
        ("axis-error joint 4", Fault::Frame { turn: [0.004, 0.003, 0.0], shift: [0.0; 3] }),
        ("link-error joint 4", Fault::Frame { turn: [0.0; 3], shift: [0.002, 0.003, 0.0] }),
        ("joint-compliance joint 4", Fault::Soft { along: 2e-4, across: 0.0 }),
        ("link-compliance joint 4", Fault::Soft { along: 0.0, across: 2e-4 }),
        ("tool-frame the tool", Fault::Tool([0.004, -0.003, 0.005])),
    ]
}
