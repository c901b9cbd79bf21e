//! Several ways from several starts, until one meets all frames.
//!
//! From the base-line: Gauss–Newton on the stops, then the same along the way from its own frames to the desired ones. From
//! there and from every other start with the platforms' poses as unknowns (see [`lift`](super::lift)), where Gauss–Newton
//! ends at a singular platform.

use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::lift::Lift;
use super::newton::{EXACT, SOLVED, Search, damped_inverse, within};
use super::problem::Problem;
use super::{Found, Options, SynthesisError};

/// Steps of the plain scheme.
const PLAIN_STEPS: u32 = 50;
/// Standard deviations of the other starts in turn, as a share of the lengths and as angles of joints, rad.
const SCATTER: [(f64, f64); 4] = [(0.05, 0.2), (0.1, 0.5), (0.2, 1.0), (0.05, 2.0)];

pub(super) fn solve(problem: &mut Problem, options: &Options, insufficient: bool) -> Result<Found, SynthesisError> {
    let base_line = within(problem, problem.start());
    let platforms = (0..problem.n_stops()).any(|stop| problem.is_leg(stop));
    let mut search = Search { problem, iterations: 0 };
    let mut best: Option<(f64, DVector<f64>)> = None;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut starts = 0;
    while starts < options.starts.max(1) {
        let start = match starts {
            0 => base_line.clone(),
            n => scattered(search.problem, &base_line, SCATTER[n as usize % SCATTER.len()], &mut rng),
        };
        starts += 1;
        options.watch.count();
        let ways: &[fn(&mut Search, &DVector<f64>) -> Way] = match (starts, platforms) {
            (1, true) => &[descend, follow, lift],
            (1, false) => &[descend, follow],
            (_, true) => &[descend, lift],
            (_, false) => &[descend],
        };
        for way in ways {
            // A start that cannot be assembled is no start; the base-line's own failure is told.
            let Ok((error, unknowns)) = way(&mut search, &start) else { continue };
            if best.as_ref().is_none_or(|(lowest, _)| error < *lowest) {
                best = Some((error, unknowns));
            }
            if error < SOLVED {
                break;
            }
        }
        // More equations than rank: other starts find the same compromise.
        if insufficient || options.watch.is_ended() || best.as_ref().is_some_and(|(error, _)| *error < SOLVED) {
            break;
        }
    }
    let Some((error, mut unknowns)) = best else {
        search.problem.residual(&base_line)?;
        return Ok(Found { unknowns: base_line, iterations: search.iterations, starts });
    };
    if error < SOLVED {
        unknowns = search.tidy(unknowns);
    }
    Ok(Found { unknowns, iterations: search.iterations, starts })
}

/// Undamped steps from the base-line, as long as the arm can be assembled.
pub(super) fn plain(problem: &mut Problem) -> Found {
    let mut unknowns = problem.start();
    let mut iterations = 0;
    while iterations < PLAIN_STEPS {
        let Ok((residual, jacobian)) = problem.linearise(&unknowns) else { break };
        if residual.amax() < EXACT {
            break;
        }
        let next = &unknowns + damped_inverse(&jacobian, &residual, 0.0).component_div(problem.weights());
        if problem.residual(&next).is_err() {
            break;
        }
        unknowns = next;
        iterations += 1;
    }
    Found { unknowns, iterations, starts: 1 }
}

type Way = Result<(f64, DVector<f64>), SynthesisError>;

fn descend(search: &mut Search, start: &DVector<f64>) -> Way {
    search.descend(start, EXACT)
}

fn follow(search: &mut Search, start: &DVector<f64>) -> Way {
    search.follow(start)
}

fn lift(search: &mut Search, start: &DVector<f64>) -> Way {
    let (unknowns, iterations) = Lift::new(search.problem, start)?.solve();
    search.iterations += iterations;
    search.descend(&within(search.problem, unknowns), EXACT)
}

fn scattered(
    problem: &Problem,
    base_line: &DVector<f64>,
    (length, angle_rad): (f64, f64),
    rng: &mut ChaCha8Rng,
) -> DVector<f64> {
    let mut unknowns = base_line.clone();
    // The poses of the platforms are sought with the anchors where they are.
    for (index, value) in unknowns.iter_mut().enumerate().filter(|(index, _)| !problem.is_anchor(*index)) {
        let size = if problem.is_angle(index) { angle_rad } else { length * value.abs().max(0.1) };
        if let Ok(normal) = Normal::new(0.0, size) {
            *value += normal.sample(rng);
        }
    }
    within(problem, unknowns)
}
