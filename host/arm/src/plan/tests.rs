//! Programs pass the checker of the board, with rests if requested.

use std::path::Path;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;
use crate::board_profile::BoardProfile;
use crate::wired_arm::profile_of;

fn arm(name: &str) -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
}

/// For a board with the profile that the arm names.
fn planned(arm: &Arm, visits: &[Visit]) -> Result<Plan, PlanError> {
    plan(arm, visits, &profile_of(arm, None).unwrap().board(None), &[])
}

fn visit(word: &str, angle_rad: Option<f64>) -> Visit {
    Visit { word: word.parse().unwrap(), servos_rad: angle_rad.into_iter().collect(), dwell_s: 0.1, label: word.into() }
}

fn seeded(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(0xda24), failure_persistence: None, ..Default::default() }
}

proptest! {
    #![proptest_config(seeded(64))]

    #[test]
    fn random_programs_pass_the_checker(
        stops in prop::collection::vec((0u16..4096, -1.0..1.0, 0.0..0.3), 1..60),
        new_coils in 1u8..7,
    ) {
        let arm = arm("planar4-hybrid.toml");
        let mut profile = profile_of(&arm, None).unwrap().profile;
        profile.supply.new_coils = new_coils;
        let profile = BoardProfile::new("less supply", profile);
        let visits: Vec<_> = stops
            .iter()
            .map(|&(bits, angle_rad, dwell_s)| {
                Visit { dwell_s, ..visit(&format!("{bits:012b}"), Some(angle_rad)) }
            })
            .collect();
        let plan = plan(&arm, &visits, &profile.board(None), &[]).unwrap();
        prop_assert_eq!(plan.windows.len(), visits.len());
        for (visit, &(from, to)) in visits.iter().zip(&plan.windows) {
            let last = plan.rows.iter().rfind(|row| row.at < to).unwrap();
            prop_assert_eq!(last.word, visit.word);
            prop_assert!(last.at + Micros::from_millis(100) <= from || last.at == Micros(0));
        }
    }
}

/// The first profile allows each output 1 s in one go and a tenth of 10 s.
#[test]
fn rests_keep_the_limits_of_a_cautious_profile() {
    let arm = arm("planar4.toml");
    let profile = BoardProfile::first(&arm);
    let board = profile.board(None);
    let visits: Vec<_> = (0..20u16).map(|k| visit(&format!("{:012b}", k * 1237 % 4096), None)).collect();
    assert!(matches!(plan(&arm, &visits, &board, &[]), Err(PlanError::Row { .. })));
    let rested = plan_with_rests(&arm, &visits, &board, &[]).unwrap();
    assert!(rested.rests > Micros(0) && rested.rests < rested.end);
    for (index, &(from, _)) in rested.windows.iter().enumerate().filter(|(index, _)| rested.rested[*index]) {
        let (_, before) = rested.windows[index - 1];
        assert!(rested.rows.iter().any(|row| row.word == arm.rest() && row.at >= before && row.at < from));
    }
    let too_long = [visit("000000000000", None), Visit { dwell_s: 2.0, ..visit("000000000001", None) }];
    assert!(matches!(plan_with_rests(&arm, &too_long, &board, &[]), Err(PlanError::Row { .. })));
    let generous = profile_of(&arm, None).unwrap();
    let none = plan_with_rests(&arm, &visits, &generous.board(None), &[]).unwrap();
    assert_eq!(none, planned(&arm, &visits).unwrap());
}

#[test]
fn eight_coils_at_once_go_in_two_rows() {
    let plan = planned(&arm("planar4.toml"), &[visit("111111110000", None)]).unwrap();
    let words: Vec<_> = plan.rows.iter().map(|row| (row.at, row.word.to_string())).collect();
    assert_eq!(
        words,
        [(Micros(0), "111111000000".into()), (Micros::from_millis(10), "111111110000".into())],
        "six coils may go on within 10 ms"
    );
    assert_eq!(plan.windows[0].0, Micros::from_millis(180), "150 ms to travel and 20 ms to settle");
}

#[test]
fn a_coil_that_would_be_on_too_long_is_told_by_its_visit() {
    let visits = [Visit { dwell_s: 301.0, ..visit("000000000001", None) }];
    let error = planned(&arm("planar4.toml"), &visits).unwrap_err();
    assert_eq!(
        error.to_string(),
        "000000000001: output 11 would be on for longer than it may (max_on_ms = 300000 in the profile); dwell for a shorter time, or put words between in which the output is off"
    );
}

/// Two rules have one fault on the board, and cures that contradict each other.
#[test]
fn a_peak_that_comes_too_soon_and_a_share_that_is_too_large_have_their_own_cures() {
    let arm = arm("planar4.toml");
    let refusal = |duty_percent: u8, dwell_s: f64| {
        let mut profile = profile_of(&arm, None).unwrap().profile;
        let output = profile.outputs[11].as_mut().unwrap();
        output.drive = Drive::PeakHold { pull: 11, hold: 12, peak_ms: 40 };
        output.limit = CoilLimit { max_on_ms: 60_000, duty_percent, window_ms: 10_000 };
        let profile = BoardProfile::new("peaks", profile);
        let words = ["000000000001", "000000000000"].into_iter().cycle().take(40);
        let visits: Vec<Visit> = words.map(|word| Visit { dwell_s, ..visit(word, None) }).collect();
        plan(&arm, &visits, &profile.board(None), &[]).err().map(|error| error.to_string())
    };
    let peak = refusal(100, 0.01).unwrap();
    let cure = "output 11 would have a peak before its pause is over (peak_ms = 40 in the profile: from one peak to the next it \
                takes at least ten, 400 ms); dwell for at least 0.4 s, or leave the output on between these words";
    assert!(peak.ends_with(cure), "{peak}");
    assert_eq!(refusal(100, 0.4), None, "the cure works");
    let share = refusal(20, 0.5).unwrap();
    assert!(share.contains("(duty_percent = 20, window_ms = 10000 in the profile); put words between"), "{share}");
}
