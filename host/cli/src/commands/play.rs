//! `darm play`: the board runs its table on its own clock; this only watches.

use std::path::PathBuf;
use std::time::Duration;

use darm_core::sequencer::{Event, Fault, Phase};
use darm_device::client::{Client, Happening};
use serde::Serialize;

use super::status::seconds;
use super::table_file::TableFile;
use crate::failure::{Safe, Unfinished};
use crate::port::PortArgs;
use crate::voice::{Answer, Voice};
use crate::{interrupt, port};

const EXAMPLES: &str = "\
Examples:
  darm play                     run the stored table and watch it to its end
  darm play visits.darm         the same, if the board holds just this table
  darm play --detach            start it and come back at once

The board runs the rows on its own clock: with a pulled cable, or after --detach, the program goes on. \
Ctrl-C stops the arm: exit code 6 when the board has confirmed it, 5 when it has not, 4 when the stop \
could not be sent. Exit code 7: another program stopped the arm before the end of its program.";

/// Time between two questions.
const POLL: Duration = Duration::from_millis(50);

/// Row 0 goes out in the tick of the start or the one after it.
const TICK_S: f64 = 2e-3;

/// Run the stored table, and watch it to its end
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Play {
    /// Table that the board has to hold; without it any
    #[arg(value_name = "TABLE.darm")]
    table: Option<PathBuf>,
    /// Come back as soon as the program runs
    #[arg(long)]
    detach: bool,
    #[command(flatten)]
    port: PortArgs,
}

/// How it went.
#[derive(Serialize)]
struct Played {
    end: &'static str,
    rows: u16,
    rows_played: u16,
    took_s: Option<f64>,
    fault: Option<String>,
}

impl Answer for Played {
    fn text(&self) -> String {
        let took = self.took_s.map_or(String::new(), |took_s| format!(" in {took_s:.3} s of the board's clock"));
        match self.end {
            "started" => format!("the program of {} rows runs; `darm status` watches, `darm stop` ends it", self.rows),
            end => format!("{end}: {} of {} rows{took}", self.rows_played, self.rows),
        }
    }
}

impl Play {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let table = self.table.as_deref().map(TableFile::read).transpose()?;
        let port = self.port.name()?;
        let (link, handle) = port::open(&port)?;
        let mut client = Client::connect(link)?;
        let rows = client.status()?.rows;
        let hello = client.say_hello()?;
        if let Some(table) = table {
            table.check_loaded(hello.table)?;
        }
        let first_event = hello.next_event;
        let interrupt = interrupt::Watch::start(&port, handle)?;
        interrupt.play(&mut client)?;
        if self.detach {
            return voice.tell(&Played { end: "started", rows, rows_played: 0, took_s: None, fault: None });
        }
        let bar = voice.bar("playing", u64::from(rows), "rows");
        let mut watch = Watch::new(first_event);
        let watched = watch.until_the_end(&mut client, &interrupt, |row| bar.set_position(u64::from(row) + 1));
        bar.finish_and_clear();
        let interrupted = interrupt.interrupted();
        if interrupted.is_none() {
            watched?;
        }
        let told = watch.tell(voice, rows);
        interrupted.map_or(told, |interrupted| Err(interrupted.into()))
    }
}

/// Why a program is not running any more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    /// It came to its end.
    Finished,
    /// Somebody stopped it.
    Stopped,
    /// A fault stopped it.
    Fault(Fault),
}

impl End {
    /// One word for it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::Stopped => "stopped",
            Self::Fault(_) => "fault",
        }
    }
}

/// Follows the events of one program.
pub(crate) struct Watch {
    next_event: u32,
    /// Earlier events are of other programs, in seconds of the board.
    since_s: f64,
    started_s: Option<f64>,
    /// The last event, in seconds of the board.
    pub(crate) ended_s: Option<f64>,
    rows_played: u16,
    /// How it ended, once it has.
    pub(crate) end: Option<End>,
}

