//! `darm ik`: joint positions that bring a frame of a robot to a pose.

mod all;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::euler::PoseVector;
use darm_papers::convergence::convergence;
use darm_robot::ik::{Method, Options, Status};
use darm_robot::robot::{Inverse, Robot, RobotFrame};
use serde::Serialize;

use super::subject::{Coordinate, Given, PoseReport, csv_line, frame_of};
use crate::failure::Usage;
use crate::voice::{Answer, Voice, columns, number};

const EXAMPLES: &str = "\
Examples:
  darm ik puma560.toml --to 400,150,900 --angles 180,0,90
  darm ik panda.urdf --frame panda_hand_tcp --to 450,0,400                 any orientation
  darm ik puma560.toml --to 400,150,900 --method transpose --steps 2000
  darm ik puma560.toml --to 400,150,900 --angles 180,0,90 --compare --plot convergence.svg
  darm ik puma560.toml --to 400,150,900 --angles 180,0,90 --all --picture all.svg
  darm fk puma560.toml --postures run.csv --csv > targets.csv && darm ik puma560.toml --targets targets.csv --csv

Positions are in mm, angles Z-Y-X Euler angles in deg, as `darm fk` tells them. --q is where the search starts. Limits are \
kept. A target that is not reached is no error: the status says so and the nearest posture is told.";

/// Most starts, and those of a search for all postures.
const STARTS: usize = 100;
const ALL_STARTS: usize = 1000;

/// Find joint positions that bring a frame to a pose: inverse kinematics
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Ik {
    #[command(flatten)]
    given: Given,
    /// Position of the frame in the base, mm
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, required_unless_present = "targets")]
    to: Option<String>,
    /// Its orientation: angles about z, the new y, the newest x, deg; any without it
    #[arg(long, value_name = "Z,Y,X", allow_hyphen_values = true, requires = "to")]
    angles: Option<String>,
    /// A table of targets: columns x_m, y_m, z_m (or mm) and euler_z_deg, euler_y_deg, euler_x_deg, or without
    /// orientation
    #[arg(long, value_name = "FILE.csv", conflicts_with = "to")]
    targets: Option<PathBuf>,
    /// Frame of the robot: the name of a link
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// lm (damped, with restarts: the one to take), inverse, pseudo-inverse, transpose, dls, or a population of
    /// points: em, memr, ga, de, cma-es
    #[arg(long, default_value = "lm")]
    method: Method,
    /// Every method that steps, from the same start
    #[arg(long, conflicts_with = "method")]
    compare: bool,
    /// All postures that reach the target; a sample of them where the arm can move without moving the frame
    #[arg(long, conflicts_with_all = ["method", "compare", "targets", "plot", "csv"])]
    all: bool,
    /// Most postures of such a sample
    #[arg(long, value_name = "N", default_value_t = 12, requires = "all")]
    most: usize,
    /// A picture of all postures
    #[arg(long, value_name = "FILE.svg", requires = "all")]
    picture: Option<PathBuf>,
    /// Tolerance of the position, mm
    #[arg(long, value_name = "MM", default_value_t = 0.01)]
    tolerance_mm: f64,
    /// Tolerance of the orientation, deg
    #[arg(long, value_name = "DEG", default_value_t = 0.000_573)]
    tolerance_deg: f64,
    /// Most steps from one start, 30 without it; iterations of a population, 1000 without it
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Most starts of the method that restarts, 100 without it; starts of --all, 1000 without it
    #[arg(long, value_name = "N")]
    starts: Option<usize>,
    /// Seed of the starts
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// How the error falls, of the first target
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Comma-separated values on the standard output
    #[arg(long)]
    csv: bool,
}

/// A pose to reach, whose orientation may not count.
pub(super) struct Target {
    pub(super) pose: Pose<f64>,
    pub(super) is_oriented: bool,
}

#[derive(Serialize)]
struct Report {
    name: String,
    frame: String,
    joints: Vec<String>,
    answers: Vec<Found>,
    #[serde(skip)]
    shown: Vec<Coordinate>,
    #[serde(skip)]
    csv: bool,
}

