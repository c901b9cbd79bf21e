//! The control tick of a board: looks, decides and drives, once a millisecond; then feeds the watchdog if the tasks report.
//!
//! A board calls it from an interrupt of the highest priority in use: no executor, no future, nothing in it can panic
//! (`cargo xtask image --panics`).

use darm_core::duty::DutyMeters;
use darm_core::sequencer::Outputs;
use darm_core::units::Micros;

use crate::control::{Control, Shared};
use crate::crash;
use crate::hardware::{Hardware, Pins};
use crate::life::{Pulse, STEADY, Task, Watch};
use crate::solenoid::Solenoids;

/// What the control tick owns.
pub struct Ticker<H: Hardware> {
    control: Control<'static>,
    solenoids: Solenoids<H::Pins>,
    watch: Watch,
    /// The start has run for [`STEADY`].
    steady: bool,
}

impl<H: Hardware> Ticker<H> {
    /// Takes the pins, outputs disabled. `used` is what memory has kept of how long each output was on.
    pub fn new(now: Micros, pins: H::Pins, used: &'static mut DutyMeters, shared: &Shared<'static>) -> Self {
        let solenoids = Solenoids::new(pins);
        Self { control: Control::new(now, shared, used), solenoids, watch: Watch::new(now), steady: false }
    }

    /// One tick, which was due at `due`; what the outputs are until the next one.
    #[inline(always)]
    pub fn tick(
        &mut self,
        now: Micros,
        due: Micros,
        shared: &Shared<'static>,
        pulses: &[Pulse; Task::ALL.len()],
    ) -> Outputs {
        let mut inputs = self.solenoids.chain().inputs();
        inputs.chain_broken = self.solenoids.is_broken();
        inputs.enable_stuck = self.solenoids.is_enable_stuck();
        let outputs = self.control.tick(now, due, inputs, shared);
        self.solenoids.set_busy(self.control.has_obeyed());
        self.solenoids.apply(outputs.lines, outputs.enabled);
        shared.set_chain_errors(self.solenoids.errors());
        self.look_after(now, pulses);
        outputs
    }

    fn look_after(&mut self, now: Micros, pulses: &[Pulse; Task::ALL.len()]) {
        if let Some(task) = self.watch.silent(now, pulses.each_ref().map(Pulse::count)) {
            crash::end_silence::<H>(task);
        }
        H::feed_watchdog();
        if !self.steady && now >= STEADY {
            self.steady = true;
            crash::forget_crashes(H::kept());
        }
    }
}
