//! The shapes of two hands: which pairs are checked, gradients of gaps, and answers against all shapes.

use std::path::Path;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::grasp::assembly::HandFile;
use crate::grasp::file::read_hand;
use crate::grasp::hand::Hand;
use crate::grasp::layout::{ANGLES, COORDINATES, PALM, joints_of};
use crate::grasp::library::Library;
use crate::grasp::solve::Settings;

const HANDS: [&str; 2] = ["allegro_hand.toml", "leap_hand.toml"];

fn hand(name: &str) -> HandFile {
    read_hand(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
}

/// Whether any two shapes touch that neither belong to one link nor to two that a joint connects.
fn any_touch(hand: &Hand, links: &Links) -> bool {
    let at = |body: usize| links.get(body).copied().unwrap_or(Pose::identity());
    let all: Vec<_> =
        hand.bodies.iter().enumerate().flat_map(|(k, body)| body.shapes.iter().map(move |s| (k, s))).collect();
    all.iter().enumerate().any(|(index, (a, first))| {
        all[..index].iter().any(|(b, second)| {
            let [one, other] = [first, second].map(|shape| Piece::new(shape).unwrap());
            let poses = [pose(&at(*a)) * one.pose, pose(&at(*b)) * other.pose];
            let found = query::intersection_test(&poses[0], &*one.shape, &poses[1], &*other.shape).unwrap();
            a != b && !is_joined(&[*a, *b]) && found.intersecting
        })
    })
}

#[test]
fn no_two_shapes_of_an_answer_touch() {
    for name in HANDS {
        let HandFile { hand, cross_check, .. } = hand(name);
        assert!(hand.overlapping().is_empty(), "{name}: {:?}", hand.overlapping());
        let library = Library::draw(&hand, 300, 1);
        let mut solved = 0;
        for contacts in hand.draw_many(10, 4) {
            let found = hand.solve(&library, &contacts, &Settings::default());
            let (links, _) = cross_check.place(&found.configuration).unwrap();
            assert!(!found.is_solved || !any_touch(&hand, &links), "{name}");
            solved += usize::from(found.is_solved);
        }
        assert!(solved > 8, "{name}: {solved}");
    }
}

#[test]
fn the_thumb_of_the_allegro_hand_is_kept_out_of_its_palm() {
    let hand = hand(HANDS[0]).hand;
    let second = hand.bodies.iter().position(|body| body.name == "link_13.0").unwrap();
    assert!(hand.shapes.pairs.contains(&[second, PALM]));
    let mut angles = hand.middle();
    angles[COORDINATES * 3] = hand.limits[COORDINATES * 3][0];
    let links = hand.place(&angles).links;
    let mut depth_m = 0.0;
    hand.shapes.near(&links, 0.0, |gap| depth_m = gap.distance_m.min(depth_m));
    assert_eq!(hand.shapes.collision(&links), Some([second, PALM]));
    assert!((-20e-3..-1e-3).contains(&depth_m), "{depth_m}");
}

#[test]
fn links_that_touch_in_nearly_all_postures_are_named_and_not_checked() {
    let HandFile { hand, .. } = hand(HANDS[0]);
    let mut bodies = hand.bodies.clone();
    bodies[PALM].shapes[0].geometry = Geometry::Cuboid { half_m: Vec3::repeat(0.07) };
    let large = Hand::new(hand.name, hand.fingers, hand.limits, bodies).unwrap();
    assert!(large.overlapping().contains(&["link_1.0".into(), "palm_link".into()]), "{:?}", large.overlapping());
    assert!(large.shapes.pairs.iter().all(|pair| !large.shapes.overlapping.contains(pair)));
    assert_eq!(large.shapes.pairs.len() + large.shapes.overlapping.len(), hand.shapes.pairs.len());
}

#[test]
fn the_gradient_of_a_gap_is_the_derivative_of_its_distance() {
    for name in HANDS {
        let hand = hand(name).hand;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let gaps = |angles: &[f64; ANGLES]| {
            let (placed, mut gaps) = (hand.place(angles), Vec::new());
            hand.shapes.near(&placed.links, 5e-3, |gap| gaps.push(gap));
            (placed, gaps)
        };
        let (mut checked, mut worst) = (0, 0.0_f64);
        for _ in 0..20 {
            let angles = hand.random_angles(&mut random);
            let (placed, near) = gaps(&angles);
            for k in 0..ANGLES {
                let moved = |step: f64| {
                    let mut angles = angles;
                    angles[k] += step;
                    gaps(&angles).1
                };
                let (before, after) = (moved(-1e-7), moved(1e-7));
                for gap in &near {
                    let same =
                        |gaps: &[Gap]| gaps.iter().find(|other| other.pair == gap.pair).map(|gap| gap.distance_m);
                    let (Some(low), Some(high)) = (same(&before), same(&after)) else { continue };
                    let axis = placed.axes[k];
                    let moves =
                        |body: usize| joints_of(body).is_some_and(|(i, n)| k / COORDINATES == i && k % COORDINATES < n);
                    let speed = |side: usize| match moves(gap.pair[side]) {
                        true => axis.direction.cross(&(gap.points[side] - axis.point)),
                        false => Vec3::zeros(),
                    };
                    let expected = gap.apart.dot(&(speed(0) - speed(1)));
                    worst = worst.max(((high - low) / 2e-7 - expected).abs());
                    checked += 1;
                }
            }
        }
        assert!(checked > 500 && worst < 1e-5, "{name}: {checked}, {worst:e}");
    }
}

/// What the boxes leave out is no gap: the gaps are those of all pieces, asked one by one.
#[test]
fn boxes_leave_out_no_piece_that_is_near() {
    const MARGIN_M: f64 = 2e-3;
    for name in HANDS {
        let hand = hand(name).hand;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let (mut near, mut skipped) = (0, 0);
        for _ in 0..40 {
            let links = hand.place(&hand.random_angles(&mut random)).links;
            let at = placed(&links);
            for [a, b] in &hand.shapes.pairs {
                for (first, second) in hand.shapes.bodies[*a]
                    .1
                    .iter()
                    .flat_map(|one| hand.shapes.bodies[*b].1.iter().map(move |o| (one, o)))
                {
                    let [one, other] = [at[*a] * first.pose, at[*b] * second.pose];
                    let found = query::contact(&one, &*first.shape, &other, &*second.shape, MARGIN_M).unwrap();
                    let by_boxes = first.bounds.is_near(&one, &second.bounds, &other, MARGIN_M);
                    assert!(by_boxes || found.is_none(), "{name}: {found:?}");
                    near += usize::from(found.is_some());
                    skipped += usize::from(!by_boxes);
                }
            }
        }
        assert!(near > 20 && skipped > 20 * near, "{name}: {near} near, {skipped} left out");
    }
}
