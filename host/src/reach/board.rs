//! What a board needs to answer by itself which word is nearest: the frames of the arm's modules as records of a table.
//!
//! A module here is a run of neighbouring stages with at most 64 frames together, or one stage of any number:
//! few large modules are searched better than many small ones. What the modules behind one typically do is told beside
//! it, so that the board looks at each frame once, in the order of the table; see [`darm_core::nearest`].

use darm_core::nearest::{Coordinates, Frame, typical};
use darm_core::se::Pose;
use darm_core::table::Record;
use darm_core::units::Word;

use super::ReachError;
use super::frames::{self, Frames};
use crate::arm::Arm;

/// Most frames of stages that make a module together.
const MAX_FRAMES: usize = 64;
/// Most actuators of a module: two bits each.
const MAX_ACTUATORS: usize = 8;

/// The modules of `arm` and their frames, by its geometry without effects.
///
/// Fails where a stage cannot be assembled, and for an arm with servo joints: its frames depend on their angles.
pub fn records(arm: &Arm) -> Result<Vec<Record>, ReachError> {
    if arm.n_servos() > 0 {
        return Err(ReachError::Servos);
    }
    let modules = modules(frames::of_stages(arm, &[], |_, _| true)?);
    let mut first = 0;
    let framed = modules.iter().map(|module| {
        let mut frames: Vec<Frame<f64>> = module
            .poses
            .iter()
            .zip(&module.words)
            .map(|(pose, word)| Frame { digits: packed(word, first, module.digits), pose: *pose })
            .collect();
        frames.sort_by_key(|frame| frame.digits);
        first += module.digits;
        (module.digits as u8, frames)
    });
    let framed: Vec<_> = framed.collect();
    let mut behind = Pose::identity();
    let mut records = Vec::new();
    for (actuators, frames) in framed.iter().rev() {
        let module = Record::Module {
            actuators: *actuators,
            length_scale_m: arm.length_scale_m as f32,
            behind: Coordinates::of(&behind),
        };
        let frame = |frame: &Frame<f64>| Record::Frame { digits: frame.digits, pose: Coordinates::of(&frame.pose) };
        records.splice(0..0, std::iter::once(module).chain(frames.iter().map(frame)));
        behind = typical(frames) * behind;
    }
    Ok(records)
}

/// Neighbouring stages together.
fn modules(stages: Vec<Frames>) -> Vec<Frames> {
    let mut modules: Vec<Frames> = Vec::new();
    for stage in stages {
        match modules.last_mut() {
            Some(last) if last.len() * stage.len() <= MAX_FRAMES && last.digits + stage.digits <= MAX_ACTUATORS => {
                *last = last.times(&stage);
            }
            _ => modules.push(stage),
        }
    }
    modules
}

/// Two bits for each digit of a module, the first in the lowest.
fn packed(word: &Word, first: usize, digits: usize) -> u16 {
    (0..digits).fold(0, |packed, k| packed | u16::from(word.digit(first + k)) << (2 * k))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::nearest::Beam;
    use darm_core::table::{Checker, TableError};

    use super::*;
    use crate::arm::ArmScratch;
    use crate::plan::{Visit, plan};

    fn arm(name: &str) -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name)).unwrap()
    }

    /// The word that the records lead to.
    fn found(records: &[Record], digits: usize, target: &Pose<f64>) -> (Word, f32) {
        let mut beam = Beam::<f32, 32>::default();
        beam.begin(&target.cast(), digits);
        for record in records {
            match record {
                Record::Module { actuators, length_scale_m, behind } => {
                    beam.module(*actuators, &behind.pose(), *length_scale_m);
                }
                Record::Frame { digits, pose } => beam.offer(&Frame { digits: *digits, pose: pose.pose() }),
                _ => {}
            }
        }
        let found = beam.found().unwrap();
        (found.word, found.distance_m)
    }

    #[test]
    fn the_frames_lead_to_the_word_that_stands_there() {
        for (name, digits) in [("planar4.toml", "010110011101"), ("serial12.toml", "010110011101")] {
            let arm = arm(name);
            let word: Word = digits.parse().unwrap();
            let target = arm.model.chain.pose_base_tool(&word, &[], &mut ArmScratch::default()).unwrap();
            let (found, distance_m) = found(&records(&arm).unwrap(), 12, &target);
            assert!(found == word && distance_m < 1e-3, "{name}: {found} {distance_m}");
        }
    }

    #[test]
    fn a_table_with_frames_passes_the_checker_of_the_board() {
        let arm = arm("spatial6.toml");
        let modules = records(&arm).unwrap();
        assert_eq!(modules.len(), 6 * 65);
        let visit = Visit { word: arm.rest(), servos_rad: vec![], dwell_s: 0.1, label: "rest".into() };
        let plan = plan(&arm, &[visit], None, &modules).unwrap();
        assert!(plan.image.bytes().len() < 12_000, "{}", plan.image.bytes().len());
        let mut checker = Checker::default();
        let module = modules[0].clone();
        assert_eq!(checker.admit(&module, None), Err(TableError::Order));
    }

    #[test]
    fn an_arm_with_servos_has_no_frames_of_its_own() {
        assert_eq!(records(&arm("planar4-hybrid.toml")), Err(ReachError::Servos));
    }
}
