//! The servos: what they are sent, what each must answer, and which commands they allow.

use super::{CommandError, FaultKind, LATE, Phase, Seen, Sequencer, ServoAction, ServoBreach, ServoSeen, ServoTarget};
use crate::output::{MAX_SERVOS, ServoWiring};
use crate::profile::Fallback;
use crate::units::Micros;

/// The servos get this share of their speed on the way to the first row.
pub(super) const APPROACH_SPEED: f32 = 0.25;

/// A servo has reached the first row when it is this near.
pub(super) const APPROACH_TOLERANCE_RAD: f32 = 0.01;

/// A servo that is farther from its target moves. One that bears a load stays a little short of it.
const MOTION_RAD: f32 = 0.05;

/// Until then an order to hold has reached every servo that answers, also where all others of the bus are silent.
const HOLD_TIME: Micros = Micros::from_millis(200);

/// An order leaves with the next tick.
const ORDER_TIME: Micros = Micros::from_millis(2);

/// One servo.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Servo {
    pub(super) action: ServoAction,
    /// Joint angle = shaft angle − offset.
    pub(super) offset_rad: f32,
    /// When it answered last, without the time since then in which no tick ran.
    pub(super) answered: Option<Micros>,
}

impl Sequencer<'_> {
    /// Whether a servo is on its way to a target.
    pub fn has_moving_servo(&self, seen: &Seen) -> bool {
        self.servos.iter().zip(&seen.servos).any(|(servo, seen)| match servo.action {
            ServoAction::Go(target) => (seen.angle_rad - target.angle_rad).abs() > MOTION_RAD,
            ServoAction::Hold | ServoAction::Release => false,
        })
    }

    /// Whether a servo that was on its way may not have its order to hold yet: it has not answered since, as it does when it gets
    /// the order.
    pub fn has_stopping_servo(&self, seen: &Seen) -> bool {
        let hold_since = self.hold_since.unwrap_or(self.now);
        let is_recent = self.now - hold_since < HOLD_TIME;
        let from = hold_since + ORDER_TIME;
        let mut own = seen.servos.iter().zip(&self.profile.servos);
        is_recent && own.any(|(servo, _)| servo.answered.is_none_or(|answered| answered < from))
    }

    /// Time in which no tick ran, as while code and tables share a flash that is erased, is no silence of a servo.
    pub(super) fn skip_missed_ticks(&mut self, since_tick: Micros) {
        if since_tick > LATE {
            for answered in self.servos.iter_mut().filter_map(|servo| servo.answered.as_mut()) {
                *answered = *answered + since_tick - LATE;
            }
        }
    }

    /// Takes zero offsets of the servos: joint angle = shaft angle − offset. No servo moves. No program may run.
    ///
    /// # Errors
    ///
    /// [`CommandError::Playing`]: a program runs.
    pub fn calibrate(&mut self, offsets_rad: [f32; MAX_SERVOS]) -> Result<(), CommandError> {
        if matches!(self.phase, Phase::Approaching { .. } | Phase::Playing { .. }) {
            return Err(CommandError::Playing);
        }
        self.hold_servos();
        for (servo, offset_rad) in self.servos.iter_mut().zip(offsets_rad) {
            servo.offset_rad = offset_rad;
        }
        Ok(())
    }

    /// No servo continues to its target.
    pub(super) fn hold_servos(&mut self) {
        for servo in &mut self.servos {
            if matches!(servo.action, ServoAction::Go(_)) {
                servo.action = ServoAction::Hold;
                self.hold_since = None;
            }
        }
    }

    /// Every servo does what its profile says for the safe state.
    pub(super) fn servos_to_fallback(&mut self) {
        self.hold_servos();
        for (index, servo) in self.servos.iter_mut().enumerate() {
            servo.action = match self.profile.servos.get(index).map(|own| own.fallback) {
                Some(Fallback::Hold) | None => ServoAction::Hold,
                Some(Fallback::Release) => ServoAction::Release,
            };
        }
    }

    /// Refuses to drive anything while a servo is silent, or has been so since the start: it may bear the arm by what it was ordered
    /// before.
    pub(super) fn check_servos_answer(&self) -> Result<(), CommandError> {
        let is_unheard = |(joint, servo): (&ServoWiring, &Servo)| {
            servo.answered.is_none() || is_silent(self.now, joint, servo.answered)
        };
        match self.joints().zip(&self.servos).position(is_unheard) {
            Some(index) => Err(CommandError::ServoSilent { servo: index as u8 }),
            None => Ok(()),
        }
    }

    /// The servos of the profile, each as the table has it, or as the profile has one that the table leaves out: it may bear the arm too.
    pub(super) fn joints(&self) -> impl Iterator<Item = &ServoWiring> {
        let named = self.table.as_deref().map_or(&[][..], |table| table.wiring().servos.as_slice());
        let own = self.profile.servos.iter().map(|servo| &servo.limit);
        named.iter().chain(own.skip(named.len()))
    }

    /// What servos do that their profile does not allow, in every state and without a table: who moves one that holds, or has none,
    /// is not the program.
    pub(super) fn look_at_breaches(&self, seen: &Seen) -> Result<(), FaultKind> {
        let servos = seen.servo_breaches.iter().zip(&seen.servos).zip(&self.servos);
        for (servo, ((breach, seen), own)) in (0u8..).zip(servos) {
            let angle_rad = seen.angle_rad - own.offset_rad;
            match breach {
                None => {}
                Some(ServoBreach::Range) => return Err(FaultKind::ServoRange { servo, angle_rad }),
                Some(ServoBreach::Speed) => return Err(FaultKind::ServoSpeed { servo }),
                Some(ServoBreach::Moved) => return Err(FaultKind::ServoMoved { servo }),
            }
        }
        Ok(())
    }

    pub(super) fn turn_servo(&mut self, servo: u8, angle_rad: f32) -> Result<(), CommandError> {
        let index = usize::from(servo);
        let wiring = self.table.as_deref().ok_or(CommandError::NoTable)?.wiring();
        let joint = wiring.servos.get(index).ok_or(CommandError::NotWired)?;
        let (min_rad, max_rad) = self.range_rad(index, joint);
        let own = self.servos.get_mut(index).filter(|own| own.answered.is_some());
        let own = own.ok_or(CommandError::ServoSilent { servo })?;
        if !(min_rad..=max_rad).contains(&angle_rad) {
            return Err(CommandError::ServoRange { min_rad, max_rad });
        }
        own.action = ServoAction::Go(target(joint, angle_rad + own.offset_rad, APPROACH_SPEED));
        Ok(())
    }

    /// Joint angles that both the table and the profile allow; empty where they allow none.
    fn range_rad(&self, index: usize, joint: &ServoWiring) -> (f32, f32) {
        let offset_rad = self.servos.get(index).map_or(0.0, |servo| servo.offset_rad);
        let shaft = self.profile.servos.get(index).map_or((0.0, -1.0), |own| (own.limit.min_rad, own.limit.max_rad));
        (joint.min_rad.max(shaft.0 - offset_rad), joint.max_rad.min(shaft.1 - offset_rad))
    }

    /// Refuses a table whose rows would take a servo's shaft out of the profile's range.
    pub(super) fn check_servo_spans(&self) -> Result<(), CommandError> {
        let Some(table) = self.table.as_deref() else { return Ok(()) };
        for (index, joint) in table.wiring().servos.iter().enumerate() {
            let (min_rad, max_rad) = self.range_rad(index, joint);
            let fits = |(low, high): (f32, f32)| min_rad <= low && high <= max_rad;
            if !table.servo_span_rad(index).is_none_or(fits) {
                return Err(CommandError::ServoRange { min_rad, max_rad });
            }
        }
        Ok(())
    }

    /// Sends the servos that have answered to the joint angles of a row.
    pub(super) fn command_servos(&mut self, row: u16, speed: f32) {
        let Some(table) = self.table.as_deref() else { return };
        let Some(row) = table.rows().get(usize::from(row)) else { return };
        let joints = table.wiring().servos.iter().zip(&row.servos);
        for ((joint, angle_rad), servo) in joints.zip(&mut self.servos) {
            if servo.answered.is_some() {
                servo.action = ServoAction::Go(target(joint, angle_rad + servo.offset_rad, speed));
            }
        }
    }
}

