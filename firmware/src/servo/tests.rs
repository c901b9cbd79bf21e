//! A servo in memory answers the bus.
use core::cell::{Cell, RefCell};
use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;
use std::collections::VecDeque;

use embedded_io_async::ErrorType;

use super::place::angle_rad;
use super::*;
use crate::tests::fakes::{HandClock, run};

mod hold;

/// Changes the answer to a request.
type Spoil = Box<dyn FnMut(&Packet, &mut Vec<u8>)>;

/// Registers of one servo, which answers to every address, and what it does with the bytes it gets.
struct Fake {
    /// Addresses of the requests.
    asked: RefCell<Vec<u8>>,
    registers: RefCell<[u8; 80]>,
    out: RefCell<VecDeque<u8>>,
    mute: Cell<bool>,
    mute_to_writes: Cell<bool>,
    error: Cell<u8>,
    writes: Cell<u32>,
    /// Polls for which a read waits although an answer is there.
    unread: Cell<u32>,
    /// The next answer with a position has two bits damaged, and the sum that it had.
    damage: Cell<bool>,
    spoil: RefCell<Option<Spoil>>,
    /// Writes that it answers and does not take.
    untaken: Cell<u32>,
    /// Goals that it was sent, each with where it was then.
    goals: RefCell<Vec<(u16, u16)>>,
}

impl Fake {
    fn new() -> Self {
        Self {
            asked: RefCell::default(),
            registers: RefCell::new([0; 80]),
            out: RefCell::default(),
            mute: Cell::new(false),
            mute_to_writes: Cell::new(false),
            error: Cell::new(0),
            writes: Cell::new(0),
            unread: Cell::new(0),
            damage: Cell::new(false),
            spoil: RefCell::default(),
            untaken: Cell::new(0),
            goals: RefCell::default(),
        }
    }

    fn take(&self, request: &Packet) {
        let [first, values @ ..] = request.parameters() else { return };
        let first = usize::from(*first);
        self.asked.borrow_mut().push(request.id);
        let mut registers = self.registers.borrow_mut();
        let mut answer = Packet::answer(request.id, self.error.get(), &[]);
        if request.code == 3 {
            self.writes.set(self.writes.get() + 1);
            let before = *registers;
            registers[first..first + values.len()].copy_from_slice(values);
            if (first..first + values.len()).contains(&42) {
                let [goal, present] = [42, 56].map(|at| u16::from_le_bytes([registers[at], registers[at + 1]]));
                self.goals.borrow_mut().push((goal, present));
            }
            if self.untaken.get() > 0 {
                self.untaken.set(self.untaken.get() - 1);
                *registers = before;
            } else {
                registers.copy_within(42..44, 56);
            }
        } else {
            answer = Packet::answer(request.id, self.error.get(), &registers[first..first + usize::from(values[0])]);
        }
        let is_mute = self.mute.get() || self.mute_to_writes.get() && request.code == 3;
        if !is_mute {
            let mut bytes = answer.encode();
            if request.code == 2 && first == 56 && self.damage.replace(false) {
                // Bit 6 of the position's high byte is gained, bit 6 of the load's low byte lost: the sum stays.
                bytes[6] ^= 0x40;
                bytes[9] ^= 0x40;
            }
            let mut bytes = bytes.to_vec();
            if let Some(spoil) = self.spoil.borrow_mut().as_mut() {
                spoil(request, &mut bytes);
            }
            self.out.borrow_mut().extend(bytes);
        }
    }
}

impl ErrorType for &Fake {
    type Error = Infallible;
}

impl Read for &Fake {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|_| {
            if self.unread.get() > 0 {
                self.unread.set(self.unread.get() - 1);
                return Poll::Pending;
            }
            let mut out = self.out.borrow_mut();
            let n = out.len().min(bytes.len()).min(5);
            bytes.iter_mut().zip(out.drain(..n)).for_each(|(to, from)| *to = from);
            if n > 0 { Poll::Ready(Ok(n)) } else { Poll::Pending }
        })
        .await
    }
}

