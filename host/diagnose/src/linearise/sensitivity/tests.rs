//! Derivatives are those of the predictions.

use std::path::Path;

use super::*;
use crate::linearise::arm_candidates;
use crate::measurement_plan::{as_run, candidates};
use darm_arm::arm::Arm;

#[test]
fn columns_are_differences_of_residuals() {
    let text = include_str!("../../../../../examples/planar4.toml");
    let arm = Arm::parse(Path::new("planar4.toml"), text).unwrap();
    let steps: Vec<_> = candidates(&arm, 3).into_iter().take(20).collect();
    let observations = Observations::new(&arm, &as_run(&arm, &steps, 5.4e5, 303.15), [1.0; 6], |_| true);
    let mut scratch = ArmScratch::default();
    let sensitivity = Sensitivity::new(&arm.model, &observations, &mut scratch).unwrap();
    for effect in arm_candidates::all(&arm.model) {
        let mut model = arm.model.clone();
        model.effects.push(effect).unwrap();
        for value in 0..effect.values().len() {
            model.effects[0] = effect;
            let mut at = |step: f64| {
                model.effects[0].values_mut()[value] = step;
                observations.residuals(&model, &mut scratch).unwrap()
            };
            // Forces are some 100 N and squares of times some 1000 s²: such steps move the tool as far as the others' do.
            let by_square_of_time = effect.quantities()[value].unit == "m/s²";
            let step = if effect.bears_load() || by_square_of_time { 1e-9 } else { 1e-6 };
            let (up, down) = (at(step), at(-step));
            let zeros = vec![0.0; up.len()];
            let column = sensitivity.column(&effect, value).unwrap_or(zeros);
            let scale = column.iter().fold(1.0, |most: f64, slope| most.max(slope.abs()));
            for (k, slope) in column.iter().enumerate() {
                let difference = (up[k] - down[k]) / (2.0 * step);
                // In units of the noise, 2e-4: rounding of 1e-15 over it and over a step of 2e-6 is 3e-6; and curvature of second
                // order in the step.
                assert!((slope - difference).abs() < 1e-5 * scale, "{effect:?} {value}: {slope} {difference}");
            }
        }
    }
}
