//! spatial6, model 1: made by `darm model --rust` from its file.

use darm_core::actuator::{Leg, Platform, Stage};
use darm_core::chain::Chain;
use darm_core::effect::{Effect, Place};
use darm_core::model::{Mass, Model};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use heapless::Vec;

/// Geometry, masses and effects.
pub(crate) const MODEL: Model<f32, 6> = Model {
    number: 1,
    chain: Chain {
        mount: Pose {
            rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
            position: Vec3::new(0.0, 0.0, 0.0),
        },
        stages: Vec::from_array([
            Stage::Spatial(Platform {
                legs: [
                    Leg {
                        base: Vec3::new(0.2415, -0.0647, 0.0),
                        top: Vec3::new(0.1273, -0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(0.2415, 0.0647, 0.0),
                        top: Vec3::new(0.1273, 0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, 0.2415, 0.0),
                        top: Vec3::new(0.0466, 0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, 0.1768, 0.0),
                        top: Vec3::new(-0.1739, 0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, -0.1768, 0.0),
                        top: Vec3::new(-0.1739, -0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, -0.2415, 0.0),
                        top: Vec3::new(0.0466, -0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                ],
                home: Pose {
                    rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
                    position: Vec3::new(0.0, 0.0, 0.33),
                },
            }),
            Stage::Spatial(Platform {
                legs: [
                    Leg {
                        base: Vec3::new(0.2415, -0.0647, 0.0),
                        top: Vec3::new(0.1273, -0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(0.2415, 0.0647, 0.0),
                        top: Vec3::new(0.1273, 0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, 0.2415, 0.0),
                        top: Vec3::new(0.0466, 0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, 0.1768, 0.0),
                        top: Vec3::new(-0.1739, 0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, -0.1768, 0.0),
                        top: Vec3::new(-0.1739, -0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, -0.2415, 0.0),
                        top: Vec3::new(0.0466, -0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                ],
                home: Pose {
                    rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
                    position: Vec3::new(0.0, 0.0, 0.33),
                },
            }),
            Stage::Spatial(Platform {
                legs: [
                    Leg {
                        base: Vec3::new(0.2415, -0.0647, 0.0),
                        top: Vec3::new(0.1273, -0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(0.2415, 0.0647, 0.0),
                        top: Vec3::new(0.1273, 0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, 0.2415, 0.0),
                        top: Vec3::new(0.0466, 0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, 0.1768, 0.0),
                        top: Vec3::new(-0.1739, 0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, -0.1768, 0.0),
                        top: Vec3::new(-0.1739, -0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, -0.2415, 0.0),
                        top: Vec3::new(0.0466, -0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                ],
                home: Pose {
                    rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
                    position: Vec3::new(0.0, 0.0, 0.33),
                },
            }),
            Stage::Spatial(Platform {
                legs: [
                    Leg {
                        base: Vec3::new(0.2415, -0.0647, 0.0),
                        top: Vec3::new(0.1273, -0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(0.2415, 0.0647, 0.0),
                        top: Vec3::new(0.1273, 0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, 0.2415, 0.0),
                        top: Vec3::new(0.0466, 0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, 0.1768, 0.0),
                        top: Vec3::new(-0.1739, 0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, -0.1768, 0.0),
                        top: Vec3::new(-0.1739, -0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, -0.2415, 0.0),
                        top: Vec3::new(0.0466, -0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                ],
                home: Pose {
                    rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
                    position: Vec3::new(0.0, 0.0, 0.33),
                },
            }),
            Stage::Spatial(Platform {
                legs: [
                    Leg {
                        base: Vec3::new(0.2415, -0.0647, 0.0),
                        top: Vec3::new(0.1273, -0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(0.2415, 0.0647, 0.0),
                        top: Vec3::new(0.1273, 0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, 0.2415, 0.0),
                        top: Vec3::new(0.0466, 0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, 0.1768, 0.0),
                        top: Vec3::new(-0.1739, 0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, -0.1768, 0.0),
                        top: Vec3::new(-0.1739, -0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, -0.2415, 0.0),
                        top: Vec3::new(0.0466, -0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                ],
                home: Pose {
                    rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
                    position: Vec3::new(0.0, 0.0, 0.33),
                },
            }),
            Stage::Spatial(Platform {
                legs: [
                    Leg {
                        base: Vec3::new(0.2415, -0.0647, 0.0),
                        top: Vec3::new(0.1273, -0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(0.2415, 0.0647, 0.0),
                        top: Vec3::new(0.1273, 0.1273, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, 0.2415, 0.0),
                        top: Vec3::new(0.0466, 0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, 0.1768, 0.0),
                        top: Vec3::new(-0.1739, 0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.1768, -0.1768, 0.0),
                        top: Vec3::new(-0.1739, -0.0466, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                    Leg {
                        base: Vec3::new(-0.0647, -0.2415, 0.0),
                        top: Vec3::new(0.0466, -0.1739, 0.0),
                        length_m: [0.327, 0.4088, 0.0, 0.0],
                        states: 2,
                    },
                ],
                home: Pose {
                    rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
                    position: Vec3::new(0.0, 0.0, 0.33),
                },
            }),
        ]),
        tool: Pose {
            rotation: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
            position: Vec3::new(0.0, 0.0, 0.0),
        },
    },
    masses: [
        Mass { mass_kg: 0.8, center: Vec3::new(0.0, 0.0, -0.02) },
        Mass { mass_kg: 0.8, center: Vec3::new(0.0, 0.0, -0.02) },
        Mass { mass_kg: 0.8, center: Vec3::new(0.0, 0.0, -0.02) },
        Mass { mass_kg: 0.8, center: Vec3::new(0.0, 0.0, -0.02) },
        Mass { mass_kg: 0.8, center: Vec3::new(0.0, 0.0, -0.02) },
        Mass { mass_kg: 0.8, center: Vec3::new(0.0, 0.0, -0.02) },
    ],
    payload: Mass { mass_kg: 0.5, center: Vec3::new(0.0, 0.0, 0.05) },
    gravity: Vec3::new(0.0, 0.0, -9.81),
    nominal_supply: 600000.0,
    reference_temperature_k: 293.15,
    working_supply: 600000.0,
    working_temperature_k: 293.15,
    effects: Vec::from_array([
        Effect::GravitySag { at: Place::Arm, compliance_m_per_n: 2.99961e-5 },
        Effect::StrokeLoss { actuator: 2, state: 1, loss_m: 0.0039997194 },
    ]),
};
