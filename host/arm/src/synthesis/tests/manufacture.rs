//! Tolerances, parts of a list, and anchors.

use super::*;

/// How far anchors of a hidden arm stand off, m.
const ANCHOR_M: f64 = 0.1;

#[test]
fn expected_errors_agree_with_drawn_arms_and_fall() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.05, 5);
    let tolerance = Tolerance { stop_m: 5e-5, stop_rad: 5e-5, anchor_m: 1e-4, worth_m: 3.0 };
    let found = synthesize(&arm, &desired, &Options::default()).unwrap();
    let calm = |worth_m| {
        let calm =
            minimize_sensitivity(&arm, &found, &Tolerance { worth_m, ..tolerance }, &Options::default()).unwrap();
        assert!(calm.status == Status::Reached && calm.kept);
        calm
    };
    let (near, far) = (calm(3.0), calm(100.0));
    let sum = |found: &Synthesis| {
        let expected = expected(&found.arm, &desired, &tolerance, 1);
        for frame in &expected {
            assert!((frame.sampled_m / frame.linear_m - 1.0).abs() < 0.15, "{frame:?}");
            assert!((frame.sampled_rad / frame.linear_rad - 1.0).abs() < 0.15, "{frame:?}");
        }
        expected.iter().map(|frame| frame.linear_m.powi(2) + (0.5 * frame.linear_rad).powi(2)).sum::<f64>()
    };
    assert!(sum(&far) < sum(&near) && sum(&near) < sum(&found));
    assert!(found.alteration_m < near.alteration_m && near.alteration_m < far.alteration_m);
}

#[test]
fn legs_are_bought_from_a_list() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.05, 5);
    let part = |part: &str, stroke_mm, retracted_mm, price| Part {
        part: part.into(),
        stroke_mm,
        retracted_mm,
        force_n: 5000.0,
        price,
    };
    let parts = [part("A", 400.0, 900.0, 30.0), part("B", 600.0, 800.0, 60.0), part("C", 700.0, 1200.0, 80.0)];
    let (found, bought) = buy(&arm, &desired, &parts, &Options::default()).unwrap();
    assert!(found.status == Status::Reached && found.kept && bought.len() == 12);
    for bought in &bought {
        assert!(
            bought.lengths_m.0 <= bought.stops_m.0 + 1e-9 && bought.stops_m.1 <= bought.lengths_m.1 + 1e-9,
            "{bought:?}"
        );
    }
    let weak = [Part { force_n: 0.1, ..part("D", 900.0, 500.0, 1.0) }];
    let error = buy(&arm, &desired, &weak, &Options::default()).unwrap_err().to_string();
    assert!(error.contains("more than any part of the list"), "{error}");
}

#[test]
fn anchors_move_where_stops_do_not_suffice() {
    let arm = planar4();
    // An arm whose anchors stand elsewhere, with stops within the parts: they can serve.
    let mut hidden = arm.clone();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for stage in &mut hidden.model.chain.stages {
        for leg in 0..3 {
            let leg = stage.leg_mut(leg).unwrap();
            let (short, long) = (leg.length_m[0] + 0.03, leg.length_m[1] - 0.03);
            (leg.length_m[0], leg.length_m[1]) = (short, long);
            let mut off = || rng.random_range(-ANCHOR_M..ANCHOR_M);
            (leg.base.x, leg.base.y, leg.top.x, leg.top.y) =
                (leg.base.x + off(), leg.base.y + off(), leg.top.x + off(), leg.top.y + off());
        }
    }
    let desired = own_frames(&hidden, &WORDS);
    let part = |part: &str, stroke_mm, retracted_mm| Part {
        part: part.into(),
        stroke_mm,
        retracted_mm,
        force_n: 5000.0,
        price: 1.0,
    };
    let parts = [part("A", 250.0, 1000.0), part("B", 353.6, 1414.2)];
    let with = |anchor_m| Options { bounds: Bounds { anchor_m, ..Bounds::default() }, starts: 2, ..Options::default() };
    let (found, _) = buy(&arm, &desired, &parts, &with(0.0)).unwrap();
    assert_eq!((found.status, found.anchors_moved_m), (Status::Closest, 0.0));
    let (found, bought) = buy(&arm, &desired, &parts, &with(2.0 * ANCHOR_M)).unwrap();
    assert!(found.status == Status::Reached && found.kept, "{:?}", found.obstacle);
    assert!(found.anchors_moved_m > 1e-3 && found.anchors_moved_m < 2.0 * ANCHOR_M + 1e-9, "{}", found.anchors_moved_m);
    for Bought { lengths_m, stops_m, .. } in &bought {
        assert!(lengths_m.0 <= stops_m.0 + 1e-9 && stops_m.1 <= lengths_m.1 + 1e-9, "{lengths_m:?} {stops_m:?}");
    }
    let (here, there) = (&arm.model.chain.stages[0], &found.arm.model.chain.stages[0]);
    assert!((0..3).all(|leg| here.leg(leg).unwrap().base.z == there.leg(leg).unwrap().base.z));
    // Where stops suffice, anchors stay.
    let found = synthesize(&arm, &moved(own_frames(&arm, &WORDS), 0.1, 5), &with(ANCHOR_M)).unwrap();
    assert_eq!((found.status, found.anchors_moved_m), (Status::Reached, 0.0));
}