#[derive(Serialize)]
struct Found {
    target: usize,
    method: &'static str,
    status: &'static str,
    q: Vec<f64>,
    error_m: f64,
    /// Where the orientation counts.
    error_rad: Option<f64>,
    steps: usize,
    starts: usize,
    pose: PoseReport,
}

impl Ik {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let subject = self.given.subject()?;
        let (postures, _) = self.given.postures(&subject)?;
        let shown = subject.coordinates();
        let robot = subject.into_robot("ik")?;
        let frame = frame_of(&robot, self.frame.as_deref())?;
        let targets = match (&self.targets, &self.to) {
            (Some(path), _) => read(path)?,
            (None, to) => vec![Target::typed(to.as_deref().unwrap_or_default(), self.angles.as_deref())?],
        };
        let methods = if self.compare { Method::STEPS.to_vec() } else { vec![self.method] };
        if self.all {
            let (Some(target), Some(posture)) = (targets.first(), postures.first()) else { return Ok(()) };
            return self.tell_all(&robot, frame, target, &posture.q, shown, voice);
        }
        let bar = voice.bar("solving", targets.len() as u64, "targets");
        let (mut answers, mut drawn) = (Vec::new(), Vec::new());
        for (index, target) in targets.iter().enumerate() {
            let start = postures.get(index).or(postures.first()).map_or(&[][..], |posture| &posture.q);
            for method in &methods {
                let inverse = self.solve(&robot, frame, target, *method, start)?;
                answers.push(found(index, target, *method, &inverse));
                if index == 0 {
                    drawn.push((*method, inverse.history));
                }
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.plot {
            let histories: Vec<_> = drawn.iter().map(|(method, history)| (*method, &history[..])).collect();
            let scale = if targets.first().is_some_and(|target| target.is_oriented) { 0.5 } else { 0.0 };
            std::fs::write(path, convergence(&histories, scale))
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        let joints = shown.iter().map(|joint| joint.name.clone()).collect();
        voice.tell(&Report {
            name: robot.name.clone(),
            frame: frame.name.clone(),
            joints,
            answers,
            shown,
            csv: self.csv,
        })
    }

    fn solve(
        &self,
        robot: &Robot,
        frame: &RobotFrame,
        target: &Target,
        method: Method,
        start: &[f64],
    ) -> anyhow::Result<Inverse> {
        let options = self.options(target, method.usual_steps(), STARTS);
        Ok(robot.inverse(method, frame, &target.pose, start, &options)?)
    }

    fn options(&self, target: &Target, steps: usize, starts: usize) -> Options<f64> {
        Options {
            position_m: 1e-3 * self.tolerance_mm,
            orientation_rad: if target.is_oriented { self.tolerance_deg.to_radians() } else { f64::INFINITY },
            steps: self.steps.unwrap_or(steps),
            starts: self.starts.unwrap_or(starts),
            seed: self.seed,
            ..Options::default()
        }
    }
}

impl Target {
    /// From what was typed: mm and deg.
    pub(super) fn typed(to: &str, angles: Option<&str>) -> Result<Self, Usage> {
        let position = three(to, "--to")? * 1e-3;
        let angles = angles.map(|angles| three(angles, "--angles")).transpose()?;
        let is_oriented = angles.is_some();
        let angles = angles.map_or(Vec3::zeros(), |angles| angles.map(f64::to_radians));
        Ok(Self { pose: Pose::from(&PoseVector { angles, position }), is_oriented })
    }
}

fn three(text: &str, option: &str) -> Result<Vec3<f64>, Usage> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|cell| cell.trim().parse::<f64>()).collect();
    match numbers.as_deref() {
        Ok([a, b, c]) if [a, b, c].iter().all(|number| number.is_finite()) => Ok(Vec3::new(*a, *b, *c)),
        _ => Err(Usage(format!("{option} {text}: write three numbers with commas between them"))),
    }
}

