//! `darm status`: board, loaded table, state and last fault.

use std::io::IsTerminal as _;
use std::time::Duration;

use darm_core::sequencer::{Event, Fault, Phase, ServoSeen};
use darm_core::units::{Digest, Micros};
use darm_core::wire::bootstrap::{CrashKind, CrashRecord};
use darm_core::wire::health::{ChipOptions, FlashErrors, Health};
use darm_core::wire::message::{self, OutputState, Refusal};
use darm_device::client::{Client, ClientError};
use serde::Serialize;

use crate::failure::SafeState;
use crate::guests::Role;
use crate::port::{self, PortArgs};
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm status          # exit code 3 if the board is in its safe state
  darm --json status   # for programs
  darm status --history   # also crashes and events of earlier starts

--watch holds the port: `darm stop` still gets through, other commands do not.";

/// The board rounds times to milliseconds.
const ROUNDING_MS: u64 = 1;

/// Show board, loaded table, state and last fault
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Status {
    #[command(flatten)]
    port: PortArgs,
    /// Add crashes and events of earlier starts that the board has kept
    #[arg(long)]
    history: bool,
    /// Print it again and again until Ctrl-C, by default each second; with --json a line each time
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, default_missing_value = "1", value_parser = interval)]
    watch: Option<f64>,
}

/// Seconds between two requests.
fn interval(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.1..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("give 0.1 to 3600 s".into()),
    }
}

/// What the board has kept of earlier starts.
#[derive(Serialize)]
struct History {
    /// The last one first.
    crashes: Vec<String>,
    /// The newest first.
    events: Vec<PastEvent>,
}

#[derive(Serialize)]
struct PastEvent {
    /// Time since its start.
    at_s: f64,
    text: String,
}

#[derive(Serialize)]
struct Report {
    port: String,
    board: String,
    device: String,
    firmware: String,
    phase: &'static str,
    fault: Option<FaultReport>,
    row: Option<u16>,
    word: String,
    rows: u16,
    model: Option<String>,
    /// Digest of the table.
    table: Option<String>,
    /// Digest of the board profile; `None` without one.
    profile: Option<String>,
    profile_state: ProfileState,
    /// Outputs that have used part of their limits.
    recovering: Vec<Recovering>,
    switches_closed: Vec<u8>,
    servos: Vec<ServoReport>,
    boots: u32,
    bad_frames: u32,
    worst_lateness_s: f64,
    /// What the board reports of itself; `None` from firmware that does not.
    health: Option<Health>,
    crash: Option<String>,
    /// With `--history`.
    history: Option<History>,
    up_s: Option<f64>,
}

#[derive(Serialize)]
pub(super) struct Recovering {
    output: u8,
    /// Remaining on-time in the present window.
    left_s: f64,
    /// Time without current until the full window is available.
    recovery_s: f64,
}

#[derive(Serialize)]
struct FaultReport {
    text: String,
    at_s: f64,
    row: Option<u16>,
}

#[derive(Serialize)]
struct ServoReport {
    angle_rad: f32,
    /// Share of the largest load.
    load: f32,
    error_bits: u8,
    answered_s: Option<f64>,
}

impl Status {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let Some(interval_s) = self.watch else { return self.show(&mut self.port.connect()?, ui) };
        let mut client = port::connect(&self.port.name()?, Role::Watches)?.0;
        loop {
            if !ui.json && std::io::stdout().is_terminal() {
                // The screen is cleared, the cursor goes to its begin.
                print!("\x1b[2J\x1b[H");
            }
            // Another command may bring another table.
            let shown = client.renew_hello().map_err(Into::into).and_then(|()| self.show(&mut client, ui));
            match shown {
                Err(error) if is_not_connected(&error) => drop(client.join()?),
                Err(error) if !error.is::<SafeState>() => return Err(error),
                // A safe state is shown, and may be cleared meanwhile.
                Ok(()) | Err(_) => std::thread::sleep(Duration::from_secs_f64(interval_s)),
            }
        }
    }

    fn show(&self, client: &mut Client, ui: Ui) -> anyhow::Result<()> {
        let status = client.status()?;
        let outputs = client.outputs()?;
        let health = client.health()?;
        let crash = client.last_crash()?.as_ref().map(crash_text);
        let history = if self.history { Some(History::of(client)?) } else { None };
        ui.print(&Report { health, history, ..report(client, &status, &outputs, crash) })?;
        match status.phase {
            Phase::Safe(fault) => Err(SafeState(fault.to_string()).into()),
            _ => Ok(()),
        }
    }
}

