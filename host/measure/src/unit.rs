//! Units in which columns are written, by this program and by others.

use crate::median;

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dimension {
    Time,
    Length,
    Angle,
    Velocity,
    AngularVelocity,
    Acceleration,
    AngularAcceleration,
    Mass,
    Force,
    Torque,
    Pressure,
    Temperature,
    Current,
    Voltage,
    /// Steps of an encoder, which no other unit measures.
    Count,
}

/// Where the name of a unit is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    /// At the end of our own columns, as in `x_mm`.
    Ours,
    /// At the end of anybody's column as well, but our files are not written in it.
    AtEnd,
    /// Only in brackets, as in `x [in]`: `x_in` and `x_min` are an input and a minimum.
    InBrackets,
}

/// A unit: its dimension, and the line that gives SI units (or °C): SI = factor · value + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name in small letters.
    pub name: &'static str,
    dimension: Dimension,
    factor: f64,
    offset: f64,
    place: Use,
}

const DEG: f64 = std::f64::consts::PI / 180.0;
const ZERO_CELSIUS_K: f64 = 273.15;

const fn unit(name: &'static str, dimension: Dimension, factor: f64, place: Use) -> Unit {
    Unit { name, dimension, factor, offset: 0.0, place }
}

/// All units. Of two with one name the first is meant, unless the other measures what is needed: `g` is the acceleration of an
/// accelerometer, and the mass of a load.
const UNITS: [Unit; 51] = {
    use Dimension::{
        Acceleration, Angle, AngularAcceleration, AngularVelocity, Count, Current, Force, Length, Mass, Pressure,
        Temperature, Time, Torque, Velocity, Voltage,
    };
    use Use::{AtEnd, InBrackets, Ours};
    [
        unit("s", Time, 1.0, Ours),
        unit("ms", Time, 1e-3, Ours),
        unit("us", Time, 1e-6, Ours),
        unit("ns", Time, 1e-9, AtEnd),
        unit("min", Time, 60.0, InBrackets),
        unit("h", Time, 3_600.0, InBrackets),
        unit("day", Time, 86_400.0, InBrackets),
        unit("m", Length, 1.0, Ours),
        unit("cm", Length, 1e-2, AtEnd),
        unit("mm", Length, 1e-3, Ours),
        unit("um", Length, 1e-6, Ours),
        unit("in", Length, 0.0254, InBrackets),
        unit("rad", Angle, 1.0, Ours),
        unit("mrad", Angle, 1e-3, AtEnd),
        unit("deg", Angle, DEG, Ours),
        unit("rev", Angle, 360.0 * DEG, InBrackets),
        unit("rad_s", AngularVelocity, 1.0, Ours),
        unit("deg_s", AngularVelocity, DEG, Ours),
        unit("rpm", AngularVelocity, 6.0 * DEG, AtEnd),
        unit("rad_s2", AngularAcceleration, 1.0, Ours),
        unit("deg_s2", AngularAcceleration, DEG, Ours),
        unit("m_s", Velocity, 1.0, Ours),
        unit("mm_s", Velocity, 1e-3, Ours),
        unit("m_s2", Acceleration, 1.0, Ours),
        unit("mm_s2", Acceleration, 1e-3, Ours),
        unit("g", Acceleration, 9.80665, InBrackets),
        unit("kg", Mass, 1.0, Ours),
        unit("g", Mass, 1e-3, Ours),
        unit("n", Force, 1.0, Ours),
        unit("kn", Force, 1e3, AtEnd),
        unit("kgf", Force, 9.80665, AtEnd),
        unit("lbf", Force, 4.448_221_615_260_5, AtEnd),
        unit("nm", Torque, 1.0, Ours),
        unit("mnm", Torque, 1e-3, AtEnd),
        unit("ncm", Torque, 1e-2, AtEnd),
        unit("nmm", Torque, 1e-3, AtEnd),
        unit("pa", Pressure, 1.0, Ours),
        unit("hpa", Pressure, 1e2, AtEnd),
        unit("kpa", Pressure, 1e3, Ours),
        unit("mpa", Pressure, 1e6, AtEnd),
        unit("bar", Pressure, 1e5, Ours),
        unit("mbar", Pressure, 1e2, AtEnd),
        unit("psi", Pressure, 6_894.757_293_168, AtEnd),
        unit("a", Current, 1.0, Ours),
        unit("ma", Current, 1e-3, AtEnd),
        unit("v", Voltage, 1.0, Ours),
        unit("mv", Voltage, 1e-3, AtEnd),
        unit("c", Temperature, 1.0, Ours),
        Unit { offset: -ZERO_CELSIUS_K, ..unit("k", Temperature, 1.0, Ours) },
        // 0 °C are 32 °F.
        Unit { offset: -32.0 / 1.8, ..unit("degf", Temperature, 1.0 / 1.8, AtEnd) },
        unit("count", Count, 1.0, Ours),
    ]
};

