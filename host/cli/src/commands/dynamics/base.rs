//! A floating base of `darm dynamics`: where it is, how it moves, and its rows of the equation of motion.

use darm_core::dynamics::floating::BaseMotion;
use darm_core::se::{Pose, Twist};
use darm_robot::robot::{FloatingBase, Robot, base_at_rest};
use serde::Serialize;

use crate::commands::subject::twist;
use crate::failure::Usage;
use crate::number_text::numbers;

/// Where a floating base is and how it moves; at rest in the origin by default.
#[derive(clap::Args, Debug)]
pub(super) struct BaseArgs {
    /// Position of a floating base in the world, in mm
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    base_position: Option<String>,
    /// Orientation of a floating base in the world: a rotation vector, in deg
    #[arg(long, value_name = "RX,RY,RZ", allow_hyphen_values = true)]
    base_rotation: Option<String>,
    /// Twist of a floating base along its own axes, in deg/s, then in mm/s
    #[arg(long, value_name = "WX,WY,WZ,VX,VY,VZ", allow_hyphen_values = true)]
    base_twist: Option<String>,
    /// Rates of the six numbers of its twist, in deg/s², then in mm/s²; not with --torque, which computes them
    #[arg(long, value_name = "AX,AY,AZ,X,Y,Z", allow_hyphen_values = true, conflicts_with = "torque")]
    base_twist_rate: Option<String>,
}

/// Rows of a floating base, angular first, in its frame.
#[derive(Serialize)]
pub(super) struct Base {
    /// Wrench on the base that the motion needs.
    wrench: [f64; 6],
    pub(super) mass: Vec<Vec<f64>>,
    coupling: Vec<Vec<f64>>,
    /// Coriolis matrix of base and joints, the base first.
    coriolis_matrix: Vec<Vec<f64>>,
    /// Whether the Coriolis matrix couples base and joints.
    #[serde(skip)]
    pub(super) moves: bool,
}

impl BaseArgs {
    /// The motion of the base.
    pub(super) fn motion(&self, robot: &Robot) -> Result<BaseMotion<f64>, Usage> {
        let given = [&self.base_position, &self.base_rotation, &self.base_twist, &self.base_twist_rate];
        if !robot.floating && given.iter().any(|option| option.is_some()) {
            return Err(Usage(format!(
                "the base of {} is fixed; give it --floating, or leave --base-… out",
                robot.name
            )));
        }
        let rest = base_at_rest();
        let position = three(self.base_position.as_deref(), "--base-position")?.map(|x| 1e-3 * x);
        let rotation = three(self.base_rotation.as_deref(), "--base-rotation")?.map(f64::to_radians);
        let rate = |text: &Option<String>, option: &str, otherwise: Twist<f64>| {
            text.as_deref().map_or(Ok(otherwise), |text| twist(text, option))
        };
        Ok(BaseMotion {
            pose: Pose::new(&rotation.into(), position.into()),
            twist: rate(&self.base_twist, "--base-twist", rest.twist)?,
            twist_rate: rate(&self.base_twist_rate, "--base-twist-rate", rest.twist_rate)?,
        })
    }
}

/// Three numbers; zeros by default.
fn three(text: Option<&str>, option: &str) -> Result<[f64; 3], Usage> {
    let Some(text) = text else { return Ok([0.0; 3]) };
    let wrong = |_| Usage(format!("{option} {text}: give three numbers, such as 0,0,900"));
    numbers(text, option)?.try_into().map_err(wrong)
}

impl From<&FloatingBase> for Base {
    fn from(base: &FloatingBase) -> Self {
        let (n, f) = (&base.load.moment, &base.load.force);
        let rows = |matrix: &nalgebra::DMatrix<f64>| -> Vec<Vec<f64>> {
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
        };
        Self {
            wrench: [n.x, n.y, n.z, f.x, f.y, f.z],
            mass: base.mass.row_iter().map(|row| row.iter().copied().collect()).collect(),
            coupling: rows(&base.coupling),
            coriolis_matrix: rows(&base.coriolis),
            moves: base.coriolis.rows(0, 6).iter().any(|entry| *entry != 0.0),
        }
    }
}

impl Base {
    pub(super) fn text(&self, matrix: &dyn Fn(&[Vec<f64>]) -> String) -> String {
        let [a, b, c, x, y, z] = self.wrench;
        let mut text = String::new();
        if self.moves {
            text += &format!(
                "\n\nCoriolis matrix C of base and joints, V = C (twist, q̇)\n{}",
                matrix(&self.coriolis_matrix)
            );
        }
        text + &format!("\n\nwrench on the base: {a:.3} {b:.3} {c:.3} N m, {x:.3} {y:.3} {z:.3} N")
    }
}
