//! The files of this workspace, for tests that check rules of its code and texts.

use std::fs;
use std::path::{Path, PathBuf};

/// A text file of the workspace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// Its path from the root, with `/` between names.
    pub path: String,
    /// Its content.
    pub text: String,
}

impl Source {
    /// Whether it is a file of tests.
    pub fn is_test(&self) -> bool {
        self.path.contains("/tests/") || self.path.ends_with("tests.rs") || self.path.ends_with("cases.rs")
    }

    /// The code above the tests at its end.
    pub fn code(&self) -> &str {
        self.text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(&self.text)
    }
}

/// The root of the workspace.
#[expect(clippy::missing_panics_doc, reason = "the folder of this crate has two parents")]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("tests/rules is in the workspace").to_path_buf()
}

/// All files with this extension by path, outside build outputs and hidden folders.
///
/// # Panics
///
/// A folder or file of the workspace cannot be read, or a file is not UTF-8.
pub fn files(extension: &str) -> Vec<Source> {
    let root = root();
    let (mut found, mut folders) = (Vec::new(), vec![root.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of the workspace") {
            let entry = entry.expect("an entry of a folder");
            let (name, path) = (entry.file_name().to_string_lossy().into_owned(), entry.path());
            if path.is_dir() {
                folders.extend((name != "target" && !name.starts_with('.')).then_some(path));
            } else if path.extension().is_some_and(|found| found == extension) {
                let text = fs::read_to_string(&path).expect("readable text");
                let path = path.strip_prefix(&root).expect("inside the workspace").display().to_string();
                found.push(Source { path, text });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

/// Every Rust source of the workspace by path.
///
/// # Panics
///
/// A folder or file cannot be read, or there are 400 sources or fewer: the search is wrong then.
pub fn sources() -> Vec<Source> {
    let found = files("rs");
    assert!(found.len() > 400, "only {} sources were found", found.len());
    found
}

/// Fails with all violations of a rule at once.
///
/// # Panics
///
/// There is a violation.
#[track_caller]
pub fn assert_none(violations: impl IntoIterator<Item = String>) {
    let violations: Vec<String> = violations.into_iter().collect();
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}
