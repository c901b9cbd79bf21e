//! What a board reports of itself and of its earlier starts. Firmware from before these requests refuses them as unknown.

use darm_core::sequencer::Event;
use darm_core::units::Micros;
use darm_core::wire::bootstrap::CrashRecord;
use darm_core::wire::health::Health;
use darm_core::wire::inputs::InputChanges;
use darm_core::wire::message::{Answer, Refusal, Request};

use super::{AnswerError, Client, ClientError};

impl Client {
    /// Board time at which the board answered last; 0 before its first answer.
    pub fn answered_at(&self) -> Micros {
        self.exchange.answered_at()
    }

    /// What the board reports of itself; `None` from firmware that does not know the request.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn health(&mut self) -> Result<Option<Health>, ClientError> {
        match self.ask_if_known("health", &Request::Health)? {
            Some(Answer::Health(health)) => Ok(Some(health)),
            Some(_) => Err(AnswerError::Payload { request: "health" }.into()),
            None => Ok(None),
        }
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
            match self.ask_if_known("past events", &Request::PastEvents { skip: events.len() as u32 })? {
                Some(Answer::PastEvents(more)) if more.is_empty() => return Ok(events),
                Some(Answer::PastEvents(more)) => events.extend(more),
                Some(_) => return Err(AnswerError::Payload { request: "past events" }.into()),
                None => return Ok(events),
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
        loop {
            match self.ask_if_known("past crash", &Request::PastCrash { back: crashes.len() as u8 })? {
                Some(Answer::PastCrash(Some(crash))) => crashes.push(crash),
                Some(Answer::PastCrash(None)) | None => return Ok(crashes),
                Some(_) => return Err(AnswerError::Payload { request: "past crash" }.into()),
            }
        }
    }

    /// Changes of the inputs from a number on, as many as fit an answer; `None` from firmware that does not know the request.
    ///
    /// # Errors
    ///
    /// As [`status`](Self::status).
    pub fn input_changes(&mut self, from: u32) -> Result<Option<InputChanges>, ClientError> {
        match self.ask_if_known("inputs", &Request::Inputs { from })? {
            Some(Answer::Inputs(changes)) => Ok(Some(changes)),
            Some(_) => Err(AnswerError::Payload { request: "inputs" }.into()),
            None => Ok(None),
        }
    }

    fn ask_if_known(&mut self, name: &'static str, request: &Request) -> Result<Option<Answer>, ClientError> {
        match self.ask(name, request) {
            Err(ClientError::Refused(Refusal::Unknown)) => Ok(None),
            answer => answer.map(Some),
        }
    }
}
