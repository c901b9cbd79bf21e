//! The book and the pages beside it: links, anchors, paths, fences and the table of contents.
//!
//! The book is checked here from its Markdown, and built as `mdbook build docs` does.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

use mdbook_driver::MDBook;
use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

/// Pages outside the book.
const ROOT_PAGES: [&str; 4] = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"];
/// Languages of fences. `sh` is run by a test of the command line.
const LANGUAGES: [&str; 7] = ["sh", "text", "toml", "rust", "csv", "json", "c"];
/// README: a first page, not a manual.
const README_LINES: usize = 130;

fn root() -> PathBuf {
    xtask::setup::root()
}

/// A Markdown page and what the checks need of it.
struct Page {
    /// Path from the root.
    path: String,
    links: Vec<String>,
    anchors: BTreeSet<String>,
    /// Text between backticks.
    code: Vec<String>,
    fences: Vec<Fence>,
}

struct Fence {
    /// What follows the backticks: language and attributes.
    info: String,
    text: String,
}

/// Every page of the book and of the root, by its path.
fn pages() -> BTreeMap<String, Page> {
    let docs = fs::read_dir(root().join("docs")).expect("the folder of the book").flatten();
    let docs = docs.map(|entry| format!("docs/{}", entry.file_name().display())).filter(|path| path.ends_with(".md"));
    let paths: Vec<_> = docs.chain(ROOT_PAGES.map(String::from)).collect();
    assert!(paths.len() > 15, "the pages were not found");
    paths.into_iter().map(|path| (path.clone(), page(path))).collect()
}

fn page(path: String) -> Page {
    let text = fs::read_to_string(root().join(&path)).unwrap_or_else(|error| panic!("{path}: {error}"));
    let mut page = Page { path, links: vec![], anchors: BTreeSet::new(), code: vec![], fences: vec![] };
    let mut heading = None;
    let mut fence = None;
    for event in Parser::new_ext(&text, Options::ENABLE_TABLES) {
        match event {
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => page.links.push(dest_url.into()),
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::End(TagEnd::Heading(_)) => add_anchor(&mut page.anchors, &heading.take().unwrap_or_default()),
            Event::Start(Tag::CodeBlock(kind)) => fence = Some(Fence { info: info(&kind), text: String::new() }),
            Event::End(TagEnd::CodeBlock) => page.fences.extend(fence.take()),
            Event::Code(code) => {
                heading.iter_mut().for_each(|heading| heading.push_str(&code));
                page.code.push(code.into());
            }
            Event::Text(text) => match (&mut fence, &mut heading) {
                (Some(fence), _) => fence.text.push_str(&text),
                (None, Some(heading)) => heading.push_str(&text),
                (None, None) => {}
            },
            _ => {}
        }
    }
    page
}

fn info(kind: &CodeBlockKind<'_>) -> String {
    match kind {
        CodeBlockKind::Fenced(info) => info.to_string(),
        CodeBlockKind::Indented => String::new(),
    }
}

/// The name of a heading as mdBook and GitHub form it; the second of two equal ones ends in `-1`.
fn add_anchor(anchors: &mut BTreeSet<String>, heading: &str) {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    let slug: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect::<String>().to_lowercase();
    let numbered = (1..).map(|n| format!("{slug}-{n}"));
    let free = std::iter::once(slug.clone()).chain(numbered).find(|name| !anchors.contains(name));
    anchors.extend(free);
}

