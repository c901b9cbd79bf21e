//! A log as a text of cells: what damages it reads and writes no numbers but those in the cells.

use std::path::Path;

use anyhow::{Context as _, Result};
use darm_diagnose::measurement::table::{Names, Table};

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
        let cells = |line: &str| line.split(',').map(str::to_string).collect::<Vec<_>>();
        let header = lines.next().map(cells).unwrap_or_default();
        Self { header, rows: lines.map(cells).collect() }
    }

    /// The text again.
    pub(super) fn text(&self) -> String {
        let lines = std::iter::once(&self.header).chain(&self.rows);
        lines.map(|cells| cells.join(",") + "\n").collect()
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
