//! `darm nearest`: the words that bring the tool nearest to a pose, by exact search.

use std::path::PathBuf;
use std::time::Instant;

use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::reach::exact::{Index, Near, Options, Pattern, Query, switches, words_to_choose_from};
use darm_arm::reach::servo::{Gap, with_servos};
use darm_arm::reach::{ReachError, anytime, corrected};
use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use darm_core::units::Word;
use serde::Serialize;

use super::path::word;
use super::servos::ServoArgs;
use crate::failure::Usage;
use crate::number_text::numbers;
use crate::port::PortArgs;
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm nearest planar4.toml 300,4200,10                        # x, y in mm, angle in degrees
  darm nearest spatial3.toml 100,200,1900,0,15,0 --count 5     # in space: rotation vector
  darm nearest spatial3.toml 100,200,1900 --position-only
  darm nearest planar4.toml 300,4200,10 --stuck 4=0 --forbid '111,***,***,***'
  darm nearest planar4.toml 300,4200,10 --from 000,000,000,000 --within 500
  darm nearest planar4-hybrid.toml 300,4200,10 --gap 5         # also optimise servo angles, to 5 mm
  darm nearest spatial6.toml 100,200,1900,0,15,0 --seconds 3   # stop after 3 s, with a lower bound
  darm nearest arm2.toml 300,4200,10 --effects                 # with the effects of the model
  darm table arm.toml planar4-frames.toml --nearest -o nearest.darm && darm upload nearest.darm
  darm nearest arm.toml 300,4200,10 --on-board                 # the board searches

d^2 = |dp|^2 + (l theta)^2 with l from the arm file. The search is exact over all words of the arm's geometry; effects of \
the model are neglected. Two searches are not exact: --effects, with the effects, coming from the word at rest, and --on-board, \
which needs a table from `darm table --nearest` on the board.";

/// Find the words that bring the tool nearest to a pose, among all words of the arm
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Nearest {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Desired pose of the tool: x,y,angle or x,y,z,rx,ry,rz in mm and degrees, with a rotation vector
    #[arg(value_name = "POSE", allow_hyphen_values = true)]
    pose: String,
    /// Number of words to list
    #[arg(long, value_name = "N", default_value_t = 1)]
    count: usize,
    /// Exclude words: digits, * for any
    #[arg(long, value_name = "PATTERN", num_args = 1..)]
    forbid: Vec<String>,
    /// Actuators that are stuck in one state
    #[arg(long, value_name = "ACTUATOR=STATE", num_args = 1..)]
    stuck: Vec<String>,
    /// Among the words within --within, find the one that switches the fewest actuators from this word
    #[arg(long, value_name = "WORD", requires = "within")]
    from: Option<String>,
    /// Largest distance of a word with --from, in mm
    #[arg(long, value_name = "MM", requires = "from")]
    within: Option<f64>,
    /// Ignore the orientation
    #[arg(long)]
    position_only: bool,
    #[command(flatten)]
    servos: ServoArgs,
    /// Optimise the servo angles too, until the distance is within this of the minimum, in mm
    #[arg(long, value_name = "MM", conflicts_with_all = ["ServoArgs", "from"])]
    gap: Option<f64>,
    /// Time limit of the search, in seconds, for arms of any number of words; report a lower bound on the distance
    #[arg(long, value_name = "S", conflicts_with_all = ["from", "gap"])]
    seconds: Option<f64>,
    /// Use the model with its effects; not exact
    #[arg(long, conflicts_with_all = ["forbid", "from", "position_only", "gap", "seconds"])]
    effects: bool,
    /// Let the board search the frames in its table (`darm table --nearest`); not exact
    #[arg(long, conflicts_with_all = ["count", "forbid", "stuck", "from", "position_only", "ServoArgs", "gap", "seconds", "effects"])]
    on_board: bool,
    #[command(flatten)]
    port: PortArgs,
}

#[derive(Serialize)]
struct OnBoard {
    board: String,
    word: String,
    distance_m: f64,
    error_m: f64,
    error_rad: f64,
    took_s: f64,
}

#[derive(Serialize)]
struct Found {
    words: f64,
    /// Share of the words that were evaluated or excluded by a bound.
    searched: f64,
    took_s: f64,
    /// `None` for a search with a time limit.
    index_bytes: Option<usize>,
    servos_rad: Vec<f64>,
    lower_bound_m: f64,
    nearest: Vec<Line>,
}

#[derive(Serialize)]
struct Line {
    word: String,
    distance_m: f64,
    error_m: f64,
    error_rad: f64,
    switches: Option<usize>,
}

