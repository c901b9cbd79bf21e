//! `darm jacobian`: Jacobian, singular values, manipulability, statics, and velocities in both directions.

mod euler;
mod velocity;

use darm_core::real::Vec3;
use darm_core::se::{Twist, Wrench};
use darm_core::tree::singular::{self, Ellipsoid};
use darm_robot::robot::euler::EulerAxes;
use darm_robot::robot::{Kinematics, Task};
use serde::Serialize;

use self::euler::Euler;
use self::velocity::{Forward, Inverse, TWIST_COLUMNS};
use super::subject::{Coordinate, Posture, SubjectArgs, WrenchArgs, listed, twist};
use crate::failure::Usage;
use crate::number_text::numbers;
use crate::ui::{Answer, Ui, columns, number};
use darm_measure::csv_text::csv_line;

const EXAMPLES: &str = "\
Examples:
  darm jacobian panda.urdf --frame panda_hand_tcp --q 0,30,0,-90,0,90,45,0
  darm jacobian puma560.toml --q 10,20,30,40,50,60 --external-wrench 0,0,0,0,0,-10   # 10 N down
  darm jacobian puma560.toml --q 10,20,30,40,50,60 --qd 5,0,0,0,10,0   # its twist
  darm jacobian puma560.toml --q 10,20,30,40,50,60 --twist 0,0,0,100,0,0   # the inverse
  darm jacobian planar2.toml --q 30,0 --velocity 100,0,0   # the stretched arm cannot do it
  darm jacobian puma560.toml --q 10,20,30,40,50,60 --euler zyz   # rates of Euler angles
  darm jacobian planar4.toml --word 010110011101   # one column per leg
  darm jacobian puma560.toml --postures puma560-postures.csv --csv > singular.csv

The angular rows come first. The column of a discrete actuator is the rate per m of its length or rad of its angle. \
Lengths and angles have different units, so the angular and the linear rows also get singular values of their own. \
Joint velocities are also read from the columns JOINT_deg_s and JOINT_mm_s of --postures. In a singular posture, \
--twist and --velocity give the joint velocities of least squares and what they miss; rad and m count alike there.";

/// A singular value below this share of the largest counts as zero.
const RANK: f64 = 1e-9;

/// Compute the Jacobian: columns, singular values, manipulability, statics, velocities in both directions
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Jacobian {
    #[command(flatten)]
    subject: SubjectArgs,
    /// Frame of a robot: the name of a link
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// Joint velocities, base first, in deg/s or mm/s; print the twist of the frame
    #[arg(long, value_name = "QD,QD,…", allow_hyphen_values = true, conflicts_with = "postures")]
    qd: Option<String>,
    /// Twist of the frame along the axes of the base, in deg/s, then in mm/s; print the joint velocities
    #[arg(long, value_name = "WX,WY,WZ,VX,VY,VZ", allow_hyphen_values = true)]
    twist: Option<String>,
    /// Velocity of the frame's origin along the axes of the base, in mm/s, its orientation free; print the joint velocities
    #[arg(long, value_name = "VX,VY,VZ", allow_hyphen_values = true, conflicts_with = "twist")]
    velocity: Option<String>,
    /// Print the Jacobian of Euler angles about these axes, each moved by the turns before it: zyx, zyz, …
    #[arg(long, value_name = "AXES")]
    euler: Option<EulerAxes>,
    #[command(flatten)]
    wrench: WrenchArgs,
    /// Print comma-separated values, one row per posture
    #[arg(long)]
    csv: bool,
}

#[derive(Serialize)]
struct Report {
    name: String,
    frame: String,
    columns: Vec<String>,
    postures: Vec<Row>,
    #[serde(skip)]
    shown: Vec<Coordinate>,
    #[serde(skip)]
    csv: bool,
}

#[derive(Serialize)]
struct Row {
    /// Six rows, angular first, along the axes of the base; per rad or m.
    jacobian_base: Vec<Vec<f64>>,
    /// The same along the axes of the frame itself.
    jacobian_tool: Vec<Vec<f64>>,
    full: Part,
    angular: Part,
    linear: Part,
    /// Torques (N m) or forces (N) of the joints that hold the external wrench F: τ = -Jᵀ F.
    #[serde(skip_serializing_if = "Option::is_none")]
    statics: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    forward: Option<Forward>,
    #[serde(skip_serializing_if = "Option::is_none")]
    inverse: Option<Inverse>,
    #[serde(skip_serializing_if = "Option::is_none")]
    euler: Option<Euler>,
}

/// What is requested beside the Jacobian itself.
struct Requests<'a> {
    shown: &'a [Coordinate],
    wrench: Option<Wrench<f64>>,
    twist: Option<(Twist<f64>, Task)>,
    euler: Option<EulerAxes>,
    /// Whether the postures have joint velocities.
    moves: bool,
}

