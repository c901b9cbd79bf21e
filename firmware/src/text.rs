//! Commands that a person types: the same operations as the messages, under the same limits.
//!
//! Every line of an answer that is not a result starts with `?`; a line that starts with no letter is no command, so
//! a terminal that echoes what it receives does not start a conversation of the board with itself.
mod parse;

use core::fmt;

use darm_core::nearest::{Coordinates, Found};
use darm_core::output::{Coil, MAX_COILS, MAX_SERVOS, ServoWiring};
use darm_core::profile::{EmergencyStop, Output};
use darm_core::sequencer::Phase;
use darm_core::units::{Digest, Micros};
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{CrashKind, CrashRecord};
use darm_core::wire::health::{Health, StackUse};
use embedded_io_async::Write;
use embedded_storage_async::nor_flash::NorFlash;

use crate::clock::Clock;
use crate::dispatch::{Dispatcher, FIRMWARE};
use crate::kept::CRASHES;
use darm_core::wire::scan::Stop;
use parse::{TextCommand, parse};

const HELP: &[&str] = &[
    "help             this list",
    "id               board, device number, versions",
    "status           state, table, profile, word, switches, servos, load, stack",
    "limits           limits of all coils and servos, remaining on-times",
    "profile          wiring of the board, and limits that no table can exceed",
    "table            the loaded table",
    "play             run the table from its first row",
    "stop             all coils off and servos hold, at once",
    "coil N on MS     switch output N on for MS milliseconds (coil N off: off)",
    "word DIGITS      switch all actuators to a word, base first: word 010,110",
    "servo N DEG      move servo N to an angle in degrees",
    "nearest X Y A    find a word near this pose of the tool, in mm and degrees;",
    "                 in space nearest X Y Z RX RY RZ, with a rotation vector",
    "fault            the latched fault, and the last crashes",
    "clear            leave the safe state after a fault",
    "log              the last events, of earlier starts as well",
    "reboot           restart (reboot loader: into the chip's loader)",
];

/// One line to the terminal. Longer lines are cut.
async fn say<W: Write>(writer: &mut W, line: fmt::Arguments<'_>) -> Result<(), W::Error> {
    let mut text = Line::default();
    // The text is cut where it does not fit.
    let _ = fmt::write(&mut text, line);
    writer.write_all(text.0.as_bytes()).await?;
    writer.write_all(b"\r\n").await
}

#[derive(Default)]
struct Line(heapless::String<160>);

impl fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|character| self.0.push(character)).map_err(|_| fmt::Error)
    }
}

impl<F: NorFlash, C: Clock> Dispatcher<'_, '_, F, C> {
    /// Does what a line says and writes the answer.
    ///
    /// # Errors
    ///
    /// `out` fails. What the board refuses is an answer.
    pub async fn execute<W: Write>(&mut self, line: &str, out: &mut W) -> Result<(), W::Error> {
        if !line.starts_with(|first: char| first.is_ascii_alphabetic()) {
            return Ok(());
        }
        match parse(line) {
            Err(error) => say(out, format_args!("? {line}: {error}")).await,
            Ok(TextCommand::Help) => {
                for line in HELP {
                    say(out, format_args!("{line}")).await?;
                }
                Ok(())
            }
            Ok(TextCommand::Id) => self.say_id(out).await,
            Ok(TextCommand::Status) => self.say_status(out).await,
            Ok(TextCommand::Limits) => self.say_limits(out).await,
            Ok(TextCommand::Profile) => self.say_profile(out).await,
            Ok(TextCommand::Table) => self.say_table(out).await,
            Ok(TextCommand::Fault) => self.say_fault(out).await,
            Ok(TextCommand::Log) => self.say_log(out).await,
            Ok(TextCommand::Reboot(into)) => match self.restart(into).await {
                Ok(()) => say(out, format_args!("ok, restarting")).await,
                Err(refusal) => say(out, format_args!("? {refusal}")).await,
            },
            Ok(TextCommand::Nearest(target)) => self.say_nearest(&target, out).await,
            Ok(TextCommand::Stop) => out.write_all(&self.stop(Stop::Typed).await).await,
            Ok(TextCommand::Run(command)) => match self.command(command).await {
                Ok(()) => say(out, format_args!("ok")).await,
                Err(refusal) => say(out, format_args!("? {refusal}")).await,
            },
        }
    }

    async fn say_nearest<W: Write>(&mut self, target: &Coordinates, out: &mut W) -> Result<(), W::Error> {
        match self.nearest(target).await {
            Ok(Found { word, distance_m, error_m, error_rad }) => {
                let (error_deg, [error_mm, distance_mm]) =
                    (error_rad.to_degrees(), [error_m, distance_m].map(|m| 1e3 * m));
                say(out, format_args!("{word}: {error_mm:.1} mm and {error_deg:.2} deg off, d {distance_mm:.1} mm"))
                    .await
            }
            Err(refusal) => say(out, format_args!("? {refusal}")).await,
        }
    }

