//! The function of an arm: the pose of its tool for a word, with the physical effects of its model.
//!
//! What a word decides is enumerated: the core configures each actuator in each of its states, and the word chooses among the
//! results. Platforms of which two legs share an anchor are solved in closed form, others by a fixed number of Newton's steps,
//! and an arm that gives way under load settles a fixed number of times. How far that is from the core's own iteration is
//! measured on random words and conditions; an arm for which it is too far is refused.

use std::f64::consts::FRAC_PI_4;

use darm_arm::arm::{Arm, ArmModel, ArmScratch, MAX_STAGES};
use darm_core::actuator::{ClosedForm, Platform, Setting, Settings, Stage};
use darm_core::chain::{ChainError, Scratch};
use darm_core::effect::fitted_term::VariableName;
use darm_core::effect::{Condition, Effect};
use darm_core::model::Model;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::function::{Constant, Function, Input, Module};
use crate::graph::{Arguments, Question};
use crate::recording::{Signature, recorded_function};
use crate::robot::written_pose;
use crate::scalar::{RecordError, Recorded, choice};

/// Random words and conditions on which a generated function is compared with the core.
const SAMPLES: usize = 400;
/// Newton's steps of a platform: each doubles the digits, so that more mean a platform near a singular posture.
const STEPS: std::ops::RangeInclusive<usize> = 2..=8;
/// The largest difference from the core, m and rad, of an arm without and with loads: the core stops settling at 1e-8 m.
const TOLERANCE: [f64; 2] = [1e-10, 1e-6];
/// Supply and temperature vary by this share and by this many K about those that the arm works at, the load is at most the third, kg.
const VARIED: [f64; 3] = [0.2, 20.0, 1.0];

/// Why there is no file for an arm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArmRefusal {
    /// The core's code cannot be recorded.
    #[error("{arm}: {reason}")]
    Record {
        /// Name of the arm.
        arm: String,
        /// Why it cannot be.
        reason: RecordError,
    },
    /// The core has no pose for a word of zeros.
    #[error("{arm}: {reason}; correct the geometry")]
    Chain {
        /// Name of the arm.
        arm: String,
        /// What the core says.
        reason: ChainError,
    },
    /// The fixed number of steps is not enough.
    #[error(
        "{arm}: {} Newton steps and {} settlings leave {error_m:.1e} m and {error_rad:.1e} rad, {} are allowed: a platform is near a \
         singular posture; use `darm model --rust`, which iterates",
        STEPS.end(), SETTLINGS.end(), TOLERANCE[usize::from(*.bears_load)]
    )]
    Steps {
        /// Name of the arm.
        arm: String,
        /// Whether its actuators give way.
        bears_load: bool,
        /// The largest difference of positions, m.
        error_m: f64,
        /// The largest difference of angles, rad.
        error_rad: f64,
    },
}

/// How often an arm that gives way settles.
const SETTLINGS: std::ops::RangeInclusive<usize> = 1..=6;

type RecordedModel = Model<Recorded, MAX_STAGES>;
type RecordedScratch = Scratch<Recorded, MAX_STAGES>;

/// How often is iterated.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plan {
    steps: usize,
    settlings: usize,
}

/// The largest differences from the core, m and rad, and how many words the core refused.
#[derive(Clone, Copy, Debug, Default)]
struct Difference {
    position_m: f64,
    angle_rad: f64,
    refused: usize,
}