impl Nearest {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let target = pose(&arm, &self.pose, self.position_only)?;
        if self.on_board {
            return ui.print(&self.ask_board(&arm, &target)?);
        }
        let forbidden = self.forbidden(&arm)?;
        let from = self.from.as_ref().map(|from| word(&arm, from)).transpose()?;
        if self.count == 0
            || [self.within, self.gap, self.seconds].iter().flatten().any(|number| number.is_nan() || *number <= 0.0)
        {
            return Err(Usage("--count, --within, --gap and --seconds must be above 0".to_owned()).into());
        }
        let mut options = Options {
            dead: self.stuck.iter().map(|text| stuck_actuator(&arm, text)).collect::<Result<_, _>>()?,
            servos_rad: self.servos.rad(&arm)?,
            ..Options::of(&arm)
        };
        if self.position_only {
            options.length_scale_m = 0.0;
        }
        let spinner = ui.spinner("searching for the nearest word");
        let found = self.search(&arm, &target, options, &forbidden, from.as_ref())?;
        spinner.finish_and_clear();
        if found.nearest.is_empty() {
            anyhow::bail!("no word found; allow more words, or increase --within or --seconds");
        }
        ui.print(&found)
    }

    fn search(
        &self,
        arm: &Arm,
        target: &Pose<f64>,
        mut options: Options,
        forbidden: &[Pattern],
        from: Option<&Word>,
    ) -> anyhow::Result<Found> {
        let start = Instant::now();
        let query = Query { target, count: self.count, forbidden };
        let words = words_to_choose_from(arm, &options, forbidden)?;
        let (searched, index_bytes, near, lower_m) = if let Some(seconds) = self.seconds {
            let go_on = || start.elapsed().as_secs_f64() < seconds;
            let found = anytime::nearest(arm, &query, &options, go_on)?;
            (found.settled, None, found.nearest, found.lower_bound_m)
        } else {
            let (mut gap_near, mut lower_m) = (None, None);
            if let Some(gap) = self.gap {
                let found = with_servos(arm, &query, &options, &Gap::of_m(1e-3 * gap), |_| true)?;
                options.servos_rad = found.servos_rad;
                (gap_near, lower_m) = (Some(found.nearest), Some(found.lower_bound_m));
            }
            let index = Index::new(arm, &options).map_err(|error| match error {
                ReachError::TooManyWords { .. } => anyhow::anyhow!("{error}; limit the search with --seconds 10"),
                error => error.into(),
            })?;
            let near = match (gap_near, from, self.within) {
                (Some(near), ..) => near,
                _ if self.effects => {
                    lower_m = Some(0.0);
                    let found = corrected::nearest(arm, &index, target, &arm.rest(), self.count)?;
                    found.into_iter().map(Near::from).collect()
                }
                (None, Some(from), Some(within)) => {
                    // A nearer word that switches more actuators is not looked for.
                    lower_m = Some(0.0);
                    index.fewest_switches(target, 1e-3 * within, from, forbidden).into_iter().collect()
                }
                _ => index.nearest(target, self.count, forbidden),
            };
            let nearest_m = near.first().map_or(0.0, |near: &Near| near.distance_m);
            (1.0, Some(index.bytes()), near, lower_m.unwrap_or(nearest_m))
        };
        Ok(Found {
            words,
            searched,
            took_s: start.elapsed().as_secs_f64(),
            index_bytes,
            servos_rad: options.servos_rad,
            lower_bound_m: lower_m,
            nearest: near.iter().map(|near| line(near, target, from)).collect(),
        })
    }

    /// The board's answer. The pose of its word, coming from rest, is computed with the arm file and its effects.
    fn ask_board(&self, arm: &Arm, target: &Pose<f64>) -> anyhow::Result<OnBoard> {
        let mut client = self.port.connect()?;
        let model = client.hello().and_then(|hello| hello.model);
        if model != Some(arm.hash()) {
            let table = model.map_or("no table".to_owned(), |model| format!("a table for model {model}"));
            anyhow::bail!(
                "the board has {table}, {} is model {}; run `darm table {0} … --nearest -o T.darm`, then `darm upload T.darm`",
                self.arm.display(),
                arm.hash()
            );
        }
        let start = Instant::now();
        let found = client.nearest(target)?;
        let took_s = start.elapsed().as_secs_f64();
        let condition = arm.model.working(found.word, arm.rest(), &[]);
        let pose = arm.model.predict(&condition, &mut ArmScratch::default())?;
        let apart = pose.to(target);
        Ok(OnBoard {
            board: client.identity().board.to_string(),
            word: found.word.to_string(),
            distance_m: pose.distance(target, arm.length_scale_m),
            error_m: apart.position.norm(),
            error_rad: apart.angle_rad(),
            took_s,
        })
    }

    fn forbidden(&self, arm: &Arm) -> Result<Vec<Pattern>, Usage> {
        self.forbid.iter().map(|text| pattern(text, arm.n_actuators())).collect()
    }
}