    async fn say_id<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let [major, minor, patch] = FIRMWARE;
        let identity = &self.board.identity;
        say(out, format_args!("board {}, device {}", identity.board, identity.device)).await?;
        say(out, format_args!("firmware {major}.{minor}.{patch}, protocol {PROTOCOL}")).await
    }

    async fn say_status<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let now = self.shared.snapshot().await;
        match now.phase {
            Phase::Idle => say(out, format_args!("idle")).await?,
            Phase::Manual => say(out, format_args!("manual control")).await?,
            Phase::Approaching { .. } => say(out, format_args!("approaching the first row")).await?,
            Phase::Playing { next, .. } => {
                say(out, format_args!("playing, row {next} of {} is next", now.rows)).await?;
            }
            Phase::Safe(fault) => say(out, format_args!("safe state: {fault}; type clear to leave it")).await?,
        }
        match now.model {
            Some(model) => say(out, format_args!("table of {} rows, model {model}", now.rows)).await?,
            None => say(out, format_args!("no table")).await?,
        }
        self.say_stored(out).await?;
        say(out, format_args!("word {}, switches {:013b}", now.word, now.switches)).await?;
        for index in 0..usize::from(now.n_servos) {
            let servo = self.joint_seen(index);
            match servo.answered {
                Some(_) => {
                    let (angle_deg, load) = (servo.angle_rad.to_degrees(), servo.load * 100.0);
                    say(out, format_args!("servo {index}: {angle_deg:.2} deg, load {load:.0} %")).await?;
                }
                None => say(out, format_args!("servo {index}: no answer yet")).await?,
            }
        }
        self.say_load(out).await?;
        say(out, format_args!("up {}, latest tick {} us late", self.clock.now(), now.worst_lateness.0)).await
    }

    /// The supply, and how much is in use of the processor and of its stack, where the board knows.
    async fn say_load<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let Health { load_permille, stack, supply_mv, min_supply_mv, .. } = self.health();
        match (supply_mv, min_supply_mv) {
            (Some(mv), Some(min_mv)) => say(out, format_args!("supply {mv} mV, at least {min_mv} mV")).await?,
            (Some(mv), None) => say(out, format_args!("supply {mv} mV")).await?,
            (None, _) => {}
        }
        if let Some(load) = load_permille {
            say(out, format_args!("load {}.{} % of the last second", load / 10, load % 10)).await?;
        }
        if let Some(StackUse { used, size }) = stack {
            say(out, format_args!("stack: {used} of {size} bytes were in use")).await?;
        }
        Ok(())
    }

    /// Which profile is in force, and what of the store is not.
    async fn say_stored<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let profile = self.profile().digest;
        if self.is_built_in() {
            say(out, format_args!("no profile is stored: the limits are those built in, servos are off")).await?;
        } else if profile == Digest::default() {
            say(out, format_args!("no profile is in force: nothing is driven until it is written again")).await?;
        } else {
            say(out, format_args!("profile {}", profile.short())).await?;
        }
        if let Some(refusal) = self.rejected() {
            say(out, format_args!("what is stored was refused: {refusal}")).await?;
        }
        if self.has_store() && !self.is_store_readable() {
            say(out, format_args!("the records of the store cannot be read; writing the profile erases them")).await?;
        } else if self.is_profile_lost() {
            say(out, format_args!("the profile is lost: the record that names it cannot be read")).await?;
        }
        Ok(())
    }

    async fn say_profile<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let profile = self.profile();
        say(out, format_args!("profile {}; {}", profile.digest.short(), profile.supply)).await?;
        if let Some(EmergencyStop { input, opens }) = profile.emergency_stop {
            let pressed = if opens { "open" } else { "closed" };
            say(out, format_args!("emergency stop: input {input}, pressed when {pressed}")).await?;
        }
        if let Some(mv) = profile.min_supply_mv {
            say(out, format_args!("supply of the board: at least {mv} mV")).await?;
        }
        for (number, output) in profile.outputs.iter().enumerate() {
            if let Some(output) = output {
                say(out, format_args!("output {number}: {}", OutputText(output))).await?;
            }
        }
        for (index, servo) in profile.servos.iter().enumerate() {
            say(out, format_args!("servo {index}: {}, safe: {:?}", ServoText(&servo.limit), servo.fallback)).await?;
        }
        Ok(())
    }

    async fn say_limits<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let Some(table) = self.shared.summary().await else {
            return say(out, format_args!("? no table is loaded; upload one first")).await;
        };
        let limit = table.switch_limit;
        say(out, format_args!("{limit}")).await?;
        for index in 0..MAX_COILS as u8 {
            if let Some(Coil { drive, limit, .. }) = self.shared.coil_wiring(index).await {
                let left_ms = self.shared.output_state(index).await.map_or(0, |output| output.left_ms);
                say(out, format_args!("coil {index}: {drive}; {limit}, {left_ms} ms left")).await?;
            }
        }
        for index in 0..MAX_SERVOS as u8 {
            if let Some(servo) = self.shared.servo_wiring(index).await {
                say(out, format_args!("servo {index}: {}", ServoText(&servo))).await?;
            }
        }
        Ok(())
    }

    async fn say_table<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let Some(table) = self.shared.summary().await else {
            return say(out, format_args!("? no table is loaded; upload one first")).await;
        };
        say(out, format_args!("{} rows in {}, model {}", table.rows, table.end, table.model)).await?;
        let (actuators, coils, servos) = (table.actuators, table.coils, table.servos);
        say(out, format_args!("{actuators} actuators on {coils} coils, {servos} servos")).await
    }

    async fn say_fault<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        match self.shared.snapshot().await.phase {
            Phase::Safe(fault) => say(out, format_args!("{fault}; type clear to leave the safe state")).await?,
            _ => say(out, format_args!("no fault is latched")).await?,
        }
        match &self.board.crash {
            Some(crash) => say(out, format_args!("last crash: {}", CrashText(crash))).await?,
            None => say(out, format_args!("no crash in the last start")).await?,
        }
        for back in 0..CRASHES as u8 {
            if let Some(crash) = self.past_crash(back) {
                say(out, format_args!("kept crash {back}: {}", CrashText(&crash))).await?;
            }
        }
        Ok(())
    }

    async fn say_log<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        self.catch_up();
        let mut number = self.log.first();
        while number != self.log.next() {
            let events = self.log.from(number);
            for (at, event) in &events.list {
                say(out, format_args!("{number} {at} {event}")).await?;
                number = number.wrapping_add(1);
            }
        }
        self.say_past(out).await
    }

    /// Events of earlier starts, the newest first.
    async fn say_past<W: Write>(&mut self, out: &mut W) -> Result<(), W::Error> {
        let mut skip = 0u32;
        loop {
            let events = self.log.before(skip);
            if events.is_empty() {
                return Ok(());
            }
            if skip == 0 {
                say(out, format_args!("before this start, the newest first:")).await?;
            }
            for (at, event) in &events {
                say(out, format_args!("- {at} {event}")).await?;
            }
            skip = skip.saturating_add(events.len() as u32);
        }
    }
}

