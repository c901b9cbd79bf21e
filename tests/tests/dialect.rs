//! Texts that users see, documents and names against the words in `tests/dialect.toml`.
//!
//! Texts are the string literals of the programs, the documentation comments of the command line (its help), and the
//! Markdown files outside code.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use toml_edit::DocumentMut;

/// Folders with programs whose texts users see.
const PROGRAMS: [&str; 5] = ["shared", "host", "firmware", "eval", "xtask"];
/// Folder whose documentation comments are the help of the command line.
const HELP: &str = "host/cli/src/commands";
/// Folders that hold no sources of ours.
const SKIPPED: [&str; 2] = ["target", ".git"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the workspace").to_path_buf()
}

/// All files with this extension, with their path from the root.
fn files(folder: &str, extension: &str) -> Vec<(String, String)> {
    let (mut found, mut folders) = (Vec::new(), vec![root().join(folder)]);
    while let Some(folder) = folders.pop() {
        for path in
            fs::read_dir(folder).expect("a folder of the workspace").map(|entry| entry.expect("an entry").path())
        {
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            if path.is_dir() && !SKIPPED.contains(&name.as_str()) {
                folders.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                let from_root = path.strip_prefix(root()).expect("inside the workspace").display().to_string();
                found.push((from_root, fs::read_to_string(&path).expect("readable text")));
            }
        }
    }
    found.sort();
    found
}

fn is_test(file: &str) -> bool {
    file.contains("/tests/") || file.ends_with("tests.rs") || file.ends_with("cases.rs")
}

/// A stretch of text with the number of its line.
struct Text {
    line: usize,
    text: String,
}

/// String literals and documentation comments of a source, without its tests.
#[derive(Default)]
struct Source {
    literals: Vec<Text>,
    docs: Vec<Text>,
}

impl Source {
    fn of(source: &str) -> Self {
        let code = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or(source);
        let (mut found, mut rest, mut line) = (Self::default(), code, 1);
        while !rest.is_empty() {
            let length = found.token(rest, line);
            line += rest[..length].matches('\n').count();
            rest = &rest[length..];
        }
        found
    }

    /// Takes the token at the beginning of `rest`; its length.
    fn token(&mut self, rest: &str, line: usize) -> usize {
        if let Some(comment) = rest.strip_prefix("//") {
            let length = comment.find('\n').unwrap_or(comment.len());
            if let Some(doc) = comment[..length].strip_prefix(['/', '!']) {
                self.docs.push(Text { line, text: doc.to_owned() });
            }
            return 2 + length;
        }
        if let Some((length, text)) = raw_literal(rest).or_else(|| literal(rest)) {
            self.literals.push(Text { line, text });
            return length;
        }
        // A character such as '"' or '\''; a lifetime has no second quote.
        let mut characters = rest.chars();
        let quoted = match (characters.next(), characters.next(), characters.next()) {
            (Some('\''), Some('\\'), Some(escaped)) => Some(2 + escaped.len_utf8() + 1),
            (Some('\''), Some(character), Some('\'')) => Some(2 + character.len_utf8()),
            _ => None,
        };
        quoted.unwrap_or_else(|| rest.chars().next().map_or(1, char::len_utf8))
    }
}

/// A raw string at the beginning: its length and its text.
fn raw_literal(rest: &str) -> Option<(usize, String)> {
    let hashes = rest.strip_prefix('r')?.chars().take_while(|c| *c == '#').count();
    let inside = rest[1 + hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    let length = inside.find(&end)?;
    Some((2 + hashes + length + end.len(), inside[..length].to_owned()))
}

/// A string at the beginning: its length and its text, with the line ends that it continues over left out.
fn literal(rest: &str) -> Option<(usize, String)> {
    let inside = rest.strip_prefix('"')?;
    let (mut text, mut characters) = (String::new(), inside.char_indices());
    while let Some((at, character)) = characters.next() {
        match character {
            '"' => return Some((at + 2, text)),
            '\\' => match characters.next() {
                Some((_, '\n')) => {
                    let blanks = characters.clone().take_while(|(_, c)| c.is_whitespace()).count();
                    characters.by_ref().take(blanks).for_each(drop);
                }
                _ => text.push(' '),
            },
            _ => text.push(character),
        }
    }
    None
}

/// The prose of a Markdown file: without fences and code.
fn prose(text: &str) -> Vec<Text> {
    let (mut found, mut fenced) = (Vec::new(), false);
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            let words = line.split('`').step_by(2).collect::<Vec<_>>().join(" ");
            found.push(Text { line: number, text: words });
        }
    }
    found
}

