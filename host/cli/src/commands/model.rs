//! `darm model`: contents of a model file, and its base parameters.

use darm_arm::arm::{Arm, ZERO_CELSIUS};
use darm_core::actuator::{JointKind, Stage};
use darm_core::effect::Quantity;
use darm_core::tree::{Inertia, Joint};
use darm_diagnose::linearise::arm_candidates::site;
use darm_robot::robot::Robot;
use darm_robot::robot::base_parameters::BaseParameters;
use serde::Serialize;

use super::subject::{Subject, SubjectArgs, frame_of};
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm model planar4.toml
  darm model panda.urdf
  darm model finger.xml                                 # an MJCF
  darm model puma560.toml --base-parameters             # what torques can identify of the masses
  darm model planar5.urdf --floating --base-parameters
  darm model puma560.toml --rust > puma560.rs           # a constant for firmware, in flash, in f32
  darm model arm2.toml --rust > arm2.rs                 # with the effects from `darm diagnose`

A base parameter is a sum of inertial parameters that appears in the torques as one number: m mass, mx my mz mass times \
centre, Ixx … moments of inertia about the origin of the joint's frame. No motion can identify the terms of a sum \
separately.";

/// Show the contents of a model: stages or joints, masses, limits, warnings, base parameters
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Model {
    #[command(flatten)]
    subject: SubjectArgs,
    /// Compute the base parameters of a robot, from random motions
    #[arg(long)]
    base_parameters: bool,
    /// Print a robot, or an arm with its effects, as a Rust constant for firmware with `darm-core`
    #[arg(long, conflicts_with = "base_parameters")]
    rust: bool,
    /// Tool frame of the constant: the name of a link; default: the last one
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
    /// What a diagnosis changes in an arm.
    #[serde(flatten)]
    correction: Option<Correction>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    frames: Vec<String>,
    warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    base_parameters: Option<Identifiable>,
}

/// Number, conditions and effects of the model of an arm.
#[derive(Serialize)]
struct Correction {
    model: u32,
    nominal_supply_pa: f64,
    working_supply_pa: f64,
    reference_temperature_k: f64,
    working_temperature_k: f64,
    effects: Vec<ModelledEffect>,
}

/// An effect of the file.
#[derive(Serialize)]
struct ModelledEffect {
    law: String,
    #[serde(rename = "where")]
    place: String,
    place_name: String,
    parameters: Vec<ModelledValue>,
}

/// A value of an effect in its unit.
#[derive(Serialize)]
struct ModelledValue {
    name: &'static str,
    value: f64,
    unit: &'static str,
}

/// A stage of an arm, or a joint of a robot with its link.
#[derive(Serialize)]
struct Part {
    name: String,
    kind: String,
    parent: String,
    mass_kg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    limits_rad: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    limits_m: Option<[f64; 2]>,
    /// Largest torque of a revolute joint, where the file gives it.
    #[serde(skip_serializing_if = "Option::is_none")]
    max_torque_nm: Option<f64>,
    /// Largest force of a prismatic joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    max_force_n: Option<f64>,
    /// Inertia of the rotor at the joint, kg·m² or kg; of a joint that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    armature: Option<f64>,
    /// The joint whose position prescribes that of this one.
    #[serde(skip_serializing_if = "Option::is_none")]
    follows: Option<Follows>,
}

/// q = factor · q of the joint + offset, in rad and m.
#[derive(Serialize)]
struct Follows {
    joint: String,
    factor: f64,
    offset: f64,
}

impl Part {
    /// A part without limits.
    fn new(name: String, kind: impl Into<String>, parent: String, mass_kg: f64) -> Self {
        let kind = kind.into();
        let (limits_rad, limits_m, max_torque_nm, max_force_n) = (None, None, None, None);
        let (armature, follows) = (None, None);
        Self { name, kind, parent, mass_kg, limits_rad, limits_m, max_torque_nm, max_force_n, armature, follows }
    }

    /// The part with limits in rad or m.
    fn with_limits(mut self, kind: JointKind, limits: Option<[f64; 2]>) -> Self {
        match kind {
            JointKind::Revolute => self.limits_rad = limits,
            JointKind::Prismatic => self.limits_m = limits,
        }
        self
    }
}

#[derive(Serialize)]
struct Constant {
    rust: String,
}

#[derive(Serialize)]
struct Identifiable {
    inertial_parameters: usize,
    base: Vec<String>,
    without_effect: Vec<String>,
}