/// The function of `arm`.
///
/// # Errors
///
/// The fixed number of iterations is not enough for its platforms, or its model cannot be recorded.
pub fn module(arm: &Arm) -> Result<Module, ArmRefusal> {
    let subject = Subject::new(arm).map_err(|reason| ArmRefusal::Chain { arm: arm.name.clone(), reason })?;
    let bears_load = arm.model.bears_load();
    let tolerance = TOLERANCE[usize::from(bears_load)];
    let [steps, settlings] = [(subject.iterates(), STEPS), (bears_load, SETTLINGS)]
        .map(|(is_needed, range)| if is_needed { range } else { 0..=0 });
    let plans = settlings.flat_map(|settlings| steps.clone().map(move |steps| Plan { steps, settlings }));
    let mut worst = Difference::default();
    for plan in plans {
        let function = subject.function(plan).map_err(|reason| ArmRefusal::Record { arm: arm.name.clone(), reason })?;
        worst = subject.difference(&function);
        if worst.position_m <= tolerance && worst.angle_rad <= tolerance {
            return Ok(subject.module(function, plan, &worst));
        }
    }
    let Difference { position_m, angle_rad, .. } = worst;
    Err(ArmRefusal::Steps { arm: arm.name.clone(), bears_load, error_m: position_m, error_rad: angle_rad })
}

/// An arm, and how its platforms are solved.
struct Subject<'a> {
    arm: &'a Arm,
    states: Vec<usize>,
    servos: usize,
    forms: Vec<Option<ClosedForm>>,
}

impl<'a> Subject<'a> {
    fn new(arm: &'a Arm) -> Result<Self, ChainError> {
        let chain = &arm.model.chain;
        let states: Vec<_> = (0..chain.n_actuators()).map(|actuator| chain.n_states(actuator)).collect();
        let servos = chain.n_servos();
        // The anchors, as effects leave them.
        let mut scratch = ArmScratch::default();
        let (word, zeros) = (word(&vec![0; states.len()]), vec![0.0; servos]);
        arm.model.configure(&arm.model.working(word, word, &zeros), &mut scratch)?;
        let form = |(stage, settings): (&Stage<f64>, &Settings<f64>)| match stage {
            Stage::Planar(platform) => platform.closed_form(settings),
            _ => None,
        };
        let forms = chain.stages.iter().zip(&scratch.settings).map(form).collect();
        Ok(Self { arm, states, servos, forms })
    }

    /// Whether a platform has no closed form.
    fn iterates(&self) -> bool {
        let mut stages = self.arm.model.chain.stages.iter().zip(&self.forms);
        stages.any(|(stage, form)| matches!(stage, Stage::Planar(_) | Stage::Spatial(_)) && form.is_none())
    }

    fn function(&self, plan: Plan) -> Result<Function, RecordError> {
        let mut inputs = Vec::new();
        if self.servos > 0 {
            inputs.push(Input {
                name: "servos",
                len: self.servos,
                about: "positions of the servo joints, rad or m".into(),
            });
        }
        let about = "supply (Pa), temperature (K), mass that the tool carries besides the payload (kg)";
        inputs.push(Input { name: "conditions", len: 3, about: about.into() });
        let signature = Signature {
            name: "pose",
            about: "Pose of the tool in the frame of the base for a word, with the effects of the model.".into(),
            digits: self.states.len(),
            inputs,
        };
        let numbers: Vec<f64> = std::iter::repeat_n(0.0, self.servos).chain(self.conditions()).collect();
        let digits = vec![0; self.states.len()];
        let sample = Arguments { numbers: &numbers, word: &digits, previous: &digits };
        recorded_function(signature, Some(&sample), |read| {
            let (servos, conditions) = if self.servos > 0 { (&read[0][..], &read[1]) } else { (&[][..], &read[0]) };
            written_pose(&self.pose(plan, servos, [conditions[0], conditions[1], conditions[2]]))
        })
    }

    /// Supply, temperature and load that the arm works with.
    fn conditions(&self) -> [f64; 3] {
        [self.arm.model.working_supply, self.arm.model.working_temperature_k, 0.0]
    }

