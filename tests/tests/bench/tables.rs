//! Tables for a board with twelve valves.

use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;
use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, ServoWiring, Wiring};
use darm_core::table::{Record, Row, head};
use darm_core::units::{Micros, ModelHash, Word};

/// Time from one row to the next.
const ROW_MS: u32 = 300;

/// Twelve valves with limit switches, and one servo if wanted.
pub(crate) fn wiring(servo: bool) -> Wiring {
    let mut wiring = Wiring::default();
    for index in 0..12 {
        let drive = Drive::Hold { line: index };
        let switch = Some(LimitSwitch { input: index, closed_in: 0b10 });
        // Rated to be on for ever, so that nothing has to recover after power-up.
        let limit = CoilLimit { duty_percent: 100, ..drive.default_limit() };
        wiring.coils.push(Coil { output: index, drive, limit }).unwrap();
        wiring.actuators.push(ActuatorWiring { states: 2, switch, travel_ms: 200 }).unwrap();
    }
    if servo {
        let (max_speed_rad_s, max_torque, timeout_ms) = (2.0, 0.8, 500);
        let joint = ServoWiring { id: 1, min_rad: -1.5, max_rad: 1.5, max_speed_rad_s, max_torque, timeout_ms };
        wiring.servos.push(joint).unwrap();
    }
    wiring
}

/// The profile that allows this wiring.
pub(crate) fn profile(wiring: &Wiring) -> BoardProfile {
    BoardProfile::of("bench", wiring)
}

/// Words whose neighbours differ by one or two digits; the first is not the word at rest.
pub(crate) fn stepped(count: u32) -> Vec<Word> {
    let gray = |n: u32| n ^ n >> 1;
    let digits = |bits: u32| (0..12).map(|bit| (bits >> bit & 1) as u8).collect::<Vec<_>>();
    (1..=count).map(|n| Word::new(&digits(gray(n))).unwrap()).collect()
}

/// Angle of the servo in row `row`.
pub(crate) fn servo_angle_rad(row: usize) -> f32 {
    0.1 * row as f32
}

/// A table with these words in rows of [`ROW_MS`].
pub(crate) fn table(wiring: &Wiring, words: &[Word], model: ModelHash) -> UploadImage {
    table_with(wiring, words, model, &[])
}

/// The same with the frames of the arm's modules.
pub(crate) fn table_with(wiring: &Wiring, words: &[Word], model: ModelHash, modules: &[Record]) -> UploadImage {
    table_under(&profile(wiring), wiring, words, model, modules)
}

/// The same for a board with this profile.
pub(crate) fn table_under(
    profile: &BoardProfile,
    wiring: &Wiring,
    words: &[Word],
    model: ModelHash,
    modules: &[Record],
) -> UploadImage {
    let at = |row: usize| Micros::from_millis(ROW_MS * row as u32);
    let profile = profile.profile.digest;
    let mut records: Vec<Record> = head(wiring, model, None, profile).collect();
    records.extend(modules.iter().cloned());
    for (row, &word) in words.iter().enumerate() {
        let servos = wiring.servos.iter().map(|_| servo_angle_rad(row % 10)).collect();
        records.push(Record::Row(Row { at: at(row), word, servos }));
    }
    records.push(Record::End { at: at(words.len()) });
    UploadImage::table(&records, model)
}
