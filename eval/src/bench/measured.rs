//! Real measurements: `darm diagnose` on each set and split, its error before and after beside the goal.
//!
//! The command lines stand in [`CASES`]: there is no code for a set.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use darm_figures::figure::Figure;
use xtask::setup;

/// One set of data and one split of it.
pub(super) struct Case {
    set: &'static str,
    split: &'static str,
    /// Model and table in `tests/data/measured`, or in the folder of the set in DIR.
    model: &'static str,
    data: &'static str,
    /// Whether the table is only in DIR.
    elsewhere: bool,
    options: &'static [&'static str],
    /// Names and goals of the norm and the axes that have one, in `tests/goals.toml`.
    figures: &'static [Report],
}

/// A figure of a case.
enum Report {
    /// The norm, times this, in this unit.
    Norm(f64, &'static str),
    /// The axis with this number, times this, in this unit.
    Axis(usize, f64, &'static str),
}

use Report::{Axis, Norm};

const TORQUE: &[Report] = &[
    Axis(0, 1.0, "N·m"),
    Axis(1, 1.0, "N·m"),
    Axis(2, 1.0, "N·m"),
    Axis(3, 1.0, "N·m"),
    Axis(4, 1.0, "N·m"),
    Axis(5, 1.0, "N·m"),
];
const BALLS: &[Report] = &[Norm(1e3, "mm"), Axis(3, 1e3, "mm")];
const PRESSURE: &[Report] = &[Axis(0, 1e3, "mm"), Axis(1, 1e3, "mm"), Norm(1e3, "mm")];
const FORCE: &[Report] = &[Norm(1.0, "N")];
const COUNTS: &[Report] = &[Norm(1.0, "count")];
const fn torque(split: &'static str, data: (&'static str, &'static str), options: &'static [&'static str]) -> Case {
    let (model, data) = data;
    Case { set: "staubli_tx40", split, model, data, elsewhere: false, options, figures: TORQUE }
}

const fn balls(split: &'static str, model: &'static str, keep: &'static [&'static str]) -> Case {
    let data = "mukca_joint_configurations.csv.gz";
    Case { set: "mukca_calibration", split, model, data, elsewhere: false, options: keep, figures: BALLS }
}

const fn cylinder(split: &'static str, options: &'static [&'static str]) -> Case {
    let (model, data) = ("cylinder.toml", "cylinder_friction_20hz.csv.gz");
    Case { set: "pneumatic_cylinder", split, model, data, elsewhere: false, options, figures: FORCE }
}

const fn servo(split: &'static str, options: &'static [&'static str]) -> Case {
    let (model, data) = ("servo.toml", "servo_play_10hz.csv");
    Case { set: "servo_play", split, model, data, elsewhere: true, options, figures: COUNTS }
}

const fn plate(split: &'static str, options: &'static [&'static str]) -> Case {
    let (model, data) = ("human.urdf", "human_wholebody_30hz.csv.gz");
    Case { set: "human_forceplate", split, model, data, elsewhere: false, options, figures: PRESSURE }
}

const MAP: &str = "position_count=pos,target_count=target,load=duty";

pub(super) const CASES: &[Case] = &[
    torque("A", ("tx40.toml", "tx40_joint_200hz.csv.gz"), &["--hold-out-column", "heldout"]),
    torque("B", ("tx40.toml", "tx40_joint_200hz.csv.gz"), &["--hold-out", "t >= 4.5"]),
    balls("panda_1", "panda.toml", &["--where", "robot = panda_1", "--hold-out-each", "tool_position"]),
    balls("panda_2", "panda.toml", &["--where", "robot = panda_2", "--hold-out-each", "tool_position"]),
    balls("panda_4", "panda.toml", &["--where", "robot = panda_4", "--hold-out-each", "tool_position"]),
    balls("panda_6", "panda.toml", &["--where", "robot = panda_6", "--hold-out-each", "tool_position"]),
    balls("kuka_14", "iiwa14.toml", &["--where", "robot = kuka_14", "--hold-out-each", "tool_position"]),
    Case {
        set: "ur5_tracker",
        split: "random",
        model: "ur5_tracker.toml",
        data: "ur5_tracker.csv.gz",
        elsewhere: false,
        options: &["--hold-out", "set = random"],
        figures: &[Norm(1e3, "mm")],
    },
    plate("A", &["--hold-out-column", "heldout", "--interpolate", "fresh", "--lowpass", "3"]),
    plate("B", &["--hold-out-last", "0.3", "--interpolate", "fresh", "--lowpass", "3"]),
    cylinder("O-ring", &["--where", "seal = O-ring", "--hold-out", "set_bar = 5"]),
    cylinder("NAPN", &["--where", "seal = NAPN", "--hold-out", "set_bar = 5"]),
    cylinder("NAP310", &["--where", "seal = NAP310", "--hold-out", "set_bar = 5"]),
    servo(
        "single_sts3215",
        &["--column", MAP, "--skip-after-change", "0.8", "--where", "test = single_sts3215", "--hold-out-last", "0.5"],
    ),
    servo(
        "dual_nocomp_m1",
        &["--column", MAP, "--skip-after-change", "0.8", "--where", "test = dual_nocomp_m1", "--hold-out-last", "0.5"],
    ),
    servo(
        "dual_pretension_m1",
        &[
            "--column",
            MAP,
            "--skip-after-change",
            "0.8",
            "--where",
            "test = dual_pretension_m1",
            "--hold-out-last",
            "0.5",
        ],
    ),
    Case {
        figures: &[Norm(1.0, "N·m")],
        ..torque(
            "5 kHz",
            ("tx40.toml", "tx40_motor_5khz.csv.gz"),
            &["--rate", "5000", "--lowpass", "100", "--thin", "200", "--hold-out-last", "0.5"],
        )
    },
];

/// Runs all sets; those that are in `folder` only are left out without it.
pub(super) fn measure(folder: Option<&Path>) -> Result<Vec<Figure>> {
    let program = build()?;
    let mut figures = Vec::new();
    for case in CASES {
        let name = format!("measured: {}", case.name());
        let Some(data) = case.table(folder) else {
            println!("{name}: its table may not be copied; give the folder that holds {} with --data DIR", case.set);
            continue;
        };
        let started = Instant::now();
        let (report, peak_mb) = case.diagnosed(&program, &data)?;
        let time_s = started.elapsed().as_secs_f64();
        println!("{name}\n  darm diagnose {} {} {}", case.model, case.data, quoted(case.options));
        println!("  named: {}", names(&report));
        for figure in case.figures {
            figures.extend(figure.of(&name, &report)?);
        }
        figures.push(Figure::new(&format!("{name}, time"), (time_s * 100.0).round() / 100.0, "s")?);
        figures.push(Figure::new(&format!("{name}, memory"), peak_mb.round(), "MB of memory")?);
    }
    Ok(figures)
}

/// Runs a program; its output, and the most memory that it had when it was looked at, MB.
fn run(command: &mut Command) -> Result<(Output, f64)> {
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
    let status = format!("/proc/{}/status", child.id());
    let waiting = std::thread::spawn(move || child.wait_with_output());
    let mut peak_mb: f64 = 0.0;
    while !waiting.is_finished() {
        let status = std::fs::read_to_string(&status).unwrap_or_default();
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = peak.and_then(|peak| peak.trim().trim_end_matches("kB").trim().parse::<f64>().ok());
        peak_mb = peak_mb.max(kib.unwrap_or(0.0) * 1.024e-3);
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = waiting.join().map_err(|_| anyhow::anyhow!("waiting for the program failed"))??;
    Ok((output, peak_mb))
}

impl Case {
    /// The set and its split.
    pub(super) fn name(&self) -> String {
        format!("{} {}", self.set, self.split)
    }

    /// The answer to a table in the place of that of the case, and the most memory that it took, MB.
    pub(super) fn diagnosed(&self, program: &Path, data: &Path) -> Result<(Value, f64)> {
        let model = setup::root().join("tests/data/measured").join(self.model);
        let mut diagnose = Command::new(program);
        diagnose.args(["--json", "diagnose"]).arg(&model).arg(data).args(self.options);
        let (output, peak_mb) = run(&mut diagnose)?;
        if !output.status.success() {
            bail!("{}: {}", self.name(), String::from_utf8_lossy(&output.stderr));
        }
        Ok((serde_json::from_slice(&output.stdout).context("the answer is no JSON")?, peak_mb))
    }

    /// Its held-out errors with what was found.
    pub(super) fn errors(&self, report: &Value) -> Result<Vec<f64>> {
        self.figures.iter().map(|figure| figure.value(report, "after")).collect()
    }

    /// Its table; `None` where that is in `folder` only and none is given.
    pub(super) fn table(&self, folder: Option<&Path>) -> Option<PathBuf> {
        match (self.elsewhere, folder) {
            (false, _) => Some(setup::root().join("tests/data/measured").join(self.data)),
            (true, Some(folder)) => Some(folder.join(self.set).join(self.data)),
            (true, None) => None,
        }
    }
}

impl Report {
    /// Where an answer has it.
    fn pointer(&self) -> String {
        match self {
            Norm(..) => "norm".to_string(),
            Axis(axis, ..) => format!("axes/{axis}"),
        }
    }

    /// The held-out figure before or after.
    fn value(&self, report: &Value, when: &str) -> Result<f64> {
        let (Norm(factor, _) | Axis(_, factor, _)) = self;
        let value = report.pointer(&format!("/error/{when}/held_out/{}/value", self.pointer()));
        Ok(value.and_then(Value::as_f64).with_context(|| format!("no error {when}"))? * factor)
    }

    /// The held-out figure after and before.
    fn of(&self, name: &str, report: &Value) -> Result<[Figure; 2]> {
        let (Norm(_, unit) | Axis(_, _, unit)) = self;
        let pointer = self.pointer();
        let number = |when: &str| self.value(report, when).with_context(|| name.to_owned());
        let axis =
            report.pointer(&format!("/error/after/held_out/{pointer}/axis")).and_then(Value::as_str).unwrap_or("norm");
        println!("  {axis}: {:.3} -> {:.3} {unit}", number("before")?, number("after")?);
        let rounded = |value: f64| (value * 1000.0).round() / 1000.0;
        Ok([
            Figure::new(&format!("{name}, {axis}"), rounded(number("after")?), unit)?,
            Figure::new(&format!("{name}, {axis}, before"), rounded(number("before")?), unit)?,
        ])
    }
}

/// The effects of an answer.
pub(super) fn effects(report: &Value) -> &[Value] {
    report["effects"].as_array().map_or(&[][..], Vec::as_slice)
}

/// The laws that were named, each with how often.
fn names(report: &Value) -> String {
    let mut laws: Vec<&str> = effects(report).iter().filter_map(|effect| effect["law"].as_str()).collect();
    laws.sort_unstable();
    let counted = laws.chunk_by(|a, b| a == b).map(|same| format!("{} ×{}", same[0], same.len()));
    counted.collect::<Vec<_>>().join(", ")
}

fn quoted(options: &[&str]) -> String {
    let quote = |option: &&str| if option.contains(' ') { format!("\"{option}\"") } else { (*option).to_string() };
    options.iter().map(quote).collect::<Vec<_>>().join(" ")
}

/// Builds `darm`.
pub(super) fn build() -> Result<PathBuf> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status =
        Command::new(cargo).current_dir(setup::root()).args(["build", "-q", "-p", "darm", "--bin", "darm"]).status()?;
    if !status.success() {
        bail!("darm did not build");
    }
    Ok(setup::root().join("target/debug/darm"))
}
