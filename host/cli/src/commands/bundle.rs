//! `darm bundle`: a diagnosis with all that it needs to be run again, in one file for a bug report.

mod files;

use std::io::{Cursor, Write as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm_diagnose::outcome::Diagnosis;
use serde::Serialize;
use serde_json::json;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::diagnose::options::{DiagnoseOptions, Task};
use super::diagnose::{Report, page};
use crate::failure;
use crate::output_file::{refuse_same, write_all};
use crate::overwrite::OutputFile;
use crate::swapped_files::{self, options_without, quoted};
use crate::ui::{self, Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm bundle bug.zip planar4.toml planar4-run.csv     # model, log, verdict and report in one file
  darm bundle bug.zip cylinder.toml cylinder-force.csv.gz --where 'seal = O-ring' --force

Takes the options of `darm diagnose` that decide the verdict. The file has the model with the files that it names, the log, the \
command line, versions, and what the diagnosis gave: verdict.json and report.html, or error.txt where it failed. Read it before you \
publish it: the log and the model are in it as they are.";

/// Logs from this size on may be too large to attach, bytes.
const LARGE: u64 = 25_000_000;

/// Pack a diagnosis with its model and log into one file, for a bug report
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Bundle {
    /// The file to write
    #[arg(value_name = "FILE.zip")]
    output: OutputFile,
    /// The model, as of `darm diagnose`
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Measurements, as of `darm diagnose`
    #[arg(value_name = "DATA")]
    data: PathBuf,
    #[command(flatten)]
    options: DiagnoseOptions,
}

/// What is printed.
#[derive(Serialize)]
struct Packed {
    output: PathBuf,
    /// Names of the files in it.
    files: Vec<String>,
    /// The command line that is stored in it.
    command: String,
    /// The verdict; null where the diagnosis failed.
    verdict: Option<String>,
    /// Why it failed.
    error: Option<String>,
}

/// What a diagnosis gave, as files.
struct Outcome {
    verdict: Option<String>,
    error: Option<String>,
    files: Vec<(String, Vec<u8>)>,
}

impl Bundle {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        swapped_files::refuse(&self.model, &self.data)?;
        for input in [&self.model, &self.data] {
            refuse_same(input, &self.output)?;
        }
        let files::Files { model, all } = files::of(&self.model)?;
        let log = std::fs::read(&self.data).with_context(|| format!("cannot read {}", self.data.display()))?;
        if log.len() as u64 >= LARGE {
            ui.note(&format!(
                "{} has {} MB, which many issue trackers refuse: leave rows out of the file that do not show the problem",
                self.data.display(),
                log.len() / 1_000_000
            ));
        }
        let log_name = format!("log/{}", name(&self.data));
        let command = self.command(&model, &log_name);
        let Outcome { verdict, error, files } = self.diagnose(ui);
        let mut files = [vec![("README.txt".into(), readme(&command).into_bytes())], files, all].concat();
        files.push(("command.txt".into(), format!("{command}\n").into_bytes()));
        files.push(("versions.json".into(), versions().to_string().into_bytes()));
        files.push((log_name, log));
        let packed = pack(&files).context("cannot pack the files")?;
        write_all(&[(&self.output, &packed)])?;
        let files = files.into_iter().map(|(name, _)| name).collect();
        ui.print(&Packed { output: self.output.to_path_buf(), files, command, verdict, error })
    }

    /// The command line that gives the same verdict in the folder of the files.
    fn command(&self, model: &str, log: &str) -> String {
        let words = ["darm", "--json", "diagnose", model, log].map(str::to_owned);
        let options = options_without(&[&self.output, &self.model, &self.data], &["--force"]);
        words.iter().chain(&options).map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    }

    /// The diagnosis; one that fails in whatever way is what the bundle is for.
    fn diagnose(&self, ui: Ui) -> Outcome {
        let task = Task { model: &self.model, data: &self.data, new_model: None };
        let run = || self.options.diagnose(task, ui).and_then(|(diagnosis, _)| self.outcome(diagnosis));
        let error = match catch_unwind(AssertUnwindSafe(run)) {
            Ok(Ok(outcome)) => return outcome,
            Ok(Err(error)) => failure::sentence(&error),
            Err(_) => "the diagnosis panicked; its message is on the standard error".into(),
        };
        let files = vec![("error.txt".into(), format!("{error}\n").into_bytes())];
        Outcome { verdict: None, error: Some(error), files }
    }

    fn outcome(&self, diagnosis: Diagnosis) -> anyhow::Result<Outcome> {
        let page = page(&diagnosis, &diagnosis.next_step(), &self.model, &self.data)?;
        let verdict = Some(diagnosis.verdict.to_string());
        let json = ui::json(&Report::new(diagnosis))?;
        let files = vec![("verdict.json".into(), json.into_bytes()), ("report.html".into(), page.into_bytes())];
        Ok(Outcome { verdict, error: None, files })
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn readme(command: &str) -> String {
    format!(
        "A diagnosis by darm {}, packed by `darm bundle`. To run it again, unpack all files and run in their folder:\n\n  \
         {command}\n\nmodel/         the model and the files that it names\nlog/           the measurements\nverdict.json   \
         what the command printed\nreport.html    the same as a page\nerror.txt      why it failed, in place of these two\n\
         versions.json  of darm and the system\ncommand.txt    the command line alone\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// Of this program and of the system.
fn versions() -> serde_json::Value {
    let release = std::fs::read_to_string("/etc/os-release").unwrap_or_default();
    let system = release.lines().find_map(|line| line.strip_prefix("PRETTY_NAME="));
    json!({
        "darm": env!("CARGO_PKG_VERSION"),
        "target": format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
        "os": system.map(|name| name.trim_matches('"')),
    })
}

fn pack(files: &[(String, Vec<u8>)]) -> zip::result::ZipResult<Vec<u8>> {
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        archive.start_file(name.as_str(), options)?;
        archive.write_all(bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}

impl Answer for Packed {
    fn text(&self) -> String {
        let gave = match (&self.verdict, &self.error) {
            (Some(verdict), _) => format!("verdict: {verdict}"),
            (None, error) => {
                format!("the diagnosis failed, and its error is in error.txt: {}", error.as_deref().unwrap_or(""))
            }
        };
        let files: Vec<String> = self.files.iter().map(|file| format!("  {file}")).collect();
        let size = format!("wrote {} with {} files:", self.output.display(), files.len());
        format!("{gave}\n{size}\n{}\nit runs again with: {}", files.join("\n"), self.command)
    }
}
