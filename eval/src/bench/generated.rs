//! Generated Rust beside the C that CasADi makes for the same robots, in one process.
//!
//! CasADi comes as a PyPI wheel into a virtual environment under `target/generated`, and its C is made by
//! `xtask/generated/casadi_c.py`. Both sides are optimised to the same level for this machine; neither may regroup its sums
//! (no `-ffast-math`). The C compiler may fuse a product and a sum into one instruction, as it does by default; the Rust
//! compiler may not.

use std::fs;
use std::io::Read as _;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context as _, Result, bail, ensure};
use darm_core::actuator::{Axis, JointKind};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::{Inertia, Joint};
use darm_figures::figure::Figure;
use darm_generate::{Width, robot, rust};
use darm_robot::robot::{Robot, RobotFrame, RobotJoint};
use serde_json::Value;
use xtask::{setup, step};

use crate::python;

const CASADI: &str = "casadi==3.8.2";
/// Those of `bench --peers`.
const ROBOTS: [&str; 3] = ["panda_urdf", "ur10_urdf", "puma560_dh"];
/// Works of the program and the functions that they need.
const FUNCTIONS: [&str; 3] = ["kinematics", "inverse_dynamics", "mass_matrix"];
/// How often the program runs, each time from a separate copy: where its pages lie in memory can decide the time of a
/// function, and stays the same for one copy.
const RUNS: usize = 5;
/// Options of both compilers: `-march=native` and `target-cpu=native` are the same features.
const C_FLAGS: [&str; 3] = ["-O3", "-march=native", "-fno-fast-math"];
const RUST_FLAGS: [&str; 6] =
    ["--edition=2024", "-Copt-level=3", "-Ctarget-cpu=native", "-Ccodegen-units=1", "-Cpanic=abort", "-Cstrip=symbols"];
const BY_HAND: &str = "xtask/generated/README.md has the commands to do it by hand";

/// Writes and compiles both sides, runs them, and gives the ratios of their times.
pub(super) fn measure() -> Result<Vec<Figure>> {
    let root = setup::root();
    let folder = root.join("target/generated");
    fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    let python = python::environment(&folder.join("venv"), &[CASADI])?;
    for name in ROBOTS {
        let golden = root.join(format!("tests/data/golden/{name}.json.gz"));
        let (robot, tool) = read(&golden)?;
        let mut module = robot::module(&robot, &tool)?;
        module.functions.retain(|function| FUNCTIONS.contains(&function.name));
        fs::write(folder.join(format!("{name}.rs")), rust::file(&module, Width::Double))?;
        let mut write = Command::new(&python);
        write.arg(root.join("xtask/generated/casadi_c.py")).arg(&golden).arg(&folder);
        run(&format!("writing the C of {name}"), &mut write)?;
    }
    let program = compiled(&root, &folder)?;
    let mut texts = Vec::new();
    for index in 1..=RUNS {
        eprintln!("run {index} of {RUNS}");
        let copy = folder.join(format!("beside-{index}"));
        fs::copy(&program, &copy).with_context(|| format!("{} cannot be written", copy.display()))?;
        let output = Command::new(&copy).output().with_context(|| format!("{} did not start", copy.display()))?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        if !output.status.success() {
            bail!("the comparison failed:\n{text}{}", String::from_utf8_lossy(&output.stderr));
        }
        texts.push(text);
    }
    figures(&texts)
}

/// Compiles both sides into one program.
fn compiled(root: &Path, folder: &Path) -> Result<std::path::PathBuf> {
    if Command::new("gcc").arg("--version").output().is_err() {
        setup::install(&["gcc"], BY_HAND)?;
    }
    let library = folder.join("libcasadi.a");
    if library.exists() {
        fs::remove_file(&library)?;
    }
    let mut archive = Command::new("ar");
    archive.current_dir(folder).args(["rcs", "libcasadi.a"]);
    for name in ROBOTS {
        let mut compile = Command::new("gcc");
        compile.current_dir(folder).args(C_FLAGS).args(["-c", &format!("{name}.c"), "-o", &format!("{name}.o")]);
        run(&format!("compiling {name}.c"), &mut compile)?;
        archive.arg(format!("{name}.o"));
    }
    run("packing CasADi's side", &mut archive)?;
    let program = folder.join("beside");
    let mut compile = Command::new("rustc");
    compile.current_dir(root).args(RUST_FLAGS).arg("xtask/generated/main.rs").arg("-o").arg(&program);
    compile.arg("-L").arg(format!("native={}", folder.display())).arg("-lm");
    run("compiling the generated Rust", &mut compile)?;
    Ok(program)
}