impl Model {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let subject = self.subject.subject()?;
        if let (true, Subject::Arm(arm)) = (self.rust, &subject) {
            return ui.print(&Constant { rust: arm.constant() });
        }
        if self.rust {
            let robot = subject.into_robot("model --rust")?;
            let is_finite = |joint: &Joint<f32>| {
                let Inertia { mass, com, about_com } = &joint.inertia;
                let pose = joint.placement.position.iter().chain(joint.placement.rotation.iter());
                pose.chain([mass]).chain(com.iter()).chain(about_com.iter()).all(|number| number.is_finite())
            };
            if let Some(joint) = robot.joints.iter().find(|joint| !is_finite(&joint.joint.cast())) {
                anyhow::bail!(
                    "joint {} has a number beyond those of the firmware, 3.4e38; correct the file",
                    joint.name
                );
            }
            let rust = robot.constant(frame_of(&robot, self.frame.as_deref())?)?;
            return ui.print(&Constant { rust });
        }
        let report = match &subject {
            Subject::Arm(arm) => of_arm(arm),
            Subject::Robot(robot) => self.of_robot(robot, ui)?,
        };
        if matches!(subject, Subject::Arm(_)) && self.base_parameters {
            subject.into_robot("model --base-parameters")?;
        }
        ui.print(&report)
    }

    fn of_robot(&self, robot: &Robot, ui: Ui) -> anyhow::Result<Report> {
        let base = robot.frames.first().map_or("base", |frame| frame.name.as_str());
        let parts = robot.joints.iter().map(|joint| {
            let kind = joint.joint.axis.kind;
            let parent = joint.joint.parent.and_then(|parent| robot.joints.get(parent));
            let parent = parent.map_or(base, |parent| parent.link.as_str());
            let name = if kind == JointKind::Revolute { "revolute" } else { "prismatic" };
            let follows = joint.mimic.map(|mimic| Follows {
                joint: robot.joints[mimic.joint].name.clone(),
                factor: mimic.factor,
                offset: mimic.offset,
            });
            let part = Part::new(joint.name.clone(), name, parent.to_owned(), joint.joint.inertia.mass);
            let is_revolute = kind == JointKind::Revolute;
            Part {
                max_torque_nm: joint.effort.filter(|_| is_revolute),
                max_force_n: joint.effort.filter(|_| !is_revolute),
                armature: Some(joint.armature).filter(|armature| *armature != 0.0),
                follows,
                ..part.with_limits(kind, joint.limits)
            }
        });
        let mut report = Report {
            name: robot.name.clone(),
            kind: if robot.floating { "robot on a floating base" } else { "robot on a fixed base" },
            mass_kg: robot.mass(),
            gravity_m_s2: robot.gravity.into(),
            parts: parts.collect(),
            correction: None,
            frames: robot.frames.iter().map(|frame| frame.name.clone()).collect(),
            warnings: [robot.warnings.clone(), robot.ignored.clone()].concat(),
            base_parameters: None,
        };
        if self.base_parameters {
            let spinner = ui.spinner("computing base parameters");
            let found = robot.base_parameters(self.seed);
            spinner.finish_and_clear();
            report.base_parameters = Some(identifiable(robot, &found?));
        }
        Ok(report)
    }
}

fn identifiable(robot: &Robot, found: &BaseParameters) -> Identifiable {
    Identifiable {
        inertial_parameters: 10 * (robot.joints.len() + usize::from(robot.floating)),
        base: found.base.iter().map(|parameter| BaseParameters::words(parameter, robot)).collect(),
        without_effect: found.without_effect.iter().map(|inertial| inertial.words(robot)).collect(),
    }
}

fn of_arm(arm: &Arm) -> Report {
    let chain = &arm.model.chain;
    let mut servos = arm.servos.iter();
    let parts = chain.stages.iter().zip(&arm.model.masses).enumerate().map(|(index, (stage, mass))| {
        let (kind, limits, of) = match stage {
            Stage::Link(_) => ("link".to_owned(), None, JointKind::Prismatic),
            Stage::Planar(_) => ("planar platform of 3 legs".into(), stroke(stage), JointKind::Prismatic),
            Stage::Spatial(_) => ("platform of 6 legs".into(), stroke(stage), JointKind::Prismatic),
            Stage::Discrete(joint) => {
                (format!("discrete joint of {} positions", joint.states), stroke(stage), joint.axis.kind)
            }
            Stage::Servo(joint) => {
                let limits = servos.next().map(|servo| [servo.min_rad, servo.max_rad].map(f64::from));
                ("servo".into(), limits, joint.axis.kind)
            }
        };
        let parent = index.checked_sub(1).map_or("base".into(), |below| arm.stage_name(below));
        Part::new(arm.stage_name(index), kind, parent, mass.mass_kg).with_limits(of, limits)
    });
    let stages: f64 = arm.model.masses.iter().take(chain.stages.len()).map(|mass| mass.mass_kg).sum();
    let mass_kg = stages + arm.model.payload.mass_kg;
    let mut warnings = Vec::new();
    if mass_kg == 0.0 {
        warnings.push("the file gives no masses: loads and sag are zero".into());
    }
    Report {
        name: arm.name.clone(),
        kind: if chain.is_planar() { "planar arm of discrete stages" } else { "arm of discrete stages" },
        mass_kg,
        gravity_m_s2: arm.model.gravity.into(),
        parts: parts.collect(),
        correction: Some(Correction::of(arm)),
        frames: Vec::new(),
        warnings,
        base_parameters: None,
    }
}

