//! Two motions: a person rises from a chair, once healthy and once elderly; the robot follows and executes.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};
use darm_arm::draw::palette::{AZURE, Color, GREEN, RED, SKY};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_papers::motion::demonstration::{Demonstration, Style, demonstrate};
use darm_papers::motion::execution::Executed;
use darm_papers::motion::mapping::{Mapped, map};
use darm_papers::motion::page::{MotionReport, along_time, chair_along_time, sagittal, sagittal_plane};
use darm_papers::motion::person::{Person, com, person};
use darm_papers::motion::setup::Setup;
use darm_papers::motion::{Capture, Posture, lift_off};
use darm_robot::robot::Robot;
use darm_robot::urdf::{self, Locks};

use super::arm_rests;
use super::capture::csv;
use super::figure::figure;
use super::postures::{Robots, golden};
use super::robots::{Followed, count_standing, executed};
use super::sequences;
use darm_figures::figure::Figure;
use darm_figures::progress::Progress;
use xtask::setup;

/// Colours of the paper's figure 7: natural and elderly, identified and CAD.
const COLORS: [[Color; 2]; 2] = [[RED, GREEN], [AZURE, SKY]];

/// Postures of Figure 1.
const SAMPLES: usize = 8;

/// Files of the pictures.
const FILES: [&str; 5] = ["figure6-natural", "chair-natural", "figure6-elderly", "chair-elderly", "figure7"];

/// The robots that rise, and the folder of the pictures.
pub(super) struct Study<'a> {
    pub(super) robots: &'a Robots,
    /// Robots of other masses.
    pub(super) drawn: &'a [Robots],
    /// Of the people.
    pub(super) seed: u64,
    pub(super) folder: &'a Path,
}

/// Maps both motions; pictures with their titles.
pub(super) fn map_both(
    figures: &mut Vec<Figure>,
    progress: &Progress,
    &Study { robots, drawn, seed, folder }: &Study<'_>,
) -> Result<Vec<(String, String)>> {
    let root = setup::root();
    let mut average = urdf::read(&root.join("tests/data/stand/person.urdf"), &Locks::new())?;
    average.floating = true;
    let setup = Setup::read(&root.join("tests/data/stand/stand.toml"), &average, &robots.cad)?;
    let markers = setup.on_person();
    let (mut pictures, mut plane, mut sequences_shown) = (Vec::new(), Vec::new(), vec![samples(&robots.cad)?]);
    for (style, colors) in [Style::Natural, Style::Elderly].into_iter().zip(COLORS) {
        let name = style.name();
        let shown = demonstrate(&average, &setup, style, seed)?;
        fs::write(folder.join(format!("{name}.csv")), csv(&shown, None))?;
        let found = person(&average, &markers, &shown.capture)?;
        report_person(figures, name, &found, &shown)?;
        let mapped = map(&robots.identified, &setup, &found, &shown.capture)?;
        let executed = executed(&robots.real, &robots.identified, &setup, &mapped)?;
        push_figures(figures, name, &mapped)?;
        report_lift_off(figures, name, &found, (&mapped, &shown))?;
        report_executed(figures, robots, name, &mapped, &executed)?;
        let report =
            MotionReport { person: &found, mapped: &mapped, robot: &robots.identified, executed: Some(&executed) };
        pictures.push((
            format!("{name}: centre of mass and of pressure, a line at lift-off (the paper's figure 6)"),
            along_time(&report)?.svg(),
        ));
        pictures.extend(chair_along_time(&report).map(|chair| (format!("{name}: what the chair bears"), chair.svg())));
        let by_cad = com(&robots.cad, &mapped.trajectory.postures, &mapped.time_s)?;
        plane.extend(sagittal(&format!("{name}, identified"), colors[0], &mapped.com, mapped.lift_off));
        plane.extend(sagittal(&format!("{name}, CAD"), colors[1], &by_cad, mapped.lift_off));
        report_plane(figures, name, &mapped.com, &by_cad)?;
        sequences_shown.extend(sequence(robots, style, &found, (&mapped, &executed))?);
        let followed = Followed { name, setup: &setup, person: &found, capture: &shown.capture };
        by_cad_plan(figures, robots, &followed)?;
        count_standing(figures, progress, drawn, &followed)?;
        if style == Style::Natural {
            arm_rests::with_hands(figures, robots, &followed, (&average, &shown))?;
        }
    }
    let title = "centre of mass in the sagittal plane, dots at lift-off (the paper's figure 7)";
    pictures.push((title.into(), sagittal_plane(plane).svg()));
    for ((_, svg), name) in pictures.iter().zip(FILES) {
        fs::write(folder.join(format!("{name}.svg")), svg)?;
    }
    for (file, title, svg) in sequences_shown {
        fs::write(folder.join(format!("{file}.svg")), &svg)?;
        pictures.push((title.into(), svg));
    }
    let masses: Vec<_> = darm_papers::identify::bodies(&robots.cad).map(|joint| mass(robots, joint)).collect();
    fs::write(folder.join("masses.json"), serde_json::to_string_pretty(&masses)?)?;
    Ok(pictures)
}

