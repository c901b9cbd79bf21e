//! The model of an arm: its ideal geometry, its masses and the physical effects known so far, under one number.
//!
//! [`Model::predict`] says where the tool is under a [`Condition`]. A diagnosis that finds a new effect, or a
//! synthesis that changes the geometry, makes another model with the next number.

use heapless::Vec;

use crate::actuator::{DiscreteJoint, JointKind, MAX_LEGS, Settings, Stage};
use crate::chain::{Chain, ChainError, Scratch};
pub use crate::effect::Condition;
use crate::effect::{Effect, Place, Site};
use crate::real::{Real, Vec3, cast, real};
use crate::se::{Pose, Wrench};
use crate::units::Word;

/// Effects that one model can hold.
pub const MAX_EFFECTS: usize = 8;

/// How often at most the loads are computed again in the posture that they bend the arm to. A sag of 3 % of a lever
/// changes the loads by as much, so each time leaves 3 % of what the last one left; near a singular posture it is more.
const MAX_SETTLINGS: usize = 12;
/// The arm has settled when no actuator moves by more than this, m or rad; 16 ε of the scalar come on top.
const SETTLED: f64 = 1e-8;

/// An arm of at most `N` stages with everything that decides the pose of its tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Model<T: Real, const N: usize> {
    /// Counts up with every change, so that a table or a measurement names what it was made with.
    pub number: u32,
    /// The ideal geometry.
    pub chain: Chain<T, N>,
    /// What moves with the top of each stage, expressed in the top's frame; entries past the last stage are not used.
    pub masses: [Mass<T>; N],
    /// What the tool carries, itself included, expressed in the tool's frame.
    pub payload: Mass<T>,
    /// The gravity field in the base frame, m/s²: (0, −9.81, 0) where y points up.
    pub gravity: Vec3<T>,
    /// The supply that the geometry was measured at: V of coils, Pa of compressed air.
    pub nominal_supply: T,
    /// The temperature that the geometry was measured at, K.
    pub reference_temperature_k: T,
    /// The supply that the arm works at, V or Pa like the nominal one; tables and syntheses are made for it.
    pub working_supply: T,
    /// The temperature that the arm works at, K.
    pub working_temperature_k: T,
    /// What makes the arm depart from its geometry, in the order in which they act.
    pub effects: Vec<Effect<T>, MAX_EFFECTS>,
}

/// A mass and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass<T: Real> {
    /// How much, kg.
    pub mass_kg: T,
    /// Centre of mass, m.
    pub center: Vec3<T>,
}

impl<T: Real, const N: usize> Model<T, N> {
    /// The ideal arm: without masses and effects, with the weight pointing down along −y and supply and temperature
    /// of 1 and 293.15 K.
    pub fn ideal(chain: Chain<T, N>) -> Self {
        Self {
            number: 0,
            chain,
            masses: [Mass::none(); N],
            payload: Mass::none(),
            gravity: Vec3::new(T::zero(), real(-9.81), T::zero()),
            nominal_supply: T::one(),
            reference_temperature_k: real(293.15),
            working_supply: T::one(),
            working_temperature_k: real(293.15),
            effects: Vec::new(),
        }
    }

