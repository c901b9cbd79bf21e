//! `darm com identify`: masses and centres of mass from torques and contact wrenches.

use std::path::PathBuf;

use darm_papers::identify::{self, Equations, HeldOut, Kind, LinkMass, Missing, Noise, Unknown, WRENCH_COMPONENTS};
use darm_robot::robot::Robot;
use darm_robot::robot::base_parameters::{BaseParameter, BaseParameters, Inertial};
use serde::Serialize;

use crate::commands::subject::floating;
use crate::failure::{Usage, in_table};
use crate::number_text::numbers;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::swapped_files;
use crate::ui::{Answer, Ui, columns, number};

const EXAMPLES: &str = "\
Examples:
  darm com identify planar5.urdf planar5-postures.csv   # static postures
  darm com identify planar5.urdf planar5-postures.csv -o masses.json   # for `darm com map --masses`
  darm com identify humanoid.urdf motion.csv --motion --lowpass 5      # a motion (no_run: data)

The table: JOINT_rad (or _deg) and tau_JOINT_nm of every joint; Fx_n … Mz_nm that the ground exerts on the base (z up, about \
the world's origin; in the sagittal plane Fx, Fz and My); LINK_Fx_n … on other links. Quantities that are not measured \
contribute no equation.";

/// Identify masses and centres of mass from postures or motions
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Identify {
    /// The robot with its nominal masses
    #[arg(value_name = "ROBOT.urdf|ROBOT.xml")]
    robot: PathBuf,
    /// Read one tree of the robot's file: the one that begins with this link or body
    #[arg(long, value_name = "BODY")]
    root: Option<String>,
    /// Postures, torques and contact wrenches
    #[arg(value_name = "FILE.csv")]
    samples: PathBuf,
    /// The rows are a motion, not static postures: identify all ten inertial parameters of each link, and friction
    #[arg(long)]
    motion: bool,
    /// Cut-off frequency of the low-pass on all signals of a motion, Hz
    #[arg(long, value_name = "HZ", requires = "motion")]
    lowpass: Option<f64>,
    /// Noise of the sensors (standard deviations): joint torque (N m), contact force (N), contact moment (N m)
    #[arg(long, value_name = "N_M,N,N_M", default_value = "5,5,2")]
    noise: String,
    /// Number of random splits into 90 % for the fit and 10 % held out
    #[arg(long, default_value_t = 1000)]
    splits: usize,
    /// Seed of the splits
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write the identified masses, for `darm com map --masses`
    #[arg(short, long, value_name = "MASSES.json")]
    output: Option<OutputFile>,
    /// Write a report
    #[arg(long, value_name = "FILE.html")]
    report: Option<OutputFile>,
}

/// Result of an identification.
#[derive(Serialize)]
struct Identified {
    robot: String,
    samples: usize,
    parameters: usize,
    rank: usize,
    /// Reduced chi-squared: 1 if the given noise is right.
    reduced_chi_squared: f64,
    physically_consistent: bool,
    /// Identifiable sums of parameters: nominal, identified and its standard deviation.
    base_parameters: Vec<BaseRow>,
    links: Vec<LinkMass>,
    friction: Vec<FrictionRow>,
    held_out: HeldOut,
    /// Masses that the nominal model does not declare, found on single links.
    missing: Missing,
    findings: Vec<String>,
}

/// A residual beyond this share of the noise gives a note.
const MAX_RESIDUAL: f64 = 3.0;

#[derive(Serialize)]
struct BaseRow {
    parameter: String,
    unit: &'static str,
    nominal: f64,
    identified: f64,
    sd: f64,
}

#[derive(Serialize)]
struct FrictionRow {
    parameter: String,
    unit: &'static str,
    value: f64,
    sd: f64,
}

impl Identify {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        swapped_files::refuse(&self.robot, &self.samples)?;
        let noise = self.noise()?;
        let robot = floating(&self.robot, self.root.as_deref())?;
        let kind = if self.motion { Kind::Moving } else { Kind::Static };
        let read = identify::read(&self.samples, &robot, kind, self.lowpass)?;
        let equations = Equations::new(&robot, &read.samples, &read.rows, noise, kind);
        let equations = equations.map_err(|error| in_table(&self.samples, error.line(), error))?;
        let spinner = ui.spinner("fitting");
        let fit = equations.fit(kind);
        self.check_signs(&equations, &fit)?;
        let held_out = identify::hold_out(&equations, 0.9, self.splits.max(1), self.seed);
        let tenth: Vec<usize> = if read.held_out.is_empty() {
            (0..equations.samples.len()).step_by(10).collect()
        } else {
            read.held_out.clone()
        };
        let missing = identify::missing(&robot, &equations, &tenth);
        spinner.finish_and_clear();
        let mut findings = read.findings;
        if kind == Kind::Static && robot.joints.iter().zip(&read.rows.torque).any(|(_, measured)| !measured) {
            findings.push("joints without a torque column contribute no equation".into());
        }
        if fit.scatter.sqrt() > MAX_RESIDUAL {
            findings.push(format!(
                "the residual is {} of the noise; check frames, units and signs, or increase --noise",
                number(fit.scatter.sqrt(), 1)
            ));
        }
        let identified = Identified {
            robot: robot.name.clone(),
            samples: equations.samples.len(),
            parameters: equations.unknowns.len(),
            rank: fit.rank,
            reduced_chi_squared: fit.scatter,
            physically_consistent: fit.is_possible,
            base_parameters: base_rows(&robot, &equations, &fit),
            links: identify::link_masses(&robot, &equations, &fit.values),
            friction: friction(&robot, &equations, &fit),
            held_out,
            missing,
            findings,
        };
        if let Some(path) = &self.output {
            let text = serde_json::to_string_pretty(&identified.links)?;
            output_file::write_text(path, Syntax::Json, &text)?;
        }
        if let Some(path) = &self.report {
            let page = darm_arm::draw::page::plain_page("Identified link masses", &identified.text());
            output_file::write_text(path, Syntax::Html, &page)?;
        }
        ui.print(&identified)
    }

    /// Refuses a component of the wrench whose sign is probably wrong.
    fn check_signs(&self, equations: &Equations, fit: &identify::Fit) -> anyhow::Result<()> {
        let Some((component, left)) = equations.turned(fit) else { return Ok(()) };
        anyhow::bail!(
            "{}: the sign of {} is probably wrong: reversed, the residual falls from {} to {} of the noise; give what the ground \
             exerts on the robot, about the world's origin, z up",
            self.samples.display(),
            WRENCH_COMPONENTS[component],
            number(fit.scatter.sqrt(), 1),
            number(left, 1)
        )
    }

    fn noise(&self) -> Result<Noise, Usage> {
        let numbers = numbers(&self.noise, "--noise")?;
        match numbers[..] {
            [torque_nm, force_n, moment_nm] if numbers.iter().all(|x| *x > 0.0) => {
                Ok(Noise { torque_nm, force_n, moment_nm })
            }
            _ => Err(Usage(format!("--noise {}: give three numbers above 0, such as 5,5,2", self.noise))),
        }
    }
}

