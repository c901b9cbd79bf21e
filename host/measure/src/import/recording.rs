//! What a file holds: parts (a table, an array, a topic) of columns with the same rows.

use std::path::PathBuf;

/// What was read from one file or folder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Where it was read from.
    pub path: PathBuf,
    /// Its tables, arrays and topics, in the order of the file.
    pub parts: Vec<Part>,
    /// What its owner should know.
    pub notes: Vec<String>,
}

/// Columns with the same rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Name of the array or topic; empty of the only table of a file.
    pub name: String,
    /// What it is: `table`, `float64`, `sensor_msgs/msg/JointState`.
    pub kind: String,
    /// Extent along each dimension; of a table or topic the number of rows.
    pub shape: Vec<usize>,
    /// Its columns; none where it cannot be read, as `kind` says.
    pub columns: Vec<Column>,
    /// Time stamps of the rows of a topic, ns since 1970; empty of tables and arrays.
    pub stamps_ns: Vec<i64>,
    /// Line of each row of a text file; empty elsewhere.
    pub lines: Vec<usize>,
    /// What its column of time counts from, ns since 1970; `None` where the file does not say it or has it in the numbers.
    pub epoch_ns: Option<i64>,
}

/// Numbers of one quantity, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// By which a mapping addresses it; unique within a recording unless the file repeats it.
    pub name: String,
    /// Unit that the file names, as the file writes it.
    pub unit: Option<String>,
    /// The numbers; NaN where a cell is missing or a text.
    pub numbers: Vec<f64>,
    /// The cells of a text file; empty where all cells are binary numbers.
    pub texts: Vec<String>,
}

/// A number that means a missing value is farther from the others than this many times their range: -9999 beside 0 to 1000.
const CODE_GAP: f64 = 5.0;

impl Column {
    /// A column of binary numbers.
    pub(crate) fn of_numbers(name: impl Into<String>, numbers: Vec<f64>) -> Self {
        Self { name: name.into(), numbers: numbers.into_iter().map(finite).collect(), ..Self::default() }
    }

    /// Leaves cells with one of these numbers empty.
    fn leave_out(&mut self, numbers: &[f64]) {
        for (row, number) in self.numbers.iter_mut().enumerate().filter(|(_, number)| numbers.contains(number)) {
            *number = f64::NAN;
            self.texts.get_mut(row).into_iter().for_each(String::clear);
        }
    }

    /// A number that several cells have, far from all others, which programs write for no value; how many have it, and the range of the
    /// others. Zero is a value: that of a supply which is off, for example.
    pub(crate) fn code(&self) -> Option<(f64, usize, [f64; 2])> {
        self.range()?.into_iter().filter(|code| *code != 0.0).find_map(|code| {
            let [low, high] = range(self.numbers.iter().copied().filter(|number| *number != code))?;
            let n = self.numbers.iter().filter(|number| **number == code).count();
            let gap = (low - code).max(code - high);
            (n > 1 && gap > CODE_GAP * (high - low) && high > low).then_some((code, n, [low, high]))
        })
    }

    /// The first cell that is neither missing nor a number, with its row.
    pub fn first_text(&self) -> Option<(usize, &str)> {
        let is_text = |(row, text): &(usize, &String)| self.numbers[*row].is_nan() && !is_missing(text);
        self.texts.iter().enumerate().find(is_text).map(|(row, text)| (row, text.as_str()))
    }

    /// The cells that are neither missing nor a number, of few beside numbers: `ERR`, `overflow`. More are states.
    pub(crate) fn stray(&self) -> Vec<&str> {
        let is_text = |(row, text): &(usize, &String)| self.numbers[*row].is_nan() && !is_missing(text);
        let stray: Vec<&str> = self.texts.iter().enumerate().filter(is_text).map(|(_, text)| text.as_str()).collect();
        // A column whose name has a unit has no states.
        let share = if self.unit.is_some() { 2 } else { 10 };
        if share * stray.len() <= self.n_values() { stray } else { Vec::new() }
    }