fn run(what: &str, command: &mut Command) -> Result<()> {
    step::run(what, command, Duration::from_secs(600), BY_HAND)
}

/// The robot of a golden file, whose numbers CasADi's side reads too, and its tool.
fn read(path: &Path) -> Result<(Robot, RobotFrame)> {
    let mut text = String::new();
    let file = fs::File::open(path).with_context(|| format!("{} cannot be opened", path.display()))?;
    flate2::read::GzDecoder::new(file).read_to_string(&mut text)?;
    parse(&serde_json::from_str(&text)?).with_context(|| format!("{} is no golden file of an arm", path.display()))
}

fn parse(file: &Value) -> Result<(Robot, RobotFrame)> {
    let joints = file["joints"].as_array().context("joints are missing")?;
    let mut robot = Robot { gravity: vector(&file["gravity_field"])?, ..Robot::empty() };
    file["name"].as_str().context("the name is missing")?.clone_into(&mut robot.name);
    for (index, joint) in joints.iter().enumerate() {
        robot.joints.push(RobotJoint::new(format!("joint{index}"), format!("link{index}"), self::joint(joint)?));
    }
    let last = joints.len().checked_sub(1);
    let tool = RobotFrame { name: "end".into(), joint: last, pose: pose(&file["ee"])?, is_end: true };
    Ok((robot, tool))
}

fn joint(value: &Value) -> Result<Joint<f64>> {
    let link = &value["link"];
    ensure!(value["type"] == "revolute", "a joint is not revolute");
    Ok(Joint {
        parent: value["parent"].as_u64().map(|parent| parent as usize),
        axis: Axis { kind: JointKind::Revolute, direction: vector(&value["axis"])? },
        placement: pose(&value["placement"])?,
        inertia: Inertia {
            mass: link["m"].as_f64().context("a mass is missing")?,
            com: vector(&link["com"])?,
            about_com: matrix(&link["I_com"])?,
        },
    })
}

fn pose(value: &Value) -> Result<Pose<f64>> {
    Ok(Pose { rotation: matrix(&value["R"])?, position: vector(&value["p"])? })
}

fn vector(value: &Value) -> Result<Vec3<f64>> {
    Ok(serde_json::from_value::<[f64; 3]>(value.clone())?.into())
}

fn matrix(value: &Value) -> Result<Mat3<f64>> {
    let rows: [[f64; 3]; 3] = serde_json::from_value(value.clone())?;
    Ok(Mat3::from_fn(|row, column| rows[row][column]))
}

/// A work of one run.
struct Timed {
    name: String,
    ours_ns: f64,
    theirs_ns: f64,
    difference: f64,
}

fn timed(line: &str) -> Result<Timed> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [robot, work, ours, theirs, difference] = words[..] else { bail!("{line:?} is no line of five words") };
    let name = format!("{robot}: generated {work}");
    Ok(Timed { name, ours_ns: ours.parse()?, theirs_ns: theirs.parse()?, difference: difference.parse()? })
}

