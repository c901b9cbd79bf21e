//! Judge 2, the person at the board: a profile comes into force only if it arrived while somebody pressed the button.
//!
//! A press is a contact that closes after it was open for 20 ms since the start; it counts while it stays closed, for 60 s.

use super::{Ceilings, Verdict};

const JUDGE: &str = "reports";
const MS: u64 = 1_000_000;
/// The contact was open for this time before a press, ms of the board.
const OPEN_MS: u64 = 20;
/// A press counts for this time, ms of the board.
const PRESS_MS: u64 = 60_000;
/// A commit is done within this time after it arrived, ms: its image is read and checked, and records are written.
const COMMIT_MS: u64 = 2_000;
/// A contact is looked at once a tick, ms.
const TICK_MS: u64 = 2;

/// A digest of 32 bytes.
pub type Digest = [u8; 32];

/// The judge's memory.
pub struct Person {
    ceilings: Ceilings,
    is_closed: bool,
    since_ns: u64,
    /// When the press began that lasts, or would if the contact only bounced.
    pressed_ns: Option<u64>,
    /// From when to when presses counted; the last may still be open.
    presses: Vec<(u64, u64)>,
    /// Digests of profiles that may be in force.
    allowed: Vec<Digest>,
    /// Which profiles were to be committed, and when that arrived.
    commits: Vec<(u64, Digest)>,
    /// When the stored profile was damaged last.
    lost_ns: Option<u64>,
    /// When the board said last that a profile is in force.
    in_force_ns: Option<u64>,
    verdict: Verdict,
}

impl Person {
    /// A board with a profile.
    pub fn new(ceilings: Ceilings, profile: Digest) -> Self {
        Self {
            ceilings,
            is_closed: true,
            since_ns: 0,
            pressed_ns: None,
            presses: Vec::new(),
            allowed: vec![profile, [0; 32]],
            commits: Vec::new(),
            lost_ns: None,
            in_force_ns: None,
            verdict: Verdict::default(),
        }
    }

    /// The contact is closed, or open, in this tick.
    pub fn look(&mut self, now_ns: u64, is_closed: bool) {
        if is_closed == self.is_closed {
            return;
        }
        // The board sees a contact a tick later, and may take it for open a tick longer.
        let was_open_ns = now_ns - self.since_ns + TICK_MS * MS;
        if is_closed {
            if was_open_ns >= self.ceilings.true_ns(OPEN_MS) {
                self.pressed_ns = Some(now_ns);
            }
            if let Some(start_ns) = self.pressed_ns {
                self.presses.push((now_ns, start_ns + self.ceilings.true_ns(PRESS_MS + TICK_MS)));
            }
        }
        if !is_closed && let Some((_, end_ns)) = self.presses.last_mut() {
            *end_ns = (*end_ns).min(now_ns + TICK_MS * MS);
        }
        (self.is_closed, self.since_ns) = (is_closed, now_ns);
    }

    /// The firmware starts: a contact that is closed now is no press.
    pub fn on_start(&mut self, now_ns: u64) {
        if let Some((_, end_ns)) = self.presses.last_mut() {
            *end_ns = (*end_ns).min(now_ns);
        }
        (self.is_closed, self.since_ns, self.pressed_ns) = (true, now_ns, None);
    }

    /// Whether somebody pressed the button at some time of a span.
    fn is_pressed(&self, from_ns: u64, to_ns: u64) -> bool {
        self.presses.iter().any(|&(start_ns, end_ns)| start_ns <= to_ns && from_ns <= end_ns)
    }

    /// Whether somebody presses the button now.
    pub fn is_present(&self, now_ns: u64) -> bool {
        self.is_pressed(now_ns, now_ns)
    }

    /// What is to put this profile in force arrives.
    pub fn on_commit(&mut self, now_ns: u64, digest: Digest) {
        self.commits.push((now_ns, digest));
    }

    /// The stored profile is damaged.
    pub fn on_lost(&mut self, now_ns: u64) {
        self.lost_ns = Some(now_ns);
    }

    /// Whether the board has lost its profile: then it drives nothing until somebody presses the button and writes one.
    pub fn is_lost(&self) -> bool {
        let is_written = |&&(at_ns, _): &&(u64, Digest)| self.is_pressed(at_ns, at_ns + COMMIT_MS * MS);
        let last = || self.commits.iter().filter(is_written).map(|commit| commit.0).max();
        self.lost_ns.is_some_and(|lost_ns| last().is_none_or(|at_ns| at_ns < lost_ns))
    }

    /// Whether the board may have none still: what was to be committed at the button may not have been complete, and the board has said nothing
    /// since.
    pub fn may_be_lost(&self) -> bool {
        self.lost_ns.is_some() && self.in_force_ns <= self.lost_ns
    }

    /// A stop that was requested at `asked_ns` is confirmed for the servos, too: a board that has lost its profile knows none.
    pub fn on_servos_confirmed(&mut self, now_ns: u64, asked_ns: u64) {
        if self.is_lost() && self.lost_ns < Some(asked_ns) {
            self.verdict.note(JUDGE, "lost-servos-confirmed", now_ns, || {
                "a stop is confirmed for the servos, and the board has lost the profile that says which there are"
                    .to_owned()
            });
        }
    }