struct OutputText<'a>(&'a Output);

impl fmt::Display for OutputText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Output { drive, limit, input } = self.0;
        write!(f, "{drive}; {limit}")?;
        input.map_or(Ok(()), |input| write!(f, "; switch at input {input}"))
    }
}

struct ServoText<'a>(&'a ServoWiring);

impl fmt::Display for ServoText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ServoWiring { id, min_rad, max_rad, max_speed_rad_s, max_torque, timeout_ms } = *self.0;
        let (min_deg, max_deg) = (min_rad.to_degrees(), max_rad.to_degrees());
        write!(f, "address {id}, {min_deg:.1} to {max_deg:.1} deg, {:.1} deg/s", max_speed_rad_s.to_degrees())?;
        write!(f, ", {:.0} % torque, answers within {timeout_ms} ms", max_torque * 100.0)
    }
}

struct CrashText<'a>(&'a CrashRecord);

impl fmt::Display for CrashText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let CrashRecord { kind, uptime_us, pc, lr, text } = self.0;
        match kind {
            CrashKind::Panic => write!(f, "a panic after {}: {text}", Micros(*uptime_us)),
            CrashKind::HardFault => {
                write!(f, "a hard fault after {} at {pc:#010x} from {lr:#010x}: {text}", Micros(*uptime_us))
            }
            // The hardware leaves no record.
            CrashKind::Watchdog if text.is_empty() => f.write_str("the watchdog: the control tick had stopped"),
            CrashKind::Watchdog => write!(f, "the watchdog after {}: {text}", Micros(*uptime_us)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::CrashText;
    use darm_core::wire::bootstrap::{CrashKind, CrashRecord};

    #[test]
    fn a_watchdog_record_says_which_task_was_silent() {
        let crash = |text: &str, uptime_us| CrashRecord {
            kind: CrashKind::Watchdog,
            uptime_us,
            pc: 0,
            lr: 0,
            text: text.try_into().unwrap(),
        };
        let silent = crash("servo bus silent for 2000 ms", 61_250_000);
        assert_eq!(CrashText(&silent).to_string(), "the watchdog after 61.250 s: servo bus silent for 2000 ms");
        let bitten = crash("", 0);
        assert_eq!(CrashText(&bitten).to_string(), "the watchdog: the control tick had stopped");
    }
}
