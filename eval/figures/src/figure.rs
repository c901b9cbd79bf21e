//! One measured number with its goal; a table for people, and the JSON file that every measuring command writes.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Deserializer, Serialize};

use crate::goals::Goals;

/// One measured number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// What was measured.
    pub name: String,
    /// The number. JSON has no NaN: it is written as `null`.
    #[serde(deserialize_with = "number_or_nan")]
    pub value: f64,
    /// Its unit; empty for a count or a ratio.
    pub unit: String,
    /// The goal of this name in `tests/goals.toml`: a bound such as `<= 8000`.
    pub goal: Option<String>,
    /// Whether the number is within the bound.
    pub met: Option<bool>,
}

/// What a measuring command writes with `--json FILE`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// The numbers, in the order of the table.
    pub rows: Vec<Figure>,
    /// The seed of what was drawn, or the first of several.
    pub seed: u64,
    /// Versions of the programs that measured.
    pub versions: BTreeMap<String, String>,
}

fn number_or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// The goals of `tests/goals.toml`.
///
/// # Errors
///
/// The file cannot be read, or is not TOML.
pub fn goals() -> Result<&'static Goals> {
    static GOALS: OnceLock<Result<Goals, String>> = OnceLock::new();
    let goals = GOALS
        .get_or_init(|| Goals::read(&crate::root().join("tests/goals.toml")).map_err(|error| format!("{error:#}")));
    goals.as_ref().map_err(|error| anyhow::anyhow!("{error}"))
}

impl Figure {
    /// The number with the goal of its name.
    ///
    /// # Errors
    ///
    /// `tests/goals.toml` cannot be read, or the goal is not a bound.
    pub fn new(name: &str, value: f64, unit: &str) -> Result<Self> {
        let (goal, met) = goals()?.judge(name, value)?.unzip();
        Ok(Self { name: name.to_owned(), value, unit: unit.to_owned(), goal, met })
    }
}

impl Figures {
    /// The figures of this version of the program.
    pub fn new(rows: Vec<Figure>, seed: u64) -> Self {
        let versions = BTreeMap::from([("darm".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
        Self { rows, seed, versions }
    }

    /// Reads a file of figures.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or has another shape.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("{} cannot be read", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{} is not a file of figures", path.display()))
    }

    /// Writes a file of figures.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)? + "\n";
        std::fs::write(path, text).with_context(|| format!("{} cannot be written", path.display()))
    }

    /// The table for people.
    pub fn text(&self) -> String {
        self.rows.iter().map(line).collect()
    }

    /// Prints the table, and writes the JSON file where one is named.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn report(&self, json: Option<&Path>) -> Result<()> {
        print!("{}", self.text());
        json.map_or(Ok(()), |path| self.write(path))
    }
}

fn line(Figure { name, value, unit, goal, met }: &Figure) -> String {
    let verdict = match met {
        Some(true) => "met",
        Some(false) => "MISSED",
        None => "",
    };
    let goal = goal.as_deref().unwrap_or_default();
    let line = format!("{name:60} {:>12} {unit:13} {goal:10} {verdict}", short(*value));
    line.trim_end().to_owned() + "\n"
}

/// Counts as they are, small numbers with two digits, others with four.
pub fn short(value: f64) -> String {
    if value.fract() == 0.0 {
        format!("{value}")
    } else if value.abs() < 1e-2 {
        format!("{value:.1e}")
    } else {
        format!("{value:.3}")
    }
}

#[cfg(test)]
mod tests {
    use super::{Figure, Figures};

    #[test]
    fn a_file_of_figures_is_read_back_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("figures.json");
        let figures = Figures::new(vec![Figure::new("some arm: error", 0.1 + 0.2, "mm").unwrap()], 7);
        figures.write(&path).unwrap();
        assert_eq!(Figures::read(&path).unwrap(), figures);
    }

    #[test]
    fn a_figure_that_is_not_a_number_stays_one_and_misses_its_goal() {
        let figure = Figure::new("simulate: seeds with a violation", f64::NAN, "seeds").unwrap();
        assert_eq!(figure.met, Some(false));
        let text = serde_json::to_string(&figure).unwrap();
        assert!(serde_json::from_str::<Figure>(&text).unwrap().value.is_nan(), "{text}");
    }

    #[test]
    fn unknown_keys_are_refused() {
        let text = r#"{"rows":[],"seed":1,"versions":{},"broken":[]}"#;
        assert!(serde_json::from_str::<Figures>(text).is_err());
    }
}
