//! `darm model`: what is in a file, and what of it can be identified from torques.

use darm_arm::arm::Arm;
use darm_core::actuator::{JointKind, Stage};
use darm_robot::robot::Robot;
use darm_robot::robot::base_parameters::BaseParameters;
use serde::Serialize;

use super::subject::{Coordinate, Given, Subject, frame_of};
use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm model planar4.toml
  darm model panda.urdf
  darm model puma560.toml --base-parameters            what torques can tell of the masses, in words
  darm model humanoid.urdf --floating --base-parameters
  darm model puma560.toml --rust > puma560.rs          a constant for firmware, in flash, in f32
  darm model corrected.toml --rust > corrected.rs      an arm with the effects that `darm diagnose` found

A base parameter is a sum of inertial parameters that torques show as one number: m mass, mx my mz mass \
times centre, Ixx … moments of inertia about the origin of the joint's frame. What is in one sum cannot \
be told apart by any motion.";

/// Show what a file holds: stages or joints, masses, limits, warnings, base parameters
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Model {
    #[command(flatten)]
    given: Given,
    /// Find the base parameters of a robot over random motions
    #[arg(long)]
    base_parameters: bool,
    /// Write a robot, or an arm with its effects, as a constant of Rust, for firmware on `darm-core`
    #[arg(long, conflicts_with = "base_parameters")]
    rust: bool,
    /// The frame that is the constant's tool; the end furthest out when left out
    #[arg(long, value_name = "LINK", requires = "rust")]
    frame: Option<String>,
    /// Seed of the motions
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

#[derive(Serialize)]
struct Report {
    name: String,
    kind: &'static str,
    mass_kg: f64,
    gravity_m_s2: [f64; 3],
    parts: Vec<Part>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    frames: Vec<String>,
    warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    base_parameters: Option<Identifiable>,
}

/// A stage of an arm, or a joint of a robot with its link.
#[derive(Serialize)]
struct Part {
    name: String,
    kind: String,
    stands_on: String,
    mass_kg: f64,
    limits: Option<[f64; 2]>,
    unit: &'static str,
    /// N m or N, where the file tells it.
    #[serde(skip_serializing_if = "Option::is_none")]
    effort: Option<f64>,
}

#[derive(Serialize)]
struct Constant {
    rust: String,
}

#[derive(Serialize)]
struct Identifiable {
    of: usize,
    base: Vec<String>,
    without_effect: Vec<String>,
}

impl Model {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let subject = self.given.subject()?;
        if let (true, Subject::Arm(arm)) = (self.rust, &subject) {
            return voice.tell(&Constant { rust: arm.constant() });
        }
        if self.rust {
            let robot = subject.into_robot("model --rust")?;
            let rust = robot.constant(frame_of(&robot, self.frame.as_deref())?)?;
            return voice.tell(&Constant { rust });
        }
        let report = match &subject {
            Subject::Arm(arm) => of_arm(arm),
            Subject::Robot(robot) => self.of_robot(robot, voice)?,
        };
        if matches!(subject, Subject::Arm(_)) && self.base_parameters {
            subject.into_robot("model --base-parameters")?;
        }
        voice.tell(&report)
    }

    fn of_robot(&self, robot: &Robot, voice: Voice) -> anyhow::Result<Report> {
        let base = robot.frames.first().map_or("base", |frame| frame.name.as_str());
        let parts = robot.joints.iter().map(|joint| {
            let axis = Coordinate { name: joint.name.clone(), kind: joint.joint.axis.kind };
            let parent = joint.joint.parent.and_then(|parent| robot.joints.get(parent));
            Part {
                kind: if axis.kind == JointKind::Revolute { "revolute" } else { "prismatic" }.into(),
                stands_on: parent.map_or(base, |parent| parent.link.as_str()).into(),
                mass_kg: joint.joint.inertia.mass,
                limits: joint.limits.map(|limits| limits.map(|limit| axis.shown(limit))),
                unit: axis.unit(),
                effort: joint.effort,
                name: axis.name,
            }
        });
        let mut report = Report {
            name: robot.name.clone(),
            kind: if robot.floating { "robot on a floating base" } else { "robot on a fixed base" },
            mass_kg: robot.mass(),
            gravity_m_s2: robot.gravity.into(),
            parts: parts.collect(),
            frames: robot.frames.iter().map(|frame| frame.name.clone()).collect(),
            warnings: robot.warnings.clone(),
            base_parameters: None,
        };
        if self.base_parameters {
            let wheel = voice.wheel("looking for what can be told apart");
            let found = robot.base_parameters(self.seed);
            wheel.finish_and_clear();
            report.base_parameters = Some(identifiable(robot, &found?));
        }
        Ok(report)
    }
}

