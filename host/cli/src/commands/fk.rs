//! `darm fk`: forward kinematics, the pose of an arm's tool or of any frame of a robot.

use serde::Serialize;

use super::subject::{PoseReport, Subject, SubjectArgs};
use crate::ui::{Answer, Ui, columns, number};
use darm_measure::csv_text::csv_line;

const EXAMPLES: &str = "\
Examples:
  darm fk planar4.toml --word 010110011101
  darm fk planar4-hybrid.toml --word 010110011101 --q 20   # the servo at 20 deg
  darm fk panda.urdf --q 0,30,0,-90,0,90,45 --lock panda_finger_joint1=0
  darm fk finger.xml --q 20,30                             # an MJCF
  darm fk puma560.toml --q 10,20,30,40,50,60 --all         # every frame
  darm fk puma560.toml --postures puma560-postures.csv --csv > poses.csv

Orientations are rotation vectors: axis times angle, along the axes of the base. --csv adds the same orientations as Z-Y-X \
Euler angles.";

/// Columns of --csv.
const CSV_COLUMNS: &str = "posture,frame,x_m,y_m,z_m,euler_z_deg,euler_y_deg,euler_x_deg,rx_deg,ry_deg,rz_deg";

/// Compute the pose of the tool: forward kinematics
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Fk {
    #[command(flatten)]
    subject: SubjectArgs,
    /// Frame of a robot: the name of a link
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// Every frame of a robot
    #[arg(long, conflicts_with = "frame")]
    all: bool,
    /// Print comma-separated values
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
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let subject = self.subject.subject()?;
        let (postures, notes) = self.subject.postures(&subject)?;
        notes.iter().for_each(|note| ui.note(note));
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
        ui.print(&Report { name: subject.name().to_owned(), poses, csv: self.csv })
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        if self.csv {
            let rows = self.poses.iter().map(|row| {
                let angles = row.pose.euler_zyx_rad.into_iter().chain(row.pose.rotation_vector_rad);
                let numbers = row.pose.position_m.into_iter().chain(angles.map(f64::to_degrees));
                let numbers = numbers.map(|x| format!("{x:?}"));
                csv_line([row.posture.to_string(), row.frame.clone()].into_iter().chain(numbers))
            });
            return std::iter::once(CSV_COLUMNS.to_owned()).chain(rows).collect::<Vec<_>>().join("\n");
        }
        let head = ["posture", "frame", "x, mm", "y, mm", "z, mm", "rx, deg", "ry, deg", "rz, deg"];
        let rows = self.poses.iter().map(|row| {
            let position = row.pose.position_m.map(|x| 1e3 * x);
            let numbers = position.into_iter().chain(row.pose.rotation_vector_rad.map(f64::to_degrees));
            let numbers = numbers.map(|x| number(x, 3));
            [row.posture.to_string(), row.frame.clone()].into_iter().chain(numbers).collect()
        });
        columns(&std::iter::once(head.map(str::to_owned).to_vec()).chain(rows).collect::<Vec<_>>())
    }
}