    /// The condition that the geometry was measured under, with no word before.
    pub fn nominal<'a>(&self, word: Word, servos: &'a [T]) -> Condition<'a, T> {
        let (supply, temperature_k) = (self.nominal_supply, self.reference_temperature_k);
        Condition { servos, supply, temperature_k, ..Condition::of_word(word) }
    }

    /// The condition that the arm works under when it comes from another word.
    pub fn working<'a>(&self, word: Word, previous: Word, servos: &'a [T]) -> Condition<'a, T> {
        let (supply, temperature_k) = (self.working_supply, self.working_temperature_k);
        Condition { previous: Some(previous), supply, temperature_k, ..self.nominal(word, servos) }
    }

    /// Pose of the tool in the base under `condition`, with all effects; the posture is left in `scratch`, the tool where
    /// the arm alone has it.
    ///
    /// # Errors
    ///
    /// The word, the word before or the servo positions of `condition` do not fit the chain, or a platform cannot be
    /// assembled with the legs that the effects give it.
    pub fn predict(&self, condition: &Condition<T>, scratch: &mut Scratch<T, N>) -> Result<Pose<T>, ChainError> {
        self.configure(condition, scratch)?;
        let unloaded = self.chain.assemble(scratch)?;
        if self.bears_load() {
            self.settle(condition, scratch)?;
            return Ok(self.seen(scratch.pose_base_tool, condition));
        }
        Ok(self.seen(unloaded, condition))
    }

    /// Writes what each actuator is set to under `condition` without loads, with all effects, and leaves the poses of
    /// `scratch` as they were.
    ///
    /// # Errors
    ///
    /// The word, the word before or the servo positions of `condition` do not fit the chain.
    pub fn configure(&self, condition: &Condition<T>, scratch: &mut Scratch<T, N>) -> Result<(), ChainError> {
        self.chain.configure(&condition.word, condition.servos, scratch)?;
        if self.effects.is_empty() {
            return Ok(());
        }
        self.check_previous(condition)?;
        self.each_effect(condition, |effect, site, leg| {
            effect.disturb(site, &mut scratch.settings[site.stage][leg]);
        });
        for effect in &self.effects {
            if let Some(stage) = self.servo_stage(effect) {
                effect.turn(&mut scratch.settings[stage][0]);
            }
        }
        Ok(())
    }

    /// Whether an actuator gives way under load.
    pub fn bears_load(&self) -> bool {
        self.effects.iter().any(|effect| effect.bears_load())
    }

    /// The stage of the servo joint that an effect acts on.
    pub fn servo_stage(&self, effect: &Effect<T>) -> Option<usize> {
        match effect.place() {
            Place::Servo(servo) => self.chain.servo_stages().nth(servo.into()),
            _ => None,
        }
    }

    /// Where the tool is seen when the arm has it at `pose_base_tool`.
    pub fn seen(&self, pose_base_tool: Pose<T>, condition: &Condition<T>) -> Pose<T> {
        self.effects.iter().fold(pose_base_tool, |pose, effect| effect.displace(pose, condition))
    }

    /// Lets the loaded actuators give way until the arm is at rest; `scratch` holds it without load.
    fn settle(&self, condition: &Condition<T>, scratch: &mut Scratch<T, N>) -> Result<(), ChainError> {
        let unloaded_settings = scratch.settings;
        let settled = real::<T>(SETTLED) + T::default_epsilon() * real(16.0);
        for _ in 0..MAX_SETTLINGS {
            let (mut moved, before) = (T::zero(), scratch.settings);
            self.give_way(condition, &unloaded_settings, scratch);
            for (stage, leg) in self.chain.actuators() {
                moved = moved.max((scratch.settings[stage][leg].value - before[stage][leg].value).abs());
            }
            self.chain.assemble(scratch)?;
            if moved < settled {
                break;
            }
        }
        Ok(())
    }

    /// Replaces the settings in `scratch` by `unloaded` ones that give way under the loads of the posture there.
    pub fn give_way(&self, condition: &Condition<T>, unloaded: &[Settings<T>; N], scratch: &mut Scratch<T, N>) {
        let loads = self.loads(scratch, condition.load_kg);
        scratch.settings = *unloaded;
        self.each_effect(condition, |effect, site, leg| {
            scratch.settings[site.stage][leg].value += effect.deflection(site, loads[site.stage][leg]);
        });
    }

    /// What each actuator of each stage bears by the weights further out, in the posture of `scratch`, when the tool carries
    /// `load_kg` in addition to the payload: see [`Stage::loads`].
    pub fn loads(&self, scratch: &Scratch<T, N>, load_kg: T) -> [[T; MAX_LEGS]; N] {
        let mut loads = [[T::zero(); MAX_LEGS]; N];
        let carried = Mass { mass_kg: self.payload.mass_kg + load_kg, ..self.payload };
        let mut in_base = self.weight(&carried, &scratch.pose_base_tool);
        for (index, stage) in self.chain.stages.iter().enumerate().rev() {
            let top = &scratch.tops[index];
            in_base = in_base + self.weight(&self.masses[index], top);
            let on_top = top.wrench_inverse(&in_base);
            loads[index] = stage.loads(&scratch.settings[index], &scratch.stages[index], &on_top);
        }
        loads
    }

    /// The weight of a mass carried by a frame, expressed about the origin of the base.
    fn weight(&self, mass: &Mass<T>, frame: &Pose<T>) -> Wrench<T> {
        Wrench::of_force(self.gravity * mass.mass_kg, &(*frame * mass.center))
    }

    /// Calls `act` with every effect at every actuator that it acts on: the site, and its number in the stage.
    fn each_effect(&self, condition: &Condition<T>, mut act: impl FnMut(&Effect<T>, &Site<T>, usize)) {
        for (site, leg) in self.sites(condition) {
            for effect in self.effects.iter().filter(|effect| effect.place().holds(&site)) {
                act(effect, &site, leg);
            }
        }
    }

    /// What every actuator is under, in the order of the digits, each with its number in the stage.
    pub fn sites(&self, condition: &Condition<T>) -> impl Iterator<Item = (Site<T>, usize)> {
        let actuators = self.chain.actuators().enumerate();
        actuators.map(|(actuator, (stage, leg))| (self.site(condition, actuator, stage, leg), leg))
    }

    fn site(&self, condition: &Condition<T>, actuator: usize, stage: usize, leg: usize) -> Site<T> {
        let digit = condition.word.digit(actuator);
        let kind = match &self.chain.stages[stage] {
            Stage::Discrete(DiscreteJoint { axis, .. }) => axis.kind,
            _ => JointKind::Prismatic,
        };
        let value = |digit| self.chain.stages[stage].setting(leg, digit).map_or(T::zero(), |setting| setting.value);
        let first = actuator - leg;
        let switched = |other: &usize| {
            condition.previous.is_some_and(|previous| previous.digit(*other) != condition.word.digit(*other))
        };
        let of_stage = first..first + self.chain.stages[stage].n_actuators();
        let together = of_stage.filter(|other| *other != actuator && switched(other)).count() as u8;
        Site {
            stage,
            actuator,
            kind,
            digit,
            previous: condition.previous.map(|word| word.digit(actuator)),
            stroke: value(digit) - value(0),
            supply_deviation: condition.supply / self.nominal_supply - T::one(),
            temperature_rise_k: condition.temperature_k - self.reference_temperature_k,
            time_s: condition.time_s,
            switches: condition.switches.get(actuator).copied(),
            dwell_s: condition.dwell_s.get(actuator).copied(),
            word: Some(condition.word),
            together,
        }
    }

    fn check_previous(&self, condition: &Condition<T>) -> Result<(), ChainError> {
        match condition.previous {
            Some(previous) if previous.len() != condition.word.len() => {
                Err(ChainError::WordLength { actuators: condition.word.len(), digits: previous.len() })
            }
            _ => Ok(()),
        }
    }
}