fn base_rows(robot: &Robot, equations: &Equations, fit: &identify::Fit) -> Vec<BaseRow> {
    let row = |parameter| base_row(robot, equations, fit, parameter);
    equations.base_parameters().base.iter().map(row).collect()
}

/// A base parameter, as the file has it and as identified.
fn base_row(robot: &Robot, equations: &Equations, fit: &identify::Fit, parameter: &BaseParameter) -> BaseRow {
    let index = |inertial: &Inertial| equations.unknowns.iter().position(|u| *u == Unknown::Inertial(*inertial));
    let terms = std::iter::once((1.0, parameter.leading)).chain(parameter.grouped.iter().copied());
    let terms: Vec<(f64, usize)> = terms.filter_map(|(c, inertial)| Some((c, index(&inertial)?))).collect();
    let sum = |of: &dyn Fn(usize) -> f64| terms.iter().map(|(c, k)| c * of(*k)).sum::<f64>();
    let variance: f64 = terms.iter().map(|(a, i)| sum(&|j| a * fit.covariance[(*i, j)])).sum();
    BaseRow {
        parameter: BaseParameters::words(parameter, robot),
        unit: parameter.leading.unit(),
        nominal: sum(&|k| equations.nominal[k]),
        identified: sum(&|k| fit.values[k]),
        sd: variance.max(0.0).sqrt(),
    }
}

