//! A hold keeps the servo where it is, whatever is damaged or lost on the bus.

use std::rc::Rc;

use super::*;

/// A servo with torque on its way to step 3000, at this step.
fn under_way(at: u16) -> Fake {
    let fake = Fake::new();
    fake.registers.borrow_mut()[40] = 1;
    fake.registers.borrow_mut()[42..44].copy_from_slice(&3000u16.to_le_bytes());
    stand_at(&fake, at);
    fake
}

fn stand_at(fake: &Fake, at: u16) {
    fake.registers.borrow_mut()[56..58].copy_from_slice(&at.to_le_bytes());
}

fn goal_of(fake: &Fake) -> u16 {
    u16::from_le_bytes([fake.registers.borrow()[42], fake.registers.borrow()[43]])
}

/// Numbers from a seed: a linear congruence, of which the high bits are used.
struct Numbers(u32);

impl Numbers {
    fn next(&mut self, below: u32) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) % below
    }
}

/// Two bits turned over, where the answer is as long as that.
fn flip(bytes: &mut [u8], bits: (usize, usize)) {
    for bit in [bits.0, bits.1] {
        if let Some(byte) = bytes.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
    }
}

/// Pairs of bits whose damage a parser does not notice.
fn unnoticed(bytes: &[u8]) -> Vec<(usize, usize)> {
    let bits = 8 * bytes.len();
    let pairs = (0..bits).flat_map(|first| (first + 1..bits).map(move |second| (first, second)));
    let passes = |pair: &(usize, usize)| {
        let (mut parser, mut damaged) = (Parser::default(), bytes.to_vec());
        flip(&mut damaged, *pair);
        damaged.iter().any(|byte| parser.push(*byte).is_some())
    };
    pairs.filter(passes).collect()
}

/// Answers of a servo from the visit on in which a stop arrives.
type Answers = Rc<RefCell<Vec<Vec<u8>>>>;

/// What a stop did.
struct Stopped {
    /// Goals that the servo was sent, each with where it was then.
    goals: Vec<(u16, u16)>,
    /// The goal that it has at the end.
    goal: u16,
    answers: Vec<Vec<u8>>,
}

impl Stopped {
    /// Whether each goal is where the servo was, to this many steps and the one that it turns meanwhile, and the last one is in force.
    fn is_held(&self, within_steps: f32) -> bool {
        let is_there = |(goal, place): &(u16, u16)| f32::from(goal.abs_diff(*place)) <= 1.0 + within_steps;
        self.goals.iter().all(is_there) && self.goals.last().is_some_and(|(goal, _)| *goal == self.goal)
    }
}

/// A servo goes at 650 steps/s from `start`, and a stop arrives. Two bits are damaged in each answer from then on that `damage`
/// numbers.
fn stop(start: u16, load: u16, damage: &[(usize, (usize, usize))]) -> Stopped {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    stand_at(&fake, start);
    fake.registers.borrow_mut()[60..62].copy_from_slice(&load.to_le_bytes());
    let mut bus = Bus::new(&fake, &fake, &clock);
    let answers = Answers::default();
    let spoil = {
        let (answers, damage) = (Rc::clone(&answers), damage.to_vec());
        move |_: &Packet, bytes: &mut Vec<u8>| {
            let number = answers.borrow().len();
            answers.borrow_mut().push(bytes.clone());
            damage.iter().filter(|(at, _)| *at == number).for_each(|(_, bits)| flip(bytes, *bits));
        }
    };
    let advance = || {
        // From its goal on it stays there.
        if fake.spoil.borrow().is_none() || fake.goals.borrow().is_empty() {
            stand_at(&fake, start + (clock.0.get() * 650 / 1_000_000) as u16);
        }
    };
    let visits = async {
        shared.set_joints([joint(0.9), None, None, None]);
        for _ in 0..3 {
            bus.visit_all(&shared).await;
            advance();
        }
        shared.stop();
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        *fake.spoil.borrow_mut() = Some(Box::new(spoil));
        fake.goals.borrow_mut().clear();
        for _ in 0..8 {
            bus.visit_all(&shared).await;
            clock.0.set(clock.0.get() + CYCLE.0);
        }
    };
    run(visits, || {
        clock.0.set(clock.0.get() + 100);
        advance();
    });
    let (goals, answers) = (fake.goals.borrow().clone(), answers.borrow().clone());
    Stopped { goals, goal: goal_of(&fake), answers }
}

