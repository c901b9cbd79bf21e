//! Measures the way from pictures to poses on rendered pictures: `cargo run -p darm-camera --features render --example evaluate -- TASK …`.
//!
//! | task | what it prints |
//! | --- | --- |
//! | `pictures FOLDER N SEED` | writes N pictures of four tags, their true corners and ours: input of `eval/camera/compare.py` |
//! | `found IMAGE …` | the corners in images, one tag a line |
//! | `empty N SEED` | false tags in N pictures without a tag |
//! | `poses N SEED` | share of N poses whose χ² is between the 5 and 95 % points |
//! | `lenses SETS DRAWS SEED` | share of lens numbers inside their 95 % intervals, over SETS x DRAWS calibrations |
//! | `views FOLDER SEED` | writes the views of one calibration, and the corners that it used, for a comparison with OpenCV |
//! | `speed N` | pictures a second, 1280 x 720 with four tags |

use std::error::Error;
use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use darm_camera::calibrate::{calibrate, guess};
use darm_camera::camera::{Camera, Quality};
use darm_camera::collector::Collector;
use darm_camera::detect::detect;
use darm_camera::edges::refine;
use darm_camera::image_file::{read, write_png};
use darm_camera::lens::{Lens, NAMES};
use darm_camera::render::{Optics, Patch, Renderer, Scene, Sheet};
use darm_camera::tag_pose::tag_pose;
use darm_camera::target::{Size, Tag, Target};
use darm_camera::view::View;
use darm_camera::watch::Watcher;
use darm_core::real::{Vec2, Vec3};
use darm_core::se::Pose;
use nalgebra::{SMatrix, SVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

type Outcome = Result<(), Box<dyn Error>>;

/// 5 and 95 % points of χ² with 6 degrees of freedom.
const CHI_SQUARED_6: [f64; 2] = [1.635_4, 12.591_6];

/// Side of the tags, m.
const SIDE_M: f64 = 0.05;

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize| arguments.get(k).and_then(|text| text.parse::<u64>().ok()).ok_or("a number is missing");
    let path = || arguments.get(1).map(PathBuf::from).ok_or("a folder is missing");
    match arguments.first().map(String::as_str) {
        Some("pictures") => pictures(&path()?, number(2)?, number(3)?),
        Some("found") => arguments[1..].iter().try_for_each(|image| found(Path::new(image))),
        Some("empty") => empty(number(1)?, number(2)?),
        Some("poses") => poses(number(1)?, number(2)?),
        Some("lenses") => lenses(number(1)?, number(2)?, number(3)?),
        Some("views") => views(&path()?, number(2)?),
        Some("speed") => speed(number(1)?),
        _ => Err("no such task; the first lines of this program list them".into()),
    }
}

/// The lens that a renderer has, as the estimator writes it.
fn lens(optics: &Optics) -> Result<Lens, Box<dyn Error>> {
    let Optics { focal_px: [fx, fy], centre_px: [cx, cy], radial: [k1, k2], tangential: [p1, p2], .. } = *optics;
    Ok(Lens::new(&SVector::from([fx, fy, cx, cy, k1, k2, p1, p2]))?)
}

/// A sheet that faces the camera, tilted by up to this angle in any direction and turned by any, seen around a pixel at a depth.
fn facing(rng: &mut ChaCha8Rng, optics: &Optics, pixel: [f64; 2], depth_m: f64, tilt_rad: [f64; 2]) -> Pose<f64> {
    let (about, tilt) = (rng.random_range(-PI..PI), rng.random_range(tilt_rad[0]..tilt_rad[1]));
    let turn = Pose::new(&Vec3::new(0.0, 0.0, rng.random_range(-PI..PI)), Vec3::zeros());
    let front = Pose::new(&Vec3::new(PI, 0.0, 0.0), Vec3::zeros());
    let tilted = Pose::new(&Vec3::new(tilt * about.cos(), tilt * about.sin(), 0.0), Vec3::zeros());
    let at = |axis: usize| (pixel[axis] - optics.centre_px[axis]) / optics.focal_px[axis] * depth_m;
    Pose { position: Vec3::new(at(0), at(1), depth_m), ..(tilted * front * turn) }
}

