//! Tables at and beyond every limit of the arm, in frames that the board accepts.

use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;
use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, ServoWiring, SwitchLimit, Wiring};
use darm_core::sequencer::Command;
use darm_core::units::{DeviceId, Digest};
use darm_core::wire::message::{CHUNK, Request};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use super::request;
use crate::arm::{Table, TablePlan, draw_records};

/// Widens some limits of the wiring to the widest that a table may name at all, or moves lines to where nothing is wired.
fn widen(rng: &mut ChaCha8Rng, wiring: &mut Wiring) {
    let wide = CoilLimit { max_on_ms: 3_600_000, duty_percent: 100, window_ms: 3_600_000 };
    if rng.random() {
        wiring.coils.iter_mut().for_each(|coil| coil.limit = wide);
    }
    if rng.random() {
        wiring.switch_limit = SwitchLimit { new_coils: 16, window_ms: 1 };
    }
    for servo in wiring.servos.iter_mut().filter(|_| rng.random()) {
        (servo.min_rad, servo.max_rad) = (-3.2, 3.2);
        (servo.max_speed_rad_s, servo.timeout_ms) = (ServoWiring::MAX_SPEED_RAD_S, ServoWiring::MAX_TIMEOUT_MS);
    }
    if rng.random() {
        let shift = rng.random_range(1..64);
        wiring.coils.iter_mut().for_each(|coil| *coil = moved(coil, shift));
    }
    wiring.actuators.iter_mut().for_each(|actuator| actuator.switch = None);
}

fn moved(coil: &Coil, shift: u8) -> Coil {
    let to = |line: u8| (line + shift) % 64;
    let drive = match coil.drive {
        Drive::Hold { line } => Drive::Hold { line: to(line) },
        Drive::PeakHold { pull, hold, peak_ms } => Drive::PeakHold { pull: to(pull), hold: to(hold), peak_ms },
        Drive::Latch { set, reset, pulse_ms } => Drive::Latch { set: to(set), reset: to(reset), pulse_ms },
    };
    Coil { drive, ..*coil }
}

/// A table beyond some limits of this wiring that names the board's profile; `None` when none was found.
pub fn beyond(rng: &mut ChaCha8Rng, wiring: &Wiring, profile: Digest) -> Option<Table> {
    let mut wiring = wiring.clone();
    widen(rng, &mut wiring);
    let (model, rows) = (rng.random::<u64>() | 1, rng.random_range(2..30));
    let plan = TablePlan { wiring: &wiring, profile, model, rows, ends_under_way: false, device: None };
    if rng.random() {
        return Table::draw(rng, &plan);
    }
    Some(Table::of(&draw_records(rng, &plan, 0.5), model))
}

/// A table that differs from this wiring in one kind of limit or line; `None` when none was found.
pub fn recombined(rng: &mut ChaCha8Rng, wiring: &Wiring, profile: Digest) -> Option<Table> {
    let mut wiring = wiring.clone();
    let kind = rng.random_range(0..4u8);
    match kind {
        0 => exchange_resets(&mut wiring),
        1 => wiring.coils.iter_mut().for_each(lengthen),
        _ => {}
    }
    for servo in &mut wiring.servos {
        match kind {
            2 => servo.timeout_ms = ServoWiring::MAX_TIMEOUT_MS,
            // Tighter than any profile: below one step in a second.
            3 => servo.max_speed_rad_s = ServoWiring::MIN_SPEED_RAD_S,
            _ => {}
        }
    }
    of_changed(rng, &wiring, profile)
}

/// Each latch is reset by the line that resets the next one.
fn exchange_resets(wiring: &mut Wiring) {
    let reset = |coil: &Coil| if let Drive::Latch { reset, .. } = coil.drive { Some(reset) } else { None };
    let resets: Vec<u8> = wiring.coils.iter().filter_map(reset).collect();
    let mut next = resets.into_iter().cycle().skip(1);
    for coil in &mut wiring.coils {
        if let Drive::Latch { reset, .. } = &mut coil.drive {
            *reset = next.next().unwrap_or(*reset);
        }
    }
}

/// Its peak, or its pulse, lasts twice as long.
fn lengthen(coil: &mut Coil) {
    match &mut coil.drive {
        Drive::Hold { .. } => {}
        Drive::PeakHold { peak_ms, .. } => *peak_ms *= 2,
        Drive::Latch { pulse_ms, .. } => *pulse_ms *= 2,
    }
}

