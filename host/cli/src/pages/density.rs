//! Plot of the density of an arm's frames: number of words per square of one plane, on a logarithmic scale.

use std::collections::BTreeMap;

use darm_arm::draw::chart::{Axis, Chart, Series, Shape};
use darm_arm::draw::palette::DENSITY;
use darm_arm::reach::map::{Place, Spot};

/// Pixels of the longer side.
const LONG: f64 = 800.0;

/// The SVG of all words seen along the axis that is not one of `axes` (0 is x, 1 is y, 2 is z), with squares of `cell_m`.
pub(crate) fn svg(spots: &BTreeMap<Place, Spot>, axes: [usize; 2], cell_m: f64) -> String {
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
    let mut shown = shown(squares.values().copied());
    let series = squares.iter().map(|(square, &words)| {
        let low = square.map(|number| cell_m * (f64::from(number) - 0.5));
        let color = DENSITY[0].mix(DENSITY[1], words.ln_1p() / largest);
        let shape = Shape::Box([low, low.map(|at| at + cell_m)]);
        // The first square of a colour of the legend gives its entry.
        let series = match shown.iter().position(|&count| count == words) {
            Some(entry) => {
                shown.remove(entry);
                Series::named(&legend(words, cell_m), color, shape)
            }
            None => Series::unnamed(color, shape),
        };
        series.with_notes(vec![note(words, square, axes, cell_m)])
    });
    // The room that a chart takes for numbers and margins.
    let size = ((width * scale) as u32 + 98, (height * scale) as u32 + 60);
    Chart { size, x, y, series: series.collect(), ..Chart::default() }.svg()
}

/// The counts of words whose colours the legend shows: the smallest, the one in the middle of the scale, and the largest.
fn shown(counts: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut counts: Vec<f64> = counts.collect();
    counts.sort_by(f64::total_cmp);
    counts.dedup();
    let (Some(&low), Some(&high)) = (counts.first(), counts.last()) else { return Vec::new() };
    let middle = 0.5 * (low.ln_1p() + high.ln_1p());
    let off = |count: &f64| (count.ln_1p() - middle).abs();
    let mut shown = vec![low, high];
    shown.extend(counts.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))));
    shown.sort_by(f64::total_cmp);
    shown.dedup();
    shown
}

fn legend(words: f64, cell_m: f64) -> String {
    format!("{} in {1:.0} × {1:.0} mm", count(words), 1e3 * cell_m)
}

/// What a square says of itself: `12 words around x 50 mm, y 4200 mm`.
fn note(words: f64, square: &[i16; 2], axes: [usize; 2], cell_m: f64) -> String {
    let [x, y] = [0, 1].map(|k| format!("{} {:.0} mm", ["x", "y", "z"][axes[k]], 1e3 * cell_m * f64::from(square[k])));
    format!("{} around {x}, {y}", count(words))
}

fn count(words: f64) -> String {
    let number = if words < 1e6 { format!("{words:.0}") } else { format!("{words:.1e}") };
    format!("{number} word{}", if words == 1.0 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn the_legend_shows_the_ends_and_the_middle_of_the_scale() {
        assert_eq!(shown([1.0, 3.0, 5.0, 24.0, 1.0].into_iter()), [1.0, 5.0, 24.0]);
        assert_eq!(shown([2.0, 2.0].into_iter()), [2.0]);
    }
}