    /// The pose as the core predicts it, but for how it iterates.
    fn pose(&self, plan: Plan, servos: &[Recorded], [supply, temperature_k, load_kg]: [Recorded; 3]) -> Pose<Recorded> {
        let model = self.arm.model.cast::<Recorded>();
        let condition = |words: &Words| {
            let [word, previous] = [&words.word, &words.previous].map(|digits| word(digits));
            Condition { supply, temperature_k, load_kg, ..model.working(word, previous, servos) }
        };
        let zeros = Words { word: vec![0; self.states.len()], previous: vec![0; self.states.len()] };
        let mut scratch = RecordedScratch::default();
        self.configure(&model, &condition, &zeros, &mut scratch);
        self.assemble(&model, &mut scratch, plan.steps, false);
        let unloaded = scratch.settings;
        for _ in 0..plan.settlings {
            model.give_way(&condition(&zeros), &unloaded, &mut scratch);
            // Sagging moves a platform little.
            self.assemble(&model, &mut scratch, plan.steps.min(2), true);
        }
        model
            .effects
            .iter()
            .fold(scratch.pose_base_tool, |pose, effect| self.displaced(effect, pose, &condition, &zeros))
    }

    /// Writes what each actuator is set to: of each of its states as the core does, chosen by the word.
    fn configure<'b>(
        &self,
        model: &RecordedModel,
        condition: &dyn Fn(&Words) -> Condition<'b, Recorded>,
        zeros: &Words,
        scratch: &mut RecordedScratch,
    ) {
        let configured = |words: &Words, scratch: &mut RecordedScratch| {
            model.configure(&condition(words), scratch).expect("digits below the number of states fit the chain");
        };
        configured(zeros, scratch);
        for (actuator, (stage, leg)) in model.chain.actuators().enumerate() {
            let first = actuator - leg;
            let end = first + model.chain.stages[stage].n_actuators();
            let mut variables = vec![Variable::Digit(actuator), Variable::Previous(actuator)];
            for effect in &model.effects {
                match *effect {
                    Effect::Crowding { .. } if !variables.iter().any(|v| matches!(v, Variable::Together { .. })) => {
                        variables.push(Variable::Together { actuator, first, end });
                    }
                    Effect::Interaction { actuator: at, other, .. } if usize::from(at) == actuator => {
                        variables.push(Variable::Digit(other.into()));
                    }
                    _ => {}
                }
            }
            let chosen = self.chosen(&variables, zeros, &mut |words| {
                let mut scratch = RecordedScratch::default();
                configured(words, &mut scratch);
                let Setting { base, top, value } = scratch.settings[stage][leg];
                [base.x, base.y, base.z, top.x, top.y, top.z, value]
            });
            let [bx, by, bz, tx, ty, tz, value] = chosen;
            scratch.settings[stage][leg] = Setting { base: Vec3::new(bx, by, bz), top: Vec3::new(tx, ty, tz), value };
        }
    }

    /// Where the tool is seen with an effect that displaces it.
    fn displaced<'b>(
        &self,
        effect: &Effect<Recorded>,
        pose: Pose<Recorded>,
        condition: &dyn Fn(&Words) -> Condition<'b, Recorded>,
        zeros: &Words,
    ) -> Pose<Recorded> {
        let variables = match effect {
            Effect::FittedTerm(term) => match term.of.name() {
                VariableName::Digits((first, _), second) => std::iter::once(first)
                    .chain(second.map(|(second, _)| second))
                    .map(|actuator| Variable::Digit(actuator.into()))
                    .collect(),
                VariableName::Stayed(actuator) => {
                    vec![Variable::Digit(actuator.into()), Variable::Previous(actuator.into())]
                }
                _ => Vec::new(),
            },
            _ => Vec::new(),
        };
        let chosen: [Recorded; 12] = self.chosen(&variables, zeros, &mut |words| {
            let Pose { rotation, position } = effect.displace(pose, &condition(words));
            std::array::from_fn(|k| if k < 9 { rotation[k] } else { position[k - 9] })
        });
        let [rotation @ .., x, y, z] = chosen;
        Pose { rotation: Mat3::from_column_slice(&rotation), position: Vec3::new(x, y, z) }
    }

    /// What `value` is for each state of `variables`, as a choice among them.
    fn chosen<const K: usize>(
        &self,
        variables: &[Variable],
        words: &Words,
        value: &mut dyn FnMut(&Words) -> [Recorded; K],
    ) -> [Recorded; K] {
        let Some((variable, rest)) = variables.split_first() else { return value(words) };
        let states = variable.states(&self.states);
        let mut chosen = self.chosen(rest, &variable.set(words, states - 1, &self.states), value);
        for state in (0..states - 1).rev() {
            let other = self.chosen(rest, &variable.set(words, state, &self.states), value);
            chosen = std::array::from_fn(|k| choice(variable.question(state), other[k], chosen[k]));
        }
        chosen
    }

    /// Poses of all stages: of a platform in closed form, or after a fixed number of steps from home or where it is.
    fn assemble(&self, model: &RecordedModel, scratch: &mut RecordedScratch, steps: usize, is_near: bool) {
        let near = scratch.stages;
        let start = |index: usize, home: &Pose<Recorded>| if is_near { near[index] } else { *home };
        let assembled = model.chain.assemble_with(scratch, |index, stage, settings| match stage {
            Stage::Planar(platform) => Ok(match &self.forms[index] {
                Some(form) => form.pose(settings, &platform.home),
                None => Platform::<_, 3>::after_steps(settings, &start(index, &platform.home), steps),
            }),
            Stage::Spatial(platform) => {
                Ok(Platform::<_, 6>::after_steps(settings, &start(index, &platform.home), steps))
            }
            joint => joint.pose(settings),
        });
        assembled.expect("joints always have a pose");
    }

    /// How far the function is from the core on random words and conditions.
    fn difference(&self, function: &Function) -> Difference {
        let (mut random, mut difference) = (ChaCha8Rng::seed_from_u64(1), Difference::default());
        let (model, mut scratch) = (&self.arm.model, ArmScratch::default());
        let limits: Vec<_> =
            self.arm.servos.iter().map(|servo| [servo.min_rad, servo.max_rad].map(f64::from)).collect();
        let [supply, temperature_k, load_kg] = self.conditions();
        let [share, kelvin, max_load_kg] = VARIED;
        for _ in 0..SAMPLES {
            let mut digits =
                || self.states.iter().map(|states| random.random_range(0..*states as u8)).collect::<Vec<u8>>();
            let words = Words { word: digits(), previous: digits() };
            let servo = |index: usize| limits.get(index).copied().unwrap_or([-FRAC_PI_4, FRAC_PI_4]);
            let mut within = |[low, high]: [f64; 2]| if low < high { random.random_range(low..high) } else { low };
            let servos: Vec<f64> = (0..self.servos).map(|index| within(servo(index))).collect();
            let conditions = [
                supply * within([1.0 - share, 1.0 + share]),
                temperature_k + within([-kelvin, kelvin]),
                load_kg + within([0.0, max_load_kg]),
            ];
            let [word, previous] = [&words.word, &words.previous].map(|digits| word(digits));
            let condition = Condition {
                supply: conditions[0],
                temperature_k: conditions[1],
                load_kg: conditions[2],
                ..model.working(word, previous, &servos)
            };
            let Ok(expected) = model.predict(&condition, &mut scratch) else {
                difference.refused += 1;
                continue;
            };
            let numbers = [servos, conditions.to_vec()].concat();
            let outputs =
                function.evaluate(&Arguments { numbers: &numbers, word: &words.word, previous: &words.previous });
            let pose =
                Pose { rotation: Mat3::from_row_slice(&outputs[0]), position: Vec3::from_column_slice(&outputs[1]) };
            // A comparison with what is not a number must not pass.
            let worse = |worst: f64, apart: f64| if apart <= worst { worst } else { apart };
            difference.position_m = worse(difference.position_m, (pose.position - expected.position).norm());
            let turned = (pose.rotation - expected.rotation).norm() / std::f64::consts::SQRT_2;
            difference.angle_rad = worse(difference.angle_rad, turned);
            if turned.is_nan() {
                break;
            }
        }
        difference
    }

    fn module(&self, function: Function, plan: Plan, worst: &Difference) -> Module {
        let ArmModel { number, .. } = &self.arm.model;
        let mut about = vec![
            format!("Pose of the tool of {}, model {number}.", self.arm.name),
            "Positions in m, angles in rad. The first digit of a word is the actuator next to the base.".into(),
            self.solved(plan),
            format!(
                "On {SAMPLES} random words, with the supply within {:.0} %, the temperature within {} K and a load up to {} kg of \
                 those that the arm works with, it differs from the iterations of `darm-core` by at most {:.1e} m and {:.1e} rad, \
                 before the rounding of its numbers.",
                100.0 * VARIED[0],
                VARIED[1],
                VARIED[2],
                worst.position_m,
                worst.angle_rad
            ),
        ];
        if worst.refused > 0 {
            about.push(format!(
                "Of these words, `darm-core` refuses {}, near a singular posture or without one: this function does not, and what it \
                 gives for them means nothing.",
                worst.refused
            ));
        }
        Module {
            name: self.arm.name.clone(),
            about,
            constants: vec![Constant {
                name: "CONDITIONS",
                about: "The conditions that the arm works with: supply (Pa), temperature (K), load besides the payload (kg).".into(),
                columns: 3,
                entries: self.conditions().into(),
            }],
            functions: vec![function],
        }
    }

    /// How the platforms are solved, as a sentence.
    fn solved(&self, plan: Plan) -> String {
        let closed = self.forms.iter().flatten().count();
        let mut parts = Vec::new();
        if closed > 0 {
            parts.push(format!("platforms solved in closed form: {closed}"));
        }
        if plan.steps > 0 {
            parts.push(format!("other platforms: {} steps of Newton's method from home", plan.steps));
        }
        if plan.settlings > 0 {
            parts.push(format!("settlings under load: {}", plan.settlings));
        }
        match parts.is_empty() {
            true => "Nothing is iterated.".into(),
            false => {
                let text = parts.join(", ");
                format!("{}{}.", text[..1].to_uppercase(), &text[1..])
            }
        }
    }
}

