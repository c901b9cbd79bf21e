//! `darm grasp`: where a hand has to be, and how its fingers bend, to make four contacts.

mod answer;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm_papers::grasp::bare::{Fingers, read_bare_hand};
use darm_papers::grasp::contact::{Configuration, Contacts};
use darm_papers::grasp::file::{HandFile, Task, read_contacts, read_hand};
use darm_papers::grasp::hand::{FINGERS, Hand};
use darm_papers::grasp::library::Library;
use darm_papers::grasp::paper::{self, End};
use darm_papers::grasp::train::Training;
use darm_papers::grasp::{picture, plot, solve};

use self::answer::{Found, Trained};
use crate::failure::Usage;
use crate::voice::Voice;

const EXAMPLES: &str = "\
Examples:
  darm grasp solve allegro_hand.toml grasp-contacts.toml    a posture that makes the contacts
  darm grasp solve allegro_hand.urdf grasp-contacts.toml    the fingers found in a bare URDF
  darm grasp train allegro_hand.toml --file training.txt    the sequence of starts for the paper's search";

const SOLVE_EXAMPLES: &str = "\
Examples:
  darm grasp solve allegro_hand.toml grasp-contacts.toml --picture grasp.svg
  darm grasp solve allegro_hand.toml grasp-contacts.toml --method paper
  darm grasp solve hand.urdf contacts.toml --tips index_tip,middle_tip,ring_tip,thumb_tip --tip-radius-mm 12
  darm --json grasp solve allegro_hand.toml grasp-contacts.toml > posture.json

The contacts name their fingers, all or none; where they do not, the assignment is found. \
A bare URDF is a hand too: its base is the palm, its fingers are the leaf links on four joints, and its \
shapes capsules as thick as the fingertips. A hand's file (host/papers/src/grasp/file.rs) says the shapes better. \
The picture shows the hand before, during and after the search from three sides.";

const TRAIN_EXAMPLES: &str = "\
Examples:
  darm grasp train allegro_hand.toml --n 1000 --lambdas 26    in less than a minute
  darm grasp train allegro_hand.toml --file training.txt --figures figures

The second is the paper's training; stopped, it goes on where it was. The constraints are contacts \
of random postures without a collision. The sequence is for `--method paper` alone: put it into the \
hand's file as `lambdas`.";

/// Find how a hand makes four contacts with its fingertips
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Grasp {
    #[command(subcommand)]
    task: GraspTask,
}

#[derive(clap::Subcommand, Debug)]
enum GraspTask {
    Solve(Solve),
    Train(Train),
}

/// Which hand.
#[derive(clap::Args, Debug)]
struct HandGiven {
    /// The hand: its file, or its URDF alone
    #[arg(value_name = "HAND.toml|HAND.urdf")]
    hand: PathBuf,
    /// Fingertips of a URDF: links at the middle of index, medium, ring and thumb, in this order; found without
    #[arg(long, value_name = "LINK,LINK,LINK,LINK", value_delimiter = ',')]
    tips: Vec<String>,
    /// Radius of the fingertips of a URDF; 12 without
    #[arg(long, value_name = "MM")]
    tip_radius_mm: Option<f64>,
}

impl HandGiven {
    fn read(&self, voice: Voice) -> anyhow::Result<HandFile> {
        if !self.hand.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("urdf")) {
            if !self.tips.is_empty() || self.tip_radius_mm.is_some() {
                return Err(Usage("--tips and --tip-radius-mm are for a URDF; a hand's file says them".into()).into());
            }
            return Ok(read_hand(&self.hand)?);
        }
        let radius_mm = self.tip_radius_mm.unwrap_or(TIP_RADIUS_MM);
        if !(radius_mm > 0.0 && radius_mm.is_finite()) {
            return Err(Usage(format!("--tip-radius-mm {radius_mm}: a length above zero")).into());
        }
        let file = read_bare_hand(&self.hand, &Fingers { tips: self.tips.clone(), tip_radius_m: 1e-3 * radius_mm })?;
        let tips = file.referee.tips.iter().zip(&file.hand.fingers);
        let tips: Vec<_> = tips.map(|(tip, finger)| format!("{} {}", finger.name, tip.name)).collect();
        voice.note(&format!("fingers: {}; their tips have {radius_mm} mm", tips.join(", ")));
        Ok(file)
    }
}