impl Write for &Fake {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let mut parser = Parser::default();
        bytes.iter().filter_map(|byte| parser.push(*byte)).for_each(|packet| self.take(&packet));
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

fn doing(action: ServoAction) -> Option<Joint> {
    let (max_speed_rad_s, max_torque, timeout_ms) = (2.0, 0.5, 100);
    let limit = ServoWiring { id: 1, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s, max_torque, timeout_ms };
    Some(Joint { limit, action })
}

fn joint(angle_rad: f32) -> Option<Joint> {
    doing(ServoAction::Go(ServoTarget { angle_rad, speed_rad_s: 1.0, torque: 0.5 }))
}

/// Visits the joints so often and returns what was seen of the first.
fn visit(fake: &Fake, shared: &Shared, clock: &HandClock, times: u32) -> ServoSeen {
    let mut bus = Bus::new(fake, fake, clock);
    let visits = async {
        for _ in 0..times {
            bus.visit_all(shared).await;
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    shared.servo_seen(0)
}

#[test]
fn a_target_becomes_a_position_and_comes_back() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([joint(0.6), None, None, None]);
    let seen = visit(&fake, &shared, &clock, 2);
    let registers = *fake.registers.borrow();
    // 0.6 rad of 4096 steps a turn is 391.1 steps; 1 rad/s is 651.9 steps/s; half the torque is 500.
    assert_eq!(registers[40..50], [1, 0, 0x87, 0x09, 0, 0, 0x8b, 0x02, 0xf4, 0x01]);
    assert!((seen.angle_rad - 0.6).abs() < TAU / SERVO_STEPS_PER_TURN);
    assert_eq!(seen.answered, Some(Micros(0)));
}

#[test]
fn no_target_exceeds_the_profile() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    let target = ServoTarget { angle_rad: 3.0, speed_rad_s: 9.0, torque: 1.0 };
    shared.set_joints([doing(ServoAction::Go(target)), None, None, None]);
    visit(&fake, &shared, &clock, 1);
    let [p0, p1, _, _, s0, s1, t0, t1] = fake.registers.borrow()[42..50] else { unreachable!() };
    let [position, speed, torque] = [[p0, p1], [s0, s1], [t0, t1]].map(u16::from_le_bytes);
    assert_eq!((position, speed, torque), (steps(1.0), 1303, 500));
}

#[test]
fn a_held_servo_stays_where_it_is() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    // It drives to step 3000 and is at 2500; the reset of the board has left its torque on.
    fake.registers.borrow_mut()[40] = 1;
    fake.registers.borrow_mut()[42..44].copy_from_slice(&3000u16.to_le_bytes());
    fake.registers.borrow_mut()[56..58].copy_from_slice(&2500u16.to_le_bytes());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    visit(&fake, &shared, &clock, 200);
    assert_eq!((fake.registers.borrow()[40], fake.writes.get()), (1, 1));
    assert_eq!(fake.registers.borrow()[42..44], 2500u16.to_le_bytes());
}

#[test]
fn a_servo_without_torque_gets_none_by_holding() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    visit(&fake, &shared, &clock, 3);
    assert_eq!((fake.registers.borrow()[40], fake.writes.get()), (0, 0));
}