/// Whether a phrase is in a text, between characters that belong to no word.
fn contains(text: &str, phrase: &str) -> bool {
    let text = text.to_lowercase();
    let in_word = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    text.match_indices(phrase).any(|(at, _)| {
        let (before, after) = (text[..at].chars().next_back(), text[at + phrase.len()..].chars().next());
        !before.is_some_and(in_word) && !after.is_some_and(in_word)
    })
}

/// A table of `tests/dialect.toml`: strings by key.
fn table(name: &str) -> BTreeMap<String, String> {
    let document: DocumentMut = include_str!("../dialect.toml").parse().expect("valid TOML");
    let table = document[name].as_table().expect("a table");
    table.iter().map(|(key, value)| (key.to_owned(), value.as_str().unwrap_or_default().to_owned())).collect()
}

/// Fails with every hit at once.
fn none(hits: Vec<String>) {
    assert!(hits.is_empty(), "\n{}", hits.join("\n"));
}

#[test]
fn texts_for_users_use_the_terms_of_the_field() {
    let words = table("words");
    let mut hits = Vec::new();
    let mut look = |file: &str, texts: &[Text]| {
        for Text { line, text } in texts {
            let found = words.iter().filter(|(word, _)| contains(text, word));
            hits.extend(found.map(|(word, term)| format!("{file}:{line}: `{word}`: write {term}")));
        }
    };
    for folder in PROGRAMS {
        for (file, text) in files(folder, "rs").iter().filter(|(file, _)| !is_test(file)) {
            let source = Source::of(text);
            // A literal of one word is a key or a name.
            let texts: Vec<Text> = source.literals.into_iter().filter(|text| text.text.trim().contains(' ')).collect();
            look(file, &texts);
            if file.starts_with(HELP) {
                look(file, &source.docs);
            }
        }
    }
    for (file, text) in files(".", "md") {
        look(&file, &prose(&text));
    }
    none(hits);
}

#[test]
fn names_use_the_terms_of_the_field() {
    let names = table("names");
    let keywords = ["fn ", "struct ", "enum ", "trait ", "mod ", "type ", "const ", "static ", "let ", "let mut "];
    let mut hits = Vec::new();
    for folder in PROGRAMS {
        for (file, text) in files(folder, "rs").iter().filter(|(file, _)| !is_test(file)) {
            for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim_start().starts_with("//")) {
                let declared = keywords.iter().filter_map(|keyword| {
                    let (before, rest) = line.split_once(keyword)?;
                    let name = rest.split(|c: char| !(c.is_alphanumeric() || c == '_')).next()?.to_lowercase();
                    before.chars().all(|c| !c.is_alphanumeric() || line.trim_start().starts_with("pub")).then_some(name)
                });
                let found = declared.filter_map(|name| Some((names.get(&name)?, name))).next();
                hits.extend(found.map(|(term, name)| format!("{file}:{number}: `{name}`: name it {term}")));
            }
        }
    }
    none(hits);
}

#[test]
fn literals_and_phrases_are_found() {
    let source =
        Source::of("//! Told.\nlet a = \"x \\\n   \\\"told\\\" y\"; // \"told\"\nlet b = ('\"', r#\"so \"many\"#);\n");
    let literals: Vec<_> = source.literals.iter().map(|text| text.text.as_str()).collect();
    assert_eq!((literals, source.docs.len()), (vec!["x  told  y", "so \"many"], 1));
    assert!(contains("as Told.", "told") && !contains("untold", "told") && !contains("whole-body", "whole"));
    assert_eq!(prose("a `told` b\n```sh\ntold\n```\n").iter().filter(|text| contains(&text.text, "told")).count(), 0);
}
