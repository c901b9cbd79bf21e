//! `darm console`: interactive console of the board.

use crate::console;
use crate::port::PortArgs;
use crate::ui::Ui;

const EXAMPLES: &str = "\
Examples:
  darm console                                                 # the only board there is
  darm console -p unix:$HOME/.local/state/darm/board/port      # the board at this port
  printf 'id\\nstatus\\n' | darm console                       # a script

The commands are the board's own and work from any terminal program at 115200 baud; `help` lists them. Arrow keys recall \
earlier lines, Tab completes. `quit` or Ctrl-D leaves the console; the board continues. The exit code is 1 if the board \
refused a line of a script. `stop` and Ctrl-C switch all coils off at once; Ctrl-C during a command also ends the console.";

/// Open the board's console: line editing, history, completion, help
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Console {
    #[command(flatten)]
    port: PortArgs,
}

impl Console {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        console::run(&self.port.name()?, ui)
    }
}
