//! The control tick of a board: looks, decides and drives, once a millisecond; then feeds the watchdog if the tasks report.
//!
//! A board calls it from an interrupt of the highest priority in use: no executor, no future, nothing in it can panic
//! (`cargo xtask image --panics`). The board in a process takes the same steps.

use darm_core::duty::DutyMeters;
use darm_core::sequencer::Outputs;
use darm_core::units::Micros;

use crate::control::{Control, Shared};
use crate::crash;
use crate::hardware::{Converted, Hardware, Pins};
use crate::life::{Pulse, STEADY, Task, Watch};
use crate::solenoid::Solenoids;

/// Ticks from one conversion to the next: supply and temperature take turns, so each is measured every 10 ms.
const CONVERSION_TICKS: u8 = 5;

/// What the control tick owns.
pub struct Ticker<'t, P> {
    control: Control<'t>,
    solenoids: Solenoids<P>,
    watch: Watch,
    /// The level of the pulse to a camera.
    sync: bool,
    /// The start has run for [`STEADY`].
    steady: bool,
    /// Ticks until the next conversion.
    until_conversion: u8,
}

/// What is to be done after a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchdogAction {
    /// Feed the watchdog.
    Feed,
    /// The same, and the start has run for [`STEADY`], since this tick: crashes in a row end.
    FeedSteady,
    /// End this start: this task no longer runs.
    End(Task),
}

impl<'t, P: Pins> Ticker<'t, P> {
    /// Takes the pins, outputs disabled. `used` is what memory has kept of how long each output was on.
    pub fn new(now: Micros, pins: P, used: &'t mut DutyMeters, shared: &Shared<'t>) -> Self {
        Self {
            control: Control::new(now, shared, used),
            solenoids: Solenoids::new(pins),
            watch: Watch::new(now),
            sync: false,
            steady: false,
            until_conversion: 0,
        }
    }

    /// One tick of a board, which was due at `due`; what the outputs are until the next one.
    #[inline(always)]
    pub fn tick<H: Hardware<Pins = P>>(
        &mut self,
        now: Micros,
        due: Micros,
        shared: &Shared<'t>,
        pulses: &[Pulse; Task::ALL.len()],
    ) -> Outputs {
        let (outputs, care) = self.step(now, due, shared, pulses);
        if let WatchdogAction::End(task) = care {
            crash::end_silence::<H>(task);
        }
        H::feed_watchdog();
        if care == WatchdogAction::FeedSteady {
            crash::forget_crashes(H::kept());
        }
        outputs
    }

    /// The same without a board around it, and what is to be done then.
    #[inline(always)]
    pub fn step(
        &mut self,
        now: Micros,
        due: Micros,
        shared: &Shared<'t>,
        pulses: &[Pulse; Task::ALL.len()],
    ) -> (Outputs, WatchdogAction) {
        let mut inputs = self.solenoids.chain().inputs();
        inputs.chain_broken = self.solenoids.is_broken();
        (inputs.enable_stuck, inputs.far_end) = (self.solenoids.enable_stuck(), self.solenoids.far_end());
        inputs.supply_mv = self.measure(shared);
        let outputs = self.control.tick(now, due, inputs, shared);
        self.solenoids.set_busy(self.control.has_obeyed());
        self.solenoids.apply(outputs.lines, outputs.enabled);
        // Behind the lines: its rising edge is theirs.
        if outputs.sync != self.sync {
            self.sync = outputs.sync;
            self.solenoids.chain_mut().set_sync(outputs.sync);
        }
        shared.set_chain_errors(self.solenoids.errors());
        (outputs, self.look_after(now, pulses))
    }

    /// The supply, where a measurement of it has ended.
    fn measure(&mut self, shared: &Shared<'t>) -> Option<u16> {
        if let Some(until) = self.until_conversion.checked_sub(1) {
            self.until_conversion = until;
            return None;
        }
        self.until_conversion = const { CONVERSION_TICKS - 1 };
        let converted = self.solenoids.chain_mut().convert()?;
        shared.see_converted(converted);
        match converted {
            Converted::SupplyMv(mv) => Some(mv),
            Converted::ChipCelsius(_) => None,
        }
    }

