//! Judge 1, the servos: what their shafts do. It sees the mechanism, never the bus: where each shaft is, which goal and which
//! torque limit are in force, how often a servo has answered.
//!
//! A motion is explained by an order: somebody requested an angle, or for a table with that angle, on a connection that no stop
//! has ended, and neither a stop, a latched fault nor a start has come since. All else is rest: the shaft stays where it came to
//! rest, whatever goal is written to hold it.

use darm_core::output::MAX_SERVOS;

use super::{Ceilings, ServoCeiling, Verdict};

const JUDGE: &str = "pins";
const MS: u64 = 1_000_000;
/// The bend of a servo under load, steps; the simulated ones have at most this.
pub const MAX_BEND_STEPS: f32 = 5.0;
/// A shaft that is held stays within this many steps (1.4°) of where it came to rest: holding takes the present position for
/// the goal, which bends it again (5), at rest under the bend of before (5), plus rounding (2) and, at the largest speed of a
/// script (3 rad/s), what it turns in 2 ms from the answer to the order (4).
const HOLD_STEPS: f32 = 16.0;
/// A start keeps the goal of a servo that is within 16 steps of it, where its load may have bent it (docs/safety.md). One that was on its way
/// there, too slowly to be seen, arrives, one bend (5) and the rounding of its place (1) beyond what is held otherwise.
const KEPT_STEPS: f32 = MAX_BEND_STEPS + 1.0;
/// Answers that are damaged in a row, and that each can be, may take the place to hold this much farther away, steps: docs/safety.md.
const DAMAGED_STEPS: f32 = 8.0;
/// A position that a servo turning at speed has reported is this old when it becomes the goal, ms: two visits and their answers.
const READ_AGE_MS: u64 = 25;
/// A shaft may be beyond its range by its bend, which takes it from a goal at the edge, and by the rounding of that goal, 1 step. A hold
/// has no goal beyond the edge: not that of a place that is bent over it (5 steps), nor that of such a place with what a damaged
/// answer may add to it (8 steps), for both together are within what the board takes for the edge (13 steps).
const RANGE_STEPS: f32 = MAX_BEND_STEPS + 1.0;
/// A goal is the requested one when it is this near, steps.
const GOAL_STEPS: f32 = 2.0;
/// A servo is on its way beyond this distance from its goal, steps: 0.1 rad, more than any that holds gives way.
const UNDER_WAY_STEPS: f32 = 65.0;
/// In one tick a shaft that rests turns less than this, steps.
const REST_STEPS: f32 = 0.01;
/// After an order has ended the shaft rests within this time, ms: docs/safety.md, with three silent servos on the bus.
const HOLD_MS: u64 = 100;
/// After a start this time is so much longer, ms: the profile is read first, which takes up to 30 ms. Nothing is written before the servos
/// have their orders.
const START_MS: u64 = 250;
/// A silent servo is noticed within this time after its time-out, in board time: two ticks.
const NOTICE_MS: u64 = 3;
/// After this time without an answer of a servo on its way the flash is written all the same, ms: docs/safety.md.
const WRITE_ANYWAY_MS: u64 = 250;
/// A servo that turns and reports an overload rests within this time, ms: a visit, a tick and the order to hold.
const OVERLOAD_MS: u64 = 150;
/// What a damaged request has put into a servo is read back in the next round of visits, which begins this long after the one before, in
/// board time. The limits of the servo do not hold until it is written again: it is unknown to the board.
const ROUND_MS: u64 = 10;
/// That visit may find the servo where it cannot be: a vote of seven reads, and two of its registers. The stop that follows keeps it from
/// writing the target again.
const VOTE_MS: u64 = 10;
/// Then each servo is held, this one last: up to six reads and a write of each.
const HOLD_VISIT_MS: u64 = 6;
/// The ceiling of a torque is rounded up, what is written to a servo down, thousandths.
const TORQUE_SLACK: u16 = 1;
/// Farther from its goal than this, 0.1 rad (docs/safety.md) and the noise of two places, a servo has left what it holds, steps; for this time,
/// two visits and the vote of each, ms.
const STRAY_STEPS: f32 = 65.0 + 16.0;
const STRAY_MS: u64 = 60;
/// A shaft turns too fast beyond this share of its speed (docs/safety.md), and what the noise of two places (8 steps) and the time of an
/// answer make of a visit, steps/s.
const FAST_SHARE: f32 = 1.5;
const FAST_STEPS_S: f32 = 1_000.0;
/// A shaft without torque is out of its range beyond this, steps: what the board takes for the edge (13) and the rounding of its place.
const OUT_STEPS: f32 = 14.0;
/// Steps of one radian.
const STEPS_PER_RAD: f32 = 4096.0 / std::f32::consts::TAU;

