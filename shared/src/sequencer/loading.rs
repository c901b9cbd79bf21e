//! How the sequencer takes a table, and gives it back.
//!
//! What a table and a profile name is taken over a few at a time, so that no tick is long.

use super::Sequencer;
use crate::table::Table;

impl<'t> Sequencer<'t> {
    /// Takes a table to run. The sequencer must be idle; the table comes back if it is not.
    ///
    /// # Errors
    ///
    /// A table is loaded or the sequencer is not idle: the table comes back.
    pub fn load(&mut self, table: &'t mut Table) -> Result<(), &'t mut Table> {
        if !self.is_idle() || self.table.is_some() {
            return Err(table);
        }
        self.coils.load(table.wiring());
        self.switches.load();
        self.n_wired = 0;
        self.hold_servos();
        self.table = Some(table);
        Ok(())
    }

    /// Whether a command is best given now: the outputs of the profile and the actuators of the table are taken over, some in each
    /// tick, and when nothing runs the meters have counted all that has flowed, as is so after a few ticks. A command that comes
    /// earlier takes over the rest at once, which makes its tick longer.
    pub fn is_ready(&self) -> bool {
        self.has_taken_over() && (!self.is_idle() || self.coils.is_counted())
    }

    /// Whether the outputs of the profile and the actuators of the table are taken over.
    pub(super) fn has_taken_over(&self) -> bool {
        let is_wired = |table: &Table| self.n_wired >= table.wiring().actuators.len();
        self.coils.has_outputs() && self.table.as_deref().is_none_or(is_wired)
    }

    /// Takes over at most `max` further outputs of the profile or, once it has them all, actuators of the table.
    pub(super) fn take_over(&mut self, max: usize) {
        if !self.coils.has_outputs() {
            return self.coils.take_outputs(self.now, self.profile, max);
        }
        let Some(table) = self.table.as_deref().filter(|_| !self.has_taken_over()) else { return };
        let actuators = table.wiring().actuators_with_coils().enumerate();
        for (index, (actuator, coils)) in actuators.skip(self.n_wired).take(max) {
            self.coils.wire(index, coils);
            self.switches.wire(index, actuator);
            self.n_wired = index.saturating_add(1);
        }
    }

    /// Gives the table back, to be filled again. Nothing while a program runs or a coil is on by hand.
    pub fn unload(&mut self) -> Option<&'t mut Table> {
        if self.is_idle() { self.table.take() } else { None }
    }
}
