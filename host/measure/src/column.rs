//! A column of a table: its name gives quantity and unit, its numbers are in SI, temperatures in °C.

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
    /// In what unit the numbers are, after the change to SI or °C; empty where the name has none.
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
        end.strip_prefix('_').unwrap_or_else(|| end.trim_matches(|c: char| c.is_whitespace() || "[](){}<>".contains(c)))
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

/// The quantity by its first name, where it goes by one of its other names.
pub(super) fn meaning_of(quantity: &str) -> &str {
    ALIASES.iter().find(|(alias, _)| *alias == quantity).map_or(quantity, |(_, meant)| meant)
}