#[test]
fn a_target_is_written_again_when_the_servo_has_lost_its_registers() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([joint(0.5), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for lost in [false, true] {
            if lost {
                fake.registers.borrow_mut()[40..50].fill(0);
            }
            for _ in 0..2 * (2 + u32::from(REWRITE_VISITS)) {
                bus.visit_all(&shared).await;
            }
            assert_eq!((fake.writes.get(), fake.registers.borrow()[40]), (1 + u32::from(lost), 1));
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
}

/// Its answer says that all is well, as it does where damage on the way has kept the sum of the request.
#[test]
fn a_target_that_a_servo_has_not_taken_is_written_again_in_the_next_visit() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    fake.untaken.set(2);
    shared.set_joints([joint(0.5), None, None, None]);
    visit(&fake, &shared, &clock, 4);
    assert_eq!((fake.registers.borrow()[42..44].to_vec(), fake.writes.get()), (steps(0.5).to_le_bytes().to_vec(), 3));
}

/// One that does not answer takes the bus 22 ms, in which the next one would move on. Lost answers make no difference: it may go
/// all the same.
#[test]
fn a_servo_on_its_way_is_held_before_the_others_are_visited() {
    let with_id =
        |joint: Option<Joint>, id| joint.map(|joint| Joint { limit: ServoWiring { id, ..joint.limit }, ..joint });
    let hold = doing(ServoAction::Hold);
    for (is_write_lost, is_read_lost) in [(false, false), (true, false), (false, true)] {
        let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
        shared.set_joints([with_id(hold, 1), with_id(hold, 2), with_id(joint(0.5), 3), None]);
        let mut bus = Bus::new(&fake, &fake, &clock);
        let visits = async {
            fake.mute_to_writes.set(is_write_lost);
            bus.visit_all(&shared).await;
            fake.mute_to_writes.set(false);
            fake.mute.set(is_read_lost);
            bus.visit_all(&shared).await;
            fake.mute.set(false);
            shared.set_joints([with_id(hold, 1), with_id(hold, 2), with_id(hold, 3), None]);
            fake.asked.borrow_mut().clear();
            bus.visit_all(&shared).await;
        };
        run(visits, || clock.0.set(clock.0.get() + 100));
        fake.asked.borrow_mut().dedup();
        assert_eq!(fake.asked.borrow()[..], [3, 1, 2], "lost: write {is_write_lost}, read {is_read_lost}");
    }
}

/// It holds already, though the answer to that was lost.
#[test]
fn the_same_target_is_written_again_after_a_hold_whose_answer_was_lost() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for (action, is_lost) in [(joint(0.5), false), (doing(ServoAction::Hold), true), (joint(0.5), false)] {
            shared.set_joints([action, None, None, None]);
            // Not yet where it is to go.
            fake.registers.borrow_mut()[56..58].copy_from_slice(&2100u16.to_le_bytes());
            fake.mute_to_writes.set(is_lost);
            bus.visit_all(&shared).await;
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!(fake.registers.borrow()[42..44], steps(0.5).to_le_bytes());
}

/// The position is read before the target is written.
#[test]
fn no_servo_is_sent_to_a_target_after_a_stop_in_the_same_visit() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([joint(0.5), None, None, None]);
    fake.unread.set(1);
    let mut bus = Bus::new(&fake, &fake, &clock);
    run(bus.visit_all(&shared), || {
        clock.0.set(clock.0.get() + 100);
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    });
    assert_eq!((fake.asked.borrow().is_empty(), fake.writes.get()), (false, 0));
}

#[test]
fn a_released_servo_has_no_torque() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    fake.registers.borrow_mut()[40] = 1;
    shared.set_joints([doing(ServoAction::Release), None, None, None]);
    visit(&fake, &shared, &clock, 1);
    assert_eq!(fake.registers.borrow()[40], 0);
}

/// It is driven from then on: its silence has to count.
#[test]
fn a_servo_that_falls_silent_in_its_first_visit_was_seen() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    fake.mute_to_writes.set(true);
    shared.set_joints([joint(0.5), None, None, None]);
    assert!(visit(&fake, &shared, &clock, 1).answered.is_some());
    assert_eq!(fake.registers.borrow()[40], 1);
}

#[test]
fn a_silent_servo_keeps_its_old_answer() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([joint(0.5), None, None, None]);
    let before = visit(&fake, &shared, &clock, 1);
    fake.mute.set(true);
    assert_eq!(visit(&fake, &shared, &clock, 3), before);
    assert!(clock.now() >= Micros(3 * ANSWER_TIMEOUT.0));
}

/// As while a flash is erased: silence is counted from the request on.
#[test]
fn an_answer_that_is_read_late_is_as_old_as_its_request() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([joint(0.0), None, None, None]);
    fake.registers.borrow_mut()[56..58].copy_from_slice(&steps(0.0).to_le_bytes());
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        bus.visit_all(&shared).await;
        clock.0.set(10_000);
        fake.unread.set(5);
        bus.visit_all(&shared).await;
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!(shared.servo_seen(0).answered, Some(Micros(10_000)));
    assert!(clock.now() >= Micros(10_500));
}

