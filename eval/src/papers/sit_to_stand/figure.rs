//! Figures of this paper, named after it.

use anyhow::Result;
use darm_figures::figure::Figure;

/// A figure of this paper.
pub(super) fn figure(name: &str, value: f64, unit: &str) -> Result<Figure> {
    Figure::new(&format!("stand: {name}"), value, unit)
}
