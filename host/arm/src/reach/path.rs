//! An order of switching from one word to another that keeps the tool within a tube.
//!
//! Every actuator that differs is switched once, to its last digit; between two rests of the arm at most this many are
//! switched at once. The tool has to rest within a distance of the straight line from its first to its last position;
//! how it moves from rest to rest is not asked, for there the arm snaps. Of all such orders one with the least number
//! of words between is found, by A*: a state is the set of actuators that have been switched and how many of them
//! since the last rest, what remains to be done is at least the rest of the actuators over those that go at once.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::fmt;

use darm_core::chain::ChainError;
use darm_core::se::Pose;
use darm_core::units::Word;

use crate::arm::{Arm, ArmScratch};

/// States that are looked at before the search gives up.
const MAX_STATES: usize = 2_000_000;

/// What an order of switching has to keep to.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Most actuators that switch at once.
    pub at_once: usize,
    /// Farthest that the tool may rest from the straight line, m.
    pub tube_m: f64,
    /// Where the servo joints stand, rad.
    pub servos_rad: Vec<f64>,
}

/// A rest on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// The word.
    pub word: Word,
    /// Pose of the tool in the base.
    pub pose_base_tool: Pose<f64>,
    /// How far the tool is from the straight line, m.
    pub off_m: f64,
}

/// Why there is no order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathError {
    /// One of the two words gives the arm no pose.
    NoPose(ChainError),
    /// No order keeps within the tube; one with a tube at least as wide as this may.
    Narrow {
        /// Of the rests outside the tube the one nearest to the line, m.
        next_m: f64,
    },
    /// Too many orders were tried.
    Unknown,
    /// The search was given up.
    GivenUp,
}

/// Actuators switched so far, a bit each in the order in which they differ, and how many since the last rest.
type State = (u64, u8);

/// From `from` to `to`: the rests, both words included.
///
/// # Errors
///
/// [`PathError::NoPose`]: one of the two words gives the arm no pose. [`PathError::Narrow`]: no order of switching
/// keeps within the tube of `limits`. [`PathError::Unknown`]: too many orders were tried to say so.
pub fn path(arm: &Arm, from: &Word, to: &Word, limits: &Limits) -> Result<Vec<Rest>, PathError> {
    path_while(arm, [from, to], limits, || true)
}

/// The same between two words, for as long as `go_on` says yes: it is asked at every state.
///
/// # Errors
///
/// As [`path`]; [`PathError::GivenUp`]: `go_on` said no.
pub fn path_while(
    arm: &Arm,
    [from, to]: [&Word; 2],
    limits: &Limits,
    go_on: impl Fn() -> bool,
) -> Result<Vec<Rest>, PathError> {
    let differing: Vec<usize> = (0..from.len()).filter(|&k| from.digit(k) != to.digit(k)).collect();
    let mut line = Line::new(arm, from, to, limits, &differing)?;
    let at_once = limits.at_once.clamp(1, usize::from(u8::MAX));
    let all = differing.iter().enumerate().fold(0, |all: u64, (bit, _)| all | 1 << bit);
    let remaining = |(mask, open): State| {
        let rest = (all & !mask).count_ones() as usize;
        let room = if open > 0 { at_once - usize::from(open) } else { 0 };
        usize::from(open > 0) + rest.saturating_sub(room).div_ceil(at_once)
    };
    let mut open = BinaryHeap::from([Reverse((remaining((0, 0)), all.count_ones(), 0, 0, (0, 0)))]);
    let mut best: HashMap<State, (usize, State)> = HashMap::from([((0, 0), (0, (0, 0)))]);
    let mut next_m = f64::INFINITY;
    while let Some(Reverse((_, _, _, rests, state))) = open.pop() {
        if best.get(&state).is_some_and(|(known, _)| *known < rests) {
            continue;
        }
        if state == (all, 0) {
            return Ok(rests_of(&mut line, &best, all));
        }
        if best.len() > MAX_STATES {
            return Err(PathError::Unknown);
        }
        if !go_on() {
            return Err(PathError::GivenUp);
        }
        let (mask, count) = state;
        let mut visit = |next: State, rests: usize, off_m: f64| {
            if best.get(&next).is_none_or(|(known, _)| rests < *known) {
                best.insert(next, (rests, state));
                let unswitched = (all & !next.0).count_ones();
                open.push(Reverse((rests + remaining(next), unswitched, (off_m * 1e6) as u64, rests, next)));
            }
        };
        match line.off_m(mask) {
            Some(off_m) if count > 0 && (off_m <= limits.tube_m || mask == all) => visit((mask, 0), rests + 1, off_m),
            Some(off_m) if count > 0 => next_m = next_m.min(off_m),
            _ => {}
        }
        if usize::from(count) < at_once {
            for bit in (0..differing.len()).map(|k| 1u64 << k).filter(|bit| mask & bit == 0) {
                let off_m = line.off_m(mask | bit).unwrap_or(f64::MAX);
                visit((mask | bit, count + 1), rests, off_m);
            }
        }
    }
    Err(PathError::Narrow { next_m })
}

/// The rests of the way that was found, from its first to its last.
fn rests_of(line: &mut Line, best: &HashMap<State, (usize, State)>, all: u64) -> Vec<Rest> {
    let mut masks = vec![all];
    let mut state = (all, 0);
    while let Some((_, before)) = best.get(&state).filter(|_| state != (0, 0)) {
        state = *before;
        if state.1 == 0 && masks.last() != Some(&state.0) {
            masks.push(state.0);
        }
    }
    let rest = |mask: u64| {
        let pose_base_tool = line.pose(mask)?;
        Some(Rest { word: line.word(mask), pose_base_tool, off_m: line.distance(&pose_base_tool) })
    };
    masks.into_iter().rev().filter_map(rest).collect()
}