impl<const N: usize> Model<f64, N> {
    /// The same model in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Model<U, N> {
        Model {
            number: self.number,
            chain: self.chain.cast(),
            masses: self.masses.map(|mass| mass.cast()),
            payload: self.payload.cast(),
            gravity: cast(&self.gravity),
            nominal_supply: real(self.nominal_supply),
            reference_temperature_k: real(self.reference_temperature_k),
            working_supply: real(self.working_supply),
            working_temperature_k: real(self.working_temperature_k),
            effects: self.effects.iter().map(Effect::cast).collect(),
        }
    }
}

impl<T: Real> Mass<T> {
    /// Nothing.
    pub fn none() -> Self {
        Self { mass_kg: T::zero(), center: Vec3::zeros() }
    }
}

impl Mass<f64> {
    /// The same mass in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Mass<U> {
        Mass { mass_kg: real(self.mass_kg), center: cast(&self.center) }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::arms::{planar_arm, seeded, word};

    const COMPLIANCE: f64 = 1e-7;

    /// The planar arm with 2 kg plates, 3 kg at the tool and soft legs.
    fn loaded() -> Model<f64, 4> {
        let mut model = Model::ideal(planar_arm());
        model.masses = [Mass { mass_kg: 2.0, center: Vector3::new(0.05, 0.02, 0.0) }; 4];
        model.payload = Mass { mass_kg: 3.0, center: Vector3::new(0.2, 0.1, 0.0) };
        let sag = Effect::GravitySag { at: Place::Arm, compliance_m_per_n: COMPLIANCE };
        model.effects = [sag].into_iter().collect();
        model
    }

