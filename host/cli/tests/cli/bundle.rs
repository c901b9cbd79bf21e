//! `darm bundle`: what is packed gives the same verdict in an empty folder.

use super::{Home, example, text};

/// Unpacks an archive into an empty home; the names in it.
fn unpacked(home: &Home, name: &str) -> (Home, Vec<String>) {
    let empty = Home::new();
    let mut archive = zip::ZipArchive::new(std::fs::File::open(home.path(name)).unwrap()).unwrap();
    archive.extract(empty.path("")).unwrap();
    (empty, archive.file_names().map(|name| name.unwrap().into_owned()).collect())
}

/// Runs the command line that is stored in a bundle; what it prints.
fn run_again(folder: &Home) -> String {
    let line = std::fs::read_to_string(folder.path("command.txt")).unwrap();
    let readme = std::fs::read_to_string(folder.path("README.txt")).unwrap();
    assert!(readme.contains(&line), "{readme}");
    // A shell parts the words, as a person would have it.
    let mut shell = std::process::Command::new("/bin/sh");
    let darm = line.trim().replacen("darm", env!("CARGO_BIN_EXE_darm"), 1);
    text(&shell.args(["-c", &darm]).current_dir(folder.path("")).output().unwrap().stdout)
}

#[test]
fn a_bundle_gives_the_same_verdict_in_an_empty_folder() {
    let home = Home::new();
    std::fs::create_dir_all(home.path("models")).unwrap();
    std::fs::create_dir_all(home.path("robots")).unwrap();
    std::fs::copy(example("tx40.urdf"), home.path("robots/tx40.urdf")).unwrap();
    std::fs::copy(example("tx40-motion.csv.gz"), home.path("my run.csv.gz")).unwrap();
    home.write("models/tx40.toml", "kind = \"robot\"\nurdf = \"../robots/tx40.urdf\"\nobserved = \"torque\"\n");
    let words = ["bundle", "bug.zip", "models/tx40.toml", "my run.csv.gz", "--where", "t >= 4 and t < 5"];
    let rejected = ["--reject", "coulomb-friction, joint 3: it's new", "--seed", "3"];
    let output = home.command("--json").args(words).args(rejected).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let packed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let (empty, names) = unpacked(&home, "bug.zip");
    for name in ["model/of/tx40.toml", "model/robots/tx40.urdf", "log/my run.csv.gz", "versions.json", "report.html"] {
        assert!(names.iter().any(|own| own == name), "{name}: {names:?}");
    }
    let verdict = std::fs::read_to_string(empty.path("verdict.json")).unwrap();
    let parsed: serde_json::Value = serde_json::from_str(&verdict).unwrap();
    assert_eq!((&parsed["verdict"], &parsed["rejected"][0]["reason"]), (&packed["verdict"], &"it's new".into()));
    assert_eq!(run_again(&empty).trim_end(), verdict);
    assert!(
        std::fs::read_to_string(empty.path("report.html")).unwrap().contains("it&#39;s new")
            || verdict.contains("it's new")
    );
    let versions: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(empty.path("versions.json")).unwrap()).unwrap();
    assert_eq!(versions["darm"], parsed["version"]);
    home.fails("bundle bug.zip models/tx40.toml my", 1, "darm: bug.zip exists; overwrite it with --force");
}

#[test]
fn a_diagnosis_that_fails_is_packed_with_its_error() {
    let home = Home::new();
    home.write("cylinder.toml", "kind = \"cylinder\"\nbore_mm = 25\n");
    let comment = format!("# {}\n", "x".repeat(998)).repeat(26_000);
    home.write("run.csv", &format!("{comment}t_s,x_mm,p_bar\n0,1,2\n1,2,3\n"));
    let output = home.darm("bundle bug.zip cylinder.toml run.csv");
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("run.csv has 26 MB"), "{}", text(&output.stderr));
    assert!(
        printed.contains("the diagnosis failed, and its error is in error.txt: run.csv: no column force"),
        "{printed}"
    );
    let (empty, names) = unpacked(&home, "bug.zip");
    assert!(!names.iter().any(|name| ["verdict.json", "report.html"].contains(&name.as_str())), "{names:?}");
    let error = std::fs::read_to_string(empty.path("error.txt")).unwrap();
    let again: serde_json::Value = serde_json::from_str(&run_again(&empty)).unwrap();
    assert_eq!(again["error"]["message"].as_str().unwrap().replace("log/", ""), error.trim_end());
    home.write("cylinder.toml", "kind = \"cylinder\"\nbore_mm = \n");
    let broken = home.succeeds("bundle bug.zip cylinder.toml run.csv --force");
    assert!(broken.contains("error.txt: cylinder.toml:2:"), "{broken}");
    home.fails(
        "bundle new.zip none.toml run.csv",
        1,
        "darm: cannot read none.toml: No such file or directory (os error 2)",
    );
}
