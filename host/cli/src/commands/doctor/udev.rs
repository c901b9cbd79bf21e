//! The rule by which Linux lets a user open boards and probes, and whether it is installed.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Check;
use crate::ui::Answer;

/// Name of the rule's file.
const NAME: &str = "60-darm.rules";
/// Its text, the same as in the Debian package.
const RULE: &str = include_str!("../../../debian/60-darm.rules");
/// Folders that udev reads; a file in an earlier one replaces that of the same name in a later one.
const FOLDERS: [&str; 4] = ["/etc/udev/rules.d", "/run/udev/rules.d", "/usr/lib/udev/rules.d", "/lib/udev/rules.d"];
/// How to install the rule.
pub(super) const INSTALL: &str =
    "`darm doctor --udev-rule | sudo tee /etc/udev/rules.d/60-darm.rules`, then plug the board in again";

/// The rule as an answer.
#[derive(Serialize)]
pub(super) struct Rule {
    file: &'static str,
    rule: &'static str,
}

impl Rule {
    pub(super) fn new() -> Self {
        Self { file: NAME, rule: RULE }
    }
}

impl Answer for Rule {
    fn text(&self) -> String {
        self.rule.trim_end().to_owned()
    }
}

/// Whether the rule is installed, as this version has it.
pub(super) fn check() -> Check {
    check_in(&FOLDERS.map(Path::new))
}

fn check_in(folders: &[&Path]) -> Check {
    let files = folders.iter().map(|folder| folder.join(NAME));
    let found: Option<(PathBuf, String)> =
        files.filter_map(|file| std::fs::read_to_string(&file).ok().map(|text| (file, text))).next();
    match found {
        Some((file, text)) if text == RULE => Check::good("udev rule", file.display().to_string()),
        Some((file, _)) => Check::missing("udev rule", format!("{} is of another version", file.display()), INSTALL),
        None => Check::missing("udev rule", format!("no {NAME}: only root and the group dialout open boards"), INSTALL),
    }
}

#[cfg(test)]
mod tests {
    use super::{FOLDERS, INSTALL, NAME, RULE, check_in};
    use crate::commands::doctor::State;

    #[test]
    fn an_installed_rule_is_compared_with_this_version() {
        let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let folders = [first.path(), second.path()];
        let state = || check_in(&folders).state;
        assert_eq!(state(), State::Missing);
        std::fs::write(second.path().join(NAME), RULE).unwrap();
        assert_eq!(state(), State::Good);
        std::fs::write(first.path().join(NAME), "# an older one\n").unwrap();
        assert_eq!(state(), State::Missing, "an earlier folder counts");
    }

    /// A line is matches and assignments, separated by commas: udev skips a line that is anything else.
    #[test]
    fn each_line_of_the_rule_is_well_formed() {
        let lines: Vec<_> = RULE.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
        assert_eq!(lines.len(), 4);
        for part in lines.iter().flat_map(|line| line.split(", ")) {
            let (key, value) = part.split_once('=').unwrap();
            assert!(key.starts_with(|c: char| c.is_ascii_uppercase()), "{part}");
            assert!(value.trim_start_matches('=').starts_with('"') && value.ends_with('"'), "{part}");
        }
        assert!(INSTALL.contains(&format!("{}/{NAME}", FOLDERS[0])) && RULE.contains(NAME));
    }
}
