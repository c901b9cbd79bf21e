//! `darm jacobian --euler`: the Jacobian of Euler angles and position, and where it does not exist.

use darm_robot::robot::Kinematics;
use darm_robot::robot::euler::{Analytic, EulerAxes};
use serde::Serialize;

use crate::ui::{columns, number};

/// The pose vector (α, β, γ, x, y, z) and how it moves.
#[derive(Serialize)]
pub(super) struct Euler {
    axes: String,
    angles_rad: [f64; 3],
    /// det E of ω = E (α̇, β̇, γ̇): ± cos β or ± sin β, 0 where the angles are singular.
    determinant: f64,
    is_singular: bool,
    /// Six rows: rates of the angles per rad or m, then of the position; absent where the angles are singular.
    #[serde(skip_serializing_if = "Option::is_none")]
    jacobian_euler: Option<Vec<Vec<f64>>>,
    /// Rates of the angles for the joint velocities.
    #[serde(skip_serializing_if = "Option::is_none")]
    rates_rad_s: Option<[f64; 3]>,
}

impl Euler {
    pub(super) fn new(kinematics: &Kinematics, axes: EulerAxes, qd: Option<&[f64]>) -> Self {
        let Analytic { angles_rad, determinant, jacobian } = kinematics.analytic(axes);
        let rates = jacobian.as_ref().zip(qd).map(|(jacobian, qd)| {
            std::array::from_fn(|row| jacobian.row(row).iter().zip(qd).map(|(entry, qd)| entry * qd).sum())
        });
        Self {
            axes: axes.to_string(),
            angles_rad: angles_rad.into(),
            determinant,
            is_singular: jacobian.is_none(),
            jacobian_euler: jacobian
                .map(|jacobian| jacobian.row_iter().map(|row| row.iter().copied().collect()).collect()),
            rates_rad_s: rates,
        }
    }

    pub(super) fn text(&self, names: &[String]) -> String {
        let degrees = |angles: [f64; 3]| angles.map(|angle| number(angle.to_degrees(), 3)).join(" ");
        let mut text = format!("{} Euler angles α β γ: {} deg", self.axes, degrees(self.angles_rad));
        let Some(jacobian) = &self.jacobian_euler else {
            text += "\nthe angles are singular here: the first and the third axis are parallel, and the rates of α and γ do not \
                     exist; choose other axes, such as zyz instead of zyx";
            return text;
        };
        let head = std::iter::once(String::new()).chain(names.iter().cloned()).collect();
        let rows = jacobian.iter().zip(["α", "β", "γ", "x", "y", "z"]).map(|(row, name)| {
            std::iter::once(name.to_owned()).chain(row.iter().map(|entry| number(*entry, 4))).collect()
        });
        let table: Vec<Vec<String>> = std::iter::once(head).chain(rows).collect();
        text += &format!(
            "\nJacobian of angles and position, per rad or m; determinant of the angles' axes {}\n{}",
            number(self.determinant, 4),
            columns(&table)
        );
        if let Some(rates) = self.rates_rad_s {
            text += &format!("\nrates of the angles: {} deg/s", degrees(rates));
        }
        text
    }
}
