//! A new arm from a few choices: the text of its arm file, of a board profile and of desired frames.
//!
//! Modules are alike and stand on each other. The files fit each other as they are: they load, give a table and simulate. Lengths,
//! masses and limits are then corrected by those of the parts that are bought.

mod stages;

use std::path::Path;

use darm_core::output::{Drive, MAX_COILS, MAX_INPUTS, MAX_LINES, SwitchLimit};
use darm_core::profile::{BoardWiring, LINES_PER_CHIP, Output, PinTable, Profile};
use darm_core::units::Word;

use crate::arm::frames::{self, DesiredFrame, Weights};
use crate::arm::{Arm, ArmScratch, MAX_STAGES};
use crate::board_profile::BoardProfile;
use crate::board_profile::starting_profile::first_limit;
use crate::stage_settings::{pose, settings};

/// How long a valve with two coils needs current, ms: well above the switching time of small ones.
const PULSE_MS: u16 = 30;
/// Coils that a small supply can switch on within [`SWITCH_WINDOW_MS`].
const SWITCHED_AT_ONCE: usize = 4;
const SWITCH_WINDOW_MS: u16 = 10;

/// What an arm is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// Plates on three cylinders each, in a plane.
    Planar,
    /// Plates on six cylinders each, in space.
    Spatial,
    /// Joints with two positions, one after the other, in a plane.
    Serial,
}

/// What feeds an actuator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Valve {
    /// A 5/2 valve with one coil and a spring: it is on as long as the coil is fed.
    Monostable,
    /// A 5/2 valve with two coils, or another latch: it keeps its state without current.
    Bistable,
}

/// The choices.
#[derive(Clone, Debug, PartialEq)]
pub struct Choices {
    /// Name of the arm, from which those of its files follow.
    pub name: String,
    /// What it is made of.
    pub topology: Topology,
    /// How many modules: platforms, or joints.
    pub modules: usize,
    /// Width of the plates, or length of the links, m.
    pub size_m: f64,
    /// Stroke of the cylinders, m, or angle between the two positions of the joints, rad.
    pub stroke: f64,
    /// What feeds the actuators.
    pub valve: Valve,
    /// Bore and rod of the cylinders, m; not used for joints.
    pub cylinder_m: [f64; 2],
    /// Torque of the joints, N·m; not used for platforms.
    pub torque_nm: f64,
    /// The board; any where there is none.
    pub board: Option<&'static PinTable>,
    /// Each actuator has a limit switch, as far as the board has inputs.
    pub has_switches: bool,
}

/// The texts of the files.
#[derive(Clone, Debug, PartialEq)]
pub struct NewArm {
    /// The arm file. It names the profile by [`profile_file`].
    pub arm: String,
    /// The board profile.
    pub profile: String,
    /// Desired frames: some words, and where the arm has its tool in them.
    pub frames: String,
}

/// Why no arm follows from the choices.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NewArmFault {
    /// The name is none of a file.
    #[error("the name {0:?} is not usable for files; give letters, digits, - and _")]
    Name(String),
    /// The arm has no module, or more than a board drives.
    #[error(
        "{found} modules of {actuators} actuators each; give 1 to {max}: a board drives {} outputs by {} lines",
        MAX_COILS,
        MAX_LINES
    )]
    Modules {
        /// How many were chosen.
        found: usize,
        /// Actuators of each.
        actuators: usize,
        /// Most that are possible.
        max: usize,
    },
    /// A number is out of range.
    #[error("{what} is {value}; give {min} to {max}")]
    Range {
        /// What it is, with its unit.
        what: &'static str,
        /// The number.
        value: f64,
        /// Least possible.
        min: f64,
        /// Largest possible.
        max: f64,
    },
    /// A module falls apart in some word.
    #[error("plates of {:.0} mm cannot be assembled in every word with a stroke of {:.0} mm; give a stroke of at most {:.0} mm, or larger plates", 1e3 * size_m, 1e3 * stroke_m, 1e3 * max_m)]
    Stroke {
        /// Width of the plates, m.
        size_m: f64,
        /// The stroke, m.
        stroke_m: f64,
        /// A stroke that is possible, m.
        max_m: f64,
    },
}

