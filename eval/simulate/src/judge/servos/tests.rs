//! Judge 1 on a mechanism that is set by hand.

use super::super::{Ceilings, ServoCeiling};
use super::{Joint, MS, Servos, Wish};

const REST: Joint = Joint {
    id: 1,
    step: 2048.0,
    has_torque: true,
    goal: 2048.0,
    torque_limit: 800,
    answers: 1,
    is_blocked: false,
    is_overloaded: false,
    is_heard: true,
    is_silent: false,
    misled: 0,
    is_bus_clear: true,
    is_pushed: false,
};

/// The judge of one servo that has answered and holds in the middle.
fn judge(is_released: bool) -> Servos {
    let servo = ServoCeiling {
        id: 1,
        min_step: 1000,
        max_step: 3000,
        max_steps_s: 500,
        max_torque: 800,
        timeout_ms: 100,
        is_released,
    };
    let (lines, servos) = ([None; 64], vec![servo]);
    let ceilings =
        Ceilings { lines, latches: Vec::new(), servos, new_loads: 1, budget_ms: 10, refresh_ms: 100, clock_ppm: 0 };
    let mut judge = Servos::new(ceilings);
    judge.look(0, true, [Joint { answers: 0, has_torque: false, ..REST }].into_iter());
    judge.look(MS, true, [Joint { has_torque: false, ..REST }].into_iter());
    judge.on_order(MS, Wish::Angle(0, 0.0));
    judge.look(2 * MS, true, [REST].into_iter());
    judge.end_orders(u64::MAX);
    judge.look(3 * MS, true, [REST].into_iter());
    judge.look(4 * MS, true, [REST].into_iter());
    judge
}

/// Turns the servo towards its goal at this speed, from 4 ms on, for so many ticks.
fn turn(judge: &mut Servos, from_ms: u64, ticks: u64, joint: Joint, steps_s: f32) -> Joint {
    let mut joint = joint;
    for tick in 1..=ticks {
        let step = 1e-3 * steps_s;
        joint.step += (joint.goal - joint.step).clamp(-step, step);
        joint.answers += 1;
        judge.look((from_ms + tick) * MS, true, [joint].into_iter());
    }
    joint
}

impl Servos {
    fn last_has_no_torque(&mut self) {
        self.tracks.iter_mut().for_each(|track| track.last.has_torque = false);
    }
}

fn broken(judge: Servos) -> Vec<&'static str> {
    judge.finish().firsts().iter().map(|(first, _)| first.rule).collect()
}

#[test]
fn an_ordered_motion_within_all_limits_breaks_no_rule() {
    let mut judge = judge(false);
    judge.on_order(4 * MS, Wish::Angle(0, 1.0));
    turn(&mut judge, 4, 2_000, Joint { goal: 2700.0, ..REST }, 500.0);
    assert!(broken(judge).is_empty());
}

#[test]
fn range_speed_and_torque_are_seen_at_the_shaft() {
    for (goal, steps_s, torque_limit, rule) in
        [(3020.0, 500.0, 800, "servo-range"), (2700.0, 530.0, 800, "servo-speed"), (2700.0, 500.0, 801, "servo-torque")]
    {
        let mut judge = judge(false);
        judge.on_order(4 * MS, Wish::Angle(0, (goal - 2048.0) / super::STEPS_PER_RAD));
        turn(&mut judge, 4, 2_100, Joint { goal, torque_limit, ..REST }, steps_s);
        assert_eq!(broken(judge), [rule]);
    }
}

#[test]
fn a_servo_that_the_profile_holds_keeps_its_torque() {
    for is_released in [false, true] {
        let mut judge = judge(is_released);
        turn(&mut judge, 4, 5, Joint { has_torque: false, ..REST }, 0.0);
        assert_eq!(judge.finish().has("servo-hold"), !is_released);
    }
}