    /// The board says which profile is in force.
    pub fn on_in_force(&mut self, now_ns: u64, digest: Digest) {
        if digest != [0; 32] {
            self.in_force_ns = Some(now_ns);
        }
        if self.allowed.contains(&digest) {
            return;
        }
        let is_attended =
            |&(at_ns, own): &(u64, Digest)| own == digest && self.is_pressed(at_ns, at_ns + COMMIT_MS * MS);
        if self.commits.iter().any(is_attended) {
            self.allowed.push(digest);
            return;
        }
        self.verdict.note(JUDGE, "profile-unattended", now_ns, || {
            let digest: String = digest.iter().take(4).map(|byte| format!("{byte:02x}")).collect();
            format!("profile {digest} is in force, and nobody pressed the button when it was written")
        });
    }

    /// The board enters the chip's loader on the cable of its console.
    pub fn on_loader(&mut self, now_ns: u64) {
        if !self.is_pressed(now_ns.saturating_sub(COMMIT_MS * MS), now_ns) {
            self.verdict.note(JUDGE, "loader-unattended", now_ns, || {
                "the board enters the chip's loader, and nobody pressed the button".to_owned()
            });
        }
    }

    /// The end of the run.
    pub fn finish(self) -> Verdict {
        self.verdict
    }
}

#[cfg(test)]
mod tests {
    use super::super::Ceilings;
    use super::{MS, Person};

    const OTHER: [u8; 32] = [2; 32];

    fn person() -> Person {
        let (lines, latches, servos) = ([None; 64], Vec::new(), Vec::new());
        let ceilings = Ceilings { lines, latches, servos, new_loads: 1, budget_ms: 10, refresh_ms: 100, clock_ppm: 0 };
        Person::new(ceilings, [1; 32])
    }

    #[test]
    fn a_profile_that_was_lost_may_be_so_until_the_board_says_that_one_is_in_force() {
        let mut person = person();
        assert!(!person.may_be_lost());
        person.on_lost(100 * MS);
        [(0, false), (150, true)].iter().for_each(|&(ms, is_closed)| person.look(ms * MS, is_closed));
        person.on_commit(200 * MS, [1; 32]);
        person.on_in_force(210 * MS, [0; 32]);
        assert!(!person.is_lost() && person.may_be_lost(), "it may have been refused");
        person.on_in_force(220 * MS, [1; 32]);
        assert!(!person.may_be_lost());
    }

    /// Whether another profile may be in force that is committed at this time, with a contact that changes at these.
    fn may_commit(changes_ms: &[(u64, bool)], at_ms: u64) -> bool {
        let mut person = person();
        changes_ms.iter().for_each(|&(ms, is_closed)| person.look(ms * MS, is_closed));
        person.on_commit(at_ms * MS, OTHER);
        person.on_in_force((at_ms + 3_000) * MS, OTHER);
        !person.finish().has("profile-unattended")
    }

    #[test]
    fn a_profile_comes_into_force_only_where_somebody_pressed_the_button() {
        assert!(!may_commit(&[], 500), "nobody");
        assert!(!may_commit(&[(0, true)], 5_000), "a jumper that was left");
        assert!(may_commit(&[(0, false), (400, true)], 500));
        assert!(!may_commit(&[(0, false), (400, true), (450, false)], 500), "released");
        assert!(!may_commit(&[(0, false), (400, true)], 60_500), "held for more than a minute");
        assert!(!may_commit(&[(390, false), (400, true)], 500), "a loose jumper");
        assert!(may_commit(&[(0, false), (400, true), (490, false), (495, true)], 500), "a bounce");
    }

    #[test]
    fn a_lost_profile_stays_lost_until_somebody_writes_one() {
        let mut person = person();
        person.look(0, false);
        person.on_lost(50 * MS);
        person.on_commit(100 * MS, OTHER);
        assert!(person.is_lost());
        person.look(5_000 * MS, true);
        person.on_commit(5_100 * MS, OTHER);
        assert!(!person.is_lost());
        person.on_lost(9_000 * MS);
        assert!(person.is_lost(), "what was written before is what was damaged");
    }

    #[test]
    fn a_board_without_its_profile_confirms_no_servo() {
        let confirmed = |asked_ms: u64| {
            let mut person = person();
            person.on_lost(50 * MS);
            person.on_servos_confirmed(60 * MS, asked_ms * MS);
            person.finish().has("lost-servos-confirmed")
        };
        assert!(confirmed(51));
        assert!(!confirmed(49), "it may have been answered before the loss");
    }

    #[test]
    fn a_contact_that_is_closed_at_a_start_is_no_press() {
        let mut person = person();
        person.look(0, false);
        person.look(100 * MS, true);
        person.on_start(200 * MS);
        person.on_commit(2_300 * MS, OTHER);
        person.on_in_force(3_000 * MS, OTHER);
        assert!(person.finish().has("profile-unattended"));
    }
}