/// What one servo does in this moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Address.
    pub id: u8,
    /// Where its shaft is, steps of 4096 a turn, 2048 in the middle.
    pub step: f32,
    /// It has torque.
    pub has_torque: bool,
    /// The goal in force, steps.
    pub goal: f32,
    /// The torque limit in force, thousandths.
    pub torque_limit: u16,
    /// Answers that it has given.
    pub answers: u32,
    /// It cannot turn.
    pub is_blocked: bool,
    /// It reports an overload, or a load above the torque that the profile allows it.
    pub is_overloaded: bool,
    /// Its answers and orders arrive as they were sent.
    pub is_heard: bool,
    /// None of its answers arrives, and what it hears is what was sent.
    pub is_silent: bool,
    /// Damaged requests that it has obeyed.
    pub misled: u32,
    /// Nothing else delays the visits of the bus.
    pub is_bus_clear: bool,
    /// Something with more strength than it moves its shaft, or has done so just now.
    pub is_pushed: bool,
}

impl Joint {
    /// Its answers or orders may arrive as something else. One that answers nothing stays where it is.
    fn is_garbled(&self) -> bool {
        !(self.is_heard || self.is_silent)
    }
}

/// What somebody wants of the servos.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// One servo, by its index, to a joint angle, rad.
    Angle(u8, f32),
    /// All servos to the angles of whatever table is loaded.
    Table,
}

/// An order that arrived.
#[derive(Clone, Copy, Debug)]
struct Order {
    at_ns: u64,
    wish: Wish,
}

/// Why a shaft is where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// An order in force explains its goal.
    Ordered,
    /// None does any more, since then; it comes to rest.
    Stopping(u64),
    /// It rests there.
    Resting(f32),
}

/// The memory of one servo.
#[derive(Clone, Copy, Debug)]
struct Track {
    last: Joint,
    motion: Motion,
    answered_ns: Option<u64>,
    driven_ns: Option<u64>,
    /// When its bus was last disturbed, or the board could say nothing to it.
    excused_ns: u64,
    /// Its answers or orders may have been damaged since an order moved it last.
    was_garbled: bool,
    /// No order has moved it since the start.
    is_as_started: bool,
    /// Where it came to rest first after its last order, as long as it has torque, its board has power, and all was well on its bus: starts
    /// may not add up.
    rested: Option<f32>,
    /// Since when it turns and reports an overload.
    overloaded_ns: Option<u64>,
    /// Since when something has pushed it away from what it holds.
    strayed_ns: Option<u64>,
    /// Since when it has torque and no order explains its goal.
    holding_ns: Option<u64>,
    /// It has lowered its torque limit by itself, and nobody has stopped the board since.
    is_weakened: bool,
    /// Since when a hand has turned it faster than it may.
    fast_ns: Option<u64>,
    /// It has been at the goal in force.
    has_arrived: bool,
    /// The end of its last motion under torque, ns.
    moved_ns: Option<u64>,
    /// Whether an order explains its goal, at that number of changes of the orders.
    explained: Option<(u64, bool)>,
    /// When it obeyed a damaged request, until what it does is judged again.
    misled_ns: Option<u64>,
    /// The same until its goal is judged again: one that was changed meanwhile has its own time.
    doubtful_ns: Option<u64>,
}

/// The judge's memory.
pub struct Servos {
    ceilings: Ceilings,
    tracks: Vec<Track>,
    orders: Vec<Order>,
    /// How often what explains a goal has changed.
    changes: u64,
    /// Joint angles of tables, with the index of their servo, rad.
    tabled: Vec<(u8, f32)>,
    /// Zero offsets that somebody has set, rad: what is added to the joint angle of each servo.
    offsets_rad: Vec<[f32; MAX_SERVOS]>,
    /// Since when the safe state is latched, as far as the judge knows by itself.
    latched_ns: Option<u64>,
    /// Since when no order was there after a start: what the profile says of the safe state holds then too.
    fallen_back_ns: Option<u64>,
    looked_ns: u64,
    /// When orders have begun or ended last.
    ordered_ns: u64,
    /// What a shaft that is held may turn more than usual, steps.
    other_range_steps: f32,
    verdict: Verdict,
}

