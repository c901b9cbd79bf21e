//! `darm grasp`: the posture of a hand that makes four contacts.

mod answer;

use std::path::PathBuf;

use anyhow::Context as _;
use darm_papers::grasp::assembly::HandFile;
use darm_papers::grasp::bare::{Fingers, read_bare_hand};
use darm_papers::grasp::contact::{Configuration, Contacts};
use darm_papers::grasp::contacts_file::{Task, read_contacts};
use darm_papers::grasp::file::read_hand;
use darm_papers::grasp::hand::Hand;
use darm_papers::grasp::layout::FINGERS;
use darm_papers::grasp::library::Library;
use darm_papers::grasp::paper::{self, End};
use darm_papers::grasp::train::Training;
use darm_papers::grasp::{picture, plot, solve};

use self::answer::{Found, Trained};
use crate::failure::Usage;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::ui::Ui;

const EXAMPLES: &str = "\
Examples:
  darm grasp solve allegro_hand.toml grasp-contacts.toml   # a posture that makes the contacts
  darm grasp solve allegro_hand.urdf grasp-contacts.toml   # fingers detected in a URDF
  darm grasp train allegro_hand.toml --constraints 20 --lambdas 5   # starts of the paper's search";

const SOLVE_EXAMPLES: &str = "\
Examples:
  darm grasp solve allegro_hand.toml grasp-contacts.toml --plot grasp.svg
  darm grasp solve allegro_hand.toml grasp-contacts.toml --method paper
  darm grasp solve allegro_hand.urdf grasp-contacts.toml --tip-radius 12
  darm --json grasp solve allegro_hand.toml grasp-contacts.toml > posture.json

Either all contacts name their fingers, or none; without names, the assignment is found. The pose of the palm is that of the \
base frame of the robot file, which the answer names. Without a hand file \
the fingers are the leaf links on four joints. The shapes that may not collide are those of the URDF or MJCF: boxes, \
spheres, cylinders, capsules, and the convex hulls of meshes. Links that a joint connects are not checked, and links that \
touch in nearly all postures neither; the answer names the latter. The keys of a hand file are documented in \
host/papers/src/grasp/file.rs. The plot shows the hand before, during and after the search from three sides.";

const TRAIN_EXAMPLES: &str = "\
Examples:
  darm grasp train allegro_hand.toml --constraints 20 --lambdas 5 -o training.txt --plot plots

The defaults are those of the paper, and take hours; an interrupted training with -o resumes where it stopped. The \
constraints are contacts of random postures without a collision. Only `darm grasp solve --method paper` uses the sequence: \
copy it into the hand file as `lambdas`.";

/// Find the posture of a hand that makes four contacts with its fingertips
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

/// The hand.
#[derive(clap::Args, Debug)]
struct HandArgs {
    /// The hand: hand file or URDF
    #[arg(value_name = "HAND.toml|HAND.urdf")]
    hand: PathBuf,
    /// Fingertip links of a URDF: index, medium, ring and thumb, in this order; default: detected
    #[arg(long, value_name = "LINK,LINK,LINK,LINK", value_delimiter = ',')]
    tips: Vec<String>,
    /// Radius of the fingertips of a URDF, mm; default: 12
    #[arg(long, value_name = "MM")]
    tip_radius: Option<f64>,
}

impl HandArgs {
    fn read(&self, ui: Ui) -> anyhow::Result<HandFile> {
        if !self.hand.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("urdf")) {
            if !self.tips.is_empty() || self.tip_radius.is_some() {
                return Err(Usage("--tips and --tip-radius need a URDF; a hand file contains them".into()).into());
            }
            return Ok(read_hand(&self.hand)?);
        }
        let radius_mm = self.tip_radius.unwrap_or(TIP_RADIUS_MM);
        if !(radius_mm > 0.0 && radius_mm.is_finite()) {
            return Err(Usage(format!("--tip-radius {radius_mm}: give a length above 0 mm")).into());
        }
        let file = read_bare_hand(&self.hand, &Fingers { tips: self.tips.clone(), tip_radius_m: 1e-3 * radius_mm })?;
        let tips = file.cross_check.tips.iter().zip(&file.hand.fingers);
        let tips: Vec<_> = tips.map(|(tip, finger)| format!("{} {}", finger.name, tip.name)).collect();
        ui.note(&format!("fingers: {}; radius of their tips: {radius_mm} mm", tips.join(", ")));
        Ok(file)
    }
}

/// Default radius of a fingertip, mm.
const TIP_RADIUS_MM: f64 = 12.0;

/// Find the posture that makes the contacts, without a collision
#[derive(clap::Args, Debug)]
#[command(after_help = SOLVE_EXAMPLES)]
struct Solve {
    #[command(flatten)]
    hand: HandArgs,
    /// The contacts
    #[arg(value_name = "CONTACTS.toml")]
    contacts: PathBuf,
    /// Search method: `lm` is recommended, `paper` is that of Suarez and Claret
    #[arg(long, value_enum, default_value_t = Method::Lm)]
    method: Method,
    /// Number of starts; of the paper's method, values of lambda
    #[arg(long, value_name = "N", default_value_t = 10)]
    starts: usize,
    /// Number of postures to choose the starts from
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    library: usize,
    /// Plot the hand before, during and after the search
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<OutputFile>,
}

/// Search method.
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
    hand: HandArgs,
    /// Number of constraints
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    constraints: usize,
    /// Number of values of lambda, evenly from 0 to 1
    #[arg(long, value_name = "N", default_value_t = 100)]
    lambdas: usize,
    /// Length of the sequence
    #[arg(long, value_name = "N", default_value_t = 10)]
    length: usize,
    /// Seed of the constraints
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Save the progress in this file, and resume from it
    #[arg(short, long, value_name = "FILE.txt")]
    output: Option<OutputFile>,
    /// Plot figures 4 and 5 of the paper, as SVG files in this folder
    #[arg(long, value_name = "FOLDER")]
    plot: Option<PathBuf>,
}

