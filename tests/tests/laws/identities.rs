//! Laws across modules: what the geometry of an arm must obey whatever its numbers are.

use std::array::from_fn;
use std::f64::consts::SQRT_2;

use darm_core::actuator::{Leg, Platform, Stage};
use darm_core::chain::{Chain, Parameter, Scratch};
use darm_core::real::{Vec2, Vec3};
use darm_core::se::{Pose, Pose2, Twist};
use darm_core::units::Word;
use nalgebra::SMatrix;

/// One module of the planar initial arm of Miyahara and Chirikjian: 1 m plates, 25 % stroke.
fn planar_module() -> Platform<f64, 3> {
    let (left, right) = (Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.0));
    let leg = |base, top, length: f64| Leg { base, top, length_m: [length, 1.25 * length, 0.0, 0.0], states: 2 };
    Platform {
        legs: [leg(left, left, 1.0), leg(left, right, SQRT_2), leg(right, right, 1.0)],
        home: Pose2::new(0.0, 1.0, 0.0).into(),
    }
}

/// A six-legged module: pairs of anchors on circles of 0.5 m and 0.35 m, 0.6 m apart.
fn spatial_module() -> Platform<f64, 6> {
    let home = Pose::at(Vec3::new(0.0, 0.0, 0.6));
    let legs = from_fn(|k| {
        let on_circle = |radius: f64, apart: f64| {
            let side = if k % 2 == 0 { -apart } else { apart };
            let angle = (120.0 * (k / 2) as f64 + side).to_radians();
            Vec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
        };
        let (base, top) = (on_circle(0.5, 15.0), on_circle(0.35, 45.0));
        let length = (home * top - base).norm();
        Leg { base, top, length_m: [length, 1.25 * length, 0.0, 0.0], states: 2 }
    });
    Platform { legs, home }
}

fn arm<const N: usize>(module: Stage<f64>) -> Chain<f64, N> {
    Chain { mount: Pose::identity(), stages: (0..N).map(|_| module).collect(), tool: Pose::identity() }
}

fn planar_arm() -> Chain<f64, 4> {
    arm(Stage::Planar(planar_module()))
}

/// The word whose binary digits are those of `number`, the lowest first.
fn word(number: usize, len: usize) -> Word {
    let digits: Vec<u8> = (0..len).map(|k| (number >> k & 1) as u8).collect();
    Word::new(&digits).expect("binary digits")
}

/// The word that sets all legs of module m to digit m of `number`.
fn whole_modules(number: usize, modules: usize, legs: usize) -> Word {
    let digits: Vec<u8> = (0..modules * legs).map(|k| (number >> (k / legs) & 1) as u8).collect();
    Word::new(&digits).expect("binary digits")
}

/// How the tool moves with every leg length in one word: all lengths of state 0, then all of state 1.
fn rows_of<const N: usize>(chain: &Chain<f64, N>, word: &Word) -> Vec<Twist<f64>> {
    let mut scratch = Scratch::default();
    chain.pose_base_tool(word, &[], &mut scratch).expect("a posture");
    let stops = (0..2).flat_map(|state| (0..word.len() as u8).map(move |actuator| Parameter::Stop { actuator, state }));
    stops.map(|stop| chain.derivative(stop, &scratch)).collect()
}

/// The rank of the Jacobian of all `words` together, by the eigenvalues of GᵀG for 24 lengths.
fn rank<const N: usize>(chain: &Chain<f64, N>, words: impl Iterator<Item = Word>) -> usize {
    let mut gram = SMatrix::<f64, 24, 24>::zeros();
    for word in words {
        let rows = SMatrix::<f64, 6, 24>::from_columns(&from_fn::<_, 24, _>({
            let columns = rows_of(chain, &word);
            move |k| columns[k].to_vector()
        }));
        gram += rows.tr_mul(&rows);
    }
    let eigenvalues = gram.symmetric_eigenvalues();
    // Eigenvalues are squares of singular values: those of a missing rank are rounding, some 1e-16 of the largest.
    eigenvalues.iter().filter(|value| **value > 1e-12 * eigenvalues.max()).count()
}

/// Modules that switch as a whole can be turned against each other unseen: an SE(2) at each of three interfaces.
#[test]
fn five_words_of_whole_modules_fix_fifteen_of_24_lengths() {
    let five = [0b0000, 0b0001, 0b0010, 0b0100, 0b1000];
    assert_eq!(rank(&planar_arm(), five.into_iter().map(|number| whole_modules(number, 4, 3))), 15);
    assert_eq!(rank(&planar_arm(), (0..16).map(|number| whole_modules(number, 4, 3))), 15);
}

#[test]
fn all_words_together_fix_all_lengths() {
    assert_eq!(rank(&planar_arm(), (0..4096).map(|number| word(number, 12))), 24);
}

#[test]
fn whole_spatial_modules_leave_an_se3_at_each_interface() {
    let two: Chain<f64, 2> = arm(Stage::Spatial(spatial_module()));
    assert_eq!(rank(&two, (0..4).map(|number| whole_modules(number, 2, 6))), 6 * (2 + 1));
}

/// The point at the distances `a_m` from `a` and `b_m` from `b`, to the left of the way from `a` to `b`.
fn circles_meet(a: Vec2<f64>, a_m: f64, b: Vec2<f64>, b_m: f64) -> Vec2<f64> {
    let apart = (b - a).norm();
    let along = (b - a) / apart;
    let foot_m = (apart * apart + a_m * a_m - b_m * b_m) / (2.0 * apart);
    let height_m = (a_m * a_m - foot_m * foot_m).sqrt();
    a + along * foot_m + Vec2::new(-along.y, along.x) * height_m
}

/// The pose of the top of a planar module by compass: first its right corner, then its left one.
fn by_compass(lengths: [f64; 3]) -> Pose2<f64> {
    let [left_m, diagonal_m, right_m] = lengths;
    let (left, right) = (Vec2::new(-0.5, 0.0), Vec2::new(0.5, 0.0));
    let top_right = circles_meet(left, diagonal_m, right, right_m);
    let top_left = circles_meet(left, left_m, top_right, 1.0);
    let along = top_right - top_left;
    Pose2 { position: (top_left + top_right) / 2.0, angle_rad: along.y.atan2(along.x) }
}

#[test]
fn newton_finds_what_the_compass_finds_for_every_word() {
    let (chain, mut scratch) = (planar_arm(), Scratch::default());
    for word in (0..4096).map(|number| word(number, 12)) {
        let lengths = planar_module().legs.map(|leg| leg.length_m);
        let modules = (0..4).map(|m| by_compass(from_fn(|k| lengths[k][usize::from(word.digit(3 * m + k))])));
        let expected = modules.fold(Pose2::identity(), |pose, module| pose * module);
        let found = chain.pose_base_tool(&word, &[], &mut scratch).expect("a posture");
        // Four modules, each right to some 4e-16 m of leg over a lever of at most 5 m.
        assert!(Pose::from(expected).distance(&found, 1.0) < 1e-13, "{word}");
    }
}
