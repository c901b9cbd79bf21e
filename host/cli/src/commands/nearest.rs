//! `darm nearest`: which words bring the tool nearest to a pose, proven.

use std::path::PathBuf;
use std::time::Instant;

use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::reach::exact::{Index, Near, Options, Pattern, switches};
use darm_arm::reach::servo::{Gap, with_servos};
use darm_arm::reach::{ReachError, anytime, corrected};
use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use darm_core::units::Word;
use serde::Serialize;

use super::path::{servos_rad, word};
use crate::failure::Usage;
use crate::port::PortArgs;
use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm nearest planar4.toml 300,4200,10                   x, y in mm, angle in degrees
  darm nearest spatial6.toml 100,200,1900,0,15,0 --k 5    x, y, z in mm, rotation vector in degrees
  darm nearest spatial6.toml 100,200,1900 --position-only
  darm nearest planar4.toml 300,4200,10 --dead 4=0 --forbid '111,***,***,***'
  darm nearest planar4.toml 300,4200,10 --from 000,000,000,000 --within 150
  darm nearest hybrid.toml 300,4200,10 --gap 5            servo angles found, too, to 5 mm
  darm nearest huge.toml 100,200,2900,0,15,0 --seconds 10 as near as 10 s lead, and what may be missed
  darm nearest corrected.toml 300,4200,10 --effects       by the model with the effects that were found
  darm nearest planar4.toml 300,4200,10 --board           what the board answers by itself

d^2 = |dp|^2 + (l theta)^2 with l from the arm file. The words are the nearest of all words by the \
arm's geometry, not the best of a sample; effects of the model are left out. With --effects they are \
looked for by the model, coming from the word at rest: near, not proven to be the nearest.";

/// Find the words that bring the tool nearest to a pose, out of all words of the arm
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Nearest {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Wanted pose of the tool: x,y,angle or x,y,z,rx,ry,rz; in mm and degrees
    #[arg(value_name = "POSE", allow_hyphen_values = true)]
    pose: String,
    /// How many words
    #[arg(short, long, value_name = "N", default_value_t = 1)]
    k: usize,
    /// Words not to be used: digits, * for any
    #[arg(long, value_name = "PATTERN", num_args = 1..)]
    forbid: Vec<String>,
    /// Actuators that stand still, counted from 0, and where: 4=0
    #[arg(long, value_name = "ACTUATOR=DIGIT", num_args = 1..)]
    dead: Vec<String>,
    /// Of the words within --within the one that switches the fewest actuators from this word
    #[arg(long, value_name = "WORD", requires = "within")]
    from: Option<String>,
    /// How near a word has to be with --from, in mm
    #[arg(long, value_name = "MM", requires = "from")]
    within: Option<f64>,
    /// Leave the orientation out
    #[arg(long)]
    position_only: bool,
    /// Hold the servos at these angles, in degrees
    #[arg(long, value_name = "DEG", num_args = 1.., allow_negative_numbers = true)]
    servos: Vec<f64>,
    /// Find servo angles, too, until no word can be nearer by more than this, in mm
    #[arg(long, value_name = "MM", conflicts_with_all = ["servos", "from"])]
    gap: Option<f64>,
    /// Search for at most so long, of any number of words, and tell the distance that none can be nearer than
    #[arg(long, value_name = "S", conflicts_with_all = ["from", "gap"])]
    seconds: Option<f64>,
    /// Judge words by the model with its effects: near, not proven to be the nearest
    #[arg(long, conflicts_with_all = ["forbid", "from", "position_only", "gap", "seconds"])]
    effects: bool,
    /// Ask the board, which searches the frames in its table (`darm table --nearest`): near, not proven
    #[arg(long, conflicts_with_all = ["k", "forbid", "dead", "from", "position_only", "servos", "gap", "seconds", "effects"])]
    board: bool,
    #[command(flatten)]
    port: PortArgs,
}

#[derive(Serialize)]
struct OnBoard {
    board: String,
    word: String,
    distance_mm: f64,
    error_mm: f64,
    error_deg: f64,
    took_s: f64,
}

#[derive(Serialize)]
struct Found {
    words_of_the_arm: f64,
    /// Share of the words that were looked at or cannot be nearer.
    settled: f64,
    took_s: f64,
    /// None of a search for a given time.
    index_mb: Option<f64>,
    servos_deg: Vec<f64>,
    lower_bound_mm: f64,
    nearest: Vec<Line>,
}