impl Servos {
    /// Servos of which nothing is known.
    pub fn new(ceilings: Ceilings) -> Self {
        Self {
            ceilings,
            tracks: Vec::new(),
            orders: Vec::new(),
            changes: 0,
            tabled: Vec::new(),
            offsets_rad: vec![[0.0; MAX_SERVOS]],
            latched_ns: None,
            fallen_back_ns: Some(0),
            looked_ns: 0,
            ordered_ns: 0,
            other_range_steps: 0.0,
            verdict: Verdict::default(),
        }
    }

    /// Some table has this joint angle for the servo of this index.
    pub fn on_tabled(&mut self, index: u8, angle_rad: f32) {
        if !self.tabled.contains(&(index, angle_rad)) {
            self.tabled.push((index, angle_rad));
            self.changes += 1;
        }
    }

    /// Somebody sets these zero offsets.
    pub fn on_offsets(&mut self, offsets_rad: [f32; MAX_SERVOS]) {
        if !self.offsets_rad.contains(&offsets_rad) {
            self.offsets_rad.push(offsets_rad);
            self.changes += 1;
        }
    }

    /// The board has confirmed these zero offsets of servos that rest, and nobody else has set others since they were requested.
    pub fn on_offsets_confirmed(&mut self, offsets_rad: [f32; MAX_SERVOS]) {
        self.offsets_rad = vec![offsets_rad];
        self.changes += 1;
    }

    /// An order arrives, on a connection that is open or as text. In the safe state it is none.
    pub fn on_order(&mut self, now_ns: u64, wish: Wish) {
        if self.latched_ns.is_none() {
            self.fallen_back_ns = None;
            self.ordered_ns = now_ns;
            self.orders.retain(|order| order.wish != wish);
            self.orders.push(Order { at_ns: now_ns, wish });
            self.changes += 1;
            self.tracks.iter_mut().for_each(|track| track.overloaded_ns = None);
        }
    }

    /// Orders that came before this time explain nothing any more: a stop or a fault came.
    pub fn end_orders(&mut self, before_ns: u64) {
        self.ordered_ns = self.looked_ns;
        self.orders.retain(|order| order.at_ns >= before_ns);
        self.changes += 1;
    }

    /// The servo of this index lowers its torque limit by itself. When the board looks for that is its own affair, but for a stop.
    pub fn on_weakened(&mut self, index: usize) {
        if let Some(track) = self.tracks.get_mut(index) {
            track.is_weakened = true;
        }
    }

    /// A stop comes: it starts each hold again, also one that an earlier stop has begun.
    pub fn on_repeated_stop(&mut self) {
        self.tracks.iter_mut().for_each(|track| track.is_weakened = false);
    }

    /// The board knows no servo: no order gives one another goal, and one that was on its way continues, however slowly. Where that is not
    /// certain, orders are in force too.
    pub fn on_uncontrolled(&mut self, now_ns: u64, is_certain: bool) {
        if is_certain {
            self.end_orders(u64::MAX);
        }
        for track in &mut self.tracks {
            (track.motion, track.holding_ns, track.rested) = (Motion::Stopping(now_ns), None, None);
        }
    }

    /// The safe state is latched, since then.
    pub fn on_latched(&mut self, now_ns: u64) {
        self.end_orders(u64::MAX);
        self.latched_ns = self.latched_ns.or(Some(now_ns));
    }

    /// Whether the safe state is latched, as far as the judge knows.
    pub fn is_latched(&self) -> bool {
        self.latched_ns.is_some()
    }

    /// Somebody asks for the safe state to be left.
    pub fn on_cleared(&mut self) {
        self.latched_ns = None;
    }

    /// Since when the safe state is latched, as far as the judge knows.
    pub fn latched_ns(&self) -> Option<u64> {
        self.latched_ns
    }

    /// Somebody requested to leave the safe state, and was refused: it is what it was before, and commands since then are none.
    pub fn on_clear_refused(&mut self, before_ns: Option<u64>) {
        if before_ns.is_some() {
            self.end_orders(u64::MAX);
            self.latched_ns = before_ns;
        }
    }

    /// The firmware starts again and knows no position.
    pub fn on_start(&mut self, now_ns: u64) {
        self.end_orders(u64::MAX);
        (self.latched_ns, self.fallen_back_ns) = (None, Some(now_ns));
        for track in &mut self.tracks {
            track.motion = Motion::Stopping(now_ns);
            (track.answered_ns, track.overloaded_ns, track.moved_ns) = (None, None, None);
            (track.holding_ns, track.is_as_started) = (None, true);
            track.excused_ns = now_ns + (START_MS - HOLD_MS) * MS;
            track.misled_ns = track.misled_ns.map(|_| track.excused_ns);
            track.doubtful_ns = None;
            track.driven_ns = track.last.has_torque.then_some(now_ns);
        }
    }

