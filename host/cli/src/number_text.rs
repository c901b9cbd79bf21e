//! Numbers of the command line and of tables: finite, and small enough that no square of them overflows.

use darm_robot::csv_table::LARGEST;

use crate::failure::Usage;

/// Why a text is not a number that a command takes; `of` says of what the number is.
pub(crate) fn number(text: &str, of: &str) -> Result<f64, Usage> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.abs() <= LARGEST => Ok(number),
        Ok(number) if !number.is_nan() => {
            Err(Usage(format!("{of}: `{}` is out of range; give a number from -1e12 to 1e12", text.trim())))
        }
        _ => Err(Usage(format!("{of}: `{}` is not a number", text.trim()))),
    }
}

/// Numbers separated by commas.
pub(crate) fn numbers(text: &str, of: &str) -> Result<Vec<f64>, Usage> {
    text.split(',').map(|cell| number(cell, of)).collect()
}

#[cfg(test)]
mod tests {
    use super::{number, numbers};

    #[test]
    fn numbers_are_finite_and_in_range() {
        assert_eq!(numbers("1, -2.5", "--q").ok(), Some(vec![1.0, -2.5]));
        let refused = |text| number(text, "--q").unwrap_err().to_string();
        assert_eq!(refused("1e308"), "--q: `1e308` is out of range; give a number from -1e12 to 1e12");
        assert_eq!(refused("inf"), "--q: `inf` is out of range; give a number from -1e12 to 1e12");
        assert_eq!(
            (refused("nan"), refused("")),
            ("--q: `nan` is not a number".into(), "--q: `` is not a number".into())
        );
    }
}