impl Dimension {
    /// Its SI unit, or °C, and its name.
    fn si_and_words(self) -> (&'static str, &'static str) {
        match self {
            Self::Time => ("s", "time"),
            Self::Length => ("m", "length"),
            Self::Angle => ("rad", "angle"),
            Self::Velocity => ("m/s", "velocity"),
            Self::AngularVelocity => ("rad/s", "angular velocity"),
            Self::Acceleration => ("m/s²", "acceleration"),
            Self::AngularAcceleration => ("rad/s²", "angular acceleration"),
            Self::Mass => ("kg", "mass"),
            Self::Force => ("N", "force"),
            Self::Torque => ("N·m", "torque"),
            Self::Pressure => ("Pa", "pressure"),
            Self::Temperature => ("°C", "temperature"),
            Self::Current => ("A", "current"),
            Self::Voltage => ("V", "voltage"),
            Self::Count => ("count", "count"),
        }
    }
}

/// The name of a unit as [`UNITS`] has it, of what files write: `°`, `N·m`, `rad/s`, `m/s^2`, `degC`.
fn plain(name: &str) -> String {
    let small: String = name.trim().to_lowercase().chars().filter(|c| !matches!(c, ' ' | '·' | '*' | '⋅')).collect();
    let small = small.replace(['µ', 'μ'], "u").replace('/', "_");
    let small = small.replace("²", "2").replace("^2", "2").replace("degrees", "deg").replace("degree", "deg");
    let small = small.replace("radians", "rad").replace("radian", "rad");
    let known = match small.as_str() {
        "°" => "deg",
        "°c" | "degc" | "celsius" => "c",
        "°f" | "fahrenheit" => "degf",
        "kelvin" => "k",
        "°_s" => "deg_s",
        "°_s2" => "deg_s2",
        "rads" => "rad",
        "sec" | "secs" | "second" | "seconds" => "s",
        "millimeters" | "millimetres" | "millimeter" => "mm",
        "centimeters" | "centimetres" => "cm",
        "minute" | "minutes" => "min",
        "hr" | "hrs" | "hour" | "hours" => "h",
        "days" => "day",
        "msec" | "msecs" | "millisec" | "milliseconds" => "ms",
        "usec" | "usecs" | "microsec" | "microseconds" => "us",
        "nsec" | "nsecs" | "nanosec" | "nanosecs" | "nanoseconds" => "ns",
        "meter" | "meters" | "metre" | "metres" => "m",
        "newton" => "n",
        "amp" | "amps" | "ampere" => "a",
        "volt" | "volts" => "v",
        "counts" | "ticks" | "inc" => "count",
        "1_min" | "u_min" => "rpm",
        _ => return small,
    };
    known.into()
}

impl Unit {
    /// The unit of this name, as files write it: `deg`, `°`, `N·m`, `Nm`, `rad/s`, `m/s^2`, `degC`.
    pub fn named(name: &str) -> Option<Self> {
        let plain = plain(name);
        UNITS.into_iter().find(|unit| unit.name == plain)
    }

    /// The same in a column of ours, where `g` is a mass.
    fn of_ours(name: &str) -> Option<Self> {
        let plain = plain(name);
        let named = || UNITS.into_iter().filter(|unit| unit.name == plain);
        named().find(|unit| unit.is_ours()).or_else(|| named().next())
    }

    /// Whether our columns are written in it.
    pub fn is_ours(&self) -> bool {
        self.place == Use::Ours
    }

    /// The names of all units.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let is_first = |k: usize| UNITS[..k].iter().all(|unit| unit.name != UNITS[k].name);
        (0..UNITS.len()).filter(move |&k| is_first(k)).map(|k| UNITS[k].name)
    }

    /// The names of the units that one of our columns can end in.
    pub fn ends() -> impl Iterator<Item = &'static str> {
        UNITS.into_iter().filter(|unit| unit.place != Use::InBrackets).map(|unit| unit.name)
    }

    /// The unit that the name of one of our columns ends in: `q1_deg`, `v1_rad_s`.
    pub fn of_target(target: &str) -> Option<Self> {
        split_ours(target).1
    }

    /// The unit of our columns in which this quantity is written: itself, or that of SI.
    pub fn written(self) -> Self {
        if self.is_ours() {
            return self;
        }
        let same = |unit: &Unit| unit.is_ours() && unit.dimension == self.dimension && unit.factor == 1.0;
        UNITS.into_iter().find(same).unwrap_or(self)
    }

    /// What takes numbers of this unit to `target`: a factor and what is added after it. `None` for another dimension.
    pub fn conversion(self, target: Self) -> Option<(f64, f64)> {
        let is_meant = |unit: &Unit| unit.name == self.name && unit.dimension == target.dimension;
        let unit = UNITS.into_iter().find(is_meant)?;
        let offset = (unit.offset - target.offset) / target.factor;
        Some((if unit.name == target.name { 1.0 } else { unit.factor / target.factor }, offset))
    }

    /// A number of this unit in SI, a temperature in °C.
    pub fn to_si(self, number: f64) -> f64 {
        number * self.factor + self.offset
    }

    /// The SI unit of its dimension, or °C.
    pub fn si(self) -> &'static str {
        self.dimension.si_and_words().0
    }

    /// What it measures, in words.
    pub fn dimension(self) -> &'static str {
        self.dimension.si_and_words().1
    }
}

