//! Numbers of a report with their units, as people read them.

use darm_diagnose::outcome::{Number, Value};
use darm_diagnose::report::sentences::readable;

/// A value in the unit that a person reads.
pub(super) fn shown(of: &Value, value: f64) -> String {
    match &of.unit[..] {
        "m" => with_unit(value, "m"),
        "rad" => with_unit(value, "rad"),
        "m/N" => format!("{:.3} µm/N", value * 1e6),
        "1/K" => format!("{:.2} µm/(m·K)", value * 1e6),
        "1" => format!("{value:.4}"),
        unit => format!("{} {unit}", short(value)),
    }
}

/// A number with its unit as people read it.
pub(super) fn with_unit(value: f64, unit: &'static str) -> String {
    match readable(&Number { value, unit }) {
        (value, "mm") => format!("{value:.3} mm"),
        (value, "°") => format!("{value:.4}°"),
        (value, unit) => format!("{} {unit}", short(value)),
    }
}

/// A length, in millimetres.
pub(super) fn mm(length_m: f64) -> String {
    with_unit(length_m, "m")
}

/// Three decimals, or as many digits.
pub(super) fn short(value: f64) -> String {
    if value == 0.0 || (1e-2..1e5).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.3e}") }
}

/// A probability.
pub(super) fn chance(p: f64) -> String {
    if p < 1e-12 {
        "< 1e-12".into()
    } else if p < 0.01 {
        format!("{p:.0e}")
    } else {
        format!("{p:.2}")
    }
}
