//! The report of a diagnosis of channels: one page with everything in it.

use maud::{Markup, html};

use super::diagnosis::ladder;
use super::skeleton::skeleton;
use darm_diagnose::outcome_signals::{Diagnosis, Errors, NextMeasurement, Parameter, Point, Term};

/// Width and height of a plot.
const PLOT: (f64, f64) = (860.0, 180.0);
/// Points of one plot at most.
const MOST_POINTS: usize = 800;

/// The whole page.
pub fn channels_page(diagnosis: &Diagnosis) -> Markup {
    let body = html! {
        header {
            h1 { "What the model lacks" }
            p.sub { (diagnosis.kind) " · " (diagnosis.verdict) " · held out: " (diagnosis.held_out) " · left out together: " (diagnosis.left_out) }
        }
        section { h2 { "Error before and after" } (errors(diagnosis)) }
        section { h2 { "Effects" } (effects(diagnosis)) (rest(diagnosis)) }
        section {
            h2 { "Residuals along the rows" }
            p { "Orange before, blue after; held-out rows are filled." }
            @for (axis, figure) in diagnosis.error.before.train.axes.iter().enumerate() {
                h4 { (figure.axis) ", " (figure.unit) }
                (plot(&diagnosis.points, axis))
            }
        }
        section { h2 { "What was tried" } (ladder(&diagnosis.ladder, &short)) }
        footer { "darm " (diagnosis.version) }
    };
    skeleton(diagnosis.kind, &body)
}

fn errors(diagnosis: &Diagnosis) -> Markup {
    let row = |name: &str, rows: usize, of: &dyn Fn(&Errors) -> Option<Vec<f64>>| {
        let (before, after) = (of(&diagnosis.error.before), of(&diagnosis.error.after));
        html! {
            @for (when, numbers) in [("before", before), ("after", after)] {
                @if let Some(numbers) = numbers {
                    tr { td { (name) " (" (rows) " rows), " (when) } @for number in numbers { td.num { (short(number)) } } }
                }
            }
        }
    };
    let numbers = |figure: &darm_diagnose::outcome_signals::Figure| -> Vec<f64> {
        figure.axes.iter().map(|axis| axis.value).chain([figure.norm.value]).collect()
    };
    let figure = &diagnosis.error.before.train;
    html! {
        table {
            thead { tr { th { "RMS" } @for axis in &figure.axes { th.num { (axis.axis) ", " (axis.unit) } } th.num { "norm, " (figure.norm.unit) } } }
            tbody {
                (row("fitted", diagnosis.rows.train, &|errors| Some(numbers(&errors.train))))
                (row("held out", diagnosis.rows.heldout, &|errors| errors.heldout.as_ref().map(numbers)))
            }
        }
    }
}

fn effects(diagnosis: &Diagnosis) -> Markup {
    let interval = |parameter: &Parameter| match parameter.ci95 {
        Some([low, high]) => {
            format!("{} ({} to {}) {}", short(parameter.value), short(low), short(high), parameter.unit)
        }
        None => format!("{} {}", short(parameter.value), parameter.unit),
    };
    html! {
        table {
            thead { tr { th { "law" } th { "where" } th { "values, 95 %" } th.num { "held-out error without it" } } }
            tbody {
                @for effect in &diagnosis.effects {
                    tr {
                        td { (effect.law) }
                        td { (effect.place) }
                        td { @for parameter in &effect.parameters { (parameter.name) " " (interval(parameter)) br; } }
                        td.num { @if let Some(gain) = effect.heldout_gain { (format!("{gain:+.3e}")) } }
                    }
                }
                @if diagnosis.effects.is_empty() { tr { td colspan="4" { "none" } } }
            }
        }
    }
}