/// A part of a camera's picture: the same lens with its principal point elsewhere. It renders in less time than the complete one.
fn part(rng: &mut ChaCha8Rng, optics: Optics, [width, height]: [usize; 2]) -> Optics {
    let x = rng.random_range(0..=optics.width.saturating_sub(width)) as f64;
    let y = rng.random_range(0..=optics.height.saturating_sub(height)) as f64;
    Optics { width, height, centre_px: [optics.centre_px[0] - x, optics.centre_px[1] - y], ..optics }
}

/// Tags of 25 to 110 px, tilted by up to 60°, around these parts of the picture's sides, before patches of all greys.
fn tags_at(rng: &mut ChaCha8Rng, optics: &Optics, places: &[[f64; 2]]) -> Scene {
    let mut id = rng.random_range(0..587 - places.len() as u16);
    let mut one = |place: &[f64; 2]| {
        let mut pixel = |axis: usize, side: usize| side as f64 * place[axis] + rng.random_range(-8.0..8.0);
        let pixel = [pixel(0, optics.width), pixel(1, optics.height)];
        let side_px = 25.0 * 4.4f64.powf(rng.random_range(0.0..1.0));
        let pose = facing(rng, optics, pixel, SIDE_M * optics.focal_px[0] / side_px, [0.0, 60f64.to_radians()]);
        id += 1;
        Sheet::tag(Tag { id, side_m: SIDE_M }, pose)
    };
    let sheets = places.iter().map(&mut one).collect();
    Scene { sheets, patches: patches(rng, 15) }
}

/// One tag in each quarter of a picture.
const QUARTERS: [[f64; 2]; 4] = [[0.25, 0.27], [0.75, 0.27], [0.25, 0.73], [0.75, 0.73]];

fn patches(rng: &mut ChaCha8Rng, count: usize) -> Vec<Patch> {
    let one = |rng: &mut ChaCha8Rng| Patch {
        middle: [rng.random_range(-0.7..0.7), rng.random_range(-0.4..0.4)],
        half: [0.005 * 40f64.powf(rng.random_range(0.0..1.0)), 0.005 * 40f64.powf(rng.random_range(0.0..1.0))],
        angle_rad: rng.random_range(0.0..PI),
        grey: rng.random_range(15.0..220.0),
    };
    (0..count).map(|_| one(rng)).collect()
}

/// The optics of a picture: blur from none to soft, noise from a sunny to a dim room.
fn any_optics(rng: &mut ChaCha8Rng, size: [usize; 2]) -> Optics {
    let optics = Optics { blur_px: rng.random_range(0.3..1.3), noise: rng.random_range(0.5..5.0), ..Optics::webcam() };
    part(rng, optics, size)
}

/// Where the corners of a tag are seen.
fn true_corners(lens: &Lens, tag: &Tag, pose: &Pose<f64>) -> Option<Vec<Vec2<f64>>> {
    let seen = |corner: Vec3<f64>| Some(lens.project_point(&(pose.rotation * corner + pose.position))?.0.pixel);
    tag.corners_m().into_iter().map(seen).collect()
}

fn corner_cells(corners: &[Vec2<f64>]) -> String {
    corners.iter().map(|corner| format!(",{:.4},{:.4}", corner.x, corner.y)).collect()
}

fn pose_cells(pose: &Pose<f64>) -> String {
    let turn = pose.log().angular;
    turn.iter().chain(pose.position.iter()).map(|number| format!(",{number:.8}")).collect()
}