impl Correction {
    fn of(arm: &Arm) -> Self {
        let model = &arm.model;
        let effects = model.effects.iter().map(|effect| {
            let site = site(arm, effect);
            let values = effect.quantities().iter().zip(effect.values());
            let value = |(quantity, value): (&Quantity, &f64)| ModelledValue {
                name: quantity.name,
                value: *value,
                unit: quantity.unit,
            };
            let parameters = values.map(value).collect();
            ModelledEffect { law: effect.name().to_string(), place: site.code, place_name: site.name, parameters }
        });
        Self {
            model: model.number,
            nominal_supply_pa: model.nominal_supply,
            working_supply_pa: model.working_supply,
            reference_temperature_k: model.reference_temperature_k,
            working_temperature_k: model.working_temperature_k,
            effects: effects.collect(),
        }
    }

    /// Lines for people.
    fn text(&self) -> String {
        let [nominal, working] = [self.nominal_supply_pa, self.working_supply_pa].map(|pascal| pascal / 1e5);
        let [reference, warm] =
            [self.reference_temperature_k, self.working_temperature_k].map(|kelvin| kelvin - ZERO_CELSIUS);
        let mut text = format!(
            "\n\nmodel number {}; works at {working:.2} bar and {warm:.1} °C, geometry measured at {nominal:.2} bar and \
             {reference:.1} °C",
            self.model
        );
        if self.effects.is_empty() {
            return text + "\nno effects";
        }
        let head = ["effect", "where", "", "value", ""].map(str::to_owned).to_vec();
        let rows = self.effects.iter().flat_map(|effect| {
            effect.parameters.iter().map(|value| {
                let unit = if value.unit == "1" { "" } else { value.unit };
                let number = format!("{:.6e}", value.value).parse::<f64>().unwrap_or(value.value);
                [&effect.law, &effect.place, value.name, &number.to_string(), unit].map(str::to_owned).to_vec()
            })
        });
        text += &format!("\n{}", columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>()));
        text
    }
}

/// Smallest and largest setting of the actuators of a stage, m or rad.
fn stroke(stage: &Stage<f64>) -> Option<[f64; 2]> {
    let legs = 0..stage.n_actuators();
    let states = legs.flat_map(|leg| (0..stage.n_states(leg)).filter_map(move |digit| stage.setting(leg, digit as u8)));
    let values: Vec<f64> = states.map(|setting| setting.value).collect();
    let smallest = values.iter().copied().reduce(f64::min)?;
    Some([smallest, values.iter().copied().reduce(f64::max)?])
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
        let head =
            ["part", "kind", "parent", "mass, kg", "from", "to", "", "max torque or force"].map(str::to_owned).to_vec();
        let rows = self.parts.iter().map(|part| {
            let degrees = part.limits_rad.map(|limits| (limits.map(f64::to_degrees), "deg"));
            let limits = degrees.or(part.limits_m.map(|limits| (limits.map(|limit| 1e3 * limit), "mm")));
            let limit = |k: usize| limits.map_or(String::new(), |(limits, _)| format!("{:.2}", limits[k]));
            let torque = part.max_torque_nm.map(|torque| format!("{torque} N m"));
            let effort = torque.or(part.max_force_n.map(|force| format!("{force} N")));
            let follows = part.follows.as_ref().map(|other| format!(", follows {}", other.joint)).unwrap_or_default();
            let names =
                [part.name.clone(), part.kind.clone() + &follows, part.parent.clone(), format!("{:.4}", part.mass_kg)];
            let unit = limits.map_or(String::new(), |(_, unit)| unit.to_owned());
            names.into_iter().chain([limit(0), limit(1), unit, effort.unwrap_or_default()]).collect()
        });
        text += &columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        if let Some(correction) = &self.correction {
            text += &correction.text();
        }
        if !self.frames.is_empty() {
            text += &format!("\n\nframes: {}", self.frames.join(", "));
        }
        for warning in &self.warnings {
            text += &format!("\nwarning: {warning}");
        }
        if let Some(found) = &self.base_parameters {
            let alone = found.base.len() + found.without_effect.len();
            text += &format!(
                "\n\n{} of {} inertial parameters: {} base parameters, {} without effect on torques, {} only in sums\n",
                found.base.len(),
                found.inertial_parameters,
                found.base.len(),
                found.without_effect.len(),
                found.inertial_parameters - alone
            );
            text += &found.base.iter().map(|words| format!("\n  {words}")).collect::<String>();
            if !found.without_effect.is_empty() {
                text += &format!("\n\nwithout effect on torques: {}", found.without_effect.join(", "));
            }
        }
        text
    }
}