impl Topology {
    /// Actuators of a module.
    pub fn n_actuators(self) -> usize {
        match self {
            Self::Planar => 3,
            Self::Spatial => 6,
            Self::Serial => 1,
        }
    }

    /// Stages of a module in the arm file: a joint is followed by its link.
    fn n_stages(self) -> usize {
        if self == Self::Serial { 2 } else { 1 }
    }

    /// Most modules of an arm on one board.
    pub fn max_modules(self, valve: Valve) -> usize {
        let actuators = (MAX_LINES / valve.n_lines()).min(MAX_COILS);
        (actuators / self.n_actuators()).min(MAX_STAGES / self.n_stages())
    }
}

impl Valve {
    fn n_lines(self) -> usize {
        match self {
            Self::Monostable => 1,
            Self::Bistable => 2,
        }
    }

    /// How the output of this number drives it, each on the next lines.
    fn drive(self, output: u8) -> Drive {
        match self {
            Self::Monostable => Drive::Hold { line: output },
            Self::Bistable => Drive::Latch { set: 2 * output, reset: 2 * output + 1, pulse_ms: PULSE_MS },
        }
    }
}

/// Name of the arm file.
pub fn arm_file(name: &str) -> String {
    format!("{name}.toml")
}

/// Name of the profile's file.
pub fn profile_file(name: &str) -> String {
    format!("{name}.profile.toml")
}

/// Name of the frames' file.
pub fn frames_file(name: &str) -> String {
    format!("{name}-frames.toml")
}

impl Choices {
    /// How many actuators the arm has.
    pub fn n_actuators(&self) -> usize {
        self.modules * self.topology.n_actuators()
    }

    /// How many 74HC595 its lines need.
    pub fn n_chips(&self) -> usize {
        (self.n_actuators() * self.valve.n_lines()).div_ceil(LINES_PER_CHIP.into())
    }

    /// How many of its actuators have a limit switch: the board has no more inputs.
    pub fn n_switches(&self) -> usize {
        if self.has_switches { self.n_actuators().min(MAX_INPUTS) } else { 0 }
    }

    /// The files of the arm.
    ///
    /// # Errors
    ///
    /// The name is not usable for files, a number is out of range, or the modules cannot be assembled in every word.
    pub fn files(&self) -> Result<NewArm, NewArmFault> {
        self.check()?;
        let text = stages::arm_text(self, &profile_file(&self.name));
        let arm = Arm::parse(Path::new("arm.toml"), &text).ok().filter(assembles_in_every_word);
        let arm = arm.ok_or_else(|| self.too_long())?;
        Ok(NewArm { arm: text, profile: self.profile().to_toml_with_advice(), frames: self.frames(&arm) })
    }

    fn check(&self) -> Result<(), NewArmFault> {
        let is_letter = |letter: char| letter.is_ascii_alphanumeric() || "-_".contains(letter);
        if self.name.is_empty() || self.name.starts_with('-') || !self.name.chars().all(is_letter) {
            return Err(NewArmFault::Name(self.name.clone()));
        }
        let (actuators, max) = (self.topology.n_actuators(), self.topology.max_modules(self.valve));
        if !(1..=max).contains(&self.modules) {
            return Err(NewArmFault::Modules { found: self.modules, actuators, max });
        }
        let [bore, rod] = self.cylinder_m.map(|diameter_m| 1e3 * diameter_m);
        let size = ("the size in mm", 1e3 * self.size_m, 10.0, 10_000.0);
        let own = match self.topology {
            Topology::Serial => [
                ("the angle in degrees", self.stroke.to_degrees(), 1.0, 170.0),
                ("the torque in N m", self.torque_nm, 1e-3, 1e5),
                ("the torque in N m", self.torque_nm, 1e-3, 1e5),
            ],
            Topology::Planar | Topology::Spatial => [
                ("the stroke in mm", 1e3 * self.stroke, 1.0, 10_000.0),
                ("the bore in mm", bore, 1.0, 1_000.0),
                ("the rod in mm", rod, 0.0, 0.9 * bore),
            ],
        };
        let outside = [size].into_iter().chain(own).find(|(_, value, min, max)| !(*min..=*max).contains(value));
        match outside {
            Some((what, value, min, max)) => Err(NewArmFault::Range { what, value, min, max }),
            None => Ok(()),
        }
    }

