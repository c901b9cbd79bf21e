//! `darm com map`: a person's motion on a robot, with the centre of mass as a hard constraint.

use std::path::{Path, PathBuf};

use darm_papers::identify::{LinkMass, with_masses};
use darm_papers::motion::execution::{Executed, Gains, execute};
use darm_papers::motion::mapping::{Mapped, map};
use darm_papers::motion::page::{MotionReport, motion_page};
use darm_papers::motion::person::{CopError, Person, Scale, WITHIN_M, person};
use darm_papers::motion::setup::Setup;
use darm_papers::motion::{Balance, Capture, LiftOffBy, feed_forward};
use darm_robot::robot::Robot;
use darm_robot::source::{Fault, FileError, Place, Source};
use serde::Serialize;

use crate::commands::subject::floating;
use crate::failure::in_table;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::swapped_files;
use crate::ui::{Answer, Ui, number};
use darm_measure::csv_text::csv_text;

const EXAMPLES: &str = "\
Examples:
  darm com map human.urdf robot.urdf stand.toml capture.csv --execute   # (no_run: data)

The capture: t_s, MARKER_x MARKER_y MARKER_z (m, empty where not visible) and Fz_n, Mx_nm, My_nm of all force plates together, \
z up, or of each: floor_Fz_n …, chair_Fz_n …, hands_Fz_n … for arm rests. Lift-off is read from chair_Fz_n; without it, from the \
height of the pelvis. stand.toml lists the markers, feet, seat and corresponding links; its keys are documented in \
host/papers/src/motion/setup.rs. --execute runs the motion on a simulated robot, --masses uses identified masses.";

/// Map a person's motion on a robot: centre of mass as a hard constraint, markers in the least-squares sense
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Map {
    /// Model of an average person
    #[arg(value_name = "PERSON.urdf|PERSON.xml")]
    person: PathBuf,
    /// The robot
    #[arg(value_name = "ROBOT.urdf|ROBOT.xml")]
    robot: PathBuf,
    /// Read one tree of the robot's file: the one that begins with this link or body
    #[arg(long, value_name = "BODY")]
    root: Option<String>,
    /// Markers, feet and links
    #[arg(value_name = "SETUP.toml")]
    setup: PathBuf,
    /// Markers and force plates over time
    #[arg(value_name = "CAPTURE.csv")]
    capture: PathBuf,
    /// Masses from `darm com identify -o`
    #[arg(long, value_name = "MASSES.json")]
    masses: Option<PathBuf>,
    /// Write the motion of base and joints
    #[arg(short, long, value_name = "MOTION.csv")]
    output: Option<OutputFile>,
    /// Write a report
    #[arg(long, value_name = "FILE.html")]
    report: Option<OutputFile>,
    /// Execute the motion on a simulated robot: joint PD control with feed-forward torques
    #[arg(long)]
    execute: bool,
}

#[derive(Serialize)]
struct Summary {
    robot: String,
    frames: usize,
    scale: f64,
    /// Simulated against measured centre of pressure of the person.
    person_before: CopError,
    person_after: CopError,
    scales: Vec<Scale>,
    com_error_m: f64,
    /// Horizontal deviation of the target of the centre of mass from the person's, for balance.
    com_moved_m: f64,
    /// Vertical deviation, because of the chair.
    com_raised_m: f64,
    com_axes: Vec<&'static str>,
    marker_rms_m: f64,
    lift_off_s: Option<f64>,
    lift_off_by: LiftOffBy,
    /// Largest force of the person's hands on arm rests; the robot rises without hands.
    #[serde(skip_serializing_if = "Option::is_none")]
    hands_max_n: Option<f64>,
    balance: Balance,
    #[serde(skip_serializing_if = "Option::is_none")]
    fell: Option<bool>,
    findings: Vec<String>,
}

impl Map {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        for model in [&self.person, &self.robot, &self.setup] {
            swapped_files::refuse(model, &self.capture)?;
        }
        let (average, robot) = (floating(&self.person, None)?, self.robot()?);
        let setup = Setup::read(&self.setup, &average, &robot)?;
        let capture = Capture::read(&self.capture, &setup.marker_names());
        let capture = capture.map_err(|error| in_table(&self.capture, error.line(), error))?;
        let spinner = ui.spinner("scaling the person");
        let found = person(&average, &setup.on_person(), &capture)?;
        spinner.set_message("mapping the motion");
        let mapped = map(&robot, &setup, &found, &capture)?;
        spinner.set_message("executing the motion");
        let executed = self.execute.then(|| executed(&robot, &setup, &mapped)).transpose()?;
        spinner.finish_and_clear();
        if let Some(path) = &self.output {
            output_file::write_text(path, Syntax::Csv, &motion_csv(&robot, &mapped))?;
        }
        if let Some(path) = &self.report {
            let curves = MotionReport { person: &found, mapped: &mapped, robot: &robot, executed: executed.as_ref() };
            output_file::write_text(path, Syntax::Html, &motion_page(&robot.name, &curves)?)?;
        }
        ui.print(&Summary::of(&robot, (&found, &mapped), executed.map(|executed| executed.fell), &capture))
    }

    fn robot(&self) -> anyhow::Result<Robot> {
        let robot = floating(&self.robot, self.root.as_deref())?;
        let Some(path) = &self.masses else { return Ok(robot) };
        let source = Source::read::<String>(path)?;
        let masses: Vec<LinkMass> = serde_json::from_str(source.text()).map_err(|error| no_masses(path, &error))?;
        Ok(with_masses(&robot, &masses))
    }
}

