//! The way from rendered pictures to poses and lenses, and what makes a picture no measurement.

use std::f64::consts::PI;

use darm_camera::camera::{Camera, Quality};
use darm_camera::collector::{Collector, Refusal};
use darm_camera::detect::detect;
use darm_camera::edges::refine;
use darm_camera::grey::GreyImage;
use darm_camera::lens::Lens;
use darm_camera::missing_views::{MIN_VIEWS, Missing};
use darm_camera::render::{Optics, Patch, Renderer, Scene, Sheet};
use darm_camera::target::{Size, Tag, Target};
use darm_camera::view::ViewError;
use darm_camera::watch::{Flag, Observation, Watcher};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use nalgebra::{SMatrix, SVector};
use proptest::prelude::{ProptestConfig, proptest};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// A webcam at half the resolution, which renders in a quarter of the time.
fn optics() -> Optics {
    let Optics { focal_px, centre_px, .. } = Optics::webcam();
    Optics {
        width: 640,
        height: 360,
        focal_px: focal_px.map(|f| f / 2.0),
        centre_px: centre_px.map(|c| c / 2.0),
        ..Optics::webcam()
    }
}

fn lens(optics: &Optics) -> Lens {
    let Optics { focal_px: [fx, fy], centre_px: [cx, cy], radial: [k1, k2], tangential: [p1, p2], .. } = *optics;
    Lens::new(&SVector::from([fx, fy, cx, cy, k1, k2, p1, p2])).unwrap()
}

/// A sheet that faces the camera, turned about three axes, rad, at a place, m.
fn posed(turn: [f64; 3], place: [f64; 3]) -> Pose<f64> {
    let front = Pose::new(&Vec3::new(PI, 0.0, 0.0), Vec3::zeros());
    let about = |axis: Vec3<f64>| Pose::new(&axis, Vec3::zeros());
    let tilted = about(Vec3::new(turn[0], turn[1], 0.0)) * front * about(Vec3::new(0.0, 0.0, turn[2]));
    Pose { position: place.into(), ..tilted }
}

