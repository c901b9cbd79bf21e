//! `darm camera target`: the page with the calibration board and the tags of base and tool.

use std::path::PathBuf;

use darm_camera::drawing::svg;
use darm_camera::target::Target;
use serde::Serialize;

use super::Paper;
use crate::output_file::{Syntax, write_text};
use crate::overwrite::OutputFile;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm camera target -o target.svg               # A4, for an arm on a desk
  darm camera target --size arm -o target.svg    # A3, for an arm on a stand

Print it at 100 %, without fitting it to the page, and measure the ruler: it has 100 mm between its outer lines. Glue it onto \
something flat: glass, a tile, aluminium. Cut out the tags of base and tool along the dashed lines.";

/// Draw the page with the calibration board and the tags of base and tool
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct TargetCommand {
    /// Size of the target
    #[arg(long, value_enum, default_value_t = Paper::A4)]
    size: Paper,
    /// SVG file to write
    #[arg(short, long, value_name = "TARGET.svg")]
    output: OutputFile,
}

#[derive(Serialize)]
struct Page {
    output: PathBuf,
    board_tags: usize,
    board_m: [f64; 2],
    base_id: u16,
    base_m: f64,
    tool_id: u16,
    tool_m: f64,
}

impl Answer for Page {
    fn text(&self) -> String {
        let [width, height] = self.board_m.map(|m| 1e3 * m);
        format!(
            "{}: board of {} tags, {width:.0} x {height:.0} mm; base tag {} of {:.0} mm, tool tag {} of {:.0} mm\n\
             print at 100 % and measure the ruler",
            self.output.display(),
            self.board_tags,
            self.base_id,
            1e3 * self.base_m,
            self.tool_id,
            1e3 * self.tool_m,
        )
    }
}

impl TargetCommand {
    pub(super) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        write_text(&self.output, Syntax::Svg, &svg(self.size.into()))?;
        let target = Target::new(self.size.into());
        let (base, tool) = (target.base(), target.tool());
        ui.print(&Page {
            output: self.output.to_path_buf(),
            board_tags: target.board_tags(),
            board_m: target.board_size_m(),
            base_id: base.id,
            base_m: base.side_m,
            tool_id: tool.id,
            tool_m: tool.side_m,
        })
    }
}
