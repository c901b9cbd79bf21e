//! Crates that are published can be: their manifests are complete, and `cargo package` finds all their files.

use serde_json::{Value, json};
use xtask::package::crates::{check, faults, published};

#[test]
fn cargo_packages_every_published_crate_offline() {
    check().unwrap();
}

#[test]
fn what_only_the_workspace_uses_is_not_published() {
    let names: Vec<Value> = published().unwrap().into_iter().map(|it| it["name"].clone()).collect();
    assert_eq!(names.len(), 13, "{names:?}");
    for name in
        ["darm-tests", "darm-book", "darm-eval", "darm-demo", "darm-figures", "darm-simulate", "xtask", "darm-pico"]
    {
        assert!(!names.contains(&json!(name)), "{name}");
    }
}

#[test]
fn an_incomplete_manifest_is_named() {
    let mut crates = published().unwrap();
    let cli = crates.iter().position(|it| it["name"] == "darm").unwrap();
    assert_eq!(faults(&crates[cli], &crates), [""; 0]);
    crates[cli]["description"] = Value::Null;
    assert!(faults(&crates[cli], &crates)[0].contains("no description"));
    let alone = [crates[cli].clone()];
    assert!(faults(&alone[0], &alone).iter().any(|fault| fault.contains("darm-core")));
}