/// Every pair of bits that keeps the sum, in every answer of the first visits after a stop.
#[test]
fn no_two_damaged_bits_of_an_answer_send_a_stopped_servo_anywhere() {
    let mut numbers = Numbers(1);
    let mut n_damaged = 0;
    for _ in 0..3 {
        let (start, load) = (1500 + numbers.next(1000) as u16, numbers.next(500) as u16);
        let undamaged = stop(start, load, &[]);
        assert!(undamaged.is_held(0.0));
        // Position twice, goal; position, goal read back twice.
        assert!(undamaged.answers.len() >= 6);
        for (number, answer) in undamaged.answers.iter().enumerate().take(8) {
            for pair in unnoticed(answer) {
                n_damaged += 1;
                let stopped = stop(start, load, &[(number, pair)]);
                assert!(stopped.is_held(0.0), "{start}: answer {number}, bits {pair:?}: {:?}", stopped.goals);
            }
        }
    }
    assert!(n_damaged > 1000, "{n_damaged}");
}

/// Two answers in a row, each with a damage that its sum does not show.
#[test]
fn damaged_answers_that_do_not_agree_send_a_stopped_servo_nowhere() {
    let mut numbers = Numbers(2);
    for _ in 0..500 {
        let (start, load) = (1500 + numbers.next(1000) as u16, numbers.next(500) as u16);
        let answers = stop(start, load, &[]).answers;
        let first = numbers.next(answers.len() as u32 - 1) as usize;
        let mut draw = |number: usize| {
            let pairs = unnoticed(&answers[number]);
            (number, pairs[numbers.next(pairs.len() as u32) as usize])
        };
        let damage = [draw(first), draw(first + 1)];
        if damage[0].1 != damage[1].1 {
            let stopped = stop(start, load, &damage);
            assert!(stopped.is_held(place::NOISE_STEPS), "{start}: {damage:?}: {:?}", stopped.goals);
        }
    }
}

/// A visit comes 10 ms after the one before at the latest, and an answer half a millisecond after its request, which takes 0.1 ms,
/// as the answer does: four requests of four servos take 11.2 ms.
#[test]
fn each_of_four_servos_on_their_way_has_its_hold_after_four_requests() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    let all = |joint: Option<Joint>| {
        [1, 2, 3, 4].map(|id| joint.map(|joint| Joint { limit: ServoWiring { id, ..joint.limit }, ..joint }))
    };
    shared.set_joints(all(joint(0.5)));
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..3 {
            bus.visit_all(&shared).await;
        }
        shared.set_joints(all(doing(ServoAction::Hold)));
        fake.asked.borrow_mut().clear();
        fake.goals.borrow_mut().clear();
        bus.visit_all(&shared).await;
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!((fake.goals.borrow().len(), fake.asked.borrow().len()), (4, 16));
}

#[test]
fn a_goal_that_a_servo_has_not_taken_is_written_again_until_it_is_read_back() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    fake.untaken.set(3);
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    visit(&fake, &shared, &clock, 60);
    assert_eq!((goal_of(&fake), fake.writes.get()), (2500, 4));
}

/// A single answer says that the servo has the goal, as its damage would have it.
#[test]
fn one_damaged_answer_does_not_confirm_a_goal() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    fake.untaken.set(1);
    let wanted = goal_registers(2500, &joint(0.0).unwrap().limit);
    let mut is_damaged = false;
    let spoil = move |request: &Packet, bytes: &mut Vec<u8>| {
        let is_read_back = !is_damaged && request.code == 2 && request.parameters()[0] == TORQUE_ENABLE;
        // Those before the first goal have other registers.
        if is_read_back && GOALS.get() > 0 {
            is_damaged = true;
            *bytes = Packet::answer(1, 0, &wanted).encode().to_vec();
        }
    };
    *fake.spoil.borrow_mut() = Some(Box::new(spoil));
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..4 {
            bus.visit_all(&shared).await;
            GOALS.set(fake.goals.borrow().len());
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!((goal_of(&fake), fake.writes.get()), (2500, 2));
}

