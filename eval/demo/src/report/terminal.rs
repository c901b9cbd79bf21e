//! The report as a table for the terminal.

use super::{LoopReport, SynthesisFigures, html::angle};
use darm_diagnose::outcome::Verdict;

/// The lines of the table, without colour.
pub(crate) fn table(report: &LoopReport) -> String {
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.into(), value));
    row("arm, board, seed", format!("{}, {}, seed {}", report.arm, report.board, report.seed));
    if let Some(figures) = &report.synthesis {
        synthesis(figures, &mut row);
    }
    row("measurement plan", measurement_plan(report));
    diagnosis(report, &mut row);
    for closure in &report.closures {
        let met = if closure.after_m <= closure.goal_m { "met" } else { "NOT met" };
        let (before, after, goal) = (mm(closure.before_m), mm(closure.after_m), mm(closure.goal_m));
        row(&closure.name, format!("error at the desired frames {before} -> {after}, goal {goal}: {met}"));
    }
    row("time", format!("{:.0} s", report.time_s));
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    rows.iter().map(|(name, value)| format!("  {name:width$}  {value}\n")).collect()
}

fn synthesis(synthesis: &SynthesisFigures, row: &mut impl FnMut(&str, String)) {
    let (error_m, error_rad) = synthesis.largest();
    let ours = format!(
        "{error_m:.0e} m, {}, {:.3} s, {} steps ({})",
        angle(error_rad),
        synthesis.time_s,
        synthesis.iterations,
        synthesis.case
    );
    row("synthesis", ours);
    let paper = &synthesis.paper;
    row(
        "  printed in the paper",
        format!("{:.0e} m, {}, {:.0} s", paper.error_m, angle(paper.error_rad), paper.time_s),
    );
    if let Some(here) = &synthesis.paper_method {
        let figures = format!("{:.0e} m, {}, {:.2} s", here.error_m, angle(here.error_rad), here.time_s);
        row("  paper's method, ours", figures);
    }
}

fn measurement_plan(report: &LoopReport) -> String {
    let p = &report.plan;
    format!(
        "{} words, {} held out, {} rows with {} exact repeats, played in {:.0} s",
        p.words, p.held_out, p.rows, p.repeats, p.time_s
    )
}

fn diagnosis(report: &LoopReport, row: &mut impl FnMut(&str, String)) {
    let diagnosis = &report.diagnosis;
    row("verdict", diagnosis.verdict.to_string());
    for effect in &diagnosis.effects {
        let values: Vec<String> = effect
            .values
            .iter()
            .map(|v| {
                let interval = v.ci95.map_or(String::new(), |[low, high]| format!(" [{low:.4e}, {high:.4e}]"));
                format!("{} {:.4e} {}{interval}", v.name, v.value, v.unit)
            })
            .collect();
        row(
            "  effect",
            format!("{} at {} ({}): {}", effect.law, effect.site.code, effect.site.name, values.join(", ")),
        );
    }
    if let Some(truth) = &report.truth {
        let right = match report.named_rightly() {
            Some(true) => "named correctly",
            _ => "NOT named correctly",
        };
        let what =
            if truth.place.is_empty() { truth.effect.into() } else { format!("{} at {}", truth.effect, truth.place) };
        row("  injected effect", format!("{what}: {right}"));
    }
    if let (Some(before), Some(after)) = (&diagnosis.error.before.held_out, &diagnosis.error.after.held_out) {
        let repeats = diagnosis.repeatability.as_ref().map_or(String::new(), |r| {
            let ratio = after.norm.value / r.norm.value;
            format!(", repeatability {} ({ratio:.2} x)", mm(r.norm.value))
        });
        row("  held-out error", format!("{} -> {}{repeats}", mm(before.norm.value), mm(after.norm.value)));
    }
    if diagnosis.verdict == Verdict::NotIdentifiable {
        let all: Vec<String> = diagnosis.alternatives.iter().map(|a| format!("{} at {}", a.law, a.site.code)).collect();
        row("  candidates", all.join("; "));
    }
}

fn mm(length_m: f64) -> String {
    format!("{:.3} mm", length_m * 1e3)
}
