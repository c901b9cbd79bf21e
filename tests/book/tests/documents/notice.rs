//! What is shipped has a licence that is allowed, and a notice of everything that is linked.

use std::collections::BTreeSet;
use std::process::Command;

use spdx::{LicenseReq, Licensee};
use xtask::image::Board;
use xtask::package::notice;
use xtask::setup::root;
use xtask::shipped::{self, Package};

/// Lines of the notice's table: name and version.
fn listed(notice: &str) -> BTreeSet<(String, String)> {
    let lines = notice.lines().filter_map(|line| line.strip_prefix("| "));
    let cells = lines.map(|line| line.split(" | ").map(str::to_owned).collect::<Vec<_>>());
    cells.filter(|cells| cells.len() >= 4).map(|cells| (cells[0].clone(), cells[1].clone())).collect()
}

/// The crates of others that `cargo tree` finds below a package: it resolves features as the build does.
fn tree(arguments: &[&str]) -> Vec<(String, String)> {
    let mut cargo = Command::new("cargo");
    cargo.current_dir(root()).args(["tree", "--locked", "--edges", "normal", "--prefix", "none", "--format", "{p}"]);
    let output = cargo.args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    // A path in brackets: a package of this workspace.
    let others = text.lines().filter(|line| !line.contains("(/"));
    let words = others.map(|line| line.split_whitespace().take(2).collect::<Vec<_>>());
    words.filter(|it| it.len() == 2).map(|it| (it[0].to_owned(), it[1].trim_start_matches('v').to_owned())).collect()
}

#[test]
fn every_normal_dependency_of_tool_and_images_is_in_the_notice() {
    let listed = listed(&notice::text(&shipped::packages().unwrap()).unwrap());
    let mut linked = tree(&["--package", "darm"]);
    assert!(linked.iter().any(|(name, _)| name == "serialport"), "{linked:?}");
    for board in Board::ALL {
        let of_board = tree(&["--package", board.package(), "--features", "chip", "--target", board.target()]);
        assert!(of_board.iter().any(|(name, _)| name == "cortex-m"), "{of_board:?}");
        linked.extend(of_board);
    }
    let missing: Vec<_> = linked.iter().filter(|it| !listed.contains(it)).collect();
    assert!(missing.is_empty(), "{missing:?}");
    for other in ["three", "std"] {
        assert!(listed.iter().any(|(name, _)| name == other), "{other}");
    }
}

#[test]
fn the_notice_has_the_texts_and_says_where_the_source_under_the_mpl_is() {
    let notice = notice::text(&shipped::packages().unwrap()).unwrap();
    let port = notice.lines().find(|line| line.starts_with("- serialport ")).expect("serialport is under the MPL");
    assert!(port.contains("https://crates.io/crates/serialport/"), "{port}");
    let definition = "1.2. \"Contributor Version\"";
    assert!(notice.contains(definition), "not the reference to the licence alone");
    assert!(notice.contains("Copyright © 2010-2026 three.js authors"));
    // A package without a text would have an empty last cell.
    assert!(!notice.contains("|  |"));
    let texts: Vec<&str> =
        notice.split("\n### Text ").skip(1).filter_map(|it| it.split_once("\n").map(|it| it.1)).collect();
    assert_eq!(texts.len(), texts.iter().collect::<BTreeSet<_>>().len(), "each text is there once");
}

/// The licences of a list `allow`.
fn licensees(list: &toml::Value) -> Vec<Licensee> {
    let names = list["allow"].as_array().unwrap().iter();
    names.map(|name| Licensee::parse(name.as_str().unwrap()).unwrap()).collect()
}

#[test]
fn every_package_that_is_shipped_has_a_licence_that_deny_toml_allows() {
    let file: toml::Table = std::fs::read_to_string(root().join("deny.toml")).unwrap().parse().unwrap();
    let (everywhere, exceptions) = (licensees(&file["licenses"]), file["licenses"]["exceptions"].as_array().unwrap());
    let allows = |package: &Package, required: &LicenseReq| {
        let own = exceptions.iter().filter(|it| it["crate"].as_str() == Some(&package.name)).flat_map(licensees);
        everywhere.iter().cloned().chain(own).any(|licensee| licensee.satisfies(required))
    };
    for package in shipped::packages().unwrap() {
        let expression = package.expression().unwrap();
        assert!(expression.evaluate(|required| allows(&package, required)), "{} {}", package.name, package.licence);
    }
    let mut unknown = shipped::packages().unwrap().pop_first().unwrap();
    unknown.licence = "MIT AND GPL-3.0-only".to_owned();
    assert!(!unknown.expression().unwrap().evaluate(|required| allows(&unknown, required)));
}
