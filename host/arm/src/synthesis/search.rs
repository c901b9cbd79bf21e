//! Several ways from several starts, until one meets all frames.
//!
//! From the base-line: Gauss–Newton on the stops, then the same along the way from its own frames to the desired ones. From
//! there and from every other start with the platforms' poses as unknowns (see [`lift`](super::lift)), where Gauss–Newton
//! ends at a singular platform. Late starts are for frames that tight bounds leave few geometries for: they take the
//! platforms' poses only, which then is ten times as fast as all, every other one with the plates of the base-line shifted. Where these met the
//! frames, and always left some word without a pose, wide starts follow, from arms that have little in common with the base-line.

use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::lift::Lift;
use super::needed_words::Needed;
use super::newton::{EXACT, Keep, SOLVED, Search, damped_inverse, within};
use super::problem::Problem;
use super::{Found, Options, SynthesisError};

/// Starts between all bounds for the closest geometry with a pose for every needed word, and the shares of the way to such a start that
/// are tried. Ten draws of frames moved out by 2 to 5 end at most 3.5 % farther than SLSQP of another program from 12 starts,
/// without these starts 12 %.
const ANYWHERE: u32 = 16;
const SHARES_OF_WAY: [f64; 4] = [0.8, 0.5, 0.3, 0.2];
/// Steps of the plain scheme.
const PLAIN_STEPS: u32 = 50;
/// Standard deviations of the other starts in turn, as a share of the lengths and as angles of joints, rad.
const SCATTER: [(f64, f64); 4] = [(0.05, 0.2), (0.1, 0.5), (0.2, 1.0), (0.05, 2.0)];
/// The same of starts beyond the requested number.
const WIDE: [(f64, f64); 3] = [(0.2, 0.5), (0.4, 1.0), (0.6, 2.0)];
/// All starts, in requested ones. One frame set of 128 needed 212 wide starts behind 256 others: 0.06 s more than 0.77.
const WIDE_SHARE: u32 = 4;
/// Starts after which those of platforms are late.
const EARLY: u32 = 16;
/// Solutions without a pose for some word that are tried for less.
const TRIED: usize = 8;
/// Standard deviations of the shifts in turn, in the arm's length scale and rad.
const SHIFT: [(f64, f64); 4] = [(0.2, 0.1), (0.4, 0.2), (0.6, 0.3), (0.4, 0.5)];

pub(super) fn solve(problem: &mut Problem, options: &Options) -> Result<Found, SynthesisError> {
    let base_line = within(problem, problem.start());
    let platforms = (0..problem.n_stops()).any(|stop| problem.is_leg(stop));
    let by_file = Needed::by_file(problem.base_line());
    let mut search = Search { problem, iterations: 0, keeps_words: false };
    let (mut ends, mut incomplete) = (Vec::new(), Vec::new());
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut starts = 0;
    let enough = options.starts.max(1);
    // Frames that are met in arms of which some word has no pose: other arms may have all, farther away.
    while starts < enough || !incomplete.is_empty() && starts < WIDE_SHARE * enough {
        let is_wide = starts >= enough;
        let scatter: &[(f64, f64)] = if is_wide { &WIDE } else { &SCATTER };
        let start = match starts {
            0 => base_line.clone(),
            n => scattered(search.problem, &base_line, scatter[n as usize % scatter.len()], &mut rng),
        };
        starts += 1;
        options.handle.count();
        if platforms && starts > EARLY && !is_wide {
            let shift = SHIFT[(starts / 2) as usize % SHIFT.len()];
            let late = match starts % 2 {
                0 => Start { unknowns: &start, shift: None },
                _ => Start { unknowns: &base_line, shift: Some(shift) },
            };
            keep(&mut ends, lift_from(&mut search, &late, &mut rng));
        }
        let ways: &[fn(&mut Search, &DVector<f64>) -> Way] = match (starts, platforms) {
            (1, true) => &[descend, follow, lift],
            (1, false) => &[descend, follow],
            (..=EARLY, true) => &[descend, lift],
            (_, true) if is_wide => &[descend, lift],
            (_, true) => &[],
            (_, false) => &[descend],
        };
        for way in ways {
            if keep(&mut ends, way(&mut search, &start)) {
                break;
            }
        }
        if let Some((_, solved)) = ends.pop_if(|(error, _)| *error < SOLVED) {
            let closest_solution = search.minimise_change(solved.clone());
            if let Some(unknowns) = search.assembled(&closest_solution, &solved) {
                return Ok(Found { unknowns, iterations: search.iterations, starts });
            }
            incomplete.push((closest_solution, solved));
        }
        if options.handle.is_ended() {
            break;
        }
    }
    // No start leaves every word a pose: what no arm file can do without is left, of the first that can have it.
    let needed = std::mem::replace(&mut search.problem.needed, by_file);
    if let Some(unknowns) =
        incomplete.iter().take(TRIED).find_map(|(closest, solved)| search.assembled(closest, solved))
    {
        return Ok(Found { unknowns, iterations: search.iterations, starts });
    }
    ends.extend(incomplete.into_iter().map(|(_, solved)| (0.0, solved)));
    let Some((_, nearest)) = ends.iter().min_by(|a, b| a.0.total_cmp(&b.0)) else {
        search.problem.residual(&base_line)?;
        return Ok(Found { unknowns: base_line, iterations: search.iterations, starts });
    };
    let nearest = nearest.clone();
    let unknowns = search.closest(&ends, &options.handle).unwrap_or(nearest);
    let by_file = std::mem::replace(&mut search.problem.needed, needed);
    if search.problem.missed_m(&unknowns) == 0.0 {
        return Ok(Found { unknowns, iterations: search.iterations, starts });
    }
    // The initial arm can be assembled, within its own bounds at least.
    let mut others = vec![unknowns.clone(), base_line.clone()];
    let drawn = (0..ANYWHERE).take_while(|_| !options.handle.is_ended());
    others.extend(drawn.filter_map(|_| search.complete_between(&base_line, &mut rng)));
    let mut closest = search.closest_with_words(&ends, &others, &options.handle);
    if closest.is_none() {
        search.problem.needed = by_file;
        closest = search.closest_with_words(&ends, &others, &options.handle);
    }
    Ok(Found { unknowns: closest.unwrap_or(unknowns), iterations: search.iterations, starts })
}

