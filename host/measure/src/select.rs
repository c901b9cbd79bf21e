//! Which rows are meant: comparisons of columns with numbers or words, as `set_bar = 5, seal = NAPN`, joined by `and` (or a
//! comma), `or` and brackets; `and` binds before `or`.

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

/// Which rows are meant.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    condition: Condition,
}

#[derive(Clone, Debug, PartialEq)]
enum Condition {
    One(Comparison),
    All(Vec<Condition>),
    Any(Vec<Condition>),
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
        let mut parser = Parser { text, at: 0, n_open: 0 };
        let condition = parser.any()?;
        match parser.rest().is_empty() {
            true => Ok(Self { condition }),
            false => Err(SelectError::Bracket { character: parser.character(), what: "closes no bracket" }),
        }
    }
}

/// Deepest brackets within brackets.
const MAX_OPEN: usize = 32;

/// A text that is read from its front: `or` joins what `and` or a comma joins, brackets group.
struct Parser<'a> {
    text: &'a str,
    at: usize,
    n_open: usize,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn character(&self) -> usize {
        self.text[..self.at].chars().count() + 1
    }

    fn skip_blanks(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    fn accepts(&mut self, token: &str) -> bool {
        let is_next = self.rest().starts_with(token);
        self.at += if is_next { token.len() } else { 0 };
        is_next
    }

    fn any(&mut self) -> Result<Condition, SelectError> {
        let mut parts = vec![self.all()?];
        while self.accepts(" or ") {
            parts.push(self.all()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Condition::Any(parts) })
    }

    fn all(&mut self) -> Result<Condition, SelectError> {
        let mut parts = vec![self.one()?];
        while self.accepts(",") || self.accepts(" and ") {
            parts.push(self.one()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Condition::All(parts) })
    }

    fn one(&mut self) -> Result<Condition, SelectError> {
        self.skip_blanks();
        let character = self.character();
        let open = |what| SelectError::Bracket { character, what };
        if self.accepts("(") {
            self.n_open += 1;
            if self.n_open > MAX_OPEN {
                return Err(open("opens more brackets than are read"));
            }
            let inside = self.any()?;
            self.skip_blanks();
            if !self.accepts(")") {
                return Err(open("opens a bracket that is not closed"));
            }
            self.n_open -= 1;
            // Blanks before the next ` and ` belong to it.
            let blanks = self.rest().len() - self.rest().trim_start().len();
            self.at += if blanks == self.rest().len() { blanks } else { blanks.saturating_sub(1) };
            return Ok(inside);
        }
        let length = length_of_comparison(self.rest());
        let text = &self.rest()[..length];
        self.at += length;
        comparison(text, character).map(Condition::One)
    }
}

/// Up to a comma, a joining word or a closing bracket outside of quotes; names such as `Torque (Nm)` have brackets.
fn length_of_comparison(text: &str) -> usize {
    let (mut quote, mut n_open) = (None, 0usize);
    for (at, c) in text.char_indices() {
        let is_end = match (quote, c) {
            (Some(open), _) => {
                quote = quote.filter(|_| c != open);
                false
            }
            (None, '"' | '\'') => {
                quote = Some(c);
                false
            }
            (None, '(') => {
                n_open += 1;
                false
            }
            (None, ')') if n_open > 0 => {
                n_open -= 1;
                false
            }
            (None, ')' | ',') => true,
            (None, ' ') => text[at..].starts_with(" and ") || text[at..].starts_with(" or "),
            _ => false,
        };
        if is_end {
            return at;
        }
    }
    text.len()
}

fn comparison(text: &str, character: usize) -> Result<Comparison, SelectError> {
    let none = || SelectError::NoComparison { character, text: text.trim().into() };
    let found = RELATIONS.iter().find_map(|(sign, relation)| text.split_once(sign).map(|parts| (*relation, parts)));
    let (relation, (column, with)) = found.ok_or_else(none)?;
    let [column, with] = [column, with].map(|part| part.trim().trim_matches(['"', '\'']).to_string());
    if column.is_empty() || with.is_empty() {
        return Err(none());
    }
    if !matches!(relation, Relation::Equal | Relation::Unequal) && with.parse::<f64>().is_err() {
        return Err(SelectError::NoNumber { character, text: with });
    }
    Ok(Comparison { column, relation, with })
}

