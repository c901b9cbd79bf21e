//! Judge 2: what the host reports against what the board holds and does.

use super::Verdict;

const JUDGE: &str = "reports";

/// How a request ended for the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The board confirmed.
    Done,
    /// The board refused.
    Refused,
    /// No answer came, or none that can be read: it may have acted or not.
    Unknown,
}

/// A table as the judge knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownTable {
    /// The number that names it; all tables of a run differ in it.
    pub model: u64,
    /// Its bytes.
    pub image: Vec<u8>,
    /// Digits of the word of each row.
    pub words: Vec<String>,
}

/// A command with one physical effect, a pulse of one line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// What the host reported.
    pub ending: Ending,
    /// How often the line went on since the command was first sent.
    pub rises: u32,
    /// How often lines of other coils have.
    pub others: u32,
    /// The longest time that the line was on since then, ns.
    pub on_ns: u64,
    /// The time for which it was commanded, and what a pulse may be late, ns.
    pub allowed_ns: u64,
    /// Nothing else disturbed the board since before the command.
    pub undisturbed: bool,
}

/// The judge's memory.
#[derive(Default)]
pub struct Reports {
    known: Vec<KnownTable>,
    /// What may be loaded: the models, `None` for no table.
    allowed: Vec<Option<u64>>,
    /// What might be loaded before an upload was confirmed, and when that was, ns: a late answer may still name it.
    replaced: Vec<(Option<u64>, u64)>,
    verdict: Verdict,
}

impl Reports {
    /// A board without a table.
    pub fn new() -> Self {
        Self { allowed: vec![None], ..Self::default() }
    }

    /// A table that somebody may upload.
    pub fn know(&mut self, table: KnownTable) {
        if self.known.iter().all(|known| known.model != table.model) {
            self.known.push(table);
        }
    }

    /// An upload ended. `concurrent`: tables that others may have committed since it began.
    pub fn on_upload(&mut self, now_ns: u64, model: u64, ending: Ending, concurrent: &[u64]) {
        match ending {
            Ending::Done => {
                let allowed = std::iter::once(&model).chain(concurrent).map(|&model| Some(model)).collect();
                let before = std::mem::replace(&mut self.allowed, allowed);
                self.replaced.extend(before.into_iter().map(|model| (model, now_ns)));
            }
            Ending::Unknown if !self.allowed.contains(&Some(model)) => self.allowed.push(Some(model)),
            Ending::Unknown | Ending::Refused => {}
        }
    }

    /// The board says which table is loaded, to a host that asked at `asked_ns`. `holds` says whether flash holds all
    /// bytes of an image.
    pub fn on_loaded(
        &mut self,
        now_ns: u64,
        asked_ns: u64,
        model: Option<u64>,
        rows: u16,
        holds: impl Fn(&[u8]) -> bool,
    ) {
        if !self.allowed.contains(&model) {
            if self.replaced.iter().any(|&(before, replaced_ns)| before == model && asked_ns <= replaced_ns) {
                return;
            }
            let allowed = &self.allowed;
            self.verdict.note(JUDGE, "table", now_ns, || {
                format!(
                    "the loaded table is {}, it may be {}",
                    name(model),
                    allowed.iter().map(|m| name(*m)).collect::<Vec<_>>().join(" or ")
                )
            });
            return;
        }
        let Some(table) = self.known.iter().find(|table| Some(table.model) == model) else { return };
        if usize::from(rows) != table.words.len() {
            self.verdict.note(JUDGE, "mixed-table", now_ns, || {
                format!("table {} has {rows} rows, uploaded were {}", name(model), table.words.len())
            });
        }
        if !holds(&table.image) {
            self.verdict
                .note(JUDGE, "mixed-table", now_ns, || format!("flash does not hold all of table {}", name(model)));
        }
    }