/// A picture: its file, its title, and the SVG.
type Picture = (&'static str, &'static str, String);

/// Some of the postures of the identification: Figure 1.
fn samples(robot: &Robot) -> Result<Picture> {
    let postures = golden()?.0;
    let base = Pose::identity();
    let shown = postures.iter().step_by(postures.len().div_ceil(SAMPLES)).enumerate();
    let frame = |(k, q): (usize, &Vec<f64>)| {
        sequences::frame(
            robot,
            &Posture { base, q: q.clone() },
            format!("posture {}", 1 + k * postures.len().div_ceil(SAMPLES)),
        )
    };
    let frames = shown.map(frame).collect::<Result<Vec<_>>>()?;
    Ok((
        "figure1",
        "sample postures of the identification (the paper's figure 1)",
        sequences::svg(&[("robot", frames)]),
    ))
}

/// The elderly person above the robot (Figure 4) with the trees of both (Figure 3), or the robot alone (Figure 5).
fn sequence(
    robots: &Robots,
    style: Style,
    found: &Person,
    (mapped, executed): (&Mapped, &Executed),
) -> Result<Vec<Picture>> {
    let robot = sequences::frames(&robots.real, &executed.postures, &mapped.time_s)?;
    if matches!(style, Style::Natural) {
        let title = "standing up: the robot, natural motion (the paper's figure 5)";
        return Ok(vec![("figure5", title, sequences::svg(&[("robot", robot)]))]);
    }
    let person = sequences::frames(&found.tree, &found.motion.postures, &mapped.time_s)?;
    let last = |robot: &Robot, postures: &[Posture]| {
        let posture = postures.last().context("a motion without frames")?;
        Ok::<_, anyhow::Error>(vec![sequences::frame(robot, posture, format!("{} joints", robot.joints.len()))?])
    };
    let trees =
        [("robot", last(&robots.real, &executed.postures)?), ("person", last(&found.tree, &found.motion.postures)?)];
    Ok(vec![
        ("figure3", "trees of the robot and of the person (the paper's figure 3)", sequences::svg(&trees)),
        (
            "figure4",
            "standing up: person and robot, elderly motion (the paper's figure 4)",
            sequences::svg(&[("person", person), ("robot", robot)]),
        ),
    ])
}

fn report_person(figures: &mut Vec<Figure>, name: &str, found: &Person, shown: &Demonstration) -> Result<()> {
    for (what, off_m) in [
        ("person's centre of pressure, worst, average masses", found.before.worst_m),
        ("person's centre of pressure, worst, scaled (paper 20)", found.after.worst_m),
        ("person's centre of mass against the truth, RMS", apart(&found.com, shown)),
    ] {
        figures.push(figure(&format!("{name}: {what}"), 1e3 * off_m, "mm")?);
    }
    Ok(())
}

/// Lift-off by the force of the chair's plate, and what the height of the pelvis would have given.
fn report_lift_off(
    figures: &mut Vec<Figure>,
    name: &str,
    found: &Person,
    (mapped, shown): (&Mapped, &Demonstration),
) -> Result<()> {
    let unseen = Capture { chair_n: None, ..shown.capture.clone() };
    let time = |frame: usize| mapped.time_s.get(frame).copied().unwrap_or(f64::NAN);
    let (by_height, _) = lift_off(&unseen, &found.motion.postures, mapped.scale);
    for (what, frame) in [("the chair's force", mapped.lift_off), ("the pelvis's height", by_height)] {
        let off_s = time(frame) - time(shown.lift_off());
        figures.push(figure(&format!("{name}: lift-off by {what}, less the true one"), off_s, "s")?);
    }
    Ok(())
}

