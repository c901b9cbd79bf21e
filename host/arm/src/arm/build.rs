//! From the file's keys to an [`Arm`] that has been checked.

use std::ops::Range;

use darm_core::actuator::{DiscreteJoint, JointKind, Leg, Platform, ServoJoint, Stage};
use darm_core::chain::{Chain, ChainError};
use darm_core::model::{Mass, Model};
use darm_core::output::{ActuatorWiring, MAX_ACTUATORS, MAX_COILS, MAX_SERVOS, ServoWiring, WiringError};
use darm_core::se::Pose;
use toml::Spanned;

use super::quantities::{Checked, axis_of, mass, needed, point, pose_of, positive, states, vector};
use super::raw::{RawArm, RawConditions, RawHead, RawKind, RawLeg, RawPose, RawServo, RawStage, RawSwitch};
use super::strength::{RawStrength, Strength};
use super::{
    Arm, ArmError, ArmFault, ArmModel, ArmScratch, Connection, FORMAT, Labels, MAX_STAGES, Places, Servo, ZERO_CELSIUS,
    effects,
};
use darm_robot::source::Source;

const BAR: f64 = 1e5;
const DEFAULT_TRAVEL_MS: u16 = 100;

pub(super) fn arm(source: &Source) -> Result<(Arm, Places), ArmError> {
    let head: RawHead = source.parse()?;
    let found = *head.format.get_ref();
    if found != FORMAT {
        let fault = other_kind(&source.parse()?).unwrap_or(ArmFault::Format { found });
        return Err(source.wrong(head.format.span(), fault));
    }
    let raw: RawArm = source.parse()?;
    let (mut arm, places) = build(&raw).map_err(|(span, fault)| source.wrong(span, fault))?;
    arm.profile = raw.profile.map(|named| source.companion(&named));
    Ok((arm, places))
}

/// That a file is of another kind, by a table that no arm has.
fn other_kind(file: &toml::Table) -> Option<ArmFault> {
    let kinds = [
        ("frame", "desired frames"),
        ("contact", "contacts of a grasp"),
        ("output", "the outputs of a board: a profile"),
        ("row", "rows of a Denavit-Hartenberg table"),
    ];
    let (_, holds) = kinds.into_iter().find(|(table, _)| file.contains_key(*table))?;
    Some(ArmFault::OtherKind { holds })
}

fn build(raw: &RawArm) -> Checked<(Arm, Places)> {
    if !(1..=MAX_STAGES).contains(&raw.stage.len()) {
        let fault = ArmFault::StageCount { found: raw.stage.len(), max: MAX_STAGES };
        return Err((raw.stage.last().map_or(0..0, Spanned::span), fault));
    }
    let mut parts = Parts::default();
    for (index, stage) in raw.stage.iter().enumerate() {
        parts.add_stage(index, stage)?;
    }
    let model = model(raw, &mut parts)?;
    let arm = Arm {
        name: raw.name.clone(),
        model,
        profile: None,
        connections: parts.connections,
        strengths: parts.strengths,
        servos: parts.servos,
        length_scale_m: positive("length_scale_m", &raw.length_scale_m)?,
        labels: parts.labels,
    };
    check_poses(&arm, raw)?;
    Ok((arm, parts.places))
}

fn model(raw: &RawArm, parts: &mut Parts) -> Checked<ArmModel> {
    let pose_or_none = |pose: Option<&Spanned<RawPose>>| pose.map_or(Ok(Pose::identity()), pose_of);
    let tool = raw.tool.as_ref().map(Spanned::get_ref);
    let chain = Chain {
        mount: pose_or_none(raw.mount.as_ref())?,
        stages: std::mem::take(&mut parts.stages),
        tool: pose_or_none(tool.and_then(|tool| tool.pose.as_ref()))?,
    };
    let mut model = Model { number: raw.model, ..Model::ideal(chain) };
    model.masses[..parts.masses.len()].copy_from_slice(&parts.masses);
    if let Some(tool) = tool {
        model.payload = mass(tool.mass_kg.as_ref(), tool.center_m.as_ref())?;
    }
    conditions(&mut model, raw.conditions.as_ref())?;
    for raw in &raw.effect {
        let effect = effects::effect(raw.get_ref(), &model).map_err(|fault| (raw.get_ref().law.span(), fault))?;
        let capacity = model.effects.capacity();
        model.effects.push(effect).map_err(|_| (raw.span(), ArmFault::TooManyEffects { max: capacity }))?;
    }
    Ok(model)
}