/// Brackets in which files write a unit.
const BRACKETS: [(char, char); 4] = [('[', ']'), ('(', ')'), ('<', '>'), ('{', '}')];

/// What is before the brackets at the end of a name, and what is in them.
pub(crate) fn in_brackets(name: &str) -> Option<(&str, &str)> {
    BRACKETS.into_iter().find_map(|(open, close)| name.strip_suffix(close)?.rsplit_once(open))
}

/// The name of one of our columns in small letters without its unit, and the unit: `x_mm`, `x [mm]`, `v1_rad_s`, `v1_rad/s`.
pub fn split_ours(name: &str) -> (String, Option<Unit>) {
    let name = name.trim().to_lowercase();
    if let Some((base, unit)) = in_brackets(&name).and_then(|(base, unit)| Some((base, Unit::of_ours(unit)?))) {
        return (base.trim_end().to_owned(), Some(unit));
    }
    // Of the units that fit the longest: `v1_rad_s` is a velocity in rad/s.
    let ends = name.match_indices('_').filter(|(at, _)| *at > 0);
    let mut units = ends.filter_map(|(at, _)| Some((at, Unit::of_ours(&name[at + 1..])?)));
    match units.find(|(_, unit)| unit.place != Use::InBrackets) {
        Some((at, unit)) => (name[..at].to_owned(), Some(unit)),
        None => (name, None),
    }
}

/// The unit at the end of a foreign name, in brackets or after `_`, and the name without it.
pub fn split(name: &str) -> (&str, Option<Unit>) {
    let name = name.trim();
    if let Some((base, unit)) = in_brackets(name) {
        if matches!(unit.trim(), "" | "-" | "1") && !base.is_empty() {
            return (base.trim_end(), None);
        }
        if let Some(unit) = Unit::named(unit) {
            return (base.trim_end(), Some(unit));
        }
    }
    // `x_mm`, `x / mm`, `x, mm`
    let separated = name.char_indices().filter(|(_, c)| matches!(c, '_' | '/' | ' ' | ','));
    let found = separated.filter_map(|(at, c)| {
        let base = name[..at].trim_end_matches([' ', '/', ',']);
        let unit = Unit::named(&name[at + c.len_utf8()..])?;
        // `q1_min` is a minimum, `q1 / min` a time.
        (unit.place != Use::InBrackets || matches!(c, '/' | ',')).then_some((base, unit))
    });
    // The first separator has the longest unit after it: `v1_rad_s` is in rad/s.
    let mut found = found.filter(|(base, _)| !base.is_empty());
    found.next().map_or((name, None), |(base, unit)| (base, Some(unit)))
}

/// The unit at the end of a foreign name, as it is written there.
pub(crate) fn text(name: &str) -> Option<&str> {
    let (base, unit) = split(name);
    let end = name.trim().get(base.len()..).filter(|_| unit.is_some())?;
    Some(end.trim_matches(|c: char| c.is_whitespace() || "[](){}<>_/,".contains(c)))
}