/// Radius of a fingertip where nobody says another, mm.
const TIP_RADIUS_MM: f64 = 12.0;

/// Find the posture that makes the contacts, without a collision
#[derive(clap::Args, Debug)]
#[command(after_help = SOLVE_EXAMPLES)]
struct Solve {
    #[command(flatten)]
    hand: HandGiven,
    /// The contacts
    #[arg(value_name = "CONTACTS.toml")]
    contacts: PathBuf,
    /// How to search: `lm` is the one to use, `paper` that of Suarez and Claret
    #[arg(long, value_enum, default_value_t = Method::Lm)]
    method: Method,
    /// Starts of the search; of the paper's, values of lambda
    #[arg(long, value_name = "COUNT", default_value_t = 10)]
    starts: usize,
    /// Postures to choose the starts from
    #[arg(long, value_name = "COUNT", default_value_t = 1000)]
    library: usize,
    /// Write a picture of the hand before, during and after
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
}

/// How to search.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    Lm,
    Paper,
}

/// Find the sequence of initial configurations for the paper's search
#[derive(clap::Args, Debug)]
#[command(after_help = TRAIN_EXAMPLES)]
struct Train {
    #[command(flatten)]
    hand: HandGiven,
    /// Constraints to train with
    #[arg(long, value_name = "COUNT", default_value_t = 10_000)]
    n: usize,
    /// Values of lambda to try, evenly from 0 to 1
    #[arg(long, value_name = "COUNT", default_value_t = 100)]
    lambdas: usize,
    /// Length of the sequence
    #[arg(long, value_name = "COUNT", default_value_t = 10)]
    length: usize,
    /// Seed of the constraints
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep what is done in this file, and go on from what it holds
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// Draw figures 4 and 5 of the paper into this folder
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
}

/// Seed of the postures that searches start from.
const LIBRARY_SEED: u64 = 1;

impl Grasp {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        match &self.task {
            GraspTask::Solve(solve) => solve.run(voice),
            GraspTask::Train(train) => train.run(voice),
        }
    }
}

/// An answer before it is told.
struct Search {
    path: Vec<Configuration>,
    /// The contact of each finger, by its number in the file.
    order: [usize; FINGERS],
    starts: usize,
    iterations: u32,
}

impl Solve {
    fn run(&self, voice: Voice) -> anyhow::Result<()> {
        if self.starts == 0 || self.library == 0 {
            return Err(Usage("--starts and --library have to be above zero".to_owned()).into());
        }
        let file = self.hand.read(voice)?;
        let task = read_contacts(&self.contacts, &file.hand)?;
        reachable(&file.hand, &task)?;
        let search = match self.method {
            Method::Lm => self.by_us(&file.hand, &task)?,
            Method::Paper => self.by_paper(&file, &task)?,
        };
        let contacts = search.order.map(|contact| task.contacts[contact]);
        let configuration = search.path.last().copied().context("a search has a first configuration")?;
        let verdict = file.referee.judge(&file.hand, &configuration, &contacts)?;
        if let Some(path) = &self.picture {
            write(path, &picture::svg(&file.hand, &stages(&search.path), &contacts))?;
        }
        voice.tell(&Found::new(&file.hand, &search, &configuration, &verdict))
    }

    fn by_us(&self, hand: &Hand, task: &Task) -> anyhow::Result<Search> {
        let library = Library::draw(hand, self.library, LIBRARY_SEED);
        anyhow::ensure!(!library.is_empty(), "no posture of the hand is without a collision: check its capsules");
        let settings = solve::Settings { starts: self.starts, ..solve::Settings::default() };
        let (solution, order) = if task.is_assigned {
            (hand.solve(&library, &task.contacts, &settings), std::array::from_fn(|finger| finger))
        } else {
            hand.solve_any(&library, &task.contacts, &settings)
        };
        if !solution.is_solved {
            let wanted = order.map(|contact| task.contacts[contact]);
            anyhow::bail!(missed(hand, &solution, &wanted));
        }
        Ok(Search { path: solution.path, order, starts: solution.starts, iterations: solution.iterations })
    }

