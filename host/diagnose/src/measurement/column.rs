//! A column of a table: its name gives quantity and unit, its numbers are in SI.

/// Factors to SI by the unit that a column's name ends in, and the unit that comes of it.
const UNITS: [(&str, f64, &str); 20] = [
    ("s", 1.0, "s"),
    ("ms", 1e-3, "s"),
    ("us", 1e-6, "s"),
    ("m", 1.0, "m"),
    ("mm", 1e-3, "m"),
    ("um", 1e-6, "m"),
    ("rad", 1.0, "rad"),
    ("deg", std::f64::consts::PI / 180.0, "rad"),
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
    ("m/s", 1.0, "m/s"),
];

/// Other names of quantities.
const ALIASES: [(&str, &str); 8] = [
    ("t", "time"),
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
    /// What it holds, by the name that the table of quantities has first.
    pub fn meaning(&self) -> &str {
        meaning_of(&self.quantity)
    }
}

/// The quantity in a column's name, the factor that brings its numbers to SI, and the unit that comes of it.
pub(super) fn name_parts(name: &str) -> (String, f64, &'static str) {
    let small = name.trim().to_lowercase();
    let split = small.rsplit_once('_').and_then(|(quantity, unit)| {
        let (_, factor, si) = UNITS.iter().find(|(known, ..)| *known == unit)?;
        Some((quantity.to_string(), *factor, *si))
    });
    split.unwrap_or((small, 1.0, ""))
}

/// The quantity by its first name, where it goes by one of its other names.
pub(super) fn meaning_of(quantity: &str) -> &str {
    ALIASES.iter().find(|(alias, _)| *alias == quantity).map_or(quantity, |(_, meant)| meant)
}