    /// A profile of another range has been in force. A shaft may have been far out of it, where each start lets its load bend it once
    /// more; or so little beyond that the board held it at the edge, one bend farther away than a place that is held.
    pub fn on_other_range(&mut self) {
        self.other_range_steps = MAX_BEND_STEPS;
    }

    /// Whether an order in force explains this goal of the servo of this index.
    fn is_ordered(&self, index: usize, goal: f32) -> bool {
        let near = |angle_rad: &f32| {
            let step = |offset: f32| ((angle_rad + offset) * STEPS_PER_RAD + 2048.0).clamp(0.0, 4095.0);
            self.offsets_rad.iter().any(|offsets| (step(offsets[index]) - goal).abs() <= GOAL_STEPS)
        };
        self.orders.iter().any(|order| match order.wish {
            Wish::Angle(servo, angle_rad) => usize::from(servo) == index && near(&angle_rad),
            Wish::Table => self.tabled.iter().any(|(servo, angle_rad)| usize::from(*servo) == index && near(angle_rad)),
        })
    }

    /// The end of a tick.
    pub fn look(&mut self, now_ns: u64, is_powered: bool, joints: impl Iterator<Item = Joint>) {
        let span_ns = now_ns.saturating_sub(self.looked_ns);
        self.looked_ns = now_ns;
        for (index, joint) in joints.enumerate() {
            let Some(track) = self.tracks.get(index).copied() else {
                let motion = Motion::Resting(joint.step);
                self.tracks.push(Track {
                    last: joint,
                    motion,
                    answered_ns: None,
                    driven_ns: None,
                    excused_ns: 0,
                    was_garbled: false,
                    is_as_started: true,
                    rested: None,
                    overloaded_ns: None,
                    strayed_ns: None,
                    holding_ns: None,
                    is_weakened: false,
                    fast_ns: None,
                    has_arrived: false,
                    moved_ns: None,
                    explained: None,
                    misled_ns: None,
                    doubtful_ns: None,
                });
                continue;
            };
            let track = self.follow(now_ns, span_ns, index, &joint, track, is_powered);
            self.tracks[index] = track;
        }
    }

    /// One servo from the last tick to this one.
    fn follow(
        &mut self,
        now_ns: u64,
        span_ns: u64,
        index: usize,
        joint: &Joint,
        mut track: Track,
        is_powered: bool,
    ) -> Track {
        let (id, before) = (joint.id, track.last);
        track.last = *joint;
        if joint.answers != before.answers {
            track.answered_ns = Some(now_ns);
        }
        if !joint.is_heard || !is_powered {
            track.excused_ns = track.excused_ns.max(now_ns);
            // No order to hold reaches it: one that is slow creeps on.
            track.rested = None;
        }
        track.was_garbled |= joint.is_garbled();
        let gets_torque = joint.has_torque && !before.has_torque;
        if !joint.has_torque {
            track.driven_ns = None;
        } else if gets_torque {
            track.driven_ns = Some(now_ns);
        }
        if joint.goal != before.goal {
            (track.explained, track.has_arrived) = (None, false);
        }
        track.has_arrived &= joint.has_torque;
        track.has_arrived |= joint.has_torque && !joint.is_pushed && (joint.goal - joint.step).abs() <= HOLD_STEPS;
        let is_misled = self.is_misled(now_ns, &mut track, joint.misled != before.misled, is_powered);
        let falls = before.has_torque && !joint.has_torque && is_powered && !is_misled;
        if falls && self.ceiling(id).is_some_and(|servo| !servo.is_released) {
            self.verdict.note(JUDGE, "servo-hold", now_ns, || {
                format!("servo {id} loses its torque, and the profile lets it hold in every state")
            });
        }
        let Some(servo) = self.ceiling(id) else {
            if joint.has_torque {
                self.verdict.note(JUDGE, "servo-wiring", now_ns, || format!("servo {id} has torque and is not wired"));
            }
            return track;
        };
        let turned = joint.step - before.step;
        if joint.has_torque {
            if !is_misled && !joint.is_pushed {
                self.check_limits(now_ns, span_ns, joint, turned, &servo);
            }
            let is_new = gets_torque || joint.goal != before.goal;
            if is_new && track.answered_ns.is_none() && is_powered {
                self.verdict.note(JUDGE, "torque-unseen", now_ns, || {
                    format!("servo {id} is driven, and it has never answered since the start")
                });
            }
            if is_new && !is_misled {
                self.check_goal(now_ns, index, joint, &servo);
            }
            if gets_torque && is_powered && !is_misled && !self.is_ordered(index, joint.goal) {
                self.verdict.note(JUDGE, "unasked-torque", now_ns, || {
                    format!(
                        "servo {id} had no torque and gets some, and no order in force gives it the goal {:.0}",
                        joint.goal
                    )
                });
            }
        }
        self.check_stray(now_ns, index, &mut track, &servo);
        self.check_fast(now_ns, span_ns, &mut track, turned, &servo);
        self.check_misled(now_ns, index, &mut track, &servo);
        if is_misled || joint.is_pushed {
            // Where it comes to rest afterwards is where it rests.
            (track.motion, track.holding_ns, track.rested) = (Motion::Stopping(now_ns), None, None);
        }
        // One that rests, or is at its goal, may bend a little, as when what had blocked it goes away.
        let is_away = (joint.goal - joint.step).abs() > HOLD_STEPS;
        let is_own = !is_misled && !joint.is_pushed;
        if turned.abs() > REST_STEPS && is_away && is_own && !matches!(track.motion, Motion::Resting(_)) {
            track.moved_ns = Some(now_ns);
        }
        if is_powered {
            if !joint.is_pushed {
                self.check_rest(now_ns, index, &mut track, turned);
            }
            self.check_strength(now_ns, &mut track, &servo);
            self.check_fallback(now_ns, &track, &servo);
            self.check_overload(now_ns, &mut track, turned);
        } else {
            track.motion = Motion::Stopping(now_ns);
        }
        track
    }

