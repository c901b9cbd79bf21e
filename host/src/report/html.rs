//! The page.

use std::collections::BTreeSet;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::{Closure, LoopReport, PaperFigures, SynthesisFigures, drawing, plots};
use crate::diagnose::outcome::{Diagnosis, ErrorFigure, Parameter, Rung, Verdict};

/// The whole page, with everything that it needs in it.
pub fn page(report: &LoopReport) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "darm: " (report.arm) ", seed " (report.seed) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                main {
                    (head(report))
                    (figures(report))
                    (synthesis(report))
                    (programme(report))
                    (diagnosis(report))
                    (closing(report))
                    footer { "darm " (report.version) " · seed " (report.seed) " · the same numbers are in report.json" }
                }
            }
        }
    }
}

fn head(report: &LoopReport) -> Markup {
    html! {
        header {
            h1 { "Once round the loop" }
            p.sub { (report.arm) " · " (report.board) " · seed " (report.seed) " · " (format!("{:.0} s", report.time_s)) }
            p.lead { @for sentence in report.diagnosis.plain.iter().take(3) { (sentence) " " } }
        }
    }
}

/// The few numbers that say how it went.
fn figures(report: &LoopReport) -> Markup {
    let (error_m, _) = report.synthesis.largest();
    let diagnosis = &report.diagnosis;
    let heldout = diagnosis.error.after.heldout.as_ref().unwrap_or(&diagnosis.error.after.train);
    let ratio = diagnosis.repeatability.as_ref().map(|r| heldout.distance_m / r.distance_m);
    html! {
        div.cards {
            (card("synthesis error", &power(error_m, "m"), "largest of the desired frames", error_m <= 1e-9))
            (verdict_card(report))
            @if let Some(ratio) = ratio {
                (card("held-out error after", &format!("{ratio:.2} ×"), "the repeatability of the measurement", ratio <= 1.3))
            }
            @for closure in &report.closures {
                (card(&closure.name, &mm(closure.after_m), &format!("at the desired frames, from {}", mm(closure.before_m)), closure.met()))
            }
        }
    }
}

fn verdict_card(report: &LoopReport) -> Markup {
    let diagnosis = &report.diagnosis;
    let (value, note) = match &diagnosis.effects[..] {
        [first, ..] => (first.law.to_string(), first.place_name.clone()),
        [] => (diagnosis.verdict.to_string(), "nothing is named".to_string()),
    };
    let right = report.named_rightly().unwrap_or(diagnosis.verdict != Verdict::UnexplainedStructure);
    card("diagnosis", &value, &note, right)
}

fn card(name: &str, value: &str, note: &str, met: bool) -> Markup {
    html! {
        div.card.met[met].missed[!met] {
            div.name { (name) }
            div.value { (value) }
            div.note { (note) }
        }
    }
}

fn synthesis(report: &LoopReport) -> Markup {
    let s = &report.synthesis;
    html! {
        section {
            h2 { "Synthesis" }
            p { "The stops of the legs, found so that the arm meets the desired frames (" (s.case) "). Grey: the base-line arm; dark: the synthesised one, extended legs in colour; the cross is the desired frame." }
            (drawing::figure(report))
            div.two {
                (frames_table(s))
                (paper_table(s))
            }
        }
    }
}

fn frames_table(s: &SynthesisFigures) -> Markup {
    html! {
        table {
            thead { tr { th { "frame" } th { "word" } th.num { "before" } th.num { "error" } th.num { "turn" } } }
            tbody {
                @for frame in &s.frames {
                    tr {
                        td { (frame.name) }
                        td { code { (frame.word) } }
                        td.num { (mm(frame.before_m)) }
                        td.num { (power(frame.error_m, "m")) }
                        td.num { (angle(frame.error_rad)) }
                    }
                }
            }
        }
    }
}

fn paper_table(s: &SynthesisFigures) -> Markup {
    let (error_m, error_rad) = s.largest();
    let ours = PaperFigures { error_m, error_rad, time_s: s.time_s };
    let row = |name: &str, figures: &PaperFigures| {
        html! {
            tr {
                td { (name) }
                td.num { (power(figures.error_m, "m")) }
                td.num { (angle(figures.error_rad)) }
                td.num { (seconds(figures.time_s)) }
            }
        }
    };
    html! {
        table {
            thead { tr { th { "largest error" } th.num { "position" } th.num { "turn" } th.num { "time" } } }
            tbody {
                (row(&format!("here, {} steps", s.iterations), &ours))
                @if let Some(here) = &s.paper_method { (row("the paper's method, here", here)) }
                (row("the paper's own figures", &s.paper))
            }
        }
    }
}

