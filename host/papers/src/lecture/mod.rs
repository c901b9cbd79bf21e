//! The lecture on differential kinematics and dynamics: every equation that it prints beside what this program computes.
//!
//! The equations are programmed here as they are printed, apart from the library, and compared with it in random postures:
//! the rows are the largest differences. Where an equation as printed is wrong, a second row has it corrected:
//!
//! - Puma 560, height: the sign of a₂ s₂. As printed, raising the upper arm lowers the wrist for one term and raises it for the
//!   other; with −a₂ s₂ it is the table's.
//! - Puma 560, third angle: the sign of c₄ c₅ s₆, and c₆ for s₆ in the last term.
//! - Puma 560, second angle: the inner arc tangent is of a sum; the fraction bar between its two halves is missing.
//! - Rotational joints, acceleration: ωᵢ × Pᵢ₊₁ for ω̇ᵢ × Pᵢ₊₁; sliding joints, angular acceleration: R ωᵢ for R ω̇ᵢ; centre of mass:
//!   ω × (ω + P_C) for ω × (ω × P_C). The summary of the recursion has all three right. A dot may have been lost in our copy.
//!
//! Source: DD2410 Introduction to Robotics, lecture 4; its equations are those of J. J. Craig, Introduction to Robotics.

mod draws;
mod dynamics;
mod kinematics;
pub mod pictures;

use darm_core::tree::TreeError;
use darm_robot::robot::Robot;

pub use dynamics::sliding_arm;

/// Lengths of the links of the planar arm, m.
pub(crate) const PLANAR_M: [f64; 2] = [0.5, 0.35];

/// A comparison with the lecture.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The section of the lecture.
    pub section: &'static str,
    /// What is compared.
    pub what: &'static str,
    /// The largest difference, or what the name says.
    pub value: f64,
    /// Its unit; empty for counts and ratios.
    pub unit: &'static str,
}

/// All rows in the order of the lecture, of postures drawn from this seed; `arms` are the Puma 560 and the arm whose third
/// joint slides.
///
/// # Errors
///
/// The joints of an arm make no tree that can be computed.
pub fn rows([puma, sliding]: [&Robot; 2], seed: u64) -> Result<Vec<Row>, TreeError> {
    let mut rows = kinematics::vacuum_cleaner(seed);
    rows.extend(kinematics::planar(seed)?);
    rows.extend(kinematics::puma(seed)?);
    rows.extend(kinematics::jacobians(puma, seed)?);
    rows.extend(kinematics::inverse(puma, seed)?);
    rows.extend(dynamics::statics(puma, seed)?);
    rows.extend(dynamics::inertia_tensor());
    rows.extend(dynamics::recursion([puma, sliding], seed)?);
    rows.extend(dynamics::state_space(puma, seed)?);
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn example(name: &str) -> Robot {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name);
        darm_robot::dh::read(&path).unwrap()
    }

    /// Printed equations that are wrong are off by far, all others to rounding.
    #[test]
    fn every_equation_agrees_but_those_that_are_misprinted() {
        let sliding = dynamics::sliding_arm();
        let rows = rows([&example("puma560.toml"), &sliding], 1).unwrap();
        assert!(rows.len() > 25, "{}", rows.len());
        for row in rows.iter().filter(|row| !row.section.starts_with("inverse kinematics")) {
            if row.what.ends_with("as printed, wrong") {
                assert!(row.value > 1e-2, "{row:?}");
            } else if !row.what.starts_with("counted") {
                assert!(row.value < 1e-9, "{row:?}");
            }
        }
        let reached = rows.iter().filter(|row| row.what.contains("reached of 100"));
        assert!(reached.map(|row| row.value).all(|count| count > 90.0));
    }
}
