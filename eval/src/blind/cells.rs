//! A log as a text of cells: what damages it reads and writes no numbers but those in the cells.

use darm_measure::csv_text::{csv_cells, csv_text};
use std::path::Path;

use anyhow::{Context as _, Result};
use darm_measure::table::{Names, Table};

/// Header and rows of a table.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    pub(super) header: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Cells {
    /// Those of comma-separated text with a header.
    pub(super) fn of(text: &str) -> Self {
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let header = lines.next().map(csv_cells).expect("a log that was written has a header");
        Self { header, rows: lines.map(csv_cells).collect() }
    }

    /// The text again.
    pub(super) fn text(&self) -> String {
        csv_text(std::iter::once(&self.header).chain(&self.rows))
    }

    /// The table that a command would read.
    pub(super) fn table(&self) -> Result<Table> {
        Ok(Table::read_text(Path::new("damaged.csv"), self.text().as_bytes(), &Names::new())?.0)
    }

    /// The numbers of the columns whose names begin so.
    pub(super) fn columns(&self, beginning: &str) -> Vec<usize> {
        (0..self.header.len()).filter(|&k| self.header[k].starts_with(beginning)).collect()
    }

    /// The number of the column whose name begins so; a sort of damage names columns that its logs have.
    pub(super) fn column(&self, beginning: &str) -> usize {
        self.columns(beginning)[0]
    }

    /// The numbers in a column.
    pub(super) fn numbers(&self, column: usize) -> Result<Vec<f64>> {
        let number = |row: &Vec<String>| row[column].parse().with_context(|| format!("`{}`", row[column]));
        self.rows.iter().map(number).collect()
    }

    /// Changes the number of every cell of a column; other text stays.
    pub(super) fn change(&mut self, column: usize, mut change: impl FnMut(f64) -> f64) {
        for row in &mut self.rows {
            if let Ok(number) = row[column].parse::<f64>() {
                row[column] = format!("{:.9}", change(number));
            }
        }
    }

    /// Changes the text of every cell of the columns that have this beginning.
    pub(super) fn rewrite(&mut self, beginning: &str, change: impl Fn(&str) -> String) {
        for column in self.columns(beginning) {
            self.rows.iter_mut().for_each(|row| row[column] = change(&row[column]));
        }
    }

    /// Exchanges what two columns hold.
    pub(super) fn swap(&mut self, a: usize, b: usize) {
        self.rows.iter_mut().for_each(|row| row.swap(a, b));
    }

    /// Gives each row the cells of these columns that another row has, where there is one.
    pub(super) fn take(&mut self, columns: &[usize], of: impl Fn(usize) -> usize) {
        let before = self.rows.clone();
        for (k, row) in self.rows.iter_mut().enumerate() {
            let Some(other) = before.get(of(k)) else { continue };
            columns.iter().for_each(|&column| row[column].clone_from(&other[column]));
        }
    }
}
