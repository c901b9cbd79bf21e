//! `docs/renamed-keys.toml` lists the keys that were renamed: the new ones are printed, the old ones are not.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Home, example};
use serde_json::Value;
use toml_edit::DocumentMut;

/// All keys of an object, with those that lead to them: `rows.at_s`.
fn keys(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (key, value) in object {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                keys(value, &path, found);
                found.insert(path);
            }
        }
        Value::Array(values) => values.iter().for_each(|value| keys(value, path, found)),
        _ => {}
    }
}

#[test]
fn renamed_keys_are_printed_by_their_new_names_only() {
    let home = Home::new();
    for file in std::fs::read_dir(example("")).unwrap().map(|entry| entry.unwrap().path()) {
        std::fs::copy(&file, home.path(&file.file_name().unwrap().to_string_lossy())).unwrap();
    }
    home.succeeds("synth planar4.toml planar4-frames.toml -o arm.toml");
    home.succeeds("table planar4-hybrid.toml --words 000010000000 --q 10 -o hybrid.darm");
    let map = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/renamed-keys.toml");
    let map: DocumentMut = std::fs::read_to_string(map).unwrap().parse().unwrap();
    let mut checked = 0;
    for (section, renamed) in map.iter() {
        let Some(line) = renamed.get("line").and_then(|line| line.as_str()) else { continue };
        let mut printed = BTreeSet::new();
        keys(&home.json(line), "", &mut printed);
        for entry in renamed["keys"].as_array().unwrap() {
            let name = |key: &str| entry.as_inline_table().unwrap().get(key).and_then(|name| name.as_str());
            let (old, new) = (name("old").unwrap(), name("new"));
            assert!(!printed.contains(old), "{section}: `darm --json {line}` still prints {old}");
            assert!(new.is_none_or(|new| printed.contains(new)), "{section}: {new:?} is not among {printed:?}");
            checked += 1;
        }
    }
    assert!(checked > 40, "{checked} keys");
}
