//! A column of a table: its name gives quantity and unit, its numbers are in SI.

/// Factors to SI by the unit that a column's name ends in, and the unit that comes of it.
const UNITS: [(&str, f64, &str); 32] = [
    ("s", 1.0, "s"),
    ("ms", 1e-3, "s"),
    ("us", 1e-6, "s"),
    ("ns", 1e-9, "s"),
    ("sec", 1.0, "s"),
    ("m", 1.0, "m"),
    ("mm", 1e-3, "m"),
    ("um", 1e-6, "m"),
    ("rad", 1.0, "rad"),
    ("deg", std::f64::consts::PI / 180.0, "rad"),
    ("kg", 1.0, "kg"),
    ("g", 1e-3, "kg"),
    ("n", 1.0, "N"),
    ("nm", 1.0, "N·m"),
    ("bar", 1e5, "Pa"),
    ("pa", 1.0, "Pa"),
    ("kpa", 1e3, "Pa"),
    ("a", 1.0, "A"),
    ("v", 1.0, "V"),
    ("k", 1.0, "K"),
    ("c", 1.0, "°C"),
    ("count", 1.0, "count"),
    ("rad/s", 1.0, "rad/s"),
    ("rad_s", 1.0, "rad/s"),
    ("deg_s", std::f64::consts::PI / 180.0, "rad/s"),
    ("rad_s2", 1.0, "rad/s²"),
    ("deg_s2", std::f64::consts::PI / 180.0, "rad/s²"),
    ("m_s", 1.0, "m/s"),
    ("mm_s", 1e-3, "m/s"),
    ("m_s2", 1.0, "m/s²"),
    ("mm_s2", 1e-3, "m/s²"),
    ("m/s", 1.0, "m/s"),
];

/// Other names of quantities.
const ALIASES: [(&str, &str); 14] = [
    ("t", "time"),
    ("timestamp", "time"),
    ("time_stamp", "time"),
    ("stamp", "time"),
    ("elapsed", "time"),
    ("elapsed_time", "time"),
    ("zeit", "time"),
    ("pos", "position"),
    ("x", "position"),
    ("p", "pressure"),
    ("f", "force"),
    ("temp", "temperature"),
    ("heldout", "held_out"),
    ("held", "held_out"),
];

/// One column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name in the file.
    pub name: String,
    /// What it holds, in small letters, as its name says it.
    pub quantity: String,
    /// In what unit the numbers are, after the change to SI; empty where the name has none.
    pub unit: &'static str,
    /// The numbers; NaN where a cell is empty or a word.
    pub numbers: Vec<f64>,
    /// The cells as they are.
    pub words: Vec<String>,
}

impl Column {
    /// The unit of its numbers in the file, as its name ends in it; empty where the name has none.
    pub fn file_unit(&self) -> &str {
        let name = self.name.trim();
        let end = name.get(self.quantity.len()..).unwrap_or_default();
        end.strip_prefix('_').unwrap_or_else(|| end.trim_matches(|c: char| c.is_whitespace() || "[]".contains(c)))
    }

    /// What it holds, by the name that the table of quantities has first.
    pub fn meaning(&self) -> &str {
        meaning_of(&self.quantity)
    }

    /// Whether its name says that its numbers are degrees.
    pub fn in_degrees(&self) -> bool {
        self.file_unit().eq_ignore_ascii_case("deg")
    }
}

/// Units that the name of a column can end in.
pub fn units() -> impl Iterator<Item = &'static str> {
    UNITS.iter().map(|(unit, ..)| *unit).filter(|unit| !unit.contains('/'))
}

/// The quantity in a column's name, the factor that brings its numbers to SI, and the unit that comes of it.
pub(super) fn name_parts(name: &str) -> (String, f64, &'static str) {
    let small = name.trim().to_lowercase();
    if let Some((base, unit)) = small.strip_suffix(']').and_then(|rest| rest.rsplit_once('['))
        && let Some((_, factor, si)) = UNITS.iter().find(|(known, ..)| *known == unit.trim())
    {
        return (base.trim_end().to_owned(), *factor, si);
    }
    let quantity = |unit: &str| small.strip_suffix(unit)?.strip_suffix('_').map(str::to_string);
    // Of the units that fit the longest: `v1_rad_s` is a velocity in rad/s.
    let fitting = UNITS.iter().filter_map(|(unit, factor, si)| Some((unit.len(), (quantity(unit)?, *factor, *si))));
    let split = fitting.max_by_key(|(length, _)| *length).map(|(_, parts)| parts);
    split.unwrap_or((small, 1.0, ""))
}

/// The quantity by its first name, where it goes by one of its other names.
pub(super) fn meaning_of(quantity: &str) -> &str {
    ALIASES.iter().find(|(alias, _)| *alias == quantity).map_or(quantity, |(_, meant)| meant)
}

#[cfg(test)]
mod tests {
    use super::name_parts;

    #[test]
    fn the_longest_unit_counts() {
        let degree = 1f64.to_radians();
        for (name, quantity, factor, unit) in [
            ("v1_rad_s", "v1", 1.0, "rad/s"),
            ("a1_deg_s2", "a1", degree, "rad/s²"),
            ("q1_deg", "q1", degree, "rad"),
            ("pressure_bar", "pressure", 1e5, "Pa"),
            ("held_out", "held_out", 1.0, ""),
            ("t_s", "t", 1.0, "s"),
            ("Time [s]", "time", 1.0, "s"),
            ("q1 [deg]", "q1", degree, "rad"),
            ("timestamp_ms", "timestamp", 1e-3, "s"),
            ("time_ns", "time", 1e-9, "s"),
            ("t_sec", "t", 1.0, "s"),
        ] {
            assert_eq!(name_parts(name), (quantity.into(), factor, unit), "{name}");
        }
    }
}
