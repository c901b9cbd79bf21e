//! How residuals change with the values of any effect, without a prediction for each of them.
//!
//! A law changes what an actuator is set to; how the tool moves with that setting is known once for the posture. So the
//! derivative with respect to a value of a law is Σ over its actuators of (∂setting/∂value) · (∂tool/∂setting), with the
//! first by a small step of the law and the second in closed form. Of a law that bears load the change of the loads is
//! left out; it is of second order. A law that moves the tool rigidly acts on where the tool is seen.

use std::cell::OnceCell;

use darm_core::actuator::{Part, Settings};
use darm_core::effect::{Effect, Place, Site};
use darm_core::model::Condition;
use darm_core::se::{Pose, Twist};

use crate::linearise::arm_candidates::same;
use crate::prepare::observations::{NoPose, Observations, PoseRow};
use darm_arm::arm::{ArmModel, ArmScratch};

/// The step of a law's value; laws are smooth at this scale in all their units.
const STEP: f64 = 1e-6;
/// Slopes below this, in units of the noise per unit of the value, are rounding: a value of one unit would not be seen.
const NO_SLOPE: f64 = 1e-3;

/// A model in the postures of some observations.
pub struct Sensitivity<'a> {
    model: &'a ArmModel,
    observations: &'a Observations,
    postures: Vec<Posture<'a>>,
    residuals: Vec<f64>,
}

/// The arm in one posture.
struct Posture<'a> {
    condition: Condition<'a, f64>,
    settings: Vec<Settings<f64>>,
    stages: Vec<Pose<f64>>,
    /// Where the arm has the tool, and where it is seen.
    tool: Pose<f64>,
    seen: Pose<f64>,
    /// Pose of the tool in the top of each stage.
    tools: Vec<Pose<f64>>,
    sites: Vec<(Site<f64>, usize)>,
    loads: Vec<f64>,
    /// How the tool moves with the value of each actuator.
    twists: Vec<OnceCell<Twist<f64>>>,
}

impl<'a> Sensitivity<'a> {
    /// The postures of `model` under the conditions of all rows.
    ///
    /// # Errors
    ///
    /// The model has no pose under the conditions of a row.
    pub fn new(model: &'a ArmModel, observations: &'a Observations, scratch: &mut ArmScratch) -> Result<Self, NoPose> {
        let mut residuals = Vec::new();
        let posture = |row| {
            let posture = Posture::new(model, observations, row, scratch)?;
            residuals.extend(observations.residual(row, &posture.seen));
            Ok(posture)
        };
        let postures = observations.rows.iter().map(posture).collect::<Result<_, NoPose>>()?;
        Ok(Self { model, observations, postures, residuals })
    }

    /// The residuals, in units of the noise.
    pub fn into_residuals(self) -> Vec<f64> {
        self.residuals
    }

    /// The derivative of all residuals with respect to one value of an effect; `None` where it changes nothing.
    pub fn column(&self, effect: &Effect<f64>, value: usize) -> Option<Vec<f64>> {
        // To both sides: a turn out of the plane of a planar arm changes its pose by the square of the turn only.
        let [mut less, mut more] = [*effect; 2];
        *less.values_mut().get_mut(value)? -= 0.5 * STEP;
        *more.values_mut().get_mut(value)? += 0.5 * STEP;
        let mut column = Vec::with_capacity(self.postures.len() * self.observations.n_axes());
        for posture in &self.postures {
            let twist = self.change(posture, &less, &more).to_vector();
            let noise = |axis: usize| self.observations.sigma[axis] * STEP;
            column.extend(self.observations.axes.iter().map(|&axis| twist[axis] / noise(axis)));
        }
        column.iter().any(|slope| slope.abs() > NO_SLOPE).then_some(column)
    }

    /// How the measured tool moves, in its own frame, when one effect takes the place of another.
    fn change(&self, posture: &Posture, from: &Effect<f64>, to: &Effect<f64>) -> Twist<f64> {
        match from.place() {
            Place::Actuator(_) | Place::Module(_) | Place::Arm => self.as_seen(posture, self.twist(posture, from, to)),
            Place::Servo(_) => {
                let Some(stage) = self.model.servo_stage(from) else { return Twist::zero() };
                let (mut before, mut after) = (posture.settings[stage][0], posture.settings[stage][0]);
                from.turn(&mut before);
                to.turn(&mut after);
                let unit = self.model.chain.stages[stage].twist(
                    &posture.settings[stage],
                    &posture.stages[stage],
                    0,
                    Part::Value,
                );
                let of_tool = posture.tools[stage].adjoint_inverse(&unit) * (after.value - before.value);
                self.as_seen(posture, of_tool)
            }
            Place::Base | Place::Tool | Place::Camera => {
                let seen = |effect: &Effect<f64>| self.seen_with(posture, effect);
                (seen(from).inverse() * seen(to)).log()
            }
        }
    }

