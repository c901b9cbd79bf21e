//! `darm camera calibrate`: the lens of a camera from views of the board.

use std::path::PathBuf;

use darm_camera::collector::{Collector, Outcome, Report};
use darm_camera::source::{SourceError, open};
use serde::Serialize;

use super::{FrameSize, PrintedTarget};
use crate::output_file::{refuse_other_than_toml, write_all};
use crate::overwrite::OutputFile;
use crate::ui::{Answer, Ui, columns, six_digits};

const EXAMPLES: &str = "\
Examples:
  darm camera calibrate views/ -o camera.toml              # (no_run: camera)
  darm camera calibrate - --frame 1280x720 -o camera.toml  # (no_run: camera) frames from a pipe, with guidance

At least 15 views are needed: the board in the middle and near each corner of the picture, large, tilted by 20 to 45° to each \
side, at rest. The command says which are missing. Without a good calibration it writes nothing.";

/// Standard deviations of a 95 % interval.
const INTERVAL: f64 = 1.96;

/// Calibrate the lens of a camera from views of the board
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct CalibrateCommand {
    /// Folder of images, one image, or `-` for grey frames from a pipe
    #[arg(value_name = "SOURCE")]
    source: String,
    #[command(flatten)]
    printed: PrintedTarget,
    /// Width and height of the frames of a pipe
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    frame: Option<FrameSize>,
    /// Camera file to write
    #[arg(short, long, value_name = "CAMERA.toml")]
    output: OutputFile,
}

#[derive(Serialize)]
struct Calibrated {
    output: PathBuf,
    lens: Vec<Parameter>,
    reprojection_px: f64,
    noise_scale: f64,
    blur_px: f64,
    views: Vec<UsedView>,
    unusable: Vec<UnusableView>,
    /// Views that would make it better.
    missing: Vec<String>,
}

#[derive(Serialize)]
struct Parameter {
    name: &'static str,
    value: f64,
    standard_deviation: f64,
}

#[derive(Serialize)]
struct UsedView {
    name: String,
    reprojection_px: f64,
}

#[derive(Serialize)]
struct UnusableView {
    name: String,
    reason: String,
}

impl Calibrated {
    fn new(output: PathBuf, report: &Report) -> Self {
        let parameter = |(name, value, standard_deviation)| Parameter { name, value, standard_deviation };
        let errors = report.used.iter().zip(&report.calibration.reprojection_px);
        let unusable = report.unusable.iter();
        Self {
            output,
            lens: report.calibration.lines().map(parameter).collect(),
            reprojection_px: report.calibration.overall_px,
            noise_scale: report.calibration.noise_scale,
            blur_px: report.camera.quality().blur_px,
            views: errors.map(|(name, px)| UsedView { name: name.clone(), reprojection_px: *px }).collect(),
            unusable: unusable.map(|(name, e)| UnusableView { name: name.clone(), reason: e.to_string() }).collect(),
            missing: report.missing.iter().map(ToString::to_string).collect(),
        }
    }
}

impl Answer for Calibrated {
    fn text(&self) -> String {
        let parameter = |line: &Parameter| {
            let interval = format!("± {}", six_digits(INTERVAL * line.standard_deviation));
            vec![line.name.to_owned(), six_digits(line.value), interval]
        };
        let title = ["lens", "value", "95 %"].map(str::to_owned).to_vec();
        let rows: Vec<_> = std::iter::once(title).chain(self.lens.iter().map(parameter)).collect();
        let view = |view: &UsedView| vec![view.name.clone(), format!("{:.3}", view.reprojection_px)];
        let title = ["view", "error px"].map(str::to_owned).to_vec();
        let views: Vec<_> = std::iter::once(title).chain(self.views.iter().map(view)).collect();
        let mut text = format!(
            "{}\n\n{}\n\n{}: {} views, reprojection error {:.3} px, blur {:.2} px",
            columns(&rows),
            columns(&views),
            self.output.display(),
            self.views.len(),
            self.reprojection_px,
            self.blur_px,
        );
        for missing in &self.missing {
            text += &format!("\nwould make it better: {missing}");
        }
        text
    }
}

impl CalibrateCommand {
    pub(super) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        refuse_other_than_toml(&self.output, &[])?;
        let mut source = open(&self.source, self.frame.map(|FrameSize(size)| size))?;
        let mut collector = Collector::new(self.printed.target()?);
        loop {
            let frame = match source.next_frame() {
                Ok(Some(frame)) => frame,
                Ok(None) => break,
                Err(error @ SourceError::Image(_)) => {
                    ui.note(&format!("not used: {error}"));
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            match collector.add(&frame.name, frame.image)? {
                Outcome::Used => ui.note(&progress(&frame.name, &collector)),
                Outcome::Repeated => {}
                Outcome::Full => break,
                Outcome::Unusable => {
                    let reason = collector.last_error().map(ToString::to_string).unwrap_or_default();
                    ui.note(&format!("{}: not used: {reason}", frame.name));
                }
            }
        }
        let report = collector.finish()?;
        write_all(&[(&self.output, report.camera.to_toml()?.as_bytes())])?;
        ui.print(&Calibrated::new(self.output.to_path_buf(), &report))
    }
}

/// The number of views, and the next one that is wanted.
fn progress(name: &str, collector: &Collector) -> String {
    let missing = collector.missing();
    let next = missing.last().map_or_else(|| "nothing is missing".into(), |missing| format!("next: {missing}"));
    format!("{name}: view {}; {next}", collector.views())
}
