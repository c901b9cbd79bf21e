//! `darm fk`: where the tool of an arm, or any frame of a robot, stands.

use serde::Serialize;

use super::subject::{Given, PoseReport, Subject, csv_line};
use crate::voice::{Answer, Voice, columns, number};

const EXAMPLES: &str = "\
Examples:
  darm fk planar4.toml --word 010110011101
  darm fk hybrid.toml --word 010110011101 --q 20          a servo at 20 deg
  darm fk panda.urdf --q 0,30,0,-90,0,90,45 --lock panda_finger_joint1=0 --lock panda_finger_joint2=0
  darm fk puma560.toml --q 10,20,30,40,50,60 --all        every frame
  darm fk panda.urdf --postures run.csv --csv > poses.csv

Angles are Z-Y-X Euler angles: about z, the new y, the newest x.";

/// Say where the tool stands: forward kinematics
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Fk {
    #[command(flatten)]
    given: Given,
    /// Frame of a robot: the name of a link
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// Every frame of a robot
    #[arg(long, conflicts_with = "frame")]
    all: bool,
    /// Comma-separated values on the standard output
    #[arg(long)]
    csv: bool,
}

#[derive(Serialize)]
struct Report {
    name: String,
    poses: Vec<Row>,
    #[serde(skip)]
    csv: bool,
}

#[derive(Serialize)]
struct Row {
    posture: usize,
    frame: String,
    #[serde(flatten)]
    pose: PoseReport,
}

impl Fk {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let subject = self.given.subject()?;
        let (postures, notes) = self.given.postures(&subject)?;
        notes.iter().for_each(|note| voice.note(note));
        let mut poses = Vec::new();
        for (posture, numbers) in postures.iter().enumerate() {
            match &subject {
                Subject::Robot(robot) if self.all => {
                    let found = robot.poses(&numbers.q)?;
                    poses.extend(robot.frames.iter().zip(&found).map(|(frame, pose)| Row {
                        posture: posture + 1,
                        frame: frame.name.clone(),
                        pose: pose.into(),
                    }));
                }
                _ => {
                    let kinematics = subject.kinematics(self.frame.as_deref(), numbers)?;
                    let frame = subject.frame_name(self.frame.as_deref())?;
                    poses.push(Row { posture: posture + 1, frame, pose: (&kinematics.pose_base_frame).into() });
                }
            }
        }
        voice.tell(&Report { name: subject.name().to_owned(), poses, csv: self.csv })
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let cells = |row: &Row, scale: f64| {
            row.pose.position_m.map(|x| x * scale).into_iter().chain(row.pose.euler_zyx_deg).collect::<Vec<_>>()
        };
        if self.csv {
            let head = ["posture", "frame", "x_m", "y_m", "z_m", "euler_z_deg", "euler_y_deg", "euler_x_deg"];
            let rows = self.poses.iter().map(|row| {
                let numbers = cells(row, 1.0).into_iter().map(|x| format!("{x:?}"));
                csv_line([row.posture.to_string(), row.frame.clone()].into_iter().chain(numbers))
            });
            return std::iter::once(head.join(",")).chain(rows).collect::<Vec<_>>().join("\n");
        }
        let head = ["posture", "frame", "x, mm", "y, mm", "z, mm", "about z, deg", "y", "x"];
        let rows = self.poses.iter().map(|row| {
            let numbers = cells(row, 1e3).into_iter().map(|x| number(x, 3));
            [row.posture.to_string(), row.frame.clone()].into_iter().chain(numbers).collect()
        });
        columns(&std::iter::once(head.map(str::to_owned).to_vec()).chain(rows).collect::<Vec<_>>())
    }
}
