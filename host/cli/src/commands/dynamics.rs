//! `darm dynamics`: inverse and forward dynamics, and the matrices of the equation of motion.

mod arm;
mod base;
mod links;

use darm_core::dynamics::floating::BaseMotion;
use darm_diagnose::linearise::torque;
use darm_robot::robot::{Accelerations, Dynamics as Equation, Motion, Robot, RobotJoint};
use serde::Serialize;

use self::arm::of_arm;
use self::base::{Base, BaseArgs};
use self::links::LinkRow;
use super::subject::{Coordinate, Effects, Posture, Subject, SubjectArgs, WrenchArgs, frame_of, listed};
use crate::failure::Usage;
use crate::number_text::numbers;
use crate::ui::{Answer, Ui, columns, number};
use darm_measure::csv_text::csv_line;

const EXAMPLES: &str = "\
Examples:
  darm dynamics puma560.toml --q 0,45,-90,0,0,0   # torques at rest
  darm dynamics puma560.toml --q 0,45,-90,0,0,0 --qd 10,20,0,0,0,0 --qdd 0,100,0,0,0,0
  darm dynamics puma560.toml --q 0,45,-90,0,0,0 --torque 0,40,5,0,0,0   # accelerations
  darm dynamics panda.urdf --external-wrench 0,0,0,0,0,-50 --frame panda_hand_tcp   # 50 N down
  darm dynamics puma560.toml --postures puma560-postures.csv --csv > torque.csv
  darm dynamics finger.xml --q 20,30   # an MJCF, with the inertia of its rotors
  darm dynamics puma560.toml --q 0,45,-90,0,0,0 --qd 10,20,0,0,0,0 --links   # link by link
  darm dynamics planar5.urdf --floating --torque 0,0,0,0   # free fall
  darm dynamics planar5.urdf --floating --base-rotation 0,10,0 --base-twist 0,20,0,100,0,0
  darm dynamics planar4.toml --word 010110011101   # load of each leg

Columns of a table: JOINT_deg, JOINT_deg_s, JOINT_deg_s2 (mm for prismatic joints; also rad and m), and JOINT_nm or JOINT_n \
for --forward. The `armature` of an MJCF is included; friction and the rotors of other files only where the model contains them as \
effects, such as a model from `darm diagnose -o`. The rows of its table are one motion, at the times in the column t_s.";

/// Compute torques, mass matrix, Coriolis matrix, gravity and energies, or accelerations from torques
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Dynamics {
    #[command(flatten)]
    subject: SubjectArgs,
    /// Velocities, base first, in deg/s or mm/s
    #[arg(long, value_name = "QD,QD,…", allow_hyphen_values = true, conflicts_with = "postures")]
    qd: Option<String>,
    /// Accelerations, in deg/s² or mm/s²
    #[arg(long, value_name = "QDD,…", allow_hyphen_values = true, conflicts_with_all = ["postures", "torque"])]
    qdd: Option<String>,
    /// Torques in N m, forces in N: forward dynamics
    #[arg(long, value_name = "T,T,…", allow_hyphen_values = true, conflicts_with = "postures")]
    torque: Option<String>,
    /// Forward dynamics with the torques in the table
    #[arg(long, requires = "postures")]
    forward: bool,
    #[command(flatten)]
    wrench: WrenchArgs,
    /// Frame that the wrench acts on: the name of a link
    #[arg(long, value_name = "LINK", requires = "WrenchArgs")]
    frame: Option<String>,
    #[command(flatten)]
    base: BaseArgs,
    /// Print velocities, accelerations, forces and moments of each link, along its own axes
    #[arg(long)]
    links: bool,
    /// Print comma-separated values: torques, or accelerations in deg/s² and mm/s²
    #[arg(long)]
    csv: bool,
}

#[derive(Serialize)]
struct Report {
    name: String,
    joints: Vec<String>,
    states: Vec<State>,
    #[serde(skip)]
    shown: Vec<Coordinate>,
    #[serde(skip)]
    csv: bool,
}

#[derive(Serialize)]
struct State {
    /// Torques or forces of the motion, N m or N.
    torque: Vec<f64>,
    /// Torques or forces of gravity alone.
    gravity: Vec<f64>,
    velocity_torque: Vec<f64>,
    /// Share of the effects of the model in `torque`.
    #[serde(skip_serializing_if = "Option::is_none")]
    effects_torque: Option<Vec<f64>>,
    mass_matrix: Vec<Vec<f64>>,
    coriolis_matrix: Vec<Vec<f64>>,
    kinetic_j: f64,
    potential_j: f64,
    /// q̈ of the given torques, rad/s² or m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    acceleration: Option<Vec<f64>>,
    /// Rate of the twist of a floating base, angular first, in its frame, rad/s² and m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    base_acceleration: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    base: Option<Base>,
    /// The recursion of Newton and Euler, link by link.
    #[serde(skip_serializing_if = "Option::is_none")]
    links: Option<Vec<LinkRow>>,
}