#[test]
fn a_servo_that_holds_with_less_torque_than_the_profile_says_is_seen() {
    for (torque_limit, ticks, is_broken) in [(799, 200, false), (500, 90, false), (500, 110, true), (0, 110, true)] {
        let mut judge = judge(false);
        turn(&mut judge, 4, ticks, Joint { torque_limit, ..REST }, 0.0);
        assert_eq!(judge.finish().has("servo-weak"), is_broken, "{torque_limit} thousandths for {ticks} ms");
    }
    let mut judge = judge(false);
    judge.on_order(4 * MS, Wish::Angle(0, 0.0));
    turn(&mut judge, 4, 300, Joint { torque_limit: 500, ..REST }, 0.0);
    assert!(!judge.finish().has("servo-weak"), "a table may say less");
}

#[test]
fn one_that_has_lowered_its_torque_limit_by_itself_has_it_back_after_a_stop() {
    for (ticks, is_broken) in [(90, false), (110, true)] {
        let mut judge = judge(false);
        judge.on_weakened(0);
        let joint = turn(&mut judge, 4, 300, Joint { torque_limit: 100, ..REST }, 0.0);
        judge.on_repeated_stop();
        turn(&mut judge, 304, ticks, joint, 0.0);
        assert_eq!(judge.finish().has("servo-weak"), is_broken, "{ticks} ms");
    }
}

#[test]
fn a_servo_that_gets_torque_without_an_order_is_seen() {
    for (order_ms, is_broken) in [(Some(4), false), (None, true)] {
        let mut judge = judge(false);
        judge.on_start(4 * MS);
        if order_ms.is_some() {
            judge.on_order(4 * MS, Wish::Angle(0, 0.0));
        }
        judge.last_has_no_torque();
        turn(&mut judge, 5, 3, REST, 0.0);
        assert_eq!(judge.finish().has("unasked-torque"), is_broken, "{order_ms:?}");
    }
}

/// The board has to have latched the safe state.
#[test]
fn a_servo_that_is_pushed_away_from_what_it_holds_latches_the_safe_state() {
    for (step, is_latched) in [(2120.0, false), (2140.0, true)] {
        let mut judge = judge(false);
        turn(&mut judge, 4, 80, Joint { step, is_pushed: true, ..REST }, 0.0);
        assert_eq!(judge.is_latched(), is_latched, "at {step}");
        assert!(judge.verdict.firsts().is_empty(), "a push is no motion of its own");
    }
}

#[test]
fn a_servo_that_is_pushed_away_from_its_target_latches_the_safe_state_once_it_has_been_there() {
    for (goal, is_latched) in [(2048.0, true), (2300.0, false)] {
        let mut judge = judge(false);
        judge.on_order(4 * MS, Wish::Angle(0, (goal - 2048.0) / super::STEPS_PER_RAD));
        turn(&mut judge, 4, 10, Joint { goal, ..REST }, 0.0);
        turn(&mut judge, 14, 80, Joint { goal, step: 2148.0, is_pushed: true, ..REST }, 0.0);
        assert_eq!(judge.is_latched(), is_latched, "to {goal}");
    }
}

#[test]
fn a_servo_without_torque_that_is_turned_too_fast_latches_the_safe_state() {
    for (steps_s, is_latched) in [(1_740.0, false), (1_760.0, true)] {
        let mut judge = judge(true);
        let joint = Joint { goal: 2900.0, has_torque: false, is_pushed: true, ..REST };
        turn(&mut judge, 4, 80, joint, steps_s);
        assert_eq!(judge.is_latched(), is_latched, "at {steps_s} steps/s");
    }
}

#[test]
fn a_servo_without_torque_that_is_turned_out_of_its_range_latches_the_safe_state() {
    for (step, is_latched) in [(3013.0, false), (3015.0, true), (985.0, true)] {
        let mut judge = judge(true);
        turn(&mut judge, 4, 80, Joint { step, has_torque: false, is_pushed: true, ..REST }, 0.0);
        assert_eq!(judge.is_latched(), is_latched, "at {step}");
        assert!(judge.verdict.firsts().is_empty(), "a hand is no motion of its own");
    }
}

