//! When a person leaves the chair: from the force that the chair's plate measures, or from the height of the pelvis.
//!
//! The force is the measurement of the contact itself. The height also rises when the pelvis rolls on the seat, before it
//! leaves, and is used only where the chair has no plate.

use serde::Serialize;

use super::Posture;
use super::markers::Capture;

/// The chair is left when it bears less than this share of the weight.
const UNLOADED: f64 = 0.02;
/// For this long, s.
const UNLOADED_S: f64 = 0.2;
/// The person has left the chair when the middle link is this much higher than in the first frame, m.
const RISEN_M: f64 = 0.03;
/// It left the chair when that link was this much higher than where it began to rise, m.
const LIFTED_M: f64 = 0.003;

/// What lift-off was read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LiftOffBy {
    /// The vertical force of the chair's plate.
    ChairForce,
    /// The height of the person's base link: the chair's force was not measured separately.
    PelvisHeight,
}

/// The first frame off the chair, from 0, and what it was read from; the number of frames when the chair is never left. Heights
/// of the base count times `scale`.
pub fn lift_off(capture: &Capture, postures: &[Posture], scale: f64) -> (usize, LiftOffBy) {
    match &capture.chair_n {
        Some(chair_n) => (by_force(capture, chair_n), LiftOffBy::ChairForce),
        None => (by_height(postures, scale), LiftOffBy::PelvisHeight),
    }
}

/// The first frame from which the chair stays unloaded for a while.
fn by_force(capture: &Capture, chair_n: &[f64]) -> usize {
    let frames = chair_n.len();
    let weight = capture.plates.iter().map(|plate| plate.force_n).sum::<f64>() / frames.max(1) as f64;
    let hold = ((UNLOADED_S / capture.step_s()).ceil() as usize).max(1);
    let is_loaded = |force: &f64| *force > UNLOADED * weight;
    (0..frames).find(|&first| !chair_n[first..frames.min(first + hold)].iter().any(is_loaded)).unwrap_or(frames)
}

/// The first frame in which the base is off the chair.
fn by_height(postures: &[Posture], scale: f64) -> usize {
    let height: Vec<f64> = postures.iter().map(|posture| scale * posture.base.position.z).collect();
    let Some(risen) = height.iter().position(|z| *z > height[0] + RISEN_M) else { return height.len() };
    let lowest = (1..=risen).rev().find(|&k| height[k - 1] >= height[k]).unwrap_or(0);
    (lowest..risen).find(|&k| height[k] > height[lowest] + LIFTED_M).unwrap_or(risen)
}

#[cfg(test)]
mod tests {
    use darm_core::real::Vec3;
    use darm_core::se::Pose;

    use super::super::markers::Plate;
    use super::*;

    const RATE_HZ: f64 = 50.0;
    const LEFT_S: f64 = 1.1;

    /// A person of 700 N whose pelvis rolls from 0.5 s on, which raises it by 20 mm, and who leaves the chair at 1.1 s.
    fn rolling() -> (Capture, Vec<Posture>) {
        let time_s: Vec<f64> = (0..150).map(|k| f64::from(k) / RATE_HZ).collect();
        let ramp = |t: f64, from: f64, to: f64| ((t - from) / (to - from)).clamp(0.0, 1.0);
        let height = |t: f64| 0.5 + 0.02 * ramp(t, 0.5, LEFT_S) + 0.4 * ramp(t, LEFT_S, 2.0);
        let posture = |&t: &f64| Posture { base: Pose::at(Vec3::new(0.0, 0.0, height(t))), q: Vec::new() };
        let postures = time_s.iter().map(posture).collect();
        // Alternating noise of 2 N, and for 0.1 s the person bounces.
        let force = |(k, t): (usize, &f64)| {
            let noise = if k % 2 == 0 { 2.0 } else { -2.0 };
            let bounces = (0.8..0.9).contains(t);
            if *t < LEFT_S && !bounces { 420.0 - 300.0 * t + noise } else { noise }
        };
        let chair_n = Some(time_s.iter().enumerate().map(force).collect());
        let plates = vec![Plate { cop: [0.0; 2], force_n: 700.0 }; time_s.len()];
        let places = vec![Vec::new(); time_s.len()];
        (Capture { names: Vec::new(), time_s, places, plates, chair_n, hands_n: None, findings: Vec::new() }, postures)
    }

    #[test]
    fn the_chairs_force_gives_lift_off_where_the_height_is_early() {
        let (capture, postures) = rolling();
        let (frame, by) = lift_off(&capture, &postures, 1.0);
        assert_eq!(by, LiftOffBy::ChairForce);
        assert!((capture.time_s[frame] - LEFT_S).abs() < 1.01 / RATE_HZ, "{}", capture.time_s[frame]);
        let without = Capture { chair_n: None, ..capture };
        let (frame, by) = lift_off(&without, &postures, 1.0);
        assert_eq!(by, LiftOffBy::PelvisHeight);
        assert!(without.time_s[frame] < LEFT_S - 0.5, "{}", without.time_s[frame]);
    }

    #[test]
    fn a_chair_that_is_never_left_or_never_sat_on_is_found() {
        let (capture, postures) = rolling();
        let with = |force: f64| Capture { chair_n: Some(vec![force; 150]), ..capture.clone() };
        assert_eq!(lift_off(&with(400.0), &postures, 1.0).0, 150);
        assert_eq!(lift_off(&with(0.0), &postures, 1.0).0, 0);
    }
}