/// Whether a stop has ended the connection.
fn is_not_connected(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(ClientError::Refused(Refusal::NotConnected)))
}

fn report(client: &Client, status: &message::Status, outputs: &[OutputState], crash: Option<String>) -> Report {
    let [major, minor, patch] = client.version().firmware;
    let (phase, row, fault) = phase(&status.phase);
    Report {
        port: client.port().to_owned(),
        board: client.identity().board.to_string(),
        device: client.identity().device.to_string(),
        firmware: format!("{major}.{minor}.{patch}"),
        phase,
        fault,
        row,
        word: status.word.to_string(),
        rows: status.rows,
        model: status.model.map(|model| model.to_string()),
        table: client.hello().and_then(|hello| hello.table).map(|table| table.to_string()),
        profile: profile(client).map(|profile| profile.to_string()),
        profile_state: ProfileState::of(client, outputs),
        recovering: recovering(outputs),
        switches_closed: (0..32).filter(|input| status.switches >> input & 1 == 1).collect(),
        servos: status.servos.iter().map(servo).collect(),
        boots: client.hello().map_or(0, |hello| hello.boots),
        bad_frames: status.bad_frames,
        worst_lateness_s: 1e-6 * f64::from(status.worst_lateness_us),
        health: None,
        history: None,
        crash,
        up_s: client.clock().offset().map(|offset| client.now_s() - offset.at_s),
    }
}

/// The profile that is in force; `None` without one.
pub(super) fn profile(client: &Client) -> Option<Digest> {
    client.hello().map(|hello| hello.profile).filter(|profile| *profile != Digest::default())
}

/// Which limits a board has in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ProfileState {
    /// Those of the profile that was written to it.
    Written,
    /// Those that are built in: it has never had a profile.
    BuiltIn,
    /// None, so that it drives nothing: its profile is lost, or cannot be used.
    Lost,
}

impl ProfileState {
    /// As the board, and these of its outputs, say. The built-in profile has outputs; a board without limits has none.
    pub(super) fn of(client: &Client, outputs: &[OutputState]) -> Self {
        match profile(client) {
            Some(_) => Self::Written,
            None if outputs.is_empty() => Self::Lost,
            None => Self::BuiltIn,
        }
    }
}

/// What to say of a board without limits.
pub(super) const LOST: &str =
    "LOST or unusable: nothing is driven until it is written again with `darm profile write`, holding the button";

/// The outputs whose remaining on-time is reduced because they were on recently.
pub(super) fn recovering(outputs: &[OutputState]) -> Vec<Recovering> {
    let seconds = |ms: u32| f64::from(ms) * 1e-3;
    let used = |output: &&OutputState| {
        let allowed_ms = u64::from(output.limit.window_ms) * u64::from(output.limit.duty_percent) / 100;
        output.recovery_ms > 0 && u64::from(output.left_ms) + ROUNDING_MS < allowed_ms
    };
    let busy = outputs.iter().filter(used);
    let report = |output: &OutputState| Recovering {
        output: output.output,
        left_s: seconds(output.left_ms.min(output.limit.max_on_ms)),
        recovery_s: seconds(output.recovery_ms),
    };
    busy.map(report).collect()
}

/// The recovering outputs in a sentence.
pub(super) fn recovery(recovering: &[Recovering]) -> String {
    if recovering.is_empty() {
        return "all recovered".to_owned();
    }
    let numbers: Vec<String> = recovering.iter().map(|output| output.output.to_string()).collect();
    let longest_s = recovering.iter().map(|output| output.recovery_s).fold(0.0, f64::max);
    format!("{} recovering, all recovered after {longest_s:.1} s without current", numbers.join(" "))
}

/// The first digits of a digest, as the board prints it.
fn short(digest: &str) -> &str {
    digest.get(..16).unwrap_or(digest)
}

fn phase(phase: &Phase) -> (&'static str, Option<u16>, Option<FaultReport>) {
    match phase {
        Phase::Idle => ("idle", None, None),
        Phase::Manual => ("manual", None, None),
        Phase::Approaching { .. } => ("approaching", None, None),
        Phase::Playing { next, .. } => ("playing", Some(*next), None),
        Phase::Safe(fault) => ("safe", fault.row, Some(fault_report(fault))),
    }
}

