//! The report of a diagnosis of tool poses, as a page of its own and as a part of the round through the loop.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::plots;
use super::skeleton::skeleton;
use darm_diagnose::outcome::{Diagnosis, ErrorFigure, Parameter, Rung};

/// The whole page; `findings` is what the owner of the data should know.
pub fn diagnosis_page(diagnosis: &Diagnosis, findings: &[String]) -> Markup {
    let body = html! {
        header {
            h1 { "What the model lacks" }
            p.sub { (diagnosis.kind) " · " (diagnosis.verdict) " · held out: " (diagnosis.held_out) }
        }
        section {
            @for sentence in &diagnosis.plain { p { (sentence) } }
            (tables_and_plots(diagnosis))
        }
        @if !findings.is_empty() { section { h2 { "What to know of the data" } @for finding in findings { p { (finding) } } } }
        footer { "darm " (diagnosis.version) " · model " (diagnosis.model) " · seed " (diagnosis.seed) }
    };
    skeleton(diagnosis.kind, &body)
}

/// Effects, errors, plots and what was tried.
pub(super) fn tables_and_plots(d: &Diagnosis) -> Markup {
    html! {
        (effects_table(d))
        (errors_table(d))
        h3 { "Error of each word" }
        (legend(d))
        (plots::by_word(d))
        h3 { "Error against each suspect" }
        div.plots {
            @for plot in suspects(d) { div { (plot) } }
        }
        (depends(d))
        h3 { "What was tried" }
        p { "Cross-validated error over words with each effect added; the best of each step, of all that were tried." }
        (ladder(&d.ladder, &mm))
    }
}

fn suspects(d: &Diagnosis) -> Vec<Markup> {
    let mut plots = vec![
        plots::over(d, "time, s", &|p| Some(p.time_s)),
        plots::over(d, "supply, bar", &|p| p.supply.map(|supply_pa| supply_pa / 1e5)),
        plots::over(d, "temperature, °C", &|p| p.temperature_c),
        plots::over(d, "number of actuators extended", &|p| Some(p.word.chars().filter(|c| *c != '0').count() as f64)),
    ];
    for k in 0..d.points.first().map_or(0, |point| point.servos_rad.len()) {
        let name = format!("position of servo {}, rad or m", k + 1);
        plots.push(plots::over(d, &name, &|p| p.servos_rad.get(k).copied()));
    }
    plots.into_iter().flatten().collect()
}

fn legend(d: &Diagnosis) -> Markup {
    html! {
        p.legend {
            span.before { "●" } " model " (d.model) " "
            span.after { "●" } " with the effects found "
            span.noise { "━" } " repeatability · filled: held-out words"
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
                        @for parameter in &effect.parameters {
                            tr {
                                td { b { (effect.law) } }
                                td { (effect.place_name) " (" (effect.place) ")" }
                                td { (parameter.name) }
                                td.num { (shown(parameter, parameter.value)) }
                                td.num { (shown(parameter, parameter.ci95[0])) " … " (shown(parameter, parameter.ci95[1])) }
                                td.num { @if let Some(gain) = effect.heldout_gain_m { (mm(gain)) } @else { "–" } }
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
        ("before, training words", Some(&d.error.before.train)),
        ("before, held-out words", d.error.before.heldout.as_ref()),
        ("after, training words", Some(&d.error.after.train)),
        ("after, held-out words", d.error.after.heldout.as_ref()),
    ];
    let axis = |value: f64, unit: &str| if unit == "rad" { degrees(value) } else { mm(value) };
    html! {
        table {
            thead {
                tr {
                    th { "error, root mean square" }
                    @for axis in &d.error.before.train.axes { th.num { (axis.axis) } }
                    th.num { "d" }
                    th.num { "largest d" }
                }
            }
            tbody {
                @for (name, figure) in rows {
                    @if let Some(ErrorFigure { axes, distance_m, largest_m }) = figure {
                        tr {
                            td { (name) }
                            @for a in axes { td.num { (axis(a.value, a.unit)) } }
                            td.num { b { (mm(*distance_m)) } }
                            td.num { (mm(*largest_m)) }
                        }
                    }
                }
                @if let Some(r) = &d.repeatability {
                    tr.noise {
                        td { "repeatability (" (r.dof) " degrees of freedom)" }
                        @for a in &r.axes { td.num { (axis(a.value, a.unit)) } }
                        td.num { b { (mm(r.distance_m)) } }
                        td.num {}
                    }
                }
            }
        }
    }
}

fn depends(d: &Diagnosis) -> Markup {
    let sides = [("before", &d.structure), ("after", &d.remaining)];
    html! {
        h3 { "What the residual depends on" }
        div.two {
            @for (side, structure) in sides {
                table {
                    @let kept = structure.depends_on.iter().any(|one| one.heldout_gain_m.is_some());
                    thead { tr { th { (side) } th { "directions" } th.num { "share" } th.num { "chance" } @if kept { th.num { "gain if kept" } } } }
                    tbody {
                        @for one in structure.depends_on.iter().take(8) {
                            tr {
                                td { (one) }
                                td { "of the " (one.frame) }
                                td.num { (format!("{:.0} %", 100.0 * one.share)) }
                                td.num { (chance(one.p)) }
                                @if kept { td.num { (one.heldout_gain_m.map_or("–".into(), mm)) } }
                            }
                        }
                        @if structure.depends_on.is_empty() { tr { td colspan="4" { "on nothing that was measured" } } }
                    }
                }
            }
        }
    }
}

/// What was tried, step by step, the best of each step; errors as `shown` writes them.
pub(super) fn ladder(rungs: &[Rung], shown: &dyn Fn(f64) -> String) -> Markup {
    let worst = rungs.iter().map(|rung| rung.without).fold(f64::MIN_POSITIVE, f64::max);
    let steps: BTreeSet<usize> = rungs.iter().map(|rung| rung.step).collect();
    html! {
        @for (number, step) in steps.iter().enumerate() {
            @let tried: Vec<&Rung> = rungs.iter().filter(|rung| rung.step == *step).collect();
            h4 { "step " (number + 1) ", " (tried.len()) " tried; without any " (tried.first().map_or(String::new(), |r| shown(r.without))) }
            table.ladder {
                @for rung in tried.iter().take(8) {
                    tr.kept[rung.kept] {
                        td { (rung.law) }
                        td { (rung.place) }
                        td.num { (shown(rung.cross_validated)) }
                        td.bar { div style={ "width:" (format!("{:.1}", 100.0 * (rung.cross_validated / worst).min(1.0))) "%" } {} }
                        td.num { @if rung.kept { "kept" } @else { "p " (chance(rung.p)) } }
                    }
                }
            }
        }
    }
}

/// A value in the unit that a person reads.
fn shown(parameter: &Parameter, value: f64) -> String {
    match parameter.unit {
        "m" => mm(value),
        "m/N" => format!("{:.3} µm/N", value * 1e6),
        "1/K" => format!("{:.2} µm/(m·K)", value * 1e6),
        "1" => format!("{value:.4}"),
        unit => format!("{value:.4e} {unit}"),
    }
}

pub(super) fn mm(length_m: f64) -> String {
    format!("{:.3} mm", length_m * 1e3)
}

fn degrees(angle_rad: f64) -> String {
    format!("{:.4}°", angle_rad.to_degrees())
}

fn chance(p: f64) -> String {
    if p < 1e-12 {
        "< 1e-12".into()
    } else if p < 0.01 {
        format!("{p:.0e}")
    } else {
        format!("{p:.2}")
    }
}
