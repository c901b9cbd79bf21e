//! Results of `darm grasp`.

use darm_core::se::rotation_log;
use darm_papers::grasp::contact::Configuration;
use darm_papers::grasp::cross_check::Verdict;
use darm_papers::grasp::hand::Hand;
use darm_papers::grasp::layout::{COORDINATES, PALM};
use darm_papers::grasp::train::{Chosen, PAPER_LAMBDAS, PAPER_SUCCESS, Training};
use serde::Serialize;

use super::Search;
use crate::ui::{Answer, columns, number};

/// A grasp, checked by the robot's forward kinematics.
#[derive(Serialize)]
pub(super) struct Found {
    starts: usize,
    iterations: u32,
    palm: Palm,
    fingers: Vec<Finger>,
    /// Largest distance of a contact from its target.
    error_m: f64,
    error_rad: f64,
    /// Links that touch in nearly all postures: their collision is not checked.
    unchecked_pairs: Vec<[String; 2]>,
}

/// Pose of the palm in the world.
#[derive(Serialize)]
struct Palm {
    /// The base frame of the robot file, whose pose it is.
    frame: String,
    position_m: [f64; 3],
    rotation_vector_rad: [f64; 3],
}

#[derive(Serialize)]
struct Finger {
    name: String,
    /// Its contact, counted from 1 in the order of the file, or of the fingers where the file names them.
    contact: usize,
    /// Four joints, then the two virtual ones of the fingertip.
    angles_rad: Vec<f64>,
}

impl Found {
    pub(super) fn new(hand: &Hand, search: &Search, configuration: &Configuration, verdict: &Verdict) -> Self {
        let finger = |((finger, angles), contact): ((&darm_papers::grasp::hand::Finger, &[f64]), &usize)| Finger {
            name: finger.name.clone(),
            contact: contact + 1,
            angles_rad: angles.to_vec(),
        };
        let fingers = hand.fingers.iter().zip(configuration.angles.chunks(COORDINATES)).zip(&search.order);
        let pose = configuration.pose_world_palm;
        Self {
            starts: search.starts,
            iterations: search.iterations,
            palm: Palm {
                frame: hand.bodies[PALM].name.clone(),
                position_m: pose.position.into(),
                rotation_vector_rad: rotation_log(&pose.rotation).into(),
            },
            fingers: fingers.map(finger).collect(),
            error_m: verdict.point_m,
            error_rad: verdict.direction_rad,
            unchecked_pairs: hand.overlapping(),
        }
    }
}

impl Answer for Found {
    fn text(&self) -> String {
        let head = ["finger", "contact", "1, deg", "2", "3", "4", "tip 5", "tip 6"].map(str::to_owned).to_vec();
        let rows = self.fingers.iter().map(|finger| {
            let angles = finger.angles_rad.iter().map(|angle| number(angle.to_degrees(), 2));
            [finger.name.clone(), finger.contact.to_string()].into_iter().chain(angles).collect()
        });
        let table = columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        let pairs: Vec<_> = self.unchecked_pairs.iter().map(|[a, b]| format!("{a} and {b}")).collect();
        let unchecked = match &pairs[..] {
            [] => String::new(),
            pairs => {
                format!("\nnot checked for collision, since they touch in nearly all postures: {}", pairs.join(", "))
            }
        };
        let vector = |v: [f64; 3], factor: f64| v.map(|x| number(factor * x, 2)).join(", ");
        format!(
            "{table}\n\npalm (frame `{}` of the robot file) at {} mm, rotation vector {} deg\n\
             contact errors up to {:.1e} mm and {:.1e} deg, no collision: checked by independent forward kinematics\n\
             {} start{}, {} iterations{unchecked}",
            self.palm.frame,
            vector(self.palm.position_m, 1e3),
            vector(self.palm.rotation_vector_rad, 180.0 / std::f64::consts::PI),
            1e3 * self.error_m,
            self.error_rad.to_degrees(),
            self.starts,
            if self.starts == 1 { "" } else { "s" },
            self.iterations
        )
    }
}

/// A trained sequence and the paper's.
#[derive(Serialize)]
pub(super) struct Trained {
    constraints: usize,
    seed: u64,
    lambdas: Vec<f64>,
    rate_percent: Vec<f64>,
    accumulated_percent: Vec<f64>,
}

impl Trained {
    pub(super) fn new(training: &Training, sequence: &[Chosen]) -> Self {
        Self {
            constraints: training.count,
            seed: training.seed,
            lambdas: sequence.iter().map(|chosen| chosen.lambda).collect(),
            rate_percent: sequence.iter().map(|chosen| chosen.rate).collect(),
            accumulated_percent: sequence.iter().map(|chosen| chosen.accumulated).collect(),
        }
    }
}

impl Answer for Trained {
    fn text(&self) -> String {
        let head = [
            "k",
            "lambda",
            "solved of the remaining, %",
            "accumulated, %",
            "paper: lambda",
            "paper: solved of the remaining, %",
        ];
        let cell = |values: &[f64], k: usize| values.get(k).map_or(String::new(), |value| format!("{value:.2}"));
        let rows = (0..self.lambdas.len()).map(|k| {
            vec![
                (k + 1).to_string(),
                cell(&self.lambdas, k),
                cell(&self.rate_percent, k),
                cell(&self.accumulated_percent, k),
                cell(&PAPER_LAMBDAS, k),
                cell(&PAPER_SUCCESS, k),
            ]
        });
        let table = columns(&std::iter::once(head.map(str::to_owned).to_vec()).chain(rows).collect::<Vec<_>>());
        let lambdas: Vec<_> = self.lambdas.iter().map(|lambda| format!("{lambda:.4}")).collect();
        format!("{} constraints, seed {}\n{table}\n\nlambdas = [{}]", self.constraints, self.seed, lambdas.join(", "))
    }
}
