//! Rules of this workspace that a program can check: layers, first lines, words that do not belong.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use darm_rules::{Source, assert_none, root, sources};
use toml_edit::DocumentMut;

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
/// The crates with their folders, lowest first, and the crates that each depends on: exactly these.
const CRATES: [(&str, &str, &[&str]); 25] = [
    ("darm-core", "shared", &[]),
    ("darm-firmware", "firmware", &["darm-core"]),
    ("darm-b-l475e-iot01a", "firmware/boards/b-l475e-iot01a", &["darm-core", "darm-firmware"]),
    ("darm-pico", "firmware/boards/pico", &["darm-core", "darm-firmware"]),
    ("darm-olimex-stm32-h405", "firmware/boards/olimex-stm32-h405", &["darm-core", "darm-firmware"]),
    ("darm-robot", "host/robot", &["darm-core"]),
    ("darm-camera", "host/camera", &["darm-core"]),
    ("darm-arm", "host/arm", &["darm-core", "darm-robot"]),
    ("darm-generate", "host/generate", &["darm-arm", "darm-core", "darm-robot"]),
    ("darm-device", "host/device", &["darm-arm", "darm-core"]),
    ("darm-sim", "host/sim", &["darm-arm", "darm-core", "darm-device", "darm-firmware"]),
    ("darm-measure", "host/measure", &["darm-arm", "darm-core", "darm-robot"]),
    ("darm-diagnose", "host/diagnose", &["darm-arm", "darm-core", "darm-measure", "darm-robot"]),
    ("darm-papers", "host/papers", &["darm-arm", "darm-core", "darm-diagnose", "darm-measure", "darm-robot"]),
    (
        "darm-serve",
        "host/serve",
        &["darm-arm", "darm-core", "darm-device", "darm-diagnose", "darm-measure", "darm-robot", "darm-sim"],
    ),
    (
        "darm",
        "host/cli",
        &[
            "darm-arm",
            "darm-camera",
            "darm-core",
            "darm-device",
            "darm-diagnose",
            "darm-generate",
            "darm-measure",
            "darm-papers",
            "darm-robot",
            "darm-serve",
            "darm-sim",
        ],
    ),
    ("darm-tests", "tests", &["darm-arm", "darm-core", "darm-device", "darm-firmware", "darm-sim"]),
    ("darm-figures", "eval/figures", &[]),
    ("darm-simulate", "eval/simulate", &["darm-arm", "darm-core", "darm-device", "darm-figures", "darm-sim"]),
    ("xtask", "xtask", &[]),
    ("darm-rules", "tests/rules", &[]),
    ("darm-book", "tests/book", &["xtask"]),
    (
        "darm-demo",
        "eval/demo",
        &["darm-arm", "darm-core", "darm-device", "darm-diagnose", "darm-figures", "darm-measure", "darm-sim", "xtask"],
    ),
    (
        "darm-eval",
        "eval",
        &[
            "darm-arm",
            "darm-core",
            "darm-demo",
            "darm-device",
            "darm-diagnose",
            "darm-figures",
            "darm-generate",
            "darm-measure",
            "darm-papers",
            "darm-robot",
            "darm-sim",
            "darm-simulate",
            "xtask",
        ],
    ),
    ("darm-fuzz", "fuzz", &["darm-core", "darm-sim"]),
];

/// The module of a file of the core: `se` of `shared/src/se/screw.rs`.
fn core_module(file: &str) -> Option<&str> {
    let inside = file.strip_prefix("shared/src/")?;
    let module = inside.split('/').next()?;
    Some(module.strip_suffix(".rs").unwrap_or(module))
}

#[test]
fn every_file_says_what_it_is() {
    let broken = sources().into_iter().filter(|source| !source.text.starts_with("//! "));
    assert_none(broken.map(|source| format!("{}: the first line must say what it is (`//! …`)", source.path)));
}

#[test]
fn the_core_imports_downward_only() {
    let level = |module: &str| LAYERS.iter().position(|layer| *layer == module);
    let mut broken = Vec::new();
    for Source { path: file, text } in sources() {
        let Some(module) = core_module(&file).filter(|module| !matches!(*module, "lib" | "arms")) else { continue };
        let Some(own) = level(module) else {
            broken.push(format!("{file}: module `{module}` has no layer in this test"));
            continue;
        };
        let code = text.split("#[cfg(test)]").next().unwrap_or(&text);
        if file.ends_with("/tests.rs") {
            continue;
        }
        let used = modules_used(code);
        broken.extend(
            used.iter()
                .filter(|used| level(used).is_some_and(|used| used > own))
                .map(|used| format!("{file}: `{module}` imports `{used}` from above")),
        );
    }
    assert_none(broken);
}

/// The crates of this workspace that a manifest names in any of its tables of dependencies.
fn dependencies(manifest: &str) -> BTreeSet<String> {
    let document: DocumentMut = manifest.parse().expect("a manifest in TOML");
    let tables = ["dependencies", "dev-dependencies", "build-dependencies"];
    let named = tables.iter().filter_map(|table| document.get(table)?.as_table_like());
    let names = named.flat_map(|table| table.iter().map(|(name, _)| name.to_owned()).collect::<Vec<_>>());
    names.filter(|name| CRATES.iter().any(|(known, ..)| known == name)).collect()
}

