//! `darm play`: starts the board's table and follows its events; the board runs it on its own clock.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use darm_core::sequencer::{Event, Fault, Phase};
use darm_core::wire::message::Refusal;
use darm_device::client::{Client, ClientError, TimedEvent};
use serde::{Serialize, Serializer};

use super::status::seconds;
use crate::failure::{SafeState, Unfinished};
use crate::guests::Role;
use crate::interrupt::InterruptHandler;
use crate::port::PortArgs;
use crate::ui::{Answer, Ui};
use crate::{interrupt, port};
use darm_arm::table_file::TableFile;

const EXAMPLES: &str = "\
Examples:
  darm play               # run the stored table and follow it to its end
  darm play visits.darm   # only if the board has exactly this table
  darm play --wait        # when the outputs have rested long enough
  darm play --detach      # start it and return immediately

The board runs the rows on its own clock: the program continues with the cable unplugged, or after --detach. Ctrl-C stops \
the arm: exit code 6 if the board confirmed the stop, 5 if not, 4 if the stop could not be sent. Exit code 7: another \
program stopped the arm before the end of its program.";

/// Interval between two requests.
const POLL: Duration = Duration::from_millis(50);

/// Interval between two attempts to start.
const RETRY: Duration = Duration::from_millis(500);
/// Added to the time that the board has requested.
const MARGIN: Duration = Duration::from_secs(5);

/// Row 0 is applied in the tick of the start or the next one.
const TICK_S: f64 = 2e-3;

/// Run the stored table and follow it to its end
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Play {
    /// Table that the board must have; default: any
    #[arg(value_name = "TABLE.darm")]
    table: Option<PathBuf>,
    /// Wait until the limits of outputs that have been on allow the program, instead of failing
    #[arg(long)]
    wait: bool,
    /// Return as soon as the program runs
    #[arg(long)]
    detach: bool,
    #[command(flatten)]
    port: PortArgs,
}

/// How far the command followed the program.
#[derive(Clone, Copy)]
enum PlayedEnd {
    /// It left it running.
    Started,
    /// To its end.
    Ended(End),
}

impl Serialize for PlayedEnd {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(match self {
            Self::Started => "started",
            Self::Ended(end) => end.name(),
        })
    }
}

/// Result of a run.
#[derive(Serialize)]
struct Played {
    end: PlayedEnd,
    rows: u16,
    rows_played: u16,
    took_s: Option<f64>,
    fault: Option<String>,
}

impl Answer for Played {
    fn text(&self) -> String {
        let took = self.took_s.map_or(String::new(), |took_s| format!(" in {took_s:.3} s of the board's clock"));
        match self.end {
            PlayedEnd::Started => format!(
                "the program of {} rows is running; `darm status` shows its state, `darm stop` ends it",
                self.rows
            ),
            PlayedEnd::Ended(end) => format!("{}: {} of {} rows{took}", end.name(), self.rows_played, self.rows),
        }
    }
}

impl Play {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let table = self.table.as_deref().map(TableFile::read).transpose()?;
        let port = self.port.name()?;
        let (mut client, handle) = port::connect(&port, Role::Controls)?;
        let rows = client.status()?.rows;
        let hello = client.say_hello()?;
        if let Some(table) = table {
            table.check_loaded(hello.table)?;
        }
        let first_event = hello.next_event;
        let interrupt = interrupt::InterruptHandler::start(&port, handle)?;
        self.start(&mut client, &interrupt, ui)?;
        if self.detach {
            return ui.print(&Played { end: PlayedEnd::Started, rows, rows_played: 0, took_s: None, fault: None });
        }
        let bar = ui.progress_bar("playing", u64::from(rows), "rows");
        let mut monitor = ProgramMonitor::new(first_event);
        let followed = monitor.until_the_end(&mut client, &interrupt, |row| bar.set_position(u64::from(row) + 1));
        bar.finish_and_clear();
        let interrupted = interrupt.interrupted();
        if interrupted.is_none() {
            followed?;
        }
        let reported = monitor.report(ui, rows);
        interrupted.map_or(reported, |interrupted| Err(interrupted.into()))
    }
}

impl Play {
    /// Starts the program; with --wait again and again while the board refuses it for outputs that have been on. The board
    /// keeps their on-times over resets and alone decides.
    fn start(&self, client: &mut Client, interrupt: &InterruptHandler, ui: Ui) -> anyhow::Result<()> {
        let mut deadline = None;
        loop {
            let refused = match interrupt.play(client) {
                Err(error) => error,
                Ok(()) => return Ok(()),
            };
            let Some(wait) = recovery(&refused) else { return Err(refused) };
            if !self.wait {
                ui.note("`darm play --wait` waits that long and plays");
                return Err(refused);
            }
            if deadline.is_none() {
                ui.note(&format!("outputs have been on: waiting for at most {} s", wait.as_secs_f64().ceil()));
            }
            if Instant::now() > *deadline.get_or_insert(Instant::now() + wait + MARGIN) {
                return Err(refused);
            }
            std::thread::sleep(wait.min(RETRY));
        }
    }
}

/// How long the board says that an output has to rest; `None` of any other error.
fn recovery(error: &anyhow::Error) -> Option<Duration> {
    match error.downcast_ref::<ClientError>()? {
        ClientError::Refused(Refusal::Recovering { wait_ms, .. }) => Some(Duration::from_millis((*wait_ms).into())),
        _ => None,
    }
}