fn pictures(folder: &Path, count: u64, seed: u64) -> Outcome {
    fs::create_dir_all(folder)?;
    let (mut truth, mut ours, mut poses) = (String::new(), String::new(), String::new());
    for k in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed + k);
        let optics = any_optics(&mut rng, [640, 480]);
        let scene = tags_at(&mut rng, &optics, &[[0.28, 0.5], [0.72, 0.5]]);
        let image = Renderer::new(optics).picture(&scene, &mut rng)?;
        let name = format!("{k:04}.png");
        write_png(&folder.join(&name), &image)?;
        for sheet in &scene.sheets {
            let tag = sheet.tags[0].0;
            let corners = true_corners(&lens(&optics)?, &tag, &sheet.pose_camera_sheet).ok_or("behind the camera")?;
            let (corners, pose) = (corner_cells(&corners), pose_cells(&sheet.pose_camera_sheet));
            let centre = optics.centre_px;
            truth += &format!("{name},{}{corners},{},{}{pose}\n", tag.id, centre[0], centre[1]);
        }
        for found in detect(&image) {
            // As for the others, without knowledge of the lens.
            match refine(&image, found.id, &found.corners, None) {
                Ok(corners) => ours += &format!("{name},{}{}\n", found.id, corner_cells(&corners.pixels)),
                Err(error) => ours += &format!("{name},{}{} # {error}\n", found.id, corner_cells(&found.corners)),
            }
            let (lens, tag) = (lens(&optics)?, Tag { id: found.id, side_m: SIDE_M });
            let corners = refine(&image, found.id, &found.corners, Some(&lens)).ok();
            if let Some(pose) = corners.and_then(|corners| tag_pose(&lens, &tag, &corners)) {
                poses += &format!("{name},{}{}\n", found.id, pose_cells(&pose.best.pose.pose));
            }
        }
    }
    fs::write(folder.join("truth.csv"), truth)?;
    fs::write(folder.join("poses.csv"), poses)?;
    Ok(fs::write(folder.join("ours.csv"), ours)?)
}

fn found(path: &Path) -> Outcome {
    let image = read(path)?;
    for found in detect(&image) {
        let refined = refine(&image, found.id, &found.corners, None);
        let corners = refined.as_ref().map_or(found.corners, |refined| refined.pixels);
        let state = refined.err().map_or_else(|| "refined".into(), |error| error.to_string());
        println!("{},{}{},{state}", path.display(), found.id, corner_cells(&corners));
    }
    Ok(())
}

fn empty(count: u64, seed: u64) -> Outcome {
    let mut tags = 0;
    for k in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed + k);
        let optics = any_optics(&mut rng, [640, 480]);
        let scene = Scene { sheets: Vec::new(), patches: patches(&mut rng, 1000) };
        tags += detect(&Renderer::new(optics).picture(&scene, &mut rng)?).len();
    }
    println!("{tags} false tags in {count} pictures");
    Ok(())
}

fn poses(count: u64, seed: u64) -> Outcome {
    let (mut all, mut inside, mut above, mut ambiguous, mut missed, mut wrong, mut rejected) = (0, 0, 0, 0, 0, 0, 0);
    let mut k = 0;
    while all < count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed + k);
        k += 1;
        let optics = any_optics(&mut rng, [260, 260]);
        let lens = lens(&optics)?;
        let scene = tags_at(&mut rng, &optics, &[[0.5, 0.5]]);
        let image = Renderer::new(optics).picture(&scene, &mut rng)?;
        let detections = detect(&image);
        for sheet in &scene.sheets {
            let tag = sheet.tags[0].0;
            let Some(found) = detections.iter().find(|found| found.id == tag.id) else {
                missed += 1;
                continue;
            };
            let Some(pose) = refine(&image, found.id, &found.corners, Some(&lens))
                .ok()
                .and_then(|corners| tag_pose(&lens, &tag, &corners))
            else {
                rejected += 1;
                continue;
            };
            let solutions = [Some(pose.best), pose.other.filter(|_| pose.is_ambiguous())];
            let chi = |solution: darm_camera::tag_pose::Solution| solution.pose.chi_squared(&sheet.pose_camera_sheet);
            let best = chi(pose.best).ok_or("singular")?;
            // Of two solutions that are both kept, the nearer: which one it is, the picture does not say.
            let kept = solutions.into_iter().flatten().filter_map(chi).fold(f64::INFINITY, f64::min);
            all += 1;
            ambiguous += u64::from(pose.is_ambiguous());
            wrong += u64::from(!pose.is_ambiguous() && best > 200.0);
            inside += u64::from((CHI_SQUARED_6[0]..=CHI_SQUARED_6[1]).contains(&kept));
            above += u64::from(kept > CHI_SQUARED_6[1]);
        }
    }
    let percent = |n: u64| 100.0 * n as f64 / all as f64;
    println!(
        "{all} poses in {k} pictures: χ² between its 5 and 95 % points in {:.1} %, above in {:.1} %",
        percent(inside),
        percent(above)
    );
    println!(
        "ambiguous {:.1} %, wrong solution without notice {wrong}, tags not found {missed}, edges or pose rejected {rejected}",
        percent(ambiguous)
    );
    Ok(())
}

