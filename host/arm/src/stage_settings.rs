//! The settings of a stage's actuators, and its pose in each.

use darm_core::actuator::{MAX_LEGS, Setting, Stage};
use darm_core::se::Pose;

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
    let mut settings = [Setting::of_joint(0.0); MAX_LEGS];
    for (leg, (setting, &digit)) in settings.iter_mut().zip(digits).enumerate() {
        *setting = stage.setting(leg, digit)?;
    }
    stage.pose(&settings).ok()
}
