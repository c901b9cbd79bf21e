//! Differential evolution, rand/1/bin: Storn, Price, J. Global Optim. 11 (1997).
//!
//! F = 0.5 and CR = 0.9. A variable that would leave its bounds stops half way between its parent and the bound.

use rand::RngExt as _;

use super::Search;

/// F: how far a difference of two points carries a third.
const WEIGHT: f64 = 0.5;
/// CR: share of the variables that a trial takes from the mutant.
const CROSSOVER: f64 = 0.9;

/// Searches.
pub(super) fn search(search: &mut Search<'_>) {
    let mut points = search.population();
    let bounds = search.bounds;
    while search.goes_on() {
        for target in 0..points.len() {
            let [a, b, c] = three_others(search, points.len(), target).map(|index| &points[index].x);
            let sure = search.random.random_range(0..bounds.len());
            let mut x = points[target].x.clone();
            for (k, (x, [low, high])) in x.iter_mut().zip(bounds).enumerate() {
                if k == sure || search.random.random::<f64>() < CROSSOVER {
                    let mutant = a[k] + WEIGHT * (b[k] - c[k]);
                    *x = if mutant < *low {
                        0.5 * (*x + low)
                    } else if mutant > *high {
                        0.5 * (*x + high)
                    } else {
                        mutant
                    };
                }
            }
            let trial = search.evaluate(x);
            if trial.value <= points[target].value {
                points[target] = trial;
            }
        }
    }
}

/// Three different numbers below `count`, which is 4 or more, none of them `target`.
fn three_others(search: &mut Search<'_>, count: usize, target: usize) -> [usize; 3] {
    let mut taken = [target; 4];
    for place in 1..4 {
        while taken[..place].contains(&taken[place]) {
            taken[place] = search.random.random_range(0..count);
        }
    }
    [taken[1], taken[2], taken[3]]
}