/// Twenty views of the board that cover the picture.
fn board_poses(rng: &mut ChaCha8Rng, optics: &Optics) -> Vec<Pose<f64>> {
    let place = |k: usize, rng: &mut ChaCha8Rng| {
        let pixel = [optics.width as f64 * [0.3, 0.5, 0.7][k % 3], optics.height as f64 * [0.38, 0.5, 0.62][k / 3 % 3]];
        let depth_m = rng.random_range(0.30..0.42);
        facing(rng, optics, pixel, depth_m, [if k < 3 { 0.0 } else { 0.3 }, if k < 3 { 0.1 } else { 0.75 }])
    };
    (0..20).map(|k| place(k, rng)).collect()
}

fn lenses(sets: u64, draws: u64, seed: u64) -> Outcome {
    let target = Target::new(Size::A4);
    let mut inside = [0u64; 8];
    let (mut all, mut failed, mut scale) = (0u64, 0u64, 0.0);
    for set in 0..sets {
        let mut rng = ChaCha8Rng::seed_from_u64(seed + set);
        let optics = Optics {
            width: 640,
            height: 360,
            focal_px: [rng.random_range(400.0..550.0); 2],
            centre_px: [rng.random_range(310.0..330.0), rng.random_range(170.0..190.0)],
            radial: [rng.random_range(-0.25..0.1), rng.random_range(-0.03..0.06)],
            blur_px: rng.random_range(0.5..1.0),
            noise: 0.0,
            ..Optics::webcam()
        };
        let truth = lens(&optics)?.parameters();
        let renderer = Renderer::new(optics);
        let noise = rng.random_range(1.0..4.0);
        let mut rendered = Vec::new();
        for pose in board_poses(&mut rng, &optics) {
            let scene = Scene { sheets: vec![Sheet::board(&target, pose)], patches: Vec::new() };
            rendered.push(renderer.light(std::slice::from_ref(&scene)));
        }
        for _ in 0..draws {
            let images =
                rendered.iter().map(|light| renderer.exposed(light, noise, &mut rng)).collect::<Result<Vec<_>, _>>()?;
            let mut views =
                images.iter().map(|image| View::find(image, &target, None)).collect::<Result<Vec<_>, _>>()?;
            let (lens, poses) = guess(&views, optics.width, optics.height)?;
            let Ok(mut found) = calibrate(&views, lens, poses) else {
                failed += 1;
                continue;
            };
            for _ in 0..2 {
                views = views.iter().zip(&images).map(|(view, image)| view.refined(image, &found.lens)).collect();
                found = calibrate(&views, found.lens, found.poses)?;
            }
            all += 1;
            scale += found.noise_scale;
            let (values, deviations) = (found.lens.parameters(), found.deviations());
            for (k, inside) in inside.iter_mut().enumerate() {
                *inside += u64::from((values[k] - truth[k]).abs() <= 1.959_964 * deviations[k]);
            }
        }
        eprintln!("set {set}: {inside:?} of {all}");
    }
    for (name, inside) in NAMES.iter().zip(inside) {
        println!(
            "{name}: truth inside the 95 % interval in {:.1} % of {all} calibrations",
            100.0 * inside as f64 / all as f64
        );
    }
    let total: u64 = inside.iter().sum();
    println!(
        "all: {:.1} %; failed {failed}; mean noise scale {:.3}",
        100.0 * total as f64 / (8 * all) as f64,
        scale / all as f64
    );
    Ok(())
}

