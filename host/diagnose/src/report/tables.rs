//! Tables and plots of a diagnosis as HTML: what every page that shows one has in common.

use std::collections::BTreeSet;

use crate::outcome::{
    AxisFigure, Diagnosis, Effect, EffectValue, ErrorFigure, NextMeasurement, SelectionStep, Structure,
};
use maud::{Markup, html};

use super::numbers::{chance, short, shown, with_unit};
use super::residuals;
use crate::prepare::sampling::usual_step_s;
use crate::select::significance::DISCOVERY_LEVEL;

/// Outliers that are listed by line.
const MAX_LINES: usize = 40;
/// Effects of each step of the selection that are listed.
const MAX_TRIED: usize = 8;

/// Effects, errors, plots and what was tried.
pub fn tables_and_plots(d: &Diagnosis) -> Markup {
    let unit = d.error.before.train.norm.unit;
    html! {
        (effects_table(d))
        (errors_table(d))
        (rest(d))
        (residuals::plots(d))
        (depends(d))
        h3 { "Selection path" }
        p { "Cross-validated error with each effect added; the best of each step, of all that were tried." }
        (selection_path(d, unit))
    }
}

/// What was measured: rows, times, what was held out, and how well the measurement repeats.
pub fn sampling_table(d: &Diagnosis) -> Markup {
    let mut times: Vec<f64> = d.points.iter().map(|point| point.time_s).collect();
    times.sort_by(f64::total_cmp);
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    // Of many rows the points are one in several.
    let every = ((d.rows.train + d.rows.held_out) as f64 / times.len().max(1) as f64).round().max(1.0);
    let (step_s, over_s) =
        (usual_step_s(&steps) / every, times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first));
    let visits = d.points.iter().filter_map(|point| point.visit.as_ref());
    let words: BTreeSet<&str> = visits.map(|visit| &visit.word[..]).collect();
    let noise = d.repeatability.as_ref().map_or("not measured".to_owned(), |r| {
        format!("{}, {} degrees of freedom", with_unit(r.norm.value, r.norm.unit), r.dof)
    });
    html! {
        table {
            tbody {
                tr { th scope="row" { "Measured" } td { (d.kind) } }
                tr { th scope="row" { "Rows" } td { (d.rows.train) " fitted, " (d.rows.held_out) " " (d.unseen()) } }
                @if !words.is_empty() { tr { th scope="row" { "Words" } td { (words.len()) " different" } } }
                @if over_s > 0.0 { tr { th scope="row" { "Time" } td { (short(over_s)) " s, usually " (short(step_s)) " s from row to row" } } }
                tr { th scope="row" { "Held out" } td { (d.held_out) } }
                tr { th scope="row" { "Cross-validated over" } td { (d.left_out) } }
                tr { th scope="row" { "Repeatability" } td { (noise) } }
                @if let Some(model) = d.model { tr { th scope="row" { "Model" } td { (model) } } }
            }
        }
    }
}