    /// Whether it obeys a damaged request now, which nobody can know before its registers are read back.
    fn is_misled(&self, now_ns: u64, track: &mut Track, is_new: bool, is_powered: bool) -> bool {
        if is_new || track.misled_ns.is_some() && !(track.last.is_bus_clear && is_powered) {
            track.misled_ns = track.misled_ns.max(Some(now_ns));
        }
        let Some(misled_ns) = track.misled_ns else { return false };
        if now_ns <= misled_ns + self.ceilings.true_ns(self.reread_ms()) {
            return true;
        }
        (track.misled_ns, track.doubtful_ns) = (None, Some(now_ns));
        false
    }

    /// The longest time from a damaged request to the next one that is written.
    fn reread_ms(&self) -> u64 {
        ROUND_MS + VOTE_MS + HOLD_VISIT_MS * self.ceilings.servos.len() as u64
    }

    /// What a damaged request had put into it is gone: it has a goal that an order explains, or is at its goal.
    fn check_misled(&mut self, now_ns: u64, index: usize, track: &mut Track, servo: &ServoCeiling) {
        if track.doubtful_ns.is_none() || now_ns <= self.ordered_ns + self.ceilings.true_ns(HOLD_MS) {
            return;
        }
        track.doubtful_ns = None;
        let Joint { id, goal, step, has_torque, .. } = track.last;
        let late = f32::from(servo.max_steps_s) * 1e-3 * READ_AGE_MS as f32;
        if has_torque && (goal - step).abs() > HOLD_STEPS + late && !self.is_ordered(index, goal) {
            let reread_ms = self.reread_ms();
            self.verdict.note(JUDGE, "misled-goal", now_ns, || {
                format!("servo {id} keeps the goal {goal:.0} of a damaged request for more than {reread_ms} ms")
            });
        }
    }

    fn ceiling(&self, id: u8) -> Option<ServoCeiling> {
        self.ceilings.servos.iter().copied().find(|servo| servo.id == id)
    }

    /// What holds in every state: range, speed and torque.
    fn check_limits(&mut self, now_ns: u64, span_ns: u64, joint: &Joint, turned: f32, servo: &ServoCeiling) {
        let Joint { id, step, torque_limit, .. } = *joint;
        let (min, max) = (f32::from(servo.min_step), f32::from(servo.max_step));
        let beyond = servo.beyond(step);
        // Where it was out of its range before, it may come back.
        let leaves = if step < min { turned < -REST_STEPS } else { turned > REST_STEPS };
        if beyond > RANGE_STEPS + self.other_range_steps && leaves {
            self.verdict.note(JUDGE, "servo-range", now_ns, || {
                format!("servo {id} turns to step {step:.0}, allowed are {min} to {max}")
            });
        }
        let allowed = f32::from(servo.max_steps_s) * 1e-9 * span_ns as f32;
        if turned.abs() > allowed * 1.001 + REST_STEPS {
            let speed = turned.abs() / (1e-9 * span_ns as f32);
            self.verdict.note(JUDGE, "servo-speed", now_ns, || {
                format!("servo {id} turns at {speed:.0} steps/s, allowed are {}", servo.max_steps_s)
            });
        }
        if torque_limit > servo.max_torque {
            self.verdict.note(JUDGE, "servo-torque", now_ns, || {
                format!(
                    "servo {id} may bear {torque_limit} thousandths of its torque, allowed are {}",
                    servo.max_torque
                )
            });
        }
    }

