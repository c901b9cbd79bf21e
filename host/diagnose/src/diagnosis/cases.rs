//! Each law of a force and of a held position has a case that it alone explains, and stays out of those of all others.
//!
//! The cases are made by equations of their own, not by the laws': friction turns round as v/√(v² + c²), bristles stick and
//! slip, a delayed channel is delayed. Each diagnosis names the law of the case, and nothing else.

use std::f64::consts::TAU;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::diagnosis::{SignalOptions, diagnose_table};
use crate::linearise::model::{Model, Predictor};
use crate::outcome::Verdict;
use darm_measure::table::{Names, Table};

const ROWS: u32 = 1200;
const STEP_S: f64 = 0.05;
const BORE_M: f64 = 0.025;

/// One row of a measurement: t, s; x, mm (of a held joint its target, counts); v, mm/s; p, bar (of a held joint its load);
/// the temperature less its mean, K; and what was there before.
struct Now<'a> {
    t: f64,
    x: f64,
    v: f64,
    p: f64,
    warm: f64,
    before: &'a mut Before,
}

/// What a case remembers.
#[derive(Default)]
struct Before {
    x: Option<f64>,
    bristle: f64,
    way: f64,
}

impl Now<'_> {
    /// Dry friction with this speed of turning round, mm/s.
    fn dry(&self, creep: f64) -> f64 {
        self.v / self.v.hypot(creep)
    }

    /// A bristle that bends by as much, mm, before it slips.
    fn bristle(&mut self, bend: f64) -> f64 {
        let dx = self.x - self.before.x.unwrap_or(self.x);
        self.before.bristle = (self.before.bristle + dx / bend).clamp(-1.0, 1.0);
        self.before.bristle
    }

    /// The way gone, mm.
    fn way(&mut self) -> f64 {
        self.before.way += (self.x - self.before.x.unwrap_or(self.x)).abs();
        self.before.way
    }
}

