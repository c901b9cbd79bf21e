//! Which rows are meant: comparisons of columns with numbers or words, as `set_bar = 5, seal = NAPN`.

use std::str::FromStr;

use super::error::SelectError;
use super::table::Table;

/// How a cell is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Relation {
    Equal,
    Unequal,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

/// One comparison.
#[derive(Clone, Debug, PartialEq)]
struct Comparison {
    column: String,
    relation: Relation,
    with: String,
}

/// Comparisons that must all hold, separated by commas or `and`.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    comparisons: Vec<Comparison>,
}

/// In the order in which they are looked for: the longer first.
const RELATIONS: [(&str, Relation); 7] = [
    ("!=", Relation::Unequal),
    ("<=", Relation::LessOrEqual),
    (">=", Relation::GreaterOrEqual),
    ("==", Relation::Equal),
    ("=", Relation::Equal),
    ("<", Relation::Less),
    (">", Relation::Greater),
];

impl FromStr for Selection {
    type Err = SelectError;

    fn from_str(text: &str) -> Result<Self, SelectError> {
        let parts = text.split(',').flat_map(|part| part.split(" and "));
        Ok(Self { comparisons: parts.map(comparison).collect::<Result<_, _>>()? })
    }
}

fn comparison(text: &str) -> Result<Comparison, SelectError> {
    let none = || SelectError::NoComparison(text.trim().into());
    let found = RELATIONS.iter().find_map(|(sign, relation)| text.split_once(sign).map(|parts| (*relation, parts)));
    let (relation, (column, with)) = found.ok_or_else(none)?;
    let (column, with) = (column.trim().to_string(), with.trim().trim_matches(['"', '\'']).to_string());
    if column.is_empty() || with.is_empty() {
        return Err(none());
    }
    if !matches!(relation, Relation::Equal | Relation::Unequal) && with.parse::<f64>().is_err() {
        return Err(SelectError::NoNumber(with));
    }
    Ok(Comparison { column, relation, with })
}

impl Selection {
    /// Whether each row is meant. Numbers are compared as they are in the file.
    pub fn rows(&self, table: &Table) -> Result<Vec<bool>, SelectError> {
        let mut meant = vec![true; table.lines.len()];
        for comparison in &self.comparisons {
            let column = table.chosen(&comparison.column)?;
            meant.iter_mut().zip(&column.words).for_each(|(meant, cell)| *meant &= comparison.holds(cell));
        }
        Ok(meant)
    }

    /// The columns that are compared.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        self.comparisons.iter().map(|comparison| comparison.column.as_str())
    }
}

impl Comparison {
    fn holds(&self, cell: &str) -> bool {
        let order = match (cell.parse::<f64>(), self.with.parse::<f64>()) {
            (Ok(a), Ok(b)) => a.partial_cmp(&b),
            _ => return (cell == self.with) == (self.relation == Relation::Equal),
        };
        match self.relation {
            Relation::Equal => order.is_some_and(|o| o.is_eq()),
            Relation::Unequal => order.is_some_and(|o| o.is_ne()),
            Relation::Less => order.is_some_and(|o| o.is_lt()),
            Relation::LessOrEqual => order.is_some_and(|o| o.is_le()),
            Relation::Greater => order.is_some_and(|o| o.is_gt()),
            Relation::GreaterOrEqual => order.is_some_and(|o| o.is_ge()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn table() -> Table {
        let text = b"set_bar,seal\n1,NAPN\n5,NAPN\n7,O-ring\n";
        Table::read_text(Path::new("a.csv"), text, &Default::default()).unwrap().0
    }

    #[test]
    fn numbers_and_words_are_compared() {
        let rows = |text: &str| text.parse::<Selection>().unwrap().rows(&table()).unwrap();
        assert_eq!(rows("set_bar >= 5, seal = NAPN"), [false, true, false]);
        assert_eq!(rows("seal != NAPN"), [false, false, true]);
        assert_eq!(rows("set_bar < 7 and seal=NAPN"), [true, true, false]);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        assert!(matches!("seal".parse::<Selection>(), Err(SelectError::NoComparison(_))));
        assert!(matches!("seal < NAPN".parse::<Selection>(), Err(SelectError::NoNumber(_))));
        let missing = "nobody = 1".parse::<Selection>().unwrap().rows(&table()).unwrap_err();
        assert_eq!(missing.to_string(), "no column nobody; the file has set_bar, seal");
    }
}