    /// A goal that comes into force is one that an order explains, or the place where the shaft is.
    fn check_goal(&mut self, now_ns: u64, index: usize, joint: &Joint, servo: &ServoCeiling) {
        let Joint { id, goal, step, .. } = *joint;
        let late = f32::from(servo.max_steps_s) * 1e-3 * READ_AGE_MS as f32;
        if (goal - step).abs() > HOLD_STEPS + late && !self.is_ordered(index, goal) {
            self.verdict.note(JUDGE, "unasked-goal", now_ns, || {
                format!("servo {id} at step {step:.0} gets the goal {goal:.0}, which no order in force explains")
            });
        }
    }

    /// Without an order the shaft comes to rest, and stays there.
    fn check_rest(&mut self, now_ns: u64, index: usize, track: &mut Track, turned: f32) {
        let Joint { id, step, goal, has_torque, is_blocked, .. } = track.last;
        let known = track.explained.filter(|(changes, _)| *changes == self.changes);
        let (_, is_ordered) = known.unwrap_or_else(|| (self.changes, self.is_ordered(index, goal)));
        track.explained = Some((self.changes, is_ordered));
        if has_torque && is_ordered {
            (track.motion, track.was_garbled) = (Motion::Ordered, track.last.is_garbled());
            (track.is_as_started, track.rested) = (false, None);
            return;
        }
        if track.motion == Motion::Ordered {
            track.motion = Motion::Stopping(now_ns);
        }
        match track.motion {
            Motion::Ordered => {}
            Motion::Stopping(since_ns) => {
                let from_ns = since_ns.max(track.excused_ns);
                // It continues when what blocks it goes away.
                let is_caught = has_torque && is_blocked && (goal - step).abs() > HOLD_STEPS;
                if turned.abs() <= REST_STEPS && now_ns > since_ns && !is_caught {
                    track.motion = Motion::Resting(step);
                } else if turned.abs() > REST_STEPS && now_ns > from_ns + self.ceilings.true_ns(HOLD_MS) {
                    track.motion = Motion::Resting(step);
                    self.verdict.note(JUDGE, "unasked-motion", now_ns, || {
                        let ms = (now_ns - from_ns) / MS;
                        format!("servo {id} still turns {ms} ms after the last order ended, to step {goal:.0}")
                    });
                }
            }
            Motion::Resting(at) => {
                let damaged_steps = if track.was_garbled { DAMAGED_STEPS } else { 0.0 };
                let kept_steps = if track.is_as_started { KEPT_STEPS } else { 0.0 };
                let allowed = HOLD_STEPS + kept_steps + self.other_range_steps + damaged_steps;
                if !has_torque || track.last.is_garbled() {
                    track.rested = None;
                }
                let first = *track.rested.get_or_insert(step);
                if (step - at).abs() > allowed || (step - first).abs() > allowed {
                    (track.motion, track.rested) = (Motion::Stopping(now_ns), None);
                    self.verdict.note(JUDGE, "unasked-motion", now_ns, || {
                        format!("servo {id} came to rest at step {first:.0} and is at {step:.0}, goal {goal:.0}; no order explains that")
                    });
                }
            }
        }
    }

    /// The board latches the safe state where a servo is pushed away from what it holds, or from a target at which it has been, or is turned
    /// out of its range without torque.
    fn check_stray(&mut self, now_ns: u64, index: usize, track: &mut Track, servo: &ServoCeiling) {
        let Joint { is_pushed, has_torque, is_heard, goal, step, .. } = track.last;
        let is_away = if has_torque { (goal - step).abs() > STRAY_STEPS } else { servo.beyond(step) > OUT_STEPS };
        let is_seen = is_away && is_pushed && is_heard;
        if !is_seen || has_torque && !track.has_arrived && self.is_ordered(index, goal) {
            track.strayed_ns = None;
            return;
        }
        let since_ns = *track.strayed_ns.get_or_insert(now_ns);
        if now_ns > since_ns + self.ceilings.true_ns(STRAY_MS) {
            self.on_latched(now_ns);
        }
    }