/// How a program ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    /// After its last row.
    Finished,
    /// By a stop.
    Stopped,
    /// By a fault.
    Fault(Fault),
}

impl End {
    /// Name in JSON.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::Stopped => "stopped",
            Self::Fault(_) => "fault",
        }
    }
}

/// Follows the events of one program.
pub(crate) struct ProgramMonitor {
    next_event: u32,
    /// Earlier events belong to other programs, in seconds of the board.
    since_s: f64,
    started_s: Option<f64>,
    /// The last event, in seconds of the board.
    pub(crate) ended_s: Option<f64>,
    rows_played: u16,
    /// How it ended, once it has.
    pub(crate) end: Option<End>,
}

impl ProgramMonitor {
    /// Follows the program from this event on.
    pub(crate) fn new(next_event: u32) -> Self {
        Self { next_event, since_s: 0.0, started_s: None, ended_s: None, rows_played: 0, end: None }
    }

    /// Follows a program whose row 0 was applied at this time of the board, in seconds.
    pub(crate) fn resume(since_s: f64) -> Self {
        Self { since_s, started_s: Some(since_s), ..Self::new(0) }
    }

    /// Polls until the program has ended or the user has interrupted it.
    fn until_the_end(
        &mut self,
        client: &mut Client,
        interrupt: &interrupt::InterruptHandler,
        mut on_row: impl FnMut(u16),
    ) -> anyhow::Result<()> {
        while self.end.is_none() && interrupt.interrupted().is_none() {
            std::thread::sleep(POLL);
            for timed in self.poll(client)? {
                if let Event::Row { row, .. } = timed.event {
                    on_row(row);
                }
            }
        }
        Ok(())
    }

    /// Requests the events since the last poll.
    pub(crate) fn poll(&mut self, client: &mut Client) -> anyhow::Result<Vec<TimedEvent>> {
        // The phase is requested first: an end between the two requests is then in the events.
        let phase = client.status()?.phase;
        let mut seen = Vec::new();
        loop {
            let new = client.events(self.next_event)?;
            let Some(last) = new.last() else { break };
            self.next_event = last.number + 1;
            new.iter().for_each(|timed| self.take(timed));
            seen.extend(new);
        }
        if self.end.is_none() && !matches!(phase, Phase::Playing { .. } | Phase::Approaching { .. }) {
            self.end = Some(match phase {
                Phase::Safe(fault) => End::Fault(fault),
                _ => End::Stopped,
            });
        }
        Ok(seen)
    }

    fn take(&mut self, timed: &TimedEvent) {
        let earlier = seconds(timed.at) < self.since_s;
        // The board ends a phase by hand with `Stopped` before it starts the program.
        let by_hand = self.started_s.is_none() && timed.event == Event::Stopped;
        if self.end.is_some() || earlier || by_hand {
            return;
        }
        match timed.event {
            Event::Started if self.started_s.is_some_and(|own_s| seconds(timed.at) > own_s + TICK_S) => {
                self.end = Some(End::Stopped);
            }
            Event::Started => self.started_s = Some(seconds(timed.at)),
            Event::Row { row, .. } => self.rows_played = row + 1,
            Event::Finished => self.end = Some(End::Finished),
            Event::Stopped | Event::Booted => self.end = Some(End::Stopped),
            Event::Fault(fault) => self.end = Some(End::Fault(fault)),
            Event::Cleared => {}
        }
        self.ended_s = Some(seconds(timed.at));
    }

    /// Prints the result; a fault or an early stop is also an error.
    fn report(&self, ui: Ui, rows: u16) -> anyhow::Result<()> {
        let fault = match self.end {
            Some(End::Fault(fault)) => Some(fault),
            Some(End::Finished | End::Stopped) | None => None,
        };
        ui.print(&Played {
            end: PlayedEnd::Ended(self.end.unwrap_or(End::Stopped)),
            rows,
            rows_played: self.rows_played,
            took_s: self.started_s.zip(self.ended_s).map(|(from_s, to_s)| to_s - from_s),
            fault: fault.map(|fault| fault.to_string()),
        })?;
        match self.end {
            Some(End::Finished) => Ok(()),
            Some(End::Fault(fault)) => Err(SafeState(fault.to_string()).into()),
            Some(End::Stopped) | None => {
                Err(Unfinished::Stopped { done: self.rows_played.into(), all: rows.into(), what: "rows played" }.into())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use darm_core::sequencer::Event;
    use darm_core::units::Micros;
    use darm_device::client::TimedEvent;

    use super::{End, ProgramMonitor};

    fn followed(events: &[Event]) -> ProgramMonitor {
        let mut monitor = ProgramMonitor::new(0);
        for (number, event) in (0..).zip(events) {
            monitor.take(&TimedEvent { number, at: Micros::from_millis(10 * number), event: *event });
        }
        monitor
    }

    #[test]
    fn a_stop_before_the_start_ends_the_phase_by_hand_and_one_after_it_ends_the_program() {
        assert_eq!(followed(&[Event::Stopped, Event::Started]).end, None);
        assert_eq!(followed(&[Event::Stopped, Event::Started, Event::Finished]).end, Some(End::Finished));
        assert_eq!(followed(&[Event::Started, Event::Stopped]).end, Some(End::Stopped));
    }
}
