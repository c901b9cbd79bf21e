//! The page `docs/measured.md`, written from the committed files of figures and the goals.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use serde::Deserialize;

use crate::figure::{Figure, Figures, short};
use crate::goals::Goals;

/// The list of the files in a folder of figures.
pub const INDEX: &str = "index.toml";

const HEAD: &str = "\
# Measured

<!-- Written by `cargo xtask measured` from docs/figures and tests/goals.toml: do not edit. -->

Each command writes its figures with `--json FILE`. The figures below are those of the files in `docs/figures`; the goals
are in `tests/goals.toml`.
";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Index {
    figures: Vec<Entry>,
    #[serde(default)]
    tables: Vec<Table>,
}

/// Figures of several subjects side by side.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    title: String,
    note: Option<String>,
    /// Names of the subjects.
    columns: Vec<String>,
    rows: Vec<Row>,
}

/// One figure of each subject.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    title: String,
    /// File and name of the figure of each subject; both empty where it has none.
    of: Vec<[String; 2]>,
}

/// One file of figures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    file: String,
    title: String,
    command: String,
    note: Option<String>,
}

/// The page for a folder of figures.
///
/// # Errors
///
/// A file of the folder is not in its index or cannot be read, or a goal is not a bound.
pub fn page(folder: &Path, goals: &Goals) -> Result<String> {
    let index = folder.join(INDEX);
    let text = std::fs::read_to_string(&index).with_context(|| format!("{} cannot be read", index.display()))?;
    let index: Index = toml::from_str(&text).with_context(|| index.display().to_string())?;
    every_file_is_listed(folder, &index)?;
    let (mut sections, mut missed, mut with_goal) = (String::new(), String::new(), 0);
    let mut files = BTreeMap::new();
    for entry in &index.figures {
        let mut figures = Figures::read(&folder.join(&entry.file))?;
        for figure in &mut figures.rows {
            // The goals of today, which may be others than those at the time of the measurement.
            (figure.goal, figure.met) = goals.judge(&figure.name, figure.value)?.unzip();
            with_goal += usize::from(figure.goal.is_some());
        }
        let Entry { title, command, note, .. } = entry;
        // Writing to a string cannot fail.
        let _ = writeln!(sections, "\n## {title}\n\n`{command}`{}\n", note_of(note.as_deref()));
        sections.push_str("| figure | value | goal | |\n| --- | --- | --- | --- |\n");
        for figure in &figures.rows {
            let _ = writeln!(sections, "| {} | {} |", row(figure), verdict(figure));
            if figure.met == Some(false) {
                let _ = writeln!(missed, "| {} | `{command}` |", row(figure));
            }
        }
        files.insert(entry.file.as_str(), figures);
    }
    let n_missed = missed.lines().count();
    let mut page = format!("{HEAD}\nOf {with_goal} figures with a goal {n_missed} miss it:\n\n");
    if n_missed > 0 {
        page += "| figure | value | goal | command |\n| --- | --- | --- | --- |\n";
        page += &missed;
    }
    for table in &index.tables {
        page += &side_by_side(&files, table)?;
    }
    Ok(page + &sections)
}

fn side_by_side(files: &BTreeMap<&str, Figures>, table: &Table) -> Result<String> {
    let Table { title, note, columns, rows } = table;
    let mut text = format!("\n## {title}\n\n");
    text.extend(note.iter().map(|note| format!("{note}\n\n")));
    text += &format!("| figure | {} |\n| --- |{}\n", columns.join(" | "), " --- |".repeat(columns.len()));
    for Row { title, of } in rows {
        ensure!(of.len() == columns.len(), "{INDEX}: {title:?} has {} figures, give {}", of.len(), columns.len());
        let values = of.iter().map(|[file, name]| value_in(files, file, name)).collect::<Result<Vec<_>>>()?;
        text += &format!("| {} | {} |\n", cell(title), values.join(" | "));
    }
    Ok(text)
}

