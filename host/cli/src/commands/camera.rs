//! `darm camera`: from pictures of printed tags to poses of the tool, for `darm record --camera`.

mod calibrate;
mod target;
mod watch;

use std::str::FromStr;

use darm_camera::target::{Size, Target};

use crate::failure::Usage;
use crate::ui::Ui;

const EXAMPLES: &str = "\
Examples:
  darm camera target -o target.svg                                # print at 100 %, measure the ruler
  darm camera calibrate views/ -o camera.toml                     # (no_run: camera)
  darm camera watch pictures/ --camera camera.toml > poses.csv    # (no_run: camera)

Video comes through a pipe from a program that decodes it, as grey frames:

  ffmpeg -f v4l2 -video_size 1280x720 -i /dev/video0 -f rawvideo -pix_fmt gray - |
    darm camera watch - --frame 1280x720 --camera camera.toml

Fix focus and zoom of the camera before the calibration, and leave them: the lens is another one afterwards.";

/// Print tags, calibrate a camera with them, and measure the tool's pose by it
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct CameraCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    Target(target::TargetCommand),
    Calibrate(calibrate::CalibrateCommand),
    Watch(watch::WatchCommand),
}

impl CameraCommand {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        match &self.action {
            Action::Target(command) => command.run(ui),
            Action::Calibrate(command) => command.run(ui),
            Action::Watch(command) => command.run(ui),
        }
    }
}

/// A size of the target.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Paper {
    /// A4, for an arm on a desk
    #[value(name = "desk")]
    A4,
    /// A3, for an arm on a stand
    #[value(name = "arm")]
    A3,
}

impl From<Paper> for Size {
    fn from(paper: Paper) -> Self {
        match paper {
            Paper::A4 => Self::A4,
            Paper::A3 => Self::A3,
        }
    }
}

/// The target as it was printed.
#[derive(clap::Args, Debug)]
struct PrintedTarget {
    /// Size of the printed target
    #[arg(long, value_enum, default_value_t = Paper::A4)]
    size: Paper,
    /// Length of the ruler on the print, in mm
    #[arg(long = "ruler-mm", value_name = "MM", default_value_t = darm_camera::target::RULER_MM)]
    ruler_mm: f64,
}

impl PrintedTarget {
    fn target(&self) -> anyhow::Result<Target> {
        Ok(Target::new(self.size.into()).with_ruler(self.ruler_mm)?)
    }
}

/// Width and height of the frames of a pipe.
#[derive(Clone, Copy, Debug)]
struct FrameSize([usize; 2]);

impl FromStr for FrameSize {
    type Err = Usage;

    fn from_str(text: &str) -> Result<Self, Usage> {
        let sides = text.split_once('x').and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
        sides.map(Self).ok_or_else(|| Usage(format!("{text:?} is no size; give width and height, as 1280x720")))
    }
}
