//! The method to use: projected Levenberg–Marquardt with limits, and collisions as constraints.
//!
//! The variables are the paper's (φ_T and all joints, the thumb on its contact), the residual has the five constraints of
//! each of the other fingers and a row for each pair of bodies that comes too near. A step is the least one,
//!
//! Δq = Kᵀ(KKᵀ + μI)⁻¹·e,
//!
//! with every joint that it takes past a limit put on that limit and the others moved for the rest; μ follows whether a
//! step was worth it. The redundancy of the hand, 25 − 15 joints, is what keeps the fingers apart.
//!
//! A search starts where a posture out of a library makes contacts like the requested ones ([`Library`]): the
//! nearest one first.

use darm_core::real::Vec3;
use nalgebra::{SMatrix, SVector};

use super::collision::Gap;
use super::contact::{Configuration, Contacts, RADIAN_M};
use super::hand::{Axis, Hand, Placed};
use super::jacobian::{COLUMNS, Jacobian, ROWS, Rows, jacobian};
use super::layout::{COORDINATES, FINGERS, THUMB, joints_of};
use super::library::Library;
use super::paper::Variables;

/// Pairs of bodies that are kept apart at once: the nearest ones.
const KEPT_APART: usize = 5;
/// Bodies that are closer than this may touch by the numbers of another program, m.
const CLEAR_M: f64 = 1e-6;
const ALL_ROWS: usize = ROWS + KEPT_APART;

/// Constants of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Starts, the most promising first.
    pub starts: usize,
    /// Iterations of each.
    pub max_iterations: u32,
    /// How near every pᵢ and rᵢ has to come, m.
    pub reached_m: f64,
    /// Distance that bodies are kept at while searching, m.
    pub apart_m: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { starts: 10, max_iterations: 40, reached_m: 1e-7, apart_m: 0.1e-3 }
    }
}

/// What a search came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The best configuration that was found.
    pub configuration: Configuration,
    /// The configurations on the way to it, from where its search began.
    pub path: Vec<Configuration>,
    /// Whether it meets the contacts, within the limits, and nothing collides.
    pub is_solved: bool,
    /// Largest |p* − p| or |r* − r|, m.
    pub error_m: f64,
    /// Least distance of parts that must not touch, m, as far as it is below [`Settings::apart_m`].
    pub gap_m: f64,
    /// Starts that were taken.
    pub starts: usize,
    /// Iterations of all starts.
    pub iterations: u32,
}

/// The residual in one posture and how it moves.
struct Linear {
    jacobian: SMatrix<f64, ALL_ROWS, COLUMNS>,
    rows: SVector<f64, ALL_ROWS>,
}

/// One posture on the way.
struct State {
    q: Variables,
    placed: Placed,
    configuration: Configuration,
    wanted: Contacts,
    near: Vec<Gap>,
    cost: f64,
}

/// μ at first, and its bounds, m².
const FIRST_DAMPING: f64 = 1e-5;
const MIN_DAMPING: f64 = 1e-12;
const MAX_DAMPING: f64 = 1.0;
/// A step that leaves more than this share of the cost has come to a local minimum.
const SLOW: f64 = 0.999;
/// Of all orders of the contacts, this many times the starts of one are tried.
const ORDERS_TRIED: usize = 6;

impl Hand {
    /// The configuration that meets the contacts, from one start of the library after another.
    pub fn solve(&self, library: &Library, contacts: &Contacts, settings: &Settings) -> Solution {
        let starts = library.nearest(self, contacts, settings.starts);
        let starts = starts.into_iter().map(|(_, start)| (start, *contacts));
        self.first_solved(starts, contacts, settings).0
    }

    /// As [`solve`](Self::solve) where nobody said which finger makes which contact: the contact of each finger too.
    ///
    /// All orders compete: the posture of the library whose contacts are nearest in any of them comes first.
    pub fn solve_any(
        &self,
        library: &Library,
        contacts: &Contacts,
        settings: &Settings,
    ) -> (Solution, [usize; FINGERS]) {
        let mut starts = Vec::new();
        for order in orders() {
            let ordered = order.map(|contact| contacts[contact]);
            let nearest = library.nearest(self, &ordered, settings.starts);
            starts.extend(nearest.into_iter().map(|(apart, start)| (apart, start, ordered, order)));
        }
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.truncate(ORDERS_TRIED * settings.starts);
        let descents = starts.iter().map(|(_, start, ordered, _)| (*start, *ordered));
        let (solution, of) = self.first_solved(descents, contacts, settings);
        (solution, starts.get(of).map_or(std::array::from_fn(|finger| finger), |start| start.3))
    }

