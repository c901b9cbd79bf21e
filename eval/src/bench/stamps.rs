//! Real measurements with worse time stamps: off by jitter, rounded, rows lost. Their errors and names beside those of the
//! sets as they are.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use darm_figures::figure::Figure;
use darm_measure::csv_text::csv_text;
use darm_measure::table::{Names, Table};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::measured::{CASES, Case, build, effects};
use crate::blind::Layout;

/// What is done to the stamps.
const LAYOUTS: [Layout; 3] = [Layout::Jitter, Layout::LostRows, Layout::RoundedStamps];
/// The column of time.
const TIME: &str = "t";

/// An error with other stamps is as good as the clean one when it lies within this share of it.
const AS_GOOD: f64 = 0.15;

/// One set with other stamps, beside itself as it is.
struct Comparison {
    set: String,
    layout: &'static str,
    /// Of the errors the one that differs most, as a share of the clean one.
    change: f64,
    new_names: usize,
}

/// Runs all sets that have stamps; those that are in `folder` only are left out without it.
pub(super) fn measure(folder: Option<&Path>) -> Result<Vec<Figure>> {
    let program = build()?;
    let mut all = Vec::new();
    for case in CASES {
        let Some(data) = case.table(folder) else { continue };
        let table = Table::read(&data, &Names::new())?.0;
        if table.columns.iter().any(|column| column.name == TIME) {
            all.extend(compared_to_clean(case, &program, (&data, &table))?);
        }
    }
    let mut figures = Vec::new();
    for layout in LAYOUTS.map(name) {
        let count =
            |so: fn(&Comparison) -> bool| all.iter().filter(|one| one.layout == layout && so(one)).count() as f64;
        let of = |what: &str, count: f64| Figure::new(&format!("stamps {layout}: {what}"), count, "");
        figures.push(of("sets with an error more than 15 % off", count(|one| one.change.abs() > AS_GOOD))?);
        figures.push(of("sets with a new name", count(|one| one.new_names > 0))?);
    }
    for Comparison { set, layout, change, new_names } in &all {
        figures.push(Figure::new(&format!("{set}, {layout}: change of an error"), (1e3 * change).round() / 10.0, "%")?);
        figures.push(Figure::new(&format!("{set}, {layout}: new names"), *new_names as f64, "")?);
    }
    Ok(figures)
}

/// One set in all layouts.
fn compared_to_clean(case: &Case, program: &Path, (data, table): (&Path, &Table)) -> Result<Vec<Comparison>> {
    let clean = Answer::of(case, program, data)?;
    println!("{}: {:.3?}", case.name(), clean.errors);
    LAYOUTS.into_iter().map(|layout| clean.compared(case, program, (layout, table))).collect()
}

/// What a diagnosis gave.
struct Answer {
    errors: Vec<f64>,
    names: BTreeSet<String>,
}

impl Answer {
    fn of(case: &Case, program: &Path, data: &Path) -> Result<Self> {
        let report = case.diagnosed(program, data)?.0;
        Ok(Self { errors: case.errors(&report)?, names: names(&report) })
    }

    /// That to the same table with other stamps, compared to this one.
    fn compared(&self, case: &Case, program: &Path, (layout, table): (Layout, &Table)) -> Result<Comparison> {
        let path = written(&changed(table, layout)?)?;
        let other = Self::of(case, program, &path)?;
        std::fs::remove_file(&path)?;
        let changes = other.errors.iter().zip(&self.errors).map(|(error, clean)| error / clean - 1.0);
        let change = changes.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or_default();
        let new: Vec<&String> = other.names.difference(&self.names).collect();
        println!("  {}: {:.3?}, new names: {new:?}", name(layout), other.errors);
        Ok(Comparison { set: case.name(), layout: name(layout), change, new_names: new.len() })
    }
}

fn name(layout: Layout) -> &'static str {
    match layout {
        Layout::Jitter => "off by jitter",
        Layout::LostRows => "with rows lost",
        _ => "rounded",
    }
}

/// Laws and places that are named.
fn names(answer: &Value) -> BTreeSet<String> {
    let text = |effect: &Value, key: &str| effect[key].as_str().unwrap_or_default().to_owned();
    effects(answer).iter().map(|effect| text(effect, "law") + " " + &text(effect, "where")).collect()
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