#[test]
fn a_damaged_request_is_no_motion_after_a_fault() {
    for (ticks, is_broken) in [(15, false), (200, true)] {
        let mut judge = judge(false);
        judge.on_fault(5 * MS, 4 * MS);
        let joint = turn(&mut judge, 4, 1_000, REST, 0.0);
        let joint = turn(&mut judge, 1_004, ticks, Joint { goal: 2400.0, misled: 1, ..joint }, 500.0);
        turn(&mut judge, 1_004 + ticks, 100, Joint { goal: joint.step, ..joint }, 0.0);
        judge.on_fault(1_400 * MS, 4 * MS);
        assert_eq!(judge.verdict.has("fault-motion"), is_broken, "for {ticks} ms");
    }
}

/// docs/safety.md: servos stay below the profile's torque.
#[test]
fn a_torque_limit_beyond_the_profile_is_seen() {
    let mut judge = judge(false);
    turn(&mut judge, 4, 1, Joint { torque_limit: u16::MAX, ..REST }, 0.0);
    assert!(!judge.finish().firsts().is_empty());
}

/// `simulate --chip rp2040 --seeds 700004..700005`: noise of two parameters passed the sum, and the judge took it for a position. The
/// firmware, which asked for six registers, refused it. Now noise that no servo sent is nothing that the judge sees.
#[test]
fn a_packet_of_another_length_is_no_position() {
    let mut judge = judge(false);
    judge.on_order(4 * MS, Wish::Angle(0, 0.0));
    turn(&mut judge, 4, 5, REST, 500.0);
    // Whatever came on the bus, the shaft is where it is.
    assert_eq!((judge.moving(), judge.places()), (None, vec![(2048.0, 2048.0)]));
    assert!(broken(judge).is_empty());
}

#[test]
fn a_goal_that_no_order_in_force_explains_is_seen_also_if_it_was_asked_for_once() {
    let mut judge = judge(false);
    judge.on_order(4 * MS, Wish::Angle(0, 1.0));
    judge.end_orders(5 * MS);
    turn(&mut judge, 5, 300, Joint { goal: 2700.0, ..REST }, 500.0);
    assert_eq!(broken(judge), ["unasked-goal", "unasked-motion"]);
}

#[test]
fn an_order_of_another_servo_or_for_a_table_that_nobody_played_explains_nothing() {
    let mut judge = judge(false);
    judge.on_order(4 * MS, Wish::Angle(1, 1.0));
    judge.on_tabled(0, 1.0);
    turn(&mut judge, 5, 1, Joint { goal: 2700.0, ..REST }, 500.0);
    assert!(judge.verdict.has("unasked-goal"));
}

#[test]
fn a_shaft_that_turns_on_after_its_order_has_ended_is_seen() {
    for (ticks, is_broken) in [(90, false), (120, true)] {
        let mut judge = judge(false);
        judge.on_order(4 * MS, Wish::Angle(0, 1.0));
        let joint = turn(&mut judge, 4, 100, Joint { goal: 2700.0, ..REST }, 500.0);
        judge.end_orders(104 * MS);
        let joint = turn(&mut judge, 104, ticks, joint, 500.0);
        turn(&mut judge, 104 + ticks, 50, Joint { goal: joint.step, ..joint }, 500.0);
        assert_eq!(judge.verdict.has("unasked-motion"), is_broken, "{ticks} ms");
    }
}

#[test]
fn a_hold_that_creeps_is_seen_and_one_that_bends_once_is_not() {
    for (holds, is_broken) in [(2, false), (8, true)] {
        let (mut judge, mut joint) = (judge(false), REST);
        for hold in 0..holds {
            joint.goal -= 3.0;
            joint = turn(&mut judge, 4 + 500 * hold, 500, joint, 500.0);
        }
        assert_eq!(broken(judge).is_empty(), !is_broken, "{holds} times");
    }
}

