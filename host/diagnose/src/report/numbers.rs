//! Numbers with as many digits as their uncertainty gives them.

/// Decimals beyond which a number is written with an exponent.
const MAX_DECIMALS: i32 = 6;

/// A value and the ends of its interval, with two digits of half the interval.
pub fn with_interval(value: f64, [low, high]: [f64; 2]) -> [String; 3] {
    let half = 0.5 * (high - low).abs();
    let last = if half > 0.0 && half.is_finite() { half.log10().floor() as i32 - 1 } else { -MAX_DECIMALS };
    [value, low, high].map(|number| match -last {
        decimals if decimals > MAX_DECIMALS => {
            let first = number.abs().max(f64::MIN_POSITIVE).log10().floor() as i32;
            format!("{number:.digits$e}", digits = (first - last).clamp(0, 12) as usize)
        }
        decimals => format!("{number:.decimals$}", decimals = decimals.max(0) as usize),
    })
}

#[cfg(test)]
mod tests {
    use super::with_interval;

    #[test]
    fn digits_are_those_of_the_interval() {
        assert_eq!(with_interval(0.252_409, [0.252_231, 0.252_587]), ["0.25241", "0.25223", "0.25259"]);
        assert_eq!(with_interval(2.3e-5, [2.21e-5, 2.39e-5]), ["2.300e-5", "2.210e-5", "2.390e-5"]);
        assert_eq!(with_interval(1234.5, [1100.0, 1369.0]), ["1234", "1100", "1369"]);
        assert_eq!(with_interval(1.0, [1.0, 1.0]), ["1.000000"; 3]);
    }
}