#[test]
fn error_bits_and_load_are_told() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    fake.error.set(0x20);
    fake.registers.borrow_mut()[60..62].copy_from_slice(&(LOAD_SIGN | 250).to_le_bytes());
    shared.set_joints([joint(0.0), None, None, None]);
    let seen = visit(&fake, &shared, &clock, 1);
    assert_eq!((seen.error, seen.load), (0x20, 0.25));
}

#[test]
fn positions_and_angles_are_inverse() {
    for register in 0..4096 {
        assert_eq!(steps(angle_rad(register)), register);
    }
    assert_eq!((steps(-4.0), steps(4.0)), (0, 4095));
    assert!((angle_rad(POSITION_SIGN | 10) - angle_rad(0) + 10.0 * TAU / SERVO_STEPS_PER_TURN).abs() < 1e-5);
}

#[test]
fn a_servo_that_has_turned_further_than_once_holds_where_it_is() {
    for register in [5000, POSITION_SIGN | 300] {
        let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
        fake.registers.borrow_mut()[40] = 1;
        fake.registers.borrow_mut()[56..58].copy_from_slice(&register.to_le_bytes());
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        visit(&fake, &shared, &clock, 1);
        assert_eq!(fake.registers.borrow()[42..44], register.to_le_bytes());
    }
}

/// The load bends a servo that holds a little below its goal: where it stands after a lost answer is no new goal.
#[test]
fn a_servo_that_holds_stays_where_it_was_when_answers_are_lost() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    let goal = || u16::from_le_bytes([fake.registers.borrow()[42], fake.registers.borrow()[43]]);
    let stand_at = |steps: u16| fake.registers.borrow_mut()[56..58].copy_from_slice(&steps.to_le_bytes());
    fake.registers.borrow_mut()[40] = 1;
    fake.registers.borrow_mut()[42..44].copy_from_slice(&2500u16.to_le_bytes());
    stand_at(2500);
    shared.set_joints([doing(ServoAction::Hold), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        for _ in 0..20 {
            bus.visit_all(&shared).await;
            stand_at(goal() - 4);
            fake.mute.set(true);
            bus.visit_all(&shared).await;
            fake.mute.set(false);
            fake.out.borrow_mut().clear();
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    assert_eq!(goal(), 2500);
}

/// The sum of a packet is eight bits: two bits of one place that turn over in opposite directions leave it as it is. One such
/// answer, in the visit in which a stop arrives, must not send the servo anywhere.
#[test]
fn one_damaged_position_does_not_become_the_goal_of_a_stop() {
    let (fake, shared, clock) = (Fake::new(), Shared::new(), HandClock::default());
    shared.set_joints([joint(0.6), None, None, None]);
    let mut bus = Bus::new(&fake, &fake, &clock);
    let visits = async {
        bus.visit_all(&shared).await;
        fake.registers.borrow_mut()[60] = 0x40;
        bus.visit_all(&shared).await;
        shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        fake.damage.set(true);
        for _ in 0..5 {
            bus.visit_all(&shared).await;
        }
    };
    run(visits, || clock.0.set(clock.0.get() + 100));
    let [p0, p1] = fake.registers.borrow()[42..44] else { unreachable!() };
    let goal = u16::from_le_bytes([p0, p1]);
    assert!((steps(-1.0)..=steps(1.0)).contains(&goal), "the stop sent the servo to step {goal}");
}

/// The target was written before, and is being read back when the stop comes; damage has kept the servo from it.
#[test]
fn no_servo_is_sent_to_a_target_after_a_stop_while_it_is_read_back() {
    let (fake, clock) = (Fake::new(), HandClock::default());
    let shared: &'static Shared = Box::leak(Box::default());
    fake.untaken.set(1);
    shared.set_joints([joint(0.5), None, None, None]);
    let stop = |request: &Packet, _: &mut Vec<u8>| {
        if request.code == 2 && request.parameters()[0] == TORQUE_ENABLE {
            shared.set_joints([doing(ServoAction::Hold), None, None, None]);
        }
    };
    *fake.spoil.borrow_mut() = Some(Box::new(stop));
    visit(&fake, shared, &clock, 2);
    assert_eq!(fake.writes.get(), 1);
}
