//! How near the tool has to come to a frame that counts as met, by method.

use super::Method;

/// Largest errors of a frame that is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Of the position, m.
    pub position_m: f64,
    /// Of the orientation, rad.
    pub orientation_rad: f64,
}

impl Accuracy {
    /// What Gauss-Newton reaches but for rounding.
    const EXACT: Self = Self { position_m: 1e-9, orientation_rad: 1e-9 };

    /// The paper's scheme ends with an error that falls with the square of its steps. The paper calls 10⁻⁵ m, of its arms in
    /// space, small enough to design an arm (section 4); at 1 m that is 10⁻⁵ rad.
    const OF_PAPER: Self = Self { position_m: 1e-5, orientation_rad: 1e-5 };

    /// What a method is judged by.
    pub fn of(method: Method) -> Self {
        match method {
            Method::Newton | Method::Plain => Self::EXACT,
            Method::Paper(_) => Self::OF_PAPER,
        }
    }
}
