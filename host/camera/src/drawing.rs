//! The target as a page to print: SVG, to scale in mm, with a ruler that shows whether the printer kept it.

use std::fmt::Write as _;

use crate::family::{CELLS, cells};
use crate::target::{RULER_MM, Size, Tag, Target};

/// Text and lines of the ruler, mm.
const TEXT_MM: f64 = 3.5;
const TICK_MM: f64 = 4.0;

/// Width and height of the paper, mm: A4 and A3.
fn paper_mm(size: Size) -> [f64; 2] {
    match size {
        Size::A4 => [210.0, 297.0],
        Size::A3 => [297.0, 420.0],
    }
}

/// The target on a page of paper.
///
/// Coordinates of the page are in mm, x to the right, y down.
pub fn svg(size: Size) -> String {
    let target = Target::new(size);
    let [width, height] = paper_mm(size);
    let board_mm = target.board_size_m().map(|m| 1e3 * m);
    // The board is in the middle of the width, as far from the upper edge as from the sides.
    let middle_x = width / 2.0;
    let board_y = (width - board_mm[0]) / 2.0 + board_mm[1] / 2.0;
    let tags = target.board().map(|(tag, centre)| (tag, [middle_x + 1e3 * centre.x, board_y - 1e3 * centre.y]));
    let mut shapes: String = tags.map(|(tag, centre)| square(&tag, centre)).collect();
    let below = board_y + board_mm[1] / 2.0;
    let row_y = (below + height - 4.0 * TEXT_MM) / 2.0;
    for (tag, name, x) in [(target.base(), "base", 0.28 * width), (target.tool(), "tool", 0.72 * width)] {
        shapes += &square(&tag, [x, row_y]);
        shapes += &cut_line(&tag, [x, row_y]);
        let label_y = row_y + 1e3 * (tag.side_m / 2.0 + 2.0 * Target::margin_m(&tag)) + TEXT_MM;
        let label = format!("{name}: tag {} of 36h11, black square {:.0} mm", tag.id, 1e3 * tag.side_m);
        shapes += &text(&label, x, label_y);
    }
    shapes += &ruler([middle_x - RULER_MM / 2.0, height - 3.0 * TEXT_MM]);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n{shapes}</svg>\n"
    )
}

/// A tag about a point of the page: a black square with white cells, runs of them in one piece.
fn square(tag: &Tag, [x, y]: [f64; 2]) -> String {
    let side = 1e3 * tag.side_m;
    let (left, top, cell) = (x - side / 2.0, y - side / 2.0, side / CELLS as f64);
    let mut white = String::new();
    for (row, line) in cells(tag.id).unwrap_or_default().iter().enumerate() {
        let mut column = 0;
        for run in line.chunk_by(|a, b| a == b) {
            if run[0] {
                let (from_x, from_y, length) =
                    (left + column as f64 * cell, top + row as f64 * cell, run.len() as f64 * cell);
                // Writing to a string cannot fail.
                let _ = write!(white, "M{from_x:.4} {from_y:.4}h{length:.4}v{cell:.4}h{:.4}z", -length);
            }
            column += run.len();
        }
    }
    format!(
        "<rect x=\"{left:.4}\" y=\"{top:.4}\" width=\"{side:.4}\" height=\"{side:.4}\"/>\
         <path d=\"{white}\" fill=\"white\" shape-rendering=\"crispEdges\"/>\n"
    )
}

/// Where to cut a tag out: the margin that it needs, twice.
fn cut_line(tag: &Tag, [x, y]: [f64; 2]) -> String {
    let half = 1e3 * (tag.side_m / 2.0 + 2.0 * Target::margin_m(tag));
    let (left, top, side) = (x - half, y - half, 2.0 * half);
    format!(
        "<rect x=\"{left:.3}\" y=\"{top:.3}\" width=\"{side:.3}\" height=\"{side:.3}\" fill=\"none\" stroke=\"#999\" \
         stroke-width=\"0.2\" stroke-dasharray=\"2 2\"/>\n"
    )
}

fn text(content: &str, x: f64, y: f64) -> String {
    format!(
        "<text x=\"{x:.3}\" y=\"{y:.3}\" font-family=\"sans-serif\" font-size=\"{TEXT_MM}\" text-anchor=\"middle\">{content}</text>\n"
    )
}

/// A ruler with a tick every 10 mm, the outer ones longer.
fn ruler([x, y]: [f64; 2]) -> String {
    let mut path = format!("M{x:.3} {y:.3}h{RULER_MM}");
    for k in 0..=10 {
        let tick = if k % 10 == 0 { 1.6 * TICK_MM } else { TICK_MM };
        let _ = write!(path, "M{:.3} {:.3}v{tick:.3}", x + RULER_MM * f64::from(k) / 10.0, y - tick / 2.0);
    }
    let label = format!(
        "{RULER_MM} mm between the outer lines: print at 100 %, measure, and give other lengths with --ruler-mm"
    );
    format!("<path d=\"{path}\" fill=\"none\" stroke=\"black\" stroke-width=\"0.2\"/>\n")
        + &text(&label, x + RULER_MM / 2.0, y + 2.0 * TEXT_MM)
}

#[cfg(test)]
mod tests {
    use super::{paper_mm, svg};
    use crate::target::{Size, Target};

    #[test]
    fn everything_fits_on_the_paper() {
        for size in [Size::A4, Size::A3] {
            let target = Target::new(size);
            let [width, height] = paper_mm(size);
            let [board_width, board_height] = target.board_size_m().map(|m| 1e3 * m);
            let border = (width - board_width) / 2.0;
            let base = 1e3 * target.base().side_m * 1.5;
            assert!(border > 5.0 && border + board_height + base + 25.0 < height, "{size:?}");
            assert!(0.28 * width - base / 2.0 > 5.0);
        }
    }

    #[test]
    fn the_page_has_a_size_in_mm_and_all_tags() {
        let page = svg(Size::A4);
        assert!(page.starts_with("<svg") && page.contains("width=\"210mm\" height=\"297mm\" viewBox=\"0 0 210 297\""));
        assert_eq!(page.matches("crispEdges").count(), 27);
    }
}