/// To this angle of the shaft, at this share of its speed.
fn target(joint: &ServoWiring, angle_rad: f32, speed: f32) -> ServoTarget {
    ServoTarget { angle_rad, speed_rad_s: joint.max_speed_rad_s * speed, torque: joint.max_torque }
}

/// Whether a servo has answered before and does not any more.
pub(super) fn is_silent(now: Micros, joint: &ServoWiring, answered: Option<Micros>) -> bool {
    answered.is_some_and(|answered| now - answered > Micros::from_millis(u32::from(joint.timeout_ms)))
}

pub(super) fn check_servo(now: Micros, servo: u8, joint: &ServoWiring, seen: &ServoSeen) -> Result<(), FaultKind> {
    if seen.answered.is_none() {
        return Ok(());
    }
    if is_silent(now, joint, seen.answered) {
        Err(FaultKind::ServoSilent { servo })
    } else if seen.error != 0 {
        Err(FaultKind::ServoError { servo, bits: seen.error })
    } else if seen.load > joint.max_torque {
        Err(FaultKind::ServoTorque { servo, load: seen.load })
    } else if !joint.keeps_range(seen.angle_rad) {
        Err(FaultKind::ServoRange { servo, angle_rad: seen.angle_rad })
    } else {
        Ok(())
    }
}
