//! The words that a table may use, by the settings that each module is in.

use darm_core::actuator::Stage;
use darm_core::units::Word;
use std::rc::Rc;

use crate::arm::Arm;
use crate::stage_settings::settings;

/// Which words the stops of an answer have to leave a pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum NeededWords {
    /// All of them: a table may use any.
    #[default]
    All,
    /// These, and those without which an arm file cannot be read: at rest and fully extended.
    These(Vec<Word>),
}

/// The settings that each stage is needed in.
#[derive(Clone, Default)]
pub(super) struct Needed {
    pub(super) stages: Rc<[Vec<Vec<u8>>]>,
}

impl Needed {
    pub(super) fn new(arm: &Arm, words: &NeededWords) -> Self {
        let chain = &arm.model.chain;
        let mut first = 0;
        let stages = chain.stages.iter().map(|stage| {
            let own = first..first + stage.n_actuators();
            first = own.end;
            match (stage, words) {
                (Stage::Planar(_) | Stage::Spatial(_), NeededWords::All) => settings(stage).collect(),
                (Stage::Planar(_) | Stage::Spatial(_), NeededWords::These(words)) => {
                    let extended: Vec<u8> = (0..own.len()).map(|leg| stage.n_states(leg) as u8 - 1).collect();
                    let mut needed = vec![vec![0; own.len()], extended];
                    needed.extend(words.iter().map(|word| own.clone().map(|actuator| word.digit(actuator)).collect()));
                    needed.sort_unstable();
                    needed.dedup();
                    needed
                }
                _ => Vec::new(),
            }
        });
        Self { stages: stages.collect() }
    }

    /// What no arm can do without: without a pose at rest and fully extended it cannot be read from its file.
    pub(super) fn by_file(arm: &Arm) -> Self {
        Self::new(arm, &NeededWords::These(Vec::new()))
    }
}