#[derive(Serialize)]
struct Line {
    word: String,
    distance_mm: f64,
    error_mm: f64,
    error_deg: f64,
    switches: Option<usize>,
}

impl Nearest {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let target = pose(&arm, &self.pose, self.position_only)?;
        if self.board {
            return voice.tell(&self.ask_board(&arm, &target)?);
        }
        let forbidden = self.forbidden(&arm)?;
        let from = self.from.as_ref().map(|from| word(&arm, from)).transpose()?;
        if self.k == 0
            || [self.within, self.gap, self.seconds].iter().flatten().any(|number| number.is_nan() || *number <= 0.0)
        {
            return Err(Usage("--k, --within, --gap and --seconds have to be more than 0".to_owned()).into());
        }
        let mut options = Options {
            dead: self.dead.iter().map(|dead| stuck(&arm, dead)).collect::<Result<_, _>>()?,
            servos_rad: servos_rad(&arm, &self.servos)?,
            ..Options::of(&arm)
        };
        if self.position_only {
            options.length_scale_m = 0.0;
        }
        let wheel = voice.wheel("looking for the nearest word");
        let found = self.search(&arm, &target, options, &forbidden, from.as_ref())?;
        wheel.finish_and_clear();
        if found.nearest.is_empty() {
            anyhow::bail!("no word is left: allow more words, or take a larger --within or more --seconds");
        }
        voice.tell(&found)
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
        let (words, settled, index_mb, near, lower_m) = if let Some(seconds) = self.seconds {
            let go_on = || start.elapsed().as_secs_f64() < seconds;
            let found = anytime::nearest(arm, target, &options, self.k, forbidden, go_on)?;
            (found.words, found.settled, None, found.nearest, found.lower_bound_m)
        } else {
            let (mut gap_near, mut lower_m) = (None, None);
            if let Some(gap) = self.gap {
                let found = with_servos(arm, target, &options, forbidden, self.k, &Gap::of_m(1e-3 * gap))?;
                options.servos_rad = found.servos_rad;
                (gap_near, lower_m) = (Some(found.nearest), Some(found.lower_bound_m));
            }
            let index = Index::new(arm, &options).map_err(|error| match error {
                ReachError::TooManyWords { .. } => anyhow::anyhow!("{error}; --seconds 10 looks at as many as it can"),
                error => error.into(),
            })?;
            let near = match (gap_near, from, self.within) {
                (Some(near), ..) => near,
                _ if self.effects => {
                    lower_m = Some(0.0);
                    let found = corrected::nearest(arm, &index, target, &arm.rest(), self.k)?;
                    found.into_iter().map(Near::from).collect()
                }
                (None, Some(from), Some(within)) => {
                    index.fewest_switches(target, 1e-3 * within, from, forbidden).into_iter().collect()
                }
                _ => index.nearest(target, self.k, forbidden),
            };
            let nearest_m = near.first().map_or(0.0, |near: &Near| near.distance_m);
            (index.words(), 1.0, Some(1e-6 * index.bytes() as f64), near, lower_m.unwrap_or(nearest_m))
        };
        Ok(Found {
            words_of_the_arm: words,
            settled,
            took_s: start.elapsed().as_secs_f64(),
            index_mb,
            servos_deg: options.servos_rad.iter().map(|angle| angle.to_degrees()).collect(),
            lower_bound_mm: 1e3 * lower_m,
            nearest: near.iter().map(|near| line(near, target, from)).collect(),
        })
    }

    /// What the board answers; where its word brings the tool from rest is told by the arm file, effects and all.
    fn ask_board(&self, arm: &Arm, target: &Pose<f64>) -> anyhow::Result<OnBoard> {
        let mut client = self.port.connect()?;
        let model = client.hello().and_then(|hello| hello.model);
        if model != Some(arm.hash()) {
            let held = model.map_or("no table".to_owned(), |model| format!("a table for model {model}"));
            anyhow::bail!(
                "the board holds {held}, {} is model {}; `darm table {0} … --nearest -o T.darm`, then `darm upload T.darm`",
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
            distance_mm: 1e3 * pose.distance(target, arm.length_scale_m),
            error_mm: 1e3 * apart.position.norm(),
            error_deg: apart.angle_rad().to_degrees(),
            took_s,
        })
    }

    fn forbidden(&self, arm: &Arm) -> Result<Vec<Pattern>, Usage> {
        let pattern = |text: &String| {
            let pattern: Pattern = text.parse().map_err(|error| Usage(format!("--forbid {text}: {error}")))?;
            let (given, wanted) = (pattern.digits(), arm.n_actuators());
            if given != wanted {
                return Err(Usage(format!("--forbid {text}: the arm has {wanted} actuators, not {given}")));
            }
            Ok(pattern)
        };
        self.forbid.iter().map(pattern).collect()
    }
}