std::thread_local! {
    /// Goals that were sent in the test of this thread.
    static GOALS: Cell<usize> = const { Cell::new(0) };
}

/// The first one has gone wrong all the same: the servo is on its way elsewhere.
#[test]
fn a_second_stop_starts_the_hold_again() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..3 {
            bus.visit_all(&shared).await;
        }
        fake.registers.borrow_mut()[42..44].copy_from_slice(&900u16.to_le_bytes());
        stand_at(&fake, 2300);
        bus.visit_all(&shared).await;
        assert_eq!(goal_of(&fake), 900);
        shared.stop();
        bus.visit_all(&shared).await;
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!(goal_of(&fake), 2300);
}

/// Each time the load bends it a little further than its goal: a new one would creep.
#[test]
fn a_hold_does_not_creep_when_stops_are_repeated() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..20 {
            bus.visit_all(&shared).await;
            stand_at(&fake, goal_of(&fake) - BENT_STEPS);
            shared.stop();
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!(goal_of(&fake), 2500);
}

/// To turn back into the range would be a motion that nobody requested.
#[test]
fn a_servo_out_of_its_range_is_held_where_it_is() {
    let (low, high) = (steps(-1.0), steps(1.0));
    for at in [high + 100, low - 100] {
        let (fake, shared, clock) = (under_way(at), Shared::new(), HandClock::default());
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        visit(&fake, &shared, &clock, 3);
        assert_eq!(goal_of(&fake), at);
    }
    let limit = joint(0.0).unwrap().limit;
    assert_eq!(place_to_hold(high as i16 - 1, &limit), high as i16 - 1);
    assert_eq!(place_to_hold(high as i16 + 13, &limit), high as i16, "bent");
    assert_eq!(place_to_hold(high as i16 + 14, &limit), high as i16 + 14);
}

/// A start does not know the goal of before.
#[test]
fn a_load_that_bends_a_servo_over_the_edge_of_its_range_takes_it_no_further_with_each_start() {
    let high = steps(1.0);
    let fake = under_way(high + 5);
    for start in 0..10 {
        let (shared, clock) = (Shared::new(), HandClock::default());
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        visit(&fake, &shared, &clock, 3);
        assert_eq!(goal_of(&fake), high, "start {start}");
        stand_at(&fake, goal_of(&fake) + 5);
    }
}

#[test]
fn a_hold_is_no_faster_and_no_stronger_than_the_profile() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    visit(&fake, &shared, &clock, 1);
    let [s0, s1, t0, t1] = fake.registers.borrow()[46..50] else { unreachable!() };
    // 2 rad/s of 4096 steps a turn, half the torque.
    assert_eq!([[s0, s1], [t0, t1]].map(u16::from_le_bytes), [1303, 500]);
}

#[test]
fn a_release_that_a_servo_has_not_taken_is_written_again() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    fake.untaken.set(2);
    shared.set_joints([doing(ServoAction::Release), None, None, None]);
    visit(&fake, &shared, &clock, 5);
    assert_eq!((fake.registers.borrow()[40], fake.writes.get()), (0, 3));
}

/// As the answer to another request would be, that has come late.
#[test]
fn an_answer_of_another_length_or_another_servo_is_none() {
    for spoiled in [Packet::answer(1, 0, &[0, 8]), Packet::answer(2, 0, &[0, 8, 0, 0, 0, 0])] {
        let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
        let spoil = move |request: &Packet, bytes: &mut Vec<u8>| {
            if request.parameters()[0] == PRESENT {
                *bytes = spoiled.encode().to_vec();
            }
        };
        *fake.spoil.borrow_mut() = Some(Box::new(spoil));
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        assert_eq!(visit(&fake, &shared, &clock, 3).answered, None);
        assert_eq!(fake.writes.get(), 0);
    }
}