    /// A row ran.
    pub fn on_row(&mut self, now_ns: u64, row: u16, word: &str) {
        let fits = |model: &Option<u64>| {
            let table = self.known.iter().find(|table| Some(table.model) == *model);
            table.is_some_and(|table| table.words.get(usize::from(row)).is_some_and(|known| known == word))
        };
        if !self.known.iter().any(|table| fits(&Some(table.model))) {
            self.verdict
                .note(JUDGE, "mixed-table", now_ns, || format!("row {row} ran with word {word}, which no table has"));
        }
    }

    /// A program ended at a row because an output was on for longer than its limit allows.
    pub fn on_limit_in_program(&mut self, now_ns: u64, row: u16, kind: &str) {
        self.verdict.note(JUDGE, "limit-in-program", now_ns, || {
            format!("a program was let begin and row {row} breaks a limit: {kind}")
        });
    }

    /// A command with one pulse was sent.
    pub fn on_pulse(&mut self, now_ns: u64, pulse: Pulse) {
        let Pulse { ending, rises, others, on_ns, allowed_ns, undisturbed } = pulse;
        if others > 0 {
            self.verdict.note(JUDGE, "other-lines", now_ns, || {
                format!("a command for one output let lines of others go high, {others} times")
            });
        }
        self.on_pulse_length(now_ns, on_ns, allowed_ns);
        if rises > 1 {
            self.verdict.note(JUDGE, "acts-at-most-once", now_ns, || {
                format!("a command that ended {ending:?} acted {rises} times")
            });
        } else if rises == 1 && ending == Ending::Refused {
            self.verdict
                .note(JUDGE, "refused-and-acted", now_ns, || "a command was reported as refused and acted".into());
        } else if rises == 0 && ending == Ending::Done && undisturbed {
            self.verdict.note(JUDGE, "acts-once", now_ns, || "a command was confirmed and did not act".into());
        }
    }

    /// By a command that allows the one time its line was on for the other.
    pub fn on_pulse_length(&mut self, now_ns: u64, on_ns: u64, allowed_ns: u64) {
        if on_ns > allowed_ns {
            self.verdict.note(JUDGE, "pulse-length", now_ns, || {
                let [on_ms, allowed_ms] = [on_ns, allowed_ns].map(|ns| ns / 1_000_000);
                format!("a line was on for {on_ms} ms by a command that allows {allowed_ms}")
            });
        }
    }

    /// A command that no state of the arm obeys was confirmed.
    pub fn on_impossible_confirmed(&mut self, now_ns: u64, command: &str) {
        self.verdict.note(JUDGE, "impossible-confirmed", now_ns, || format!("the board confirmed {command}"));
    }

    /// Commands by hand for the two coils of an actuator brought it to a state that it does not have.
    pub fn on_no_such_state(&mut self, now_ns: u64, actuator: usize, ending: Ending) {
        self.verdict.note(JUDGE, "no-such-state", now_ns, || {
            format!("a coil by hand, {ending:?}, brought actuator {actuator} to a state that it does not have")
        });
    }

    /// A command was confirmed on a connection that was opened before a confirmed stop.
    pub fn on_command_after_stop(&mut self, now_ns: u64) {
        self.verdict
            .note(JUDGE, "acts-after-stop", now_ns, || "the board confirmed a command from before a stop".into());
    }

    /// A command was confirmed, and all the time since before it was sent this servo was silent for longer than it may.
    pub fn on_accepted_while_silent(&mut self, now_ns: u64, servo: usize, command: &str) {
        self.verdict.note(JUDGE, "accepted-while-silent", now_ns, || {
            format!("the board confirmed {command}, and servo {servo} does not answer")
        });
    }

    /// A command was confirmed although a servo has not taken the order before it for longer than it may.
    pub fn on_accepted_while_stubborn(&mut self, now_ns: u64, order: &str, command: &str) {
        self.verdict.note(JUDGE, "accepted-while-stubborn", now_ns, || {
            format!("the board confirmed {command}, and a servo takes no order since {order}")
        });
    }

