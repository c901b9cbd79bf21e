//! What an actuator gives: the force or torque by which it holds a load off its stop.

use darm_core::actuator::JointKind;
use toml::Spanned;

use super::ArmFault;
use super::quantities::{Checked, positive};
use super::raw::{RawCylinder, RawForce};
use darm_robot::source::Number;

/// What an actuator gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strength {
    /// A cylinder at the supply of the arm: its rod takes part of the area that pulls.
    Cylinder {
        /// Diameter of the piston, m.
        bore_m: f64,
        /// Diameter of the rod, m.
        rod_m: f64,
    },
    /// Forces that do not depend on the supply: of a coil, a magnet, a spring.
    Force {
        /// Force that lengthens the actuator, N.
        push_n: f64,
        /// Force that shortens it, N.
        pull_n: f64,
    },
    /// A torque about a revolute joint, the same in both directions, that does not depend on the supply.
    Torque {
        /// The torque, N·m.
        torque_nm: f64,
    },
}

impl Strength {
    /// What lengthens the actuator or turns it up, and what shortens it or turns it down, at a supply in Pa; N, or N·m of a
    /// revolute joint. Friction and the pressure behind the piston are neglected.
    pub fn push_and_pull(&self, supply_pa: f64) -> [f64; 2] {
        match *self {
            Self::Cylinder { bore_m, rod_m } => {
                let area = |diameter: f64| std::f64::consts::FRAC_PI_4 * diameter * diameter;
                [supply_pa * area(bore_m), supply_pa * (area(bore_m) - area(rod_m))]
            }
            Self::Force { push_n, pull_n } => [push_n, pull_n],
            Self::Torque { torque_nm } => [torque_nm, torque_nm],
        }
    }

    /// The line of an arm file.
    pub(super) fn line(&self) -> String {
        match *self {
            Self::Cylinder { bore_m, rod_m } => format!("cylinder = {{ bore_m = {bore_m:?}, rod_m = {rod_m:?} }}"),
            Self::Force { push_n, pull_n } => format!("force = {{ push_n = {push_n:?}, pull_n = {pull_n:?} }}"),
            Self::Torque { torque_nm } => format!("torque_nm = {torque_nm:?}"),
        }
    }
}

/// The keys by which a file says what an actuator gives.
pub(super) struct RawStrength<'a> {
    pub(super) cylinder: Option<&'a Spanned<RawCylinder>>,
    pub(super) force: Option<&'a Spanned<RawForce>>,
    pub(super) torque_nm: Option<&'a Spanned<Number>>,
}

impl RawStrength<'_> {
    /// What an actuator of this kind gives; `None` where no key says it.
    pub(super) fn check(&self, kind: JointKind) -> Checked<Option<Strength>> {
        let given = [
            ("cylinder", self.cylinder.map(Spanned::span), JointKind::Prismatic),
            ("force", self.force.map(Spanned::span), JointKind::Prismatic),
            ("torque_nm", self.torque_nm.map(Spanned::span), JointKind::Revolute),
        ];
        let mut spans = given.into_iter().filter_map(|(key, span, of)| Some((key, span?, of)));
        let Some((first, span, of)) = spans.next() else { return Ok(None) };
        if let Some((second, span, _)) = spans.next() {
            return Err((span, ArmFault::TwoStrengths { first, second }));
        }
        if of != kind {
            let of = if kind == JointKind::Revolute { "a revolute joint" } else { "an actuator that slides" };
            return Err((span, ArmFault::Useless { key: first, of }));
        }
        Ok(match (self.cylinder, self.force, self.torque_nm) {
            (Some(cylinder), ..) => Some(checked_cylinder(cylinder)?),
            (_, Some(force), _) => {
                let RawForce { push_n, pull_n } = force.get_ref();
                Some(Strength::Force { push_n: positive("push_n", push_n)?, pull_n: positive("pull_n", pull_n)? })
            }
            (_, _, Some(torque)) => Some(Strength::Torque { torque_nm: positive("torque_nm", torque)? }),
            (None, None, None) => None,
        })
    }
}

fn checked_cylinder(raw: &Spanned<RawCylinder>) -> Checked<Strength> {
    let bore_m = positive("bore_m", &raw.get_ref().bore_m)?;
    let rod_m = raw.get_ref().rod_m.map_or(0.0, |rod| rod.0);
    match (0.0..bore_m).contains(&rod_m) {
        true => Ok(Strength::Cylinder { bore_m, rod_m }),
        false => Err((raw.span(), ArmFault::Rod { rod_m, bore_m })),
    }
}

#[cfg(test)]
mod tests {
    use super::Strength;

    #[test]
    fn a_cylinder_pulls_with_the_area_around_its_rod() {
        // 32 mm at 6 bar: 482.5 N; the rod of 12 mm takes 67.9 N of it.
        let [push, pull] = Strength::Cylinder { bore_m: 0.032, rod_m: 0.012 }.push_and_pull(6e5);
        assert!((push - 482.55).abs() < 0.01 && (pull - 414.69).abs() < 0.01, "{push} {pull}");
    }
}
