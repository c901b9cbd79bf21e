//! The settings of a stage's actuators, its pose in each, and words of which several stages have set their digits.

use darm_core::actuator::{MAX_LEGS, Setting, Settings, Stage};
use darm_core::se::Pose;
use darm_core::units::Word;

/// The settings of a stage: a digit for each of its actuators, the first digit changing fastest.
pub(crate) fn settings(stage: &Stage<f64>) -> impl Iterator<Item = Vec<u8>> {
    let states: Vec<usize> = (0..stage.n_actuators()).map(|leg| stage.n_states(leg)).collect();
    (0..states.iter().product()).map(move |mut index: usize| {
        let digit = |n_states: &usize| {
            let digit = index % n_states;
            index /= n_states;
            digit as u8
        };
        states.iter().map(digit).collect()
    })
}

/// The pose of a stage in a setting; `None` where it cannot be assembled.
pub(crate) fn pose(stage: &Stage<f64>, digits: &[u8]) -> Option<Pose<f64>> {
    stage.pose(&setting(stage, digits)?).ok()
}

/// What each actuator of a stage is set to; `None` where one does not have the state of its digit.
pub(crate) fn setting(stage: &Stage<f64>, digits: &[u8]) -> Option<Settings<f64>> {
    let mut settings = [Setting::of_joint(0.0); MAX_LEGS];
    for (leg, (setting, &digit)) in settings.iter_mut().zip(digits).enumerate() {
        *setting = stage.setting(leg, digit)?;
    }
    Some(settings)
}

/// The word with the digits of both, where each leaves those of the other 0.
pub(crate) fn joined(a: &Word, b: &Word) -> Word {
    b.iter().enumerate().filter(|(_, digit)| *digit > 0).fold(*a, |word, (at, digit)| word.with_digit(at, digit))
}