/// The value of a figure with its unit; a dash where no file is named.
fn value_in(files: &BTreeMap<&str, Figures>, file: &str, name: &str) -> Result<String> {
    if file.is_empty() {
        return Ok("–".into());
    }
    let figures = files.get(file).with_context(|| format!("{INDEX}: {file} is not among its figures"))?;
    let found = figures.rows.iter().find(|figure| figure.name == name);
    let Figure { value, unit, .. } = found.with_context(|| format!("{INDEX}: {file} has no figure {name:?}"))?;
    Ok(cell(format!("{} {unit}", short(*value)).trim_end()))
}

fn note_of(note: Option<&str>) -> String {
    note.map_or(String::new(), |note| format!(": {note}"))
}

fn row(Figure { name, value, unit, goal, .. }: &Figure) -> String {
    let value = format!("{} {unit}", short(*value));
    format!("{} | {} | {}", cell(name), cell(value.trim_end()), cell(goal.as_deref().unwrap_or_default()))
}

/// A text that does not end its cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

fn verdict(figure: &Figure) -> &'static str {
    match figure.met {
        Some(true) => "met",
        Some(false) => "**missed**",
        None => "",
    }
}

fn every_file_is_listed(folder: &Path, index: &Index) -> Result<()> {
    for entry in std::fs::read_dir(folder).with_context(|| format!("{} cannot be read", folder.display()))? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_listed = index.figures.iter().any(|entry| entry.file == name);
        ensure!(
            is_listed || path.extension().is_none_or(|extension| extension != "json"),
            "{} is not in {INDEX}; add its title and its command",
            path.display()
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_committed_page_is_that_of_the_committed_figures() {
        let root = crate::root();
        let goals = Goals::read(&root.join("tests/goals.toml")).unwrap();
        let page = page(&root.join("docs/figures"), &goals).unwrap();
        let committed = std::fs::read_to_string(root.join("docs/measured.md")).unwrap();
        assert!(page == committed, "docs/measured.md is not up to date: run `cargo xtask measured`");
    }

    #[test]
    fn goals_of_today_are_judged_and_missed_ones_come_first() {
        let folder = tempfile::tempdir().unwrap();
        let figure = |name: &str, value| Figure { unit: "mm".into(), ..Figure::new(name, value, "").unwrap() };
        let figures = Figures::new(vec![figure("far | wide", 2.5), figure("near", 0.5), figure("free", 7.0)], 1);
        figures.write(&folder.path().join("a.json")).unwrap();
        let index = "[[figures]]\nfile = \"a.json\"\ntitle = \"Errors\"\ncommand = \"measure\"\nnote = \"a minute\"\n";
        std::fs::write(folder.path().join(INDEX), index).unwrap();
        let goals_file = folder.path().join("goals.toml");
        std::fs::write(&goals_file, "\"far | wide\" = \"<= 1\"\n\"near\" = \"<= 1\"\n").unwrap();
        let goals = Goals::read(&goals_file).unwrap();
        let page = page(folder.path(), &goals).unwrap();
        assert!(page.contains("Of 2 figures with a goal 1 miss it"), "{page}");
        assert!(page.contains("| far \\| wide | 2.500 mm | <= 1 | `measure` |"), "{page}");
        assert!(page.contains("## Errors\n\n`measure`: a minute\n"), "{page}");
        assert!(page.contains("| near | 0.500 mm | <= 1 | met |\n| free | 7 mm |  |  |\n"), "{page}");
        let table = "[[tables]]\ntitle = \"Both\"\ncolumns = [\"a\", \"b\"]\n\
                     rows = [{ title = \"Nearest\", of = [[\"a.json\", \"near\"], [\"\", \"\"]] }]\n";
        std::fs::write(folder.path().join(INDEX), index.to_owned() + table).unwrap();
        let with_table = super::page(folder.path(), &goals).unwrap();
        assert!(with_table.contains("## Both\n\n| figure | a | b |\n| --- | --- | --- |\n| Nearest | 0.500 mm | – |"));
        figures.write(&folder.path().join("b.json")).unwrap();
        let error = super::page(folder.path(), &goals).unwrap_err().to_string();
        assert!(error.contains("b.json is not in index.toml"), "{error}");
    }
}
