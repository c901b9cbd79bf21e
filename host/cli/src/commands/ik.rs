//! `darm ik`: inverse kinematics, joint positions that bring a frame of a robot to a pose.

mod all;

use std::path::{Path, PathBuf};

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::euler::PoseVector;
use darm_papers::convergence::convergence;
use darm_robot::csv_table::{CsvError, CsvFault, CsvTable};
use darm_robot::ik::{Method, Options, Status};
use darm_robot::robot::{Inverse, Robot, RobotFrame};
use serde::Serialize;

use super::subject::{Coordinate, PoseReport, SubjectArgs, frame_of};
use crate::failure::Usage;
use crate::number_text::numbers;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::ui::{Answer, Ui, columns, number};
use darm_measure::csv_text::csv_line;

const EXAMPLES: &str = "\
Examples:
  darm ik puma560.toml --to 400,150,900 --rotation 0,180,0
  darm ik panda.urdf --frame panda_hand_tcp --to 450,0,400                 # any orientation
  darm ik puma560.toml --to 400,150,900 --method transpose --steps 2000
  darm ik puma560.toml --to 400,150,900 --rotation 0,180,0 --compare --plot convergence.svg
  darm ik puma560.toml --to 400,150,900 --rotation 0,180,0 --all --plot all.svg
  darm fk puma560.toml --postures puma560-postures.csv --csv > targets.csv
  darm ik puma560.toml --targets targets.csv --csv

Positions are in mm, orientations are rotation vectors in deg, as `darm fk` prints them. The search starts at --q and keeps \
the limits. A target that is not reached is no error: the status says so, and the posture printed is the nearest of all \
starts, a minimum of √(|Δp|² + (0.5 m·θ)²), or of the distance alone for a target without orientation. Coordinates are the \
joints that mimic no other.";

/// One degree in rad.
const DEG: f64 = std::f64::consts::PI / 180.0;
/// Default numbers of starts of one search, and of the search for all postures.
const STARTS: usize = 100;
const ALL_STARTS: usize = 1000;

/// Find joint positions that bring a frame to a pose: inverse kinematics
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Ik {
    #[command(flatten)]
    subject: SubjectArgs,
    /// Position of the frame in the base, mm
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, required_unless_present = "targets")]
    to: Option<String>,
    #[command(flatten)]
    orientation: OrientationArgs,
    /// Table of targets with the columns x_m, y_m, z_m (or _mm) and, for oriented targets, rx_deg, ry_deg, rz_deg
    #[arg(long, value_name = "FILE.csv", conflicts_with = "to")]
    targets: Option<PathBuf>,
    /// Frame of the robot: the name of a link
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// Method: lm (damped, with restarts; recommended), inverse, pseudo-inverse, transpose, dls, or a population method:
    /// em, memr, ga, de, cma-es
    #[arg(long, default_value = "lm")]
    method: Method,
    /// Compare all gradient methods from the same start
    #[arg(long, conflicts_with = "method")]
    compare: bool,
    /// Find all postures that reach the target; a sample of them where the arm has self-motion
    #[arg(long, conflicts_with_all = ["method", "compare", "targets", "csv"])]
    all: bool,
    /// Largest number of postures of such a sample
    #[arg(long, value_name = "N", default_value_t = 12, requires = "all")]
    count: usize,
    /// Tolerance of the position, mm
    #[arg(long, value_name = "MM", default_value_t = 0.01)]
    tolerance: f64,
    /// Tolerance of the orientation, deg
    #[arg(long, value_name = "DEG", default_value_t = 0.000_573)]
    angle_tolerance: f64,
    /// Largest number of steps from one start, default 30; iterations of a population method, default 1000
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Largest number of starts of lm, default 100; starts of --all, default 1000
    #[arg(long, value_name = "N")]
    starts: Option<usize>,
    /// Seed of the starts
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Plot the error of the first target over the steps; with --all the postures
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<OutputFile>,
    /// Print comma-separated values
    #[arg(long)]
    csv: bool,
}

/// The orientation of a target.
#[derive(clap::Args, Debug)]
pub(super) struct OrientationArgs {
    /// Orientation of the frame: rotation vector (axis times angle) along the axes of the base, deg; default: any
    #[arg(long, value_name = "RX,RY,RZ", allow_hyphen_values = true, requires = "to")]
    rotation: Option<String>,
}

/// A pose to reach, with or without its orientation.
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
    /// `None` for a target without orientation.
    error_rad: Option<f64>,
    #[serde(skip)]
    is_reached: bool,
    /// Whether no small motion within the limits comes nearer to the target.
    is_minimum: bool,
    steps: usize,
    starts: usize,
    pose: PoseReport,
}

impl Found {
    /// The status, and what the posture is where the target is not reached.
    fn said(&self) -> String {
        let Self { status, starts, .. } = self;
        match (self.is_reached, self.is_minimum) {
            (true, _) => (*status).into(),
            (false, true) => format!("{status}, nearest of {starts} starts"),
            (false, false) => format!("{status}, best of {starts} starts, no minimum"),
        }
    }
}