fn programme(report: &LoopReport) -> Markup {
    let p = &report.programme;
    html! {
        section {
            h2 { "Measurement" }
            p {
                (p.words) " words chosen for information, " (p.visits) " visits each after different words, "
                (p.repeats) " exact repeats: " (p.rows) " poses, played by the board in " (format!("{:.0} s", p.time_s))
                " from a table of " (p.table_rows) " rows. " (p.held_out) " words were drawn before any fit and held out."
            }
        }
    }
}

fn diagnosis(report: &LoopReport) -> Markup {
    let d = &report.diagnosis;
    html! {
        section {
            h2 { "Diagnosis" }
            @for sentence in &d.plain { p { (sentence) } }
            @if let Some(truth) = &report.truth {
                p.unsealed {
                    "Unsealed after the verdict: " b { (truth.effect) }
                    @if !truth.place.is_empty() { " at " (truth.place) ", " (format!("{:.4e} {}", truth.size, truth.unit)) ", sized for " (format!("{:.0}", truth.times_scatter)) " × the repeatability" }
                    "."
                }
            }
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
}

fn suspects(d: &Diagnosis) -> Vec<Markup> {
    let plots = [
        plots::over(d, "time, s", |p| Some(p.time_s)),
        plots::over(d, "supply, bar", |p| p.supply.map(|supply_pa| supply_pa / 1e5)),
        plots::over(d, "temperature, °C", |p| p.temperature_c),
        plots::over(d, "number of actuators extended", |p| Some(p.word.chars().filter(|c| *c != '0').count() as f64)),
    ];
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
                    thead { tr { th { (side) } th.num { "share" } th.num { "chance" } } }
                    tbody {
                        @for one in structure.depends_on.iter().take(8) {
                            tr { td { (one) } td.num { (format!("{:.0} %", 100.0 * one.share)) } td.num { (chance(one.p)) } }
                        }
                        @if structure.depends_on.is_empty() { tr { td colspan="3" { "on nothing that was measured" } } }
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

fn closing(report: &LoopReport) -> Markup {
    html! {
        section {
            h2 { "Closing the loop" }
            @for closure in &report.closures { (closure_table(closure)) }
            @if !report.stops.is_empty() {
                h3 { "What a person turns" }
                table {
                    thead { tr { th { "part" } th.num { "from" } th.num { "to" } th { "turn" } } }
                    tbody {
                        @for stop in &report.stops {
                            tr { td { (stop.name) } td.num { (mm(stop.from_m)) } td.num { (mm(stop.to_m)) } td { (stop.turn) } }
                        }
                    }
                }
            }
        }
    }
}

fn closure_table(closure: &Closure) -> Markup {
    html! {
        h3 { (closure.name) }
        p { (closure.note) }
        table {
            thead { tr { th { "frame" } th { "word before" } th { "word after" } th.num { "error before" } th.num { "error after" } } }
            tbody {
                @for frame in &closure.frames {
                    tr {
                        td { (frame.name) }
                        td { code { (frame.word_before) } }
                        td { code { (frame.word_after) } }
                        td.num { (mm(frame.before_m)) }
                        td.num { (mm(frame.after_m)) }
                    }
                }
                tr.sum {
                    td colspan="3" { "root mean square; goal " (mm(closure.goal_m)) ": " (if closure.met() { "met" } else { "not met" }) }
                    td.num { (mm(closure.before_m)) }
                    td.num { b { (mm(closure.after_m)) } }
                }
            }
        }
    }
}

impl Closure {
    /// Whether the error came down to the goal.
    pub fn met(&self) -> bool {
        self.after_m <= self.goal_m
    }
}

impl SynthesisFigures {
    /// The largest distance (m) and angle (rad) of all frames.
    pub fn largest(&self) -> (f64, f64) {
        let frames = self.frames.iter();
        frames.fold((0.0, 0.0), |(m, rad), frame| (f64::max(m, frame.error_m), f64::max(rad, frame.error_rad)))
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

fn mm(length_m: f64) -> String {
    format!("{:.3} mm", length_m * 1e3)
}

fn degrees(angle_rad: f64) -> String {
    format!("{:.4}°", angle_rad.to_degrees())
}

/// A tiny angle.
pub(super) fn angle(angle_rad: f64) -> String {
    format!("{:.0e}°", angle_rad.to_degrees())
}

fn power(value: f64, unit: &str) -> String {
    format!("{value:.0e} {unit}")
}

fn seconds(time_s: f64) -> String {
    if time_s < 1.0 { format!("{:.1} ms", time_s * 1e3) } else { format!("{time_s:.0} s") }
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