    /// The board latches the safe state where a servo without torque is turned faster than the profile says.
    fn check_fast(&mut self, now_ns: u64, span_ns: u64, track: &mut Track, turned: f32, servo: &ServoCeiling) {
        let Joint { is_pushed, has_torque, is_heard, .. } = track.last;
        let allowed = (FAST_SHARE * f32::from(servo.max_steps_s) + FAST_STEPS_S) * 1e-9 * span_ns as f32;
        if has_torque || !is_pushed || !is_heard || turned.abs() <= allowed {
            track.fast_ns = None;
            return;
        }
        let since_ns = *track.fast_ns.get_or_insert(now_ns - span_ns);
        if now_ns > since_ns + self.ceilings.true_ns(STRAY_MS) {
            self.on_latched(now_ns);
        }
    }

    /// One that holds does so with the torque of the profile: with less the arm sags.
    fn check_strength(&mut self, now_ns: u64, track: &mut Track, servo: &ServoCeiling) {
        let Joint { id, torque_limit, has_torque, .. } = track.last;
        if !has_torque || track.motion == Motion::Ordered || track.is_weakened {
            track.holding_ns = None;
            return;
        }
        let since_ns = *track.holding_ns.get_or_insert(now_ns);
        let from_ns = since_ns.max(track.excused_ns);
        if torque_limit.saturating_add(TORQUE_SLACK) < servo.max_torque
            && now_ns > from_ns + self.ceilings.true_ns(HOLD_MS)
        {
            self.verdict.note(JUDGE, "servo-weak", now_ns, || {
                format!(
                    "servo {id} holds with {torque_limit} thousandths of its torque, the profile says {}",
                    servo.max_torque
                )
            });
        }
    }

    /// In the safe state, and after a start, a servo that the profile releases has no torque.
    fn check_fallback(&mut self, now_ns: u64, track: &Track, servo: &ServoCeiling) {
        let Some(since_ns) = self.latched_ns.or(self.fallen_back_ns).filter(|_| servo.is_released) else { return };
        let from_ns = since_ns.max(track.excused_ns);
        if track.last.has_torque && now_ns > from_ns + self.ceilings.true_ns(HOLD_MS) {
            let (id, ms) = (servo.id, (now_ns - from_ns) / MS);
            self.verdict.note(JUDGE, "servo-release", now_ns, || {
                format!("servo {id} has torque {ms} ms after a fault or a start, and the profile releases it")
            });
        }
    }

    /// One that an order moves has to stop for good: where it rests between two goals of a program its time continues.
    fn check_overload(&mut self, now_ns: u64, track: &mut Track, turned: f32) {
        let Joint { id, step, goal, is_overloaded, is_heard, .. } = track.last;
        let is_ordered = track.motion == Motion::Ordered;
        // At its goal it may bend a little.
        let goes = turned.abs() > REST_STEPS && (!is_ordered || (goal - step).abs() > HOLD_STEPS);
        if !(is_overloaded && is_heard && (goes || is_ordered)) {
            track.overloaded_ns = None;
        } else if goes {
            track.overloaded_ns = track.overloaded_ns.or(Some(now_ns));
        }
        let Some(since_ns) = track.overloaded_ns.map(|since_ns| since_ns.max(track.excused_ns)) else { return };
        if goes && now_ns > since_ns + self.ceilings.true_ns(OVERLOAD_MS) {
            let ms = (now_ns - since_ns) / MS;
            self.verdict.note(JUDGE, "servo-overload", now_ns, || {
                format!("servo {id} turns on, {ms} ms after it first reported an overload or too much load")
            });
        }
    }

    /// The board reports a fault at this true time, and nobody has cleared it since: what the servos have done.
    pub fn on_fault(&mut self, now_ns: u64, fault_ns: u64) {
        for index in 0..self.tracks.len() {
            let track = self.tracks[index];
            let limit_ns = fault_ns.max(track.excused_ns) + self.ceilings.true_ns(HOLD_MS);
            let id = track.last.id;
            if now_ns <= limit_ns {
                continue;
            }
            if let Some(moved_ns) = track.moved_ns.filter(|moved_ns| *moved_ns > limit_ns) {
                self.verdict.note(JUDGE, "fault-motion", now_ns, || {
                    let (fault_ms, moved_ms) = (fault_ns / MS, moved_ns / MS);
                    format!("servo {id} turned at {moved_ms} ms, {HOLD_MS} ms after a fault at {fault_ms} ms and what excuses it")
                });
            }
            let is_released = self.ceiling(id).is_some_and(|servo| servo.is_released);
            if is_released && track.last.has_torque {
                self.verdict.note(JUDGE, "servo-release", now_ns, || {
                    format!("servo {id} has torque after a fault that the board reports, and the profile releases it")
                });
            }
        }
    }

