//! What every search promises, whatever it searches.

use std::sync::atomic::{AtomicUsize, Ordering};

use proptest::prelude::*;

use super::*;

/// A valley about `least`, whose evaluations are counted.
struct Valley {
    bounds: Vec<[f64; 2]>,
    least: Vec<f64>,
    evaluations: AtomicUsize,
}

impl Valley {
    fn new(bounds: Vec<[f64; 2]>, least: Vec<f64>) -> Self {
        Self { bounds, least, evaluations: AtomicUsize::new(0) }
    }
}

impl Objective for Valley {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    fn value(&self, x: &[f64]) -> f64 {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        assert!(x.iter().zip(&self.bounds).all(|(x, [low, high])| low <= x && x <= high), "{x:?} is out of bounds");
        x.iter().zip(&self.least).map(|(x, least)| (x - least).powi(2)).sum::<f64>().sqrt()
    }
}

/// Something that is no valley.
struct Flat(f64, Vec<[f64; 2]>);

impl Objective for Flat {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.1
    }

    fn value(&self, _: &[f64]) -> f64 {
        self.0
    }
}

fn short(seed: u64) -> Settings {
    Settings { population: 12, iterations: 20, seed, ..Settings::default() }
}

proptest! {
    #![proptest_config(crate::testing::seeded(24))]

    #[test]
    fn a_run_keeps_its_promises(
        sides in prop::collection::vec((-5.0..5.0f64, 0.0..9.0f64, 0.0..1.0f64), 1..6),
        seed in any::<u64>(),
    ) {
        let bounds: Vec<_> = sides.iter().map(|(low, width, _)| [*low, low + width]).collect();
        let least = sides.iter().map(|(low, width, share)| low + share * width).collect();
        let valley = Valley::new(bounds, least);
        for algorithm in Algorithm::ALL {
            valley.evaluations.store(0, Ordering::Relaxed);
            let run = minimise(algorithm, &valley, &short(seed));
            prop_assert_eq!(run.evaluations, valley.evaluations.load(Ordering::Relaxed), "{}", algorithm);
            prop_assert_eq!(run.value, valley.value(&run.x));
            prop_assert_eq!(run.history.len(), 21);
            prop_assert!(run.history.windows(2).all(|pair| pair[1].value <= pair[0].value));
            prop_assert!(run.history.windows(2).all(|pair| pair[1].evaluations >= pair[0].evaluations));
            prop_assert_eq!(run.history[20].value, run.value);
            let again = minimise(algorithm, &valley, &short(seed));
            prop_assert_eq!((again.x, again.history), (run.x, run.history), "the same seed, another run");
        }
    }
}

#[test]
fn iterations_evaluate_as_often_as_the_papers_do() {
    let counts =
        [Algorithm::Em, Algorithm::Memr, Algorithm::Genetic, Algorithm::DifferentialEvolution].map(|algorithm| {
            let valley = Valley::new(vec![[-1.0, 1.0]; 4], vec![0.3; 4]);
            minimise(algorithm, &valley, &Settings { iterations: 2, ..Settings::default() }).evaluations
        });
    assert_eq!(counts, [50 + 2 * 49, 50 + 2 * 549, 50 + 2 * 49, 50 + 2 * 50]);
}

#[test]
fn local_search_pays_and_adaptation_more() {
    let values = [Algorithm::Em, Algorithm::Memr, Algorithm::CmaEs].map(|algorithm| {
        let valley = Valley::new(vec![[-5.0, 5.0]; 4], vec![0.3; 4]);
        minimise(algorithm, &valley, &Settings { iterations: 200, deviation: 0.01, ..Settings::default() }).value
    });
    assert!(values[1] < 0.5 * values[0] && values[2] < 1e-3 * values[1], "{values:?}");
}

#[test]
fn a_search_ends_when_it_is_told_to() {
    for algorithm in Algorithm::ALL {
        let valley = || Valley::new(vec![[-1.0, 1.0]; 3], vec![0.0; 3]);
        let run = |settings: Settings| minimise(algorithm, &valley(), &settings);
        let of_evaluations = run(Settings { evaluations: 500, ..short(1) });
        assert!(of_evaluations.evaluations < 500 + 12 * 11, "{algorithm}: {}", of_evaluations.evaluations);
        assert_eq!(run(Settings { enough: 10.0, ..short(1) }).history.len(), 1, "{algorithm}");
        assert_eq!(run(Settings { time: Duration::ZERO, ..short(1) }).history.len(), 1, "{algorithm}");
        let none = run(Settings { iterations: 0, ..short(1) });
        assert_eq!((none.history.len(), none.x.len()), (1, 3), "{algorithm}");
    }
}

#[test]
fn no_objective_breaks_a_search() {
    let narrow = vec![[1.0, 1.0], [-2.0, 2.0]];
    for algorithm in Algorithm::ALL {
        for value in [0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
            let run = minimise(algorithm, &Flat(value, narrow.clone()), &Settings { population: 0, ..short(3) });
            assert_eq!((run.x[0], run.x.len()), (1.0, 2), "{algorithm} of {value}");
        }
        let none = minimise(algorithm, &Flat(2.0, vec![]), &short(1));
        assert_eq!((none.value, none.x.len()), (2.0, 0));
        for wild in [[f64::NAN; 2], [1.0, -1.0], [f64::NEG_INFINITY, f64::INFINITY]] {
            assert_eq!(minimise(algorithm, &Flat(1.0, vec![wild; 2]), &short(1)).x.len(), 2);
        }
    }
}
