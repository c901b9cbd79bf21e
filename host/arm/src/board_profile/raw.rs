//! The keys of a profile's file, as they are read.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawProfile {
    pub(super) format: Spanned<u32>,
    pub(super) name: String,
    pub(super) ambient_c: Option<Spanned<f64>>,
    pub(super) rated_c: Option<Spanned<f64>>,
    pub(super) derate_percent_per_k: Option<Spanned<f64>>,
    pub(super) supply: Spanned<RawSupply>,
    pub(super) emergency_stop: Option<Spanned<RawEmergencyStop>>,
    pub(super) board: Option<Spanned<String>>,
    pub(super) min_board_supply_mv: Option<Spanned<u16>>,
    pub(super) chain: Option<RawChain>,
    #[serde(default)]
    pub(super) pins: BTreeMap<String, Spanned<RawPins>>,
    #[serde(default)]
    pub(super) output: Vec<Spanned<RawOutput>>,
    #[serde(default)]
    pub(super) servo: Vec<Spanned<RawServo>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSupply {
    pub(super) new_outputs: u8,
    pub(super) window_ms: u16,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawChain {
    pub(super) chips: Spanned<u8>,
}

/// The pin of a function, or those of the inputs in order.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum RawPins {
    One(String),
    Several(Vec<String>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEmergencyStop {
    pub(super) input: u8,
    pub(super) opens: bool,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawDrive {
    Hold,
    PeakHold,
    Latch,
}

impl RawDrive {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::PeakHold => "peak-hold",
            Self::Latch => "latch",
        }
    }

    pub(super) fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Hold => &["line"],
            Self::PeakHold => &["pull", "hold", "peak_ms"],
            Self::Latch => &["set", "reset", "pulse_ms"],
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOutput {
    pub(super) number: u8,
    pub(super) drive: RawDrive,
    pub(super) line: Option<Spanned<u8>>,
    pub(super) pull: Option<Spanned<u8>>,
    pub(super) hold: Option<Spanned<u8>>,
    pub(super) peak_ms: Option<Spanned<u16>>,
    pub(super) set: Option<Spanned<u8>>,
    pub(super) reset: Option<Spanned<u8>>,
    pub(super) pulse_ms: Option<Spanned<u16>>,
    pub(super) max_on_ms: u32,
    pub(super) duty_percent: u8,
    pub(super) window_ms: u32,
    pub(super) input: Option<u8>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawFallback {
    Hold,
    Release,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawServo {
    pub(super) id: u8,
    pub(super) min_deg: f64,
    pub(super) max_deg: f64,
    pub(super) max_speed_deg_s: f64,
    pub(super) max_torque: f32,
    pub(super) timeout_ms: u16,
    pub(super) fallback: RawFallback,
}