fn effects_table(d: &Diagnosis) -> Markup {
    html! {
        @if !d.effects.is_empty() {
            table {
                thead { tr { th { "effect" } th { "where" } th { "value" } th.num { "estimate" } th.num { "95 % interval" } th.num { "held-out gain" } } }
                tbody {
                    @for effect in &d.effects {
                        @for value in &effect.values {
                            tr {
                                td { b { (effect.law) } }
                                td { (effect.site.name) @if effect.site.name != effect.site.code { " (" (effect.site.code) ")" } }
                                td { (value.name) }
                                td.num { @if let Some(from) = value.nominal { (shown(value, from)) " → " } (shown(value, to(value, value.value))) }
                                td.num { @if let Some([low, high]) = value.ci95 { (shown(value, to(value, low))) " … " (shown(value, to(value, high))) } @else { "fixed" } }
                                td.num { @if let Some(gain) = &effect.held_out_gain { (with_unit(gain.value, gain.unit)) } @else { "–" } }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn errors_table(d: &Diagnosis) -> Markup {
    let rows = [
        ("before, training rows", d.rows.train, Some(&d.error.before.train)),
        ("before, held-out rows", d.rows.held_out, d.error.before.held_out.as_ref()),
        ("after, training rows", d.rows.train, Some(&d.error.after.train)),
        ("after, held-out rows", d.rows.held_out, d.error.after.held_out.as_ref()),
    ];
    html! {
        table {
            thead {
                tr {
                    th { "error, root mean square" }
                    th.num { "rows" }
                    @for axis in &d.error.before.train.axes { th.num { (axis.axis) } }
                    th.num { "norm" }
                    th.num { "largest" }
                }
            }
            tbody {
                @for (name, n, figure) in rows {
                    @if let Some(ErrorFigure { axes, norm, largest, .. }) = figure {
                        tr {
                            td { (name) }
                            td.num { (n) }
                            (cells(axes))
                            td.num { b { (with_unit(norm.value, norm.unit)) } }
                            td.num { (with_unit(largest.value, largest.unit)) }
                        }
                    }
                }
                @if let Some(r) = &d.repeatability {
                    tr.noise {
                        td { "repeatability (" (r.dof) " degrees of freedom)" }
                        td.num {}
                        (cells(&r.axes))
                        td.num { b { (with_unit(r.norm.value, r.norm.unit)) } }
                        td.num {}
                    }
                }
            }
        }
    }
}

fn cells(axes: &[AxisFigure]) -> Markup {
    html! { @for axis in axes { td.num { (with_unit(axis.value, axis.unit)) } } }
}

/// Alternatives, what to measure next, what is not identifiable, and outliers.
fn rest(d: &Diagnosis) -> Markup {
    html! {
        @if !d.alternatives.is_empty() {
            p { "Not distinguished by these data: " @for other in &d.alternatives { (other.law) " at " (other.site.name) "; " } }
        }
        @if let Some(next) = &d.next_measurement { (proposal(next)) }
        @if !d.unobservable.is_empty() { p { "Not identifiable from these data: " (d.unobservable.join("; ")) "." } }
        @if !d.outliers.is_empty() {
            p { (d.outliers.len()) " outliers: lines " @for row in d.outliers.iter().take(MAX_LINES) { (row.line) " " } @if d.outliers.len() > MAX_LINES { "…" } }
        }
    }
}

/// The words or rows to measure next.
fn proposal(next: &NextMeasurement) -> Markup {
    html! {
        h3 { "Measure next" }
        p { "To distinguish " (next.distinguishes) @if let Some(conditions) = &next.conditions { ", " (conditions) } @if !next.rows.is_empty() { "; conditions in SI units, angles in rad" } "." }
        @if !next.words.is_empty() { p { @for word in &next.words { code { (word) } " " } } }
        @if let Some(first) = next.rows.first() {
            table {
                thead { tr { th { "line" } @for name in first.conditions.keys() { th.num { (name) } } } }
                tbody { @for row in &next.rows { tr { td { (row.line) } @for value in row.conditions.values() { td.num { (short(*value)) } } } } }
            }
        }
    }
}

fn depends(d: &Diagnosis) -> Markup {
    html! {
        h3 { "What the residual correlates with" }
        div.two {
            @if let Some(before) = &d.structure { (dependences("before", before)) }
            (dependences("after", &d.remaining))
        }
        @for one in d.remaining.depends_on.iter().filter(|one| !one.curve.is_empty()) { (residuals::curve(one, &residuals::unit(d, one))) }
    }
}

fn dependences(side: &str, structure: &Structure) -> Markup {
    let has_gain = structure.depends_on.iter().any(|one| one.held_out_gain.is_some());
    html! {
        table {
            thead { tr { th { (side) } th { "axis" } th.num { "share" } th.num { "chance" } @if has_gain { th.num { "gain as a fitted term" } } } }
            tbody {
                @for one in structure.depends_on.iter().take(8) {
                    tr {
                        td { (one) }
                        td { (one.direction()) }
                        td.num { (format!("{:.0} %", 100.0 * one.share)) }
                        td.num { (one.p.map_or("–".into(), chance)) }
                        @if has_gain { td.num { (one.held_out_gain.as_ref().map_or("–".into(), |gain| with_unit(gain.value, gain.unit))) } }
                    }
                }
                @if structure.depends_on.is_empty() { tr { td colspan="4" { "nothing that was measured" } } }
            }
        }
    }
}

/// What was tried, step by step, the best of each step, and why it was kept or rejected.
fn selection_path(d: &Diagnosis, unit: &'static str) -> Markup {
    let path = &d.selection_path;
    let worst = path.iter().map(|tried| tried.without).fold(f64::MIN_POSITIVE, f64::max);
    let steps: BTreeSet<usize> = path.iter().map(|tried| tried.step).collect();
    html! {
        @for (number, step) in steps.iter().enumerate() {
            @let tried: Vec<&SelectionStep> = path.iter().filter(|tried| tried.step == *step).collect();
            h4 { "step " (number + 1) ", " (tried.len()) " tried; without any " (tried.first().map_or(String::new(), |first| with_unit(first.without, unit))) }
            table.candidates {
                thead { tr { th { "effect" } th { "where" } th.num { "error" } th {} th { "outcome" } } }
                tbody {
                    @for tried in tried.iter().take(MAX_TRIED) {
                        tr.kept[tried.kept] {
                            td { (tried.candidate.law) }
                            td { (tried.candidate.text) }
                            td.num { (with_unit(tried.cross_validated, unit)) }
                            td.share { (bar(tried.cross_validated / worst)) }
                            td.reason { (reason(d, tried)) }
                        }
                    }
                }
            }
        }
    }
}

/// A share of 1 as a bar. Attributes, not a style: pages of a server forbid styles that are not in a file.
fn bar(share: f64) -> Markup {
    let width = format!("{:.1}", 100.0 * share.min(1.0));
    html! { svg viewBox="0 0 100 9" preserveAspectRatio="none" aria-hidden="true" { rect width=(width) height="9" {} } }
}

/// Why an effect that was tried is in the model or not.
fn reason(d: &Diagnosis, tried: &SelectionStep) -> String {
    let p = chance(tried.p);
    let is_named = || {
        let named =
            |effect: &Effect| effect.law == tried.candidate.law && tried.candidate.places.contains(&effect.site.place);
        d.effects.iter().any(named)
    };
    if tried.kept {
        let later = if is_named() { "" } else { ", but not named in the end" };
        return format!("kept: p {p}{later}");
    }
    if tried.cross_validated >= tried.without {
        "rejected: predicts rows left out no better".into()
    } else if tried.p >= DISCOVERY_LEVEL {
        format!("rejected: the gain may be chance, p {p}, limit {}", chance(DISCOVERY_LEVEL))
    } else {
        format!("rejected: p {p}, and another effect predicts rows left out better")
    }
}

/// What the model has after a change; other values as they are.
fn to(value: &EffectValue, size: f64) -> f64 {
    value.nominal.map_or(size, |from| from + size)
}