/// Its load bends it once more in each silence, as where the board takes its place for the goal afterwards.
#[test]
fn silences_that_let_a_servo_sink_a_little_each_are_seen() {
    for (silences, is_broken) in [(3, false), (4, true)] {
        let mut judge = judge(false);
        let mut joint = turn(&mut judge, 4, 5, REST, 0.0);
        for silence in 0..silences {
            let silent = Joint { is_heard: false, is_silent: true, ..joint };
            turn(&mut judge, 9 + 300 * silence, 100, silent, 0.0);
            joint.goal -= 5.0;
            joint = turn(&mut judge, 109 + 300 * silence, 200, joint, 500.0);
        }
        assert_eq!(broken(judge).is_empty(), !is_broken, "{silences} silences");
    }
}

#[test]
fn a_start_may_let_a_servo_arrive_that_was_nearly_there() {
    for (steps, is_broken) in [(21.0, false), (23.0, true)] {
        let mut judge = judge(false);
        judge.on_start(4 * MS);
        turn(&mut judge, 4, 500, REST, 0.0);
        turn(&mut judge, 504, 500, Joint { goal: 2048.0 + steps, ..REST }, 500.0);
        assert_eq!(broken(judge).is_empty(), !is_broken, "{steps} steps");
    }
}

#[test]
fn starts_that_let_a_servo_sink_a_little_each_are_seen() {
    for (starts, is_broken) in [(4, false), (5, true)] {
        let mut judge = judge(false);
        let mut joint = turn(&mut judge, 4, 5, REST, 0.0);
        for start in 0..starts {
            judge.on_start((9 + 500 * start) * MS);
            joint.goal -= 5.0;
            joint = turn(&mut judge, 9 + 500 * start, 500, joint, 500.0);
        }
        let rules = broken(judge);
        assert_eq!(!rules.is_empty(), is_broken, "{starts} starts: {rules:?}");
    }
}

#[test]
fn torque_before_the_first_answer_is_seen() {
    let mut judge = judge(false);
    judge.on_start(4 * MS);
    judge.look(5 * MS, true, [REST].into_iter());
    assert!(!judge.verdict.has("torque-unseen"), "it holds, as it did before the start");
    judge.look(6 * MS, true, [Joint { goal: 2050.0, ..REST }].into_iter());
    assert_eq!(broken(judge), ["torque-unseen"]);
}

#[test]
fn a_servo_that_a_fault_does_not_release_is_seen() {
    for (is_released, has_torque, rules) in
        [(true, true, &["servo-release"][..]), (true, false, &[]), (false, true, &[])]
    {
        let mut judge = judge(is_released);
        judge.fallen_back_ns = None;
        judge.on_latched(4 * MS);
        let joint = turn(&mut judge, 4, 50, REST, 0.0);
        turn(&mut judge, 54, 100, Joint { has_torque, ..joint }, 0.0);
        assert_eq!(broken(judge), rules);
    }
}

#[test]
fn an_order_in_the_safe_state_explains_nothing() {
    let mut judge = judge(false);
    judge.on_latched(4 * MS);
    judge.on_order(5 * MS, Wish::Angle(0, 1.0));
    turn(&mut judge, 5, 1, Joint { goal: 2700.0, ..REST }, 500.0);
    assert_eq!(broken(judge), ["unasked-goal"]);
}

#[test]
fn motion_after_a_fault_that_is_reported_later_is_seen() {
    for (fault_ms, is_broken) in [(90, true), (950, false)] {
        let mut judge = judge(false);
        judge.on_order(4 * MS, Wish::Angle(0, 1.0));
        turn(&mut judge, 4, 1_000, Joint { goal: 2500.0, ..REST }, 500.0);
        judge.on_fault(2_000 * MS, fault_ms * MS);
        assert_eq!(judge.verdict.has("fault-motion"), is_broken, "{fault_ms} ms");
    }
}

#[test]
fn a_servo_that_turns_on_under_an_overload_is_seen() {
    for (ticks, is_broken) in [(140, false), (170, true)] {
        let mut judge = judge(false);
        judge.on_order(4 * MS, Wish::Angle(0, 1.0));
        turn(&mut judge, 4, ticks, Joint { goal: 2700.0, is_overloaded: true, ..REST }, 500.0);
        assert_eq!(judge.verdict.has("servo-overload"), is_broken, "{ticks} ms");
    }
}

