//! Where a servo is, from answers that may be damaged: the sum of a packet is eight bits, and two bits of one place that turn over
//! in opposite directions leave it as it is. So no single answer is believed that says something new.

use core::f32::consts::TAU;

use darm_core::output::{SERVO_STEPS_PER_TURN, ServoWiring};
use darm_core::sequencer::ServoSeen;
use darm_core::units::Micros;

use super::{LOAD_SIGN, MIDDLE, POSITION_SIGN};

/// Two reads of a servo at rest differ by no more, steps: the noise of its encoder is one or two, the rest is what it gives way
/// to a push within a millisecond. It bounds what a damaged answer can add to a goal: 0.7°.
pub(super) const NOISE_STEPS: f32 = 8.0;
/// A servo overshoots its speed while it speeds up and while a load drives it, by this factor of its limit.
pub(super) const OVERSHOOT: f32 = 1.25;

/// Where a servo was when it was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// When this was requested; the clock in µs, which wraps after 71 minutes: places are forgotten long before.
    asked_us: u32,
    pub(super) steps: i16,
    /// Its own report of its speed, steps/s.
    pub(super) speed: u16,
}

/// One answer about position, speed and load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) place: Place,
    /// It cannot have come here from where it was before the vote.
    pub(super) has_jumped: bool,
    load: u16,
    error: u8,
    pub(super) asked: Micros,
    came: Micros,
}

impl Sample {
    /// An answer to a request of `asked` that has come by `came`.
    pub(super) fn new(values: [u8; 6], error: u8, asked: Micros, came: Micros) -> Self {
        let [p0, p1, s0, s1, l0, l1] = values;
        let steps = signed(u16::from_le_bytes([p0, p1]));
        let speed = u16::from_le_bytes([s0, s1]) & (POSITION_SIGN - 1);
        let load = u16::from_le_bytes([l0, l1]) & (LOAD_SIGN - 1);
        let place = Place { asked_us: asked.0 as u32, steps, speed };
        Self { place, has_jumped: false, load, error, asked, came }
    }

    /// What the control tick learns.
    pub(super) fn seen(&self) -> ServoSeen {
        ServoSeen {
            angle_rad: angle_rad(register(self.place.steps)),
            load: f32::from(self.load) * 1e-3,
            error: self.error,
            answered: Some(self.asked),
        }
    }
}

impl Place {
    /// Whether the servo can have come from here to there: at the limit of its profile, and at the speed that both answers report,
    /// where it turns faster, as one that an earlier start or another tool has sent off. A damaged report of one of the two adds
    /// nothing.
    pub(super) fn leads_to(&self, later: &Sample, limit: &ServoWiring) -> bool {
        let own = f32::from(self.speed.min(later.place.speed));
        self.distance(later) <= NOISE_STEPS + (limit_steps_s(limit) + own) * self.elapsed_s(later)
    }

    /// The time since it was read.
    pub(super) fn age(&self, now: Micros) -> Micros {
        Micros((now.0 as u32).wrapping_sub(self.asked_us).into())
    }

    /// Steps from here to there.
    pub(super) fn distance(&self, later: &Sample) -> f32 {
        f32::from(self.steps.abs_diff(later.place.steps))
    }

    /// The longest time that the servo may have had: an answer says where it was at some time between its request and its coming.
    pub(super) fn elapsed_s(&self, later: &Sample) -> f32 {
        (later.came.0 as u32).wrapping_sub(self.asked_us) as f32 * 1e-6
    }
}

/// The speed that the profile allows and that a servo reaches under it, steps/s.
pub(super) fn limit_steps_s(limit: &ServoWiring) -> f32 {
    limit.max_speed_rad_s * (OVERSHOOT * SERVO_STEPS_PER_TURN / TAU)
}

/// The number in a position register.
pub(super) fn signed(register: u16) -> i16 {
    let magnitude = (register & (POSITION_SIGN - 1)) as i16;
    if register & POSITION_SIGN == 0 { magnitude } else { magnitude.saturating_neg() }
}

/// The position register of a number.
pub(super) fn register(steps: i16) -> u16 {
    steps.unsigned_abs().min(POSITION_SIGN - 1) | if steps < 0 { POSITION_SIGN } else { 0 }
}

/// Servo angle of a position register.
pub(super) fn angle_rad(register: u16) -> f32 {
    let magnitude = f32::from(register & (POSITION_SIGN - 1));
    let steps = if register & POSITION_SIGN == 0 { magnitude } else { -magnitude };
    (steps - MIDDLE) * (TAU / SERVO_STEPS_PER_TURN)
}