fn fault_report(fault: &Fault) -> FaultReport {
    FaultReport { text: fault.kind.to_string(), at_s: seconds(fault.at), row: fault.row }
}

fn servo(seen: &ServoSeen) -> ServoReport {
    ServoReport {
        angle_rad: seen.angle_rad,
        load: seen.load,
        error_bits: seen.error,
        answered_s: seen.answered.map(seconds),
    }
}

pub(crate) fn seconds(at: Micros) -> f64 {
    at.0 as f64 * 1e-6
}

fn crash_text(crash: &CrashRecord) -> String {
    let kind = match crash.kind {
        CrashKind::Panic => "panic",
        CrashKind::HardFault => "hard fault",
        CrashKind::Watchdog => "watchdog",
    };
    let place = if crash.pc == 0 { String::new() } else { format!(", pc {:#010x}", crash.pc) };
    format!("{kind} {:.3} s after the start{place}: {}", crash.uptime_us as f64 * 1e-6, crash.text)
}

impl History {
    fn of(client: &mut Client) -> anyhow::Result<Self> {
        let event = |(at, event): (Micros, Event)| PastEvent { at_s: seconds(at), text: event.to_string() };
        Ok(Self {
            crashes: client.past_crashes()?.iter().map(crash_text).collect(),
            events: client.past_events()?.into_iter().map(event).collect(),
        })
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec!["history   earlier starts, the newest first".to_owned()];
        lines.extend(self.crashes.iter().map(|crash| format!("  crash   {crash}")));
        lines.extend(self.events.iter().map(|event| format!("  {:11.3} s  {}", event.at_s, event.text)));
        if lines.len() == 1 {
            lines.push("  nothing is kept".to_owned());
        }
        lines
    }
}

/// What a person should know of the board itself: a line for each thing that is known.
fn health_lines(health: &Health) -> Vec<String> {
    let mut lines = Vec::new();
    lines.extend(health.clock.map(|clock| format!("clock     {clock}")));
    lines.extend(health.reset.map(|cause| format!("reset     by {cause}")));
    lines.push(format!("console   {}", measured(health.console, |errors| errors.to_string())));
    let bus = measured(health.servo_bus, |errors| errors.to_string());
    lines.push(format!("servo bus {bus}, {} visits without an answer", health.servos_unanswered));
    let flash = |FlashErrors { corrected, damaged }| {
        format!("{corrected} words corrected, {damaged} damaged words in the data")
    };
    lines.push(format!("flash     {}", measured(health.flash, flash)));
    lines.extend(
        health.chain.map(|chain| format!("chain     {} chips, {} errors at its far end", chain.chips, chain.errors)),
    );
    lines.extend(health.options.as_ref().map(options_line));
    lines.extend(
        health.load_permille.map(|load| format!("load      {:.1} % of the last second", 0.1 * f64::from(load))),
    );
    lines.extend(health.stack.map(|stack| format!("stack     {} of {} bytes were in use", stack.used, stack.size)));
    lines.extend(supply_line(health));
    lines.extend(health.chip_celsius.map(|celsius| format!("chip      {celsius} °C")));
    lines
}

/// The supply of the board, and the profile's threshold.
fn supply_line(health: &Health) -> Option<String> {
    let volts = |mv: u16| format!("{:.2} V", 1e-3 * f64::from(mv));
    match (health.supply_mv.map(volts), health.min_supply_mv.map(volts)) {
        (Some(supply), Some(min)) => Some(format!("supply    {supply}, at least {min} by the profile")),
        (Some(supply), None) => Some(format!("supply    {supply}")),
        (None, Some(min)) => Some(format!("supply    not measured, at least {min} by the profile")),
        (None, None) => None,
    }
}

/// What a board counts; not every board counts everything.
fn measured<T>(errors: Option<T>, text: impl Fn(T) -> String) -> String {
    errors.map_or_else(|| "errors not measured".to_owned(), text)
}

fn options_line(options: &ChipOptions) -> String {
    format!(
        "options   brown-out at {:.1} V, debugger {}, on-times {} a reset",
        f64::from(options.brown_out_mv) * 1e-3,
        if options.debugger_allowed { "allowed" } else { "locked out" },
        if options.keeps_on_times { "survive" } else { "are lost at" }
    )
}

