//! Arrays of numbers: files of NumPy and MATLAB, and the columns that they give.

pub(crate) mod mat;
pub(crate) mod npy;
mod python_literal;

use darm_robot::files::Limits;

use crate::import::error::Fault;
use crate::import::recording::{Column, Part};

/// Most columns of one array: more are samples of an image, say, and no columns of a table.
const MAX_COLUMNS: usize = 1024;

/// An array, its first index running fastest.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    pub(crate) name: String,
    /// Type of its numbers: `float64`, `int32`; or why they are not read.
    pub(crate) kind: String,
    pub(crate) shape: Vec<usize>,
    /// `None` where they are not read.
    pub(crate) numbers: Option<Vec<f64>>,
}

impl Array {
    /// Rows and columns; a vector is a column, whichever way it lies.
    fn rows_and_columns(&self) -> Option<(usize, usize)> {
        match *self.shape {
            [] => Some((1, 1)),
            [n] => Some((n, 1)),
            [1, n] if n > 1 => Some((n, 1)),
            [n, m] => Some((n, m)),
            _ => None,
        }
    }
}

/// What arrays may still take of memory, of all in a file together.
pub(crate) struct Room {
    pub(crate) bytes: u64,
    numbers: usize,
    arrays: usize,
    limits: Limits,
}

impl Room {
    pub(crate) fn new(limits: &Limits) -> Self {
        Self { bytes: limits.bytes, numbers: limits.cells, arrays: limits.columns, limits: *limits }
    }

    /// Takes an array with this number of elements, before it is read.
    pub(crate) fn take(&mut self, numbers: usize) -> Result<(), Fault> {
        let left = self.numbers.checked_sub(numbers).zip(self.arrays.checked_sub(1));
        (self.numbers, self.arrays) = left.ok_or_else(|| self.full())?;
        Ok(())
    }

    /// Whether there is room for this number of names, before they are read: a name takes 24 bytes and an allocation more than in
    /// the file.
    pub(crate) fn check_names(&self, names: usize) -> Result<(), Fault> {
        if names <= self.limits.columns { Ok(()) } else { Err(self.full()) }
    }

    fn full(&self) -> Fault {
        let Limits { cells, columns, .. } = self.limits;
        Fault::of_file(format!("the file has more than {cells} numbers or {columns} arrays: save a part of it"))
    }
}

/// Arrays as parts. Where the rows of a matrix are as many as the samples of the others, and its columns are not, it is
/// addressed row by row.
pub(crate) fn parts(arrays: Vec<Array>) -> Vec<Part> {
    let read = arrays.iter().filter(|array| array.numbers.as_ref().is_some_and(|numbers| !numbers.is_empty()));
    let lengths: Vec<usize> = read.filter_map(|array| Some(array.rows_and_columns()?.0)).collect();
    let votes = |n: usize| lengths.iter().filter(|length| **length == n).count();
    let samples = lengths.iter().copied().max_by_key(|&n| (votes(n), n)).unwrap_or(0);
    arrays.into_iter().map(|array| part(array, samples)).collect()
}

fn part(array: Array, samples: usize) -> Part {
    let Array { name, kind, shape, numbers } = &array;
    let part =
        |kind: String, columns| Part { name: name.clone(), kind, shape: shape.clone(), columns, ..Part::default() };
    let Some(numbers) = numbers else { return part(kind.clone(), Vec::new()) };
    let Some((rows, columns)) = array.rows_and_columns() else {
        return part(format!("{kind}, not read: {} dimensions, at most 2 are", shape.len()), Vec::new());
    };
    let lies = rows != samples && (columns == samples || rows < columns);
    if columns == 1 {
        return part(kind.clone(), vec![Column::of_numbers(name, numbers.clone())]);
    }
    let (n, length) = if lies { (rows, columns) } else { (columns, rows) };
    if n > MAX_COLUMNS {
        return part(format!("{kind}, not read: {n} columns, at most {MAX_COLUMNS} are"), Vec::new());
    }
    let cell = |row: usize, column: usize| numbers[row + column * rows];
    let column = |k: usize| match lies {
        true => Column::of_numbers(format!("{name}[{k},:]"), (0..length).map(|at| cell(k, at)).collect()),
        false => Column::of_numbers(format!("{name}[:,{k}]"), (0..length).map(|at| cell(at, k)).collect()),
    };
    part(kind.clone(), (0..n).map(column).collect())
}
