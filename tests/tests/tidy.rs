//! Rules of this workspace that a program can check: layers, lengths, first lines, words that do not belong.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Modules of the core, lowest first: a module imports only from those before it.
const LAYERS: [&str; 19] = [
    "real",
    "trig",
    "units",
    "se",
    "actuator",
    "chain",
    "tree",
    "dynamics",
    "ik",
    "odometry",
    "effect",
    "model",
    "nearest",
    "output",
    "duty",
    "profile",
    "table",
    "sequencer",
    "wire",
];
/// Packages with their folders, lowest first: a package depends only on those before it.
const PACKAGES: [(&str, &str); 15] = [
    ("shared", "darm-core"),
    ("firmware", "darm-firmware"),
    ("host/robot", "darm-robot"),
    ("host/arm", "darm-arm"),
    ("host/device", "darm-device"),
    ("host/diagnose", "darm-diagnose"),
    ("host/import", "darm-import"),
    ("host/papers", "darm-papers"),
    ("host/cli", "darm"),
    ("tests", "darm-tests"),
    ("eval/figures", "darm-figures"),
    ("eval/simulate", "darm-simulate"),
    ("xtask", "xtask"),
    ("eval", "darm-eval"),
    ("fuzz", "darm-fuzz"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the workspace").to_path_buf()
}

/// Every Rust source of the packages, with its path from the root.
fn sources() -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders: Vec<_> =
        ["shared", "firmware", "host", "tests", "eval", "xtask"].map(|name| root().join(name)).into();
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).expect("a folder of the workspace").flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let name = path.strip_prefix(root()).expect("inside the workspace").display().to_string();
                found.push((name, fs::read_to_string(&path).expect("a readable source")));
            }
        }
    }
    found.sort();
    assert!(found.len() > 20, "the sources were not found");
    found
}

/// Fails with every line that breaks a rule at once.
fn none(broken: Vec<String>) {
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

/// The module of a file of the core: `se` of `shared/src/se/screw.rs`.
fn core_module(file: &str) -> Option<&str> {
    let inside = file.strip_prefix("shared/src/")?;
    let module = inside.split('/').next()?;
    Some(module.strip_suffix(".rs").unwrap_or(module))
}

#[test]
fn every_file_says_what_it_is() {
    let broken = sources().into_iter().filter(|(_, text)| !text.starts_with("//! "));
    none(broken.map(|(file, _)| format!("{file}: the first line must say what it is (`//! …`)")).collect());
}

#[test]
fn the_core_imports_downward_only() {
    let level = |module: &str| LAYERS.iter().position(|layer| *layer == module);
    let mut broken = Vec::new();
    for (file, text) in sources() {
        let Some(module) = core_module(&file).filter(|module| !matches!(*module, "lib" | "arms")) else { continue };
        let Some(own) = level(module) else {
            broken.push(format!("{file}: module `{module}` has no layer in this test"));
            continue;
        };
        let code = text.split("#[cfg(test)]").next().unwrap_or(&text);
        if file.ends_with("/tests.rs") {
            continue;
        }
        for line in code.lines().filter(|line| !line.trim_start().starts_with("//")) {
            for used in line.split("crate::").skip(1) {
                let used: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                if level(&used).is_some_and(|used| used > own) {
                    broken.push(format!("{file}: `{module}` imports `{used}` from above"));
                }
            }
        }
    }
    none(broken);
}

#[test]
fn packages_depend_downward_only() {
    let mut broken = Vec::new();
    for (own, (folder, _)) in PACKAGES.iter().enumerate() {
        let text = fs::read_to_string(root().join(folder).join("Cargo.toml")).expect("a manifest");
        let used = PACKAGES.iter().enumerate().filter(|(_, (_, name))| text.contains(&format!("\n{name}.workspace")));
        let upward =
            used.filter(|(level, _)| *level >= own).map(|(_, (_, name))| format!("{folder} depends on {name}"));
        broken.extend(upward);
    }
    none(broken);
}

/// The module of a file of a package and the modules of the package that it imports, its tests left out.
fn imports(folder: &str, file: &str, text: &str) -> Option<(String, Vec<String>)> {
    let inside = file.strip_prefix(folder)?.strip_prefix("/src/")?;
    if inside.ends_with("tests.rs") || inside.ends_with("cases.rs") {
        return None;
    }
    let module = inside.split('/').next()?.trim_end_matches(".rs").to_owned();
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let code = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let named = code.flat_map(|line| line.split("crate::").skip(1));
    let names = named.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>());
    Some((module.clone(), names.filter(|used| *used != module).collect()))
}

/// Takes away module after module that imports none of those left; what remains imports itself in a circle.
#[test]
fn modules_of_the_host_import_in_no_circle() {
    let sources = sources();
    let mut broken = Vec::new();
    for (folder, _) in PACKAGES.iter().filter(|(folder, _)| folder.starts_with("host/") && *folder != "host/cli") {
        let mut modules: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (module, used) in sources.iter().filter_map(|(file, text)| imports(folder, file, text)) {
            modules.entry(module).or_default().extend(used);
        }
        assert!(modules.len() > 2, "{folder} has no modules");
        while let Some(lowest) = modules.iter().find(|(_, used)| !used.iter().any(|used| modules.contains_key(used))) {
            let lowest = lowest.0.clone();
            modules.remove(&lowest);
        }
        broken.extend(modules.into_keys().map(|module| format!("{folder}: `{module}` is in a circle of imports")));
    }
    none(broken);
}

#[test]
fn the_core_and_the_firmware_do_not_panic_on_input() {
    let mut broken = Vec::new();
    for (file, text) in sources().into_iter().filter(|(file, _)| {
        (file.starts_with("shared/src") || file.starts_with("firmware/src"))
            && !file.ends_with("tests.rs")
            && !file.contains("/tests/")
            && !file.ends_with("arms.rs")
    }) {
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(&text);
        for (number, line) in code.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
            if [".unwrap()", ".expect(", "panic!(", "todo!", "unimplemented!", "unreachable!"]
                .iter()
                .any(|w| line.contains(w))
            {
                broken.push(format!("{file}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    none(broken);
}

#[test]
fn only_real_names_libm() {
    let named = sources().into_iter().filter(|(file, text)| {
        file.starts_with("shared/src")
            && !file.ends_with("real.rs")
            && !file.ends_with("trig.rs")
            && text.contains("libm::")
    });
    none(named.map(|(file, _)| format!("{file}: libm is named in `real` alone")).collect());
}

#[test]
fn nothing_is_left_undone() {
    let banned = [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("#[ig", "nore]"), concat!("#[should_", "panic]")];
    let mut broken = Vec::new();
    for (file, text) in sources() {
        let found = banned.iter().filter(|word| text.contains(**word));
        broken.extend(found.map(|word| format!("{file}: {word}")));
        broken.extend(
            text.lines()
                .enumerate()
                .filter(|(_, line)| line.ends_with([' ', '\t']))
                .map(|(number, _)| format!("{file}:{}: blanks at the end of the line", number + 1)),
        );
    }
    none(broken);
}