fn conditions(model: &mut ArmModel, raw: Option<&RawConditions>) -> Checked<()> {
    model.nominal_supply = 6.0 * BAR;
    model.working_supply = model.nominal_supply;
    let Some(raw) = raw else { return Ok(()) };
    if let Some(gravity) = &raw.gravity_m_s2 {
        model.gravity = vector(gravity);
    }
    if let Some(supply) = &raw.supply_bar {
        model.nominal_supply = positive("supply_bar", supply)? * BAR;
    }
    if let Some(celsius) = raw.temperature_c {
        model.reference_temperature_k = celsius.0 + ZERO_CELSIUS;
    }
    model.working_supply = match &raw.working_supply_bar {
        Some(supply) => positive("working_supply_bar", supply)? * BAR,
        None => model.nominal_supply,
    };
    model.working_temperature_k =
        raw.working_temperature_c.map_or(model.reference_temperature_k, |celsius| celsius.0 + ZERO_CELSIUS);
    Ok(())
}

/// What the stages add up to, and where each part is in the file.
#[derive(Default)]
struct Parts {
    stages: heapless::Vec<Stage<f64>, MAX_STAGES>,
    masses: Vec<Mass<f64>>,
    connections: Vec<Connection>,
    strengths: Vec<Option<Strength>>,
    servos: Vec<Servo>,
    labels: Labels,
    places: Places,
    /// The stage that each servo moves.
    servo_stages: Vec<usize>,
    /// The stage of each actuator.
    actuator_stages: Vec<usize>,
}

/// The keys by which a discrete actuator is connected to the board, of a leg or of a joint.
struct RawActuator<'a> {
    span: Range<usize>,
    states: usize,
    output: Option<&'a Spanned<u8>>,
    outputs: Option<&'a Spanned<Vec<u8>>>,
    switch: Option<&'a Spanned<RawSwitch>>,
    travel_ms: Option<u16>,
}

impl Parts {
    fn add_stage(&mut self, index: usize, spanned: &Spanned<RawStage>) -> Checked<()> {
        let raw = spanned.get_ref();
        let span = raw.kind.span();
        self.labels.stages.push(raw.name.clone().unwrap_or_else(|| format!("module {index}")));
        self.masses.push(mass(raw.mass_kg.as_ref(), raw.center_m.as_ref())?);
        check_keys(raw).map_err(|fault| (span.clone(), fault))?;
        let stage = match raw.kind.get_ref() {
            RawKind::Link => Stage::Link(pose_of(needed(&raw.pose, "pose", "a link", &span)?)?),
            RawKind::PlanarPlatform => Stage::Planar(self.platform(raw)?),
            RawKind::SpatialPlatform => Stage::Spatial(self.platform(raw)?),
            RawKind::DiscreteJoint => Stage::Discrete(self.discrete_joint(raw)?),
            RawKind::Servo => Stage::Servo(self.servo_joint(raw)?),
        };
        self.stages.push(stage).map_err(|_| (span, ArmFault::StageCount { found: index + 1, max: MAX_STAGES }))
    }

    fn platform<const LEGS: usize>(&mut self, raw: &RawStage) -> Checked<Platform<f64, LEGS>> {
        let span = raw.kind.span();
        let home = pose_of(needed(&raw.home, "home", "a platform", &span)?)?;
        let mut legs = Vec::new();
        for leg in &raw.leg {
            legs.push(self.leg::<LEGS>(leg, legs.len())?);
        }
        let found = legs.len();
        let legs = legs.try_into().map_err(|_| (span, ArmFault::LegCount { expected: LEGS, found }))?;
        Ok(Platform { legs, home })
    }

    fn leg<const LEGS: usize>(&mut self, spanned: &Spanned<RawLeg>, index: usize) -> Checked<Leg<f64>> {
        let raw = spanned.get_ref();
        let lengths = raw.length_m.get_ref();
        let (length_m, states) = states(lengths, |length| length, raw.length_m.span())?;
        if lengths[0].0 <= 0.0 {
            return Err((raw.length_m.span(), ArmFault::NotPositive { key: "length_m", value: lengths[0].0 }));
        }
        let own = ["left", "diagonal", "right"].get(index).filter(|_| LEGS == 3);
        let own = own.map_or_else(|| format!("{}", index + 1), |name| (*name).into());
        self.labels.actuators.push(raw.name.clone().unwrap_or(own));
        self.connect(&RawActuator {
            span: spanned.span(),
            states: lengths.len(),
            output: raw.output.as_ref(),
            outputs: raw.outputs.as_ref(),
            switch: raw.switch.as_ref(),
            travel_ms: raw.travel_ms,
        })?;
        let strength = RawStrength { cylinder: raw.cylinder.as_ref(), force: raw.force.as_ref(), torque_nm: None };
        self.strengths.push(strength.check(JointKind::Prismatic)?);
        let dimension = if LEGS == 3 { 2 } else { 3 };
        Ok(Leg { base: point(&raw.base_m, dimension)?, top: point(&raw.top_m, dimension)?, length_m, states })
    }