#[test]
fn crates_depend_on_those_of_the_table() {
    let mut broken = Vec::new();
    for (level, (name, folder, allowed)) in CRATES.iter().enumerate() {
        let path = format!("{folder}/Cargo.toml");
        let used = dependencies(&fs::read_to_string(root().join(&path)).expect("a manifest"));
        let allowed: BTreeSet<String> = allowed.iter().map(|name| (*name).to_owned()).collect();
        let is_below = |lower: &String| CRATES[..level].iter().any(|(below, ..)| below == lower);
        broken.extend(used.difference(&allowed).map(|other| format!("{path}: `{name}` may not depend on `{other}`")));
        broken
            .extend(allowed.difference(&used).map(|other| format!("{path}: `{name}` no longer depends on `{other}`")));
        broken.extend(
            allowed.iter().filter(|other| !is_below(other)).map(|other| format!("`{other}` is not below `{name}`")),
        );
    }
    assert_none(broken);
}

#[test]
fn every_package_of_the_workspace_is_in_the_table() {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("the manifest of the workspace");
    let document: DocumentMut = manifest.parse().expect("a manifest in TOML");
    let names = document["workspace"]["dependencies"].as_table_like().expect("a table").iter();
    let own = names.filter(|(_, item)| item.as_table_like().is_some_and(|table| table.contains_key("path")));
    let missing = own.filter(|(own, _)| !CRATES.iter().any(|(name, ..)| name == own));
    assert_none(missing.map(|(name, _)| format!("`{name}` is missing in the table")));
}

/// The module of a file of a package and the modules of the package that it imports, its tests left out.
fn imports(folder: &str, source: &Source) -> Option<(String, Vec<String>)> {
    let inside = source.path.strip_prefix(folder)?.strip_prefix("/src/")?;
    if source.is_test() {
        return None;
    }
    let module = inside.split('/').next()?.trim_end_matches(".rs").to_owned();
    Some((module.clone(), modules_used(source.code()).into_iter().filter(|used| *used != module).collect()))
}

/// The names that follow `crate::` in code, one by one or in braces.
fn modules_used(code: &str) -> Vec<String> {
    let is_code = |line: &&str| !line.trim_start().starts_with("//");
    let code = code.lines().filter(is_code).collect::<Vec<_>>().join("\n");
    let name = |text: &str| text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let of = |rest: &str| match rest.strip_prefix('{').and_then(|group| group.split_once('}')) {
        Some((group, _)) => group.split(',').map(name).collect(),
        None => vec![name(rest)],
    };
    code.split("crate::").skip(1).flat_map(of).filter(|name| !name.is_empty()).collect()
}

#[test]
fn modules_in_braces_are_seen() {
    assert_eq!(modules_used("use crate::{a, b};\n// crate::c\ncrate::d::e(crate::f)"), ["a", "b", "d", "f"]);
}

/// Takes away module after module that imports none of those left; what remains imports itself in a circle.
#[test]
fn modules_of_the_host_import_in_no_circle() {
    let sources = sources();
    let mut broken = Vec::new();
    for (_, folder, _) in CRATES.iter().filter(|(_, folder, _)| folder.starts_with("host/")) {
        let mut modules: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (module, used) in sources.iter().filter_map(|source| imports(folder, source)) {
            modules.entry(module).or_default().extend(used);
        }
        assert!(modules.len() > 2, "{folder} has no modules");
        while let Some(lowest) = modules.iter().find(|(_, used)| !used.iter().any(|used| modules.contains_key(used))) {
            let lowest = lowest.0.clone();
            modules.remove(&lowest);
        }
        broken.extend(modules.into_keys().map(|module| format!("{folder}: `{module}` is in a circle of imports")));
    }
    assert_none(broken);
}

