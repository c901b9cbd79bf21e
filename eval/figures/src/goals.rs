//! The goals of measured numbers: `tests/goals.toml`, a bound such as `<= 8000` for each name.

use std::path::Path;

use anyhow::{Context as _, Result};

/// The goals of a file.
pub struct Goals(toml::Table);

impl Goals {
    /// Reads them.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not TOML.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("{} cannot be read", path.display()))?;
        Ok(Self(text.parse().with_context(|| format!("{} is no TOML", path.display()))?))
    }

    /// The goal of this name, if there is one, and whether the number meets it.
    ///
    /// # Errors
    ///
    /// The goal is not `<=` or `>=` and a number.
    pub fn judge(&self, name: &str, value: f64) -> Result<Option<(String, bool)>> {
        let Some(goal) = self.0.get(name).and_then(toml::Value::as_str) else { return Ok(None) };
        Ok(Some((goal.to_owned(), is_met(value, goal)?)))
    }
}

fn is_met(value: f64, goal: &str) -> Result<bool> {
    let (sign, bound) =
        goal.split_once(' ').with_context(|| format!("the goal {goal:?} is not a sign and a number"))?;
    let bound: f64 = bound.parse().with_context(|| format!("the goal {goal:?} does not contain a number"))?;
    match sign {
        "<=" => Ok(value <= bound),
        ">=" => Ok(value >= bound),
        _ => anyhow::bail!("the goal {goal:?} begins with neither <= nor >="),
    }
}

#[cfg(test)]
mod tests {
    use super::is_met;

    #[test]
    fn goals_are_bounds() {
        assert!(is_met(8000.0, "<= 8000").unwrap() && !is_met(8001.0, "<= 8000").unwrap());
        assert!(is_met(19.0, ">= 19").unwrap() && is_met(1.0, "about 2").is_err());
    }
}