/// The straight line between the first and the last position, and what belongs to it.
struct Line<'a> {
    arm: &'a Arm,
    from: &'a Word,
    to: &'a Word,
    limits: &'a Limits,
    differing: &'a [usize],
    ends: [Pose<f64>; 2],
    known: HashMap<u64, Option<f64>>,
    scratch: ArmScratch,
}

impl<'a> Line<'a> {
    fn new(
        arm: &'a Arm,
        from: &'a Word,
        to: &'a Word,
        limits: &'a Limits,
        differing: &'a [usize],
    ) -> Result<Self, PathError> {
        let mut scratch = ArmScratch::default();
        let mut pose = |word| arm.model.chain.pose_base_tool(word, &limits.servos_rad, &mut scratch);
        let ends = [pose(from).map_err(PathError::NoPose)?, pose(to).map_err(PathError::NoPose)?];
        Ok(Self { arm, from, to, limits, differing, ends, known: HashMap::new(), scratch })
    }

    fn word(&self, mask: u64) -> Word {
        let switched = self.differing.iter().enumerate().filter(|(bit, _)| mask >> bit & 1 == 1);
        switched.fold(*self.from, |word, (_, &actuator)| word.with_digit(actuator, self.to.digit(actuator)))
    }

    fn pose(&mut self, mask: u64) -> Option<Pose<f64>> {
        let word = self.word(mask);
        self.arm.model.chain.pose_base_tool(&word, &self.limits.servos_rad, &mut self.scratch).ok()
    }

    /// How far the tool is from the line; `None` where the arm cannot be assembled.
    fn off_m(&mut self, mask: u64) -> Option<f64> {
        if let Some(known) = self.known.get(&mask) {
            return *known;
        }
        let off_m = self.pose(mask).map(|pose| self.distance(&pose));
        self.known.insert(mask, off_m);
        off_m
    }

    fn distance(&self, pose: &Pose<f64>) -> f64 {
        let along = self.ends[1].position - self.ends[0].position;
        let to = pose.position - self.ends[0].position;
        let share = (to.dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (to - along * share).norm()
    }
}

impl fmt::Display for PathError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoPose(reason) => write!(f, "a word gives the arm no pose: {reason}"),
            Self::Narrow { next_m } => write!(
                f,
                "no order of switching keeps the tool so near the straight line: allow a deviation of more than {:.1} mm, or more switches \
                 at once",
                1e3 * next_m
            ),
            Self::GivenUp => write!(f, "the search was given up"),
            Self::Unknown => {
                write!(
                    f,
                    "{MAX_STATES} states were tried without an end: allow a larger deviation, or more switches at once"
                )
            }
        }
    }
}

impl std::error::Error for PathError {}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::path::Path;

    use super::{Limits, PathError, path, path_while};
    use crate::arm::Arm;
    use crate::reach::exact::switches;

    fn arm() -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml")).unwrap()
    }

    #[test]
    fn the_way_keeps_to_its_limits_and_is_the_shortest() {
        let (arm, from, to) = (arm(), "000000000000".parse().unwrap(), "111011101110".parse().unwrap());
        for (at_once, tube_m, words) in [(6, 10.0, 3), (3, 10.0, 4), (9, 0.0, 2), (1, 10.0, 10), (4, 0.35, 4)] {
            let limits = Limits { at_once, tube_m, servos_rad: Vec::new() };
            let rests = path(&arm, &from, &to, &limits).unwrap();
            assert_eq!(rests.len(), words, "{limits:?}");
            assert_eq!((rests[0].word, rests[rests.len() - 1].word), (from, to));
            assert!(rests.iter().all(|rest| rest.off_m <= tube_m + 1e-12));
            let largest = rests.windows(2).map(|pair| switches(&pair[0].word, &pair[1].word, 12)).max();
            assert!(largest <= Some(at_once));
        }
    }

    #[test]
    fn a_tube_too_narrow_is_told() {
        let limits = Limits { at_once: 1, tube_m: 1e-3, servos_rad: Vec::new() };
        let error = path(&arm(), &"000000000000".parse().unwrap(), &"111111111111".parse().unwrap(), &limits);
        assert!(matches!(error, Err(PathError::Narrow { next_m }) if next_m > 1e-3), "{error:?}");
    }

    #[test]
    fn a_search_ends_when_it_is_given_up() {
        let (from, to) = ("000000000000".parse().unwrap(), "111111111111".parse().unwrap());
        let limits = Limits { at_once: 1, tube_m: 1e-3, servos_rad: Vec::new() };
        let asked = Cell::new(0);
        let go_on = || asked.replace(asked.get() + 1) < 10;
        assert_eq!(path_while(&arm(), [&from, &to], &limits, go_on), Err(PathError::GivenUp));
        assert_eq!(asked.get(), 11);
    }

    #[test]
    fn a_word_leads_to_itself() {
        let word = "010101010101".parse().unwrap();
        let limits = Limits { at_once: 1, tube_m: 0.0, servos_rad: Vec::new() };
        assert_eq!(path(&arm(), &word, &word, &limits).unwrap().len(), 1);
    }
}
