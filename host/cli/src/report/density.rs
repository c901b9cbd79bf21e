//! Plot of the density of an arm's frames: number of words per square of one plane, on a logarithmic scale.

use std::collections::BTreeMap;

use darm_arm::draw::chart::{Axis, Chart, Series, Shape};
use darm_arm::draw::palette::DENSITY;
use darm_arm::reach::map::{Place, Spot};

/// Pixels of the longer side.
const LONG: f64 = 800.0;

/// The SVG of all words seen along the axis that is not one of `axes` (0 is x, 1 is y, 2 is z), with squares of `cell_m`.
pub fn svg(spots: &BTreeMap<Place, Spot>, axes: [usize; 2], cell_m: f64) -> String {
    let mut squares: BTreeMap<[i16; 2], f64> = BTreeMap::new();
    for (place, spot) in spots {
        *squares.entry(axes.map(|axis| place[axis])).or_default() += spot.words;
    }
    let [x, y] = [0, 1].map(|k| {
        let along = || squares.keys().map(|square| f64::from(square[k]));
        let (low, high) = (along().fold(0.0, f64::min), along().fold(0.0, f64::max));
        Axis::linear(["x, m", "y, m", "z, m"][axes[k]], cell_m * (low - 1.0)..cell_m * (high + 1.0))
    });
    let [width, height] = [&x, &y].map(|axis| axis.range.end - axis.range.start);
    let scale = LONG / width.max(height);
    let largest = squares.values().fold(1.0, |largest: f64, words| largest.max(*words)).ln_1p();
    let series = squares.iter().map(|(square, words)| {
        let low = square.map(|number| cell_m * (f64::from(number) - 0.5));
        let color = DENSITY[0].mix(DENSITY[1], words.ln_1p() / largest);
        Series::unnamed(color, Shape::Box([low, low.map(|at| at + cell_m)]))
    });
    // The room that a chart takes for numbers and margins.
    let size = ((width * scale) as u32 + 98, (height * scale) as u32 + 60);
    Chart { size, x, y, series: series.collect(), ..Chart::default() }.svg()
}
