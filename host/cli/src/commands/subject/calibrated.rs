//! The robot of a model of `darm diagnose`, with what a calibration found.

use anyhow::Context as _;
use darm_diagnose::effect::LawName;
use darm_diagnose::linearise::calibrated::{calibrated, with_joint_offsets};
use darm_diagnose::linearise::measured_tool::MeasuredTool;
use darm_diagnose::linearise::model::Predictor;
use darm_diagnose::linearise::model_effects::ModelEffect;
use darm_diagnose::linearise::point_contact::Points;
use darm_robot::robot::Robot;
use darm_robot::source::Source;

use super::Part;
use crate::failure::Usage;

/// The robot of a model of an experiment. Effects of a point-contact calibration are in its joints and its tool; of those of torques
/// the joint offsets.
pub(super) fn robot(source: &Source, part: Part) -> anyhow::Result<Robot> {
    let (model, _) = part.model_of(source)?;
    let shown = source.path().display();
    match model.what {
        Predictor::PointContact(robot, Points { tool, .. }) | Predictor::Tool(robot, MeasuredTool { tool, .. }) => {
            calibrated(&robot, tool.as_deref(), &model.effects).with_context(|| shown.to_string())
        }
        Predictor::Torque(robot, _) | Predictor::Wrench(robot) | Predictor::Any(robot) => {
            let is_of_link = |effect: &ModelEffect| effect.law == LawName::MassDistribution && !effect.is_carried();
            if model.effects.iter().any(is_of_link) {
                let text =
                    format!("{shown}: its effect mass-distribution changes masses: use `darm dynamics`, or the URDF");
                return Err(Usage(text).into());
            }
            with_joint_offsets(&robot, &model.effects).with_context(|| shown.to_string())
        }
        Predictor::Cylinder { .. } | Predictor::Servo => {
            Err(Usage(format!("{shown}: a model of one actuator, this command needs an arm or a robot")).into())
        }
    }
}
