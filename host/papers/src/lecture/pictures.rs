//! Pictures of the lecture: manipulability of the planar arm, the lost direction at the singularity, and how fast the three
//! methods of inverse kinematics converge.

use std::f64::consts::{PI, TAU};

use darm_arm::draw::chart::{Axis, Chart, Corner, Series, Shape};
use darm_arm::draw::palette::SERIES;
use darm_core::ik::Options;
use darm_core::tree::{TreeError, singular};
use darm_robot::ik::Method;
use darm_robot::robot::Robot;
use darm_robot::robot::planar::planar_arm;

use super::PLANAR_M;
use super::draws::random;
use super::kinematics::near_target;
use crate::convergence::convergence;

/// Points of a curve.
const POINTS: usize = 90;
/// Postures of the ellipses, deg: the second joint from nearly straight to folded.
const POSTURES_DEG: [f64; 5] = [15.0, 45.0, 90.0, 135.0, 165.0];
/// Size of an ellipse in the picture of the arm, m per m/rad.
const ELLIPSE: f64 = 0.25;

/// A file name and its SVG.
pub type Picture = (String, String);

/// All pictures.
///
/// # Errors
///
/// The joints of the arm make no tree that can be computed.
pub fn all(puma: &Robot, seed: u64) -> Result<Vec<Picture>, TreeError> {
    Ok(vec![manipulability()?, ellipses()?, methods(puma, seed)?])
}

/// √det(J Jᵀ) over the second joint.
fn manipulability() -> Result<Picture, TreeError> {
    let (arm, tip) = planar_arm(&PLANAR_M, &[[-PI, PI]; 2]);
    let mut points = Vec::new();
    for k in 0..=2 * POINTS {
        let angle = PI * (k as f64 / POINTS as f64 - 1.0);
        let jacobian = arm.kinematics(&tip, &[0.4, angle])?.compact_jacobian();
        points.push([angle.to_degrees(), singular::manipulability(&singular::rows(&jacobian, &[3, 4]))]);
    }
    let chart = Chart {
        x: Axis::linear("second joint, deg", -180.0..180.0),
        y: Axis::around("manipulability, m²", points.iter().map(|point| point[1])),
        series: vec![Series::unnamed(SERIES[0], Shape::Line(points))],
        ..Chart::default()
    };
    Ok(("manipulability.svg".into(), chart.svg()))
}

/// The arm in postures that are more and more folded, with the ellipse of velocities at its tip.
fn ellipses() -> Result<Picture, TreeError> {
    let (arm, tip) = planar_arm(&PLANAR_M, &[[-PI, PI]; 2]);
    let mut series = Vec::new();
    for (second_deg, color) in POSTURES_DEG.into_iter().zip(SERIES.into_iter().cycle()) {
        let q = [(70.0 - second_deg / 2.0).to_radians(), f64::to_radians(second_deg)];
        let kinematics = arm.kinematics(&tip, &q)?;
        let (jacobian, at) = (&kinematics.jacobian_base, kinematics.pose_base_frame.position);
        let elbow = [PLANAR_M[0] * q[0].cos(), PLANAR_M[0] * q[0].sin()];
        let name = format!("{second_deg} deg");
        series.push(Series::named(&name, color, Shape::Line(vec![[0.0, 0.0], elbow, [at.x, at.y]])));
        let ellipse = (0..=POINTS).map(|k| {
            let (s, c) = (TAU * k as f64 / POINTS as f64).sin_cos();
            [3, 4].map(|row| ELLIPSE * (jacobian[(row, 0)] * c + jacobian[(row, 1)] * s) + at[row - 3])
        });
        series.push(Series::unnamed(color, Shape::Dashed(ellipse.collect())));
    }
    let drawn: Vec<[f64; 2]> = series
        .iter()
        .flat_map(|series| match &series.shape {
            Shape::Line(points) | Shape::Dashed(points) => points.clone(),
            _ => Vec::new(),
        })
        .collect();
    let chart = Chart {
        x: Axis::around("x, m", drawn.iter().map(|point| point[0])),
        y: Axis::around("y, m", drawn.iter().map(|point| point[1])),
        series,
        legend: Corner::UpperRight,
        ..Chart::default()
    };
    Ok(("manipulability-ellipses.svg".into(), chart.svg()))
}

/// Error over the steps of inverse, pseudo-inverse and transpose from one start.
fn methods(puma: &Robot, seed: u64) -> Result<Picture, TreeError> {
    let name = "convergence.svg".to_owned();
    let Some(tool) = puma.tool() else { return Ok((name, String::new())) };
    let (q, off) = near_target(&mut random(seed));
    let start: Vec<f64> = q.iter().zip(off).map(|(q, off)| q + off).collect();
    let target = puma.kinematics(tool, &q)?.pose_base_frame;
    let options = Options { steps: 200, starts: 1, ..Options::default() };
    let mut histories = Vec::new();
    for method in [Method::Inverse, Method::PseudoInverse, Method::Transpose] {
        histories.push((method, puma.inverse(method, tool, &target, &start, &options)?.history));
    }
    let shown: Vec<_> = histories.iter().map(|(method, history)| (*method, &history[..])).collect();
    Ok((name, convergence(&shown, 0.5)))
}
