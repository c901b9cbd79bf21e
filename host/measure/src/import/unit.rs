//! Units of foreign recordings and of our columns.

/// A unit: its dimension, and the line that gives SI units (or °C): SI = factor · value + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name in small letters; our columns end in it where [`Unit::is_ours`].
    pub name: &'static str,
    dimension: &'static str,
    factor: f64,
    offset: f64,
    /// Whether the name is one that our columns end in.
    pub is_ours: bool,
}

const DEG: f64 = std::f64::consts::PI / 180.0;

const fn ours(name: &'static str, dimension: &'static str, factor: f64) -> Unit {
    Unit { name, dimension, factor, offset: 0.0, is_ours: true }
}

const fn foreign(name: &'static str, dimension: &'static str, factor: f64) -> Unit {
    Unit { name, dimension, factor, offset: 0.0, is_ours: false }
}

const UNITS: [Unit; 45] = [
    ours("s", "time", 1.0),
    ours("ms", "time", 1e-3),
    ours("us", "time", 1e-6),
    foreign("ns", "time", 1e-9),
    foreign("min", "time", 60.0),
    ours("m", "length", 1.0),
    foreign("cm", "length", 1e-2),
    ours("mm", "length", 1e-3),
    ours("um", "length", 1e-6),
    foreign("in", "length", 0.0254),
    ours("rad", "angle", 1.0),
    foreign("mrad", "angle", 1e-3),
    ours("deg", "angle", DEG),
    foreign("rev", "angle", 360.0 * DEG),
    ours("rad_s", "angular velocity", 1.0),
    ours("deg_s", "angular velocity", DEG),
    foreign("rpm", "angular velocity", 6.0 * DEG),
    ours("rad_s2", "angular acceleration", 1.0),
    ours("deg_s2", "angular acceleration", DEG),
    ours("m_s", "velocity", 1.0),
    ours("mm_s", "velocity", 1e-3),
    ours("m_s2", "acceleration", 1.0),
    ours("mm_s2", "acceleration", 1e-3),
    foreign("g", "acceleration", 9.80665),
    ours("n", "force", 1.0),
    foreign("kn", "force", 1e3),
    foreign("kgf", "force", 9.80665),
    foreign("lbf", "force", 4.448_221_615_260_5),
    ours("nm", "torque", 1.0),
    foreign("mnm", "torque", 1e-3),
    foreign("ncm", "torque", 1e-2),
    foreign("nmm", "torque", 1e-3),
    ours("pa", "pressure", 1.0),
    foreign("hpa", "pressure", 1e2),
    ours("kpa", "pressure", 1e3),
    foreign("mpa", "pressure", 1e6),
    ours("bar", "pressure", 1e5),
    foreign("mbar", "pressure", 1e2),
    foreign("psi", "pressure", 6_894.757_293_168),
    ours("a", "current", 1.0),
    foreign("ma", "current", 1e-3),
    ours("v", "voltage", 1.0),
    foreign("mv", "voltage", 1e-3),
    ours("c", "temperature", 1.0),
    Unit { name: "k", dimension: "temperature", factor: 1.0, offset: -273.15, is_ours: true },
];

/// Steps of an encoder, which no other unit measures.
const COUNT: Unit = ours("count", "count", 1.0);

impl Unit {
    /// The unit of this name, as files write it: `deg`, `°`, `N·m`, `Nm`, `rad/s`, `m/s^2`, `degC`.
    pub fn named(name: &str) -> Option<Self> {
        let small: String =
            name.trim().to_lowercase().chars().filter(|c| !matches!(c, ' ' | '·' | '*' | '⋅')).collect();
        let small = small.replace(['µ', 'μ'], "u").replace('/', "_");
        let small = small.replace("²", "2").replace("^2", "2").replace("degrees", "deg").replace("degree", "deg");
        let small = small.replace("radians", "rad").replace("radian", "rad");
        let plain = match small.as_str() {
            "°" => "deg",
            "°c" | "degc" | "celsius" => "c",
            "kelvin" => "k",
            "°_s" => "deg_s",
            "°_s2" => "deg_s2",
            "rads" => "rad",
            "sec" | "secs" | "second" | "seconds" => "s",
            "millimeters" | "millimetres" | "millimeter" => "mm",
            "centimeters" | "centimetres" => "cm",
            "msec" | "msecs" | "millisec" | "milliseconds" => "ms",
            "usec" | "usecs" | "microsec" | "microseconds" => "us",
            "nsec" | "nsecs" | "nanosec" | "nanosecs" | "nanoseconds" => "ns",
            "meter" | "meters" | "metre" | "metres" => "m",
            "newton" => "n",
            "amp" | "amps" | "ampere" => "a",
            "volt" | "volts" => "v",
            "counts" | "ticks" | "inc" => "count",
            "1_min" | "u_min" => "rpm",
            other => other,
        };
        UNITS.iter().chain([&COUNT]).find(|unit| unit.name == plain).copied()
    }

