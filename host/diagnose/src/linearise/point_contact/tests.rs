//! Each law of a closure alone explains the case of its own fault. The arm that touches has the fault by its kinematics and
//! dynamics, not by the law's columns.

use std::borrow::Cow;
use std::path::Path;

use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::{IntoParallelRefIterator as _, ParallelIterator as _};

use super::*;
use crate::diagnosis::{SignalOptions, diagnose_table};
use crate::linearise::model::{Model, What};
use crate::linearise::model_effects::ModelEffect;
use crate::measurement::table::{Names, Table};
use crate::outcome::Verdict;
use crate::prepare::signals::Preparation;

/// Pairs of points, this far apart, m.
const PAIRS: usize = 4;
const APART_M: f64 = 0.05;
/// Postures in which each point is touched.
const POSTURES: usize = 20;
/// Joints up to the tool; two fingers come after them.
const JOINTS: usize = 7;
/// Steps within which a posture is met or given up.
const STEPS: usize = 30;
const NOISE_M: f64 = 1e-4;
const SEED: u64 = 8;
/// The joint at fault, from 0.
const JOINT: usize = 3;

/// What is wrong with an arm.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    /// The joint stands elsewhere than told: by as much, and by as much times the sine of its angle a little further, rad.
    Told {
        offset: f64,
        ripple: f64,
    },
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
struct Faulty {
    robot: Robot,
    fault: Fault,
}