fn views(folder: &Path, seed: u64) -> Outcome {
    fs::create_dir_all(folder)?;
    let target = Target::new(Size::A4);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let optics = Optics::webcam();
    let renderer = Renderer::new(optics);
    let mut collector = Collector::new(target);
    let mut images = Vec::new();
    for (k, pose) in board_poses(&mut rng, &optics).into_iter().enumerate() {
        let scene = Scene { sheets: vec![Sheet::board(&target, pose)], patches: Vec::new() };
        let image = renderer.picture(&scene, &mut rng)?;
        write_png(&folder.join(format!("{k:02}.png")), &image)?;
        println!("{k:02}: {:?}", collector.add(&k.to_string(), image.clone())?);
        images.push(image);
    }
    let report = collector.finish()?;
    let lens = report.calibration.lens;
    let mut corners = String::new();
    for name in &report.used {
        let view =
            View::find(&images[name.parse::<usize>()?], &target, None)?.refined(&images[name.parse::<usize>()?], &lens);
        for tag in &view.tags {
            for (point, pixel) in tag.corners_m.iter().zip(&tag.corners.pixels) {
                corners += &format!("{name},{:.6},{:.6},{:.5},{:.5}\n", point.x, point.y, pixel.x, pixel.y);
            }
        }
    }
    fs::write(folder.join("corners.csv"), corners)?;
    for (name, value, deviation) in report.calibration.lines() {
        println!("{name} = {value:.5} ± {:.5}", 1.96 * deviation);
    }
    println!("reprojection {:.5} px, noise scale {:.3}", report.calibration.overall_px, report.calibration.noise_scale);
    Ok(())
}

fn speed(count: u64) -> Outcome {
    let optics = Optics::webcam();
    let quality = Quality { blur_px: 0.8, reprojection_px: 0.05, noise_scale: 1.0 };
    let camera = Camera::new([optics.width, optics.height], lens(&optics)?, SMatrix::identity() * 1e-6, quality)?;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let scenes: Vec<Scene> = (0..8).map(|_| tags_at(&mut rng, &optics, &QUARTERS)).collect();
    let renderer = Renderer::new(optics);
    let images = scenes.iter().map(|scene| renderer.picture(scene, &mut rng)).collect::<Result<Vec<_>, _>>()?;
    let (mut detecting, mut all, mut measured) = (0.0, 0.0, 0);
    for k in 0..count as usize {
        let (scene, image) = (&scenes[k % scenes.len()], &images[k % images.len()]);
        // Two watchers: all four tags are refined and posed.
        let tags: Vec<Tag> = scene.sheets.iter().map(|sheet| sheet.tags[0].0).collect();
        let start = Instant::now();
        let detections = detect(image);
        detecting += start.elapsed().as_secs_f64();
        for tag in &tags {
            let Some(found) = detections.iter().find(|found| found.id == tag.id) else { continue };
            let corners = refine(image, found.id, &found.corners, Some(camera.lens()));
            measured += usize::from(corners.ok().and_then(|corners| tag_pose(camera.lens(), tag, &corners)).is_some());
        }
        all += start.elapsed().as_secs_f64();
        if k == 0 {
            let observed = Watcher::new(camera.clone(), tags[0], tags[1], None).observe(image)?;
            println!("first picture: {} tags, flags {:?}", observed.tags.len(), observed.flags);
        }
    }
    let count = count as f64;
    println!(
        "{:.1} pictures a second, {:.1} ms a picture, of it detection {:.1} ms; {:.2} poses a picture",
        count / all,
        1e3 * all / count,
        1e3 * detecting / count,
        measured as f64 / count
    );
    Ok(())
}
