//! The page of one calibration loop.

use std::time::SystemTime;

use maud::{Markup, html};

use super::{Closure, LoopReport, PaperFigures, SynthesisFigures, drawing};
use darm_arm::draw::page::{SourceFile, date, file_table, skeleton};
use darm_diagnose::outcome::Verdict;
use darm_diagnose::report::numbers::mm;
use darm_diagnose::report::tables::tables_and_plots;

/// The page, self-contained: of a loop that ended `at` this time and wrote these files.
pub(crate) fn page(report: &LoopReport, files: &[SourceFile], at: SystemTime) -> Markup {
    let body = html! {
        (head(report, at))
        (figures(report))
        @if let Some(figures) = &report.synthesis { (synthesis(report, figures)) }
        (measurement_plan(report))
        (diagnosis(report))
        (closing(report))
        @if !files.is_empty() { section { h2 { "Files" } (file_table(files)) } }
        footer { "darm " (report.version) " · seed " (report.seed) " · the same numbers are in report.json" }
    };
    skeleton(&format!("{}, seed {}", report.arm, report.seed), &body)
}

fn head(report: &LoopReport, at: SystemTime) -> Markup {
    html! {
        header {
            h1 { "Calibration report" }
            p.sub { (report.arm) " · " (report.board) " · seed " (report.seed) " · " (format!("{:.0} s", report.time_s)) " · " (date(at)) }
            p.lead { @for sentence in report.diagnosis.plain.iter().take(3) { (sentence) " " } }
        }
    }
}

/// The main figures.
fn figures(report: &LoopReport) -> Markup {
    let synthesised = report.synthesis.as_ref().map(SynthesisFigures::largest);
    let diagnosis = &report.diagnosis;
    let held_out = diagnosis.error.after.held_out_or_train();
    let ratio = diagnosis.repeatability.as_ref().map(|r| held_out.norm.value / r.norm.value);
    html! {
        div.cards {
            @if let Some((error_m, _)) = synthesised {
                (card("synthesis error", &power(error_m, "m"), "largest of the desired frames", error_m <= 1e-9))
            }
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
        [first, ..] => (first.law.to_string(), first.site.name.clone()),
        [] => (diagnosis.verdict.to_string(), "no effect named".to_string()),
    };
    let right = report.named_rightly().unwrap_or(matches!(diagnosis.verdict, Verdict::EffectFound | Verdict::NoEffect));
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

fn synthesis(report: &LoopReport, s: &SynthesisFigures) -> Markup {
    html! {
        section {
            h2 { "Synthesis" }
            p { "Stop positions with which the arm reaches the desired frames (" (s.case) "). Grey: the initial arm; dark: the synthesised arm, extended legs in colour, each with the number of its actuator; the cross is the desired frame." }
            (drawing::figure(report))
            p.legend { @for label in report.drawing.actuators.iter().chain(&report.drawing.servos) { span { (label) } " " } }
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
            thead { tr { th { "frame" } th { "word" } th.num { "before" } th.num { "error" } th.num { "angle error" } } }
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
    html! {
        table {
            thead { tr { th { "largest error" } th.num { "position" } th.num { "angle error" } th.num { "time" } } }
            tbody {
                (paper_row(&format!("default method, {} steps", s.iterations), &ours))
                @if let Some(here) = &s.paper_method { (paper_row("the paper's method, our implementation", here)) }
                (paper_row("as printed in the paper", &s.paper))
            }
        }
    }
}

/// A row of the largest errors and the time of one method.
fn paper_row(name: &str, figures: &PaperFigures) -> Markup {
    html! {
        tr {
            td { (name) }
            td.num { (power(figures.error_m, "m")) }
            td.num { (angle(figures.error_rad)) }
            td.num { (seconds(figures.time_s)) }
        }
    }
}

fn measurement_plan(report: &LoopReport) -> Markup {
    let p = &report.plan;
    html! {
        section {
            h2 { "Measurement" }
            p {
                "Measurement plan of " (p.words) " informative words, " (p.visits) " visits each, after different words, and "
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
                    "Injected effect: " b { (truth.effect) }
                    @if !truth.place.is_empty() { ", " (truth.place) ", " (size(truth.size, truth.unit)) ", about " (format!("{:.0}", truth.times_scatter)) " × the repeatability" }
                    "."
                    @if let Some(interval) = missed_interval(report) {
                        " This is outside of the fitted interval, " (interval) ": a simulated arm follows a separate equation, of which \
                        the fitted law is an approximation over the conditions that were measured. The verdict rests on the held-out error."
                    }
                }
            }
            (tables_and_plots(d))
        }
    }
}

/// The fitted interval of an effect that was named rightly, where it does not contain the injected size; the injected
/// size has no sign.
fn missed_interval(report: &LoopReport) -> Option<String> {
    let truth = report.truth.as_ref().filter(|_| report.named_rightly() == Some(true))?;
    let [effect] = &report.diagnosis.effects[..] else { return None };
    let value = effect.values.iter().find(|value| value.unit == truth.unit)?;
    let [low, high] = value.ci95?;
    let injected = truth.size.copysign(value.value);
    let ends = [low, high].map(|end| size(end, truth.unit));
    (!(low..=high).contains(&injected)).then(|| format!("{} {} to {}", value.name, ends[0], ends[1]))
}

/// The size of an effect; `1` means a number without unit.
fn size(value: f64, unit: &str) -> String {
    if unit == "1" { format!("{value:.4}") } else { format!("{value:.4e} {unit}") }
}

fn closing(report: &LoopReport) -> Markup {
    html! {
        section {
            h2 { "Closing the loop" }
            @for closure in &report.closures { (closure_table(closure)) }
            @if !report.stops.is_empty() {
                h3 { "Adjustments" }
                table {
                    thead { tr { th { "part" } th.num { "from" } th.num { "to" } th { "adjustment" } } }
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
    /// Whether the error is within the goal.
    pub(crate) fn met(&self) -> bool {
        self.after_m <= self.goal_m
    }
}

impl SynthesisFigures {
    /// The largest distance (m) and angle (rad) of all frames.
    pub(crate) fn largest(&self) -> (f64, f64) {
        let frames = self.frames.iter();
        frames.fold((0.0, 0.0), |(m, rad), frame| (f64::max(m, frame.error_m), f64::max(rad, frame.error_rad)))
    }
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
