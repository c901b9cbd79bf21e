//! The paper's real-coded genetic algorithm: roulette wheel, arithmetic crossover, uniform mutation.
//!
//! Printed are a rate of 0.8 for crossover, 0.04 for mutation and 50 individuals. The rest is chosen here: the
//! wheel's sectors are as wide as an individual is better than the worst; a pair's children are a·p₁ + (1 − a)·p₂ and
//! (1 − a)·p₁ + a·p₂ with one a from (0, 1); each variable mutates by itself to any value within its bounds; the best
//! individual survives.

use rand::RngExt as _;

use super::{Point, Search};

/// Share of the pairs that cross.
const CROSSOVER: f64 = 0.8;
/// Share of the variables that mutate.
const MUTATION: f64 = 0.04;

/// Searches.
pub(super) fn search(search: &mut Search<'_>) {
    let mut points = search.population();
    while search.goes_on() {
        let roulette = Roulette::new(&points);
        let mut next = vec![points[Point::best_of(&points)].clone()];
        while next.len() < points.len() {
            let parents = [(); 2].map(|()| &points[roulette.turn(search.random.random())].x);
            for x in children(search, parents) {
                if next.len() < points.len() {
                    next.push(search.evaluate(x));
                }
            }
        }
        points = next;
    }
}

/// Sectors by how much better than the worst each point is, added up.
struct Roulette(Vec<f64>);

impl Roulette {
    fn new(points: &[Point]) -> Self {
        let worst = points.iter().map(|point| point.value).filter(|value| value.is_finite()).fold(f64::MIN, f64::max);
        let mut sum = 0.0;
        let sector = |point: &Point| {
            sum += (worst - point.value).max(0.0);
            sum
        };
        Self(points.iter().map(sector).collect())
    }

    /// The number of the point where the wheel stops; all alike where no sector has a width.
    fn turn(&self, share: f64) -> usize {
        let sum = self.0.last().copied().unwrap_or(0.0);
        let last = self.0.len().saturating_sub(1);
        let index = if sum > 0.0 {
            self.0.partition_point(|end| *end <= share * sum)
        } else {
            (share * self.0.len() as f64) as usize
        };
        index.min(last)
    }
}

fn children(search: &mut Search<'_>, [a, b]: [&Vec<f64>; 2]) -> [Vec<f64>; 2] {
    let crosses = search.random.random::<f64>() < CROSSOVER;
    let share = if crosses { search.random.random::<f64>() } else { 1.0 };
    let mix = |share: f64| a.iter().zip(b).map(|(a, b)| share * a + (1.0 - share) * b).collect::<Vec<_>>();
    let mut children = [mix(share), mix(1.0 - share)];
    for child in &mut children {
        for (x, [low, high]) in child.iter_mut().zip(search.bounds) {
            if search.random.random::<f64>() < MUTATION {
                *x = low + (high - low) * search.random.random::<f64>();
            }
        }
    }
    children
}

#[cfg(test)]
mod tests {
    use super::{Point, Roulette};

    #[test]
    fn the_wheel_stops_by_merit() {
        let roulette = Roulette::new(&[4.0, 1.0, 3.0].map(|value| Point { x: vec![], value }));
        // Sectors 0, 3 and 1 of 4.
        assert_eq!([0.0, 0.74, 0.75, 0.999].map(|share| roulette.turn(share)), [1, 1, 2, 2]);
        let equal = Roulette::new(&[1.0, 1.0].map(|value| Point { x: vec![], value }));
        assert_eq!([0.0, 0.6].map(|share| equal.turn(share)), [0, 1]);
    }
}
