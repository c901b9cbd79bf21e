//! How fast an image gets to a board over a serial line: the firmware's library in virtual time behind a line of 115200
//! baud, with the flash's times of erasing and programming.
//!
//! The *wire rate* is what the host puts on the line, the *stored rate* the image, both over the complete upload (begin,
//! pieces, check, the record that makes it valid) and as shares of the line's 11 520 bytes/s. Of the 277 bytes of a piece
//! on the line 256 are the image's.

use anyhow::Result;
use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;
use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, ServoWiring, Wiring};
use darm_core::table::{MAX_ROWS, Record, Row, head};
use darm_core::units::{Micros, ModelHash, Word};
use darm_device::client::Client;
use darm_device::link::paced::{Line, Paced};
use darm_figures::figure::Figure;
use darm_sim::in_process::{InProcess, MemoryFlash};
use darm_sim::plant::Plant;

const BAUD: u32 = 115_200;
/// Seeds of a line with losses.
const SEEDS: u64 = 100;
/// Time between rows, ms: longer than an actuator travels.
const ROW_MS: u64 = 200;
const ACTUATORS: u8 = 16;
const SERVOS: u8 = 4;

/// A line and the words that name it.
const LINES: [(&str, f64, f64); 4] = [
    ("115200 baud", 0.0, 0.0),
    ("10 ms each way", 0.01, 0.0),
    ("1 % of frames lost", 0.0, 0.01),
    ("10 ms each way, 1 % lost", 0.01, 0.01),
];

/// Wire rate and stored rate over each line.
pub(super) fn measure() -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for (name, delay_s, lost) in LINES {
        let seeds = if lost > 0.0 { SEEDS } else { 1 };
        let rates = rates(Line { baud: BAUD, delay_s, lost }, seeds)?;
        figures.push(Figure::new(&format!("upload, {name}: wire rate"), 100.0 * rates.wire, "% of the line")?);
        figures.push(Figure::new(&format!("upload, {name}: stored rate"), 100.0 * rates.stored, "% of the line")?);
        if delay_s == 0.0 && lost == 0.0 {
            let bytes_s = (rates.stored / Line { baud: BAUD, delay_s, lost }.byte_s()).round();
            figures.push(Figure::new("upload, 115200 baud: stored", bytes_s, "bytes/s")?);
        }
    }
    figures.push(Figure::new("upload: bytes of the image", f64::from(longest_table().image().len), "bytes")?);
    Ok(figures)
}

/// As shares of the line.
struct Rates {
    wire: f64,
    stored: f64,
}

/// The rates of as many uploads together.
fn rates(line: Line, seeds: u64) -> Result<Rates> {
    let image = longest_table();
    let mut all = Upload::default();
    for seed in 0..seeds {
        let one = upload(&image, line, seed)?;
        (all.sent_bytes, all.time_s) = (all.sent_bytes + one.sent_bytes, all.time_s + one.time_s);
    }
    let stored_bytes = seeds * u64::from(image.image().len);
    let [wire, stored] = [all.sent_bytes, stored_bytes].map(|bytes| bytes as f64 * line.byte_s() / all.time_s);
    Ok(Rates { wire, stored })
}

/// What uploads took.
#[derive(Default)]
struct Upload {
    /// Bytes that the host put on the line.
    sent_bytes: u64,
    time_s: f64,
}

fn upload(image: &UploadImage, line: Line, seed: u64) -> Result<Upload> {
    let flash = MemoryFlash::with_profile(&profile().image());
    flash.keep_times();
    let board = InProcess::boot(Plant::new(&wiring(), &[0.0; SERVOS as usize]), flash)?;
    let mut client = Client::connect_as(Box::new(Paced::new(board.link(), line, seed)), 1 + seed as u32)?;
    let (start_s, sent_before) = (board.now_s(), client.counts().sent_bytes);
    client.upload(image, &mut |_| {})?;
    Ok(Upload { sent_bytes: client.counts().sent_bytes - sent_before, time_s: board.now_s() - start_s })
}

/// As many rows as a board takes, with the servos that a row can have.
fn longest_table() -> UploadImage {
    let (wiring, model) = (wiring(), ModelHash(9));
    let profile = profile().profile.digest;
    let mut records: Vec<Record> = head(&wiring, model, None, profile).collect();
    for row in 0..MAX_ROWS as u64 {
        let mut digits = [0; ACTUATORS as usize];
        digits[row as usize % digits.len()] = 1;
        let word = Word::new(&digits).expect("as many digits as a word has");
        let servos = [0.1; SERVOS as usize].into_iter().collect();
        records.push(Record::Row(Row { at: Micros(1000 * ROW_MS * row), word, servos }));
    }
    records.push(Record::End { at: Micros(1000 * ROW_MS * MAX_ROWS as u64) });
    UploadImage::table(&records, model)
}

fn profile() -> BoardProfile {
    BoardProfile::of("upload", &wiring())
}

fn wiring() -> Wiring {
    let mut wiring = Wiring::default();
    for index in 0..ACTUATORS {
        let drive = Drive::Hold { line: index };
        let limit = CoilLimit { duty_percent: 100, ..drive.default_limit() };
        wiring.coils.push(Coil { output: index, drive, limit }).expect("fewer coils than lines");
        let actuator = ActuatorWiring { states: 2, switch: None, travel_ms: 100 };
        wiring.actuators.push(actuator).expect("fewer actuators than digits");
    }
    for index in 0..SERVOS {
        let (max_speed_rad_s, max_torque, timeout_ms) = (2.0, 0.8, 100);
        let servo = ServoWiring { id: 1 + index, min_rad: -1.5, max_rad: 1.5, max_speed_rad_s, max_torque, timeout_ms };
        wiring.servos.push(servo).expect("as many servos as a board has");
    }
    wiring
}

#[cfg(test)]
mod tests {
    use super::{BAUD, LINES, rates};
    use darm_device::link::paced::Line;

    /// 90 % on the line, of which the pieces' own overhead leaves 256 of 278 bytes.
    #[test]
    fn an_upload_fills_the_line() {
        for (name, delay_s, lost) in LINES {
            let rates = rates(Line { baud: BAUD, delay_s, lost }, if lost > 0.0 { 10 } else { 1 }).unwrap();
            assert!(rates.wire >= 0.9 && rates.wire <= 1.0, "{name}: {}", rates.wire);
            assert!(rates.stored >= 0.9 * 256.0 / 278.0 && rates.stored <= rates.wire, "{name}: {}", rates.stored);
        }
    }
}
