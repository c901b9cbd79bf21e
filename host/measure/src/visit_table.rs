//! From visits, or the words of a diagnosis, to a table with its visit file.

use darm_arm::arm::Arm;
use darm_arm::board_profile::{BoardProfile, longest_on_s};
use darm_arm::plan::{Plan, PlanError, Visit, plan, plan_with_rests};
use darm_core::output::Drive;
use darm_core::table::Record;
use darm_core::units::{DeviceId, Word};

use crate::visits::{Rest, Visits};

/// Default rest at a frame or word, where the limits allow it, s.
const DWELL_S: f64 = 1.0;
/// Where they do not: share of the longest on-time; the remainder is for travel and the next visit.
const DWELL_SHARE: f64 = 0.5;
/// Default rest at a word of a measurement plan, s: long enough for eight camera frames.
pub const MEASUREMENT_DWELL_S: f64 = 0.2;
/// Tolerance of angles in single precision.
const ROUNDING_RAD: f32 = 1e-5;

/// A visit and whether it is held out.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedVisit {
    /// The visit.
    pub visit: Visit,
    /// Whether no fit may see it.
    pub held_out: bool,
}

/// A row would move a servo out of the range of the board's profile.
#[derive(Debug, thiserror::Error)]
#[error(
    "row {row}, word {word}: servo {servo} ({name}) would go to {angle_deg:.1} deg, but the profile allows {min_deg:.1} to \
     {max_deg:.1} deg without a zero offset; choose an angle within the range, or correct the range in the profile"
)]
pub struct ServoError {
    row: usize,
    word: Word,
    servo: usize,
    name: String,
    angle_deg: f32,
    min_deg: f32,
    max_deg: f32,
}

/// Why visits make no table.
#[derive(Debug, thiserror::Error)]
pub enum VisitTableError {
    /// The board would refuse it.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A servo would leave its range.
    #[error(transparent)]
    Servo(#[from] ServoError),
}

/// What a table is made of.
#[derive(Clone, Copy, Debug)]
pub struct VisitTable<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// The profile of its board.
    pub profile: &'a BoardProfile,
    /// The only board that shall take the table.
    pub device: Option<DeviceId>,
    /// Records for the board's own search for a word.
    pub modules: &'a [Record],
    /// Whether the arm may rest between visits, so that limits of outputs are kept.
    pub may_rest: bool,
}

impl VisitTable<'_> {
    /// The table of these visits, and when the arm rests at each.
    ///
    /// # Errors
    ///
    /// The board would refuse the table, or a row moves a servo out of the range of the profile.
    pub fn of(&self, planned: &[PlannedVisit]) -> Result<(Plan, Visits), VisitTableError> {
        let visits: Vec<Visit> = planned.iter().map(|planned| planned.visit.clone()).collect();
        let make = if self.may_rest { plan_with_rests } else { plan };
        let plan = make(self.arm, &visits, &self.profile.board(self.device), self.modules)?;
        check_servos(self.arm, self.profile, &plan)?;
        let visits = visits_of(self.arm, planned, &plan);
        Ok((plan, visits))
    }
}

/// The default dwell, s: shorter where an output of the arm must not be on for that time.
pub fn default_dwell_s(arm: &Arm, profile: &BoardProfile) -> f64 {
    let outputs = arm.connections.iter().flat_map(|connection| &connection.outputs);
    let limits = outputs.filter_map(|&number| profile.profile.output(number));
    let holds = limits.filter(|output| !matches!(output.drive, Drive::Latch { .. }));
    let longest_s = holds.map(|output| longest_on_s(&output.limit));
    longest_s.map(|longest_s| DWELL_SHARE * longest_s).fold(DWELL_S, f64::min)
}

fn visits_of(arm: &Arm, planned: &[PlannedVisit], plan: &Plan) -> Visits {
    let mut previous = arm.rest();
    let rests = planned.iter().zip(&plan.windows).zip(&plan.rested).map(|((planned, &(from, to)), &rested)| {
        previous = if rested { arm.rest() } else { previous };
        let row = plan.rows.iter().rposition(|row| row.at < from).expect("the arm comes to rest after a row");
        let rest = Rest {
            label: planned.visit.label.clone(),
            from_s: from.0 as f64 * 1e-6,
            to_s: to.0 as f64 * 1e-6,
            row: row as u16,
            word: planned.visit.word,
            previous,
            servos_rad: planned.visit.servos_rad.clone(),
            held_out: planned.held_out,
        };
        previous = rest.word;
        rest
    });
    let table = plan.image.image().digest;
    Visits { model: arm.hash(), geometry: arm.geometry_hash(), table, rests: rests.collect() }
}

/// Rejects rows that move a servo out of the profile's range, which the board checks when it plays them. The range is
/// that of the shaft; without a zero offset in the servo it is also that of the joint.
fn check_servos(arm: &Arm, profile: &BoardProfile, plan: &Plan) -> Result<(), ServoError> {
    for (index, row) in plan.rows.iter().enumerate() {
        for (number, (&angle_rad, servo)) in row.servos.iter().zip(&profile.profile.servos).enumerate() {
            let (min_rad, max_rad) = (servo.limit.min_rad, servo.limit.max_rad);
            if angle_rad < min_rad - ROUNDING_RAD || angle_rad > max_rad + ROUNDING_RAD {
                let [angle_deg, min_deg, max_deg] = [angle_rad, min_rad, max_rad].map(f32::to_degrees);
                let (word, name) = (row.word, arm.servo_name(number));
                return Err(ServoError { row: index, word, servo: number, name, angle_deg, min_deg, max_deg });
            }
        }
    }
    Ok(())
}
