//! Suárez and Claret, Searching a valid hand configuration to perform a given grasp: Table 1, Figures 4 to 8, and the
//! method to use on constraints that the training never saw, for two hands.

mod check;
mod examples;

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use darm_core::se::Pose;
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use darm_papers::grasp::assembly::HandFile;
use darm_papers::grasp::contact::{Configuration, Contacts};
use darm_papers::grasp::file::read_hand;
use darm_papers::grasp::hand::Hand;
use darm_papers::grasp::layout::{ANGLES, COORDINATES};
use darm_papers::grasp::library::Library;
use darm_papers::grasp::paper::{End, Settings};
use darm_papers::grasp::train::{Chosen, Outcomes, PAPER_LAMBDAS, PAPER_SUCCESS, Training};
use darm_papers::grasp::{plot, solve};
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use xtask::setup;

/// Finding a hand's configuration for a grasp: Table 1, Figures 4 to 8, and the method to use, for two hands
#[derive(clap::Args, Serialize, Deserialize)]
pub(crate) struct Grasp {
    /// Constraints of the training
    #[arg(long, default_value_t = 10_000)]
    n: usize,
    /// Constraints of the comparison, which no training has seen
    #[arg(long, default_value_t = 10_000)]
    held_out: usize,
    /// Values of λ in the training
    #[arg(long, default_value_t = 100)]
    lambdas: usize,
}

const SEED: u64 = 1;
/// Of the comparison.
const HELD_OUT_SEED: u64 = 2;
const LIBRARY_SEED: u64 = 3;
const LIBRARY: usize = 10_000;
/// The longest sequence of the paper.
const LENGTH: usize = 10;
/// Constraints of one item.
const BATCH: usize = 100;
/// Constraints that are searched for examples like the paper's.
const EXAMPLES: usize = 2000;

/// The hand of the paper's method, and another one; names of their figures.
const HANDS: [(&str, &str, &str); 2] = [
    ("Levenberg-Marquardt", "examples/allegro_hand.toml", "examples/allegro_hand.urdf"),
    ("LEAP hand", "examples/leap_hand.toml", "examples/leap_hand.xml"),
];

/// What one method came to on one constraint.
#[derive(Serialize, Deserialize)]
pub(crate) struct Run {
    /// The start or the number of the λ that solved it.
    solved_by: Option<usize>,
    iterations: u32,
    /// Of the processor: other programs on the machine do not count.
    time_s: f64,
    /// The angles of an answer, rad.
    angles: Vec<f64>,
    /// What the independent forward kinematics finds wrong.
    faults: Faults,
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
struct Faults {
    collides: bool,
    is_past_limits: bool,
    error_m: f64,
}

/// How far contacts may be to the side of a fingertip.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Range {
    /// "Approximately a quarter of the sphere surface", as printed: with bends from 0 to 90°, ±90° are exactly a quarter.
    Printed,
    /// That of the hand's file, ±45°: 18 % of the sphere.
    Hand,
}

impl Range {
    const ALL: [Self; 2] = [Self::Printed, Self::Hand];

    fn training(self) -> &'static str {
        match self {
            Self::Printed => "training with the printed range",
            Self::Hand => "training",
        }
    }

    /// How the names of its figures begin.
    fn method(self) -> &'static str {
        match self {
            Self::Printed => "paper's method, range as printed",
            Self::Hand => "paper's method",
        }
    }

    fn file(self, figure: &str) -> String {
        match self {
            Self::Printed => format!("{figure}.svg"),
            Self::Hand => format!("{figure}-45-deg.svg"),
        }
    }

    /// The hand with this range.
    fn of(self, hand: &Hand) -> Hand {
        let mut hand = hand.clone();
        if self == Self::Printed {
            for finger in hand.limits.chunks_mut(COORDINATES) {
                finger[COORDINATES - 1] = [-FRAC_PI_2, FRAC_PI_2];
            }
        }
        hand
    }
}