    /// That the stroke is too long, with one that is not: found by bisection.
    fn too_long(&self) -> NewArmFault {
        let assembles = |stroke: f64| {
            let text = stages::arm_text(&Self { stroke, modules: 1, ..self.clone() }, &profile_file(&self.name));
            Arm::parse(Path::new("arm.toml"), &text).is_ok_and(|arm| assembles_in_every_word(&arm))
        };
        let (mut possible, mut too_long) = (0.0, self.stroke);
        for _ in 0..20 {
            let middle = 0.5 * (possible + too_long);
            if assembles(middle) { possible = middle } else { too_long = middle }
        }
        NewArmFault::Stroke { size_m: self.size_m, stroke_m: self.stroke, max_m: 1e-3 * (1e3 * possible).floor() }
    }

    fn profile(&self) -> BoardProfile {
        let new_coils = self.n_actuators().min(SWITCHED_AT_ONCE) as u8;
        let mut profile =
            Profile { supply: SwitchLimit { new_coils, window_ms: SWITCH_WINDOW_MS }, ..Profile::empty() };
        let n_switches = self.n_switches();
        for (number, place) in (0u8..).zip(profile.outputs.iter_mut().take(self.n_actuators())) {
            let drive = self.valve.drive(number);
            let input = (usize::from(number) < n_switches).then_some(number);
            *place = Some(Output { drive, limit: first_limit(drive.default_limit()), input });
        }
        // A board that can read the far end of its chain demands that it is wired where the profile has its length.
        let chips = self.board.filter(|pins| pins.far_end.is_empty()).map(|_| self.n_chips() as u8);
        profile.board = BoardWiring { chips, layout: self.board.map(PinTable::layout) };
        BoardProfile::new(&self.name, profile)
    }

    /// Where the arm has its tool at rest, with every second actuator out, and with all of them out.
    fn frames(&self, arm: &Arm) -> String {
        let word = |digit: &dyn Fn(usize) -> u8| {
            (0..arm.n_actuators()).fold(arm.rest(), |word, actuator| word.with_digit(actuator, digit(actuator)))
        };
        let mut words: Vec<(&str, Word)> = vec![
            ("rest", arm.rest()),
            ("alternating", word(&|actuator| (actuator % 2 == 0).into())),
            ("extended", word(&|_| 1)),
        ];
        words.dedup_by_key(|(_, word)| *word);
        let mut scratch = ArmScratch::default();
        let frame = |(name, word): (&str, Word)| {
            let pose_base_tool = arm.model.chain.pose_base_tool(&word, &[], &mut scratch).ok()?;
            let (name, previous, weights) = (name.to_owned(), arm.rest(), Weights::default());
            Some(DesiredFrame { name, word, previous, servos_rad: Vec::new(), pose_base_tool, weights })
        };
        let frames: Vec<DesiredFrame> = words.into_iter().filter_map(frame).collect();
        format!(
            "# Frames of {}: where its tool is in a few words. Move a pose, then `darm synth` finds lengths for it.\n\n{}",
            self.name,
            frames::to_toml(&frames)
        )
    }
}

fn assembles_in_every_word(arm: &Arm) -> bool {
    let mut stages = arm.model.chain.stages.iter();
    stages.all(|stage| settings(stage).all(|digits| pose(stage, &digits).is_some()))
}

#[cfg(test)]
mod tests {
    use darm_core::profile::{B_L475E_IOT01A, PICO};
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::arm::contradictions;
    use crate::load::Laden;
    use crate::load::capacity::Capacity;

    fn choices() -> Choices {
        Choices {
            name: "new".into(),
            topology: Topology::Planar,
            modules: 3,
            size_m: 0.2,
            stroke: 0.025,
            valve: Valve::Monostable,
            cylinder_m: [0.02, 0.008],
            torque_nm: 2.0,
            board: Some(&PICO),
            has_switches: true,
        }
    }

