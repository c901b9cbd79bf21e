//! `darm diagnose`: which effect the model lacks, where, how large, and how sure that is.

use std::path::PathBuf;

use darm::arm::Arm;
use darm::diagnose::outcome::{Diagnosis, ErrorFigure, Found, Verdict};
use darm::diagnose::{Options, diagnose};
use darm::measurement::{self, check};
use serde::Serialize;

use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm diagnose arm.toml run.csv                 the verdict, and what it rests on
  darm diagnose arm.toml run.csv -o arm2.toml    and the model with the effect in it, for the next table
  darm --json diagnose arm.toml run.csv.gz       everything that was tried

Rows that are held out (column held_out) are never fitted: the error after is told on them.";

/// Find which effect the model lacks, where, how large, and how sure that is
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Diagnose {
    /// The model that predicted
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Measurements: what `darm record` writes, or any CSV with its columns; may end in .gz
    #[arg(value_name = "RUN.csv")]
    data: PathBuf,
    /// The model with the effects that were found
    #[arg(short, long, value_name = "NEW.toml")]
    output: Option<PathBuf>,
    /// Seed of the cross-validation
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

#[derive(Serialize)]
struct Report {
    findings: Vec<String>,
    #[serde(flatten)]
    diagnosis: Diagnosis,
    output: Option<PathBuf>,
}

impl Diagnose {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let (run, mut findings) = measurement::read(&self.data)?;
        findings.extend(check(&arm, &run));
        let wheel = voice.wheel("diagnosing");
        let diagnosis = diagnose(&arm, &run, &Options { seed: self.seed, ..Options::default() });
        wheel.finish_and_clear();
        let diagnosis =
            diagnosis.map_err(|error| anyhow::Error::new(error).context(self.data.display().to_string()))?;
        let output = match (&self.output, diagnosis.verdict) {
            (Some(path), Verdict::EffectFound) => {
                diagnosis.corrected(&arm, &run).write(path)?;
                Some(path.clone())
            }
            (Some(_), _) => {
                voice.note("no effect is named, so there is no better model to write");
                None
            }
            (None, _) => None,
        };
        voice.tell(&Report { findings: findings.iter().map(ToString::to_string).collect(), diagnosis, output })
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let mut lines: Vec<String> = self.findings.iter().map(|finding| format!("note: {finding}")).collect();
        lines.extend(self.diagnosis.plain.clone());
        lines.extend(self.diagnosis.effects.iter().map(effect));
        lines.push(String::new());
        lines.push(self.errors());
        lines.extend(self.output.as_ref().map(|path| format!("\nthe model with it is in {}", path.display())));
        lines.join("\n")
    }
}

fn effect(found: &Found) -> String {
    let values = found.parameters.iter().map(|parameter| {
        let [low, high] = parameter.ci95;
        let unit = if parameter.unit == "1" { String::new() } else { format!(" {}", parameter.unit) };
        format!("{} {:.6}{unit} (95 %: {low:.6} to {high:.6})", parameter.name, parameter.value)
    });
    format!("  {}, {}: {}", found.law, found.place_name, values.collect::<Vec<_>>().join(", "))
}

impl Report {
    /// Errors before and after, on rows that the fit saw and on those that it did not.
    fn errors(&self) -> String {
        let Diagnosis { rows, error, repeatability, .. } = &self.diagnosis;
        let mm = |figure: &ErrorFigure| format!("{:.3} mm", 1e3 * figure.distance_m);
        let optional = |figure: &Option<ErrorFigure>| figure.as_ref().map_or("-".to_owned(), mm);
        let head = ["error (RMS distance)", "rows", "before", "after"].map(str::to_owned).to_vec();
        let fitted = vec!["fitted".into(), rows.train.to_string(), mm(&error.before.train), mm(&error.after.train)];
        let heldout = vec![
            "held out".into(),
            rows.heldout.to_string(),
            optional(&error.before.heldout),
            optional(&error.after.heldout),
        ];
        let repeats =
            repeatability.as_ref().map_or("not measured".to_owned(), |r| format!("{:.3} mm", 1e3 * r.distance_m));
        format!("{}\nrepeatability: {repeats}", columns(&[head, fitted, heldout]))
    }
}