    fn discrete_joint(&mut self, raw: &RawStage) -> Checked<DiscreteJoint<f64>> {
        let span = raw.kind.span();
        let axis = axis_of(raw)?;
        let (values, states) = match axis.kind {
            JointKind::Revolute => {
                let values = needed(&raw.value_deg, "value_deg", "a revolute discrete joint", &span)?;
                states(values.get_ref(), f64::to_radians, values.span())?
            }
            JointKind::Prismatic => {
                let values = needed(&raw.value_m, "value_m", "a prismatic discrete joint", &span)?;
                states(values.get_ref(), |value| value, values.span())?
            }
        };
        self.labels.actuators.push(self.labels.stages.last().expect("add_stage names the stage first").clone());
        self.connect(&RawActuator {
            span,
            states: states.into(),
            output: raw.output.as_ref(),
            outputs: raw.outputs.as_ref(),
            switch: raw.switch.as_ref(),
            travel_ms: raw.travel_ms,
        })?;
        let strength = RawStrength {
            cylinder: raw.cylinder.as_ref(),
            force: raw.force.as_ref(),
            torque_nm: raw.torque_nm.as_ref(),
        };
        self.strengths.push(strength.check(axis.kind)?);
        Ok(DiscreteJoint { axis, values, states })
    }

    fn servo_joint(&mut self, raw: &RawStage) -> Checked<ServoJoint<f64>> {
        let spanned = needed(&raw.servo, "servo", "a servo", &raw.kind.span())?;
        let RawServo { id, min_deg, max_deg } = *spanned.get_ref();
        let [min_rad, max_rad] = [min_deg, max_deg].map(|degrees| degrees.0.to_radians() as f32);
        self.check_bus_id(id).map_err(|fault| (spanned.span(), fault))?;
        let within = -ServoWiring::MAX_RAD <= min_rad && min_rad < max_rad && max_rad <= ServoWiring::MAX_RAD;
        if !within || id > ServoWiring::MAX_ID {
            return Err((spanned.span(), ArmFault::Servo { id }));
        }
        if self.servos.len() == MAX_SERVOS {
            return Err((spanned.span(), ArmFault::Wiring(WiringError::TooMany)));
        }
        self.servos.push(Servo { id, min_rad, max_rad });
        self.servo_stages.push(self.labels.stages.len() - 1);
        self.places.servos.push(spanned.span());
        Ok(ServoJoint { axis: axis_of(raw)?, offset: raw.offset_deg.map_or(0.0, |degrees| degrees.0.to_radians()) })
    }

    /// Refuses an address of the bus that an earlier servo has: both would answer at once.
    fn check_bus_id(&self, id: u8) -> Result<(), ArmFault> {
        let Some(earlier) = self.servos.iter().position(|servo| servo.id == id) else { return Ok(()) };
        let stages = [self.servo_stages[earlier], self.labels.stages.len() - 1];
        Err(ArmFault::SameBusId { id, joints: stages.map(|stage| self.labels.stages[stage].clone()) })
    }

    /// Number and names of an actuator, of its stage first where that has several.
    fn actuator_in_full(&self, actuator: usize) -> String {
        let stage = self.actuator_stages.get(actuator).and_then(|&stage| self.labels.stages.get(stage));
        let own = self.labels.actuators.get(actuator);
        let names: Vec<&str> =
            stage.into_iter().chain(own.filter(|own| Some(*own) != stage)).map(String::as_str).collect();
        format!("actuator {actuator} ({})", names.join(", "))
    }