    /// The names of all units.
    pub fn names() -> impl Iterator<Item = &'static str> {
        UNITS.iter().chain([&COUNT]).map(|unit| unit.name)
    }

    /// The unit that the name of one of our columns ends in: `q1_deg`, `v1_rad_s`.
    pub fn of_target(target: &str) -> Option<Self> {
        let small = target.to_lowercase();
        let ours = UNITS.iter().chain([&COUNT]).filter(|unit| unit.is_ours);
        let ends =
            ours.filter(|unit| small.strip_suffix(unit.name).is_some_and(|rest| rest.len() > 1 && rest.ends_with('_')));
        ends.max_by_key(|unit| unit.name.len()).copied()
    }

    /// The unit of our columns in which this quantity is written: itself, or that of SI.
    pub fn written(self) -> Self {
        if self.is_ours {
            return self;
        }
        let same = |unit: &&Self| unit.is_ours && unit.dimension == self.dimension && unit.factor == 1.0;
        UNITS.iter().find(same).copied().unwrap_or(self)
    }

    /// What takes numbers of this unit to `target`: a factor and what is added after it. `None` for another dimension.
    pub fn conversion(self, target: Self) -> Option<(f64, f64)> {
        let same = self.dimension == target.dimension;
        let offset = (self.offset - target.offset) / target.factor;
        same.then_some((if self.name == target.name { 1.0 } else { self.factor / target.factor }, offset))
    }

    /// What it measures, in words.
    pub fn dimension(self) -> &'static str {
        self.dimension
    }
}

/// The unit at the end of a foreign name, in brackets or after `_`, and the name without it.
pub fn split(name: &str) -> (&str, Option<Unit>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')'), ('<', '>')] {
        if let Some((base, unit)) = name.strip_suffix(close).and_then(|rest| rest.rsplit_once(open)) {
            if matches!(unit.trim(), "" | "-" | "1") && !base.is_empty() {
                return (base.trim_end(), None);
            }
            if let Some(unit) = Unit::named(unit) {
                return (base.trim_end(), Some(unit));
            }
        }
    }
    let separated = name.char_indices().filter(|(_, c)| matches!(c, '_' | '/' | ' '));
    let found = separated.filter_map(|(at, c)| Some((name[..at].trim_end(), Unit::named(&name[at + c.len_utf8()..])?)));
    // The first separator has the longest unit after it: `v1_rad_s` is in rad/s.
    let mut found = found.filter(|(base, _)| !base.is_empty());
    found.next().map_or((name, None), |(base, unit)| (base, Some(unit)))
}

/// The unit at the end of a foreign name, as it is written there.
pub(crate) fn text(name: &str) -> Option<&str> {
    let (base, unit) = split(name);
    let end = name.trim().get(base.len()..).filter(|_| unit.is_some())?;
    Some(end.trim_matches(|c: char| c.is_whitespace() || "[]()<>_/".contains(c)))
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
    fn numbers_are_converted_and_dimensions_compared() {
        let to = |from: &str, to: &str| Unit::named(from).unwrap().conversion(Unit::named(to).unwrap());
        assert_eq!(to("mm", "m"), Some((1e-3, 0.0)));
        assert_eq!(to("k", "c"), Some((1.0, -273.15)));
        assert_eq!(to("c", "k"), Some((1.0, 273.15)));
        assert_eq!(to("deg", "mm"), None);
        assert!((to("rpm", "deg_s").unwrap().0 - 6.0).abs() < 1e-12);
    }
}
