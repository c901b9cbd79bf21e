//! What a board reports of itself and of its earlier starts. Firmware from before these requests refuses them as unknown.

use darm_core::sequencer::Event;
use darm_core::units::Micros;
use darm_core::wire::bootstrap::CrashRecord;
use darm_core::wire::health::Health;
use darm_core::wire::inputs::InputChanges;
use darm_core::wire::message::Refusal;

use super::question::{self, Question};
use super::{Client, ClientError};

impl Client {
    /// Board time at which the board answered last; 0 before its first answer.
    pub fn answered_at(&self) -> Micros {
        self.answered_at
    }

    /// What the board reports of itself; `None` from firmware that does not know the request.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn health(&mut self) -> Result<Option<Health>, ClientError> {
        self.ask_if_known(&question::health())
    }

    /// What happened before the board's last start, as far as it has kept it, the newest first. Times are those of their start,
    /// which begins with [`Event::Booted`].
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn past_events(&mut self) -> Result<Vec<(Micros, Event)>, ClientError> {
        let mut events = Vec::new();
        loop {
            match self.ask_if_known(&question::past_events(events.len() as u32))? {
                Some(more) if !more.is_empty() => events.extend(more),
                Some(_) | None => return Ok(events),
            }
        }
    }

    /// How earlier starts ended, as far as the board has kept it, the last crash first.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn past_crashes(&mut self) -> Result<Vec<CrashRecord>, ClientError> {
        let mut crashes = Vec::new();
        while let Some(crash) = self.ask_if_known(&question::past_crash(crashes.len() as u8))?.flatten() {
            crashes.push(crash);
        }
        Ok(crashes)
    }

    /// Changes of the inputs from a number on, as many as fit an answer; `None` from firmware that does not know the request.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn input_changes(&mut self, from: u32) -> Result<Option<InputChanges>, ClientError> {
        self.ask_if_known(&question::inputs(from))
    }

    fn ask_if_known<T>(&mut self, question: &Question<'_, T>) -> Result<Option<T>, ClientError> {
        match self.ask(question) {
            Err(ClientError::Refused(Refusal::Unknown)) => Ok(None),
            answer => answer.map(Some),
        }
    }
}