impl Faulty {
    fn new(robot: &Robot, fault: Fault) -> Self {
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

    /// Where it touches, and how that moves with each joint, nearly.
    fn touch(&self, told: &[f64]) -> (Vec3<f64>, DMatrix<f64>) {
        let (mut q, mut tip, mut robot) = (told.to_vec(), Vec3::zeros(), Cow::Borrowed(&self.robot));
        match self.fault {
            Fault::None | Fault::Frame { .. } => {}
            Fault::Told { offset, ripple } => q[JOINT] += offset + ripple * (q[JOINT] + 0.5).sin(),
            Fault::Soft { along, across } => robot = Cow::Owned(self.bent(told, along, across)),
            Fault::Tool(shift) => tip = shift.into(),
        }
        let stands = robot.kinematics(self.robot.frame("ball_link").unwrap(), &q).unwrap();
        let moves = DMatrix::from_fn(3, JOINTS, |row, k| stands.jacobian_base[(3 + row, k)]);
        (stands.pose_base_frame * tip, moves)
    }

    /// A posture in which it touches a point, from one that is drawn, by damped steps.
    fn posture(&self, point: &Vec3<f64>, random: &mut impl Rng) -> Vec<f64> {
        let limits: Vec<[f64; 2]> = self.robot.joints.iter().map(|joint| joint.limits.unwrap()).collect();
        loop {
            let mut q: Vec<f64> = limits.iter().map(|[low, high]| random.random_range(*low..*high)).collect();
            for _ in 0..STEPS {
                let (at, moves) = self.touch(&q);
                let off = point - at;
                let damped = &moves * moves.transpose() + DMatrix::identity(3, 3) * (0.1 * off.norm());
                let step = moves.transpose() * damped.lu().solve(&DVector::from_column_slice(off.as_slice())).unwrap();
                q.iter_mut().zip(step.iter()).for_each(|(q, step)| *q += step.clamp(-0.3, 0.3));
            }
            let inside = limits.iter().zip(&q).all(|([low, high], q)| (low..=high).contains(&q));
            if inside && (point - self.touch(&q).0).norm() < 1e-7 {
                return q;
            }
        }
    }
}

/// The postures of an arm with a fault, as a table.
fn table(robot: &Robot, fault: Fault, seed: u64) -> Table {
    let (mut random, faulty) = (ChaCha8Rng::seed_from_u64(seed), Faulty::new(robot, fault));
    let mut text = String::from("place,socket,q1,q2,q3,q4,q5,q6,q7\n");
    for place in 0..PAIRS {
        let at =
            Vec3::new(random.random_range(0.3..0.6), random.random_range(-0.3..0.3), random.random_range(0.1..0.5));
        let way = normal(&mut random).normalize() * APART_M;
        for (name, point) in [("a", at), ("b", at + way)] {
            for _ in 0..POSTURES {
                let q = faulty.posture(&(point + normal(&mut random) * NOISE_M), &mut random);
                let q: Vec<String> = q[..JOINTS].iter().map(f64::to_string).collect();
                text += &format!("p{place},{name},{}\n", q.join(","));
            }
        }
    }
    Table::read_text(Path::new("a.csv"), text.as_bytes(), &Names::new()).unwrap().0
}

fn normal(random: &mut impl Rng) -> Vec3<f64> {
    Vec3::from_fn(|_, _| StandardNormal.sample(random))
}

/// The Panda with masses; these do not say what its real ones are.
fn panda() -> Robot {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/measured/panda.toml");
    let What::Closure(mut robot, _) = Model::read(&model).unwrap().unwrap().what else { panic!("no closure") };
    for (joint, mass) in robot.joints.iter_mut().zip([3.5, 3.5, 2.5, 2.5, 2.0, 1.5, 1.0]) {
        joint.joint.inertia.mass = mass;
        joint.joint.inertia.com = Vec3::new(0.01, -0.03, 0.02);
    }
    robot
}

/// What is reported of a fault: the laws, each with its place, and the verdict where it is another.
fn told(robot: &Robot, fault: Fault, pair: Option<(String, f64)>) -> String {
    let point = ["place", "socket"].map(String::from).to_vec();
    let model = Model::from(What::Closure(robot.clone(), Points { point, pair, tool: Some("ball_link".into()) }));
    let options = SignalOptions { preparation: Preparation::default(), always: Vec::new(), seed: 1 };
    let found = diagnose_table(&model, &table(robot, fault, SEED), &options).unwrap().diagnosis;
    // What turns or moves all points alike.
    for value in ["offset of joint-offset", "x of link-error"] {
        let untold = format!("{value} at joint 1 (panda_joint1)");
        assert!(found.unobservable.contains(&untold), "{fault:?}: {:?}", found.unobservable);
    }
    let effects =
        found.effects.iter().map(|effect| format!("{} {}", effect.law, effect.site.code.split(" (").next().unwrap()));
    let told = effects.collect::<Vec<_>>().join(" + ");
    if found.verdict == Verdict::EffectFound { told } else { format!("{} {told}", found.verdict) }
}

fn cases() -> [(&'static str, Fault); 8] {
    [
        ("no-effect ", Fault::None),
        ("joint-offset joint 4", Fault::Told { offset: 0.01, ripple: 0.0 }),
        ("encoder-periodic joint 4", Fault::Told { offset: 0.0, ripple: 0.005 }),
        ("axis-error joint 4", Fault::Frame { turn: [0.004, 0.003, 0.0], shift: [0.0; 3] }),
        ("link-error joint 4", Fault::Frame { turn: [0.0; 3], shift: [0.002, 0.003, 0.0] }),
        ("joint-compliance joint 4", Fault::Soft { along: 2e-4, across: 0.0 }),
        ("link-compliance joint 4", Fault::Soft { along: 0.0, across: 2e-4 }),
        ("tool-frame the tool", Fault::Tool([0.004, -0.003, 0.005])),
    ]
}

fn wrong(pair: Option<(String, f64)>) -> Vec<(&'static str, String)> {
    let robot = panda();
    let all = cases();
    let told = all.par_iter().map(|(right, fault)| (*right, told(&robot, *fault, pair.clone())));
    told.filter(|(right, told)| right != told).collect()
}

#[test]
fn each_law_alone_explains_the_case_of_its_fault() {
    assert_eq!(wrong(Some(("socket".into(), APART_M))), []);
}

#[test]
fn without_a_known_distance_the_arm_keeps_its_size() {
    assert_eq!(wrong(None), []);
}

#[test]
fn the_calibrated_robot_is_where_the_effects_put_the_tool() {
    let robot = panda();
    let points = Points { point: Vec::new(), pair: None, tool: Some("ball_link".into()) };
    let tool = robot.frame("ball_link").unwrap();
    let (path, q) = (robot.path(tool), [0.1, -0.4, 0.3, -1.2, 0.2, 0.9, -0.5]);
    let posture = Posture { q: q.to_vec(), moments: Vec::new(), point: 0 };
    let mut values = vec![0.0; path.len() * PER_JOINT + 3];
    for k in 0..path.len() {
        (0..6).for_each(|value| values[k * PER_JOINT + value] = 1e-3 * (k * 6 + value) as f64);
    }
    values[path.len() * PER_JOINT + 1] = 0.02;
    let contact = PointContact {
        robot: robot.clone(),
        path: path.clone(),
        tool: tool.pose,
        postures: Vec::new(),
        n_points: 0,
        pairs: Vec::new(),
        distance_m: 0.0,
        reach_m: None,
    };
    let expected = contact.chain(&posture, &values).tool;
    let named = |law, place: &str, names: &[&str], first: usize| ModelEffect {
        law,
        place: place.into(),
        constant: None,
        values: names.iter().enumerate().map(|(k, name)| ((*name).to_owned(), values[first + k])).collect(),
        points: Vec::new(),
    };
    let mut effects = vec![named(Law::ToolFrame, "the tool", &["x", "y", "z"], path.len() * PER_JOINT)];
    for (k, &joint) in path.iter().enumerate() {
        let place = site_of_joint(&robot, k, joint).code;
        effects.push(named(Law::JointOffset, &place, &["offset"], k * PER_JOINT));
        effects.push(named(Law::AxisError, &place, &["first turn across", "second turn across"], k * PER_JOINT + 1));
        effects.push(named(Law::LinkError, &place, &["x", "y", "z"], k * PER_JOINT + 3));
    }
    let found = calibrated(&robot, &points, &effects).unwrap();
    let all = [&q[..], &vec![0.0; robot.joints.len() - q.len()]].concat();
    let pose = found.kinematics(found.frame("ball_link").unwrap(), &all).unwrap().pose_base_frame;
    assert!((pose.position - expected.position).norm() < 1e-12, "{} {}", pose.position, expected.position);
    assert!((pose.rotation - expected.rotation).norm() < 1e-12);
    effects[1].law = Law::JointCompliance;
    let error = calibrated(&robot, &points, &effects).unwrap_err().to_string();
    assert!(error.starts_with("joint-compliance at joint 1 (panda_joint1) depends on the load"), "{error}");
    effects[1].place = "joint 9 (x)".into();
    effects[1].law = Law::JointOffset;
    assert!(matches!(calibrated(&robot, &points, &effects), Err(NotRigid::NoSuchPlace { .. })));
}
