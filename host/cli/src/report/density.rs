//! Plot of the density of an arm's frames: number of words per square of one plane, on a logarithmic scale.

use std::collections::BTreeMap;

use plotters::prelude::{
    ChartBuilder, IntoDrawingArea as _, IntoFont as _, RGBColor, Rectangle, SVGBackend, TextStyle, WHITE,
};
use plotters::style::Color as _;

use darm_arm::reach::map::{Place, Spot};

/// Pixels of the longer side.
const LONG: f64 = 800.0;
const INK: RGBColor = RGBColor(40, 44, 52);
/// Few words, and many.
const COLORS: [RGBColor; 2] = [RGBColor(222, 235, 247), RGBColor(8, 48, 107)];

/// The SVG of all words seen along the axis that is not one of `axes` (0 is x, 1 is y, 2 is z), with squares of `cell_m`.
pub fn svg(spots: &BTreeMap<Place, Spot>, axes: [usize; 2], cell_m: f64) -> String {
    let mut squares: BTreeMap<[i16; 2], f64> = BTreeMap::new();
    for (place, spot) in spots {
        *squares.entry(axes.map(|axis| place[axis])).or_default() += spot.words;
    }
    let mut svg = String::new();
    // Drawing into a string does not fail; a picture that cannot be drawn is left empty.
    let _ = draw(&mut svg, &squares, axes.map(|axis| ["x, m", "y, m", "z, m"][axis]), cell_m);
    svg
}

fn draw(
    svg: &mut String,
    squares: &BTreeMap<[i16; 2], f64>,
    names: [&str; 2],
    cell_m: f64,
) -> Result<(), Box<dyn std::error::Error>> {
    let bounds = [0, 1].map(|axis| {
        let along = || squares.keys().map(|square| f64::from(square[axis]));
        let (low, high) = (along().fold(0.0, f64::min), along().fold(0.0, f64::max));
        cell_m * (low - 1.0)..cell_m * (high + 1.0)
    });
    let [wide, high] = [0, 1].map(|axis| bounds[axis].end - bounds[axis].start);
    let scale = LONG / wide.max(high);
    let area =
        SVGBackend::with_string(svg, ((wide * scale) as u32 + 90, (high * scale) as u32 + 70)).into_drawing_area();
    area.fill(&WHITE)?;
    let [x, y] = bounds;
    let mut chart =
        ChartBuilder::on(&area).margin(10).x_label_area_size(45).y_label_area_size(60).build_cartesian_2d(x, y)?;
    let font = || TextStyle::from(("sans-serif", 14).into_font()).color(&INK);
    chart.configure_mesh().disable_mesh().label_style(font()).x_desc(names[0]).y_desc(names[1]).draw()?;
    let largest = squares.values().fold(1.0, |largest: f64, words| largest.max(*words)).ln_1p();
    chart.draw_series(squares.iter().map(|(square, words)| {
        let [left, low] = square.map(|number| cell_m * (f64::from(number) - 0.5));
        let corners = [(left, low), (left + cell_m, low + cell_m)];
        Rectangle::new(corners, between(COLORS, words.ln_1p() / largest).filled())
    }))?;
    area.present()?;
    Ok(())
}

fn between([from, to]: [RGBColor; 2], share: f64) -> RGBColor {
    let mix = |from: u8, to: u8| (f64::from(from) + share * (f64::from(to) - f64::from(from))) as u8;
    RGBColor(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}
