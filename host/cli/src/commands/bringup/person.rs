//! The person at the terminal: gives consent and says what moved.

use darm_device::bringup::{Consent, Look, Operator, Step};

use crate::interrupt::InterruptHandler;
use crate::question::ask;

/// A person who is asked on standard error and answers on standard input, or nobody.
pub(super) struct Person {
    interrupt: InterruptHandler,
    /// Consent was given for all, and nobody looks.
    yes: bool,
}

impl Person {
    pub(super) fn new(interrupt: InterruptHandler, yes: bool) -> Self {
        Self { interrupt, yes }
    }
}

/// What a person answered to the question what moved; `None` where it is not an answer.
fn look(answer: &str, step: &Step<'_>) -> Option<Look> {
    match answer {
        "" => Some(Look::Moved(vec![step.actuator])),
        "n" | "nothing" => Some(Look::Moved(Vec::new())),
        "r" | "again" => Some(Look::Again),
        "?" => Some(Look::Nobody),
        numbers => {
            let split = numbers.split([',', ' ']).filter(|number| !number.is_empty());
            let mut moved: Vec<usize> = split.map(str::parse).collect::<Result<_, _>>().ok()?;
            moved.sort_unstable();
            moved.dedup();
            let all_exist = moved.iter().all(|&actuator| actuator < step.subject.names.len());
            all_exist.then_some(Look::Moved(moved))
        }
    }
}

impl Operator for Person {
    fn consent(&mut self, step: &Step<'_>) -> Consent {
        if self.yes {
            return Consent::Go;
        }
        let Step { subject, output, actuator, state, on_ms } = step;
        eprintln!(
            "\noutput {output}: {} to state {state} for {:.2} s, then back",
            subject.name(*actuator),
            1e-3 * f64::from(*on_ms)
        );
        loop {
            match ask("  Enter: switch it on   s: skip   q: end").as_deref() {
                Some("" | "y" | "yes") => return Consent::Go,
                Some("s" | "skip") => return Consent::Skip,
                None | Some("q" | "quit") => return Consent::Quit,
                Some(_) => {}
            }
        }
    }

    fn moved(&mut self, step: &Step<'_>) -> Look {
        if self.yes {
            return Look::Nobody;
        }
        let question = format!(
            "  what moved? Enter: actuator {} alone   n: nothing   0,3: these actuators   r: again   ?: did not look",
            step.actuator
        );
        loop {
            let Some(answer) = ask(&question) else { return Look::Nobody };
            if let Some(look) = look(&answer, step) {
                return look;
            }
            eprintln!("  actuators are numbered from 0 to {}", step.subject.names.len().saturating_sub(1));
        }
    }

    fn in_state(&mut self, step: &Step<'_>) -> Option<bool> {
        if self.yes {
            return None;
        }
        let question = format!(
            "  its switch shows the opposite. While the output was on: was it in state {}? y, n, ?",
            step.state
        );
        match ask(&question).as_deref() {
            Some("y" | "yes") => Some(true),
            Some("n" | "no") => Some(false),
            _ => None,
        }
    }

    fn emergency_stop(&mut self, pressed: bool) -> bool {
        if self.yes {
            return false;
        }
        if !pressed {
            eprintln!("  now release it");
            return true;
        }
        let answer = ask("\nemergency stop: Enter, then press it within 20 s   s: skip");
        !matches!(answer.as_deref(), None | Some("s" | "skip"))
    }

    fn waiting(&mut self, output: u8, wait_ms: u32) {
        if !self.yes {
            let wait_s = wait_ms.div_ceil(1000);
            eprintln!("  output {output} recovers within its limits: waiting for at most {wait_s} s");
        }
    }

    fn is_interrupted(&mut self) -> bool {
        self.interrupt.is_requested()
    }
}

#[cfg(test)]
mod tests {
    use darm_core::output::Wiring;
    use darm_device::bringup::{Look, Step, Subject};

    use super::look;

    #[test]
    fn answers_name_what_moved() {
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        let subject = Subject { wiring: Wiring::default(), names, emergency_stop: None };
        let step = Step { subject: &subject, output: 4, actuator: 1, state: 1, on_ms: 300 };
        let cases = [
            ("", Some(Look::Moved(vec![1]))),
            ("n", Some(Look::Moved(vec![]))),
            ("2, 0,2", Some(Look::Moved(vec![0, 2]))),
            ("r", Some(Look::Again)),
            ("?", Some(Look::Nobody)),
            ("3", None),
            ("what", None),
        ];
        for (answer, expected) in cases {
            assert_eq!(look(answer, &step), expected, "{answer}");
        }
    }
}