    fn connect(&mut self, raw: &RawActuator) -> Checked<()> {
        let closed_in = raw.switch.map(|switch| closed_in(switch, raw.states)).transpose()?;
        let (one, more) = (raw.output.map(Spanned::get_ref), raw.outputs.map(Spanned::get_ref));
        let outputs: Vec<u8> = one.into_iter().chain(more.into_iter().flatten()).copied().collect();
        self.actuator_stages.push(self.labels.stages.len() - 1);
        let span = raw.outputs.map(Spanned::span).or(raw.output.map(Spanned::span)).unwrap_or(raw.span.clone());
        let wrong = |fault| Err((span.clone(), fault));
        let travel_ms = raw.travel_ms.unwrap_or(DEFAULT_TRAVEL_MS);
        let expected = ActuatorWiring { states: raw.states as u8, switch: None, travel_ms }.coils();
        let found = outputs.len();
        if found != expected && found != 0 {
            return wrong(ArmFault::OutputCount { expected, found });
        }
        for (index, &output) in outputs.iter().enumerate() {
            let used = self.connections.iter().position(|other| other.outputs.contains(&output));
            let own = outputs[..index].contains(&output).then_some(self.connections.len());
            if let Some(first) = used.or(own) {
                let [first, second] = [first, self.connections.len()].map(|actuator| self.actuator_in_full(actuator));
                return wrong(ArmFault::OutputTwice { output, first, second });
            }
            if usize::from(output) >= MAX_COILS {
                return wrong(ArmFault::Wiring(WiringError::Output { output }));
            }
        }
        if self.connections.len() == MAX_ACTUATORS {
            return wrong(ArmFault::Wiring(WiringError::TooMany));
        }
        self.places.switches.push(raw.switch.map_or(span.clone(), Spanned::span));
        self.places.outputs.push(span);
        self.connections.push(Connection { outputs, closed_in, travel_ms });
        Ok(())
    }
}

/// The states in which a limit switch is closed, bit `d` for digit `d`.
fn closed_in(switch: &Spanned<RawSwitch>, states: usize) -> Checked<u8> {
    let closed_in = &switch.get_ref().closed_in;
    match closed_in.iter().find(|state| usize::from(**state) >= states) {
        Some(&state) => Err((switch.span(), ArmFault::SwitchState { state })),
        None => Ok(closed_in.iter().fold(0, |bits, state| bits | 1 << state)),
    }
}

/// Refuses keys that mean nothing in a stage of this kind.
fn check_keys(raw: &RawStage) -> Result<(), ArmFault> {
    let kind = *raw.kind.get_ref();
    let platform = matches!(kind, RawKind::PlanarPlatform | RawKind::SpatialPlatform);
    let joint = matches!(kind, RawKind::DiscreteJoint | RawKind::Servo);
    let discrete = kind == RawKind::DiscreteJoint;
    let of = match kind {
        RawKind::Link => "a link",
        RawKind::PlanarPlatform | RawKind::SpatialPlatform => "a platform",
        RawKind::DiscreteJoint => "a discrete joint",
        RawKind::Servo => "a servo",
    };
    let given = [
        ("pose", raw.pose.is_some(), kind == RawKind::Link),
        ("home", raw.home.is_some(), platform),
        ("leg", !raw.leg.is_empty(), platform),
        ("motion", raw.motion.is_some(), discrete),
        ("axis", raw.axis.is_some(), joint),
        ("value_m", raw.value_m.is_some(), discrete),
        ("value_deg", raw.value_deg.is_some(), discrete),
        ("output", raw.output.is_some(), discrete),
        ("outputs", raw.outputs.is_some(), discrete),
        ("switch", raw.switch.is_some(), discrete),
        ("travel_ms", raw.travel_ms.is_some(), discrete),
        ("cylinder", raw.cylinder.is_some(), discrete),
        ("force", raw.force.is_some(), discrete),
        ("torque_nm", raw.torque_nm.is_some(), discrete),
        ("offset_deg", raw.offset_deg.is_some(), kind == RawKind::Servo),
        ("servo", raw.servo.is_some(), kind == RawKind::Servo),
    ];
    match given.iter().find(|(_, given, allowed)| *given && !allowed) {
        Some((key, ..)) => Err(ArmFault::Useless { key, of }),
        None => Ok(()),
    }
}

/// Every module has to stand at rest and fully extended: a base-line that is singular or does not fit is reported here.
fn check_poses(arm: &Arm, raw: &RawArm) -> Checked<()> {
    let chain = &arm.model.chain;
    let servos = vec![0.0; arm.n_servos()];
    let mut extended = arm.rest();
    for actuator in 0..arm.n_actuators() {
        extended = extended.with_digit(actuator, chain.n_states(actuator) as u8 - 1);
    }
    let mut scratch = ArmScratch::default();
    for word in [arm.rest(), extended] {
        if let Err(reason) = chain.pose_base_tool(&word, &servos, &mut scratch) {
            let stage = match reason {
                ChainError::Platform { stage, .. } => stage,
                _ => 0,
            };
            let fault = ArmFault::NoPose { word, module: arm.stage_name(stage), reason };
            return Err((raw.stage[stage].get_ref().kind.span(), fault));
        }
    }
    Ok(())
}