    /// The board may have no table: its records are damaged.
    pub fn on_store_damaged(&mut self) {
        if !self.allowed.contains(&None) {
            self.allowed.push(None);
        }
    }

    /// Lines of a program stay on after the end that the board reports of it.
    pub fn on_lines_after_end(&mut self, now_ns: u64, lines: u64) {
        self.verdict
            .note(JUDGE, "end-lines", now_ns, || format!("the lines {lines:#x} stay on after the end of a program"));
    }

    /// Lines are on, this time after a stop that came in one piece with commands before it. Nobody has sent anything
    /// since.
    pub fn on_lines_after_burst(&mut self, now_ns: u64, after_ns: u64, lines: u64) {
        self.verdict.note(JUDGE, "acts-after-stop", now_ns, || {
            let after_ms = after_ns / 1_000_000;
            format!(
                "the lines {lines:#x} are on {after_ms} ms after a stop, by a command or a connection from before it"
            )
        });
    }

    /// Commands of coils whose times have passed, and the lines that are still on. Nothing else acted meanwhile.
    pub fn on_pulses_over(&mut self, now_ns: u64, lines: u64) {
        if lines != 0 {
            self.verdict.note(JUDGE, "pulse-length", now_ns, || {
                format!("the lines {lines:#x} are on after the times for which they were commanded")
            });
        }
    }

    /// A restart was confirmed while these lines were on.
    pub fn on_restart_under_way(&mut self, now_ns: u64, lines: u64) {
        self.verdict.note(JUDGE, "restart-under-way", now_ns, || {
            format!("the board confirmed a restart while the lines {lines:#x} were on")
        });
    }

    /// A stop was confirmed: these lines are on, this servo is on its way.
    pub fn on_stopped(&mut self, now_ns: u64, lines: u64, moving: Option<(u8, u16)>) {
        if lines != 0 {
            self.verdict
                .note(JUDGE, "stop-lines", now_ns, || format!("a stop was confirmed and the lines {lines:#x} are on"));
        }
        if let Some((id, steps)) = moving {
            self.verdict.note(JUDGE, "stop-servos", now_ns, || {
                format!("a stop was confirmed and servo {id} is driven on to a goal {steps} steps away")
            });
        }
    }

    /// A request went unanswered though the board was undisturbed and the line lost nothing.
    pub fn on_unanswered(&mut self, now_ns: u64, request: &str, error: &str) {
        self.verdict.note(JUDGE, "unanswered", now_ns, || {
            format!("`{request}` got no answer from an undisturbed board on a good line: {error}")
        });
    }

    /// An upload over a line of this loss did not complete, however often it was tried.
    pub fn on_incomplete(&mut self, now_ns: u64, loss_percent: u32, error: &str) {
        self.verdict.note(JUDGE, "upload-incomplete", now_ns, || {
            format!("an upload at {loss_percent} % loss did not complete: {error}")
        });
    }

    /// The flash was written where it was not erased.
    pub fn on_overwrites(&mut self, now_ns: u64, count: u32) {
        if count > 0 {
            self.verdict.note(JUDGE, "flash-overwrite", now_ns, || {
                format!("{count} words of flash were written without an erase")
            });
        }
    }

    /// The host's own code panicked.
    pub fn on_host_panic(&mut self, now_ns: u64, message: &str) {
        self.verdict.note(JUDGE, "host-panic", now_ns, || format!("the host panicked: {message}"));
    }

    /// The end of the run.
    pub fn finish(self) -> Verdict {
        self.verdict
    }
}

fn name(model: Option<u64>) -> String {
    model.map_or("none".into(), |model| format!("{model:x}"))
}

#[cfg(test)]
mod tests {
    use super::{Ending, KnownTable, Pulse, Reports};

    fn judge() -> Reports {
        let mut judge = Reports::new();
        for model in [1, 2] {
            judge.know(KnownTable { model, image: vec![model as u8], words: vec!["01".into(); model as usize] });
        }
        judge
    }

