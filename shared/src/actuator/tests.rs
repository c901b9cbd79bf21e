//! A platform stands where its legs have their lengths, in its own assembly mode, or says why not.

use proptest::prelude::*;

use super::*;
use crate::arms::{planar_module, seeded, spatial_module};
use crate::real::{Vec3, real};

fn settings<const LEGS: usize>(platform: &Platform<f64, LEGS>, shares: &[f64]) -> Settings<f64> {
    core::array::from_fn(|k| {
        let Some(leg) = platform.legs.get(k) else {
            return Setting::of_joint(0.0);
        };
        let [short, long, ..] = leg.length_m;
        Setting { base: leg.base, top: leg.top, value: short + shares[k] * (long - short) }
    })
}

/// The farthest that a leg is from its length, m.
fn miss<const LEGS: usize>(legs: &Settings<f64>, pose: &Pose<f64>) -> f64 {
    legs.iter().take(LEGS).map(|leg| ((*pose * leg.top - leg.base).norm() - leg.value).abs()).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(seeded(256))]

    #[test]
    fn planar_legs_have_their_lengths(shares in prop::array::uniform3(-0.1..1.1)) {
        let module = planar_module();
        let legs = settings(&module, &shares);
        let assembly = module.assemble(&legs).unwrap();
        prop_assert!(miss::<3>(&legs, &assembly.pose) < 1e-15 * 4.0);
        prop_assert!(assembly.iterations <= 6, "{} steps", assembly.iterations);
        prop_assert!(assembly.pose.is_planar());
    }

    #[test]
    fn legs_that_share_an_anchor_need_no_iteration(shares in prop::array::uniform3(-0.1..1.1)) {
        // The planar module's diagonal shares the base anchor of one leg and the top anchor of the other; without one, the other.
        let (mut module, aside) = (planar_module(), Vec3::new(0.03, 0.05, 0.0));
        for leg in [0, 2] {
            let legs = settings(&module, &shares);
            let form = module.closed_form(&legs).unwrap();
            let (newton, closed) = (module.assemble(&legs).unwrap().pose, form.pose(&legs, &module.home));
            // A few tens of roundings of lengths up to 2 m, over the sine of the angle at which circles meet.
            prop_assert!(newton.distance(&closed, 1.0) < 1e-13, "{}", newton.distance(&closed, 1.0));
            module.legs[leg].top += aside;
            module.legs[leg].base += aside;
            let lengths = module.lengths(&module.home);
            module.legs.iter_mut().zip(lengths).for_each(|(leg, length)| {
                let stroke = leg.length_m[1] - leg.length_m[0];
                (leg.length_m[0], leg.length_m[1]) = (length, length + stroke);
            });
        }
        prop_assert_eq!(module.closed_form(&settings(&module, &shares)), None);
    }

    #[test]
    fn spatial_legs_have_their_lengths(shares in prop::array::uniform6(0.0..1.0)) {
        let module = spatial_module();
        let legs = settings(&module, &shares);
        let assembly = module.assemble(&legs).unwrap();
        prop_assert!(miss::<6>(&legs, &assembly.pose) < 1e-15 * 4.0);
        prop_assert!(assembly.iterations <= 8, "{} steps", assembly.iterations);
    }

    #[test]
    fn any_lengths_give_the_right_mode_or_an_error(lengths in prop::array::uniform3(0.0..3.0)) {
        let module = planar_module();
        let mut legs = settings(&module, &[0.0; 3]);
        for (leg, length) in legs.iter_mut().zip(lengths) {
            leg.value = length;
        }
        if let Ok(Assembly { pose, .. }) = module.assemble(&legs) {
            prop_assert!(miss::<3>(&legs, &pose) < 1e-14);
            // In home's mode the top right corner is to the left of the right base anchor seen from the left one,
            // and the top left corner to the left of it seen from the left base anchor.
            let (left, right) = (pose * legs[0].top, pose * legs[2].top);
            let across = left - legs[0].base;
            prop_assert!(right.y > 0.0 && across.cross(&(right - legs[0].base)).z < 0.0, "{lengths:?}");
        }
    }

    #[test]
    fn legs_carry_the_load_by_virtual_work(
        shares in prop::array::uniform6(0.0..1.0),
        m in prop::array::uniform3(-1.0..1.0),
        f in prop::array::uniform3(-1.0..1.0),
    ) {
        let stage = Stage::Spatial(spatial_module());
        let legs = settings(&spatial_module(), &shares);
        let pose = stage.pose(&legs).unwrap();
        let load = Wrench { moment: m.into(), force: f.into() };
        let forces = stage.loads(&legs, &pose, &load);
        for (k, force) in forces.iter().enumerate() {
            let growth = stage.twist(&legs, &pose, k, Part::Value);
            prop_assert!((force + load.power(&growth)).abs() < 1e-12);
        }
    }

    #[test]
    fn single_precision_assembles_as_well(shares in prop::array::uniform6(0.0..1.0)) {
        let (module, spatial) = (planar_module(), spatial_module());
        let coarse = |leg: Setting<f64>| Setting::<f32> {
            base: leg.base.map(real), top: leg.top.map(real), value: real(leg.value),
        };
        let legs = settings(&module, &shares);
        let pose = module.assemble(&legs).unwrap().pose;
        let coarse_pose = module.cast::<f32>().assemble(&legs.map(coarse)).unwrap().pose;
        prop_assert!((coarse_pose.position - pose.position.map(real)).norm() < 2e-6);
        let legs = settings(&spatial, &shares);
        let pose = spatial.assemble(&legs).unwrap().pose;
        let coarse_pose = spatial.cast::<f32>().assemble(&legs.map(coarse)).unwrap().pose;
        prop_assert!((coarse_pose.position - pose.position.map(real)).norm() < 5e-6);
    }
}

#[test]
fn the_contracted_module_stands_at_home() {
    let module = planar_module();
    let assembly = module.assemble(&settings(&module, &[0.0; 3])).unwrap();
    assert!(module.home.distance(&assembly.pose, 1.0) < 1e-15);
    assert_eq!(assembly.iterations, 1);
}

#[test]
fn legs_too_short_cannot_be_assembled() {
    let module = planar_module();
    let error = module.assemble(&settings(&module, &[-3.0, -3.0, 0.0])).unwrap_err();
    assert!(matches!(error, PlatformError::NotAssembled { .. } | PlatformError::NearSingular { .. }), "{error}");
}

#[test]
fn three_parallel_legs_are_singular() {
    let mut module = planar_module();
    module.legs[1].base.x = 0.0;
    module.legs[1].top.x = 0.0;
    module.legs[1].length_m = [1.0, 1.25, 0.0, 0.0];
    let error = module.assemble(&settings(&module, &[0.0; 3])).unwrap_err();
    assert!(matches!(error, PlatformError::NearSingular { .. }), "{error}");
}

#[test]
fn a_load_on_the_plate_stands_on_the_upright_legs() {
    let stage = Stage::Planar(planar_module());
    let legs = settings(&planar_module(), &[0.0; 3]);
    let pose = stage.pose(&legs).unwrap();
    // 10 N down on the middle of the plate: 5 N of compression in each upright leg, none in the diagonal.
    let load = Wrench::of_force(Vec3::new(0.0, -10.0, 0.0), &Vec3::zeros());
    let [left, diagonal, right, ..] = stage.loads(&legs, &pose, &load);
    assert!((left - 5.0).abs() < 1e-12 && diagonal.abs() < 1e-12 && (right - 5.0).abs() < 1e-12);
}
