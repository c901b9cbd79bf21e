//! The plots of a diagnosis: errors of words and against suspects, residuals of signals along the rows.

use darm_diagnose::outcome::{Dependence, Diagnosis, Point, Visit};
use maud::{Markup, html};

use super::numbers::short;
use super::plots;

/// Width and height of a plot of signals.
const PLOT: (f64, f64) = (860.0, 180.0);
/// Points of one plot at most.
const MAX_POINTS: usize = 800;

/// All plots: of the visits of an arm, or of signals axis by axis.
pub(super) fn plots(d: &Diagnosis) -> Markup {
    match d.points.first().and_then(|point| point.visit.as_ref()) {
        Some(first) => of_visits(d, first),
        None => html! {
            h3 { "Residuals along the rows" }
            p.legend { span.before { "●" } " before " span.after { "●" } " after · filled: held-out rows" }
            @for (axis, figure) in d.error.before.train.axes.iter().enumerate() {
                h4 { (figure.axis) ", " (figure.unit) }
                (along_rows(&d.points, axis))
            }
        },
    }
}

fn of_visits(d: &Diagnosis, first: &Visit) -> Markup {
    html! {
        h3 { "Error of each word" }
        p.legend {
            span.before { "●" } @if let Some(model) = d.model { " model " (model) " " }
            span.after { "●" } " with the effects found "
            span.noise { "━" } " repeatability · filled: held-out words"
        }
        (plots::by_word(d))
        h3 { "Error against each suspect" }
        div.plots { @for plot in suspects(d, first) { div { (plot) } } }
    }
}

fn suspects(d: &Diagnosis, first: &Visit) -> Vec<Markup> {
    let n_extended = |visit: &Visit| visit.word.chars().filter(|c| *c != '0').count() as f64;
    let mut all = vec![
        plots::over(d, "time, s", &|point, _| Some(point.time_s)),
        plots::over(d, "supply, bar", &|_, visit| visit.supply.map(|supply_pa| supply_pa / 1e5)),
        plots::over(d, "temperature, °C", &|_, visit| visit.temperature_c),
        plots::over(d, "number of actuators extended", &|_, visit| Some(n_extended(visit))),
    ];
    for k in 0..first.servos_rad.len() {
        let name = format!("position of servo {}, rad or m", k + 1);
        all.push(plots::over(d, &name, &|_, visit| visit.servos_rad.get(k).copied()));
    }
    all.into_iter().flatten().collect()
}

/// Residuals of one axis over the order of the rows.
fn along_rows(points: &[Point], axis: usize) -> Markup {
    let (width, height) = PLOT;
    let thinned: Vec<&Point> = points.iter().step_by(points.len().div_ceil(MAX_POINTS).max(1)).collect();
    let at = |values: &[f64]| values.get(axis).copied().unwrap_or(0.0);
    let largest = thinned.iter().map(|p| at(&p.before).abs().max(at(&p.after).abs())).fold(f64::MIN_POSITIVE, f64::max);
    let place =
        |k: usize, value: f64| (width * k as f64 / thinned.len().max(1) as f64, 0.5 * height * (1.0 - value / largest));
    let mark = |k: usize, value: f64, color: &str, filled: bool| {
        let (x, y) = place(k, value);
        html! { circle cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="2" stroke=(color) fill=(if filled { color } else { "none" }) {} }
    };
    html! {
        svg role="img" viewBox=(format!("0 0 {width} {height}")) {
            line x1="0" x2=(width) y1=(0.5 * height) y2=(0.5 * height) stroke="#7a868f" {}
            @for (k, point) in thinned.iter().enumerate() {
                (mark(k, at(&point.before), "#d15b2c", point.held_out))
                (mark(k, at(&point.after), "#1f6f8b", point.held_out))
            }
            text x="4" y="14" font-size="12" { "± " (short(largest)) }
        }
    }
}

/// What remains of an axis along a signal.
pub(super) fn curve(one: &Dependence) -> Markup {
    let (width, height) = PLOT;
    let ends = |k: usize| {
        let of = one.curve.iter().map(|point| point[k]);
        of.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), number| (low.min(number), high.max(number)))
    };
    let ((left, right), (low, high)) = (ends(0), ends(1));
    let share = |number: f64, low: f64, high: f64| (number - low) / (high - low).max(f64::MIN_POSITIVE);
    let place = |[x, y]: &[f64; 2]| {
        format!("{:.1},{:.1} ", width * share(*x, left, right), height * (1.0 - share(*y, low, high)))
    };
    html! {
        svg role="img" viewBox=(format!("0 0 {width} {height}")) {
            polyline points=(one.curve.iter().map(place).collect::<String>()) fill="none" stroke="#1f6f8b" stroke-width="2" {}
        }
        p.sub {
            @if let Some(axis) = &one.axis { (axis) ": " }
            (one) " from " (short(left)) " to " (short(right)) " (SI units, rad), residual from " (short(low)) " to " (short(high))
        }
    }
}
