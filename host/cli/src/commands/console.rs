//! `darm console`: interactive console of the board.

use crate::console;
use crate::port::PortArgs;
use crate::ui::Ui;

const EXAMPLES: &str = "\
Examples:
  darm console                                                 # the only board there is
  darm console -p unix:$HOME/.local/state/darm/board/port      # the board at this port
  printf 'id\\nstatus\\n' | darm console                         # a script

The commands are the board's own and work from any terminal program at 115200 baud; `help` lists them, `help COMMAND` explains one \
with the values that are allowed now. The line above the prompt shows what the board does; Tab completes commands and values, arrow keys recall \
earlier lines. `quit` or Ctrl-D leaves the console; the board continues. `stop` and Ctrl-C switch all coils off at once; Ctrl-C \
during a command also ends the console.

Exit codes of a script: 3 if the board refused a line, 4 if it did not answer one, 1 or 2 if another line failed.";

/// Open the board's console: status, line editing, history, completion, help
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