    /// The first descent that solves its contacts, or the best, and its number; from the middle where there is none.
    fn first_solved(
        &self,
        descents: impl Iterator<Item = (Variables, Contacts)>,
        contacts: &Contacts,
        settings: &Settings,
    ) -> (Solution, usize) {
        let mut best: Option<(Solution, usize)> = None;
        let (mut starts, mut iterations) = (0, 0);
        for (of, (start, contacts)) in descents.enumerate() {
            let found = self.descend(start, &contacts, settings);
            starts += 1;
            iterations += found.iterations;
            let is_solved = found.is_solved;
            if best.as_ref().is_none_or(|(best, _)| found.is_better(best)) {
                best = Some((found, of));
            }
            if is_solved {
                break;
            }
        }
        let (best, of) = best.unwrap_or_else(|| (self.descend(self.middle_start(contacts), contacts, settings), 0));
        (Solution { starts, iterations, ..best }, of)
    }

    /// Levenberg–Marquardt from one start.
    fn descend(&self, start: Variables, contacts: &Contacts, settings: &Settings) -> Solution {
        let mut state = self.state(start, contacts, settings);
        let mut path = vec![state.configuration];
        let (mut damping, mut iterations) = (FIRST_DAMPING, 0);
        while iterations < settings.max_iterations && !self.is_solved(&state, settings) && damping <= MAX_DAMPING {
            let next = self.state(self.step(&state.q, &self.linear(&state, settings), damping), contacts, settings);
            iterations += 1;
            if next.cost >= state.cost {
                damping *= 10.0;
                continue;
            }
            damping = (damping * 0.1).max(MIN_DAMPING);
            let is_slow = next.cost > SLOW * state.cost;
            state = next;
            path.push(state.configuration);
            if is_slow {
                break;
            }
        }
        let errors = self.errors(&state.configuration, contacts);
        Solution {
            configuration: state.configuration,
            path,
            is_solved: self.is_solved(&state, settings),
            error_m: errors.iter().fold(0.0, |largest, error| error.point_m.max(error.center_m).max(largest)),
            gap_m: state.near.first().map_or(settings.apart_m, |gap| gap.distance_m),
            starts: 1,
            iterations,
        }
    }

    fn middle_start(&self, contacts: &Contacts) -> Variables {
        let angles = self.middle();
        Variables { turn_rad: self.initial_turn(&self.place(&angles), contacts), angles }
    }

    fn state(&self, q: Variables, contacts: &Contacts, settings: &Settings) -> State {
        let placed = self.place(&q.angles);
        let pose_world_palm = self.on_thumb(&placed, contacts, q.turn_rad);
        let wanted = contacts.map(|contact| contact.seen_from(&pose_world_palm));
        let mut near = Vec::new();
        self.shapes.near(&placed.links, settings.apart_m, |gap| near.push(gap));
        near.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        near.truncate(KEPT_APART);
        let missing = near.iter().map(|gap| (settings.apart_m - gap.distance_m).powi(2)).sum::<f64>();
        let cost = self.rows(&placed, &wanted).norm_squared() + missing;
        let configuration = Configuration { pose_world_palm, angles: q.angles };
        State { q, placed, configuration, wanted, near, cost }
    }

    /// How far each fingertip has to move and to turn, the latter in metres.
    fn rows(&self, placed: &Placed, wanted: &Contacts) -> Rows {
        let mut rows = Rows::zeros();
        for (i, tip) in placed.tips.iter().enumerate().take(THUMB) {
            let moved = wanted[i].center(self.fingers[i].tip_radius_m) - tip.position;
            let seen = tip.rotation.tr_mul(&wanted[i].direction);
            let sine = seen.x.hypot(seen.y);
            // The angle itself: the sine would be blind to a normal that points the other way.
            let turned = match sine {
                _ if sine > 1e-9 => [seen.x, seen.y].map(|part| part * sine.atan2(seen.z) / sine),
                _ if seen.z < 0.0 => [std::f64::consts::PI, 0.0],
                _ => [seen.x, seen.y],
            };
            rows.fixed_rows_mut::<3>(5 * i).copy_from(&moved);
            rows[5 * i + 3] = RADIAN_M * turned[0];
            rows[5 * i + 4] = RADIAN_M * turned[1];
        }
        rows
    }