    /// Arm and profile of the files, which have to fit each other.
    #[track_caller]
    fn check(choices: &Choices) -> (Arm, BoardProfile) {
        let files = choices.files().unwrap_or_else(|fault| panic!("{choices:?}: {fault}"));
        let arm = Arm::parse(Path::new("new.toml"), &files.arm).unwrap();
        let profile = BoardProfile::parse(Path::new("new.profile.toml"), &files.profile).unwrap();
        assert_eq!(contradictions(&arm, &profile.profile), [], "{choices:?}");
        assert_eq!(arm.n_actuators(), choices.n_actuators());
        for frame in frames::parse(Path::new("new-frames.toml"), &files.frames, &arm).unwrap() {
            let reached = arm.model.chain.pose_base_tool(&frame.word, &[], &mut ArmScratch::default()).unwrap();
            assert!(reached.distance(&frame.pose_base_tool, arm.length_scale_m) < 1e-9, "{choices:?}");
        }
        (arm, profile)
    }

    #[test]
    fn files_of_any_choice_fit_each_other() {
        let mut rng = ChaCha8Rng::seed_from_u64(48);
        for _ in 0..60 {
            let pick = |k: usize, of: [Topology; 3]| of[k % 3];
            let topology = pick(rng.random_range(0..3), [Topology::Planar, Topology::Spatial, Topology::Serial]);
            let valve = if rng.random_bool(0.5) { Valve::Monostable } else { Valve::Bistable };
            let size_m = rng.random_range(0.05..1.0);
            let share = rng.random_range(0.02..0.12);
            check(&Choices {
                topology,
                valve,
                modules: rng.random_range(1..=topology.max_modules(valve)),
                size_m,
                stroke: if topology == Topology::Serial { share * 10.0 } else { share * size_m },
                board: [None, Some(&PICO), Some(&B_L475E_IOT01A)][rng.random_range(0..3)],
                has_switches: rng.random_bool(0.5),
                ..choices()
            });
        }
    }

    #[test]
    fn valves_with_two_coils_are_latches_on_two_lines() {
        let (_, profile) = check(&Choices { valve: Valve::Bistable, ..choices() });
        let output = profile.profile.output(4).unwrap();
        assert_eq!(output.drive, Drive::Latch { set: 8, reset: 9, pulse_ms: PULSE_MS });
        assert_eq!(profile.profile.board, BoardWiring { chips: Some(3), layout: Some(PICO.layout()) });
    }

    #[test]
    fn the_new_arm_carries_something() {
        let (arm, _) = check(&choices());
        let laden = Laden { arm: &arm, servos_rad: Vec::new(), payload_kg: 0.0 };
        let Some(Capacity::UpTo { payload_kg, .. }) = laden.capacity().unwrap() else { panic!("it has a capacity") };
        assert!(payload_kg > 0.5, "{payload_kg} kg");
    }

    #[test]
    fn a_stroke_that_is_too_long_is_refused_with_one_that_is_not() {
        let long = Choices { stroke: 0.5, ..choices() };
        let Err(NewArmFault::Stroke { max_m, .. }) = long.files() else { panic!("{:?}", long.files()) };
        check(&Choices { stroke: max_m, ..choices() });
        assert!((0.03..0.3).contains(&max_m), "{max_m}");
    }

    #[test]
    fn choices_out_of_range_are_refused() {
        let refused = |choices: Choices| choices.files().unwrap_err().to_string();
        assert_eq!(
            refused(Choices { name: "../arm".into(), ..choices() }),
            "the name \"../arm\" is not usable for files; give letters, digits, - and _"
        );
        assert_eq!(
            refused(Choices { modules: 17, ..choices() }),
            "17 modules of 3 actuators each; give 1 to 16: a board drives 48 outputs by 64 lines"
        );
        assert_eq!(refused(Choices { cylinder_m: [0.02, 0.02], ..choices() }), "the rod in mm is 20; give 0 to 18");
        for number in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
            assert!(matches!(Choices { size_m: number, ..choices() }.files(), Err(NewArmFault::Range { .. })));
            assert!(matches!(Choices { stroke: number, ..choices() }.files(), Err(NewArmFault::Range { .. })));
        }
    }
}
