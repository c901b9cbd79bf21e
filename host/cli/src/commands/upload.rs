//! `darm upload`: brings a table to the board, whole or not at all.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::table_file::TableFile;
use crate::port::PortArgs;
use crate::voice::{Answer, Voice};

const EXAMPLES: &str = "\
Examples:
  darm upload visits.darm                       the only serial port there is
  darm upload visits.darm -p /dev/ttyACM0       this one
  darm upload visits.darm -p unix:board.sock    a board in the emulator

An upload that breaks off goes on where it stopped when the command is given again. \
Until the last byte is stored and checked the board keeps its old table.";

/// Bring a table to the board; the board stores it whole or keeps the old one
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Upload {
    /// Table made by `darm table`
    #[arg(value_name = "TABLE.darm")]
    table: PathBuf,
    #[command(flatten)]
    port: PortArgs,
}

/// What was brought where.
#[derive(Serialize)]
struct Uploaded {
    board: String,
    device: String,
    model: String,
    /// Digest of the table, as the board and the recordings name it.
    table: String,
    rows: u16,
    bytes: u32,
    program_s: f64,
    took_s: f64,
}

impl Answer for Uploaded {
    fn text(&self) -> String {
        format!(
            "table {} with {} rows for model {} stored on {} {} ({} bytes in {:.1} s); the program lasts {:.1} s, start it with \
             `darm play`",
            self.table.get(..16).unwrap_or(&self.table),
            self.rows,
            self.model,
            self.board,
            self.device,
            self.bytes,
            self.took_s,
            self.program_s
        )
    }
}

impl Upload {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let file = TableFile::read(&self.table)?;
        let mut client = self.port.connect()?;
        file.check_device(client.identity().device)?;
        if let Some(hello) = client.hello() {
            file.check_profile(hello.profile)?;
        }
        let image = file.image.image();
        let bar = voice.bar("uploading", u64::from(image.len), "bytes");
        let start = Instant::now();
        let rows = client.upload(&file.image, &mut |progress| bar.set_position(u64::from(progress.done)))?;
        bar.finish_and_clear();
        voice.tell(&Uploaded {
            board: client.identity().board.to_string(),
            device: client.identity().device.to_string(),
            model: image.model.to_string(),
            table: image.digest.to_string(),
            rows,
            bytes: image.len,
            program_s: file.end().0 as f64 * 1e-6,
            took_s: start.elapsed().as_secs_f64(),
        })
    }
}
