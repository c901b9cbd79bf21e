//! A person at the simulated arm: sees where its actuators are, hears nothing of lines and inputs.

use super::TRAVEL_MS;
use darm_device::bringup::{Consent, Look, Operator, Step};
use darm_sim::in_process::InProcess;
use darm_sim::plant::camera::{Film, Frame};

/// The stroke ends this time after the output was switched off; a look in the middle of the time before it.
const AFTER_OFF_S: f64 = 1e-3 * (2.0 * TRAVEL_MS as f64 + 50.0);
const BEFORE_OFF_S: f64 = 0.06;

pub(super) struct Person {
    pub(super) board: InProcess,
    pub(super) film: Film,
    pub(super) looks: bool,
    pub(super) stop_at: Option<u8>,
    /// What the film showed of the last stroke.
    pub(super) seen: Vec<Frame>,
    pub(super) skips: Vec<u8>,
    pub(super) quits_at: Option<u8>,
    pub(super) strokes: usize,
    /// Lines that were high when a stroke was about to begin.
    pub(super) lines_between_strokes: u64,
    /// Actuators that moved in one stroke, at most.
    pub(super) max_moved: usize,
}

impl Person {
    pub(super) fn new(board: InProcess, looks: bool, stop_at: Option<u8>) -> Self {
        let film = board.film();
        Self {
            board,
            film,
            looks,
            stop_at,
            seen: Vec::new(),
            skips: Vec::new(),
            quits_at: None,
            strokes: 0,
            lines_between_strokes: 0,
            max_moved: 0,
        }
    }

    pub(super) fn consent_for(&self, output: u8) -> Consent {
        match self.quits_at {
            Some(at) if at == output => Consent::Quit,
            _ if self.skips.contains(&output) => Consent::Skip,
            _ => Consent::Go,
        }
    }

    fn moved_actuators(&self) -> Vec<usize> {
        let digits = |actuator: usize| self.seen.iter().map(move |frame| frame.state.reached.digit(actuator));
        (0..6).filter(|&actuator| digits(actuator).min() != digits(actuator).max()).collect()
    }
}

impl Operator for Person {
    fn consent(&mut self, step: &Step<'_>) -> Consent {
        self.film.take();
        self.lines_between_strokes |= self.board.with_board(|bench| bench.plant().lines()).unwrap();
        self.consent_for(step.output)
    }

    fn moved(&mut self, _: &Step<'_>) -> Look {
        self.strokes += 1;
        self.seen = self.film.take();
        let moved = self.moved_actuators();
        self.max_moved = self.max_moved.max(moved.len());
        if self.looks { Look::Moved(moved) } else { Look::Nobody }
    }

    fn in_state(&mut self, step: &Step<'_>) -> Option<bool> {
        let end_s = self.seen.last()?.at_s;
        let on = self.seen.iter().rfind(|frame| frame.at_s < end_s - AFTER_OFF_S - BEFORE_OFF_S)?;
        self.looks.then(|| on.state.reached.digit(step.actuator) == step.state)
    }

    fn emergency_stop(&mut self, pressed: bool) -> bool {
        if let Some(input) = self.stop_at.filter(|_| self.looks) {
            let mut broken = self.board.with_board(|bench| bench.plant().broken()).unwrap();
            broken.switches_closed = broken.switches_closed & !(1 << input) | u32::from(!pressed) << input;
            self.board.set_broken(broken);
        }
        self.looks
    }

    fn waiting(&mut self, _: u8, _: u32) {}

    fn is_interrupted(&mut self) -> bool {
        false
    }
}