impl Dynamics {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let (subject, effects) = self.subject.with_effects()?;
        if effects.is_some() && (self.torque.is_some() || self.forward) {
            let what =
                "--torque and --forward: a model with effects supports inverse dynamics only; give --qd and --qdd";
            return Err(Usage(what.into()).into());
        }
        let (mut postures, notes) = self.subject.postures(&subject)?;
        notes.iter().for_each(|note| ui.note(note));
        if let (Subject::Arm(arm), [posture]) = (&subject, &postures[..]) {
            return ui.print(&of_arm(arm, posture, &subject)?);
        }
        let shown = subject.coordinates();
        let robot = subject.into_robot("dynamics --postures")?;
        if let [posture] = &mut postures[..] {
            self.complete(posture, &shown)?;
        }
        let base = self.base.motion(&robot)?;
        let load = match self.wrench.external()? {
            Some(wrench) => Some((frame_of(&robot, self.frame.as_deref())?, wrench)),
            None => None,
        };
        let mut states = postures
            .iter()
            .map(|posture| {
                let motion = Motion { state: [&posture.q, &posture.qd, &posture.qdd], load };
                self.state(&robot, &base, &motion, &posture.torque)
            })
            .collect::<anyhow::Result<Vec<State>>>()?;
        if let Some(effects) = &effects {
            add(effects, &robot, &postures, &mut states)?;
        }
        let joints = shown.iter().map(|joint| joint.name.clone()).collect();
        ui.print(&Report { name: robot.name.clone(), joints, states, shown, csv: self.csv })
    }

    /// Adds velocities, accelerations and torques of the command line.
    fn complete(&self, posture: &mut Posture, joints: &[Coordinate]) -> Result<(), Usage> {
        if let Some(qd) = &self.qd {
            posture.qd = listed(qd, joints, "--qd")?;
        }
        if let Some(qdd) = &self.qdd {
            posture.qdd = listed(qdd, joints, "--qdd")?;
        }
        if let Some(torque) = &self.torque {
            let wrong = || Usage(format!("--torque {torque}: give {} numbers, in N m and N", joints.len()));
            posture.torque = numbers(torque, "--torque")?;
            if posture.torque.len() != joints.len() {
                return Err(wrong());
            }
        }
        Ok(())
    }

    fn state(
        &self,
        robot: &Robot,
        base: &BaseMotion<f64>,
        motion: &Motion<'_>,
        torque: &[f64],
    ) -> anyhow::Result<State> {
        let equation = robot.dynamics_on(base, motion)?;
        let is_forward = self.torque.is_some() || self.forward;
        let found = if is_forward { Some(accelerations(robot, base, motion, torque)?) } else { None };
        let links = if self.links { Some(links::rows(robot, base, motion, found.as_ref())?) } else { None };
        Ok(State { links, ..state(equation, found) })
    }
}

fn accelerations(
    robot: &Robot,
    base: &BaseMotion<f64>,
    motion: &Motion<'_>,
    torque: &[f64],
) -> anyhow::Result<Accelerations> {
    if torque.is_empty() {
        return Err(Usage("the table has no torques; add columns JOINT_nm or JOINT_n".into()).into());
    }
    if let Some(found) = robot.accelerations_on(base, motion, torque)? {
        return Ok(found);
    }
    // Which mass is missing: M is singular where a joint carries none, or where the base has none to push against.
    let mass = robot.dynamics_on(base, motion)?.mass;
    let idle = robot.coordinates().enumerate().find(|(k, _)| mass[(*k, *k)] <= 0.0);
    let what = match idle {
        Some((_, joint)) => {
            let RobotJoint { name, link, .. } = &robot.joints[joint];
            format!("joint `{name}` moves no mass; give its link `{link}` one")
        }
        None if robot.floating && robot.base.mass == 0.0 => {
            let base = robot.frames.first().map_or("base", |frame| frame.name.as_str());
            format!("the floating base `{base}` has no mass; give it one")
        }
        None => "its masses are too unequal; check their units".to_owned(),
    };
    Err(anyhow::anyhow!("the mass matrix of {} is singular: {what}", robot.name))
}

/// Adds the torques of the model's effects.
fn add(effects: &Effects, robot: &Robot, postures: &[Posture], states: &mut [State]) -> anyhow::Result<()> {
    let motion: Vec<[&[f64]; 3]> = postures.iter().map(|p| [&p.q[..], &p.qd, &p.qdd]).collect();
    let times_s: Vec<f64> = postures.iter().map(|posture| posture.time_s).collect();
    let more = torque::added(robot, effects.transmission.as_ref(), &effects.known, &motion, &times_s)?;
    for (state, more) in states.iter_mut().zip(more) {
        state.torque.iter_mut().zip(&more).for_each(|(torque, more)| *torque += more);
        state.effects_torque = Some(more);
    }
    Ok(())
}