/// Prints the table, and gives median and worst of the ratios of all runs.
fn figures(runs: &[String]) -> Result<Vec<Figure>> {
    let runs: Vec<Vec<Timed>> = runs.iter().map(|text| text.lines().map(timed).collect()).collect::<Result<_>>()?;
    let first = runs.first().context("nothing was run")?;
    ensure!(!first.is_empty(), "the comparison printed nothing");
    println!("{:44} {:>10} {:>10}", "least of all runs, ns", "ours", "CasADi");
    let (mut figures, mut faster, mut difference) = (Vec::new(), 0, 0.0_f64);
    for (index, work) in first.iter().enumerate() {
        let same: Vec<&Timed> = runs.iter().filter_map(|run| run.get(index)).collect();
        ensure!(
            same.len() == runs.len() && same.iter().all(|run| run.name == work.name),
            "the runs have different works"
        );
        let min_of = |value: fn(&Timed) -> f64| same.iter().map(|run| value(run)).fold(f64::INFINITY, f64::min);
        println!("{:44} {:>10.1} {:>10.1}", work.name, min_of(|run| run.ours_ns), min_of(|run| run.theirs_ns));
        let mut ratios: Vec<f64> = same.iter().map(|run| run.ours_ns / run.theirs_ns).collect();
        ratios.sort_by(f64::total_cmp);
        let (median, worst) = (ratios[ratios.len() / 2], ratios[ratios.len() - 1]);
        faster += usize::from(worst <= FASTER);
        for (what, ratio) in [("median", median), ("worst", worst)] {
            let name = format!("{} over CasADi's C, {what} of {}", work.name, runs.len());
            figures.push(Figure::new(&name, (ratio * 1000.0).round() / 1000.0, "of the time")?);
        }
        difference = same.iter().fold(difference, |largest, run| {
            if largest.is_nan() || run.difference <= largest { largest } else { run.difference }
        });
    }
    figures.push(Figure::new(
        &format!("generated: works of {} at most {FASTER} of CasADi's time in the worst run", first.len()),
        faster as f64,
        "",
    )?);
    figures.push(Figure::new(
        "generated: largest difference from CasADi's results",
        difference,
        "of the largest number",
    )?);
    Ok(figures)
}

/// The share of CasADi's time that most works are to reach.
const FASTER: f64 = 0.95;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_those_of_each_run() {
        let runs = [
            "ur10_urdf kinematics 50 100 1e-15\nur10_urdf mass-matrix 110 100 2e-15\n",
            "ur10_urdf kinematics 60 100 1e-15\nur10_urdf mass-matrix 90 100 1e-15\n",
            "ur10_urdf kinematics 99 100 3e-15\nur10_urdf mass-matrix 100 100 1e-15\n",
        ];
        let reported = figures(&runs.map(str::to_owned)).unwrap();
        let values: Vec<f64> = reported.iter().map(|figure| figure.value).collect();
        assert_eq!(values, [0.6, 0.99, 1.0, 1.1, 0.0, 3e-15]);
    }

    #[test]
    fn runs_without_the_same_works_are_refused() {
        let refused = |runs: &[&str]| figures(&runs.iter().map(|run| (*run).to_owned()).collect::<Vec<_>>()).is_err();
        assert!(refused(&[]) && refused(&[""]) && refused(&["words\n"]));
        assert!(refused(&["a kinematics 1 2 0\n", "a mass-matrix 1 2 0\n"]) && refused(&["a kinematics 1 2 0\n", ""]));
    }

    #[test]
    fn a_difference_that_is_not_a_number_is_reported() {
        let reported = figures(&["a kinematics 1 2 NaN\n".to_owned(), "a kinematics 1 2 0\n".to_owned()]);
        assert!(reported.unwrap().last().unwrap().value.is_nan());
    }

    #[test]
    fn golden_files_are_the_robots_of_the_examples() {
        let root = setup::root();
        let (robot, tool) = read(&root.join("tests/data/golden/puma560_dh.json.gz")).unwrap();
        let example = darm_robot::dh::read(&root.join("examples/puma560.toml")).unwrap();
        let q = [0.1, -0.4, 0.7, 1.1, -0.3, 0.5];
        let ours = robot.kinematics(&tool, &q).unwrap().pose_base_frame;
        let theirs = example.kinematics(example.tool().unwrap(), &q).unwrap().pose_base_frame;
        assert!((ours.position - theirs.position).norm() < 1e-12, "{ours:?} {theirs:?}");
        assert!(parse(&serde_json::json!({"name": "none"})).is_err());
    }
}