    fn by_paper(&self, file: &HandFile, task: &Task) -> anyhow::Result<Search> {
        if !task.is_assigned {
            let text = "--method paper needs the finger of each contact; name them, or use --method lm";
            return Err(Usage(text.to_owned()).into());
        }
        let (mut iterations, mut ends) = (0, Vec::new());
        for (index, lambda) in file.lambdas.iter().take(self.starts).enumerate() {
            let mut path = Vec::new();
            let settings = paper::Settings::default();
            let attempt = file.hand.attempt(*lambda, &task.contacts, &settings, |on_the_way| path.push(*on_the_way));
            iterations += attempt.iterations;
            if attempt.end == End::Solved {
                let order = std::array::from_fn(|finger| finger);
                return Ok(Search { path, order, starts: index + 1, iterations });
            }
            ends.push(format!("{lambda:.2} {}", attempt.end));
        }
        anyhow::bail!("the paper's search does not find the contacts, try --method lm; lambda {}", ends.join(", "))
    }
}

/// Refuses contacts further apart than the hand is long.
fn reachable(hand: &Hand, task: &Task) -> anyhow::Result<()> {
    let Some((a, b, apart, most)) = hand.out_of_reach(&task.contacts, task.is_assigned) else { return Ok(()) };
    let name = |k: usize| match task.is_assigned {
        true => hand.fingers[k].name.clone(),
        false => (k + 1).to_string(),
    };
    anyhow::bail!(
        "contacts {} and {} are {:.0} mm apart, out of reach: stretched, the fingers bridge {:.0} mm",
        name(a),
        name(b),
        1e3 * apart,
        1e3 * most
    )
}

/// What stands in the way, of a search that ended without a grasp.
fn missed(hand: &Hand, solution: &solve::Solution, contacts: &Contacts) -> String {
    let errors = hand.errors(&solution.configuration, contacts);
    let worst = (0..FINGERS).max_by(|a, b| errors[*a].point_m.total_cmp(&errors[*b].point_m)).unwrap_or(0);
    let tried = format!("{} starts, {} iterations", solution.starts, solution.iterations);
    let cause = if errors[worst].point_m < 1e-6 {
        format!("parts of the hand overlap by {:.2} mm", -1e3 * solution.gap_m)
    } else {
        format!("{} misses its contact by {:.2} mm", hand.fingers[worst].name, 1e3 * errors[worst].point_m)
    };
    format!(
        "no posture makes these contacts: in the nearest {cause} ({tried}); move the contacts, or try more --starts"
    )
}

/// The first, a middle and the last configuration of a search.
fn stages(path: &[Configuration]) -> Vec<(String, Configuration)> {
    let last = path.len().saturating_sub(1);
    let mut picked = vec![0, last / 2, last];
    picked.dedup();
    picked.into_iter().filter_map(|k| Some((format!("iteration {k} of {last}"), *path.get(k)?))).collect()
}

impl Train {
    fn run(&self, voice: Voice) -> anyhow::Result<()> {
        if self.n == 0 || self.lambdas == 0 {
            return Err(Usage("--n and --lambdas have to be above zero".to_owned()).into());
        }
        let hand = self.hand.read(voice)?.hand;
        let settings = paper::Settings::default();
        let training = Training { count: self.n, lambdas: self.lambdas, seed: self.seed, settings };
        let bar = voice.bar("training", self.n as u64, "constraints");
        let outcomes = training.run(&hand, self.file.as_deref(), |done| bar.set_position(done as u64))?;
        bar.finish_and_clear();
        let sequence = outcomes.sequence(self.length);
        if let Some(folder) = &self.figures {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
            write(&folder.join("figure-4.svg"), &plot::selection(&outcomes.lambdas, &sequence))?;
            write(&folder.join("figure-5.svg"), &plot::accumulation(&sequence))?;
        }
        voice.tell(&Trained::new(&training, &sequence))
    }
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