/// The word and the word before.
#[derive(Clone, Debug)]
struct Words {
    word: Vec<u8>,
    previous: Vec<u8>,
}

/// What the setting of an actuator depends on.
#[derive(Clone, Copy, Debug)]
enum Variable {
    /// The digit of an actuator.
    Digit(usize),
    /// Its digit in the word before.
    Previous(usize),
    /// How many others of its stage have switched.
    Together { actuator: usize, first: usize, end: usize },
}

impl Variable {
    /// How many states it has.
    fn states(self, states: &[usize]) -> usize {
        match self {
            Self::Digit(actuator) | Self::Previous(actuator) => states[actuator],
            Self::Together { first, end, .. } => end - first,
        }
    }

    /// The words in which it has this state.
    fn set(self, words: &Words, state: usize, states: &[usize]) -> Words {
        let mut words = words.clone();
        match self {
            Self::Digit(actuator) => words.word[actuator] = state as u8,
            Self::Previous(actuator) => words.previous[actuator] = state as u8,
            Self::Together { actuator, first, end } => {
                for (others, other) in (first..end).filter(|other| *other != actuator).enumerate() {
                    let digit = words.word[other];
                    let next = (digit + 1) % states[other] as u8;
                    words.previous[other] = if others < state { next } else { digit };
                }
            }
        }
        words
    }

    /// Whether it has this state.
    fn question(self, state: usize) -> Question {
        let state = state as u8;
        match self {
            Self::Digit(actuator) => Question::Digit { actuator: actuator as u8, state },
            Self::Previous(actuator) => Question::Previous { actuator: actuator as u8, state },
            Self::Together { actuator, first, end } => {
                Question::Together { actuator: actuator as u8, first: first as u8, end: end as u8, count: state }
            }
        }
    }
}

fn word(digits: &[u8]) -> Word {
    Word::new(digits).expect("an arm has no more actuators than a word can have digits")
}