/// Parses words to leave out, of an arm with this number of actuators.
fn pattern(text: &str, n_actuators: usize) -> Result<Pattern, Usage> {
    let pattern: Pattern = text.parse().map_err(|error| Usage(format!("--forbid {text}: {error}")))?;
    let given = pattern.digits();
    if given != n_actuators {
        return Err(Usage(format!("--forbid {text}: {given} digits, the arm has {n_actuators} actuators")));
    }
    Ok(pattern)
}

fn line(near: &Near, target: &Pose<f64>, from: Option<&Word>) -> Line {
    let apart = near.pose_base_tool.to(target);
    Line {
        word: near.word.to_string(),
        distance_m: near.distance_m,
        error_m: apart.position.norm(),
        error_rad: apart.angle_rad(),
        switches: from.map(|from| switches(&near.word, from, near.word.len())),
    }
}

/// Parses a pose.
fn pose(arm: &Arm, text: &str, position_only: bool) -> Result<Pose<f64>, Usage> {
    let planar = arm.model.chain.is_planar();
    let wrong = |what: &str| {
        let form = if planar { "x,y,angle" } else { "x,y,z,rx,ry,rz" };
        Usage(format!("pose {text}: {what}; give {form} in mm and degrees, or only the position with --position-only"))
    };
    let numbers = numbers(text, "pose")?;
    match (planar, numbers.as_slice()) {
        (true, &[x, y, angle]) => Ok(Pose2::new(1e-3 * x, 1e-3 * y, angle.to_radians()).into()),
        (true, &[x, y]) if position_only => Ok(Pose2::new(1e-3 * x, 1e-3 * y, 0.0).into()),
        (false, &[x, y, z, a, b, c]) => {
            Ok(Pose::new(&Vec3::new(a, b, c).map(f64::to_radians), 1e-3 * Vec3::new(x, y, z)))
        }
        (false, &[x, y, z]) if position_only => Ok(Pose::at(1e-3 * Vec3::new(x, y, z))),
        _ => Err(wrong(&format!("{} numbers", numbers.len()))),
    }
}

/// Parses an actuator that is stuck: `4=0`.
fn stuck_actuator(arm: &Arm, text: &str) -> Result<(usize, u8), Usage> {
    let wrong = || Usage(format!("--stuck {text}: give ACTUATOR=STATE, such as 4=0"));
    let (actuator, digit) = text.split_once('=').ok_or_else(wrong)?;
    let (actuator, digit) = (actuator.parse().map_err(|_| wrong())?, digit.parse::<u8>().map_err(|_| wrong())?);
    if usize::from(digit) >= arm.model.chain.n_states(actuator) {
        return Err(Usage(format!("--stuck {text}: the arm has no actuator {actuator} with a state {digit}")));
    }
    Ok((actuator, digit))
}

impl Answer for OnBoard {
    fn text(&self) -> String {
        format!(
            "{}  {:.4} mm  position {:.4} mm  orientation {:.4} deg\n\nfrom {} in {:.2} s, by a search that is not exact; \
             without --on-board it is exact",
            self.word,
            1e3 * self.distance_m,
            1e3 * self.error_m,
            self.error_rad.to_degrees(),
            self.board,
            self.took_s
        )
    }
}

impl Answer for Found {
    fn text(&self) -> String {
        let counted = self.nearest.iter().any(|line| line.switches.is_some());
        let mut head = ["word", "d, mm", "position, mm", "orientation, deg"].map(str::to_owned).to_vec();
        head.extend(counted.then(|| "switches".to_owned()));
        let mut rows = vec![head];
        rows.extend(self.nearest.iter().map(|line| {
            let mut row = vec![
                line.word.clone(),
                format!("{:.4}", 1e3 * line.distance_m),
                format!("{:.4}", 1e3 * line.error_m),
                format!("{:.4}", line.error_rad.to_degrees()),
            ];
            row.extend(line.switches.map(|count| count.to_string()));
            row
        }));
        let servos: Vec<_> = self.servos_rad.iter().map(|angle| format!("{:.3}", angle.to_degrees())).collect();
        let servos = if servos.is_empty() { String::new() } else { format!("servos at {} deg; ", servos.join(", ")) };
        let searched = match self.searched {
            1.0 => String::new(),
            share => format!(" ({:.2} % evaluated or excluded)", 100.0 * share),
        };
        let bound = match self.lower_bound_m {
            0.0 => String::new(),
            bound => format!(", lower bound {:.4} mm", 1e3 * bound),
        };
        let index = self.index_bytes.map_or(String::new(), |bytes| format!(", index of {:.1} MB", 1e-6 * bytes as f64));
        format!("{}\n\n{servos}{:.0} words{searched}{bound}; {:.2} s{index}", columns(&rows), self.words, self.took_s)
    }
}