fn report_executed(
    figures: &mut Vec<Figure>,
    robots: &Robots,
    name: &str,
    mapped: &Mapped,
    executed: &Executed,
) -> Result<()> {
    let frames = executed.postures.len();
    let real = com(&robots.real, &executed.postures, &mapped.time_s[..frames])?;
    let off = real.iter().zip(&mapped.com).map(|(a, b)| (a.x - b.x).powi(2)).sum::<f64>() / frames.max(1) as f64;
    figures.push(figure(
        &format!("{name}: executed centre of mass forward less the plan, RMS"),
        1e3 * off.sqrt(),
        "mm",
    )?);
    figures.push(figure(&format!("{name}: fell"), f64::from(u8::from(executed.fell)), "")?);
    Ok(())
}

/// The plan's centre of mass, as the identified and as the CAD masses have it.
fn report_plane(figures: &mut Vec<Figure>, name: &str, com: &[Vec3<f64>], by_cad: &[Vec3<f64>]) -> Result<()> {
    let shift = mean(com) - mean(by_cad);
    figures.push(figure(
        &format!("{name}: identified less CAD centre of mass, forward (paper: to the rear)"),
        1e3 * shift.x,
        "mm",
    )?);
    figures.push(figure(
        &format!("{name}: identified less CAD centre of mass, up (paper: lower)"),
        1e3 * shift.z,
        "mm",
    )?);
    let dip = com[0].z - com.iter().map(|com| com.z).fold(f64::INFINITY, f64::min);
    figures.push(figure(&format!("{name}: centre of mass lowers before it rises"), 1e3 * dip, "mm")?);
    Ok(())
}

fn mass(robots: &Robots, joint: Option<usize>) -> darm_papers::identify::LinkMass {
    let inertia = joint.map_or(&robots.identified.base, |joint| &robots.identified.joints[joint].joint.inertia);
    let link = darm_papers::identify::body_name(&robots.identified, joint);
    darm_papers::identify::LinkMass { link, mass_kg: inertia.mass, com_m: inertia.com.into() }
}

fn push_figures(figures: &mut Vec<Figure>, name: &str, mapped: &Mapped) -> Result<()> {
    figures.push(figure(&format!("{name}: centre of mass less its target, worst frame"), mapped.com_error_m, "m")?);
    figures.push(figure(
        &format!("{name}: feet and limits, worst frame"),
        mapped.trajectory.worst_constraint,
        "m or rad",
    )?);
    figures.push(figure(
        &format!("{name}: target off the person's along the ground, for balance, worst frame"),
        1e3 * mapped.moved_m,
        "mm",
    )?);
    figures.push(figure(
        &format!("{name}: target off the person's in height, on the chair, worst frame"),
        1e3 * mapped.raised_m,
        "mm",
    )?);
    figures.push(figure(&format!("{name}: markers, RMS"), 1e3 * mapped.trajectory.marker_rms_m, "mm")?);
    figures.push(figure(&format!("{name}: person's motion times"), mapped.scale, "")?);
    figures.push(figure(&format!("{name}: zero-moment point, least margin"), 1e3 * mapped.balance.zmp_margin_m, "mm")?);
    figures.push(figure(&format!("{name}: centre of mass, least margin"), 1e3 * mapped.balance.com_margin_m, "mm")?);
    Ok(())
}

/// What a plan with the CAD masses would have come to.
fn by_cad_plan(figures: &mut Vec<Figure>, robots: &Robots, followed: &Followed<'_>) -> Result<()> {
    let Followed { name, setup, person, capture } = *followed;
    let mapped = map(&robots.cad, setup, person, capture)?;
    let real = com(&robots.real, &mapped.trajectory.postures, &mapped.time_s)?;
    let off = real.iter().zip(&mapped.target).map(|(a, b)| (a.x - b.x).powi(2)).sum::<f64>() / real.len() as f64;
    figures.push(figure(
        &format!("{name}: planned with CAD masses, true centre of mass off, RMS"),
        1e3 * off.sqrt(),
        "mm",
    )?);
    let executed = executed(&robots.real, &robots.cad, setup, &mapped)?;
    figures.push(figure(&format!("{name}: planned with CAD masses, fell"), f64::from(u8::from(executed.fell)), "")?);
    Ok(())
}

fn mean(path: &[Vec3<f64>]) -> Vec3<f64> {
    path.iter().sum::<Vec3<f64>>() / path.len().max(1) as f64
}

fn apart(com: &[Vec3<f64>], shown: &Demonstration) -> f64 {
    let square: f64 = com.iter().zip(&shown.com).map(|(a, b)| (a - b).norm_squared()).sum();
    (square / com.len().max(1) as f64).sqrt()
}