/// What came of one item.
#[derive(Serialize, Deserialize)]
pub(crate) enum Outcome {
    /// For each constraint of a training, a digit for each λ: 1 where it solves.
    Trained { range: Range, rows: Vec<String> },
    /// Some held-out constraints by both methods, and some with contacts in an order that nobody gave.
    Allegro { paper: Vec<Run>, ours: Vec<Run>, unassigned: Vec<Run> },
    /// Some of the other hand.
    Leap(Vec<Run>),
}

/// A hand and constraints that no training saw.
struct Subject {
    file: HandFile,
    library: Library,
    held_out: Vec<Contacts>,
}

/// Both hands; and for each range the hand that is trained, and the constraints of its training.
pub(crate) struct Bench {
    allegro: Subject,
    leap: Subject,
    trainings: [(Hand, Vec<Contacts>); 2],
}

impl Subject {
    fn new(hand: &str, count: usize) -> Result<Self> {
        let file = read_hand(&setup::root().join(hand))?;
        let library = Library::draw(&file.hand, LIBRARY, LIBRARY_SEED);
        let held_out = file.hand.draw_many(count, HELD_OUT_SEED);
        ensure!(held_out.len() == count && !library.is_empty(), "{hand}: every posture that was drawn collides");
        Ok(Self { file, library, held_out })
    }
}

impl Grasp {
    fn training(&self) -> Training {
        Training { count: self.n, lambdas: self.lambdas, seed: SEED, settings: Settings::default() }
    }

    /// The items of a training, and those of a hand.
    fn batches(&self) -> [usize; 2] {
        [self.n.div_ceil(BATCH), self.held_out.div_ceil(BATCH)]
    }
}

impl Job for Grasp {
    const COMMAND: &'static str = "papers grasp";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let named = |what: &'static str, count: usize| {
            (0..count).step_by(BATCH).map(move |first| format!("{what}, constraints from {first}"))
        };
        let hands = ["Allegro hand", "LEAP hand"].into_iter().flat_map(|hand| named(hand, self.held_out));
        Ok(Range::ALL.into_iter().flat_map(|range| named(range.training(), self.n)).chain(hands).collect())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        let [allegro, leap] = [HANDS[0], HANDS[1]].map(|(_, hand, _)| Subject::new(hand, self.held_out));
        let allegro = allegro?;
        let trainings = Range::ALL.map(|range| {
            let hand = range.of(&allegro.file.hand);
            let constraints = hand.draw_many(self.n, SEED);
            (hand, constraints)
        });
        Ok(Bench { allegro, leap: leap?, trainings })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let [trained, held_out] = self.batches();
        let batch = |all: &[Contacts], index: usize| all.chunks(BATCH).nth(index).map(<[Contacts]>::to_vec);
        let missing = "an item past the last";
        if let Some((range, (hand, all))) = Range::ALL.iter().zip(&bench.trainings).nth(item / trained.max(1)) {
            let training = self.training();
            let digits = |solved: Vec<bool>| solved.iter().map(|solved| if *solved { '1' } else { '0' }).collect();
            let constraints = batch(all, item % trained).context(missing)?;
            let rows = constraints.iter().map(|contacts| digits(training.solved(hand, contacts))).collect();
            return Ok(Outcome::Trained { range: *range, rows });
        }
        let item = item - Range::ALL.len() * trained;
        if item >= held_out {
            let Subject { file, library, held_out: all } = &bench.leap;
            let all = batch(all, item - held_out).context(missing)?;
            return Ok(Outcome::Leap(
                all.iter().map(|contacts| by_us(file, library, contacts)).collect::<Result<_>>()?,
            ));
        }
        let Subject { file, library, held_out: all } = &bench.allegro;
        // A tenth of all constraints, the first ones.
        let unassigned = all.len().div_ceil(10).saturating_sub(item * BATCH).min(BATCH);
        let all = batch(all, item).context(missing)?;
        let unassigned = &all[..unassigned.min(all.len())];
        Ok(Outcome::Allegro {
            paper: all.iter().map(|contacts| by_paper(file, contacts)).collect::<Result<_>>()?,
            ours: all.iter().map(|contacts| by_us(file, library, contacts)).collect::<Result<_>>()?,
            unassigned: unassigned
                .iter()
                .map(|contacts| unassigned_by_us(file, library, contacts))
                .collect::<Result<_>>()?,
        })
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let mut solved = Range::ALL.map(|_| Vec::new());
        let [mut by_paper, mut ours, mut unassigned, mut leap] = [const { Vec::<&Run>::new() }; 4];
        for outcome in outcomes {
            match outcome {
                Outcome::Trained { range, rows } => {
                    let rows = rows.iter().map(|row| row.chars().map(|c| c == '1').collect());
                    let mut all = Range::ALL.iter().zip(&mut solved);
                    all.find(|(other, _)| *other == range).context("a range is missing")?.1.extend(rows);
                }
                Outcome::Allegro { paper: first, ours: second, unassigned: third } => {
                    by_paper.extend(first);
                    ours.extend(second);
                    unassigned.extend(third);
                }
                Outcome::Leap(runs) => leap.extend(runs),
            }
        }
        let folder = setup::root().join("target/papers/grasp");
        std::fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
        let mut figures = Vec::new();
        for (range, solved) in Range::ALL.into_iter().zip(solved) {
            figures.extend(reported(range, &Outcomes { lambdas: self.training().values(), solved }, &folder)?);
        }
        let allegro = Judge::new(HANDS[0])?;
        examples::pictures(&allegro.file, &allegro.file.hand.draw_many(EXAMPLES, HELD_OUT_SEED), &folder)?;
        figures.extend(allegro.compared("paper's method, held out", &by_paper)?);
        figures.extend(allegro.compared(HANDS[0].0, &ours)?);
        figures.extend(assigned(&unassigned)?);
        figures.extend(Judge::new(HANDS[1])?.compared(HANDS[1].0, &leap)?);
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        SEED
    }
}