/// The unit of time stamps by their size: since 1970 of the years 2001 to 2286; of numbers that rise by a million and more, which is a
/// row in twelve days of s, ns; days since 1900 as spreadsheets count them, of the years 1970 to 2100, which as s would be more than
/// 50 000 rows a second; else s.
pub(crate) fn of_times(numbers: &[f64]) -> Unit {
    const NANOSECONDS_A_ROW: f64 = 1e6;
    const DAYS: std::ops::Range<f64> = 25_569.0..73_051.0;
    const DAYS_A_ROW: f64 = 2e-5;
    let largest = numbers.iter().copied().filter(|number| number.is_finite()).fold(0.0, f64::max);
    let steps = numbers.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    let step = median(steps);
    let is_fast = step.is_some_and(|step| step >= NANOSECONDS_A_ROW);
    let is_days = step.is_some_and(|step| step < DAYS_A_ROW) && numbers.iter().all(|x| x.is_nan() || DAYS.contains(x));
    let unit = ["ns", "us", "ms"].into_iter().zip([1e18, 1e15, 1e12]).find(|(_, min)| largest > *min);
    let unit = unit.map_or(
        if is_fast {
            "ns"
        } else if is_days {
            "day"
        } else {
            "s"
        },
        |(unit, _)| unit,
    );
    Unit::named(unit).expect("these units are known")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_recognised_as_files_write_them() {
        for (text, name) in [
            ("[N·m]", "nm"),
            ("(°)", "deg"),
            ("[deg/s]", "deg_s"),
            ("(m/s^2)", "m_s2"),
            ("[degC]", "c"),
            ("[Seconds]", "s"),
        ] {
            assert_eq!(split(&format!("a {text}")), ("a", Unit::named(name)), "{text}");
        }
        assert_eq!(split("v1_rad_s"), ("v1", Unit::named("rad_s")));
        assert_eq!([split("q1_min").1, split("x in").1, split("t / min").1], [None, None, Unit::named("min")]);
        assert_eq!(split("t [hours]"), ("t", Unit::named("h")));
        assert_eq!(
            [text("a [N·m]"), text("v1_rad_s"), text("v (m/s)"), text("gear")],
            [Some("N·m"), Some("rad_s"), Some("m/s"), None]
        );
        assert_eq!((split("gear"), split("m")), (("gear", None), ("m", None)));
        // Empty brackets are no unit, and no part of the name.
        assert_eq!([split("q_w []"), split("q_w [-]")], [("q_w", None); 2]);
        assert_eq!(Unit::of_target("q1_deg_s").unwrap().name, "deg_s");
        assert_eq!(Unit::of_target("word"), None);
    }

    #[test]
    fn our_columns_end_in_their_unit_and_the_longest_counts() {
        for (name, quantity, unit) in [
            ("v1_rad_s", "v1", "rad_s"),
            ("v1_rad/s", "v1", "rad_s"),
            ("a1_deg_s2", "a1", "deg_s2"),
            ("q1_deg", "q1", "deg"),
            ("pressure_bar", "pressure", "bar"),
            ("t_s", "t", "s"),
            ("t_sec", "t", "s"),
            ("Time [s]", "time", "s"),
            ("q1 [°]", "q1", "deg"),
            ("x [in]", "x", "in"),
            ("q1 (deg)", "q1", "deg"),
            ("timestamp_ms", "timestamp", "ms"),
            ("time_ns", "time", "ns"),
        ] {
            assert_eq!(split_ours(name), (quantity.into(), Unit::named(unit)), "{name}");
        }
        for name in ["held_out", "x_in", "q1_min", "s", "_s"] {
            assert_eq!(split_ours(name), (name.into(), None), "{name}");
        }
        let [load, acceleration] = [split_ours("load_g").1, Unit::named("g")].map(Option::unwrap);
        assert_eq!((load.to_si(500.0), load.si(), acceleration.si()), (0.5, "kg", "m/s²"));
    }

    #[test]
    fn time_stamps_have_the_unit_of_their_size() {
        let unit = |numbers: &[f64]| of_times(numbers).name;
        assert_eq!(unit(&[0.0, 0.01, 0.02]), "s");
        assert_eq!(unit(&[1.7e9, 1.7e9 + 0.01]), "s");
        assert_eq!(unit(&[1.7e12, 1.7e12 + 10.0]), "ms");
        assert_eq!(unit(&[1.7e18, 1.7e18 + 1e7]), "ns");
        // Of a spreadsheet, a row in 0.1 s.
        assert_eq!(unit(&[45_443.520_833, 45_443.520_834_2, 45_443.520_835_3]), "day");
        // Since the start, 50 rows a second.
        assert_eq!(unit(&[31_951_500_000.0, 31_971_500_000.0]), "ns");
    }

    #[test]
    fn numbers_are_converted_and_dimensions_compared() {
        let to = |from: &str, to: &str| Unit::named(from).unwrap().conversion(Unit::named(to).unwrap());
        assert_eq!(to("mm", "m"), Some((1e-3, 0.0)));
        assert_eq!(to("k", "c"), Some((1.0, -273.15)));
        assert_eq!(to("c", "k"), Some((1.0, 273.15)));
        assert_eq!(to("deg", "mm"), None);
        // A foreign column in `g` is a mass where one is needed.
        assert_eq!(to("g", "kg"), Some((1e-3, 0.0)));
        assert!((Unit::named("°F").unwrap().to_si(212.0) - 100.0).abs() < 1e-12);
        assert!((to("rpm", "deg_s").unwrap().0 - 6.0).abs() < 1e-12);
    }
}
