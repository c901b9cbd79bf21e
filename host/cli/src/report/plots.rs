//! The plots of a report, as SVG.

use std::collections::BTreeMap;

use maud::{Markup, PreEscaped};
use plotters::prelude::{
    ChartBuilder, Circle, Color, EmptyElement, IntoDrawingArea, IntoLogRange, LineSeries, RGBColor, SVGBackend, WHITE,
};
use plotters::style::{IntoFont, ShapeStyle, TextStyle};

use darm_diagnose::outcome::{Diagnosis, Point, Visit};

const BEFORE: RGBColor = RGBColor(0xd1, 0x5b, 0x2c);
const AFTER: RGBColor = RGBColor(0x1f, 0x6f, 0x8b);
const NOISE: RGBColor = RGBColor(0x7a, 0x86, 0x8f);
const INK: RGBColor = RGBColor(0x33, 0x3d, 0x45);
const GRID: RGBColor = RGBColor(0xe7, 0xeb, 0xee);

/// Size of a wide plot.
const WIDE: (u32, u32) = (920, 300);
/// Size of a narrow one.
const NARROW: (u32, u32) = (450, 250);

/// Error of each word before and after, the largest first; held-out words are filled.
pub(super) fn by_word(diagnosis: &Diagnosis) -> Markup {
    let mut words: BTreeMap<&str, (Vec<&Visit>, bool)> = BTreeMap::new();
    for (point, visit) in visits(diagnosis) {
        let (of_word, held_out) = words.entry(&visit.word).or_default();
        of_word.push(visit);
        *held_out = point.held_out;
    }
    let rms = |visits: &[&Visit], of: fn(&Visit) -> f64| {
        1e3 * (visits.iter().map(|visit| of(visit).powi(2)).sum::<f64>() / visits.len() as f64).sqrt()
    };
    let mut rows: Vec<(f64, f64, bool)> =
        words.values().map(|(of, held_out)| (rms(of, |v| v.before_m), rms(of, |v| v.after_m), *held_out)).collect();
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let series = |of: fn(&(f64, f64, bool)) -> f64| -> Vec<Mark> {
        rows.iter().enumerate().map(|(k, row)| Mark { x: k as f64 + 0.5, y: of(row), filled: row.2 }).collect()
    };
    let plot = Plot {
        size: WIDE,
        x: "words, largest error first",
        x_range: 0.0..rows.len().max(1) as f64,
        x_numbers: false,
        before: series(|row| row.0),
        after: series(|row| row.1),
        noise_mm: diagnosis.repeatability.as_ref().map(|r| r.norm.value * 1e3),
    };
    plot.draw()
}

/// Error over one quantity; `None` where it was not measured or is constant.
pub(super) fn over(diagnosis: &Diagnosis, name: &str, of: &dyn Fn(&Point, &Visit) -> Option<f64>) -> Option<Markup> {
    let xs: Vec<f64> = visits(diagnosis).filter_map(|(point, visit)| of(point, visit)).collect();
    let (low, high) = xs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    if xs.is_empty() || high - low <= 1e-9 {
        return None;
    }
    let marks = |error: fn(&Visit) -> f64| -> Vec<Mark> {
        let mark = |(point, visit): (&Point, &Visit)| {
            Some(Mark { x: of(point, visit)?, y: 1e3 * error(visit), filled: point.held_out })
        };
        visits(diagnosis).filter_map(mark).collect()
    };
    let margin = 0.03 * (high - low);
    let plot = Plot {
        size: NARROW,
        x: name,
        x_range: low - margin..high + margin,
        x_numbers: true,
        before: marks(|visit| visit.before_m),
        after: marks(|visit| visit.after_m),
        noise_mm: diagnosis.repeatability.as_ref().map(|r| r.norm.value * 1e3),
    };
    Some(plot.draw())
}

/// The points that are visits of an arm.
fn visits(diagnosis: &Diagnosis) -> impl Iterator<Item = (&Point, &Visit)> {
    diagnosis.points.iter().filter_map(|point| Some((point, point.visit.as_ref()?)))
}

struct Mark {
    x: f64,
    y: f64,
    filled: bool,
}

/// Errors in mm over something, on a logarithmic scale.
struct Plot<'a> {
    size: (u32, u32),
    x: &'a str,
    x_range: std::ops::Range<f64>,
    x_numbers: bool,
    before: Vec<Mark>,
    after: Vec<Mark>,
    noise_mm: Option<f64>,
}

impl Plot<'_> {
    fn draw(&self) -> Markup {
        let mut svg = String::new();
        // Drawing into a string does not fail; a plot that cannot be drawn is left empty.
        let _ = self.draw_into(&mut svg);
        PreEscaped(scalable(&svg, self.size))
    }

    fn draw_into(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let area = SVGBackend::with_string(svg, self.size).into_drawing_area();
        area.fill(&WHITE)?;
        let font = || TextStyle::from(("sans-serif", 14).into_font()).color(&INK);
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .x_label_area_size(38)
            .y_label_area_size(58)
            .build_cartesian_2d(self.x_range.clone(), self.y_range().log_scale())?;
        let mut mesh = chart.configure_mesh();
        mesh.label_style(font())
            .axis_desc_style(font())
            .axis_style(NOISE)
            .bold_line_style(GRID)
            .light_line_style(WHITE);
        mesh.x_desc(self.x).y_desc("error d, mm").y_label_formatter(&|y| short(*y)).disable_x_mesh();
        if !self.x_numbers {
            mesh.x_labels(0);
        }
        let span = self.x_range.end - self.x_range.start;
        mesh.x_label_formatter(&|x| number(*x, span)).draw()?;
        if let Some(noise) = self.noise_mm {
            chart.draw_series(LineSeries::new(
                [(self.x_range.start, noise), (self.x_range.end, noise)],
                NOISE.stroke_width(2),
            ))?;
        }
        for (marks, color) in [(&self.before, BEFORE), (&self.after, AFTER)] {
            chart.draw_series(marks.iter().map(|mark| {
                let style: ShapeStyle = if mark.filled { color.filled() } else { color.stroke_width(1) };
                EmptyElement::at((mark.x, mark.y.max(1e-3))) + Circle::new((0, 0), 3, style)
            }))?;
        }
        area.present()?;
        Ok(())
    }

    fn y_range(&self) -> std::ops::Range<f64> {
        let all = || self.before.iter().chain(&self.after).map(|mark| mark.y.max(1e-3)).chain(self.noise_mm);
        let low = all().fold(f64::INFINITY, f64::min).max(1e-2);
        let high = all().fold(0.0, f64::max).max(2.0 * low);
        0.7 * low..1.4 * high
    }
}

/// An SVG that takes the width of its surroundings.
fn scalable(svg: &str, (width, height): (u32, u32)) -> String {
    let fixed = format!("<svg width=\"{width}\" height=\"{height}\"");
    svg.replacen(&fixed, "<svg role=\"img\"", 1)
}

/// A number with enough decimals for marks that are a fifth of `span` apart.
fn number(value: f64, span: f64) -> String {
    let decimals = (1.0 - span.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    // A tick at zero may be a little less.
    if short == "-0" { "0".into() } else { short.to_string() }
}

/// A number with one digit or two, for a logarithmic scale.
fn short(value: f64) -> String {
    number(value, value.abs().max(1e-6) * 10.0)
}