    /// Where the tool is seen when one effect takes the place of that of the same law and place in the model, or comes last
    /// where the model has none. In its own place: a turn before another motion moves the tool about other axes
    /// than one that comes after it, and at 60° by half as much.
    fn seen_with(&self, posture: &Posture, effect: &Effect<f64>) -> Pose<f64> {
        let own = |other: &&Effect<f64>| same(other, effect);
        if !self.model.effects.iter().any(|other| own(&other)) {
            return effect.displace(posture.seen, &posture.condition);
        }
        let effects = self.model.effects.iter().map(|other| if own(&other) { effect } else { other });
        effects.fold(posture.tool, |pose, effect| effect.displace(pose, &posture.condition))
    }

    /// A small motion of the tool as it is seen.
    fn as_seen(&self, posture: &Posture, of_tool: Twist<f64>) -> Twist<f64> {
        let displaced = self.model.effects.iter().any(|effect| {
            let place = effect.place();
            matches!(place, Place::Base | Place::Tool | Place::Camera)
        });
        if !displaced {
            return of_tool;
        }
        (posture.seen.inverse() * self.model.seen(posture.tool * Pose::exp(&of_tool), &posture.condition)).log()
    }

    /// How the tool moves, in its own frame, when one law of actuators takes the place of another.
    fn twist(&self, posture: &Posture, from: &Effect<f64>, to: &Effect<f64>) -> Twist<f64> {
        let mut sum = Twist::zero();
        for (actuator, (site, leg)) in posture.sites.iter().enumerate() {
            if !from.place().holds(site) {
                continue;
            }
            let ideal = posture.settings[site.stage][*leg];
            let (mut before, mut after) = (ideal, ideal);
            from.disturb(site, &mut before);
            to.disturb(site, &mut after);
            let mut growth = after.value - before.value;
            if from.bears_load() {
                let force = posture.loads[actuator];
                growth += to.deflection(site, force) - from.deflection(site, force);
            }
            if growth != 0.0 {
                let unit = posture.twists[actuator].get_or_init(|| self.unit(posture, site, *leg, Part::Value));
                sum = sum + *unit * growth;
            }
            for axis in 0..3u8 {
                let k = usize::from(axis);
                let anchors = [
                    (Part::Base(axis), after.base[k] - before.base[k]),
                    (Part::Top(axis), after.top[k] - before.top[k]),
                ];
                for (part, change) in anchors.into_iter().filter(|(_, change)| *change != 0.0) {
                    sum = sum + self.unit(posture, site, *leg, part) * change;
                }
            }
        }
        sum
    }

    /// How the tool moves with one number of an actuator.
    fn unit(&self, posture: &Posture, site: &Site<f64>, leg: usize, part: Part) -> Twist<f64> {
        let stage = site.stage;
        let kind = &self.model.chain.stages[stage];
        let of_top = kind.twist(&posture.settings[stage], &posture.stages[stage], leg, part);
        posture.tools[stage].adjoint_inverse(&of_top)
    }
}

impl<'a> Posture<'a> {
    /// The posture of `model` under the conditions of a row.
    fn new(
        model: &ArmModel,
        observations: &Observations,
        row: &'a PoseRow,
        scratch: &mut ArmScratch,
    ) -> Result<Self, NoPose> {
        let condition = observations.condition(row);
        let seen = model.predict(&condition, scratch).map_err(|error| NoPose { sample: row.sample, error })?;
        let n = model.chain.stages.len();
        let sites: Vec<(Site<f64>, usize)> = model.sites(&condition).collect();
        let loads = model.loads(scratch, condition.load_kg);
        Ok(Self {
            condition,
            settings: scratch.settings[..n].to_vec(),
            stages: scratch.stages[..n].to_vec(),
            tool: scratch.pose_base_tool,
            seen,
            tools: scratch.tops[..n].iter().map(|top| top.to(&scratch.pose_base_tool)).collect(),
            loads: sites.iter().map(|(site, leg)| loads[site.stage][*leg]).collect(),
            twists: sites.iter().map(|_| OnceCell::new()).collect(),
            sites,
        })
    }
}

#[cfg(test)]
mod tests;
