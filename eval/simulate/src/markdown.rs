//! The results as Markdown tables for `docs/simulation.md`.

use std::fmt::Write as _;

use darm_figures::figure::Figure;

use crate::mutants::Caught;
use crate::script::LOSSES;

/// The head of the table of mutants.
pub const MUTANTS: &str = "| mutant | rules | first seed | seeds caught |\n| --- | --- | --- | --- |";

/// The line of one mutant.
pub fn mutant(name: &str, caught: &Caught) -> String {
    let rules: Vec<String> = caught.rules().iter().map(|(rule, _)| format!("`{rule}`")).collect();
    let seeds = caught.seeds();
    match seeds.first() {
        Some(first) => format!("| `{name}` | {} | {first} | {} of {} |", rules.join(", "), seeds.len(), caught.ran),
        None => format!("| `{name}` | not caught | | 0 of {} |", caught.ran),
    }
}

/// What was injected with the recovery from it, and the uploads against the loss of the line.
pub fn figures(rows: &[Figure]) -> String {
    let value = |name: &str| rows.iter().find(|row| row.name == name).map(|row| row.value);
    let mut text =
        String::from("| injected | times | recoveries | median | longest |\n| --- | --- | --- | --- | --- |\n");
    for row in rows {
        let Some(kind) = row.name.strip_prefix("injected: ") else { continue };
        let of = |what: &str| value(&format!("recovered after {kind}{what}"));
        let recovery = match (of(""), of(", median"), of(", longest")) {
            (Some(count), Some(median), Some(longest)) => {
                format!("{count} | {median} ms | {:.1} s", 1e-3 * longest)
            }
            _ => "| |".into(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {kind} | {} | {recovery} |", row.value);
    }
    text.push_str("\n| loss | uploads completed | in one call | mean time |\n| --- | --- | --- | --- |\n");
    for loss in LOSSES {
        let of = |what: &str| value(&format!("{what} at {loss} % loss"));
        let at_once = value(&format!("uploads completed at {loss} % loss in one call"));
        let mean_s = value(&format!("upload at {loss} % loss, mean"));
        if let (Some(completed), Some(at_once), Some(mean_s)) = (of("uploads completed"), at_once, mean_s) {
            let _ = writeln!(text, "| {loss} % | {completed:.1} % | {at_once:.1} % | {mean_s:.2} s |");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{figures, mutant};
    use crate::mutants::{Broken, Caught};
    use darm_figures::figure::Figure;

    #[test]
    fn a_mutant_is_one_line() {
        let broken = |seed, rule: &str| Broken { seed, rule: rule.into() };
        let caught = Caught { ran: 20, broken: vec![broken(3, "duty"), broken(3, "wiring"), broken(9, "duty")] };
        assert_eq!(mutant("a", &caught), "| `a` | `duty`, `wiring` | 3 | 2 of 20 |");
        assert_eq!(mutant("b", &Caught { ran: 5, broken: Vec::new() }), "| `b` | not caught | | 0 of 5 |");
    }

    #[test]
    fn a_disturbance_is_beside_its_recovery() {
        let rows = [
            ("injected: reset", 4.0),
            ("recovered after reset", 3.0),
            ("recovered after reset, median", 12.0),
            ("recovered after reset, longest", 2500.0),
            ("injected: piece lost", 7.0),
        ];
        let text = figures(&rows.map(|(name, value)| Figure::new(name, value, "").unwrap()));
        assert!(text.contains("| reset | 4 | 3 | 12 ms | 2.5 s |\n| piece lost | 7 | | | |\n"), "{text}");
    }
}