    fn linear(&self, state: &State, settings: &Settings) -> Linear {
        let mut task: Jacobian = jacobian(&state.placed);
        for i in 0..THUMB {
            task.fixed_view_mut::<2, COLUMNS>(5 * i + 3, 0).scale_mut(RADIAN_M);
        }
        let mut linear = Linear { jacobian: SMatrix::zeros(), rows: SVector::zeros() };
        linear.jacobian.fixed_view_mut::<ROWS, COLUMNS>(0, 0).copy_from(&task);
        linear.rows.fixed_rows_mut::<ROWS>(0).copy_from(&self.rows(&state.placed, &state.wanted));
        for (k, gap) in state.near.iter().enumerate() {
            linear.rows[ROWS + k] = settings.apart_m - gap.distance_m;
            for (body, point, sign) in [(gap.pair[0], gap.points[0], 1.0), (gap.pair[1], gap.points[1], -1.0)] {
                let Some((finger, joints)) = joints_of(body) else { continue };
                for j in 0..joints {
                    let axis = state.placed.axes[COORDINATES * finger + j];
                    linear.jacobian[(ROWS + k, 1 + COORDINATES * finger + j)] +=
                        sign * lever(&axis, &point).dot(&gap.apart);
                }
            }
        }
        linear
    }

    /// The damped step within the limits.
    fn step(&self, q: &Variables, linear: &Linear, damping: f64) -> Variables {
        let mut step = SVector::<f64, COLUMNS>::zeros();
        let mut free = [true; COLUMNS];
        let mut rest = linear.rows;
        let mut gram = linear.jacobian * linear.jacobian.transpose();
        gram += SMatrix::<f64, ALL_ROWS, ALL_ROWS>::identity() * damping;
        for _ in 0..FINGERS * COORDINATES {
            let Some(factor) = gram.cholesky() else { break };
            let found = linear.jacobian.tr_mul(&factor.solve(&rest));
            let mut is_within = true;
            for k in (0..COLUMNS).filter(|k| free[*k]).collect::<Vec<_>>() {
                step[k] = found[k];
                let Some([low, high]) = k.checked_sub(1).map(|k| self.limits[k]) else { continue };
                let at = q.angles[k - 1] + found[k];
                if at < low - 1e-12 || at > high + 1e-12 {
                    // On its limit, and no longer asked.
                    step[k] = at.clamp(low, high) - q.angles[k - 1];
                    free[k] = false;
                    is_within = false;
                    let column = linear.jacobian.column(k);
                    rest -= column * step[k];
                    gram.ger(-1.0, &column, &column, 1.0);
                }
            }
            if is_within {
                break;
            }
        }
        let angles = std::array::from_fn(|k| q.angles[k] + step[1 + k]);
        Variables { turn_rad: q.turn_rad + step[0], angles: self.within_limits(&angles) }
    }

    fn is_solved(&self, state: &State, settings: &Settings) -> bool {
        // The cost is not a number where the contacts are none, and then nothing is solved.
        state.cost.is_finite()
            && state.near.first().is_none_or(|gap| gap.distance_m > CLEAR_M)
            && self.rows(&state.placed, &state.wanted).amax() < 0.5 * settings.reached_m
            && self.shapes.collision(&state.placed.links).is_none()
    }
}

impl Solution {
    fn is_better(&self, other: &Self) -> bool {
        let rank = |solution: &Self| (!solution.is_solved, solution.error_m - solution.gap_m.min(0.0));
        rank(self) < rank(other)
    }
}

/// All orders of the contacts.
fn orders() -> impl Iterator<Item = [usize; FINGERS]> {
    let digits = |n: usize| -> [usize; FINGERS] { std::array::from_fn(|k| n / FINGERS.pow(k as u32) % FINGERS) };
    let has_all = |order: &[usize; FINGERS]| (0..FINGERS).all(|k| order.contains(&k));
    (0..FINGERS.pow(FINGERS as u32)).map(digits).filter(has_all)
}

/// How a point moves with a joint, per radian.
fn lever(axis: &Axis, point: &Vec3<f64>) -> Vec3<f64> {
    axis.direction.cross(&(point - axis.point))
}
