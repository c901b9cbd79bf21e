//! Layouts of measurements: what other people's logs look like. The rules of each stand in [`rules`](super::rules).

use clap::ValueEnum;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use darm_diagnose::measurement_plan::PlanStep;
use darm_diagnose::prepare::sampling::usual_step_s;
use darm_diagnose::truth::Kind;
use darm_measure::Run;
use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Rows of a short measurement, and of a long one.
const SHORT: std::ops::Range<usize> = 60..121;
/// Repeats of one word where there are few.
const FEW_REPEATS: std::ops::Range<usize> = 1..5;
/// Share of the rows that are far off, beside the usual one.
pub(super) const MORE_OUTLIERS: f64 = 0.03;
/// Way of a camera that drifts over a run, in units of its scatter.
const CAMERA_DRIFT: std::ops::Range<f64> = 8.0..32.0;
/// Share of a step of time that stamps are off by (standard deviation).
const JITTER: f64 = 0.02;
/// Share of the rows that are lost.
const LOST: f64 = 0.05;

/// How a measurement was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Layout {
    /// A measurement plan as it is made: rows held out, words repeated in a row
    Plan,
    /// No column of held-out rows
    NoHeldOut,
    /// Repeats at other times
    Scattered,
    /// Repeats at other times, no column of held-out rows
    ScatteredNoHeldOut,
    /// No repeats
    NoRepeats,
    /// No repeats, no column of held-out rows
    NothingToCompare,
    /// One to four repeats
    FewRepeats,
    /// 60 to 120 rows, no repeats
    Short,
    /// Neither supply nor temperature
    Unmeasured,
    /// 5 % outliers
    Outliers,
    /// A camera that drifts
    CameraDrift,
    /// Signals with stamps off by 2 % of a step
    Jitter,
    /// Signals of which 5 % of the rows are lost
    LostRows,
    /// Signals with stamps rounded to two steps
    RoundedStamps,
}

impl Layout {
    /// Whether signals are measured, not tool poses.
    pub(super) fn is_of_signals(self) -> bool {
        matches!(self, Self::Jitter | Self::LostRows | Self::RoundedStamps)
    }

    /// Whether a run of this layout is long enough for effects to be named.
    pub(super) fn suffices(self) -> bool {
        self != Self::Short
    }

    /// Whether an arm may have this effect: one that follows what is not measured has no right law.
    pub(super) fn allows(self, kind: Kind) -> bool {
        let follows_surroundings = matches!(kind, Kind::SupplyStroke | Kind::ThermalGrowth | Kind::Crowding);
        self != Self::Unmeasured || !follows_surroundings
    }

    /// The steps of a plan in this layout.
    pub(super) fn steps(self, plan: &[PlanStep], rng: &mut impl Rng) -> Vec<PlanStep> {
        let mut steps = plan.to_vec();
        match self {
            Self::Scattered | Self::ScatteredNoHeldOut => steps = scattered(steps, rng),
            Self::NoRepeats | Self::NothingToCompare => steps.retain(|step| !step.repeat),
            Self::FewRepeats => {
                let mut left = rng.random_range(FEW_REPEATS);
                steps.retain(|step| {
                    let is_kept = !step.repeat || left > 0;
                    left -= usize::from(step.repeat && left > 0);
                    is_kept
                });
            }
            Self::Short => {
                steps.retain(|step| !step.repeat);
                let n = rng.random_range(SHORT).min(steps.len());
                let first = rng.random_range(0..=steps.len() - n);
                steps = steps[first..first + n].to_vec();
            }
            _ => {}
        }
        if matches!(self, Self::NoHeldOut | Self::ScatteredNoHeldOut | Self::NothingToCompare) {
            steps.iter_mut().for_each(|step| step.held_out = false);
        }
        steps
    }

    /// What this layout makes of a run of tool poses whose camera scatters by so much, m.
    pub(super) fn change(self, run: &mut Run, scatter_m: f64, rng: &mut impl Rng) {
        if self == Self::Unmeasured {
            run.samples.iter_mut().for_each(|sample| (sample.supply, sample.temperature_c) = (None, None));
        }
        if self == Self::CameraDrift {
            let (from_s, to_s) = run
                .samples
                .iter()
                .fold((f64::INFINITY, 0.0f64), |(from, to), sample| (from.min(sample.time_s), to.max(sample.time_s)));
            let angle = rng.random_range(0.0..std::f64::consts::TAU);
            let way_m = rng.random_range(CAMERA_DRIFT) * scatter_m;
            for sample in &mut run.samples {
                let share = (sample.time_s - from_s) / (to_s - from_s);
                let mut moved = Twist::<f64>::zero();
                moved.linear = Vec3::new(angle.cos(), angle.sin(), 0.0) * (way_m * share);
                sample.pose = Pose::exp(&moved) * sample.pose;
            }
        }
    }

    /// What this layout makes of the stamps of signals, s; which rows are kept.
    pub(crate) fn change_stamps(self, time_s: &mut [f64], rng: &mut impl Rng) -> Vec<bool> {
        let steps_s: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let step_s = usual_step_s(&steps_s);
        match self {
            Self::Jitter => time_s.iter_mut().for_each(|time_s| {
                let normal = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
                *time_s += JITTER * step_s * normal;
            }),
            Self::RoundedStamps => {
                time_s.iter_mut().for_each(|time_s| *time_s = (*time_s / (2.0 * step_s)).round() * 2.0 * step_s);
            }
            _ => {}
        }
        time_s.iter().map(|_| self != Self::LostRows || !rng.random_bool(LOST)).collect()
    }
}

/// The repeats of a plan made at other times, each after a step to the word that it comes from.
fn scattered(steps: Vec<PlanStep>, rng: &mut impl Rng) -> Vec<PlanStep> {
    let (mut repeats, mut visits): (Vec<PlanStep>, Vec<PlanStep>) = (Vec::new(), Vec::new());
    for step in steps {
        match visits.last() {
            Some(first) if step.repeat => repeats.push(PlanStep { repeat: false, ..first.clone() }),
            _ => visits.push(step),
        }
    }
    let mut before: Vec<usize> = (0..repeats.len()).map(|_| rng.random_range(1..visits.len())).collect();
    before.sort_unstable();
    repeats.shuffle(rng);
    let mut places = before.into_iter().zip(repeats).peekable();
    let mut all: Vec<PlanStep> = Vec::new();
    for (index, step) in visits.into_iter().enumerate() {
        while let Some((_, repeat)) = places.next_if(|(place, _)| *place == index) {
            let current = all.last().map_or(repeat.previous, |last| last.word);
            let aside =
                PlanStep { word: repeat.previous, previous: current, held_out: step.held_out, ..repeat.clone() };
            all.push(aside);
            all.push(repeat);
        }
        let previous = all.last().map_or(step.previous, |last| last.word);
        all.push(PlanStep { previous, ..step });
    }
    all
}
