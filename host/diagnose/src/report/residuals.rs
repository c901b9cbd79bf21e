//! The plots of a diagnosis: errors of words and against suspects, residuals of signals along the rows.

use crate::outcome::{Dependence, Diagnosis, Visit};
use maud::{Markup, html};

use super::numbers::short;
use super::plots;

/// All plots: of the visits of an arm, or of signals axis by axis.
pub(super) fn plots(d: &Diagnosis) -> Markup {
    match d.points.first().and_then(|point| point.visit.as_ref()) {
        Some(first) => of_visits(d, first),
        None => html! {
            h3 { "Residuals along the rows" }
            p.legend { span.before { "●" } " before " span.after { "●" } " after · filled: held-out rows" }
            @for (axis, figure) in d.error.before.train.axes.iter().enumerate() {
                h4 { (figure.axis) ", " (figure.unit) }
                (plots::along_rows(&d.points, axis, &format!("residual, {}", figure.unit)))
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
        plots::over(d, "supply, bar", &|_, visit| visit.supply_pa.map(|supply_pa| supply_pa / 1e5)),
        plots::over(d, "temperature, °C", &|_, visit| visit.temperature_c),
        plots::over(d, "number of actuators extended", &|_, visit| Some(n_extended(visit))),
    ];
    for k in 0..first.servos_rad.len() {
        let name = format!("position of servo {k}, rad or m");
        all.push(plots::over(d, &name, &|_, visit| visit.servos_rad.get(k).copied()));
    }
    all.into_iter().flatten().collect()
}

/// The unit of the residual that depends on a signal; empty where several axes do.
pub(super) fn unit(d: &Diagnosis, one: &Dependence) -> String {
    let figure = d.error.before.train.axes.iter().find(|figure| Some(&figure.axis) == one.axis.as_ref());
    figure.map_or_else(String::new, |figure| format!(", {}", figure.unit))
}

/// The unit of the numbers of a signal, by its name.
fn signal_unit(name: &str) -> &'static str {
    match name {
        "time" => "s",
        "pressure" | "supply" => "Pa",
        "temperature" => "°C",
        "force" => "N",
        _ => "SI units, rad",
    }
}

/// What remains of an axis along a signal; `unit` is that of the residual, after a comma.
pub(super) fn curve(one: &Dependence, unit: &str) -> Markup {
    let ends = |k: usize| {
        let of = one.curve.iter().map(|point| point[k]);
        of.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), number| (low.min(number), high.max(number)))
    };
    let ((left, right), (low, high)) = (ends(0), ends(1));
    html! {
        (plots::along_signal(one, &format!("{one}, {}", signal_unit(&one.variable)), &format!("residual{unit}")))
        p.sub {
            @if let Some(axis) = &one.axis { (axis) ": " }
            (one) " from " (short(left)) " to " (short(right)) " " (signal_unit(&one.variable)) ", residual from " (short(low)) " to " (short(high)) (unit.replace(',', ""))
        }
    }
}