fn identifiable(robot: &Robot, found: &BaseParameters) -> Identifiable {
    Identifiable {
        of: 10 * (robot.joints.len() + usize::from(robot.floating)),
        base: found.base.iter().map(|parameter| BaseParameters::words(parameter, robot)).collect(),
        without_effect: found.without_effect.iter().map(|inertial| inertial.words(robot)).collect(),
    }
}

fn of_arm(arm: &Arm) -> Report {
    let chain = &arm.model.chain;
    let mut servos = arm.servos.iter();
    let parts = chain.stages.iter().zip(&arm.model.masses).enumerate().map(|(index, (stage, mass))| {
        let (kind, range, unit) = match stage {
            Stage::Link(_) => ("link".into(), None, "mm"),
            Stage::Planar(_) => ("planar platform of 3 legs".into(), stroke(stage), "mm"),
            Stage::Spatial(_) => ("platform of 6 legs".into(), stroke(stage), "mm"),
            Stage::Discrete(joint) => {
                let shown = Coordinate { name: String::new(), kind: joint.axis.kind };
                let range = stroke(stage).map(|range| range.map(|value| shown.shown(value / 1e3)));
                (format!("discrete joint of {} positions", joint.states), range, shown.unit())
            }
            Stage::Servo(joint) => {
                let shown = Coordinate { name: String::new(), kind: joint.axis.kind };
                let limits = servos.next().map(|servo| [servo.min_rad, servo.max_rad].map(|q| shown.shown(q.into())));
                ("servo".into(), limits, shown.unit())
            }
        };
        let stands_on = index.checked_sub(1).map_or("base".into(), |below| arm.stage_name(below));
        let (name, mass_kg) = (arm.stage_name(index), mass.mass_kg);
        Part { name, kind, stands_on, mass_kg, limits: range, unit, effort: None }
    });
    let stages: f64 = arm.model.masses.iter().take(chain.stages.len()).map(|mass| mass.mass_kg).sum();
    let mass_kg = stages + arm.model.payload.mass_kg;
    let mut warnings = Vec::new();
    if mass_kg == 0.0 {
        warnings.push("no part has a mass: loads and sag are zero".into());
    }
    Report {
        name: arm.name.clone(),
        kind: if chain.is_planar() { "planar arm of discrete stages" } else { "arm of discrete stages" },
        mass_kg,
        gravity_m_s2: arm.model.gravity.into(),
        parts: parts.collect(),
        frames: Vec::new(),
        warnings,
        base_parameters: None,
    }
}

/// Shortest and longest state of the actuators of a stage, mm (or 10⁻³ rad).
fn stroke(stage: &Stage<f64>) -> Option<[f64; 2]> {
    let legs = 0..stage.n_actuators();
    let states = legs.flat_map(|leg| (0..stage.n_states(leg)).filter_map(move |digit| stage.setting(leg, digit as u8)));
    let values: Vec<f64> = states.map(|setting| 1e3 * setting.value).collect();
    let least = values.iter().copied().reduce(f64::min)?;
    Some([least, values.iter().copied().reduce(f64::max)?])
}

impl Answer for Constant {
    fn text(&self) -> String {
        self.rust.trim_end().to_owned()
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let mut text = format!("{}: {}, {:.4} kg", self.name, self.kind, self.mass_kg);
        let [x, y, z] = self.gravity_m_s2;
        text += &format!(", gravity {x:.2} {y:.2} {z:.2} m/s²\n\n");
        let head = ["", "", "stands on", "mass, kg", "from", "to", "", "effort"].map(str::to_owned).to_vec();
        let rows = self.parts.iter().map(|part| {
            let limit = |k: usize| part.limits.map_or(String::new(), |limits| format!("{:.2}", limits[k]));
            let (unit, effort) = if part.limits.is_some() { (part.unit, part.effort) } else { ("", part.effort) };
            vec![
                part.name.clone(),
                part.kind.clone(),
                part.stands_on.clone(),
                format!("{:.4}", part.mass_kg),
                limit(0),
                limit(1),
                unit.to_owned(),
                effort.map_or(String::new(), |effort| format!("{effort}")),
            ]
        });
        text += &columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        if !self.frames.is_empty() {
            text += &format!("\n\nframes: {}", self.frames.join(", "));
        }
        for warning in &self.warnings {
            text += &format!("\nwarning: {warning}");
        }
        if let Some(found) = &self.base_parameters {
            let alone = found.base.len() + found.without_effect.len();
            text += &format!(
                "\n\n{} of {} inertial parameters: {} base parameters, {} that no torque shows, {} in sums\n",
                found.base.len(),
                found.of,
                found.base.len(),
                found.without_effect.len(),
                found.of - alone
            );
            text += &found.base.iter().map(|words| format!("\n  {words}")).collect::<String>();
            if !found.without_effect.is_empty() {
                text += &format!("\n\nno torque shows: {}", found.without_effect.join(", "));
            }
        }
        text
    }
}