/// A table within all limits of this wiring that names a profile which the board never had.
pub fn of_another_profile(rng: &mut ChaCha8Rng, wiring: &Wiring) -> Option<Table> {
    let (model, rows) = (rng.random::<u64>() | 1, rng.random_range(2..30));
    let profile = Digest(rng.random());
    Table::draw(rng, &TablePlan { wiring, profile, model, rows, ends_under_way: false, device: None })
}

/// A table within all limits of this wiring that names the profile of the board and another device.
pub fn of_another_device(rng: &mut ChaCha8Rng, wiring: &Wiring, profile: Digest) -> Option<Table> {
    let (model, rows) = (rng.random::<u64>() | 1, rng.random_range(2..30));
    let device = Some(DeviceId(rng.random()));
    Table::draw(rng, &TablePlan { wiring, profile, model, rows, ends_under_way: false, device })
}

/// A table whose outputs count their duty over a window that is twice as long as that of the board's profile, which it names.
pub fn of_another_window(rng: &mut ChaCha8Rng, wiring: &Wiring, profile: Digest) -> Option<Table> {
    let mut wiring = wiring.clone();
    wiring.coils.iter_mut().for_each(|coil| coil.limit.window_ms *= 2);
    of_changed(rng, &wiring, profile)
}

/// A table whose limit switches are at the inputs behind those of the board's profile, which it names; `None` where the arm has no switch.
pub fn of_other_inputs(rng: &mut ChaCha8Rng, wiring: &Wiring, profile: Digest) -> Option<Table> {
    let mut wiring = wiring.clone();
    wiring.actuators.iter().find(|actuator| actuator.switch.is_some())?;
    wiring.actuators.iter_mut().filter_map(|actuator| actuator.switch.as_mut()).for_each(|switch| switch.input += 1);
    of_changed(rng, &wiring, profile)
}

fn of_changed(rng: &mut ChaCha8Rng, wiring: &Wiring, profile: Digest) -> Option<Table> {
    let (model, rows) = (rng.random::<u64>() | 1, rng.random_range(2..30));
    Table::draw(rng, &TablePlan { wiring, profile, model, rows, ends_under_way: false, device: None })
}

/// A table that a board without a profile takes: valves at the first lines, as the limits that are built in allow.
pub fn of_no_profile(rng: &mut ChaCha8Rng) -> Option<Table> {
    let count = rng.random_range(1..=4u8);
    let drives = (0..count).map(|line| Drive::Hold { line });
    let limit = CoilLimit { max_on_ms: 1_000, duty_percent: 10, window_ms: 10_000 };
    let wiring = Wiring {
        coils: (0..).zip(drives).map(|(output, drive)| Coil { output, drive, limit }).collect(),
        actuators: (0..count).map(|_| ActuatorWiring { states: 2, switch: None, travel_ms: 60 }).collect(),
        switch_limit: SwitchLimit { new_coils: 1, window_ms: 10 },
        ..Wiring::default()
    };
    let (model, rows) = (rng.random::<u64>() | 1, 2);
    Table::draw(
        rng,
        &TablePlan { wiring: &wiring, profile: Digest([0; 32]), model, rows, ends_under_way: false, device: None },
    )
}

/// A profile that allows what this one does not. Nobody holds the button: the board must refuse it.
pub fn wider_profile(rng: &mut ChaCha8Rng, wiring: &Wiring) -> UploadImage {
    let mut wiring = wiring.clone();
    widen(rng, &mut wiring);
    BoardProfile::of("wider", &wiring).image()
}

/// The frames that upload an image on an open connection and play it, with the numbers from `number` on.
pub fn frames(upload: &UploadImage, link: u32, mut number: u16) -> Vec<Vec<u8>> {
    let (image, bytes) = (upload.image(), upload.bytes());
    let mut requests = vec![Request::Command(Command::Clear), Request::Begin(image)];
    let offsets = (0..bytes.len()).step_by(CHUNK);
    requests.extend(bytes.chunks(CHUNK).zip(offsets).map(|(bytes, at)| Request::Chunk { offset: at as u32, bytes }));
    requests.extend([Request::Commit(image), Request::Command(Command::Play)]);
    let mut next = || {
        number = number.wrapping_add(1);
        number
    };
    requests.iter().map(|asked| request(link, next(), asked)).collect()
}
