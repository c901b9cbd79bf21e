//! The training as charts: Figures 4 and 5 of the paper.

use darm_arm::draw::chart::{Axis, Chart, Corner, Series, Shape};
use darm_arm::draw::palette::{BLUE, INK, ORANGE};

use super::train::{Chosen, PAPER_LAMBDAS, PAPER_SUCCESS};

/// Radius of the circles at values of the paper, pixels.
const RADIUS: u32 = 6;

/// Fig. 4: success over λ on all constraints, and on those that the first λ of the sequence does not solve; circles: the
/// paper's maxima.
pub fn selection(lambdas: &[f64], sequence: &[Chosen]) -> String {
    let names = [("all constraints, first λ", BLUE), ("remaining constraints, second λ", ORANGE)];
    let mut series = Vec::new();
    for (k, (chosen, (name, color))) in sequence.iter().zip(names).enumerate() {
        let line = lambdas.iter().zip(&chosen.rates).map(|(lambda, rate)| [*lambda, *rate]).collect();
        series.push(Series::named(name, color, Shape::Line(line)));
        series.push(Series::unnamed(color, Shape::Circles(RADIUS, vec![[PAPER_LAMBDAS[k], PAPER_SUCCESS[k]]])));
    }
    svg("λ", 0.0..1.0, series)
}

/// Fig. 5: the share of all constraints that the first k values of the sequence solve; circles: the values in the
/// paper's text.
pub fn accumulation(sequence: &[Chosen]) -> String {
    let line = sequence.iter().enumerate().map(|(k, chosen)| [(k + 1) as f64, chosen.accumulated]).collect();
    let [first, second] = PAPER_SUCCESS;
    let paper = vec![[1.0, first], [2.0, first + (100.0 - first) * second / 100.0]];
    let series = vec![
        Series::named("solved by the first k values of λ", BLUE, Shape::Line(line)),
        Series::unnamed(BLUE, Shape::Circles(RADIUS, paper)),
    ];
    svg("k", 1.0..sequence.len().max(2) as f64, series)
}

/// Shares over `x`, with an entry for the paper's circles in the legend.
fn svg(x: &str, range: std::ops::Range<f64>, mut series: Vec<Series>) -> String {
    series.push(Series::named("the paper", INK, Shape::Circles(RADIUS, Vec::new())));
    let (x, y) = (Axis::linear(x, range), Axis::linear("solved, %", 0.0..100.0));
    Chart { x, y, series, legend: Corner::LowerRight, ..Chart::default() }.svg()
}
