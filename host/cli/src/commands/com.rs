//! `darm com`: centre of mass and its Jacobian; identification of masses, mapping of motions.

mod identify;
mod map;

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::real::Vec3;
use serde::Serialize;

use super::subject::{Posture, Subject, SubjectArgs};
use crate::failure::Usage;
use crate::ui::{Answer, Ui, columns, number};
use darm_measure::csv_text::csv_line;

const EXAMPLES: &str = "\
Examples:
  darm com panda.urdf --q 0,30,0,-90,0,90,45,0
  darm com planar5.urdf --floating              # with the base
  darm com planar4.toml --word 010110011101     # stages and payload
  darm com puma560.toml --postures puma560-postures.csv --csv > com.csv
  darm com identify planar5.urdf planar5-postures.csv   # masses from torques and contact wrenches

A fixed base is excluded. `darm com map` maps a person's motion on a robot.";

/// Compute the centre of mass and its Jacobian
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Com {
    #[command(subcommand)]
    other: Option<Other>,
    #[command(flatten)]
    subject: Option<SubjectArgs>,
    /// Print comma-separated values
    #[arg(long)]
    csv: bool,
}

/// Tasks about the centre of mass.
#[derive(clap::Subcommand, Debug)]
enum Other {
    Identify(identify::Identify),
    Map(map::Map),
}

#[derive(Serialize)]
struct Report {
    name: String,
    mass_kg: f64,
    joints: Vec<String>,
    postures: Vec<Row>,
    #[serde(skip)]
    csv: bool,
}

#[derive(Serialize)]
struct Row {
    com_m: [f64; 3],
    /// Three rows, per rad or m of each joint; of a robot.
    jacobian: Vec<Vec<f64>>,
    /// Three rows, per unit of the twist of a floating base, angular first.
    #[serde(skip_serializing_if = "Option::is_none")]
    base: Option<Vec<Vec<f64>>>,
}

impl Com {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        match (&self.other, &self.subject) {
            (Some(Other::Identify(command)), _) => command.run(ui),
            (Some(Other::Map(command)), _) => command.run(ui),
            (None, Some(given)) => self.report(given, ui),
            (None, None) => {
                Err(Usage("no robot; give `darm com ROBOT.urdf`, `darm com identify` or `darm com map`".into()).into())
            }
        }
    }

    fn report(&self, given: &SubjectArgs, ui: Ui) -> anyhow::Result<()> {
        let subject = given.subject()?;
        let (postures, notes) = given.postures(&subject)?;
        notes.iter().for_each(|note| ui.note(note));
        let (mut rows, mut mass_kg) = (Vec::new(), 0.0);
        for posture in &postures {
            let (mass, row) = match &subject {
                Subject::Robot(robot) => of_robot(&robot.com(&posture.q)?),
                Subject::Arm(arm) => of_arm(arm, posture)?,
            };
            mass_kg = mass;
            rows.push(row);
        }
        if mass_kg == 0.0 {
            ui.note(match &subject {
                Subject::Robot(robot) if robot.base.mass > 0.0 => {
                    "nothing with a mass moves; --floating takes the base in"
                }
                _ => "the file gives no masses",
            });
        }
        let joints = match &subject {
            Subject::Robot(_) => subject.coordinates().into_iter().map(|joint| joint.name).collect(),
            Subject::Arm(_) => Vec::new(),
        };
        ui.print(&Report { name: subject.name().to_owned(), mass_kg, joints, postures: rows, csv: self.csv })
    }
}

fn of_robot(com: &darm_robot::robot::Com) -> (f64, Row) {
    let base = com.base.map(|base| base.row_iter().map(|row| row.iter().copied().collect()).collect());
    let jacobian = com.jacobian.row_iter().map(|row| row.iter().copied().collect()).collect();
    (com.mass_kg, Row { com_m: com.position.into(), jacobian, base })
}

/// Masses of the stages and of the payload, in the posture with the model's effects.
fn of_arm(arm: &Arm, posture: &Posture) -> anyhow::Result<(f64, Row)> {
    let (model, mut scratch) = (&arm.model, ArmScratch::default());
    let tool = model.predict(&arm.working_condition(posture.word, &posture.q), &mut scratch)?;
    let stages = scratch.tops.iter().zip(&model.masses).take(model.chain.stages.len());
    let (mut mass, mut moment) = (0.0, Vec3::zeros());
    for (frame, body) in stages.chain([(&tool, &model.payload)]) {
        mass += body.mass_kg;
        moment += (*frame * body.center) * body.mass_kg;
    }
    let com = if mass > 0.0 { moment / mass } else { moment };
    Ok((mass, Row { com_m: com.into(), jacobian: Vec::new(), base: None }))
}

impl Answer for Report {
    fn text(&self) -> String {
        if self.csv {
            let rows = self.postures.iter().enumerate().map(|(index, row)| {
                csv_line(std::iter::once((index + 1).to_string()).chain(row.com_m.map(|x| format!("{x:?}"))))
            });
            return std::iter::once("posture,x_m,y_m,z_m".to_owned()).chain(rows).collect::<Vec<_>>().join("\n");
        }
        let head = ["posture", "x, mm", "y, mm", "z, mm"].map(str::to_owned).to_vec();
        let rows = self.postures.iter().enumerate().map(|(index, row)| {
            std::iter::once((index + 1).to_string()).chain(row.com_m.map(|x| number(1e3 * x, 3))).collect()
        });
        let table = columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        let mut text = format!("{:.4} kg, centre of mass in the base\n{table}", self.mass_kg);
        if let [Row { jacobian, .. }] = &self.postures[..]
            && !jacobian.is_empty()
        {
            let head = ["joint", "x", "y", "z"].map(str::to_owned).to_vec();
            let rows = self.joints.iter().enumerate().map(|(k, joint)| {
                let numbers = jacobian.iter().map(|row| number(row.get(k).copied().unwrap_or(0.0), 5));
                std::iter::once(joint.clone()).chain(numbers).collect::<Vec<_>>()
            });
            let table = columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
            text += &format!("\n\nJacobian of the centre of mass, m per rad or m\n{table}");
        }
        text
    }
}