    fn look_after(&mut self, now: Micros, pulses: &[Pulse; Task::ALL.len()]) -> WatchdogAction {
        if let Some(task) = self.watch.silent(now, pulses.each_ref().map(Pulse::count)) {
            return WatchdogAction::End(task);
        }
        if self.steady || now < STEADY {
            return WatchdogAction::Feed;
        }
        self.steady = true;
        WatchdogAction::FeedSteady
    }
}

#[cfg(test)]
mod tests {
    use darm_core::units::Micros;

    use super::{STEADY, Ticker, WatchdogAction};
    use crate::control::{Inputs, Shared, TICK};
    use crate::hardware::{Converted, Pins};
    use crate::life::{Pulse, SILENCE_LIMIT, Task};
    use crate::solenoid::Chain;

    struct NoPins;

    impl Chain for NoPins {
        fn shift(&mut self, _: u64) {}

        fn set_enabled(&mut self, _: bool) {}

        fn reads_disabled(&mut self) -> Option<bool> {
            None
        }
    }

    impl Pins for NoPins {
        fn inputs(&self) -> Inputs {
            Inputs::default()
        }
    }

    /// Pins whose converter gives these supplies and temperatures in turn.
    struct Converter(Vec<Converted>);

    impl Chain for Converter {
        fn shift(&mut self, _: u64) {}

        fn set_enabled(&mut self, _: bool) {}

        fn reads_disabled(&mut self) -> Option<bool> {
            None
        }
    }

    impl Pins for Converter {
        fn inputs(&self) -> Inputs {
            Inputs::default()
        }

        fn convert(&mut self) -> Option<Converted> {
            self.0.pop()
        }
    }

    #[test]
    fn the_supply_is_measured_every_10_ms_and_reported_with_the_temperature() {
        let shared = Shared::new();
        let (warm, low) = (Converted::ChipCelsius(Some(31)), Converted::SupplyMv(4_400));
        let given = [low, warm, low, warm, Converted::SupplyMv(5_000)];
        let mut used = Box::default();
        let mut ticker = Ticker::new(Micros(0), Converter(given.to_vec()), &mut used, &shared);
        let mut supplies = Vec::new();
        for millis in 1..=25 {
            let now = Micros::from_millis(millis);
            supplies.extend(ticker.measure(&shared).map(|mv| (millis, mv)));
            ticker.control.tick(now, now, Inputs::default(), &shared);
            if millis == 10 {
                assert_eq!((shared.supply_mv(), shared.chip_celsius()), (Some(5_000), Some(31)));
            }
        }
        assert_eq!(supplies, [(1, 5_000), (11, 4_400), (21, 4_400)]);
        assert_eq!(shared.supply_mv(), Some(4_400));
    }

    /// What is to be done after each tick up to a time, where the first task reports and the second one until then.
    fn cares(until: Micros, bus_reports_until: Micros) -> Vec<WatchdogAction> {
        let (shared, pulses) = (Shared::new(), [const { Pulse::new() }; Task::ALL.len()]);
        let mut used = Box::default();
        let mut ticker = Ticker::new(Micros(0), NoPins, &mut used, &shared);
        let mut cares = Vec::new();
        let mut now = Micros(0);
        while now < until {
            now = now + TICK;
            pulses[0].beat();
            if now <= bus_reports_until {
                pulses[1].beat();
            }
            cares.push(ticker.step(now, now, &shared, &pulses).1);
        }
        cares
    }

    #[test]
    fn the_watchdog_is_fed_until_a_task_is_silent() {
        let cares = cares(Micros(2 * SILENCE_LIMIT.0), Micros(0));
        let fed = cares.iter().take_while(|care| **care == WatchdogAction::Feed).count();
        assert_eq!(fed as u64 * TICK.0, SILENCE_LIMIT.0);
        assert!(cares[fed..].iter().all(|care| *care == WatchdogAction::End(Task::ServoBus)));
    }

    #[test]
    fn a_start_is_steady_once() {
        let until = STEADY + Micros(3 * TICK.0);
        let cares = cares(until, until);
        let steady: Vec<usize> = (0..cares.len()).filter(|index| cares[*index] == WatchdogAction::FeedSteady).collect();
        assert_eq!(steady, [(STEADY.0 / TICK.0) as usize - 1]);
    }
}