    /// Whether a servo turns on an order that a stop has ended: its address and how far it has to go, steps.
    pub fn moving(&self) -> Option<(u8, u16)> {
        let turns = |track: &&Track| {
            let away = (track.last.goal - track.last.step).abs();
            let is_free = track.last.has_torque && !track.last.is_blocked;
            is_free && track.moved_ns == Some(self.looked_ns) && away > HOLD_STEPS
        };
        self.tracks.iter().find(turns).map(|track| (track.last.id, (track.last.goal - track.last.step).abs() as u16))
    }

    /// Where the shafts are, and the goals that they have.
    pub fn places(&self) -> Vec<(f32, f32)> {
        self.tracks.iter().map(|track| (track.last.step, track.last.goal)).collect()
    }

    /// A calibration was confirmed, and nothing else came since the shafts were there on their way to these goals: none has turned
    /// elsewhere.
    pub fn on_calibrated(&mut self, now_ns: u64, before: &[(f32, f32)]) {
        for (track, &(start, goal)) in self.tracks.iter().zip(before) {
            let (id, step) = (track.last.id, track.last.step);
            if step < start.min(goal) - HOLD_STEPS || step > start.max(goal) + HOLD_STEPS {
                self.verdict.note(JUDGE, "calibration-moves", now_ns, || {
                    format!("a calibration let servo {id} turn to step {step:.0}; before it went from {start:.0} to {goal:.0}")
                });
            }
        }
    }

    /// For this time the flash lets nothing run, so that no servo is asked: it does not count as silence, and nobody would see
    /// what a servo does that is on its way.
    pub fn on_pause(&mut self, now_ns: u64, span_ns: u64) {
        for track in &mut self.tracks {
            let Joint { id, goal, step, has_torque, is_blocked, .. } = track.last;
            let away = (goal - step).abs();
            let is_excused = now_ns < track.excused_ns + WRITE_ANYWAY_MS * MS;
            if has_torque && !is_blocked && away > UNDER_WAY_STEPS && !is_excused {
                self.verdict.note(JUDGE, "flash-under-motion", now_ns, || {
                    format!("servo {id} is {away:.0} steps from its goal while the flash lets no control tick run")
                });
            }
            track.answered_ns = track.answered_ns.map(|at_ns| at_ns + span_ns);
            track.excused_ns = track.excused_ns.max(now_ns);
            track.misled_ns = track.misled_ns.map(|at_ns| at_ns + span_ns);
        }
    }

    /// Whether a servo has been silent for longer than it may, or since the start of the firmware at `started_ns`: its index, and since when.
    pub fn silent(&self, now_ns: u64, started_ns: u64) -> Option<(usize, u64)> {
        self.tracks.iter().enumerate().find_map(|(index, track)| {
            let ServoCeiling { timeout_ms, .. } = self.ceiling(track.last.id)?;
            let allowed_ns = self.ceilings.true_ns(u64::from(timeout_ms) + NOTICE_MS);
            // A start reads the profile before it asks.
            let from_ns = track.answered_ns.unwrap_or(started_ns + START_MS * MS);
            (now_ns.saturating_sub(from_ns) > allowed_ns).then_some((index, from_ns))
        })
    }

    /// The end of a tick in which any line was on: a driven servo that has fallen silent must have been noticed.
    pub fn on_lines_on(&mut self, now_ns: u64) {
        for index in 0..self.tracks.len() {
            let Track { answered_ns: Some(answered_ns), driven_ns: Some(driven_ns), last, .. } = self.tracks[index]
            else {
                continue;
            };
            let Some(ServoCeiling { id, timeout_ms, .. }) = self.ceiling(last.id) else { continue };
            let silent_ns = now_ns.saturating_sub(answered_ns.max(driven_ns));
            if silent_ns > self.ceilings.true_ns(u64::from(timeout_ms) + NOTICE_MS) {
                self.verdict.note(JUDGE, "servo-silence", now_ns, || {
                    format!("servo {id} is driven and silent for {} ms and lines are on", silent_ns / MS)
                });
            }
        }
    }

    /// The end of the run.
    pub fn finish(self) -> Verdict {
        self.verdict
    }
}

#[cfg(test)]
mod tests;