fn rest(diagnosis: &Diagnosis) -> Markup {
    html! {
        @if !diagnosis.alternatives.is_empty() { p { "These rows cannot tell apart: " @for other in &diagnosis.alternatives { (other.law) " at " (other.place) "; " } } }
        @if let Some(next) = &diagnosis.next_measurement { (proposal(next)) }
        @if !diagnosis.unobservable.is_empty() { p { "These rows do not tell: " (diagnosis.unobservable.join("; ")) "." } }
        @for term in &diagnosis.remaining {
            p { "What remains of " (term.axis) " depends on " (term.term) ": " (format!("{:.0} %", 100.0 * term.share)) }
            @if !term.curve.is_empty() { (curve(term)) }
        }
        @if !diagnosis.outliers.is_empty() { p { (diagnosis.outliers.len()) " rows fit nothing: lines " @for row in diagnosis.outliers.iter().take(40) { (row.line) " " } } }
        @for finding in &diagnosis.findings { p { (finding) } }
    }
}

/// The rows to measure once more.
fn proposal(next: &NextMeasurement) -> Markup {
    html! {
        h3 { "Measure next" }
        p { "Under the conditions of these rows, to tell " (next.tells) "." }
        table {
            thead { tr { th { "line" } @for name in next.rows.iter().take(1).flat_map(|row| row.conditions.keys()) { th.num { (name) } } } }
            tbody { @for row in &next.rows { tr { td { (row.line) } @for value in row.conditions.values() { td.num { (short(*value)) } } } } }
        }
    }
}

/// What remains of an axis along a channel.
fn curve(term: &Term) -> Markup {
    let (width, height) = PLOT;
    let ends = |k: usize| {
        let of = term.curve.iter().map(|point| point[k]);
        of.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), number| (low.min(number), high.max(number)))
    };
    let ((left, right), (low, high)) = (ends(0), ends(1));
    let share = |number: f64, low: f64, high: f64| (number - low) / (high - low).max(f64::MIN_POSITIVE);
    let place = |[x, y]: &[f64; 2]| {
        format!("{:.1},{:.1} ", width * share(*x, left, right), height * (1.0 - share(*y, low, high)))
    };
    html! {
        svg role="img" viewBox=(format!("0 0 {width} {height}")) {
            polyline points=(term.curve.iter().map(place).collect::<String>()) fill="none" stroke="#1f6f8b" stroke-width="2" {}
        }
        p.sub { (term.term) " from " (short(left)) " to " (short(right)) " (SI units, rad), upwards from " (short(low)) " to " (short(high)) }
    }
}

/// Residuals of one axis over the order of the rows.
fn plot(points: &[Point], axis: usize) -> Markup {
    let (width, height) = PLOT;
    let thinned: Vec<&Point> = points.iter().step_by(points.len().div_ceil(MOST_POINTS).max(1)).collect();
    let at = |values: &[f64]| values.get(axis).copied().unwrap_or(0.0);
    let most = thinned.iter().map(|p| at(&p.before).abs().max(at(&p.after).abs())).fold(f64::MIN_POSITIVE, f64::max);
    let place =
        |k: usize, value: f64| (width * k as f64 / thinned.len().max(1) as f64, 0.5 * height * (1.0 - value / most));
    let view = format!("0 0 {width} {height}");
    let mark = |k: usize, value: f64, color: &str, filled: bool| {
        let (x, y) = place(k, value);
        html! { circle cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="2" stroke=(color) fill=(if filled { color } else { "none" }) {} }
    };
    html! {
        svg role="img" viewBox=(view) {
            line x1="0" x2=(width) y1=(0.5 * height) y2=(0.5 * height) stroke="#7a868f" {}
            @for (k, point) in thinned.iter().enumerate() {
                (mark(k, at(&point.before), "#d15b2c", point.held_out))
                (mark(k, at(&point.after), "#1f6f8b", point.held_out))
            }
            text x="4" y="14" font-size="12" { "± " (short(most)) }
        }
    }
}

/// Four digits.
fn short(value: f64) -> String {
    if value == 0.0 || (1e-2..1e5).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.3e}") }
}