/// What the bus finds in visits each 10 ms, in which `advance` says where the servo is.
fn breaches(action: Option<Joint>, torque: u8, visits: u16, advance: impl Fn(u16) -> u16) -> Vec<Option<ServoBreach>> {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    fake.registers.borrow_mut()[40] = torque;
    shared.set_joints([action, None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let mut found = Vec::new();
    let visits = async {
        for visit in 0..visits {
            stand_at(&fake, advance(visit));
            bus.visit_all(&shared).await;
            found.push(shared.servo_breaches()[0]);
            clock.0.set(CYCLE.0 * (1 + u64::from(visit)));
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    found
}

/// A step in each visit, as something pushes it that is stronger than it is.
#[test]
fn a_servo_that_moves_in_hold_without_being_asked_is_found() {
    let hold = doing(ServoAction::Hold);
    let pushed = |visit: u16| 2000 + visit;
    assert!(breaches(hold, 1, 100, pushed).contains(&Some(ServoBreach::Moved)));
    assert_eq!(breaches(hold, 1, 60, pushed), [None; 60], "the load bends it");
    assert_eq!(breaches(hold, 0, 200, pushed), [None; 200], "without torque a hand moves it");
    assert_eq!(breaches(doing(ServoAction::Release), 1, 200, pushed), [None; 200]);
}

#[test]
fn a_servo_that_leaves_its_target_is_found() {
    let target = steps(0.5);
    let found = breaches(joint(0.5), 1, 300, |visit| target - 400 + 2 * visit.min(200));
    assert_eq!(found, [None; 300], "it goes there");
    let found = breaches(joint(0.5), 1, 300, |visit| target - 400 + 2 * visit.min(400 - visit));
    assert_eq!((found[230], found[299]), (None, Some(ServoBreach::Moved)));
}

#[test]
fn range_and_speed_are_watched_whatever_a_servo_is_to_do() {
    // The profile has 1303 steps/s, 13 in 10 ms.
    let actions = [joint(0.0), doing(ServoAction::Hold), doing(ServoAction::Release)];
    for (action, torque) in actions.into_iter().flat_map(|action| [(action, 0), (action, 1)]) {
        let outside = breaches(action, torque, 2, |_| steps(1.0) + 20);
        assert_eq!(outside, [None, Some(ServoBreach::Range)], "from the start on");
        let fast = breaches(action, torque, 12, |visit| 1500 + 30 * visit);
        assert_eq!(fast[..2], [None, Some(ServoBreach::Speed)], "{action:?}");
        assert_eq!(breaches(action, torque, 12, |visit| 1500 + 13 * visit)[11], None);
    }
}

/// Three that agree with each other have not outvoted the place before.
#[test]
fn damaged_answers_of_one_visit_are_no_breach() {
    let (fake, shared, clock) = (under_way(2000), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let mut found = Vec::new();
    let visits = async {
        for visit in 0..60 {
            let mut left = if visit == 40 { 3 } else { 0 };
            let spoil = move |request: &Packet, bytes: &mut Vec<u8>| {
                if request.code == 2 && request.parameters()[0] == PRESENT && left > 0 {
                    left -= 1;
                    let [p0, p1] = 2900u16.to_le_bytes();
                    *bytes = Packet::answer(1, 0, &[p0, p1, 0, 0, 0, 0]).encode().to_vec();
                }
            };
            *fake.spoil.borrow_mut() = Some(Box::new(spoil));
            bus.visit_all(&shared).await;
            found.push(shared.servo_breaches()[0]);
            clock.0.set(clock.0.get() + CYCLE.0);
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!(found, [None; 60]);
}

/// A limit of 0 comes of a hold that was damaged on its way, or of a servo whose supply failed for a moment.
#[test]
fn a_hold_without_strength_is_written_again() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    stand_at(&fake, 2048);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        shared.set_joints([joint(0.2), None, None, None]);
        for _ in 0..3 {
            bus.visit_all(&shared).await;
            clock.0.set(clock.0.get() + CYCLE.0);
        }
        shared.stop();
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        for visit in 0..300 {
            if visit == 8 {
                fake.registers.borrow_mut()[48..50].copy_from_slice(&0u16.to_le_bytes());
            }
            bus.visit_all(&shared).await;
            clock.0.set(clock.0.get() + CYCLE.0);
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    let torque = u16::from_le_bytes([fake.registers.borrow()[48], fake.registers.borrow()[49]]);
    assert_ne!(torque, 0);
}

/// While the flash is written nothing runs, and the servo could have gone to where two equally damaged answers show it.
#[test]
fn damaged_answers_after_a_pause_send_a_held_servo_nowhere() {
    let (fake, shared, clock) = (under_way(2002), Shared::new(), HandClock::default());
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        for _ in 0..3 {
            bus.visit_all(&shared).await;
        }
        clock.0.set(clock.0.get() + 200_000);
        let mut n_damaged = 0;
        let spoil = move |request: &Packet, bytes: &mut Vec<u8>| {
            if request.code == 2 && request.parameters()[0] == PRESENT && n_damaged < 2 {
                n_damaged += 1;
                // Bit 6 of the position's low byte is lost, that of the load's low byte gained.
                bytes[5] ^= 0x40;
                bytes[9] ^= 0x40;
            }
        };
        *fake.spoil.borrow_mut() = Some(Box::new(spoil));
        shared.stop();
        for _ in 0..3 {
            bus.visit_all(&shared).await;
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert!(fake.goals.borrow().iter().all(|(goal, _)| *goal == 2002), "{:?}", fake.goals.borrow());
}

/// A damaged release writes 128 to the torque's register, which makes the place where the servo stands its middle: its angles are
/// other ones from then on. Seen in one visit, and not again.
#[test]
fn a_jump_that_a_whole_vote_shows_is_a_breach_at_once() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    fake.registers.borrow_mut().copy_within(56..58, 42);
    shared.set_joints([doing(ServoAction::Release), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..5 {
            bus.visit_all(&shared).await;
            assert_eq!(shared.servo_breaches()[0], None);
        }
        stand_at(&fake, 2048);
        bus.visit_all(&shared).await;
        assert_eq!(shared.servo_breaches()[0], Some(ServoBreach::Speed));
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
}

/// A damaged hold took its torque: the arm sinks.
#[test]
fn a_servo_that_loses_its_torque_while_it_holds_and_sinks_has_moved() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..3 * u16::from(REWRITE_VISITS) {
            bus.visit_all(&shared).await;
        }
        fake.registers.borrow_mut()[40] = 0;
        let mut reported = 0;
        for sunk in 0..220 {
            stand_at(&fake, 2500 - sunk);
            bus.visit_all(&shared).await;
            reported += u32::from(shared.servo_breaches()[0] == Some(ServoBreach::Moved));
        }
        assert_eq!(
            (goal_of(&fake), fake.registers.borrow()[40], reported),
            (2500, 0, 1),
            "once: the safe state can be left"
        );
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
}

/// Its own memory allows less torque. It bends further each time that it is looked at, which must not become its goal.
#[test]
fn a_servo_that_does_not_take_what_it_is_told_counts_as_silent_and_does_not_creep() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let mut answered = Vec::new();
    let visits = async {
        for _ in 0..40 {
            bus.visit_all(&shared).await;
            fake.registers.borrow_mut()[48..50].copy_from_slice(&300u16.to_le_bytes());
            stand_at(&fake, goal_of(&fake) - 10);
            answered.push(shared.servo_seen(0).answered);
            clock.0.set(clock.0.get() + CYCLE.0);
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!(goal_of(&fake), 2500);
    let tries = usize::from(MAX_TRIES);
    assert!(answered[..tries].is_sorted_by(|before, after| before < after), "{answered:?}");
    assert!(answered[tries..].iter().all(|at| *at == answered[tries]), "{answered:?}");
}

/// Its supply was switched off, and a hand moved it.
#[test]
fn a_servo_that_comes_back_without_torque_may_have_been_moved() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..100 {
            bus.visit_all(&shared).await;
        }
        fake.mute.set(true);
        for _ in 0..2 {
            bus.visit_all(&shared).await;
        }
        fake.mute.set(false);
        fake.out.borrow_mut().clear();
        fake.registers.borrow_mut()[40] = 0;
        stand_at(&fake, 2200);
        for _ in 0..100 {
            bus.visit_all(&shared).await;
            assert_eq!(shared.servo_breaches()[0], None);
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
}

/// One that was on its way: its first hold does not ask for its registers.
#[test]
fn a_stop_in_each_visit_lets_no_loaded_servo_creep() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([joint(0.5), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..3 {
            bus.visit_all(&shared).await;
        }
        let reached = goal_of(&fake);
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        for _ in 0..100 {
            bus.visit_all(&shared).await;
            stand_at(&fake, goal_of(&fake) - 5);
            shared.stop();
        }
        assert_eq!(goal_of(&fake), reached);
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
}

#[test]
fn no_start_lets_a_loaded_servo_sink() {
    let fake = under_way(2500);
    fake.registers.borrow_mut().copy_within(56..58, 42);
    for start in 0..20 {
        let (shared, clock) = (Shared::new(), HandClock::default());
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        visit(&fake, &shared, &clock, 3);
        assert_eq!(goal_of(&fake), 2500, "start {start}");
        stand_at(&fake, 2495);
    }
}

/// A start waits for that order before it writes the flash.
#[test]
fn a_servo_that_is_to_hold_has_not_answered_before_it_has_the_order() {
    let (fake, clock) = (under_way(2500), HandClock::default());
    let shared: &'static Shared = Box::leak(Box::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let spoil = |request: &Packet, _: &mut Vec<u8>| {
        if request.code == 3 {
            assert_eq!(shared.servo_seen(0).answered, None);
        }
    };
    *fake.spoil.borrow_mut() = Some(Box::new(spoil));
    assert!(visit(&fake, shared, &clock, 1).answered.is_some());
}

/// Something with more strength than it bears it down, two steps in each visit. Anybody with the port can repeat a stop.
#[test]
fn a_servo_that_sinks_is_found_however_often_it_is_stopped() {
    for every in [usize::MAX, 25, 10, 1] {
        let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
        fake.registers.borrow_mut().copy_within(56..58, 42);
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        let mut bus = Bus::new(&fake, &fake, &clock);
        let (mut at, mut found) = (2500, false);
        let visits = async {
            for visit in 0..150 {
                at -= if visit > 60 { 2 } else { 0 };
                stand_at(&fake, at);
                if visit % every == 5 {
                    shared.stop();
                }
                bus.visit_all(&shared).await;
                found |= shared.servo_breaches()[0] == Some(ServoBreach::Moved);
                assert!(found || at > 2500 - STRAY_STEPS - 8, "a stop each {every} visits, at {at}");
                clock.0.set(clock.0.get() + CYCLE.0);
            }
        };
        run(visits, || clock.0.set(clock.0.get() + 100));
        assert!(found, "a stop each {every} visits");
    }
}

#[test]
fn a_servo_that_leaves_its_hold_in_jerks_is_found() {
    let (fake, shared, clock) = (under_way(2500), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let mut found = Vec::new();
    let visits = async {
        for visit in 0..100_u16 {
            let jerks = visit.saturating_sub(60).div_ceil(2);
            stand_at(&fake, 2500 - 18 * jerks);
            let speed: u16 = if jerks > 0 && visit % 2 == 1 { 1800 | POSITION_SIGN } else { 0 };
            fake.registers.borrow_mut()[58..60].copy_from_slice(&speed.to_le_bytes());
            bus.visit_all(&shared).await;
            found.extend(shared.servo_breaches()[0].map(|breach| (visit, breach)));
            clock.0.set(clock.0.get() + CYCLE.0);
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert!(found.first().is_some_and(|(visit, _)| *visit < 72), "{found:?}");
}

/// A joint of 0.1 rad/s is moved by hand. In a single visit the noise of two places is worth 1.2 rad/s.
#[test]
fn the_mean_speed_of_a_slow_servo_is_watched() {
    // Steps in 20 visits: 16 at 1.25 times the limit, and twice the noise of a place, 16.
    for (steps_in_20, is_fast) in [(10, false), (30, false), (36, true), (160, true)] {
        let slow = doing(ServoAction::Release).map(|joint| {
            let limit = ServoWiring { max_speed_rad_s: 0.1, ..joint.limit };
            Joint { limit, ..joint }
        });
        let found = breaches(slow, 0, 60, |visit| 1900 + visit * steps_in_20 / 20);
        assert_eq!(found.contains(&Some(ServoBreach::Speed)), is_fast, "{steps_in_20} steps in 0.2 s");
    }
}

/// Rows 10 ms apart. What is written in each visit is read back in none of the next.
#[test]
fn a_servo_that_takes_another_order_in_each_visit_is_not_silent() {
    for stops in [false, true] {
        let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
        let mut bus = Bus::new(&fake, &fake, &clock);
        let visits = async {
            for visit in 0..60_u16 {
                let order = if stops { doing(ServoAction::Hold) } else { joint(0.002 * f32::from(visit)) };
                fake.registers.borrow_mut()[40] = 1;
                shared.set_joints([order, None, None, None]);
                shared.stop();
                let began = clock.0.get();
                bus.visit_all(&shared).await;
                let answered = shared.servo_seen(0).answered.map(|answered| answered.0);
                assert!(visit == 0 || answered >= Some(began), "visit {visit}: {answered:?}");
                clock.0.set(clock.0.get() + CYCLE.0);
            }
        };
        run(visits, || clock.0.set(clock.0.get() + 100));
    }
}

/// Damage of a request can change any of its registers: torque, goal, speed and torque limit are compared.
#[test]
fn a_target_that_a_servo_has_not_taken_entirely_is_written_again() {
    for (register, value) in [(40, 0), (42, 17), (46, 1), (48, 17)] {
        let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
        shared.set_joints([joint(0.5), None, None, None]);
        let mut bus = Bus::new(&fake, &fake, &clock);
        let visits = async {
            bus.visit_all(&shared).await;
            let wanted = fake.registers.borrow()[40..50].to_vec();
            fake.registers.borrow_mut()[register] = value;
            bus.visit_all(&shared).await;
            // A lower speed is not faster than the target's.
            let is_kept = register == 46;
            assert_eq!(fake.registers.borrow()[40..50] == wanted, !is_kept, "register {register}");
        };
        run(visits, || clock.0.set(clock.0.get() + 100));
    }
}

/// What the bus finds in visits each 10 ms; in those for which `is_mute` the servo does not answer.
fn breaches_in_visits(
    action: Option<Joint>,
    visits: u16,
    is_mute: impl Fn(u16) -> bool,
    advance: impl Fn(u16, &Fake) -> u16,
) -> Vec<Option<ServoBreach>> {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    fake.registers.borrow_mut()[40] = 1;
    shared.set_joints([action, None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let mut found = Vec::new();
    let visits = async {
        for visit in 0..visits {
            let at = advance(visit, &fake);
            stand_at(&fake, at);
            fake.mute.set(is_mute(visit));
            bus.visit_all(&shared).await;
            found.push(shared.servo_breaches()[0]);
            clock.0.set(clock.0.get() + CYCLE.0);
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    found
}

/// On a worn cable each second visit has no answer: no time-out is reached.
#[test]
fn a_servo_that_answers_each_second_visit_is_watched_too() {
    let hold = doing(ServoAction::Hold);
    let every_second = |visit: u16| visit % 2 == 1;
    let outside = breaches_in_visits(hold, 400, every_second, |_, _| steps(1.0) + 200);
    let pushed = breaches_in_visits(hold, 400, every_second, |visit, _| 2000 + visit.saturating_sub(60).min(300));
    let found = [outside, pushed].map(|found| found.into_iter().flatten().next());
    assert!(found.iter().all(Option::is_some), "out of range, pushed by 0.46 rad: {found:?}");
}

#[test]
fn a_servo_that_loses_its_torque_and_one_answer_and_sinks_has_moved() {
    let sink = |lost: u16| {
        breaches_in_visits(
            doing(ServoAction::Hold),
            400,
            move |visit| visit == lost,
            |visit, fake| {
                if visit == 60 {
                    fake.registers.borrow_mut()[40] = 0;
                }
                2000 - visit.saturating_sub(70).min(300)
            },
        )
    };
    assert!(sink(1_000).contains(&Some(ServoBreach::Moved)), "without a lost answer");
    assert!(sink(65).contains(&Some(ServoBreach::Moved)), "the answer of one visit was lost");
}

/// On its way at 0.15 rad/s, away from targets that change all the time.
#[test]
fn a_servo_that_goes_the_other_way_while_its_targets_change_is_found() {
    for visits_each in [1, 20, 28, 40] {
        let (fake, shared, clock) = (under_way(2048), Shared::new(), HandClock::default());
        let mut bus = Bus::new(&fake, &fake, &clock);
        let mut found_at = None;
        let visits = async {
            for visit in 0..300u16 {
                shared.set_joints([joint(0.001 * f32::from(visit / visits_each)), None, None, None]);
                bus.visit_all(&shared).await;
                stand_at(&fake, 2048 - visit);
                found_at = found_at.or(shared.servo_breaches()[0].map(|breach| (visit, breach)));
                clock.0.set((u64::from(visit) + 1) * 10_000);
            }
        };
        run(visits, || clock.0.set(clock.0.get() + 100));
        // 0.1 rad, as much again before its first target, and two visits.
        let is_found = |(steps, breach)| (65..140).contains(&steps) && breach == ServoBreach::Moved;
        assert!(found_at.is_some_and(is_found), "{visits_each}: {found_at:?}");
    }
}

/// It turns round at 1.3 rad/s, in 0.2 s, with each target; they come faster than it can follow.
#[test]
fn a_servo_that_brakes_and_turns_round_is_not_found() {
    let (fake, shared, clock) = (under_way(2048), Shared::new(), HandClock::default());
    let mut bus = Bus::new(&fake, &fake, &clock);
    let (mut at, mut speed) = (2048.0f32, 0.0f32);
    let visits = async {
        for visit in 0..2_000u32 {
            let is_right = visit / 25 % 2 == 0;
            shared.set_joints([joint(if is_right { 0.4 } else { -0.4 }), None, None, None]);
            speed = (speed + if is_right { 85.0 } else { -85.0 }).clamp(-850.0, 850.0);
            at += 0.01 * speed;
            stand_at(&fake, at as u16);
            let report = speed.abs() as u16 | if speed < 0.0 { 1 << 15 } else { 0 };
            fake.registers.borrow_mut()[58..60].copy_from_slice(&report.to_le_bytes());
            bus.visit_all(&shared).await;
            assert_eq!(shared.servo_breaches()[0], None, "visit {visit}, at {at}");
            clock.0.set((u64::from(visit) + 1) * 10_000);
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
}

/// Of three answers two are lost; it stays below its time-out.
#[test]
fn a_servo_that_answers_each_third_visit_is_found_out_of_its_range() {
    let is_mute = |visit: u16| visit > 60 && !visit.is_multiple_of(3);
    for action in [doing(ServoAction::Hold), doing(ServoAction::Release)] {
        let found = breaches_in_visits(action, 180, is_mute, |visit, _| 2048 + 20 * visit.saturating_sub(60).min(80));
        assert!(found.contains(&Some(ServoBreach::Range)), "{action:?}: {found:?}");
    }
}