fn line(near: &Near, target: &Pose<f64>, from: Option<&Word>) -> Line {
    let apart = near.pose_base_tool.to(target);
    Line {
        word: near.word.to_string(),
        distance_mm: 1e3 * near.distance_m,
        error_mm: 1e3 * apart.position.norm(),
        error_deg: apart.angle_rad().to_degrees(),
        switches: from.map(|from| switches(&near.word, from, near.word.len())),
    }
}

/// The pose that a person typed.
fn pose(arm: &Arm, text: &str, position_only: bool) -> Result<Pose<f64>, Usage> {
    let planar = arm.model.chain.is_planar();
    let wrong = |what: &str| {
        let form = if planar { "x,y,angle" } else { "x,y,z,rx,ry,rz" };
        Usage(format!(
            "the pose {text}: {what}; give {form} in mm and degrees, the position alone with --position-only"
        ))
    };
    let numbers: Vec<f64> = text
        .split(',')
        .map(|number| number.trim().parse().ok().filter(|number: &f64| number.is_finite()))
        .collect::<Option<_>>()
        .ok_or_else(|| wrong("not all are numbers"))?;
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

/// An actuator that stands still: `4=0`.
fn stuck(arm: &Arm, text: &str) -> Result<(usize, u8), Usage> {
    let wrong = || Usage(format!("--dead {text}: give the number of an actuator and its digit, 4=0"));
    let (actuator, digit) = text.split_once('=').ok_or_else(wrong)?;
    let (actuator, digit) = (actuator.parse().map_err(|_| wrong())?, digit.parse::<u8>().map_err(|_| wrong())?);
    if usize::from(digit) >= arm.model.chain.n_states(actuator) {
        return Err(Usage(format!("--dead {text}: the arm has no actuator {actuator} with a state {digit}")));
    }
    Ok((actuator, digit))
}

impl Answer for OnBoard {
    fn text(&self) -> String {
        format!(
            "{}  {:.4} mm  position {:.4} mm  orientation {:.4} deg\n\nfrom {} in {:.2} s: near, not proven to be the \
             nearest; without --board it is",
            self.word, self.distance_mm, self.error_mm, self.error_deg, self.board, self.took_s
        )
    }
}

impl Answer for Found {
    fn text(&self) -> String {
        let counted = self.nearest.iter().any(|line| line.switches.is_some());
        let mut head = ["word", "d", "position", "orientation"].map(str::to_owned).to_vec();
        head.extend(counted.then(|| "switches".to_owned()));
        let mut rows = vec![head];
        rows.extend(self.nearest.iter().map(|line| {
            let mut row = vec![
                line.word.clone(),
                format!("{:.4} mm", line.distance_mm),
                format!("{:.4} mm", line.error_mm),
                format!("{:.4} deg", line.error_deg),
            ];
            row.extend(line.switches.map(|count| count.to_string()));
            row
        }));
        let servos: Vec<_> = self.servos_deg.iter().map(|angle| format!("{angle:.3}")).collect();
        let servos = if servos.is_empty() { String::new() } else { format!("servos at {} deg; ", servos.join(", ")) };
        let settled = match self.settled {
            1.0 => String::new(),
            share => format!(" ({:.2} % of them looked at or ruled out)", 100.0 * share),
        };
        let bound = match self.lower_bound_mm {
            0.0 => String::new(),
            bound => format!(", none nearer than {bound:.4} mm"),
        };
        let index = self.index_mb.map_or(String::new(), |mb| format!(", index of {mb:.1} MB"));
        format!(
            "{}\n\n{servos}out of {:.0} words{settled}{bound}; {:.2} s{index}",
            columns(&rows),
            self.words_of_the_arm,
            self.took_s
        )
    }
}