    /// Every effect but the sag at once.
    fn disturbed() -> Model<f64, 4> {
        let mut model = loaded();
        let more: [Effect<f64>; 4] = [
            Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 2e-3 },
            Effect::Play { at: Place::Actuator(7), width_m: 1e-3 },
            Effect::SupplyStroke { at: Place::Arm, gain: 0.05 },
            Effect::ThermalGrowth { at: Place::Module(1), expansion_per_k: 2e-5 },
        ];
        more.into_iter().for_each(|effect| model.effects.push(effect).unwrap());
        model
    }

    proptest! {
        #![proptest_config(seeded(64))]

        #[test]
        fn the_weights_sink_by_what_the_legs_take_up(word in word(planar_arm())) {
            let (model, mut scratch) = (loaded(), Scratch::default());
            model.chain.pose_base_tool(&word, &[], &mut scratch).unwrap();
            let loads = model.loads(&scratch, 0.0);
            let heights = |s: &Scratch<f64, 4>| {
                let plates = s.tops.iter().map(|top| 2.0 * (*top * model.masses[0].center).y);
                plates.sum::<f64>() + 3.0 * (s.pose_base_tool * model.payload.center).y
            };
            let before = heights(&scratch);
            model.predict(&model.nominal(word, &[]), &mut scratch).unwrap();
            let work = 9.81 * (before - heights(&scratch));
            let taken: f64 = loads.as_flattened().iter().map(|force| COMPLIANCE * force * force).sum();
            // The legs yield by less than a millimetre in a metre: the second order is well below a hundredth.
            prop_assert!((work - taken).abs() < 1e-2 * taken, "{work} {taken}");
        }

        #[test]
        fn single_precision_predicts_as_well(word in word(planar_arm()), before in word(planar_arm())) {
            let model = disturbed();
            let fine = Condition { previous: Some(before), supply: 0.9, temperature_k: 300.0, ..model.nominal(word, &[]) };
            let single = model.cast::<f32>();
            let coarse =
                Condition { previous: Some(before), supply: 0.9, temperature_k: 300.0, ..single.nominal(word, &[]) };
            let fine = model.predict(&fine, &mut Scratch::default()).unwrap();
            let coarse = single.predict(&coarse, &mut Scratch::default()).unwrap();
            // Four modules, each with leg lengths known to 4 ε · 1.8 m, turned into a pose by a D⁻¹ of norm below 5
            // and carried over a lever of at most 5 m: 4 · 7.2 ε · 5 · 5 = 720 ε = 8.6e-5.
            let apart = fine.cast::<f32>().distance(&coarse, 1.0);
            prop_assert!(apart < 720.0 * f32::EPSILON, "{apart}");
        }
    }

    #[test]
    fn an_ideal_model_is_its_chain() {
        let (model, mut scratch) = (Model::ideal(planar_arm()), Scratch::default());
        let word = "010110011101".parse().unwrap();
        let ideal = model.chain.pose_base_tool(&word, &[], &mut scratch).unwrap();
        assert_eq!(model.predict(&model.nominal(word, &[]), &mut scratch), Ok(ideal));
    }

    #[test]
    fn a_stroke_loss_is_a_stop_moved() {
        let (word, mut scratch) = ("111111111111".parse().unwrap(), Scratch::default());
        let mut model = Model::ideal(planar_arm());
        let mut moved = planar_arm();
        let stop = crate::chain::Parameter::Stop { actuator: 4, state: 1 };
        moved.set(stop, moved.get(stop).unwrap() - 2e-3).unwrap();
        model.effects.push(Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 2e-3 }).unwrap();
        let expected = moved.pose_base_tool(&word, &[], &mut scratch).unwrap();
        assert_eq!(model.predict(&model.nominal(word, &[]), &mut scratch), Ok(expected));
    }

    #[test]
    fn a_word_before_of_another_length_is_refused() {
        let model = disturbed();
        let word = "111111111111".parse().unwrap();
        let condition = Condition { previous: "1".parse().ok(), ..model.nominal(word, &[]) };
        let error = model.predict(&condition, &mut Scratch::default()).unwrap_err();
        assert_eq!(error, ChainError::WordLength { actuators: 12, digits: 1 });
    }
}