/// Singular values and ellipsoids of a part of the Jacobian.
#[derive(Serialize)]
struct Part {
    singular_values: Vec<f64>,
    rank: usize,
    smallest_singular_value: f64,
    /// Yoshikawa's √det(J Jᵀ), or √det(Jᵀ J) with fewer columns than rows.
    manipulability: f64,
    /// Unit vectors along the half axes of the manipulability ellipsoid, whose lengths are the singular values.
    ellipsoid_axes: Vec<Vec<f64>>,
    /// Half axes of the force ellipsoid along the same vectors; `None` where no torque is needed.
    force_half_axes: Vec<Option<f64>>,
}

impl Jacobian {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let subject = self.subject.subject()?;
        let (mut postures, notes) = self.subject.postures(&subject)?;
        notes.iter().for_each(|note| ui.note(note));
        let frame = self.frame.as_deref();
        let shown = subject.columns();
        if let (Some(qd), [posture]) = (&self.qd, &mut postures[..]) {
            posture.qd = listed(qd, &shown, "--qd")?;
        }
        // The joints hold the opposite of what the environment exerts.
        let external = self.wrench.external()?;
        let requests = Requests {
            shown: &shown,
            wrench: external.map(|w| Wrench { moment: -w.moment, force: -w.force }),
            twist: self.wanted()?,
            euler: self.euler,
            moves: self.qd.is_some() || postures.iter().any(|posture| posture.qd.iter().any(|qd| *qd != 0.0)),
        };
        let mut rows = Vec::new();
        for posture in &postures {
            rows.push(row(&subject.kinematics(frame, posture)?, posture, &requests));
        }
        ui.print(&Report {
            name: subject.name().to_owned(),
            frame: subject.frame_name(frame)?,
            columns: shown.iter().map(|coordinate| coordinate.name.clone()).collect(),
            postures: rows,
            shown,
            csv: self.csv,
        })
    }
}

impl Jacobian {
    /// The twist for which joint velocities are requested, and which rows of it count.
    fn wanted(&self) -> Result<Option<(Twist<f64>, Task)>, Usage> {
        if let Some(text) = &self.velocity {
            let wrong = |_| Usage(format!("--velocity {text}: give three numbers, in mm/s, such as 100,0,0"));
            let speeds: [f64; 3] = numbers(text, "--velocity")?.try_into().map_err(wrong)?;
            let linear = speeds.map(|speed| 1e-3 * speed).into();
            return Ok(Some((Twist { angular: Vec3::zeros(), linear }, Task::Position)));
        }
        let twist = self.twist.as_deref().map(|text| twist(text, "--twist")).transpose()?;
        Ok(twist.map(|twist| (twist, Task::Pose)))
    }
}

fn row(kinematics: &Kinematics, posture: &Posture, requests: &Requests<'_>) -> Row {
    let count = requests.shown.len();
    let qd = requests.moves.then_some(&posture.qd[..]);
    let jacobian = &kinematics.compact_jacobian();
    let by_rows = |matrix: &darm_robot::robot::Jacobian| -> Vec<Vec<f64>> {
        (0..6).map(|row| (0..count).map(|column| matrix[(row, column)]).collect()).collect()
    };
    let (angular, linear) = (singular::rows(jacobian, &[0, 1, 2]), singular::rows(jacobian, &[3, 4, 5]));
    Row {
        jacobian_base: by_rows(&kinematics.jacobian_base),
        jacobian_tool: by_rows(&kinematics.jacobian_tool),
        full: part(&singular::manipulability_ellipsoid(jacobian), count),
        angular: part(&singular::manipulability_ellipsoid(&angular), count),
        linear: part(&singular::manipulability_ellipsoid(&linear), count),
        statics: requests.wrench.as_ref().map(|wrench| kinematics.statics(wrench)),
        forward: qd.map(|qd| Forward::new(kinematics, qd)),
        inverse: requests.twist.as_ref().map(|twist| Inverse::new(kinematics, twist, requests.shown)),
        euler: requests.euler.map(|axes| Euler::new(kinematics, axes, qd)),
    }
}

fn part<const R: usize>(ellipsoid: &Ellipsoid<f64, R>, count: usize) -> Part {
    let values = &ellipsoid.lengths[..R.min(count)];
    let tolerance = RANK * values.first().copied().unwrap_or(0.0);
    Part {
        singular_values: values.to_vec(),
        rank: values.iter().filter(|value| **value > tolerance).count(),
        smallest_singular_value: values.last().copied().unwrap_or(0.0),
        manipulability: values.iter().product(),
        ellipsoid_axes: (0..values.len()).map(|k| ellipsoid.axes.column(k).iter().copied().collect()).collect(),
        force_half_axes: values.iter().map(|value| (*value > tolerance).then(|| 1.0 / value)).collect(),
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        if self.csv {
            return self.table();
        }
        let postures: Vec<_> = self.postures.iter().enumerate().map(|(index, row)| self.one(index, row)).collect();
        postures.join("\n\n")
    }
}