impl Ik {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let subject = self.subject.subject()?;
        let (postures, _) = self.subject.postures(&subject)?;
        let shown = subject.coordinates();
        let robot = subject.into_robot("ik")?;
        let frame = frame_of(&robot, self.frame.as_deref())?;
        let targets = match (&self.targets, &self.to) {
            (Some(path), _) => read(path)?,
            (None, Some(to)) => vec![Target::parse(to, &self.orientation)?],
            (None, None) => unreachable!("clap requires one of the two"),
        };
        let methods = if self.compare { Method::STEPS.to_vec() } else { vec![self.method] };
        if self.all {
            let (Some(target), Some(posture)) = (targets.first(), postures.first()) else { return Ok(()) };
            let found = self.all_postures(&robot, frame, target, &posture.q, ui)?;
            return ui.print(&all::All::new(&robot, frame, found, shown));
        }
        let bar = ui.progress_bar("solving", targets.len() as u64, "targets");
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
            output_file::write_text(path, Syntax::Svg, &convergence(&histories, scale))?;
        }
        let joints = shown.iter().map(|joint| joint.name.clone()).collect();
        ui.print(&Report { name: robot.name.clone(), frame: frame.name.clone(), joints, answers, shown, csv: self.csv })
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
            position_m: 1e-3 * self.tolerance,
            orientation_rad: if target.is_oriented { self.angle_tolerance.to_radians() } else { f64::INFINITY },
            steps: self.steps.unwrap_or(steps),
            starts: self.starts.unwrap_or(starts),
            seed: self.seed,
            ..Options::default()
        }
    }
}

impl Target {
    /// Parses a position in mm and an orientation in deg.
    pub(super) fn parse(to: &str, orientation: &OrientationArgs) -> Result<Self, Usage> {
        let position = three(to, "--to")? * 1e-3;
        let Some(rotation) = &orientation.rotation else {
            return Ok(Self { pose: Pose::at(position), is_oriented: false });
        };
        let rotation = three(rotation, "--rotation")?.map(f64::to_radians);
        Ok(Self { pose: Pose::new(&rotation, position), is_oriented: true })
    }
}

fn three(text: &str, option: &str) -> Result<Vec3<f64>, Usage> {
    match numbers(text, option)?[..] {
        [a, b, c] => Ok(Vec3::new(a, b, c)),
        _ => Err(Usage(format!("{option} {text}: give three numbers separated by commas"))),
    }
}

/// Reads a table of targets.
fn read(path: &Path) -> Result<Vec<Target>, CsvError> {
    let table = CsvTable::read(path)?;
    let column = |names: &[(&str, f64)]| names.iter().find_map(|(name, factor)| Some((table.column(name)?, *factor)));
    let position = ["x", "y", "z"].map(|axis| column(&[(&format!("{axis}_m"), 1.0), (&format!("{axis}_mm"), 1e-3)]));
    let angle = |name: &str| column(&[(&format!("{name}_deg"), DEG), (&format!("{name}_rad"), 1.0)]);
    let rotation = ["rx", "ry", "rz"].map(angle);
    let euler = ["euler_z", "euler_y", "euler_x"].map(angle);
    let [Some(x), Some(y), Some(z)] = position else {
        return Err(table.no_column("x_m, y_m or z_m (or _mm)"));
    };
    let is_doubled = |name: &str, [a, b]: [&str; 2]| {
        table.column(&format!("{name}_{a}")).is_some() && table.column(&format!("{name}_{b}")).is_some()
    };
    let lengths = ["x", "y", "z"].map(|name| (name, ["m", "mm"]));
    let angles = ["rx", "ry", "rz", "euler_z", "euler_y", "euler_x"].map(|name| (name, ["deg", "rad"]));
    if let Some((name, [a, b])) = lengths.into_iter().chain(angles).find(|(name, units)| is_doubled(name, *units)) {
        return Err(table.wrong(CsvFault::Row(format!("{name}_{a} and {name}_{b} are both given; remove one"))));
    }
    for (columns, names) in [(rotation, "rx, ry or rz"), (euler, "euler_z, euler_y or euler_x")] {
        if columns.iter().any(Option::is_some) && columns.iter().any(Option::is_none) {
            return Err(table.no_column(format!("{names} (_deg or _rad)")));
        }
    }
    let mut targets = Vec::new();
    for row in table.rows() {
        let number = |(column, factor): (usize, f64)| row.number(column).map(|number| number * factor);
        let position = Vec3::new(number(x)?, number(y)?, number(z)?);
        let (pose, is_oriented) = match (rotation, euler) {
            ([Some(x), Some(y), Some(z)], _) => {
                (Pose::new(&Vec3::new(number(x)?, number(y)?, number(z)?), position), true)
            }
            (_, [Some(z), Some(y), Some(x)]) => {
                let angles = Vec3::new(number(z)?, number(y)?, number(x)?);
                (Pose::from(&PoseVector { angles, position }), true)
            }
            _ => (Pose::at(position), false),
        };
        targets.push(Target { pose, is_oriented });
    }
    if targets.is_empty() { Err(table.wrong(CsvFault::Empty { what: "target" })) } else { Ok(targets) }
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
        is_reached: inverse.status == Status::Reached,
        is_minimum: inverse.is_minimum,
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
        let head =
            ["target", "method", "", "error, mm", "error, deg", "steps", "starts"].into_iter().map(str::to_owned);
        let rows = self.answers.iter().map(|found| {
            let q = found.q.iter().zip(&self.shown).map(|(q, joint)| number(joint.shown(*q), 3));
            let cells = [
                found.target.to_string(),
                found.method.to_owned(),
                found.said(),
                number(1e3 * found.error_m, 2),
                found.error_rad.map_or(String::new(), |error| number(error.to_degrees(), 2)),
                found.steps.to_string(),
                found.starts.to_string(),
            ];
            cells.into_iter().chain(q).collect()
        });
        columns(&std::iter::once(head.chain(units).collect()).chain(rows).collect::<Vec<_>>())
    }
}