/// A program moves a servo in short spans, none of them as long as what a stop takes.
#[test]
fn a_servo_that_goes_on_under_an_overload_in_each_row_of_a_program_is_seen() {
    for (rows, is_broken) in [(1, false), (2, true)] {
        let mut judge = judge(false);
        judge.on_order(4 * MS, Wish::Table);
        let mut joint = Joint { is_overloaded: true, ..REST };
        for row in 0..rows {
            joint.goal += 40.0;
            judge.on_tabled(0, (joint.goal - 2048.0) / super::STEPS_PER_RAD);
            joint = turn(&mut judge, 4 + 200 * row, 200, joint, 500.0);
        }
        assert_eq!(judge.verdict.has("servo-overload"), is_broken, "{rows} rows");
    }
}

#[test]
fn a_calibration_that_turns_a_shaft_is_seen() {
    for (goal, is_broken) in [(2050.0, false), (2080.0, true)] {
        let mut judge = judge(false);
        let before = judge.places();
        turn(&mut judge, 4, 100, Joint { goal, ..REST }, 500.0);
        judge.on_calibrated(200 * MS, &before);
        assert_eq!(judge.verdict.has("calibration-moves"), is_broken, "to {goal}");
    }
}

#[test]
fn silence_of_a_driven_servo_is_seen() {
    let mut judge = judge(false);
    turn(&mut judge, 4, 1, REST, 0.0);
    judge.on_pause(5 * MS, 45 * MS);
    judge.on_lines_on((5 + 45 + 103) * MS);
    assert!(!judge.verdict.has("servo-silence"), "a pause does not count");
    assert_eq!(judge.silent((5 + 45 + 103) * MS, 0), None);
    judge.on_lines_on((5 + 45 + 103) * MS + 1);
    assert!(judge.verdict.has("servo-silence"));
    assert_eq!(judge.silent((5 + 45 + 103) * MS + 1, 0).map(|(servo, _)| servo), Some(0));
}

#[test]
fn a_servo_on_its_way_while_the_flash_lets_nothing_run_is_seen() {
    for (steps, is_broken) in [(60.0, false), (70.0, true)] {
        let mut judge = judge(false);
        judge.on_order(4 * MS, Wish::Angle(0, steps / super::STEPS_PER_RAD));
        judge.look(900 * MS, true, [Joint { goal: 2048.0 + steps, ..REST }].into_iter());
        judge.on_pause(901 * MS, MS);
        assert_eq!(judge.verdict.has("flash-under-motion"), is_broken, "{steps} steps");
    }
}

#[test]
fn a_servo_that_nobody_wired_is_not_driven() {
    let mut judge = judge(false);
    let stranger = Joint { id: 9, has_torque: false, ..REST };
    judge.look(5 * MS, true, [REST, stranger].into_iter());
    judge.look(6 * MS, true, [REST, stranger].into_iter());
    assert!(judge.verdict.firsts().is_empty());
    judge.look(7 * MS, true, [REST, Joint { has_torque: true, ..stranger }].into_iter());
    assert_eq!(broken(judge), ["servo-wiring"]);
}

/// A servo on its way to an ordered goal obeys a damaged request, and has its own goal again after this number of ticks.
fn is_misled_for(ticks: u64) -> Vec<&'static str> {
    let mut judge = judge(false);
    judge.on_order(4 * MS, Wish::Angle(0, 500.0 / super::STEPS_PER_RAD));
    let ordered = Joint { goal: 2548.0, ..REST };
    let joint = turn(&mut judge, 4, 200, ordered, 500.0);
    let misled = Joint { goal: 1200.0, torque_limit: 1000, misled: 1, ..joint };
    let joint = turn(&mut judge, 204, ticks, misled, 900.0);
    turn(&mut judge, 204 + ticks, 500, Joint { goal: 2548.0, torque_limit: 800, ..joint }, 500.0);
    broken(judge)
}

