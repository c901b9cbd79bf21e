//! `darm stop`: all coils off, in any version of the protocol, even while another process holds the port.

use darm_core::sequencer::{Command, Phase};
use darm_device::client::stop::Confirmation;
use serde::Serialize;

use crate::failure::{ServosUncontrolled, Unconfirmed};
use crate::port::{self, PortArgs};
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm stop           # all coils off, at once; works with firmware of any version
  darm stop --clear   # also leave the safe state, after its cause was removed

The stop is sent before anything else, and the command ends within 1 s. If another `darm` holds the port, that process \
sends the stop. A socket (unix:, tcp:) serves one connection: a program other than `darm` that holds it blocks the stop; a `darm` that is \
suspended there is continued. \
Exit codes:
  0  the board confirmed that all coils are off, and has ordered its servos to hold
  4  the stop could not be sent: no such port, another program holds it exclusively, or it accepts no bytes
  5  the board did not confirm the stop within 1 s, or it is held after crashes and does not control its servos: switch off \
the supply";

/// Switch all coils off at once; with --clear also leave the safe state
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Stop {
    /// Leave the safe state, after its cause was removed
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
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let port = self.port.name()?;
        match port::stop(&port)? {
            Confirmation::Confirmed => {}
            Confirmation::OutputsAlone => return Err(ServosUncontrolled.into()),
            Confirmation::Missing => return Err(Unconfirmed { port }.into()),
        }
        let cleared = if self.clear { self.clear()? } else { None };
        ui.print(&Stopped { stopped: true, cleared })
    }

    /// Leaves the safe state; returns the fault that was latched.
    fn clear(&self) -> anyhow::Result<Option<String>> {
        let mut client = self.port.connect()?;
        let Phase::Safe(fault) = client.status()?.phase else { return Ok(None) };
        client.command(Command::Clear)?;
        Ok(Some(fault.to_string()))
    }
}