/// Targets of a table.
fn read(path: &Path) -> anyhow::Result<Vec<Target>> {
    let shown = path.display();
    let mut table =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).with_context(|| format!("{shown}"))?;
    let header = table.headers().with_context(|| format!("{shown}"))?.clone();
    let column = |names: &[(&str, f64)]| {
        names.iter().find_map(|(name, factor)| Some((header.iter().position(|column| column == *name)?, *factor)))
    };
    let position = ["x", "y", "z"].map(|axis| column(&[(&format!("{axis}_m"), 1.0), (&format!("{axis}_mm"), 1e-3)]));
    let angles = ["z", "y", "x"].map(|axis| {
        column(&[(&format!("euler_{axis}_deg"), std::f64::consts::PI / 180.0), (&format!("euler_{axis}_rad"), 1.0)])
    });
    let [Some(x), Some(y), Some(z)] = position else {
        let present = header.iter().collect::<Vec<_>>().join(", ");
        return Err(Usage(format!("{shown}: columns x_m, y_m, z_m (or mm) are needed; the file has {present}")).into());
    };
    let mut targets = Vec::new();
    for (row, record) in table.records().enumerate() {
        let record = record.with_context(|| format!("{shown}"))?;
        let number = |(index, factor): (usize, f64)| {
            let cell = record.get(index).unwrap_or_default();
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            let wrong = || Usage(format!("{shown}: line {}: `{cell}` is no number", row + 2));
            number.map(|number| number * factor).ok_or_else(wrong)
        };
        let position = Vec3::new(number(x)?, number(y)?, number(z)?);
        let (angles, is_oriented) = match angles {
            [Some(a), Some(b), Some(c)] => (Vec3::new(number(a)?, number(b)?, number(c)?), true),
            _ => (Vec3::zeros(), false),
        };
        targets.push(Target { pose: Pose::from(&PoseVector { angles, position }), is_oriented });
    }
    if targets.is_empty() { Err(Usage(format!("{shown}: no rows")).into()) } else { Ok(targets) }
}

fn found(index: usize, target: &Target, method: Method, inverse: &Inverse) -> Found {
    let status = match inverse.status {
        Status::Reached => "reached",
        Status::OutOfReach => "out-of-reach",
        Status::NotConverged => "not-converged",
    };
    Found {
        target: index + 1,
        method: method.name(),
        status,
        q: inverse.q.clone(),
        error_m: inverse.error_m,
        error_rad: target.is_oriented.then_some(inverse.error_rad),
        steps: inverse.steps,
        starts: inverse.starts,
        pose: (&inverse.pose).into(),
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        if self.csv {
            let joints = self.shown.iter().map(|joint| format!("{}_{}", joint.name, joint.unit()));
            let head = ["target", "method", "status"].into_iter().map(str::to_owned).chain(joints);
            let head = csv_line(head.chain(["error_mm", "error_deg", "steps", "starts"].map(str::to_owned)));
            let rows = self.answers.iter().map(|found| {
                let q = found.q.iter().zip(&self.shown).map(|(q, joint)| format!("{:?}", joint.shown(*q)));
                let angle = found.error_rad.map_or(String::new(), |error| format!("{:e}", error.to_degrees()));
                let errors = [format!("{:e}", 1e3 * found.error_m), angle];
                let head = [found.target.to_string(), found.method.to_owned(), found.status.to_owned()];
                let counts = [found.steps.to_string(), found.starts.to_string()];
                csv_line(head.into_iter().chain(q).chain(errors).chain(counts))
            });
            return std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n");
        }
        let units = self.shown.iter().map(|joint| format!("{}, {}", joint.name, joint.unit()));
        let head = ["target", "method", "", "error", "", "steps", "starts"].into_iter().map(str::to_owned);
        let rows = self.answers.iter().map(|found| {
            let q = found.q.iter().zip(&self.shown).map(|(q, joint)| number(joint.shown(*q), 3));
            let told = [
                found.target.to_string(),
                found.method.to_owned(),
                found.status.to_owned(),
                format!("{:.1e} mm", 1e3 * found.error_m),
                found.error_rad.map_or(String::new(), |error| format!("{:.1e} deg", error.to_degrees())),
                found.steps.to_string(),
                found.starts.to_string(),
            ];
            told.into_iter().chain(q).collect()
        });
        columns(&std::iter::once(head.chain(units).collect()).chain(rows).collect::<Vec<_>>())
    }
}
