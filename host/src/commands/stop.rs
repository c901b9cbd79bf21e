//! `darm stop`: all coils off, in any version of the protocol.

use darm_core::sequencer::{Command, Phase};
use serde::Serialize;

use crate::port::PortArgs;
use crate::voice::{Answer, Voice};

const EXAMPLES: &str = "\
Examples:
  darm stop                     all coils off, at once; works with a firmware of any version
  darm stop --clear             and leave the safe state after its cause was mended";

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
        let mut client = self.port.connect()?;
        client.stop_at_once()?;
        let mut cleared = None;
        if self.clear
            && let Phase::Safe(fault) = client.status()?.phase
        {
            client.command(Command::Clear)?;
            cleared = Some(fault.to_string());
        }
        voice.tell(&Stopped { stopped: true, cleared })
    }
}