fn state(equation: Equation, acceleration: Option<Accelerations>) -> State {
    let rows = |matrix: &nalgebra::DMatrix<f64>| -> Vec<Vec<f64>> {
        matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
    };
    let base = equation.base.as_ref().map(Base::from);
    let (joints, of_base) = acceleration.map_or((None, None), |found| (Some(found.joints), found.base));
    State {
        mass_matrix: rows(&equation.mass),
        coriolis_matrix: rows(&equation.coriolis),
        torque: equation.torque,
        effects_torque: None,
        gravity: equation.gravity,
        velocity_torque: equation.velocity_torque,
        kinetic_j: equation.kinetic_j,
        // The height of a body at the origin is 0, not -0.
        potential_j: equation.potential_j + 0.0,
        acceleration: joints,
        base_acceleration: of_base.map(|rate| rate.to_vector().into()),
        base,
        links: None,
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        if self.csv {
            return self.table();
        }
        let states: Vec<_> = self.states.iter().enumerate().map(|(index, state)| self.one(index, state)).collect();
        states.join("\n\n")
    }
}

impl Report {
    fn table(&self) -> String {
        let is_forward = self.states.iter().any(|state| state.acceleration.is_some());
        let head = self.shown.iter().map(|joint| match is_forward {
            true => format!("{}_{}_s2", joint.name, joint.unit()),
            false => format!("{}_{}", joint.name, joint.load_unit().replace(' ', "").to_lowercase()),
        });
        let rows = self.states.iter().enumerate().map(|(index, state)| {
            let numbers: Vec<f64> = match &state.acceleration {
                Some(qdd) => qdd.iter().zip(&self.shown).map(|(qdd, joint)| joint.shown(*qdd)).collect(),
                None => state.torque.clone(),
            };
            csv_line(std::iter::once((index + 1).to_string()).chain(numbers.iter().map(|x| format!("{x:?}"))))
        });
        let head = csv_line(std::iter::once("posture".to_owned()).chain(head));
        std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n")
    }

    fn one(&self, index: usize, state: &State) -> String {
        let mut text = String::new();
        if self.states.len() > 1 {
            text += &format!("posture {}\n", index + 1);
        }
        let mut head = vec!["joint", "torque", "gravity", "velocity"];
        head.extend(state.effects_torque.as_ref().map(|_| "effects"));
        head.push("");
        if state.acceleration.is_some() {
            head.push("acceleration");
        }
        let mut rows = vec![head.into_iter().map(str::to_owned).collect::<Vec<_>>()];
        for (k, joint) in self.shown.iter().enumerate() {
            let of = |numbers: &[f64]| number(numbers.get(k).copied().unwrap_or(0.0), 4);
            let mut row = vec![joint.name.clone(), of(&state.torque), of(&state.gravity), of(&state.velocity_torque)];
            row.extend(state.effects_torque.as_ref().map(|more| of(more)));
            row.push(joint.load_unit().to_owned());
            if let Some(qdd) = state.acceleration.as_ref().and_then(|qdd| qdd.get(k)) {
                row.push(format!("{} {}/s²", number(joint.shown(*qdd), 3), joint.unit()));
            }
            rows.push(row);
        }
        text += &columns(&rows);
        let matrix = |rows: &[Vec<f64>]| {
            columns(&rows.iter().map(|row| row.iter().map(|x| number(*x, 4)).collect()).collect::<Vec<_>>())
        };
        match &state.base {
            // A single body that floats has no matrix but that of its base.
            Some(base) if state.mass_matrix.is_empty() => {
                text += &format!("\n\nmass matrix of the base, angular axes first\n{}", matrix(&base.mass));
            }
            _ => text += &format!("\n\nmass matrix M, per rad or m\n{}", matrix(&state.mass_matrix)),
        }
        let moves = state.velocity_torque.iter().any(|torque| *torque != 0.0);
        let base_moves = state.base.as_ref().is_some_and(|base| base.moves);
        if moves && !base_moves {
            text += &format!("\n\nCoriolis matrix C, V = C q̇\n{}", matrix(&state.coriolis_matrix));
        }
        text += &format!("\n\nkinetic energy {:.4} J, potential {:.4} J", state.kinetic_j, state.potential_j);
        text += &state.base.as_ref().map(|base| base.text(&matrix)).unwrap_or_default();
        if let Some([a, b, c, x, y, z]) = state.base_acceleration {
            let [a, b, c] = [a, b, c].map(f64::to_degrees);
            text +=
                &format!("\n\nacceleration of the floating base: {a:.2} {b:.2} {c:.2} °/s², {x:.3} {y:.3} {z:.3} m/s²");
        }
        text += &state.links.as_deref().map(links::text).unwrap_or_default();
        text
    }
}
