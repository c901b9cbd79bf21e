//! Laws of one actuator or joint that moves along one coordinate: how its force departs from the ideal.
//!
//! Shapes that no linear fit finds (the speed at which friction falls, the distance over which it turns round) are taken
//! from a few values spread over what the measurement covers, so that they have the measurement's own scale.
//!
//! | law | column | unit of the value |
//! | --- | --- | --- |
//! | `force-offset` | 1 | force |
//! | `coulomb-friction` | tanh(v/v₀) | force |
//! | `viscous-friction` | v | force per speed |
//! | `stribeck-friction` | tanh(v/v₀)·exp(−\|v\|/v_s) | force |
//! | `presliding-friction` | z, with dz = (sign(dx) − z)·\|dx\|/d | force |
//! | `load-dependent-friction` | L·tanh(v/v₀), L·z | force per load |
//! | `position-dependent-friction` | x·z | force per length |
//! | `spring` | x | force per length |
//! | `drift` | t | force per time |
//!
//! v₀, v_s in shares of the root mean square of v, d in shares of the range of x. The friction of presliding is Dahl's
//! with the exponent 1, solved exactly from row to row. Sources: P. R. Dahl, A Solid Friction Model, 1968; B.
//! Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994) 1083.

use super::experiment::Candidate;

/// v₀ over the root mean square of v.
const CREEP: [f64; 3] = [0.05, 0.2, 0.5];
/// v_s over the root mean square of v.
const STRIBECK: [f64; 3] = [0.1, 0.3, 1.0];
/// d over the range of x.
const PRESLIDING: [f64; 5] = [0.002, 0.005, 0.01, 0.03, 0.1];

/// One coordinate along the rows of a measurement.
pub struct Coordinate<'a> {
    /// Position, m or rad.
    pub position: &'a [f64],
    /// Its rate.
    pub velocity: &'a [f64],
    /// When, s.
    pub time_s: &'a [f64],
    /// The stretch of each row: memory does not reach over a border.
    pub series: &'a [usize],
    /// Units of position and force: `m` and `N`, or `rad` and `N·m`.
    pub units: (&'static str, &'static str),
}

/// A column of numbers, one a row, with the law that it belongs to.
pub struct Law {
    /// Its name.
    pub name: &'static str,
    /// A number that is not fitted.
    pub shape: Option<(&'static str, f64, &'static str)>,
    /// Name and unit of the value.
    pub value: (&'static str, String),
    /// One number a row.
    pub column: Vec<f64>,
}

impl Law {
    /// A law without a shape.
    pub fn new(name: &'static str, value: &'static str, unit: String, column: Vec<f64>) -> Self {
        Self { name, shape: None, value: (value, unit), column }
    }

    /// The law at a place, acting on one of several axes.
    pub fn on_axis(&self, place: &str, axis: usize, n_axes: usize) -> Candidate {
        let shares: Vec<f64> = (0..n_axes).map(|k| f64::from(u8::from(k == axis))).collect();
        self.on_axes(place, &shares)
    }

    /// The law at a place, acting on each axis by its share.
    pub fn on_axes(&self, place: &str, shares: &[f64]) -> Candidate {
        let column = self.column.iter().flat_map(|number| shares.iter().map(move |share| share * number)).collect();
        let mut candidate = Candidate::one(self.name, place, (self.value.0, &self.value.1), column);
        candidate.shape = self.shape;
        candidate
    }
}

/// √(mean of squares).
fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Largest less smallest.
pub fn range(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    (high - low).max(0.0)
}

fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// z along the rows: +1 after going up by several `distance`, −1 after going down, zero where a stretch begins.
pub fn presliding(position: &[f64], series: &[usize], distance: f64) -> Vec<f64> {
    let mut state = vec![0.0; position.len()];
    for k in 1..position.len() {
        if series[k] == series[k - 1] {
            let step = position[k] - position[k - 1];
            let way = if step == 0.0 { 0.0 } else { step.signum() };
            state[k] = way + (state[k - 1] - way) * (-step.abs() / distance).exp();
        }
    }
    state
}

impl Coordinate<'_> {
    /// The laws of friction along this coordinate; friction may grow with each of the loads (name, unit, one number a row).
    pub fn friction(&self, loads: &[(&'static str, &'static str, Vec<f64>)]) -> Vec<Law> {
        let (length, force) = self.units;
        let speed = format!("{length}/s");
        let (usual, stroke) = (rms(self.velocity).max(1e-12), range(self.position).max(1e-12));
        let per = |unit: &str| format!("{force}/{unit}");
        let creep = |share: f64| -> Vec<f64> { self.velocity.iter().map(|v| (v / (share * usual)).tanh()).collect() };
        let unit_of_speed = if length == "m" { "m/s" } else { "rad/s" };
        let mut laws = vec![Law::new("viscous-friction", "coefficient", format!("{force}/({speed})"), self.velocity.to_vec())];
        let mut shaped = |name, shape, value, unit: String, column| {
            laws.push(Law { shape: Some(shape), ..Law::new(name, value, unit, column) });
        };
        for share in CREEP {
            let (column, shape) = (creep(share), ("creep speed", share * usual, unit_of_speed));
            for (load, unit, size) in loads {
                shaped("load-dependent-friction", shape, load, per(unit), times(&column, size));
            }
            shaped("coulomb-friction", shape, "level", force.into(), column);
        }
        for share in STRIBECK {
            let falling = self.velocity.iter().map(|v| (-v.abs() / (share * usual)).exp()).collect::<Vec<_>>();
            let shape = ("speed of fall", share * usual, unit_of_speed);
            shaped("stribeck-friction", shape, "level", force.into(), times(&creep(CREEP[0]), &falling));
        }
        for share in PRESLIDING {
            let column = presliding(self.position, self.series, share * stroke);
            let shape = ("presliding distance", share * stroke, length);
            for (load, unit, size) in loads {
                shaped("load-dependent-friction", shape, load, per(unit), times(&column, size));
            }
            shaped("position-dependent-friction", shape, "slope", per(length), times(&column, self.position));
            shaped("presliding-friction", shape, "level", force.into(), column);
        }
        laws
    }

    /// The laws that are no friction.
    pub fn others(&self) -> Vec<Law> {
        let (length, force) = self.units;
        let speed: Vec<f64> = self.velocity.iter().map(|v| v.abs()).collect();
        let start = self.time_s.first().copied().unwrap_or_default();
        vec![
            Law::new("force-offset", "offset", force.into(), vec![1.0; self.position.len()]),
            Law::new("spring", "stiffness", format!("{force}/{length}"), self.position.to_vec()),
            Law::new("speed-dependent-offset", "coefficient", format!("{force}/({length}/s)"), speed),
            Law::new("drift", "rate", format!("{force}/s"), self.time_s.iter().map(|t| t - start).collect()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presliding_turns_round_over_its_distance_and_forgets_at_a_border() {
        let position = [0.0, 0.1, 0.2, 0.19, 0.1, 0.5];
        let state = presliding(&position, &[0, 0, 0, 0, 0, 1], 0.01);
        assert!((state[2] - 1.0).abs() < 1e-4 && (state[4] + 1.0).abs() < 1e-2 && state[5] == 0.0);
        assert!((state[3] - (2.0 * (-1.0f64).exp() - 1.0)).abs() < 1e-4);
    }
}