#[test]
fn the_core_and_the_firmware_do_not_panic_on_input() {
    let mut broken = Vec::new();
    for source in sources().into_iter().filter(|source| {
        (source.path.starts_with("shared/src") || source.path.starts_with("firmware/"))
            && !source.is_test()
            && !source.path.contains("/src/bin/")
            && !source.path.ends_with("build.rs")
            && !source.path.ends_with("arms.rs")
    }) {
        let (file, code) = (&source.path, source.code());
        for (number, line) in code.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
            if [".unwrap()", ".expect(", "panic!(", "todo!", "unimplemented!", "unreachable!"]
                .iter()
                .any(|w| line.contains(w))
            {
                broken.push(format!("{file}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    assert_none(broken);
}

/// The boards: the folders of their crates.
fn boards() -> Vec<String> {
    let folders = fs::read_dir(root().join("firmware/boards")).expect("the folder of the boards");
    let names = folders.map(|entry| entry.expect("a folder").file_name().to_string_lossy().into_owned());
    names.filter(|name| root().join("firmware/boards").join(name).join("Cargo.toml").is_file()).collect()
}

/// Every board is known to what builds, flashes and packages images.
#[test]
fn every_board_is_named_where_images_are_built_and_flashed() {
    let files = [
        "host/cli/build.rs",
        "host/cli/src/firmware_image.rs",
        "xtask/src/image/board.rs",
        "xtask/src/package/check.sh",
    ];
    let boards = boards();
    assert!(boards.len() >= 3, "{boards:?}");
    let mut missing = Vec::new();
    for file in files {
        let text = fs::read_to_string(root().join(file)).expect("a file");
        let lacking = boards.iter().filter(|board| !text.contains(board.as_str()));
        missing.extend(lacking.map(|board| format!("{file}: the board `{board}` is missing")));
    }
    let folders = boards.iter().map(|board| format!("firmware/boards/{board}"));
    let unknown = folders.filter(|folder| !CRATES.iter().any(|(_, known, _)| known == folder));
    missing.extend(unknown.map(|folder| format!("`{folder}` is missing in the table of crates")));
    assert_none(missing);
}

/// The linker looks in the root of the workspace first: a `board.x` there would lay out every image as one board.
#[test]
fn each_board_has_its_memories_and_the_root_has_what_is_common() {
    assert!(root().join("memory.x").is_file() && !root().join("board.x").exists());
    for board in boards() {
        let folder = root().join("firmware/boards").join(&board);
        assert!(folder.join("board.x").is_file() && !folder.join("memory.x").exists(), "{board}");
    }
}

/// Lines of a board's crate that are neither blank nor only a comment: build script and sources, without tests.
fn lines_of_code(board: &str) -> usize {
    let folder = format!("firmware/boards/{board}/");
    let own = sources().into_iter().filter(|source| {
        let inside = source.path.strip_prefix(&folder);
        inside.is_some_and(|inside| inside == "build.rs" || inside.starts_with("src/"))
    });
    let is_code = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with("//");
    own.map(|source| source.text.lines().filter(is_code).count()).sum()
}

#[test]
fn the_page_for_a_new_board_says_how_many_lines_the_examples_have() {
    /// A board on bare registers is to stay this small.
    const SMALL: usize = 400;
    let page = fs::read_to_string(root().join("docs/add-a-board.md")).expect("the page");
    let [pico, small] = ["pico", "olimex-stm32-h405"].map(lines_of_code);
    assert!((100..=SMALL).contains(&small), "{small} lines");
    let missing = [pico, small].map(|n| format!("{n} lines of code"));
    assert_none(
        missing.into_iter().filter(|count| !page.contains(count)).map(|count| format!("the page has no `{count}`")),
    );
}

/// Whether a text cites a section of the reference manual, such as 3.7.7, or the errata sheet.
fn cites_manual(text: &str) -> bool {
    let is_section = |token: &str| {
        let parts: Vec<&str> = token.trim_matches('.').split('.').collect();
        parts.len() == 3 && parts.iter().all(|part| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit()))
    };
    text.split(|c: char| !c.is_ascii_digit() && c != '.').any(is_section) || text.contains("errat")
}

/// What the model of a chip refuses or does is a reading of its manual: a test says of which section.
#[test]
fn every_test_of_a_driver_cites_the_manual() {
    const DRIVERS: [&str; 9] = ["adc", "bank2", "clocks", "ecc", "gpio", "loader", "options", "usart", "watchdog"];
    let mut missing = Vec::new();
    let mut n_tests = 0;
    for Source { path, text } in sources() {
        let Some(inside) = path.strip_prefix("firmware/boards/b-l475e-iot01a/src/") else { continue };
        let module = inside.split('/').next().unwrap_or(inside).trim_end_matches(".rs");
        if !DRIVERS.contains(&module) {
            continue;
        }
        // A test reaches from the blank line above its comment to the one below its end.
        let items = text.split("\n\n").filter(|item| item.contains("#[test]\n"));
        for item in items {
            n_tests += 1;
            let name = item.split("fn ").nth(1).and_then(|rest| rest.split('(').next()).unwrap_or_default();
            missing.extend((!cites_manual(item)).then(|| format!("{path}: `{name}` cites no section of the manual")));
        }
    }
    assert!(n_tests > 40, "{n_tests} tests");
    assert_none(missing);
}

#[test]
fn only_real_names_libm() {
    let named = sources().into_iter().filter(|Source { path: file, text }| {
        file.starts_with("shared/src") && !file.ends_with("real.rs") && text.contains("libm::")
    });
    assert_none(named.map(|source| format!("{}: libm is named in `real` alone", source.path)));
}

#[test]
fn nothing_is_left_undone() {
    let banned = [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("#[ig", "nore]"), concat!("#[should_", "panic]")];
    let mut broken = Vec::new();
    for Source { path: file, text } in sources() {
        let found = banned.iter().filter(|word| text.contains(**word));
        broken.extend(found.map(|word| format!("{file}: {word}")));
        broken.extend(
            text.lines()
                .enumerate()
                .filter(|(_, line)| line.ends_with([' ', '\t']))
                .map(|(number, _)| format!("{file}:{}: blanks at the end of the line", number + 1)),
        );
    }
    assert_none(broken);
}