fn picture(optics: Optics, sheets: Vec<Sheet>, seed: u64) -> GreyImage {
    let scene = Scene { sheets, patches: Vec::new() };
    Renderer::new(optics).picture(&scene, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap()
}

#[test]
fn corners_keep_their_order_however_a_tag_is_turned() {
    let (optics, tag) = (optics(), Tag { id: 42, side_m: 0.05 });
    for quarter in 0..4 {
        let pose = posed([0.3, -0.2, f64::from(quarter) * PI / 2.0 + 0.2], [0.02, -0.01, 0.3]);
        let image = picture(optics, vec![Sheet::tag(tag, pose)], 1);
        let found = detect(&image);
        assert_eq!(found.iter().map(|found| found.id).collect::<Vec<_>>(), [42]);
        let corners = refine(&image, 42, &found[0].corners, Some(&lens(&optics))).unwrap();
        for (corner, pixel) in tag.corners_m().iter().zip(&corners.pixels) {
            let (truth, _) = lens(&optics).project_point(&(pose.rotation * corner + pose.position)).unwrap();
            // Ten times the noise of a corner of a tag of this size.
            assert!((truth.pixel - pixel).norm() < 0.3, "{} {pixel}", truth.pixel);
        }
    }
}

/// A camera with the lens of the renderer.
fn camera() -> Camera {
    let quality = Quality { blur_px: 0.8, reprojection_px: 0.05, noise_scale: 1.0 };
    Camera::new([optics().width, optics().height], lens(&optics()), SMatrix::identity() * 1e-6, quality).unwrap()
}

const BASE: Tag = Tag { id: 100, side_m: 0.064 };
const TOOL: Tag = Tag { id: 101, side_m: 0.04 };

/// Poses of the tags of base and tool in the camera.
fn base_and_tool() -> [Pose<f64>; 2] {
    [posed([0.6, 0.1, 0.3], [-0.1, 0.03, 0.45]), posed([-0.5, 0.4, -0.8], [0.09, -0.02, 0.4])]
}

fn sheets() -> Vec<Sheet> {
    [BASE, TOOL].into_iter().zip(base_and_tool()).map(|(tag, pose)| Sheet::tag(tag, pose)).collect()
}

fn observed(image: &GreyImage) -> Observation {
    Watcher::new(camera(), BASE, TOOL, None).observe(image).unwrap()
}

#[test]
fn the_tool_is_where_its_tag_is_seen_from_the_base() {
    let observed = observed(&picture(optics(), sheets(), 2));
    let [base, tool] = base_and_tool();
    let measured = observed.measured().expect("no flags");
    // The 0.999 point of χ² with 6 degrees of freedom.
    assert!(measured.chi_squared(&base.to(&tool)).unwrap() < 22.5, "{:?}", measured.error(&base.to(&tool)));
}

#[test]
fn a_tag_that_is_not_seen_is_named() {
    let observed = observed(&picture(optics(), sheets()[..1].to_vec(), 3));
    assert_eq!(observed.flags, [Flag::Missing { id: 101 }]);
    assert_eq!(observed.measured(), None);
}

/// A strip of paper with a pattern that is no tag, in front of a part of the base tag's border.
#[test]
fn a_tag_with_a_hidden_edge_is_no_measurement() {
    let mut sheets = sheets();
    let [base, _] = base_and_tool();
    let finger = base * Pose::at(Vec3::new(0.0, 0.032, 0.002));
    sheets.push(Sheet { pose_camera_sheet: finger, half_m: [0.006, 0.004], tags: Vec::new() });
    let observed = observed(&picture(optics(), sheets, 4));
    let is_named = |flag: &Flag| matches!(flag, Flag::Edge { id: 100, .. } | Flag::Missing { id: 100 });
    assert!(observed.flags.iter().any(is_named), "{:?}", observed.flags);
}

#[test]
fn a_mirrored_picture_is_recognised() {
    assert_eq!(observed(&picture(optics(), sheets(), 5).mirrored()).flags, [Flag::Mirrored]);
}

#[test]
fn a_moving_tool_is_blurred() {
    let [base, tool] = base_and_tool();
    let moved = |k: i32| {
        let tool = Pose::at(Vec3::new(f64::from(k) * 0.0006, 0.0, 0.0)) * tool;
        Scene { sheets: vec![Sheet::tag(BASE, base), Sheet::tag(TOOL, tool)], patches: Vec::new() }
    };
    let scenes: Vec<Scene> = (-5..=5).map(moved).collect();
    let image = Renderer::new(optics()).picture_of_motion(&scenes, &mut ChaCha8Rng::seed_from_u64(6)).unwrap();
    let flags = observed(&image).flags;
    assert!(flags.iter().any(|flag| matches!(flag, Flag::Blurred { id: 101, .. })), "{flags:?}");
    assert!(!flags.iter().any(|flag| matches!(flag, Flag::Blurred { id: 100, .. })), "{flags:?}");
}

#[test]
fn tags_printed_at_another_scale_are_found_by_their_distance() {
    let [base, tool] = base_and_tool();
    let image = picture(optics(), sheets(), 7);
    let known_m = base.to(&tool).position.norm();
    // Printed at 95 %, as if all tags were larger than they are.
    let larger = |tag: Tag| Tag { side_m: tag.side_m / 0.95, ..tag };
    let flags = |watcher: Watcher| watcher.observe(&image).unwrap().flags;
    assert_eq!(flags(Watcher::new(camera(), BASE, TOOL, Some(known_m))), []);
    let wrong = flags(Watcher::new(camera(), larger(BASE), larger(TOOL), Some(known_m)));
    assert!(matches!(wrong[..], [Flag::WrongSize { scale, .. }] if (scale - 0.95).abs() < 0.01), "{wrong:?}");
}

#[test]
fn a_picture_of_another_size_is_refused() {
    let image = GreyImage::new(320, 180, vec![0; 320 * 180]).unwrap();
    let error = Watcher::new(camera(), BASE, TOOL, None).observe(&image).unwrap_err();
    assert!(error.to_string().contains("320x180") && error.to_string().contains("640x360"));
}

/// Views of the board, tilted by an angle, rad, up to a distance to the sides, m, at a depth, m.
fn views(count: usize, tilt: f64, spread: f64, depth: f64) -> Vec<GreyImage> {
    let target = Target::new(Size::A4);
    let renderer = Renderer::new(optics());
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut view = |k: usize| {
        let place = [spread * (k % 3) as f64 - spread, 0.6 * spread * (k / 3 % 3) as f64 - 0.6 * spread];
        let about = rng.random_range(-PI..PI);
        let (depth, turn) = (depth * rng.random_range(0.95..1.05), rng.random_range(-0.4..0.4));
        let pose = posed([tilt * about.cos(), tilt * about.sin(), turn], [place[0], place[1], depth]);
        let scene = Scene { sheets: vec![Sheet::board(&target, pose)], patches: Vec::new() };
        renderer.picture(&scene, &mut rng).unwrap()
    };
    (0..count).map(&mut view).collect()
}

fn collected(images: Vec<GreyImage>) -> Collector {
    let mut collector = Collector::new(Target::new(Size::A4));
    for (k, image) in images.into_iter().enumerate() {
        collector.add(&k.to_string(), image).unwrap();
    }
    collector
}

#[test]
fn the_lens_of_a_camera_is_found_from_views_of_the_board() {
    let report = collected(views(18, 0.6, 0.09, 0.35)).finish().unwrap();
    let error = report.calibration.lens.parameters() - lens(&optics()).parameters();
    let deviations = report.calibration.deviations();
    for (k, (error, deviation)) in error.iter().zip(deviations.iter()).enumerate() {
        assert!(error.abs() < 4.5 * deviation, "parameter {k}: {error} with a deviation of {deviation}");
    }
    assert!(report.calibration.overall_px < 0.1 && (0.7..1.4).contains(&report.calibration.noise_scale));
    assert_eq!(report.used.len(), 18);
}

#[test]
fn what_cannot_be_calibrated_is_refused_with_what_is_missing() {
    let few = collected(views(4, 0.6, 0.09, 0.35)).finish().unwrap_err();
    assert!(
        matches!(&few, Refusal::FewViews { found: 4, missing } if missing.contains(&Missing::Views { count: MIN_VIEWS - 4 }))
    );
    let flat = collected(views(18, 0.02, 0.09, 0.35)).finish().unwrap_err();
    assert!(matches!(flat, Refusal::OneTilt { .. }), "{flat}");
    let middle = collected(views(18, 0.6, 0.01, 0.48)).finish().unwrap_err();
    assert!(
        matches!(&middle, Refusal::Uncovered { missing } if missing.contains(&Missing::Zone { column: 0, row: 0 })),
        "{middle}"
    );
}

#[test]
fn blurred_and_mirrored_views_are_not_used() {
    let target = Target::new(Size::A4);
    let board = vec![Sheet::board(&target, posed([0.1, 0.2, 0.0], [0.0, 0.0, 0.3]))];
    let mut collector = Collector::new(target);
    collector.add("mirrored", picture(optics(), board.clone(), 9).mirrored()).unwrap();
    assert!(matches!(collector.last_error(), Some(ViewError::Mirrored)));
    collector.add("blurred", picture(Optics { blur_px: 2.5, ..optics() }, board, 9)).unwrap();
    assert!(matches!(collector.last_error(), Some(ViewError::Blurred { .. } | ViewError::FewTags { .. })));
    assert_eq!(collector.views(), 0);
}

#[test]
fn patches_without_a_tag_give_none() {
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    let patch = |rng: &mut ChaCha8Rng| Patch {
        middle: [rng.random_range(-0.7..0.7), rng.random_range(-0.4..0.4)],
        half: [rng.random_range(0.005..0.1), rng.random_range(0.005..0.1)],
        angle_rad: rng.random_range(0.0..PI),
        grey: rng.random_range(15.0..220.0),
    };
    let patches = (0..800).map(|_| patch(&mut rng)).collect();
    let scene = Scene { sheets: Vec::new(), patches };
    assert_eq!(detect(&Renderer::new(optics()).picture(&scene, &mut rng).unwrap()), []);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

    #[test]
    fn no_image_makes_the_detector_panic(width in 1usize..70, height in 1usize..70, seed in 0u64..1000, coarse in 0u32..4) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let levels = [2u32, 8, 64, 256][coarse as usize];
        let pixels = (0..width * height).map(|_| (rng.random_range(0..levels) * 255 / (levels - 1)) as u8).collect();
        detect(&GreyImage::new(width, height, pixels).unwrap());
    }

    #[test]
    fn no_corners_make_the_refinement_panic(corners in proptest::array::uniform8(-50.0f64..120.0), seed in 0u64..1000) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let image = GreyImage::new(64, 48, (0..64 * 48).map(|_| rng.random_range(0..=255)).collect()).unwrap();
        let [a, b, c, d, e, f, g, h] = corners;
        let corners = [[a, b], [c, d], [e, f], [g, h]].map(Into::into);
        let _ = refine(&image, 7, &corners, None);
        let _ = refine(&image, 7, &corners, Some(&lens(&optics())));
    }
}
