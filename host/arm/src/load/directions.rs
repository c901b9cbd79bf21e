//! The directions that gravity has in the base of each stage, and the one with the largest product with a vector.
//!
//! Each stage turns the directions of the one before. As long as a table holds them, they are in a tree of boxes; behind it
//! the vector is turned back stage by stage instead, and left where a [`Support`] shows that it cannot win.

use std::collections::HashSet;

use darm_core::real::{Mat3, Vec3};
use darm_core::units::Word;

use super::PRECISION;
use super::hull::Point;
use super::support::Support;
use crate::stage_settings::joined;

/// Most directions of one table: 15 MB.
const MAX_DIRECTIONS: usize = 1 << 18;
/// Directions that are looked at one by one.
const LEAF: usize = 16;
/// Directions that are closer than this share of gravity are the same.
const SAME: f64 = 1e-10;

/// How a stage turns its top in one posture.
#[derive(Clone, Copy)]
pub(super) struct Turn {
    pub(super) rotation: Mat3<f64>,
    /// Its digits; 0 for all other actuators of the arm.
    pub(super) word: Word,
}

/// The directions of gravity in an arm.
pub(super) struct Directions {
    gravity: f64,
    /// Of the base of stage 0 and of the stages behind it, as far as they can be tabulated.
    tables: Vec<Table>,
    /// Of the bases of the stages behind those.
    supports: Vec<Support>,
    turns: Vec<Vec<Turn>>,
}

impl Directions {
    /// Those of an arm whose stages turn by `turns`, with `gravity` in the base of the first one.
    pub(super) fn new(gravity: Vec3<f64>, turns: Vec<Vec<Turn>>, rest: Word) -> Self {
        let mut directions = vec![Point { at: gravity, word: rest }];
        let mut tables = vec![Table::new(directions.clone())];
        // No stage is on the last one.
        for turns in &turns[..inner_stages(&turns)] {
            if directions.len() * turns.len() > MAX_DIRECTIONS {
                break;
            }
            directions = turned(&directions, turns, SAME * gravity.norm());
            tables.push(Table::new(directions.clone()));
        }
        let (n_tabulated, supports) = (tables.len() - 1, Vec::new());
        let mut all = Self { gravity: gravity.norm(), tables, supports, turns };
        for stage in n_tabulated..inner_stages(&all.turns) {
            let largest = |direction: &Vec3<f64>| {
                let products = all.turns[stage].iter().map(|turn| all.support(stage, &(turn.rotation * direction)));
                products.fold(f64::NEG_INFINITY, f64::max)
            };
            let support = Support::new(largest);
            all.supports.push(support);
        }
        all
    }

    /// What no product of a vector and a direction in the base of `stage` exceeds.
    fn support(&self, stage: usize, vector: &Vec3<f64>) -> f64 {
        let Some(table) = self.tables.get(stage) else {
            return self.supports[stage - self.tables.len()].bound(vector);
        };
        let mut best = Best::default();
        table.search(&Point { at: *vector, word: Word::default() }, &mut best);
        best.found.map_or(f64::NEG_INFINITY, |(value, _)| value + PRECISION * value.abs())
    }

    /// The same, looser and quicker where a table would have to be searched.
    fn bound(&self, stage: usize, vector: &Vec3<f64>) -> f64 {
        match self.tables.get(stage) {
            Some(table) => table.boxes[0].product(vector, self.gravity),
            None => self.support(stage, vector),
        }
    }

    /// The word that gives the largest product of a direction in the base of `stage` and one of `vectors`; `None` without any.
    pub(super) fn largest_product(&self, stage: usize, vectors: &[Point]) -> Option<Word> {
        let mut best = Best::default();
        self.try_all(stage, vectors, &mut best);
        best.found.map(|(_, word)| word)
    }

    /// Tries the vectors from the most promising one on.
    fn try_all(&self, stage: usize, vectors: &[Point], best: &mut Best) {
        let mut bounded: Vec<(f64, Point)> =
            vectors.iter().map(|vector| (self.bound(stage, &vector.at), *vector)).collect();
        bounded.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (bound, vector) in bounded {
            if !best.may_gain(bound) {
                return;
            }
            match self.tables.get(stage) {
                Some(table) => table.search(&vector, best),
                None => {
                    let turned =
                        |turn: &Turn| Point { at: turn.rotation * vector.at, word: joined(&turn.word, &vector.word) };
                    let turned: Vec<Point> = self.turns[stage - 1].iter().map(turned).collect();
                    self.try_all(stage - 1, &turned, best);
                }
            }
        }
    }
}

