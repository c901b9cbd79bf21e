//! The parameters of an arm that a synthesis alters: stops and anchors.

use darm_core::actuator::Stage;
use darm_core::chain::Parameter;
use darm_core::units::Word;

use crate::arm::Arm;

/// Every stop of every discrete actuator.
pub(super) fn stops(arm: &Arm) -> Vec<Parameter> {
    let states = |actuator: usize| 0..arm.model.chain.n_states(actuator) as u8;
    let actuators = 0..arm.n_actuators();
    actuators
        .flat_map(|actuator| states(actuator).map(move |state| Parameter::Stop { actuator: actuator as u8, state }))
        .collect()
}

/// Every coordinate of every anchor, in the plane two of each.
pub(super) fn anchors(arm: &Arm) -> Vec<Parameter> {
    let stages = &arm.model.chain.stages;
    let legs = arm.model.chain.actuators().enumerate().filter(|(_, (stage, leg))| stages[*stage].leg(*leg).is_some());
    legs.flat_map(|(actuator, (stage, _))| {
        let (actuator, axes) = (actuator as u8, if stages[stage].is_planar() { 0..2 } else { 0..3 });
        axes.flat_map(move |axis| [Parameter::BaseAnchor { actuator, axis }, Parameter::TopAnchor { actuator, axis }])
    })
    .collect()
}

pub(super) fn values(arm: &Arm, parameters: &[Parameter]) -> Vec<f64> {
    let value = |parameter: &Parameter| arm.model.chain.get(*parameter).expect("a parameter of this chain");
    parameters.iter().map(value).collect()
}

pub(super) fn is_leg(arm: &Arm, stop: &Parameter) -> bool {
    let Parameter::Stop { actuator, .. } = *stop else { return false };
    let stage = arm.model.chain.actuator(actuator.into()).map(|(stage, _)| &arm.model.chain.stages[stage]);
    matches!(stage, Some(Stage::Planar(_) | Stage::Spatial(_)))
}

pub(super) fn turns(arm: &Arm, stop: &Parameter) -> bool {
    matches!(*stop, Parameter::Stop { actuator, .. } if arm.turns(actuator.into()))
}

pub(super) fn is_used(stop: &Parameter, word: &Word) -> bool {
    match *stop {
        Parameter::Stop { actuator, state } => word.digit(actuator.into()) == state,
        _ => true,
    }
}