impl Search<'_, '_> {
    /// An arm with a pose for every needed word, as far as one is found on the way from the initial arm to one that is drawn between all
    /// bounds.
    fn complete_between(&mut self, base_line: &DVector<f64>, rng: &mut ChaCha8Rng) -> Option<DVector<f64>> {
        let way = self.problem.anywhere(base_line, rng) - base_line;
        SHARES_OF_WAY.iter().find_map(|share| {
            let start = within(self.problem, base_line + &way * *share);
            self.with_words(&start, Keep::Little)
        })
    }

    /// A solution in which every needed word can be assembled, near `solved` or the one with the least alteration near that.
    fn assembled(&mut self, closest: &DVector<f64>, solved: &DVector<f64>) -> Option<DVector<f64>> {
        if self.problem.missed_m(closest) == 0.0 {
            return Some(closest.clone());
        }
        let complete = match self.problem.missed_m(solved) {
            0.0 => solved.clone(),
            _ => self.with_words(closest, Keep::Frames).or_else(|| self.with_words(solved, Keep::Frames))?,
        };
        self.keeps_words = true;
        let exact = self.descend(&complete, EXACT).ok().filter(|(error, _)| *error < SOLVED);
        let found = exact.map(|(_, exact)| self.minimise_change(exact));
        self.keeps_words = false;
        found
    }
}

/// Keeps where a way ended; whether it meets all frames there.
fn keep(ends: &mut Vec<(f64, DVector<f64>)>, way: Way) -> bool {
    // A start that cannot be assembled is no start; the failure of the base-line is reported.
    let Ok((error, unknowns)) = way else { return false };
    ends.push((error, unknowns));
    error < SOLVED
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

/// How the platforms' poses start: where the start has them, or with the plates between them shifted at random.
struct Start<'s> {
    unknowns: &'s DVector<f64>,
    /// Standard deviations of the shift, in the arm's length scale and rad.
    shift: Option<(f64, f64)>,
}

type Way = Result<(f64, DVector<f64>), SynthesisError>;

fn descend(search: &mut Search, start: &DVector<f64>) -> Way {
    search.descend(start, EXACT)
}

fn follow(search: &mut Search, start: &DVector<f64>) -> Way {
    search.follow(start)
}

fn lift(search: &mut Search, start: &DVector<f64>) -> Way {
    lift_from(search, &Start { unknowns: start, shift: None }, &mut ChaCha8Rng::seed_from_u64(0))
}

fn lift_from(search: &mut Search, start: &Start, rng: &mut ChaCha8Rng) -> Way {
    let length_scale_m = search.problem.base_line().length_scale_m;
    let mut lift = Lift::new(search.problem, start.unknowns)?;
    if let Some((length, angle_rad)) = start.shift {
        lift.shift((length * length_scale_m, angle_rad), rng);
    }
    let (unknowns, iterations) = lift.solve();
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
    let n_scattered = if problem.servos_fixed { problem.n_stops() } else { base_line.len() };
    let scattered = unknowns.iter_mut().take(n_scattered).enumerate();
    for (index, value) in scattered.filter(|(index, _)| !problem.is_anchor(*index)) {
        let size = if problem.is_angle(index) { angle_rad } else { length * value.abs().max(0.1) };
        if let Ok(normal) = Normal::new(0.0, size) {
            *value += normal.sample(rng);
        }
    }
    within(problem, unknowns)
}