/// How many stages another one follows.
fn inner_stages(turns: &[Vec<Turn>]) -> usize {
    turns.len().saturating_sub(1)
}

/// The directions behind a stage: each different one once.
fn turned(directions: &[Point], turns: &[Turn], same: f64) -> Vec<Point> {
    let mut seen = HashSet::new();
    let mut found = Vec::new();
    for direction in directions {
        for turn in turns {
            let at = turn.rotation.tr_mul(&direction.at);
            if seen.insert([at.x, at.y, at.z].map(|x| (x / same).round() as i64)) {
                found.push(Point { at, word: joined(&direction.word, &turn.word) });
            }
        }
    }
    found
}

/// The largest product so far, and its word.
#[derive(Default)]
struct Best {
    found: Option<(f64, Word)>,
}

impl Best {
    /// Whether a product of at most `bound` could be larger by more than the [`PRECISION`].
    fn may_gain(&self, bound: f64) -> bool {
        self.found.is_none_or(|(value, _)| bound > value + PRECISION * value.abs())
    }

    fn offer(&mut self, value: f64, word: impl FnOnce() -> Word) {
        if self.found.is_none_or(|(best, _)| value > best) {
            self.found = Some((value, word()));
        }
    }
}

/// A box with its sides along the axes.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3<f64>,
    high: Vec3<f64>,
}

impl Bounds {
    fn around(points: &[Point]) -> Self {
        points.iter().fold(Self::empty(), |bounds, point| bounds.with(&point.at))
    }

    fn empty() -> Self {
        Self { low: Vec3::repeat(f64::INFINITY), high: Vec3::repeat(f64::NEG_INFINITY) }
    }

    fn with(&self, point: &Vec3<f64>) -> Self {
        Self { low: self.low.inf(point), high: self.high.sup(point) }
    }

    /// What the product of a vector and a direction of this length in the box does not exceed.
    fn product(&self, vector: &Vec3<f64>, length: f64) -> f64 {
        let along = |axis: usize| (vector[axis] * self.low[axis]).max(vector[axis] * self.high[axis]);
        (along(0) + along(1) + along(2)).min(vector.norm() * length)
    }

    fn longest_axis(&self) -> usize {
        (self.high - self.low).imax()
    }
}

/// Directions in a tree of boxes: node `k` has the children 2k + 1 and 2k + 2, each with half of its directions.
struct Table {
    directions: Vec<Point>,
    boxes: Vec<Bounds>,
}

impl Table {
    fn new(mut directions: Vec<Point>) -> Self {
        let leaves = directions.len().div_ceil(LEAF).next_power_of_two();
        let mut boxes = vec![Bounds::empty(); 2 * leaves - 1];
        build(&mut directions, 0, &mut boxes);
        Self { directions, boxes }
    }

    fn search(&self, vector: &Point, best: &mut Best) {
        self.search_node(0, &self.directions, vector, best);
    }

    fn search_node(&self, node: usize, directions: &[Point], vector: &Point, best: &mut Best) {
        let [left, right] = [2 * node + 1, 2 * node + 2];
        if right >= self.boxes.len() {
            for direction in directions {
                best.offer(direction.at.dot(&vector.at), || joined(&direction.word, &vector.word));
            }
            return;
        }
        let (first, second) = directions.split_at(directions.len() / 2);
        let bound = |node: usize| self.boxes[node].product(&vector.at, f64::INFINITY);
        let mut halves = [(bound(left), left, first), (bound(right), right, second)];
        halves.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (bound, node, directions) in halves {
            if best.may_gain(bound) {
                self.search_node(node, directions, vector, best);
            }
        }
    }
}

/// Sorts directions into the two halves of each node, along the longest side of its box.
fn build(directions: &mut [Point], node: usize, boxes: &mut [Bounds]) {
    let bounds = Bounds::around(directions);
    boxes[node] = bounds;
    if 2 * node + 2 >= boxes.len() {
        return;
    }
    let (axis, middle) = (bounds.longest_axis(), directions.len() / 2);
    if middle > 0 {
        directions.select_nth_unstable_by(middle, |a, b| a.at[axis].total_cmp(&b.at[axis]));
    }
    let (left, right) = directions.split_at_mut(middle);
    build(left, 2 * node + 1, boxes);
    build(right, 2 * node + 2, boxes);
}