impl Report {
    fn table(&self) -> String {
        let mut head: Vec<String> =
            "posture,rank,distance_to_singularity,manipulability,manipulability_angular,manipulability_linear_m3"
                .split(',')
                .map(str::to_owned)
                .collect();
        if self.postures.iter().any(|row| row.statics.is_some()) {
            let unit = |column: &Coordinate| column.load_unit().replace(' ', "").to_lowercase();
            head.extend(self.shown.iter().map(|column| format!("{}_{}", column.name, unit(column))));
        }
        if self.postures.iter().any(|row| row.forward.is_some()) {
            head.extend(TWIST_COLUMNS.map(str::to_owned));
        }
        if self.postures.iter().any(|row| row.inverse.is_some()) {
            let unit = |column: &Coordinate| if column.unit() == "deg" { "rad_s" } else { "m_s" };
            head.extend(self.shown.iter().map(|column| format!("{}_{}", column.name, unit(column))));
        }
        let rows = self.postures.iter().enumerate().map(|(index, row)| {
            let mut numbers = vec![
                row.full.smallest_singular_value,
                row.full.manipulability,
                row.angular.manipulability,
                row.linear.manipulability,
            ];
            numbers.extend(row.statics.iter().flatten());
            numbers.extend(row.forward.iter().flat_map(Forward::si));
            numbers.extend(row.inverse.iter().flat_map(|inverse| &inverse.joint_velocities).map(|rate| rate.si()));
            let numbers = numbers.iter().map(|x| format!("{x:?}"));
            csv_line([(index + 1).to_string(), row.full.rank.to_string()].into_iter().chain(numbers))
        });
        std::iter::once(csv_line(head)).chain(rows).collect::<Vec<_>>().join("\n")
    }

    fn one(&self, index: usize, row: &Row) -> String {
        let mut text = String::new();
        if self.postures.len() > 1 {
            text += &format!("posture {}\n", index + 1);
        }
        for (axes, matrix) in [("the base", &row.jacobian_base), (self.frame.as_str(), &row.jacobian_tool)] {
            let head = std::iter::once(String::new()).chain(self.columns.iter().cloned()).collect();
            let rows = matrix.iter().zip(["ωx", "ωy", "ωz", "vx", "vy", "vz"]);
            let rows = rows.map(|(row, name)| {
                std::iter::once(name.to_owned()).chain(row.iter().map(|x| number(*x, 4))).collect::<Vec<_>>()
            });
            let table: Vec<_> = std::iter::once(head).chain(rows).collect();
            text +=
                &format!("Jacobian of {} along the axes of {axes}, per rad or m\n{}\n\n", self.frame, columns(&table));
        }
        let head =
            ["", "rank", "manipulability", "smallest singular value", "singular values"].map(str::to_owned).to_vec();
        let parts = [("angular, rad", &row.angular), ("linear, m", &row.linear), ("both", &row.full)];
        let parts = parts.map(|(name, part)| {
            let values = part.singular_values.iter().map(|x| number(*x, 4)).collect::<Vec<_>>().join(" ");
            let (w, smallest) =
                (format!("{:.4e}", part.manipulability), format!("{:.4e}", part.smallest_singular_value));
            vec![name.to_owned(), part.rank.to_string(), w, smallest, values]
        });
        text += &columns(&std::iter::once(head).chain(parts).collect::<Vec<_>>());
        text += "\n\nhalf axes of the manipulability ellipsoid, m, and of the force ellipsoid, N\n";
        let axes = row.linear.ellipsoid_axes.iter().zip(&row.linear.singular_values).zip(&row.linear.force_half_axes);
        let axes = axes.map(|((axis, length), force)| {
            let direction = axis.iter().map(|x| number(*x, 3)).collect::<Vec<_>>().join(" ");
            let force = force.map_or("any".to_owned(), |force| format!("{force:.4}"));
            vec![format!("along {direction}"), format!("{length:.4}"), force]
        });
        text += &columns(&axes.collect::<Vec<_>>());
        if let Some(torques) = &row.statics {
            text += "\n\njoint torques and forces that hold the external wrench F: τ = -Jᵀ F\n";
            let rows = self.shown.iter().zip(torques);
            text += &columns(
                &rows
                    .map(|(c, t)| vec![c.name.clone(), format!("{} {}", number(*t, 4), c.load_unit())])
                    .collect::<Vec<_>>(),
            );
        }
        let more = [
            row.forward.as_ref().map(|forward| forward.text(&self.frame)),
            row.inverse.as_ref().map(|inverse| inverse.text(&self.shown)),
            row.euler.as_ref().map(|euler| euler.text(&self.columns)),
        ];
        more.iter().flatten().for_each(|part| text += &format!("\n\n{part}"));
        text
    }
}