/// Table 1, Figures 4 and 5, and what the training promises.
fn reported(range: Range, trained: &Outcomes, folder: &Path) -> Result<Vec<Figure>> {
    let sequence = trained.sequence(LENGTH);
    ensure!(!sequence.is_empty(), "no λ solves any constraint");
    println!("{}:", range.training());
    table(&sequence);
    for (name, svg) in [
        (range.file("figure-4"), plot::selection(&trained.lambdas, &sequence)),
        (range.file("figure-5"), plot::accumulation(&sequence)),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, svg).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    println!("Figures 4 and 5: {}\n", folder.display());
    let accumulated = |chosen: Option<&Chosen>| chosen.map_or(0.0, |chosen| chosen.accumulated);
    let (first, all) = (accumulated(sequence.first()), accumulated(sequence.last()));
    let method = range.method();
    Ok(vec![
        Figure::new(&format!("grasp: {method}, first lambda"), first, "%")?,
        Figure::new(&format!("grasp: {method}, first lambda, at most"), first, "%")?,
        Figure::new(&format!("grasp: {method}, ten lambdas"), all, "%")?,
    ])
}

/// Table 1, ours beside the paper's.
fn table(sequence: &[Chosen]) {
    println!("Table 1: the sequence of λ, and what it solves; the paper gives the first two percentages");
    println!("{:>3} {:>7} {:>10} {:>12} {:>13} {:>10}", "k", "λ", "of rest %", "of all %", "λ, paper", "of rest %");
    for (k, chosen) in sequence.iter().enumerate() {
        let paper = PAPER_SUCCESS.get(k).map_or(String::new(), |success| format!("{success:.2}"));
        let Chosen { lambda, rate, accumulated, .. } = chosen;
        let paper_lambda = PAPER_LAMBDAS.get(k).map_or(String::new(), |lambda| format!("{lambda:.2}"));
        println!("{:>3} {lambda:>7.2} {rate:>10.2} {accumulated:>12.2} {paper_lambda:>13} {paper:>10}", k + 1);
    }
    let lambdas: Vec<_> = sequence.iter().map(|chosen| format!("{:.4}", chosen.lambda)).collect();
    println!("{}: lambdas = [{}]\n", HANDS[0].1, lambdas.join(", "));
}

