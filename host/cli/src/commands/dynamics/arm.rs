//! `darm dynamics` of an arm: the load of each discrete actuator by the weights beyond it.

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::actuator::JointKind;
use serde::Serialize;

use crate::commands::subject::{Posture, Subject};
use crate::ui::{Answer, columns};

#[derive(Serialize)]
pub(super) struct ArmReport {
    name: String,
    actuators: Vec<ActuatorLoad>,
}

/// Load of a discrete actuator by the weights beyond it.
#[derive(Serialize)]
struct ActuatorLoad {
    actuator: String,
    #[serde(flatten)]
    load: Load,
}

/// A force, or the torque on a revolute joint.
#[derive(Clone, Copy, Serialize)]
#[serde(untagged)]
enum Load {
    Force { load_n: f64 },
    Torque { load_nm: f64 },
}

impl Load {
    /// Value and unit.
    fn shown(self) -> (f64, &'static str) {
        match self {
            Self::Force { load_n } => (load_n, "N"),
            Self::Torque { load_nm } => (load_nm, "N m"),
        }
    }
}

pub(super) fn of_arm(arm: &Arm, posture: &Posture, subject: &Subject) -> anyhow::Result<ArmReport> {
    let (model, mut scratch) = (&arm.model, ArmScratch::default());
    model.predict(&arm.working_condition(posture.word, &posture.q), &mut scratch)?;
    let loads = model.loads(&scratch, 0.0);
    let discrete = subject.columns().into_iter().skip(arm.n_servos());
    let actuators = discrete.zip(model.chain.actuators()).map(|(actuator, (stage, leg))| ActuatorLoad {
        load: match actuator.kind {
            JointKind::Revolute => Load::Torque { load_nm: loads[stage][leg] },
            JointKind::Prismatic => Load::Force { load_n: loads[stage][leg] },
        },
        actuator: actuator.name,
    });
    Ok(ArmReport { name: arm.name.clone(), actuators: actuators.collect() })
}

impl Answer for ArmReport {
    fn text(&self) -> String {
        let head = ["actuator", "load", ""].map(str::to_owned).to_vec();
        let rows = self.actuators.iter().map(|actuator| {
            let (load, unit) = actuator.load.shown();
            vec![actuator.actuator.clone(), format!("{load:.3}"), unit.to_owned()]
        });
        let table = columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        format!(
            "{table}\n\nloads by the weight of {} at rest; compression is positive, and a torque that increases the angle",
            self.name
        )
    }
}