impl Watch {
    /// Follows from this event on.
    pub(crate) fn new(next_event: u32) -> Self {
        Self { next_event, since_s: 0.0, started_s: None, ended_s: None, rows_played: 0, end: None }
    }

    /// Follows a program whose row 0 went out at this time of the board, in seconds.
    pub(crate) fn resume(since_s: f64) -> Self {
        Self { since_s, started_s: Some(since_s), ..Self::new(0) }
    }

    /// Looks until the program has ended or the user has interrupted it.
    fn until_the_end(
        &mut self,
        client: &mut Client,
        interrupt: &interrupt::Watch,
        mut on_row: impl FnMut(u16),
    ) -> anyhow::Result<()> {
        while self.end.is_none() && interrupt.interrupted().is_none() {
            std::thread::sleep(POLL);
            for happening in self.look(client)? {
                if let Event::Row { row, .. } = happening.event {
                    on_row(row);
                }
            }
        }
        Ok(())
    }

    /// Asks for what happened since the last look.
    pub(crate) fn look(&mut self, client: &mut Client) -> anyhow::Result<Vec<Happening>> {
        // The phase comes first: what ends between the two questions is then in the events.
        let phase = client.status()?.phase;
        let mut seen = Vec::new();
        loop {
            let new = client.events(self.next_event)?;
            let Some(last) = new.last() else { break };
            self.next_event = last.number + 1;
            new.iter().for_each(|happening| self.take(happening));
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

    fn take(&mut self, happening: &Happening) {
        let earlier = seconds(happening.at) < self.since_s;
        // The board ends a phase by hand with `Stopped` before it starts the program.
        let by_hand = self.started_s.is_none() && happening.event == Event::Stopped;
        if self.end.is_some() || earlier || by_hand {
            return;
        }
        match happening.event {
            Event::Started if self.started_s.is_some_and(|own_s| seconds(happening.at) > own_s + TICK_S) => {
                self.end = Some(End::Stopped);
            }
            Event::Started => self.started_s = Some(seconds(happening.at)),
            Event::Row { row, .. } => self.rows_played = row + 1,
            Event::Finished => self.end = Some(End::Finished),
            Event::Stopped | Event::Booted => self.end = Some(End::Stopped),
            Event::Fault(fault) => self.end = Some(End::Fault(fault)),
            Event::Cleared => {}
        }
        self.ended_s = Some(seconds(happening.at));
    }

    /// Says how it went; a fault or an early stop is an error too.
    fn tell(&self, voice: Voice, rows: u16) -> anyhow::Result<()> {
        let fault = match self.end {
            Some(End::Fault(fault)) => Some(fault),
            Some(End::Finished | End::Stopped) | None => None,
        };
        voice.tell(&Played {
            end: self.end.map_or("stopped", End::name),
            rows,
            rows_played: self.rows_played,
            took_s: self.started_s.zip(self.ended_s).map(|(from_s, to_s)| to_s - from_s),
            fault: fault.map(|fault| fault.to_string()),
        })?;
        match self.end {
            Some(End::Finished) => Ok(()),
            Some(End::Fault(fault)) => Err(Safe(fault.to_string()).into()),
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
    use darm_device::client::Happening;

    use super::{End, Watch};

    fn watched(events: &[Event]) -> Watch {
        let mut watch = Watch::new(0);
        for (number, event) in (0..).zip(events) {
            watch.take(&Happening { number, at: Micros::from_millis(10 * number), event: *event });
        }
        watch
    }

    #[test]
    fn a_stop_before_the_start_ends_the_phase_by_hand_and_one_after_it_ends_the_program() {
        assert_eq!(watched(&[Event::Stopped, Event::Started]).end, None);
        assert_eq!(watched(&[Event::Stopped, Event::Started, Event::Finished]).end, Some(End::Finished));
        assert_eq!(watched(&[Event::Started, Event::Stopped]).end, Some(End::Stopped));
    }
}