/// Seed of the postures that searches start from.
const LIBRARY_SEED: u64 = 1;

impl Grasp {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        match &self.task {
            GraspTask::Solve(solve) => solve.run(ui),
            GraspTask::Train(train) => train.run(ui),
        }
    }
}

/// Result of a search.
struct Search {
    path: Vec<Configuration>,
    /// The contact of each finger, by its number in the file.
    order: [usize; FINGERS],
    starts: usize,
    iterations: u32,
}

impl Solve {
    fn run(&self, ui: Ui) -> anyhow::Result<()> {
        if self.starts == 0 || self.library == 0 {
            return Err(Usage("--starts and --library must be above 0".to_owned()).into());
        }
        let file = self.hand.read(ui)?;
        let task = read_contacts(&self.contacts, &file.hand)?;
        check_reach(&file.hand, &task)?;
        let search = match self.method {
            Method::Lm => self.solve_lm(&file.hand, &task)?,
            Method::Paper => self.solve_paper(&file, &task)?,
        };
        let contacts = search.order.map(|contact| task.contacts[contact]);
        let configuration =
            search.path.last().copied().context("the search has no configuration; please report this error of darm")?;
        let verdict = file.cross_check.judge(&file.hand, &configuration, &contacts)?;
        if let Some(path) = &self.plot {
            output_file::write_text(path, Syntax::Svg, &picture::svg(&file.hand, &stages(&search.path), &contacts))?;
        }
        ui.print(&Found::new(&file.hand, &search, &configuration, &verdict))
    }

    fn solve_lm(&self, hand: &Hand, task: &Task) -> anyhow::Result<Search> {
        let library = Library::draw(hand, self.library, LIBRARY_SEED);
        anyhow::ensure!(!library.is_empty(), "every posture of the hand has a collision; check its shapes and limits");
        let settings = solve::Settings { starts: self.starts, ..solve::Settings::default() };
        let (solution, order) = if task.is_assigned {
            (hand.solve(&library, &task.contacts, &settings), std::array::from_fn(|finger| finger))
        } else {
            hand.solve_any(&library, &task.contacts, &settings)
        };
        if !solution.is_solved {
            let wanted = order.map(|contact| task.contacts[contact]);
            anyhow::bail!(why_unsolved(hand, &solution, &wanted));
        }
        Ok(Search { path: solution.path, order, starts: solution.starts, iterations: solution.iterations })
    }

    fn solve_paper(&self, file: &HandFile, task: &Task) -> anyhow::Result<Search> {
        if !task.is_assigned {
            let text = "--method paper needs the finger of each contact; add them to the contacts, or use --method lm";
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
        anyhow::bail!("the paper's search found no posture (lambda {}); use --method lm", ends.join(", "))
    }
}

/// Rejects contacts that are further apart than the hand can span.
fn check_reach(hand: &Hand, task: &Task) -> anyhow::Result<()> {
    let Some((a, b, apart, limit)) = hand.out_of_reach(&task.contacts, task.is_assigned) else { return Ok(()) };
    let name = |k: usize| match task.is_assigned {
        true => hand.fingers[k].name.clone(),
        false => (k + 1).to_string(),
    };
    anyhow::bail!(
        "contacts {} and {} are {:.0} mm apart, the fingers can span {:.0} mm; move the contacts closer",
        name(a),
        name(b),
        1e3 * apart,
        1e3 * limit
    )
}

/// Why a search ended without a grasp.
fn why_unsolved(hand: &Hand, solution: &solve::Solution, contacts: &Contacts) -> String {
    let errors = hand.errors(&solution.configuration, contacts);
    let worst = (0..FINGERS).max_by(|a, b| errors[*a].point_m.total_cmp(&errors[*b].point_m)).unwrap_or(0);
    let tried = format!("{} starts, {} iterations", solution.starts, solution.iterations);
    let cause = if errors[worst].point_m < 1e-6 {
        format!("parts of the hand overlap by {:.2} mm", -1e3 * solution.gap_m)
    } else {
        format!("{} misses its contact by {:.2} mm", hand.fingers[worst].name, 1e3 * errors[worst].point_m)
    };
    format!(
        "no posture found that makes these contacts: in the closest one, {cause} ({tried}); increase --starts, or move the contacts"
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
    fn run(&self, ui: Ui) -> anyhow::Result<()> {
        if self.constraints == 0 || self.lambdas == 0 {
            return Err(Usage("--constraints and --lambdas must be above 0".to_owned()).into());
        }
        let hand = self.hand.read(ui)?.hand;
        let settings = paper::Settings::default();
        let training = Training { count: self.constraints, lambdas: self.lambdas, seed: self.seed, settings };
        let bar = ui.progress_bar("training", self.constraints as u64, "constraints");
        let outcomes = training.run(&hand, self.output.as_deref(), |done| bar.set_position(done as u64))?;
        bar.finish_and_clear();
        let sequence = outcomes.sequence(self.length);
        if let Some(folder) = &self.plot {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot create the folder {}", folder.display()))?;
            output_file::write_text(
                &folder.join("figure-4.svg"),
                Syntax::Svg,
                &plot::selection(&outcomes.lambdas, &sequence),
            )?;
            output_file::write_text(&folder.join("figure-5.svg"), Syntax::Svg, &plot::accumulation(&sequence))?;
        }
        ui.print(&Trained::new(&training, &sequence))
    }
}
