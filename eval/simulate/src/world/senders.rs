//! Who has sent what to the board, and what the judges conclude from it.

use darm_core::wire::message::{REQUEST, Request};
use darm_core::wire::{bootstrap, frame};

use super::World;
use crate::judge::reports::Ending;

/// After a stop that came behind a command the lines are off within this time, ms of the board's clock.
const STOP_MS: u64 = 3;
/// For this time nothing that came before that stop may act, ms.
const QUIET_MS: u64 = 60;

/// Who sends to the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Party {
    /// The host of the script.
    First,
    /// The second host.
    Second,
    /// The hostile sender.
    Hostile,
}

impl World {
    /// True if the hostile sender has sent something since then.
    pub fn is_hostile_since(&self, since_ns: u64) -> bool {
        self.hostile_ns.is_some_and(|at| at >= since_ns)
    }

    /// True if anybody but this host has sent something since then that acts.
    pub fn has_other_acted_since(&self, party: Party, since_ns: u64) -> bool {
        let other = self.acted_ns[usize::from(party == Party::First)];
        self.is_hostile_since(since_ns) || other.is_some_and(|at| at >= since_ns)
    }

    /// An upload of this host ended.
    pub fn on_upload(&mut self, party: Party, model: u64, ending: Ending, began_ns: u64) {
        let of_others = self.commits.iter().filter(|&&(by, _, at_ns)| by != party && at_ns >= began_ns);
        let concurrent: Vec<u64> = of_others.map(|commit| commit.1).collect();
        self.reports.on_upload(self.now_ns(), model, ending, &concurrent);
    }

    /// This host had a stop confirmed that it began then: what still moves, if nobody else has acted since.
    pub fn judge_stopped(&mut self, party: Party, began_ns: u64, at_once: bool) {
        if self.has_other_acted_since(party, began_ns) {
            return;
        }
        let (now_ns, lines) = (self.now_ns(), self.pins.high());
        let reachable = !at_once && self.is_undisturbed_since(began_ns);
        let moving = if reachable { self.servos.moving() } else { None };
        self.reports.on_stopped(now_ns, lines, moving);
    }

    /// What flash holds, for judge 2.
    pub fn judge_loaded(&mut self, asked_ns: u64, model: Option<u64>, rows: u16) {
        let (now_ns, flash) = (self.now_ns(), self.bench.flash().clone());
        self.reports.on_loaded(now_ns, asked_ns, model, rows, |image| flash.holds(image));
        self.reports.on_overwrites(now_ns, flash.overwrites());
    }

    /// A host sends bytes.
    pub(crate) fn on_sent(&mut self, party: Party, bytes: &[u8]) {
        self.trace.mix(bytes);
        self.burst_ns = None;
        let mut body = bytes.to_vec();
        if let [0, encoded @ .., 0] = body.as_mut_slice()
            && let Ok((header, payload)) = frame::decode(encoded)
        {
            self.on_frame(party, header, payload);
        }
        self.bench.send(bytes);
    }

    fn on_frame(&mut self, party: Party, header: frame::Header, payload: &[u8]) {
        let now_ns = self.now_ns();
        if header.link != 0 {
            self.host_link = header.link;
        }
        let request = (header.tag == REQUEST).then(|| postcard::from_bytes::<Request<'_>>(payload).ok()).flatten();
        if let Some(Request::Commit(image)) = request {
            self.commits.push((party, image.model.0, now_ns));
            self.reports.on_upload(now_ns, image.model.0, Ending::Unknown, &[]);
        }
        let stops_or_restarts = matches!(
            bootstrap::Request::decode(header.tag, payload),
            Some(bootstrap::Request::Stop | bootstrap::Request::Reboot(_))
        );
        if stops_or_restarts || request.is_some_and(|request| !request.is_repeatable()) {
            self.acted_ns[usize::from(party == Party::Second)] = Some(now_ns);
        }
    }

    /// Lines are on: none may be because of a command that a stop followed at once.
    pub(super) fn judge_burst(&mut self) {
        let Some(burst_ns) = self.burst_ns else { return };
        let after_ns = self.bench.now_ns() - burst_ns;
        if after_ns > QUIET_MS * 1_000_000 {
            self.burst_ns = None;
        } else if after_ns > STOP_MS * 1_020_000 {
            self.reports.on_lines_after_burst(self.bench.now_ns(), after_ns, self.pins.high());
            self.burst_ns = None;
        }
    }
}