/// The paper's method with the sequence of the hand's file.
fn by_paper(file: &HandFile, contacts: &Contacts) -> Result<Run> {
    let start_s = processor_s();
    let attempts = file.hand.search(&file.lambdas, contacts, &Settings::default());
    let time_s = processor_s() - start_s;
    let last = attempts.last().context("there is no λ")?;
    let is_solved = last.end == End::Solved;
    Ok(Run {
        solved_by: is_solved.then_some(attempts.len()),
        iterations: attempts.iter().map(|attempt| attempt.iterations).sum(),
        time_s,
        angles: last.configuration.angles.to_vec(),
        faults: checked(file, is_solved, &last.configuration, contacts)?,
    })
}

/// Time that this thread has had of the processor, s.
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn by_us(file: &HandFile, library: &Library, contacts: &Contacts) -> Result<Run> {
    let start_s = processor_s();
    let solution = file.hand.solve(library, contacts, &solve::Settings::default());
    let time_s = processor_s() - start_s;
    Ok(Run {
        solved_by: solution.is_solved.then_some(solution.starts),
        iterations: solution.iterations,
        time_s,
        angles: solution.configuration.angles.to_vec(),
        faults: checked(file, solution.is_solved, &solution.configuration, contacts)?,
    })
}

/// Faults of an answer, by the robot's own forward kinematics; what is no answer has none.
fn checked(file: &HandFile, is_solved: bool, configuration: &Configuration, contacts: &Contacts) -> Result<Faults> {
    if !is_solved {
        return Ok(Faults::default());
    }
    let verdict = file.cross_check.judge(&file.hand, configuration, contacts)?;
    Ok(Faults {
        collides: verdict.collision.is_some(),
        is_past_limits: verdict.past_limit_rad > 0.0,
        error_m: verdict.point_m,
    })
}

/// A hand and its robot's file, by which answers are judged.
struct Judge {
    file: HandFile,
    robot: PathBuf,
}

impl Judge {
    fn new((_, hand, robot): (&str, &str, &str)) -> Result<Self> {
        Ok(Self { file: read_hand(&setup::root().join(hand))?, robot: setup::root().join(robot) })
    }

    /// Of the answers those that collide by the independent program.
    fn collisions(&self, runs: &[&Run]) -> Result<usize> {
        let answers = runs.iter().filter(|run| run.solved_by.is_some());
        let configuration = |run: &&Run| -> Option<Configuration> {
            let angles: [f64; ANGLES] = run.angles.clone().try_into().ok()?;
            Some(Configuration { pose_world_palm: Pose::identity(), angles })
        };
        check::collisions(&self.robot, &self.file, &answers.filter_map(configuration).collect::<Vec<_>>())
    }

