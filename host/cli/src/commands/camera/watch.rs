//! `darm camera watch`: the pose of the tool in the base from each picture, as lines that `darm record --camera` reads.

use std::path::PathBuf;

use darm_camera::camera::Camera;
use darm_camera::source::{SourceError, open};
use darm_camera::uncertain_pose::UncertainPose;
use darm_camera::watch::{Observation, Watcher};
use darm_measure::csv_text::csv_line;
use serde::Serialize;

use super::{FrameSize, PrintedTarget};
use crate::commands::camera_lines::{header, unix_now_s};
use crate::failure::Usage;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm camera watch pictures/ --camera camera.toml > poses.csv           # (no_run: camera)
  darm camera watch - --frame 1280x720 --camera camera.toml > poses.csv  # (no_run: camera) while `darm record` plays
  darm camera watch picture.png --camera camera.toml --distance-mm 250   # (no_run: camera) is the print to scale?

A line for each picture: the columns of `darm record --camera`, then the covariance of the rotation (rad) and position (m) \
about and along the axes of the base, row by row from its diagonal (cov00, cov01, … cov55), and why the picture is no \
measurement. Its pose is then NaN, and `darm record` does not take it. With --json all poses that fit are listed.";

/// Measure the tool's pose in each picture
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct WatchCommand {
    /// Folder of images, one image, or `-` for grey frames from a pipe
    #[arg(value_name = "SOURCE")]
    source: String,
    /// The calibrated camera
    #[arg(long, value_name = "CAMERA.toml")]
    camera: PathBuf,
    #[command(flatten)]
    printed: PrintedTarget,
    /// Width and height of the frames of a pipe
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    frame: Option<FrameSize>,
    /// Images of a folder per second; frames of a pipe have the time at which they arrive
    #[arg(long = "rate-hz", value_name = "HZ", default_value_t = 1.0)]
    rate_hz: f64,
    /// Known distance between the centres of base tag and tool tag, in mm: other distances are reported
    #[arg(long = "distance-mm", value_name = "MM")]
    distance_mm: Option<f64>,
}

/// The columns of the covariance: its upper triangle.
fn covariance_cells(of: impl Fn(usize, usize) -> String) -> Vec<String> {
    (0..6).flat_map(|row| (row..6).map(move |column| (row, column))).map(|(row, column)| of(row, column)).collect()
}

#[derive(Serialize)]
struct Header;

impl Answer for Header {
    fn text(&self) -> String {
        let covariance = covariance_cells(|row, column| format!("cov{row}{column}"));
        format!("{},{},{}", header(false), csv_line(covariance), "no_measurement")
    }
}

#[derive(Serialize)]
struct PoseLine {
    position_m: [f64; 3],
    rotation_vector_rad: [f64; 3],
    /// Of rotation and position, rad and m.
    covariance: [[f64; 6]; 6],
}

impl PoseLine {
    fn new(measured: &UncertainPose) -> Self {
        Self {
            position_m: measured.pose.position.into(),
            rotation_vector_rad: measured.pose.log().angular.into(),
            covariance: measured.covariance.transpose().into(),
        }
    }
}

/// A picture with what it shows.
#[derive(Serialize)]
struct Line {
    picture: String,
    time_s: f64,
    /// The pose of the tool in the base, if the picture is a measurement.
    pose: Option<PoseLine>,
    /// All poses that fit, the best first.
    candidates: Vec<PoseLine>,
    no_measurement: Vec<String>,
}

impl Line {
    fn new(picture: String, time_s: f64, observed: &Observation) -> Self {
        let candidates = observed.candidates.iter().map(PoseLine::new).collect();
        let no_measurement = observed.flags.iter().map(ToString::to_string).collect();
        Self { picture, time_s, pose: observed.measured().map(PoseLine::new), candidates, no_measurement }
    }
}

impl Answer for Line {
    fn text(&self) -> String {
        let number =
            |of: &dyn Fn(&PoseLine) -> f64| self.pose.as_ref().map_or("NaN".into(), |pose| format!("{:.7}", of(pose)));
        let position = (0..3).map(|axis| number(&|pose| pose.position_m[axis]));
        let rotation = (0..3).map(|axis| number(&|pose| pose.rotation_vector_rad[axis].to_degrees()));
        let covariance = covariance_cells(|row, column| {
            self.pose.as_ref().map_or(String::new(), |pose| format!("{:.4e}", pose.covariance[row][column]))
        });
        let time = std::iter::once(format!("{:.6}", self.time_s));
        // Supply and temperature are not measured by a camera.
        let conditions = [String::new(), String::new()];
        let reason = std::iter::once(self.no_measurement.join("; "));
        csv_line(time.chain(position).chain(rotation).chain(conditions).chain(covariance).chain(reason))
    }
}

impl WatchCommand {
    pub(super) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        if !(self.rate_hz > 0.0 && self.rate_hz.is_finite()) {
            return Err(Usage(format!("--rate-hz {}: give a number of images per second above 0", self.rate_hz)).into());
        }
        let target = self.printed.target()?;
        let mut source = open(&self.source, self.frame.map(|FrameSize(size)| size))?;
        let known_m = self.distance_mm.map(|mm| 1e-3 * mm);
        let watcher = Watcher::new(Camera::read(&self.camera)?, target.base(), target.tool(), known_m);
        if !ui.json {
            ui.print(&Header)?;
        }
        for index in 0u64.. {
            let frame = match source.next_frame() {
                Ok(Some(frame)) => frame,
                Ok(None) => break,
                Err(error @ SourceError::Image(_)) => {
                    ui.note(&format!("not measured: {error}"));
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            let time_s = if self.source == "-" { unix_now_s() } else { index as f64 / self.rate_hz };
            let observed = watcher.observe(&frame.image)?;
            ui.print(&Line::new(frame.name, time_s, &observed))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use darm_camera::uncertain_pose::UncertainPose;
    use darm_camera::watch::{Flag, Observation};
    use darm_core::real::{Mat6, Vec3};
    use darm_core::se::Pose;

    use super::{Header, Line};
    use crate::commands::camera_lines::Columns;
    use crate::ui::Answer as _;

    #[test]
    fn record_reads_what_watch_prints() {
        let pose = Pose::new(&Vec3::new(0.1, -0.2, 0.3), Vec3::new(0.25, 0.5, 1.0));
        let candidates = vec![UncertainPose { pose, covariance: Mat6::identity() * 1e-8 }];
        let observed = Observation { tags: Vec::new(), candidates, flags: Vec::new() };
        let columns = Columns::parse(&Header.text()).unwrap();
        let read = columns.picture(&Line::new("0".into(), 12.5, &observed).text()).unwrap().unwrap();
        assert!(read.time_s == 12.5 && read.pose.distance(&pose, 1.0) < 1e-6);
        let flagged = Observation { flags: vec![Flag::Missing { id: 101 }], ..observed };
        assert_eq!(columns.picture(&Line::new("1".into(), 13.0, &flagged).text()), Ok(None));
    }
}