    #[test]
    fn the_last_confirmed_table_or_a_later_one_of_unknown_ending() {
        let loaded = |endings: &[(u64, Ending)], model, rows| {
            let mut judge = judge();
            endings.iter().for_each(|&(model, ending)| judge.on_upload(5, model, ending, &[]));
            judge.on_loaded(9, 9, model, rows, |_| true);
            judge.finish().firsts().iter().map(|(first, _)| first.rule).collect::<Vec<_>>()
        };
        assert!(loaded(&[], None, 0).is_empty());
        assert_eq!(loaded(&[(1, Ending::Done)], None, 0), ["table"]);
        assert!(loaded(&[(1, Ending::Done), (2, Ending::Unknown)], Some(2), 2).is_empty());
        assert!(loaded(&[(1, Ending::Done), (2, Ending::Unknown)], Some(1), 1).is_empty());
        assert_eq!(loaded(&[(1, Ending::Done), (2, Ending::Refused)], Some(2), 2), ["table"]);
        assert_eq!(loaded(&[(1, Ending::Done)], Some(1), 2), ["mixed-table"]);
    }

    #[test]
    fn the_table_of_another_host_that_committed_meanwhile() {
        let loaded = |concurrent: &[u64], asked_ns, model| {
            let mut judge = judge();
            judge.on_upload(5, 1, Ending::Done, concurrent);
            judge.on_loaded(9, asked_ns, model, model.unwrap_or(0) as u16, |_| true);
            judge.finish().has("table")
        };
        assert!(loaded(&[], 9, Some(2)));
        assert!(!loaded(&[2], 9, Some(2)));
        assert!(loaded(&[], 9, None), "asked after the upload was confirmed");
        assert!(!loaded(&[], 4, None), "asked before");
    }

    #[test]
    fn an_impossible_command_and_lines_after_a_burst_are_seen() {
        let mut judge = judge();
        judge.on_impossible_confirmed(1, "a word of nine digits");
        judge.on_lines_after_burst(2, 4_000_000, 0x10);
        let verdict = judge.finish();
        assert!(verdict.has("impossible-confirmed") && verdict.has("acts-after-stop"));
        assert!(verdict.firsts()[1].0.sentence.contains("0x10 are on 4 ms after"));
    }

    #[test]
    fn a_confirmed_command_acts_once() {
        let rule = |ending, rises, undisturbed| {
            let mut judge = judge();
            judge.on_pulse(0, Pulse { ending, rises, others: 0, on_ns: 33, allowed_ns: 33, undisturbed });
            judge.finish().firsts().first().map(|(first, _)| first.rule)
        };
        assert_eq!(rule(Ending::Done, 1, true), None);
        assert_eq!(rule(Ending::Done, 2, false), Some("acts-at-most-once"));
        assert_eq!(rule(Ending::Done, 0, true), Some("acts-once"));
        assert_eq!(rule(Ending::Done, 0, false), None);
        assert_eq!(rule(Ending::Refused, 1, true), Some("refused-and-acted"));
        assert_eq!(rule(Ending::Unknown, 1, true), None);
    }

    #[test]
    fn a_command_that_acts_for_too_long_is_seen_however_it_ended() {
        for ending in [Ending::Done, Ending::Unknown] {
            let mut judge = judge();
            judge.on_pulse(0, Pulse { ending, rises: 1, others: 0, on_ns: 34, allowed_ns: 33, undisturbed: false });
            assert!(judge.finish().has("pulse-length"), "{ending:?}");
        }
    }

    #[test]
    fn a_command_that_lets_lines_of_other_outputs_go_high_is_seen() {
        let mut judge = judge();
        let ending = Ending::Done;
        judge.on_pulse(0, Pulse { ending, rises: 1, others: 1, on_ns: 33, allowed_ns: 33, undisturbed: false });
        assert!(judge.finish().has("other-lines"));
    }
}
