//! Numbers at axes and of points.

/// A number with a hundredth of `span` as its last digit at most, without zeros at the end.
pub(super) fn rounded(value: f64, span: f64) -> String {
    let decimals = (2.0 - span.log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    // A tick at zero may be a little less.
    if short == "-0" { "0".into() } else { short.to_owned() }
}
