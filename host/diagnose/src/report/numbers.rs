//! Numbers as people read them: with their units, and with as many digits as their uncertainty gives them.

use crate::outcome::{EffectValue, Number};

/// Decimals beyond which a number is written with an exponent.
const MAX_DECIMALS: i32 = 6;

/// A value and the ends of its interval, with two digits of half the interval.
pub fn with_interval(value: f64, [low, high]: [f64; 2]) -> [String; 3] {
    let half = 0.5 * (high - low).abs();
    let last = if half > 0.0 && half.is_finite() { half.log10().floor() as i32 - 1 } else { -MAX_DECIMALS };
    [value, low, high].map(|number| match -last {
        decimals if decimals > MAX_DECIMALS => {
            let first = number.abs().max(f64::MIN_POSITIVE).log10().floor() as i32;
            format!("{number:.digits$e}", digits = (first - last).clamp(0, 12) as usize)
        }
        decimals => format!("{number:.decimals$}", decimals = decimals.max(0) as usize),
    })
}

/// A value in the unit that a person reads.
pub fn shown(of: &EffectValue, value: f64) -> String {
    match &of.unit[..] {
        "m" => with_unit(value, "m"),
        "rad" => with_unit(value, "rad"),
        "m/N" => format!("{:.3} µm/N", value * 1e6),
        "1/K" => format!("{:.2} µm/(m·K)", value * 1e6),
        "1" => format!("{value:.4}"),
        unit => format!("{} {unit}", short(value)),
    }
}

/// A value with its name for a sentence, and from what it changes: `mass 1.2000 → 1.3000 kg`.
pub(crate) fn named(of: &EffectValue) -> String {
    let (factor, unit) = match &of.unit[..] {
        "m" => (1e3, " mm".to_owned()),
        "rad" => (1f64.to_degrees(), "°".to_owned()),
        unit => (1.0, after(unit)),
    };
    let number = |value: f64| four_decimals(factor * value);
    match of.nominal {
        Some(from) => format!("{} {} → {}{unit}", of.name, number(from), number(from + of.value)),
        None => format!("{} {}{unit}", of.name, number(of.value)),
    }
}

/// Four decimals, or four digits.
pub(crate) fn four_decimals(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-3..1e5).contains(&size) { format!("{value:.4}") } else { format!("{value:.3e}") }
}

/// A number as people read it: lengths in mm, angles in degrees.
pub fn readable(number: &Number) -> (f64, &'static str) {
    match number.unit {
        "m" => (1e3 * number.value, "mm"),
        "rad" => (number.value.to_degrees(), "°"),
        unit => (number.value, unit),
    }
}

/// A number with its unit as people read it.
pub fn with_unit(value: f64, unit: &'static str) -> String {
    match readable(&Number { value, unit }) {
        (value, "mm") => format!("{value:.3} mm"),
        (value, "°") => format!("{value:.4}°"),
        (value, unit) => format!("{} {unit}", short(value)),
    }
}

/// A unit after its number; nothing after a ratio.
pub fn after(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {unit}") }
}

/// A length, in millimetres.
pub fn mm(length_m: f64) -> String {
    with_unit(length_m, "m")
}

/// Three decimals, or as many digits.
pub fn short(value: f64) -> String {
    if value == 0.0 || (1e-2..1e5).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.3e}") }
}

/// A probability.
pub fn chance(p: f64) -> String {
    if p < 1e-12 {
        "< 1e-12".into()
    } else if p < 0.01 {
        format!("{p:.0e}")
    } else {
        format!("{p:.2}")
    }
}

#[cfg(test)]
mod tests {
    use super::{named, with_interval};
    use crate::outcome::EffectValue;

    #[test]
    fn a_value_has_one_unit_in_sentences_and_tables() {
        let value = |unit: &str, nominal| EffectValue {
            name: "lag".into(),
            value: 4.108e-4,
            unit: unit.into(),
            ci95: None,
            nominal,
        };
        assert_eq!(named(&value("m", None)), "lag 0.4108 mm");
        assert_eq!(named(&value("m", Some(1e-3))), "lag 1.0000 → 1.4108 mm");
        assert_eq!(named(&value("N", None)), "lag 4.108e-4 N");
    }

    #[test]
    fn digits_are_those_of_the_interval() {
        assert_eq!(with_interval(0.252_409, [0.252_231, 0.252_587]), ["0.25241", "0.25223", "0.25259"]);
        assert_eq!(with_interval(2.3e-5, [2.21e-5, 2.39e-5]), ["2.300e-5", "2.210e-5", "2.390e-5"]);
        assert_eq!(with_interval(1234.5, [1100.0, 1369.0]), ["1234", "1100", "1369"]);
        assert_eq!(with_interval(1.0, [1.0, 1.0]), ["1.000000"; 3]);
    }
}
