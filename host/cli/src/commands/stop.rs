//! `darm stop`: all coils off, in any version of the protocol, whatever else holds the port.

use darm_core::sequencer::{Command, Phase};
use darm_device::client::stop::{Confirmation, stop_at};
use serde::Serialize;

use crate::failure::Unconfirmed;
use crate::port::PortArgs;
use crate::state_folder;
use crate::voice::{Answer, Voice};

const EXAMPLES: &str = "\
Examples:
  darm stop                     all coils off, at once; works with a firmware of any version
  darm stop --clear             and leave the safe state after its cause was mended

The stop is the first thing on the line and ends within 1 s in every case. Where another `darm` \
holds the port, that process sends the stop. A socket (unix:, tcp:) serves one connection: another \
program that holds it, and is not `darm`, keeps the stop out. Exit codes:
  0  the board confirmed that all coils are off
  4  the stop could not be sent: no such port, another program holds it exclusively, or it takes
     no bytes
  5  the board did not confirm the stop within 1 s: switch the supply off";

/// Switch all coils off at once; with --clear leave the safe state too
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Stop {
    /// Leave the safe state, after its cause was mended
    #[arg(long)]
    clear: bool,
    #[command(flatten)]
    port: PortArgs,
}

#[derive(Serialize)]
struct Stopped {
    stopped: bool,
    /// The fault that was latched, if `--clear` found one.
    cleared: Option<String>,
}

impl Answer for Stopped {
    fn text(&self) -> String {
        match &self.cleared {
            Some(fault) => format!("all coils are off; cleared: {fault}"),
            None => "all coils are off".to_owned(),
        }
    }
}

impl Stop {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let port = self.port.name()?;
        match stop_at(&port, state_folder::stop_socket(&port))? {
            Confirmation::Confirmed => {}
            Confirmation::Missing => return Err(Unconfirmed { port }.into()),
        }
        let cleared = if self.clear { self.clear()? } else { None };
        voice.tell(&Stopped { stopped: true, cleared })
    }

    /// Leaves the safe state; the fault that was latched.
    fn clear(&self) -> anyhow::Result<Option<String>> {
        let mut client = self.port.connect()?;
        let Phase::Safe(fault) = client.status()?.phase else { return Ok(None) };
        client.command(Command::Clear)?;
        Ok(Some(fault.to_string()))
    }
}