fn no_masses(path: &Path, error: &serde_json::Error) -> FileError<String> {
    let (text, place) = (error.to_string(), Place { line: error.line().max(1), column: error.column().max(1) });
    let what = text.split(" at line ").next().unwrap_or_default();
    let fault = Fault::Syntax(format!("{what}; write the masses with `darm com identify -o`"));
    FileError { path: path.into(), place: Some(place), fault }
}

fn executed(robot: &Robot, setup: &Setup, mapped: &Mapped) -> anyhow::Result<Executed> {
    let torque = feed_forward(robot, setup, mapped)?;
    Ok(execute(robot, setup, mapped, (Gains::default(), &torque))?)
}

/// Time, base and joints, frame by frame.
fn motion_csv(robot: &Robot, mapped: &Mapped) -> String {
    let head = ["t_s", "px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"].map(str::to_owned).into_iter();
    let joints = robot.joints.iter().map(|joint| format!("{}_rad", joint.name));
    let mut rows: Vec<Vec<String>> = vec![head.chain(joints).collect()];
    for (time, posture) in mapped.time_s.iter().zip(&mapped.trajectory.postures) {
        let turn = nalgebra::UnitQuaternion::from_matrix(&posture.base.rotation);
        let place = posture.base.position;
        let base = [*time, place.x, place.y, place.z, turn.i, turn.j, turn.k, turn.w];
        rows.push(base.iter().chain(&posture.q).map(|number| format!("{number:.9}")).collect());
    }
    csv_text(rows)
}

impl Summary {
    fn of(robot: &Robot, (person, mapped): (&Person, &Mapped), fell: Option<bool>, capture: &Capture) -> Self {
        let free = |k: &usize| !mapped.axes[*k];
        let mut findings = capture.findings.clone();
        if person.after.worst_m > WITHIN_M {
            findings.push(format!(
                "largest error of the person's centre of pressure: {} mm, more than {} mm; check that plates and markers share one \
                 frame and one clock",
                number(1e3 * person.after.worst_m, 0),
                number(1e3 * WITHIN_M, 0)
            ));
        }
        if mapped.lift_off_by == LiftOffBy::PelvisHeight {
            findings.push(
                "lift-off is read from the height of the pelvis, which rises early when the pelvis rolls; add the column \
                 chair_Fz_n"
                    .into(),
            );
        }
        let hands = capture.hands_n.as_ref().map(|forces| forces.iter().copied().fold(0.0, f64::max));
        if let Some(force) = hands {
            findings.push(format!(
                "the person's hands push with up to {} N; the robot rises without hands",
                number(force, 0)
            ));
        }
        findings.extend((0..3).filter(free).map(|k| {
            format!("the robot cannot move its centre of mass along {}: unconstrained there", ["x", "y", "z"][k])
        }));
        Self {
            robot: robot.name.clone(),
            frames: mapped.time_s.len(),
            scale: mapped.scale,
            person_before: person.before,
            person_after: person.after,
            scales: person.scales.clone(),
            com_error_m: mapped.com_error_m,
            com_moved_m: mapped.moved_m,
            com_raised_m: mapped.raised_m,
            com_axes: (0..3).filter(|k| mapped.axes[*k]).map(|k| ["x", "y", "z"][k]).collect(),
            marker_rms_m: mapped.trajectory.marker_rms_m,
            lift_off_s: mapped.time_s.get(mapped.lift_off).copied(),
            lift_off_by: mapped.lift_off_by,
            hands_max_n: hands,
            balance: mapped.balance.clone(),
            fell,
            findings,
        }
    }
}

impl Answer for Summary {
    fn text(&self) -> String {
        let mm = |at: f64| number(1e3 * at, 1);
        let mut text = format!(
            "{}: {} frames, the person's motion scaled by {}\n\
             person: largest error of the simulated centre of pressure {} mm, {} mm after scaling\n\
             centre of mass constrained along {}, error up to {:.1e} m; markers {} mm (RMS)\n\
             smallest margin: zero-moment point {} mm (frame {}), centre of mass {} mm (frame {})",
            self.robot,
            self.frames,
            number(self.scale, 3),
            mm(self.person_before.worst_m),
            mm(self.person_after.worst_m),
            self.com_axes.join(", "),
            self.com_error_m,
            mm(self.marker_rms_m),
            mm(self.balance.zmp_margin_m),
            self.balance.zmp_frame,
            mm(self.balance.com_margin_m),
            self.balance.com_frame,
        );
        if let Some(lift_off) = self.lift_off_s {
            let by = match self.lift_off_by {
                LiftOffBy::ChairForce => "force of the chair",
                LiftOffBy::PelvisHeight => "height of the pelvis",
            };
            text += &format!("\nlift-off from the chair at {} s, by the {by}", number(lift_off, 2));
        }
        text += &format!(
            "\ncentre of mass deviates from the person's by up to {} mm horizontally, for balance, and {} mm vertically, on the chair",
            mm(self.com_moved_m),
            mm(self.com_raised_m)
        );
        if self.balance.zmp_margin_m < 0.0 {
            text += &format!(
                "\nthe zero-moment point leaves the support polygon, most in frame {}; slow the motion down",
                self.balance.zmp_frame
            );
        }
        match self.fell {
            Some(true) => text += "\nexecuted: the robot falls",
            Some(false) => text += "\nexecuted: the robot does not fall",
            None => {}
        }
        self.findings.iter().for_each(|finding| text += &format!("\nnote: {finding}"));
        text
    }
}
