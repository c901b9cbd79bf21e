//! `darm path`: an order of switching from one word to another.

use std::path::PathBuf;

use darm_arm::arm::{Arm, frames};
use darm_arm::reach::path::{Limits, path};
use darm_arm::wired_arm::profile_of;
use darm_core::units::Word;
use serde::Serialize;

use super::servos::ServoArgs;
use crate::failure::Usage;
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm path planar4.toml 000,000,000,000 111,000,111,000 --deviation 2000
  darm path planar4.toml 000,000,000,000 111,000,111,000 --max-switches 2 --deviation 2000
  darm --json path planar4.toml 000,000,000,000 111,000,111,000 --deviation 2000

Deviations are distances from the straight line between the two positions of the tool. Only resting poses are checked; motion \
between words is not. Every actuator that differs is switched once.";

/// Find an order of switching between two words that keeps the tool near the straight line, with the fewest words in between
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Path {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Present word
    #[arg(value_name = "FROM")]
    from: String,
    /// Target word
    #[arg(value_name = "TO")]
    to: String,
    /// Largest distance of a resting tool from the straight line, in mm
    #[arg(long, value_name = "MM")]
    deviation: f64,
    /// Largest number of actuators that switch together; default: what the board's supply can feed
    #[arg(long, value_name = "N")]
    max_switches: Option<usize>,
    /// Profile of the board; default: the one that the arm names, else the one built into boards
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    #[command(flatten)]
    servos: ServoArgs,
}

#[derive(Serialize)]
struct SwitchingOrder {
    at_once: usize,
    words_between: usize,
    rests: Vec<Line>,
}

#[derive(Serialize)]
struct Line {
    word: String,
    position_m: [f64; 3],
    deviation_m: f64,
}

impl Path {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let (from, to) = (word(&arm, &self.from)?, word(&arm, &self.to)?);
        if self.deviation.is_nan() || self.deviation < 0.0 || self.max_switches == Some(0) {
            return Err(Usage("--deviation must be at least 0 mm, --max-switches at least 1".to_owned()).into());
        }
        let at_once = match self.max_switches {
            Some(at_once) => at_once,
            None => profile_of(&arm, self.profile.as_deref())?.profile.supply.new_coils.into(),
        };
        let limits = Limits { at_once, tube_m: 1e-3 * self.deviation, servos_rad: self.servos.rad(&arm)? };
        let spinner = ui.spinner("searching for an order");
        let rests = path(&arm, &from, &to, &limits);
        spinner.finish_and_clear();
        let rests: Vec<_> = rests?
            .iter()
            .map(|rest| Line {
                word: rest.word.to_string(),
                position_m: rest.pose_base_tool.position.into(),
                deviation_m: rest.off_m,
            })
            .collect();
        ui.print(&SwitchingOrder { at_once, words_between: rests.len().saturating_sub(2), rests })
    }
}

/// Parses a word and checks it against the arm.
pub(super) fn word(arm: &Arm, text: &str) -> Result<Word, Usage> {
    let word: Word = text.parse().map_err(|error| Usage(format!("{text}: {error}")))?;
    frames::check_word(&word, arm).map_err(|fault| Usage(format!("{text}: {fault}")))?;
    Ok(word)
}

impl Answer for SwitchingOrder {
    fn text(&self) -> String {
        let mut rows = vec![["word", "x, mm", "y, mm", "z, mm", "deviation, mm"].map(str::to_owned).to_vec()];
        rows.extend(self.rests.iter().map(|line| {
            let [x, y, z] = line.position_m.map(|x| format!("{:.1}", 1e3 * x));
            vec![line.word.clone(), x, y, z, format!("{:.1}", 1e3 * line.deviation_m)]
        }));
        format!(
            "{}\n\n{} words in between, at most {} actuators at once",
            columns(&rows),
            self.words_between,
            self.at_once
        )
    }
}
