//! `darm path`: in which order to switch from one word to another.

use std::path::PathBuf;

use darm_arm::arm::{Arm, frames};
use darm_arm::reach::path::{Limits, path};
use darm_arm::wired_arm::profile_of;
use darm_core::units::Word;
use serde::Serialize;

use crate::failure::Usage;
use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm path arm.toml 000,000,000,000 111,000,111,000 --tube 200
  darm path arm.toml 000,000,000,000 111,000,111,000 --at-once 2 --tube 400
  darm --json path arm.toml 000,000,000,000 111,000,111,000 --tube 200

The tube is about the straight line between the two positions of the tool; only rests are asked, for \
between two words the arm snaps. Every actuator that differs is switched once.";

/// Find an order of switching between two words with the tool in a tube and the fewest words between
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Path {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// The word it stands at
    #[arg(value_name = "FROM")]
    from: String,
    /// The word it is to go to
    #[arg(value_name = "TO")]
    to: String,
    /// Farthest that the tool may rest from the straight line, in mm
    #[arg(long, value_name = "MM")]
    tube: f64,
    /// Most actuators that switch at once; where left out, the outputs that the board's supply feeds at once
    #[arg(long, value_name = "N")]
    at_once: Option<usize>,
    /// Profile of the board; where it is left out, the one that the arm names, else the one built into boards
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// Servo angles, in degrees; 0 where left out
    #[arg(long, value_name = "DEG", num_args = 1.., allow_negative_numbers = true)]
    servos: Vec<f64>,
}

#[derive(Serialize)]
struct Way {
    at_once: usize,
    words_between: usize,
    rests: Vec<Line>,
}

#[derive(Serialize)]
struct Line {
    word: String,
    position_m: [f64; 3],
    off_mm: f64,
}

impl Path {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let (from, to) = (word(&arm, &self.from)?, word(&arm, &self.to)?);
        if self.tube.is_nan() || self.tube < 0.0 || self.at_once == Some(0) {
            return Err(Usage("--tube has to be 0 mm or more, --at-once 1 or more".to_owned()).into());
        }
        let at_once = match self.at_once {
            Some(at_once) => at_once,
            None => profile_of(&arm, self.profile.as_deref())?.profile.supply.new_coils.into(),
        };
        let limits = Limits { at_once, tube_m: 1e-3 * self.tube, servos_rad: servos_rad(&arm, &self.servos)? };
        let wheel = voice.wheel("looking for an order");
        let rests = path(&arm, &from, &to, &limits);
        wheel.finish_and_clear();
        let rests: Vec<_> = rests?
            .iter()
            .map(|rest| Line {
                word: rest.word.to_string(),
                position_m: rest.pose_base_tool.position.into(),
                off_mm: 1e3 * rest.off_m,
            })
            .collect();
        voice.tell(&Way { at_once, words_between: rests.len().saturating_sub(2), rests })
    }
}

/// The word that a person typed, of as many digits as the arm has actuators.
pub(super) fn word(arm: &Arm, text: &str) -> Result<Word, Usage> {
    let word: Word = text.parse().map_err(|error| Usage(format!("{text}: {error}")))?;
    frames::check_word(&word, arm).map_err(|fault| Usage(format!("{text}: {fault}")))?;
    Ok(word)
}

/// The servo angles that a person typed, all 0 where none are.
pub(super) fn servos_rad(arm: &Arm, degrees: &[f64]) -> Result<Vec<f64>, Usage> {
    let (given, wanted) = (degrees.len(), arm.n_servos());
    if given > 0 && given != wanted {
        return Err(Usage(format!("the arm has {wanted} servo joints, --servos gives {given} angles")));
    }
    Ok(if given == 0 { vec![0.0; wanted] } else { degrees.iter().map(|angle| angle.to_radians()).collect() })
}

impl Answer for Way {
    fn text(&self) -> String {
        let mut rows = vec![["word", "x", "y", "z", "off the line"].map(str::to_owned).to_vec()];
        rows.extend(self.rests.iter().map(|line| {
            let [x, y, z] = line.position_m.map(|x| format!("{x:.4} m"));
            vec![line.word.clone(), x, y, z, format!("{:.1} mm", line.off_mm)]
        }));
        format!(
            "{}\n\n{} words between, at most {} actuators at once",
            columns(&rows),
            self.words_between,
            self.at_once
        )
    }
}
