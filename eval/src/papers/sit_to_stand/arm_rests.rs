//! The same motion with hands that push on arm rests, whose plate is measured separately.
//!
//! The motion is the natural one: its total wrench is what moves the body, and the arm rests take a part of it from the
//! chair and then from the feet. A person who relies on the hands would move differently.

use std::f64::consts::PI;
use std::path::Path;

use anyhow::{Context as _, Result};
use darm_measure::table::{Names, Table};
use darm_papers::motion::demonstration::Demonstration;
use darm_papers::motion::mapping::map;
use darm_papers::motion::person::person;
use darm_papers::motion::{Capture, Plate};
use darm_robot::robot::Robot;

use super::capture::csv;
use super::figure::figure;
use super::postures::Robots;
use super::robots::{Followed, executed};
use darm_figures::figure::Figure;

/// The largest force on the arm rests as a share of the weight, when the hands push (s), and how far ahead of the ankles (m).
const SHARE: f64 = 0.2;
const PUSH_S: [f64; 2] = [1.0, 2.2];
const AHEAD_M: f64 = -0.25;
/// Of the chair's force the hands take this share at most: it is left when the hips leave it.
const FROM_CHAIR: f64 = 0.8;

/// What the arm rests exert: Fz (N), Mx and My (N·m, about the world's origin).
fn pushed(Demonstration { capture, .. }: &Demonstration) -> Vec<[f64; 3]> {
    let [start, end] = PUSH_S;
    let force = |(time, plate): (&f64, &Plate)| {
        let phase = ((time - start) / (end - start)).clamp(0.0, 1.0);
        let force = SHARE * plate.force_n * (PI * phase).sin().powi(2);
        [force, 0.0, -AHEAD_M * force]
    };
    capture.time_s.iter().zip(&capture.plates).map(force).collect()
}

/// The demonstration with less on its chair.
fn relieved(shown: &Demonstration, hands: &[[f64; 3]]) -> Demonstration {
    let mut relieved = shown.clone();
    let measured = relieved.capture.chair_n.iter_mut().flatten();
    for ((chair, measured), [hands, ..]) in relieved.chair.iter_mut().zip(measured).zip(hands) {
        let taken = hands.min(FROM_CHAIR * chair[0]);
        if chair[0] > 0.0 {
            let left = 1.0 - taken / chair[0];
            chair.iter_mut().for_each(|part| *part *= left);
        }
        *measured -= taken;
    }
    relieved
}

/// The person by all plates and without those of the arm rests, and the robot that follows without hands.
pub(super) fn with_hands(
    figures: &mut Vec<Figure>,
    robots: &Robots,
    followed: &Followed<'_>,
    (average, shown): (&Robot, &Demonstration),
) -> Result<()> {
    let Followed { name, setup, capture, .. } = *followed;
    let markers = setup.on_person();
    let hands = pushed(shown);
    let text = csv(&relieved(shown, &hands), Some(&hands));
    let (table, _) = Table::read_text(Path::new("hands.csv"), text.as_bytes(), &Names::new())?;
    let seen = Capture::of(&table, &capture.names)?;
    // The wrench of all plates less that of the arm rests.
    let without = |(plate, [force, mx, my]): (&Plate, &[f64; 3])| {
        let force_n = plate.force_n - force;
        let moment = [plate.cop[1] * plate.force_n - mx, -plate.cop[0] * plate.force_n - my];
        Plate { cop: [-moment[1] / force_n, moment[0] / force_n], force_n }
    };
    let plates = seen.plates.iter().zip(&hands).map(without).collect();
    let unseen = Capture { plates, hands_n: None, ..seen.clone() };
    let mut push = |what: &str, value: f64, unit: &str| -> Result<()> {
        figures.push(figure(&format!("{name}, hands on arm rests: {what}"), value, unit)?);
        Ok(())
    };
    let force_n = seen.hands_n.as_ref().context("the arm rests' plate is not read")?;
    push("largest force of the hands", force_n.iter().copied().fold(0.0, f64::max), "N")?;
    let found = person(average, &markers, &seen)?;
    let by_two = person(average, &markers, &unseen)?;
    for (what, person) in [("with their plate", &found), ("without it", &by_two)] {
        push(&format!("person's centre of pressure, worst, {what}"), 1e3 * person.after.worst_m, "mm")?;
    }
    let mapped = map(&robots.identified, setup, &found, &seen)?;
    let off_s = mapped.time_s.get(mapped.lift_off).context("the chair is never left")?
        - mapped.time_s.get(shown.lift_off()).context("the person never leaves the chair")?;
    push("lift-off by the chair's force, less the true one", off_s, "s")?;
    let run = executed(&robots.real, &robots.identified, setup, &mapped)?;
    push("fell, without hands", f64::from(u8::from(run.fell)), "")
}