/// Fails with every line that breaks a rule at once.
fn none(broken: Vec<String>) {
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

/// The file that a relative link names, from the root.
fn target(page: &str, file: &str) -> String {
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in file.split('/') {
        match part {
            ".." => drop(parts.pop()),
            "." | "" => {}
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// What is wrong with a link, if anything is.
fn fault_of_link(page: &Page, link: &str, pages: &BTreeMap<String, Page>) -> Option<String> {
    if link.contains("://") || link.starts_with("mailto:") {
        return None;
    }
    let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
    let target = if file.is_empty() { page.path.clone() } else { target(&page.path, file) };
    if !root().join(&target).exists() {
        return Some(format!("{target} does not exist"));
    }
    if page.path.starts_with("docs/") && !target.starts_with("docs/") {
        return Some("a page of the book cannot link to a file outside of it; name the path in backticks".into());
    }
    let has_anchor = || pages.get(&target).is_some_and(|target| target.anchors.contains(anchor));
    (!anchor.is_empty() && !has_anchor()).then(|| format!("{target} has no heading #{anchor}"))
}

#[test]
fn every_link_leads_to_a_page_and_a_heading() {
    let pages = pages();
    let faults = pages.values().flat_map(|page| {
        let faults = page.links.iter().filter_map(|link| Some((link, fault_of_link(page, link, &pages)?)));
        faults.map(|(link, fault)| format!("{}: link {link}: {fault}", page.path))
    });
    none(faults.collect());
}

/// Whether code between backticks is meant as a file of the workspace: it begins with a folder of the workspace, or it
/// is a Rust file with a folder before it.
fn is_path(code: &str, folders: &BTreeSet<String>) -> bool {
    let plain = code.chars().all(|c| c.is_ascii_alphanumeric() || "/._-*".contains(c));
    let first = code.split('/').next().unwrap_or_default();
    plain && code.contains('/') && (folders.contains(first) || code.ends_with(".rs"))
}

#[test]
fn every_path_between_backticks_exists() {
    let entries = fs::read_dir(root()).expect("the workspace").flatten();
    let folders = entries.filter(|entry| entry.path().is_dir()).map(|entry| entry.file_name().display().to_string());
    let folders: BTreeSet<String> = folders.filter(|name| !matches!(name.as_str(), "target" | ".git")).collect();
    let mut broken = Vec::new();
    for page in pages().values() {
        for code in page.code.iter().filter(|code| is_path(code, &folders)) {
            let fixed = code.split('*').next().unwrap_or_default();
            let path =
                if fixed.len() < code.len() { fixed.rsplit_once('/').map_or("", |(path, _)| path) } else { fixed };
            if !root().join(path).exists() {
                broken.push(format!("{}: `{code}` does not exist; write paths from the root", page.path));
            }
        }
    }
    none(broken);
}

#[test]
fn the_table_of_contents_has_every_page_once() {
    let pages = pages();
    let listed = &pages["docs/SUMMARY.md"].links;
    let twice = listed.iter().enumerate().filter(|(index, link)| listed[..*index].contains(link));
    let mut broken: Vec<_> = twice.map(|(_, link)| format!("docs/SUMMARY.md lists {link} twice")).collect();
    let of_book = pages.keys().filter_map(|path| path.strip_prefix("docs/")).filter(|name| *name != "SUMMARY.md");
    let missing = of_book.filter(|name| !listed.iter().any(|link| link == name));
    broken.extend(missing.map(|name| format!("docs/{name} is not in docs/SUMMARY.md")));
    none(broken);
}

/// What is wrong with a fence. `in=FILE` says that its text is an excerpt of that file, `no_run: REASON` why a test
/// cannot run its commands.
fn fault_of_fence(fence: &Fence) -> Option<String> {
    let (language, attribute) = fence.info.split_once(',').unwrap_or((&fence.info, ""));
    if !LANGUAGES.contains(&language) {
        return Some(format!("unknown language; use one of {}", LANGUAGES.join(", ")));
    }
    if let Some(file) = attribute.strip_prefix("in=") {
        let text = fs::read_to_string(root().join(file)).unwrap_or_default();
        return (!text.contains(fence.text.trim())).then(|| format!("its text is not in {file}; copy it again"));
    }
    let reason = attribute.strip_prefix("no_run:").map(str::trim);
    let known = attribute.is_empty() || language == "sh" && reason.is_some_and(|reason| !reason.is_empty());
    (!known).then(|| "unknown attribute; use `sh,no_run: REASON` or `toml,in=FILE`".into())
}

#[test]
fn every_fence_has_a_language_and_excerpts_are_in_their_files() {
    let pages = pages();
    let faults = pages.values().flat_map(|page| {
        let faults = page.fences.iter().filter_map(|fence| Some((fence, fault_of_fence(fence)?)));
        faults.map(|(fence, fault)| format!("{}: fence `{}`: {fault}", page.path, fence.info))
    });
    none(faults.collect());
}

#[test]
fn the_readme_is_short() {
    let lines = fs::read_to_string(root().join("README.md")).expect("the first page").lines().count();
    assert!(lines <= README_LINES, "README.md has {lines} lines, at most {README_LINES}; move details to the book");
}

#[test]
fn the_book_builds() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut book = MDBook::load(root().join("docs")).expect("the book is read");
    book.config.build.build_dir = folder.path().into();
    book.build().expect("the book is built");
    assert!(folder.path().join("architecture.html").exists(), "there is no architecture page");
}

#[test]
fn anchors_are_formed_as_in_the_built_book() {
    let mut anchors = BTreeSet::new();
    for heading in ["Keys of [[stage]]", "Not identifiable", "Not identifiable", "a_b: 1, 2"] {
        add_anchor(&mut anchors, heading);
    }
    let expected = ["keys-of-stage", "not-identifiable", "not-identifiable-1", "a_b-1-2"];
    assert_eq!(anchors, expected.map(String::from).into());
}
