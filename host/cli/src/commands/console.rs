//! `darm console`: type to the board.

use crate::console;
use crate::port::PortArgs;
use crate::voice::Voice;

const EXAMPLES: &str = "\
Examples:
  darm console                          the only serial port there is
  darm console -p unix:board.sock       a board in the emulator
  printf 'id\\nstatus\\n' | darm console  a script

The words are the board's own and work from any terminal program at 115200 baud; `help` lists them. \
Arrow keys bring back earlier lines, Tab completes. `quit` or Ctrl-D leaves; the board goes on. \
A script of which the board has refused a line ends with exit code 1. \
`stop` and Ctrl-C switch all coils off at once; Ctrl-C during a command ends the console as well.";

/// Type to the board: line editing, history, completion, help
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Console {
    #[command(flatten)]
    port: PortArgs,
}

impl Console {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        console::run(&self.port.name()?, voice)
    }
}
