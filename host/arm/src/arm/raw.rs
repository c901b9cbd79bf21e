//! The arm file as it is in TOML, before it is checked.

use std::collections::BTreeMap;

use darm_robot::source::Number;
use serde::Deserialize;
use toml::Spanned;

/// What every version of the format begins with.
#[derive(Deserialize)]
pub(crate) struct RawHead {
    pub(crate) format: Spanned<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawArm {
    #[expect(dead_code, reason = "checked before, in `RawHead`")]
    format: u32,
    pub(super) name: String,
    pub(super) profile: Option<String>,
    #[serde(default)]
    pub(super) model: u32,
    #[serde(default = "default_length_scale")]
    pub(super) length_scale_m: Spanned<Number>,
    pub(super) conditions: Option<RawConditions>,
    pub(super) mount: Option<Spanned<RawPose>>,
    pub(super) tool: Option<Spanned<RawTool>>,
    #[serde(default)]
    pub(super) stage: Vec<Spanned<RawStage>>,
    #[serde(default)]
    pub(super) effect: Vec<Spanned<RawEffect>>,
}

fn default_length_scale() -> Spanned<Number> {
    Spanned::new(0..0, Number(0.5))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawConditions {
    pub(super) gravity_m_s2: Option<[Number; 3]>,
    pub(super) supply_bar: Option<Spanned<Number>>,
    pub(super) temperature_c: Option<Number>,
    pub(super) working_supply_bar: Option<Spanned<Number>>,
    pub(super) working_temperature_c: Option<Number>,
}

#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPose {
    pub(crate) position_m: Vec<Number>,
    pub(crate) angle_deg: Option<Number>,
    pub(crate) rotation_deg: Option<[Number; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTool {
    pub(super) pose: Option<Spanned<RawPose>>,
    pub(super) mass_kg: Option<Spanned<Number>>,
    pub(super) center_m: Option<[Number; 3]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawKind {
    Link,
    PlanarPlatform,
    SpatialPlatform,
    DiscreteJoint,
    Servo,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawMotion {
    Revolute,
    Prismatic,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawStage {
    pub(super) kind: Spanned<RawKind>,
    pub(super) name: Option<String>,
    pub(super) mass_kg: Option<Spanned<Number>>,
    pub(super) center_m: Option<[Number; 3]>,
    /// Of a link.
    pub(super) pose: Option<Spanned<RawPose>>,
    /// Of a platform.
    pub(super) home: Option<Spanned<RawPose>>,
    #[serde(default)]
    pub(super) leg: Vec<Spanned<RawLeg>>,
    /// Of a joint.
    pub(super) motion: Option<RawMotion>,
    pub(super) axis: Option<Spanned<[Number; 3]>>,
    pub(super) value_m: Option<Spanned<Vec<Number>>>,
    pub(super) value_deg: Option<Spanned<Vec<Number>>>,
    pub(super) output: Option<Spanned<u8>>,
    pub(super) outputs: Option<Spanned<Vec<u8>>>,
    pub(super) switch: Option<Spanned<RawSwitch>>,
    pub(super) travel_ms: Option<u16>,
    pub(super) cylinder: Option<Spanned<RawCylinder>>,
    pub(super) force: Option<Spanned<RawForce>>,
    pub(super) torque_nm: Option<Spanned<Number>>,
    /// Of a servo.
    pub(super) offset_deg: Option<Number>,
    pub(super) servo: Option<Spanned<RawServo>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLeg {
    pub(super) name: Option<String>,
    pub(super) base_m: Spanned<Vec<Number>>,
    pub(super) top_m: Spanned<Vec<Number>>,
    pub(super) length_m: Spanned<Vec<Number>>,
    pub(super) output: Option<Spanned<u8>>,
    pub(super) outputs: Option<Spanned<Vec<u8>>>,
    pub(super) switch: Option<Spanned<RawSwitch>>,
    pub(super) travel_ms: Option<u16>,
    pub(super) cylinder: Option<Spanned<RawCylinder>>,
    pub(super) force: Option<Spanned<RawForce>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCylinder {
    pub(super) bore_m: Spanned<Number>,
    pub(super) rod_m: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawForce {
    pub(super) push_n: Spanned<Number>,
    pub(super) pull_n: Spanned<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSwitch {
    pub(super) closed_in: Vec<u8>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawServo {
    pub(super) id: u8,
    pub(super) min_deg: Number,
    pub(super) max_deg: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEffect {
    pub(super) law: Spanned<String>,
    pub(super) actuator: Option<u8>,
    pub(super) module: Option<u8>,
    pub(super) state: Option<u8>,
    pub(super) plate: Option<RawPlate>,
    pub(super) other: Option<u8>,
    pub(super) servo: Option<u8>,
    pub(super) since_s: Option<Number>,
    pub(super) until_s: Option<Number>,
    pub(super) until_switches: Option<Number>,
    pub(super) dwell_s: Option<Number>,
    pub(super) along: Option<RawVariable>,
    pub(super) square: Option<bool>,
    pub(super) frame: Option<RawFrame>,
    pub(super) values: Spanned<BTreeMap<String, Number>>,
}

impl RawEffect {
    /// The constants of laws, with their keys.
    pub(super) fn constants(&self) -> [(&'static str, Option<Number>); 4] {
        [
            ("since_s", self.since_s),
            ("until_s", self.until_s),
            ("until_switches", self.until_switches),
            ("dwell_s", self.dwell_s),
        ]
    }
}

/// What a fitted term goes along, from 0 at the center to 1 at a span from there.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum RawVariable {
    Supply {
        center_pa: Number,
        span_pa: Number,
    },
    Temperature {
        center_k: Number,
        span_k: Number,
    },
    /// In rad, of a sliding joint in m.
    Servo {
        index: u8,
        center: Number,
        span: Number,
    },
    /// Actuator and state.
    Digit(u8, u8),
    /// The same of two.
    Digits((u8, u8), (u8, u8)),
    Stayed {
        actuator: u8,
        share: Number,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawFrame {
    Base,
    Tool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawPlate {
    Base,
    Top,
}