#[test]
fn a_servo_may_obey_a_damaged_request_until_it_is_read_back() {
    assert!(is_misled_for(25).is_empty());
    let rules = is_misled_for(40);
    assert!(["misled-goal", "servo-torque", "servo-speed"].iter().all(|rule| rules.contains(rule)), "{rules:?}");
}

#[test]
fn a_damaged_request_excuses_nothing_after_its_time() {
    let mut judge = judge(false);
    let joint = turn(&mut judge, 4, 60, Joint { misled: 1, ..REST }, 0.0);
    turn(&mut judge, 64, 1, Joint { goal: 2400.0, ..joint }, 500.0);
    assert_eq!(broken(judge), ["unasked-goal"]);
}

#[test]
fn an_offset_that_was_replaced_explains_no_goal() {
    for (newest_rad, is_asked) in [(0.2, true), (-0.1, false)] {
        let mut judge = judge(false);
        [0.2, newest_rad].into_iter().for_each(|rad| judge.on_offsets([rad; 4]));
        judge.on_offsets_confirmed([newest_rad; 4]);
        judge.on_order(5 * MS, Wish::Angle(0, 0.3));
        let goal = 2048.0 + 0.5 * super::STEPS_PER_RAD;
        judge.look(6 * MS, true, [Joint { goal, ..REST }].into_iter());
        assert_eq!(broken(judge).is_empty(), is_asked, "{newest_rad}");
    }
}

#[test]
fn the_offset_of_another_servo_explains_no_goal() {
    for (offsets_rad, is_asked) in [([0.2, 0.0, 0.0, 0.0], true), ([0.0, 0.2, 0.2, 0.2], false)] {
        let mut judge = judge(false);
        judge.on_offsets_confirmed(offsets_rad);
        judge.on_order(5 * MS, Wish::Angle(0, 0.3));
        let goal = 2048.0 + 0.5 * super::STEPS_PER_RAD;
        judge.look(6 * MS, true, [Joint { goal, ..REST }].into_iter());
        assert_eq!(broken(judge).is_empty(), is_asked, "{offsets_rad:?}");
    }
}

#[test]
fn a_clear_that_was_refused_has_not_left_the_safe_state() {
    let mut judge = judge(false);
    judge.on_latched(5 * MS);
    let before_ns = judge.latched_ns();
    judge.on_cleared();
    judge.on_order(6 * MS, Wish::Angle(0, 0.3));
    judge.on_clear_refused(before_ns);
    assert!(judge.is_latched());
    let goal = 2048.0 + 0.3 * super::STEPS_PER_RAD;
    judge.look(7 * MS, true, [Joint { goal, ..REST }].into_iter());
    assert_eq!(broken(judge), ["unasked-goal"]);
}

#[test]
fn a_servo_that_the_board_does_not_know_may_go_on_and_gets_no_other_goal() {
    let mut judge = judge(false);
    judge.on_order(4 * MS, Wish::Angle(0, 0.3));
    let mut joint = Joint { goal: 2048.0 + 0.3 * super::STEPS_PER_RAD, ..REST };
    for tick in 5..1_000 {
        joint.step += 0.05;
        judge.look(tick * MS, true, [joint].into_iter());
        judge.on_uncontrolled(tick * MS, true);
    }
    judge.look(1_001 * MS, true, [Joint { goal: 2600.0, ..joint }].into_iter());
    assert_eq!(broken(judge), ["unasked-goal"]);
}

#[test]
fn an_order_is_in_force_where_the_board_may_know_the_servo() {
    for (is_certain, ends) in [(true, true), (false, false)] {
        let mut judge = judge(false);
        judge.look(4 * MS, true, [REST].into_iter());
        judge.on_order(5 * MS, Wish::Angle(0, 0.3));
        judge.on_uncontrolled(6 * MS, is_certain);
        let goal = 2048.0 + 0.3 * super::STEPS_PER_RAD;
        judge.look(7 * MS, true, [Joint { goal, ..REST }].into_iter());
        assert_eq!(broken(judge).contains(&"unasked-goal"), ends, "{is_certain}");
    }
}