impl Selection {
    /// Whether each row is meant. Numbers are compared as they are in the file.
    ///
    /// # Errors
    ///
    /// The table has no column of a name that the selection compares.
    pub fn rows(&self, table: &Table) -> Result<Vec<bool>, SelectError> {
        self.condition.rows(table)
    }

    /// The columns that are compared.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let mut columns = Vec::new();
        self.condition.collect_columns(&mut columns);
        columns.into_iter()
    }
}

impl Condition {
    fn rows(&self, table: &Table) -> Result<Vec<bool>, SelectError> {
        match self {
            Self::One(comparison) => {
                let column = table.chosen(&comparison.column)?;
                Ok(column.words.iter().map(|cell| comparison.holds(cell)).collect())
            }
            Self::All(parts) => Self::joined(parts, table, true),
            Self::Any(parts) => Self::joined(parts, table, false),
        }
    }

    /// For each line whether all of `parts` hold, or any.
    fn joined(parts: &[Self], table: &Table, is_all: bool) -> Result<Vec<bool>, SelectError> {
        let mut meant = vec![is_all; table.lines.len()];
        for part in parts {
            let rows = part.rows(table)?;
            let both = meant.iter_mut().zip(rows);
            both.for_each(|(meant, row)| *meant = if is_all { *meant && row } else { *meant || row });
        }
        Ok(meant)
    }

    fn collect_columns<'a>(&'a self, columns: &mut Vec<&'a str>) {
        match self {
            Self::One(comparison) => columns.push(&comparison.column),
            Self::All(parts) | Self::Any(parts) => parts.iter().for_each(|part| part.collect_columns(columns)),
        }
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
    fn and_binds_before_or_and_brackets_before_both() {
        let rows = |text: &str| text.parse::<Selection>().unwrap().rows(&table()).unwrap();
        assert_eq!(rows("set_bar = 1 or set_bar = 7"), [true, false, true]);
        assert_eq!(rows("set_bar = 7 or set_bar = 1 and seal = O-ring"), [false, false, true]);
        assert_eq!(rows("(set_bar = 7 or set_bar = 1) and seal = NAPN"), [true, false, false]);
        assert_eq!(rows("set_bar > 1, ((seal = 'NAPN' or seal = 'a or b') )"), [false, true, false]);
        let columns: Vec<String> =
            "a=1 or (b=2, a=3)".parse::<Selection>().unwrap().columns().map(String::from).collect();
        assert_eq!(columns, ["a", "b", "a"]);
        assert_eq!(length_of_comparison("Torque (Nm) > 3) or a = 1"), "Torque (Nm) > 3".len());
    }

    #[test]
    fn faults_have_their_character() {
        for (text, expected) in [
            ("a = 1 or b", "character 10: `b` compares nothing"),
            ("a = 1 and (b = 2", "character 11 opens a bracket that is not closed"),
            ("a = 1)", "character 6 closes no bracket"),
            ("ä = 1, b < c", "character 8: `c` is not a number"),
            ("", "character 1: `` compares nothing"),
            (&"(".repeat(100), "character 33 opens more brackets"),
        ] {
            let error = text.parse::<Selection>().unwrap_err().to_string();
            assert!(error.starts_with(expected), "{text}: {error}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        assert!(matches!("seal".parse::<Selection>(), Err(SelectError::NoComparison { .. })));
        assert!(matches!("seal < NAPN".parse::<Selection>(), Err(SelectError::NoNumber { .. })));
        let missing = "nobody = 1".parse::<Selection>().unwrap().rows(&table()).unwrap_err();
        assert_eq!(missing.to_string(), "no column nobody; the file has set_bar, seal");
    }
}