impl Report {
    fn state(&self) -> String {
        match (self.phase, &self.fault, self.row) {
            (_, Some(fault), Some(row)) => format!("SAFE: {} at {:.3} s, row {row}", fault.text, fault.at_s),
            (_, Some(fault), None) => format!("SAFE: {} at {:.3} s", fault.text, fault.at_s),
            ("playing", _, Some(row)) => format!("playing, row {row} of {}", self.rows),
            ("manual", ..) => "manual control".to_owned(),
            ("approaching", ..) => "servos approaching the first row".to_owned(),
            (phase, ..) => phase.to_owned(),
        }
    }
}

impl Report {
    fn profile_text(&self) -> &str {
        match self.profile_state {
            ProfileState::Written => self.profile.as_deref().map_or("", short),
            ProfileState::BuiltIn => "built in",
            ProfileState::Lost => LOST,
        }
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let closed: Vec<String> = self.switches_closed.iter().map(u8::to_string).collect();
        let mut lines = vec![
            format!("board     {} {}, firmware {}", self.board, self.device, self.firmware),
            format!("port      {}", self.port),
            format!("state     {}", self.state()),
            match (&self.model, &self.table) {
                (Some(model), Some(table)) => {
                    format!("table     {}, {} rows for model {model}", short(table), self.rows)
                }
                _ => "table     none; make one with `darm table`, then `darm upload` it".to_owned(),
            },
            format!("profile   {}", self.profile_text()),
            format!("outputs   {}", recovery(&self.recovering)),
            format!("word      {}", if self.word.is_empty() { "none" } else { &self.word }),
            format!(
                "switches  {}",
                if closed.is_empty() { "none closed".into() } else { closed.join(" ") + " closed" }
            ),
        ];
        lines.extend(self.servos.iter().enumerate().map(|(index, servo)| {
            format!(
                "servo {index}   {:.2} deg, load {:.0} %{}",
                servo.angle_rad.to_degrees(),
                100.0 * servo.load,
                servo.trouble()
            )
        }));
        let up = self.up_s.map_or(String::new(), |up_s| format!("up {up_s:.1} s since start {}, ", self.boots));
        lines.push(format!(
            "health    {up}{} bad frames, control tick at most {:.0} us late",
            self.bad_frames,
            1e6 * self.worst_lateness_s
        ));
        lines.extend(self.health.iter().flat_map(health_lines));
        lines.extend(self.crash.iter().map(|crash| format!("crash     {crash}")));
        lines.extend(self.history.iter().flat_map(History::lines));
        lines.join("\n")
    }
}

impl ServoReport {
    fn trouble(&self) -> String {
        match (self.answered_s, self.error_bits) {
            (None, _) => ", has never answered".to_owned(),
            (Some(_), 0) => String::new(),
            (Some(_), bits) => format!(", error bits {bits:#04x}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_arm::board_profile::BoardProfile;
    use darm_core::output::Wiring;
    use darm_device::client::Client;
    use darm_sim::in_process::{InProcess, MemoryFlash};
    use darm_sim::plant::Plant;

    use super::{LOST, ProfileState, report};
    use crate::ui::Answer as _;

    /// What `darm status` says of the profile of a board with this flash.
    fn said(flash: MemoryFlash) -> (ProfileState, String) {
        let board = InProcess::boot(Plant::new(&Wiring::default(), &[]), flash).unwrap();
        let mut client = Client::connect(board.link()).unwrap();
        let (status, outputs) = (client.status().unwrap(), client.outputs().unwrap());
        let report = report(&client, &status, &outputs, None);
        let line = report.text().lines().find_map(|line| line.strip_prefix("profile   ").map(str::to_owned));
        (report.profile_state, line.unwrap())
    }

    #[test]
    fn a_lost_profile_is_not_the_one_that_is_built_in() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.profile.toml");
        let profile = BoardProfile::read(&path).unwrap();
        assert_eq!(said(MemoryFlash::default()), (ProfileState::BuiltIn, "built in".to_owned()));
        let written = said(MemoryFlash::with_profile(&profile.image()));
        assert_eq!(written, (ProfileState::Written, profile.profile.digest.short().to_string()));
        let damaged = MemoryFlash::with_profile(&profile.image());
        assert!(damaged.damage_profiles(profile.image().bytes()) > 0);
        assert_eq!(said(damaged), (ProfileState::Lost, LOST.to_owned()));
    }
}
