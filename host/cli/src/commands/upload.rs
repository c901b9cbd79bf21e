//! `darm upload`: stores a table on the board, completely or not at all.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use crate::failure::Occupied;
use crate::port::PortArgs;
use crate::ui::{Answer, Ui};
use darm_arm::table_file::TableFile;

const EXAMPLES: &str = "\
Examples:
  darm upload two.darm      # the only board there is
  darm upload visits.darm -p unix:$HOME/.local/state/darm/board/port   # the board at this port

An interrupted upload continues where it stopped when the command is repeated. The board keeps its old table until the \
last byte is stored and checked.";

/// Upload a table; the board stores it completely or keeps the old one
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Upload {
    /// Table from `darm table`
    #[arg(value_name = "TABLE.darm")]
    table: PathBuf,
    #[command(flatten)]
    port: PortArgs,
}

/// Result of an upload.
#[derive(Serialize)]
struct Uploaded {
    board: String,
    device: String,
    model: String,
    /// Digest of the table, as in the board's status and in recordings.
    table: String,
    rows: u16,
    bytes: u32,
    end_s: f64,
    took_s: f64,
}

impl Answer for Uploaded {
    fn text(&self) -> String {
        format!(
            "table {} with {} rows for model {} stored on {} {} ({} bytes in {:.1} s); the program takes {:.1} s, start it with \
             `darm play`",
            self.table.get(..16).unwrap_or(&self.table),
            self.rows,
            self.model,
            self.board,
            self.device,
            self.bytes,
            self.took_s,
            self.end_s
        )
    }
}

impl Upload {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let file = TableFile::read(&self.table)?;
        let mut client = self.port.connect()?;
        file.check_device(client.identity().device)?;
        if let Some(hello) = client.hello() {
            file.check_profile(hello.profile)?;
        }
        let image = file.image.image();
        let bar = ui.progress_bar("uploading", u64::from(image.len), "bytes");
        let start = Instant::now();
        let uploaded = client.upload(&file.image, &mut |progress| bar.set_position(u64::from(progress.done)));
        let rows = uploaded.map_err(|error| Occupied::explain(&mut client, error))?;
        bar.finish_and_clear();
        ui.print(&Uploaded {
            board: client.identity().board.to_string(),
            device: client.identity().device.to_string(),
            model: image.model.to_string(),
            table: image.digest.to_string(),
            rows,
            bytes: image.len,
            end_s: file.end().0 as f64 * 1e-6,
            took_s: start.elapsed().as_secs_f64(),
        })
    }
}