/// The name of a law, and what its case adds: N, or counts.
type Case = (&'static str, fn(&mut Now) -> f64);

const FORCES: [Case; 18] = [
    ("offset", |_| 5.0),
    ("spring", |now| 0.4 * now.x),
    ("offset-drift", |now| 0.15 * now.t),
    ("step-in-time", |now| if now.t < 22.5 { 0.0 } else { 5.0 }),
    ("viscous-friction", |now| 0.5 * now.v),
    ("coulomb-friction", |now| 6.0 * now.dry(1.0)),
    ("stribeck-friction", |now| 8.0 * now.dry(0.3) / (1.0 + (now.v / 4.0).powi(2))),
    ("presliding-friction", |now| 6.0 * now.bristle(3.0)),
    ("position-dependent-friction", |now| 0.3 * now.x * now.bristle(3.0)),
    ("load-dependent-friction", |now| 2.0 * now.p * now.dry(1.0)),
    ("load-dependent-presliding", |now| 2.0 * now.p * now.bristle(3.0)),
    ("load-dependent-viscosity", |now| 0.2 * now.p * now.v),
    ("speed-dependent-offset", |now| 0.5 * now.v.abs()),
    ("gain", |now| 0.05 * area_n_per_bar() * now.p),
    ("delay", |now| area_n_per_bar() * (pressure(now.t - 0.06) - pressure(now.t))),
    ("thermal-drift", |now| now.warm),
    ("thermal-viscosity", |now| 0.1 * now.warm * now.v),
    ("friction-wear", |now| 0.01 * now.way() * now.dry(0.5)),
];

const POSITIONS: [Case; 9] = [
    ("offset", |_| 5.0),
    ("offset-drift", |now| 0.15 * now.t),
    ("step-in-time", |now| if now.t < 22.5 { 0.0 } else { 5.0 }),
    ("thermal-drift", |now| now.warm),
    ("backlash", |now| 4.0 * now.bristle(5.0)),
    ("joint-compliance", |now| 3.0 * (now.p - 3.0)),
    ("backlash-by-load", |now| 4.0 * (now.p - 3.0) / (now.p - 3.0).hypot(0.02)),
    ("hysteresis", |now| 3.0 * (slack(now.t) - 3.0)),
    ("encoder-scale", |now| 0.02 * now.x),
];

fn area_n_per_bar() -> f64 {
    1e5 * std::f64::consts::FRAC_PI_4 * BORE_M * BORE_M
}

fn pressure(t: f64) -> f64 {
    3.0 + 0.5 * (0.11 * t).sin() + 0.3 * (1.7 * t).sin()
}

/// The pressure as a slack of 0.15 bar to either side follows it, from the start on.
fn slack(t: f64) -> f64 {
    (0..=(t / STEP_S) as u32)
        .map(|k| pressure(f64::from(k) * STEP_S))
        .fold(3.0, |last: f64, p| last.clamp(p - 0.15, p + 0.15))
}

fn position(t: f64) -> f64 {
    20.0 * (0.5 * t).sin() + 8.0 * (1.31 * t + 1.0).sin() + 3.0 * (2.93 * t).sin()
}

/// Steps of a target, each held for 1 s, counts.
fn target(t: f64) -> f64 {
    (100.0 * (37.0 * t.floor()).sin()).round()
}

/// Rows with what a case adds, and noise.
fn rows(case: &Case, position: fn(f64) -> f64, row: impl Fn(&Now, f64) -> String) -> String {
    let (mut random, mut before) = (ChaCha8Rng::seed_from_u64(3), Before::default());
    let mut text = String::new();
    for k in 0..ROWS {
        let t = f64::from(k) * STEP_S;
        let (x, v, warm) =
            (position(t), (position(t + 1e-4) - position(t - 1e-4)) / 2e-4, 6.0 * (TAU * t / 30.0).sin());
        let mut now = Now { t, x, v, p: pressure(t), warm, before: &mut before };
        let added = case.1(&mut now) + random.random_range(-0.5..0.5);
        text += &row(&now, added);
        before.x = Some(x);
    }
    text
}

/// The laws that a diagnosis of a table names. What it leaves may be more than noise: bristles and turns of friction have other
/// equations here than in the laws.
fn named(model: &Model, text: &str) -> String {
    let table = Table::read_text(Path::new("a.csv"), text.as_bytes(), &Names::new()).unwrap().0;
    let options = SignalOptions { seed: 1, ..SignalOptions::default() };
    let found = diagnose_table(model, &table, &options).unwrap().diagnosis;
    let laws: Vec<&str> = found.effects.iter().map(|effect| effect.law.as_str()).collect();
    let others: Vec<&str> = found.alternatives.iter().map(|other| other.law.as_str()).collect();
    match found.verdict {
        Verdict::EffectFound | Verdict::PartlyExplained => laws.join(" + "),
        verdict => format!("{verdict}: {} ({})", laws.join(" + "), others.join(", ")),
    }
}

fn all_alone(cases: &[Case], named: impl Fn(&Case) -> String + Sync) {
    let wrong = cases.par_iter().map(|case| (case.0, named(case))).filter(|(law, named)| law != named);
    assert_eq!(wrong.collect::<Vec<_>>(), []);
}

#[test]
fn each_law_of_a_force_alone_explains_its_case() {
    let model = Predictor::Cylinder { bore_m: BORE_M }.into();
    all_alone(&FORCES, |case| {
        let row = |now: &Now, added: f64| {
            let force = area_n_per_bar() * now.p + added;
            format!("{:.3},{:.5},{:.6},{:.4},{force:.5}\n", now.t, now.x, now.p, 20.0 + now.warm)
        };
        named(&model, &("t_s,x_mm,p_bar,temp_c,F_N\n".to_string() + &rows(case, position, row)))
    });
}

#[test]
fn each_law_of_a_held_position_alone_explains_its_case() {
    let model = Predictor::Servo.into();
    all_alone(&POSITIONS, |case| {
        let row = |now: &Now, added: f64| {
            format!("{:.3},{},{:.5},{:.6},{:.4}\n", now.t, now.x, now.x + added, now.p - 3.0, 20.0 + now.warm)
        };
        named(&model, &("t_s,target_count,position_count,load,temp_c\n".to_string() + &rows(case, target, row)))
    });
}