    /// Whether all cells with a value are numbers, but for a few strays.
    pub(crate) fn is_mostly_numeric(&self) -> bool {
        self.is_numeric() || !self.stray().is_empty()
    }

    /// Whether all cells with a value are numbers.
    pub fn is_numeric(&self) -> bool {
        self.first_text().is_none()
    }

    /// Number of cells with a value.
    pub fn n_values(&self) -> usize {
        let is_value = |row: &usize| match self.texts.get(*row) {
            Some(text) => !is_missing(text),
            None => !self.numbers[*row].is_nan(),
        };
        (0..self.numbers.len()).filter(is_value).count()
    }

    /// Smallest and largest finite number.
    pub fn range(&self) -> Option<[f64; 2]> {
        range(self.numbers.iter().copied())
    }
}

impl Recording {
    /// Leaves all cells with one of these numbers empty: they mean a missing value.
    pub fn leave_out(&mut self, numbers: &[f64]) {
        let columns = self.parts.iter_mut().flat_map(|part| &mut part.columns);
        columns.for_each(|column| column.leave_out(numbers));
    }
}

impl Part {
    /// Whether it is the table of a text file.
    pub fn is_text_table(&self) -> bool {
        !self.lines.is_empty()
    }

    /// Number of rows of its columns.
    pub fn n_rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.numbers.len())
    }

    /// How messages call it.
    pub(crate) fn shown(&self) -> &str {
        if self.name.is_empty() { "table" } else { &self.name }
    }
}

/// Smallest and largest finite number.
fn range(numbers: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let finite = numbers.filter(|number| number.is_finite());
    finite.fold(None, |range, x| Some(range.map_or([x; 2], |[low, high]: [f64; 2]| [low.min(x), high.max(x)])))
}

/// The number, NaN where it is infinite: no quantity is, and programs write it after a division by zero.
fn finite(number: f64) -> f64 {
    if number.is_finite() { number } else { f64::NAN }
}

/// Whether a cell of a text file has no value: words of programs for it, infinity, NaN as the C library prints it, errors of spreadsheets.
pub(crate) fn is_missing(cell: &str) -> bool {
    const WORDS: [&str; 14] =
        ["nan", "na", "n/a", "n.a.", "#n/a", "<na>", "null", "none", "nil", "nat", "missing", "undefined", "?", "."];
    let cell = cell.trim().to_ascii_lowercase();
    // Of any length: programs fill the width of a column.
    let is_dashes = cell.chars().all(|c| matches!(c, '-' | '–' | '—'));
    let size = cell.trim_start_matches(['+', '-']);
    let is_of_c = size.starts_with("nan(") || size.starts_with("1.#") || size == "nan";
    let is_error = cell.strip_prefix('#').is_some_and(|word| word.ends_with(['!', '?']) && !word.contains(' '));
    let is_infinite = cell.parse().is_ok_and(f64::is_infinite);
    is_dashes || is_of_c || is_error || is_infinite || WORDS.contains(&cell.as_str())
}

/// A row of cells and its line.
pub(crate) struct Row {
    pub(crate) line: usize,
    pub(crate) cells: Vec<String>,
}

/// A number as text; `inf` and `nan` are NaN, digits with other signs between are not. A minus may be that of typesetting, and
/// the exponent of Fortran, `1.5D+00`.
pub(crate) fn number(cell: &str) -> Option<f64> {
    let cell = cell.trim();
    cell.parse().ok().map(finite).or_else(|| {
        let is_plain =
            cell.chars().all(|c| c.is_ascii_digit() || matches!(c, '+' | '-' | '\u{2212}' | '.' | 'D' | 'E' | 'e'));
        let is_one = is_plain && (cell.contains('\u{2212}') || cell.contains('.') && cell.contains('D'));
        is_one.then(|| cell.replace('\u{2212}', "-").replace('D', "e").parse().ok())?
    })
}