fn friction(robot: &Robot, equations: &Equations, fit: &identify::Fit) -> Vec<FrictionRow> {
    let unknowns =
        equations.unknowns.iter().enumerate().filter(|(_, unknown)| !matches!(unknown, Unknown::Inertial(_)));
    let row = |(k, unknown): (usize, &Unknown)| FrictionRow {
        parameter: unknown.words(robot),
        unit: unknown.unit(robot),
        value: fit.values[k],
        sd: fit.covariance[(k, k)].max(0.0).sqrt(),
    };
    unknowns.map(row).collect()
}

impl Answer for Identified {
    fn text(&self) -> String {
        let head = |cells: &[&str]| cells.iter().map(|cell| (*cell).to_owned()).collect::<Vec<_>>();
        let mut text = format!(
            "{}: {} samples identify {} sums of {} parameters; residual {} of the noise; {}",
            self.robot,
            self.samples,
            self.rank,
            self.parameters,
            number(self.reduced_chi_squared.sqrt(), 2),
            if self.physically_consistent {
                "physically consistent bodies"
            } else {
                "physically consistent bodies would fit worse"
            },
        );
        let mut rows = vec![head(&["identifiable sum", "unit", "nominal", "identified", "sd"])];
        rows.extend(self.base_parameters.iter().map(|row| {
            vec![
                row.parameter.clone(),
                row.unit.into(),
                number(row.nominal, 3),
                number(row.identified, 3),
                number(row.sd, 3),
            ]
        }));
        text += &format!("\n\n{}", columns(&rows));
        let mut rows = vec![head(&["held-out error of the centre of pressure, mm", "x", "y"])];
        let mm = |of: [Option<f64>; 2]| of.map(|at| at.map_or("not measured".into(), |at| number(1e3 * at, 2)));
        let named = [
            ("nominal masses", self.held_out.nominal_m),
            ("identified", self.held_out.identified_m),
            ("noise of the plate", self.held_out.noise_m),
        ];
        rows.extend(named.map(|(name, of)| std::iter::once(name.to_owned()).chain(mm(of)).collect()));
        text += &format!("\n\n{}", columns(&rows));
        if !self.friction.is_empty() {
            let mut rows = vec![head(&["friction", "unit", "identified", "sd"])];
            rows.extend(
                self.friction
                    .iter()
                    .map(|f| vec![f.parameter.clone(), f.unit.into(), number(f.value, 3), number(f.sd, 3)]),
            );
            text += &format!("\n\n{}", columns(&rows));
        }
        text += &missing(&self.missing);
        self.findings.iter().for_each(|finding| text += &format!("\nnote: {finding}"));
        text
    }
}

fn missing(missing: &Missing) -> String {
    let Some(_) = missing.named.first() else {
        return "\n\nno undeclared mass detected".into();
    };
    let mut text = String::from("\n\nundeclared masses");
    for named in &missing.named {
        let links = named.links.join(" or ");
        let (mass, sd) = (number(named.mass_kg, 2), number(named.mass_sd_kg, 2));
        text += &format!("\n  {links}: {mass} kg (sd {sd}), {}; p = {:.0e}", named.side, named.p);
    }
    let mm = |of: [f64; 2]| number(1e3 * of[0], 2);
    text += &format!(
        "\n  held-out error of the centre of pressure, x: {} → {} mm",
        mm(missing.before_m),
        mm(missing.after_m)
    );
    text
}
