//! Real measurements with worse time stamps: off by jitter, rounded, rows lost. Their errors and names beside those of the
//! sets as they are.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use clap::ValueEnum as _;
use darm_diagnose::measurement::csv_text::csv_text;
use darm_diagnose::measurement::table::{Names, Table};
use darm_figures::figure::Figure;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::measured::{CASES, Case, build};
use crate::blind::Layout;

/// What is done to the stamps.
const LAYOUTS: [Layout; 3] = [Layout::Jitter, Layout::LostRows, Layout::RoundedStamps];
/// The column of time.
const TIME: &str = "t";

/// Runs all sets that have stamps; those that are in `folder` only are left out without it.
pub(super) fn measure(folder: Option<&Path>) -> Result<Vec<Figure>> {
    let program = build()?;
    let mut figures = Vec::new();
    for case in CASES {
        let Some(data) = case.table(folder) else { continue };
        let table = Table::read(&data, &Names::new())?.0;
        if table.columns.iter().any(|column| column.name == TIME) {
            figures.extend(beside_clean(case, &program, (&data, &table))?);
        }
    }
    Ok(figures)
}

/// One set in all layouts.
fn beside_clean(case: &Case, program: &Path, (data, table): (&Path, &Table)) -> Result<Vec<Figure>> {
    let clean = case.diagnosed(program, data)?.0;
    println!("{}: {:.3?} {}", case.name(), case.errors(&clean)?, clean["verdict"]);
    let mut figures = Vec::new();
    for layout in LAYOUTS {
        let value = layout.to_possible_value().context("a layout without a name")?;
        let path = written(&changed(table, layout)?)?;
        let answer = case.diagnosed(program, &path)?.0;
        std::fs::remove_file(&path)?;
        let (errors, clean_errors) = (case.errors(&answer)?, case.errors(&clean)?);
        let changes = errors.iter().zip(&clean_errors).map(|(error, clean)| 100.0 * (error / clean - 1.0));
        let largest =
            changes.fold(0.0, |largest: f64, change| if change.abs() > largest.abs() { change } else { largest });
        let new: Vec<String> = names(&answer).difference(&names(&clean)).cloned().collect();
        println!("  {}: {errors:.3?} {} {}", value.get_name(), answer["verdict"], new.join(", "));
        let name = format!("stamps: {}, {}", case.name(), value.get_name());
        figures.push(Figure::new(&format!("{name}: change of an error"), (10.0 * largest).round() / 10.0, "%")?);
        figures.push(Figure::new(&format!("{name}: new names"), new.len() as f64, "")?);
    }
    Ok(figures)
}

/// Laws and places that are named.
fn names(answer: &Value) -> BTreeSet<String> {
    let effects = answer["effects"].as_array().map_or(&[][..], Vec::as_slice);
    let text = |effect: &Value, key: &str| effect[key].as_str().unwrap_or_default().to_owned();
    effects.iter().map(|effect| text(effect, "law") + " " + &text(effect, "where")).collect()
}

/// The table as text, its stamps changed.
fn changed(table: &Table, layout: Layout) -> Result<String> {
    let time = table.columns.iter().find(|column| column.name == TIME).context("a table without time")?;
    let mut time_s = time.numbers.clone();
    let kept = layout.change_stamps(&mut time_s, &mut ChaCha8Rng::seed_from_u64(super::SEED));
    let header: Vec<String> = table.columns.iter().map(|column| column.name.clone()).collect();
    let row = |row: usize| -> Vec<String> {
        let cells = table.columns.iter().map(|column| match column.name == TIME {
            true => format!("{:.6}", time_s[row]),
            false => column.words[row].clone(),
        });
        cells.collect()
    };
    let rows = (0..kept.len()).filter(|&row| kept[row]).map(row);
    Ok(csv_text(std::iter::once(header).chain(rows)))
}

/// A file with this text.
fn written(text: &str) -> Result<PathBuf> {
    let path = std::env::temp_dir().join(format!("darm-stamps-{}.csv", std::process::id()));
    std::fs::write(&path, text)?;
    Ok(path)
}
