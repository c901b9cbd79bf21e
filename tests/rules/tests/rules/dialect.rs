//! Texts that users see, documents and names against the words in `tests/dialect.toml`.
//!
//! Texts are the string literals of the programs, their comments and the Markdown files, all outside code. Names are
//! compared word by word: `HeldOut` and `held_out` are two words.

use std::collections::BTreeMap;

use darm_rules::{Source, assert_none, files, sources};
use syn::visit::{self, Visit};
use toml_edit::DocumentMut;

/// Folders with programs whose texts users see.
const PROGRAMS: [&str; 5] = ["shared", "host", "firmware", "eval", "xtask"];
/// Folder whose documentation comments are the help of the command line: texts for users.
const HELP: &str = "host/cli/src/commands";

/// The sources of the programs, without tests.
fn programs() -> impl Iterator<Item = Source> {
    let is_program = |source: &Source| PROGRAMS.iter().any(|folder| source.path.starts_with(&format!("{folder}/")));
    sources().into_iter().filter(move |source| is_program(source) && !source.is_test())
}

/// A stretch of text with the number of its line.
struct Text {
    line: usize,
    text: String,
}

/// String literals and comments of a source, without its tests.
#[derive(Default)]
struct Parts {
    literals: Vec<Text>,
    comments: Vec<Text>,
}

impl Parts {
    fn of(code: &str) -> Self {
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
            self.comments.push(Text { line, text: comment[..length].trim_start_matches(['/', '!']).to_owned() });
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
            found.push(Text { line: number, text: outside_code(line) });
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
    let document: DocumentMut = include_str!("../../../dialect.toml").parse().expect("valid TOML");
    let table = document[name].as_table().expect("a table");
    table.iter().map(|(key, value)| (key.to_owned(), value.as_str().unwrap_or_default().to_owned())).collect()
}

/// The text outside spans of code.
fn outside_code(text: &str) -> String {
    text.split('`').step_by(2).collect::<Vec<_>>().join(" ")
}

#[test]
fn texts_use_the_terms_of_the_field() {
    let (words, user_words) = (table("words"), table("user_words"));
    let mut hits = Vec::new();
    let mut look = |file: &str, texts: &[Text], is_for_users: bool| {
        for Text { line, text } in texts {
            let for_users = user_words.iter().filter(|_| is_for_users);
            let found = words.iter().chain(for_users).filter(|(word, _)| contains(text, word));
            hits.extend(found.map(|(word, term)| format!("{file}:{line}: `{word}`: write {term}")));
        }
    };
    for source in programs() {
        let parts = Parts::of(source.code());
        // A literal of one word is a key or a name.
        let texts: Vec<Text> = parts.literals.into_iter().filter(|text| text.text.trim().contains(' ')).collect();
        look(&source.path, &texts, true);
        let comments = parts.comments.into_iter().map(|comment| Text { text: outside_code(&comment.text), ..comment });
        look(&source.path, &comments.collect::<Vec<_>>(), source.path.starts_with(HELP));
    }
    for source in files("md") {
        look(&source.path, &prose(&source.text), true);
    }
    assert_none(hits);
}

/// The names that a source declares, with their lines.
#[derive(Default)]
struct Names {
    items: Vec<(usize, String)>,
    variables: Vec<(usize, String)>,
}

impl Names {
    fn add(&mut self, ident: &syn::Ident) {
        self.items.push((ident.span().start().line, ident.to_string()));
    }
}

/// Visits a declaration with the field `ident`, and what is inside it.
macro_rules! declared {
    ($($visit:ident: $node:ident),* $(,)?) => {
        $(fn $visit(&mut self, node: &'ast syn::$node) {
            self.add(&node.ident);
            visit::$visit(self, node);
        })*
    };
}

impl<'ast> Visit<'ast> for Names {
    declared!(
        visit_signature: Signature,
        visit_item_struct: ItemStruct,
        visit_item_enum: ItemEnum,
        visit_item_trait: ItemTrait,
        visit_item_type: ItemType,
        visit_item_const: ItemConst,
        visit_item_static: ItemStatic,
        visit_item_mod: ItemMod,
        visit_impl_item_const: ImplItemConst,
        visit_variant: Variant,
    );

    fn visit_pat_ident(&mut self, pattern: &'ast syn::PatIdent) {
        self.variables.push((pattern.ident.span().start().line, pattern.ident.to_string()));
        visit::visit_pat_ident(self, pattern);
    }

    fn visit_field(&mut self, field: &'ast syn::Field) {
        field.ident.iter().for_each(|ident| self.add(ident));
        visit::visit_field(self, field);
    }
}

/// The words of a name in lower case: `held`, `out`, `m` of `held_out_m`, and `held`, `out` of `HeldOut`.
fn words_of(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = '_';
    for letter in name.chars() {
        if letter == '_' || letter.is_uppercase() && before.is_lowercase() {
            words.push(String::new());
        }
        if letter != '_' {
            words.last_mut().expect("one word at least").extend(letter.to_lowercase());
        }
        before = letter;
    }
    words
}

#[test]
fn names_use_the_terms_of_the_field() {
    let (names, terms) = (table("names"), table("terms"));
    let mut hits = Vec::new();
    for source in programs() {
        let mut declared = Names::default();
        declared.visit_file(&syn::parse_file(source.code()).expect("a source that compiles"));
        for (line, name) in declared.items.into_iter().chain(declared.variables) {
            let text = terms.keys().fold(words_of(&name).join(" "), |text, term| text.replace(term.as_str(), ""));
            let found = text.split(' ').find_map(|word| names.get(word));
            hits.extend(found.map(|term| format!("{}:{line}: `{name}`: name it {term}", source.path)));
        }
    }
    assert_none(hits);
}

#[test]
fn literals_and_phrases_are_found() {
    let source =
        Parts::of("//! Told.\nlet a = \"x \\\n   \\\"told\\\" y\"; // \"told\"\nlet b = ('\"', r#\"so \"many\"#);\n");
    let literals: Vec<_> = source.literals.iter().map(|text| text.text.as_str()).collect();
    assert_eq!((literals, source.comments.len()), (vec!["x  told  y", "so \"many"], 2));
    assert!(contains("as Told.", "told") && !contains("untold", "told") && !contains("whole-body", "whole"));
    assert_eq!(prose("a `told` b\n```sh\ntold\n```\n").iter().filter(|text| contains(&text.text, "told")).count(), 0);
}

#[test]
fn names_are_split_into_words() {
    assert_eq!(words_of("held_out_m").join(" "), "held out m");
    assert_eq!(words_of("HeldOut").join(" "), "held out");
    assert_eq!(words_of("MOST_NS").join(" "), "most ns");
}