    fn compared(&self, method: &str, runs: &[&Run]) -> Result<Vec<Figure>> {
        let name = |what: &str| format!("grasp: {method}, {what}");
        let solved =
            |starts: usize| runs.iter().filter(|run| run.solved_by.is_some_and(|by| by <= starts)).count() as f64;
        let percent = |starts: usize| 100.0 * solved(starts) / runs.len() as f64;
        let faults = |is: fn(&Faults) -> bool| runs.iter().filter(|run| is(&run.faults)).count() as f64;
        let max_m = runs.iter().map(|run| run.faults.error_m).fold(0.0, f64::max);
        let iterations: f64 = runs.iter().map(|run| f64::from(run.iterations)).sum();
        let time_s: f64 = runs.iter().map(|run| run.time_s).sum();
        Ok(vec![
            Figure::new(&name("one start"), percent(1), "%")?,
            Figure::new(&name("two starts"), percent(2), "%")?,
            Figure::new(&name("ten starts"), percent(LENGTH), "%")?,
            Figure::new(&name("answers that collide"), faults(|fault| fault.collides), "")?,
            Figure::new(&name("answers that collide, by MuJoCo"), self.collisions(runs)? as f64, "")?,
            Figure::new(&name("answers past a limit"), faults(|fault| fault.is_past_limits), "")?,
            Figure::new(&name("largest error of an answer"), 1e3 * max_m, "mm")?,
            Figure::new(&name("iterations for a grasp"), iterations / solved(LENGTH), "")?,
            Figure::new(&name("time for a grasp"), 1e3 * time_s / solved(LENGTH), "ms")?,
        ])
    }
}

/// Contacts in an order that nobody gave.
fn unassigned_by_us(file: &HandFile, library: &Library, contacts: &Contacts) -> Result<Run> {
    let shuffled = [2, 3, 1, 0].map(|k: usize| contacts[k]);
    let start_s = processor_s();
    let (solution, order) = file.hand.solve_any(library, &shuffled, &solve::Settings::default());
    let time_s = processor_s() - start_s;
    let wanted = order.map(|k| shuffled[k]);
    let faults = checked(file, solution.is_solved, &solution.configuration, &wanted)?;
    let solved_by = solution.is_solved.then_some(solution.starts);
    let angles = solution.configuration.angles.to_vec();
    Ok(Run { solved_by, iterations: solution.iterations, time_s, angles, faults })
}

fn assigned(runs: &[&Run]) -> Result<Vec<Figure>> {
    let solved = runs.iter().filter(|run| run.solved_by.is_some()).count() as f64;
    let wrong = runs.iter().filter(|run| run.faults.collides || run.faults.is_past_limits).count() as f64;
    let time_s: f64 = runs.iter().map(|run| run.time_s).sum();
    Ok(vec![
        Figure::new("grasp: fingers not assigned, solved", 100.0 * solved / runs.len() as f64, "%")?,
        Figure::new("grasp: fingers not assigned, wrong answers", wrong, "")?,
        Figure::new("grasp: fingers not assigned, time for a grasp", 1e3 * time_s / solved, "ms")?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_range_is_a_quarter_of_the_sphere() {
        let hand = read_hand(&setup::root().join(HANDS[0].1)).unwrap().hand;
        // Of the sphere: the bend is an angle about an axis, the area grows with the sine to the side.
        let share = |hand: &Hand, finger: usize| {
            let [.., bend, side] = &hand.limits[COORDINATES * finger..COORDINATES * (finger + 1)] else { panic!() };
            (bend[1] - bend[0]) * (side[1].sin() - side[0].sin()) / (4.0 * std::f64::consts::PI)
        };
        for finger in 0..4 {
            assert!((share(&Range::Printed.of(&hand), finger) - 0.25).abs() < 1e-12);
            assert!((share(&Range::Hand.of(&hand), finger) - 0.1768).abs() < 1e-4);
        }
    }

    #[test]
    fn items_of_both_trainings_come_before_those_of_the_hands() {
        let small = Grasp { n: 2, held_out: 1, lambdas: 2 };
        let (items, bench) = (small.items().unwrap(), small.bench(Shard::ALL).unwrap());
        let ranges: Vec<Option<Range>> = (0..items.len())
            .map(|item| match small.run(&bench, item).unwrap() {
                Outcome::Trained { range, rows } => {
                    assert_eq!((rows.len(), items[item].starts_with(range.training())), (2, true));
                    Some(range)
                }
                _ => None,
            })
            .collect();
        assert!(ranges == [Some(Range::Printed), Some(Range::Hand), None, None], "{items:?}");
    }
}
