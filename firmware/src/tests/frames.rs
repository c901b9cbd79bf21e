//! Damaged, random and valid frames and lines: nothing panics, and what is damaged changes nothing.

use darm_core::sequencer::Command;
use darm_core::units::{Micros, Word};
use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::message::{Answer, CHUNK, Calibration, REQUEST, Refusal, Request, Status};

use super::fakes::{profile, profile_image, table};
use super::nearest::along;
use super::{Bench, LINK, loaded};
use crate::port::{Item, Port};

/// Feeds bytes as they come from the line.
fn feed(bench: &Bench, port: &mut Port, bytes: &[u8]) {
    for byte in bytes {
        match port.push(*byte, Micros(bench.clock.0.get())) {
            Some(Item::Frame(encoded)) => drop(bench.frame(encoded)),
            Some(Item::Line(line)) => drop(bench.type_line(line)),
            Some(Item::Dropped) | None => {}
        }
    }
}

/// What an invalid frame must not change.
fn state(bench: &Bench) -> (Status, Result<Answer, Refusal>) {
    let status = Status { bad_frames: 0, ..bench.status() };
    (status, bench.ask(Request::Begin(table(2, 20, false).0)))
}

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n
    }
}

/// A real frame of any kind.
fn any_frame(random: &mut Random) -> Vec<u8> {
    let (image, bytes) = table(2, 20, false);
    let chunk = bytes.chunks(CHUNK).next().unwrap();
    let requests = [
        Request::Status,
        Request::Events { from: random.below(99) as u32 },
        Request::Begin(image),
        Request::Chunk { offset: random.below(300) as u32, bytes: chunk },
        Request::Commit(image),
        Request::Command(Command::Play),
        Request::Command(Command::Coil { coil: random.below(9) as u8, on_ms: 10 }),
        Request::Calibration,
        Request::Nearest(along(random.below(9) as f32, f32::from_bits(random.below(1 << 32) as u32))),
        Request::Hello { protocol: random.below(8) as u16, challenge: random.below(3) as u64 },
        Request::Begin(profile_image(&profile()).0),
        Request::Commit(profile_image(&profile()).0),
        Request::Outputs { from: random.below(256) as u8 },
        Request::Calibrate(Calibration::try_from([1e-3 * random.below(3000) as f32; 4]).unwrap()),
        Request::Command(Command::Stop),
        Request::Command(Command::Clear),
        Request::Command(Command::Word(Word::new(&[random.below(4) as u8; 2]).unwrap())),
        Request::Command(Command::Servo {
            servo: random.below(5) as u8,
            angle_rad: f32::from_bits(random.below(1 << 32) as u32),
        }),
    ];
    let mut payload = [0; MAX_PAYLOAD];
    let payload = postcard::to_slice(&requests[random.below(requests.len())], &mut payload).unwrap();
    let mut frame = [0; MAX_FRAME];
    let number = random.below(1 << 16) as u16;
    let len = frame::encode(Header { tag: REQUEST, link: LINK, number }, payload, &mut frame).unwrap();
    frame[..len].to_vec()
}

/// A number from an environment variable, or the one given.
fn number(variable: &str, otherwise: usize) -> usize {
    std::env::var(variable).map_or(otherwise, |text| text.parse().unwrap())
}

/// How many frames and lines the hostile tests send: 20 000, or as many as the environment variable `DARM_FRAMES` says.
fn rounds() -> usize {
    number("DARM_FRAMES", 20_000)
}

/// Seeds of the two tests; `DARM_SEED` moves both.
fn random(first: u64) -> Random {
    Random(first + 2 * number("DARM_SEED", 0) as u64)
}

#[test]
fn damaged_frames_change_nothing() {
    let bench = loaded();
    let mut random = random(1);
    let before = state(&bench);
    for round in 0..rounds() {
        let mut bytes = any_frame(&mut random);
        // CRC-32 finds every burst of up to 32 bits; COBS may spread one byte over two.
        let at = 1 + random.below(bytes.len() - 2);
        bytes[at] ^= 1 + random.below(255) as u8;
        let len = bytes.len();
        if !bytes[1..len - 1].contains(&0) {
            assert_eq!(bench.frame(&mut bytes[1..len - 1]), None, "round {round}");
        }
        if round % 100 == 0 {
            assert_eq!(state(&bench), before, "round {round}");
        }
    }
    let dropped = bench.status().bad_frames as usize;
    assert!(dropped > rounds() / 4 * 3);
    println!("FIGURE damaged frames dropped without a change of state = {dropped} frames");
}

#[test]
fn noise_frames_and_lines_do_not_panic() {
    let bench = loaded();
    let (mut port, mut random) = (Port::default(), random(2));
    let words = [
        "coil",
        "word",
        "servo",
        "on",
        "off",
        "99999999999",
        "-1",
        "nan",
        "0101",
        "status",
        "log",
        "limits",
        "stop",
        "nearest",
    ];
    for _ in 0..rounds() {
        match random.below(4) {
            0 => {
                let noise: Vec<u8> = (0..random.below(40)).map(|_| random.below(256) as u8).collect();
                feed(&bench, &mut port, &noise);
            }
            1 => {
                let line: Vec<_> = (0..random.below(5)).map(|_| words[random.below(words.len())]).collect();
                feed(&bench, &mut port, line.join(" ").as_bytes());
                feed(&bench, &mut port, b"\r");
            }
            2 => feed(&bench, &mut port, &any_frame(&mut random)),
            _ => {
                let mut bytes = any_frame(&mut random);
                bytes.truncate(random.below(bytes.len()) + 1);
                feed(&bench, &mut port, &bytes);
            }
        }
    }
    feed(&bench, &mut port, b"\0\0");
    bench.pass_ms(200);
    assert!(bench.open(5, 1).is_ok());
    assert_eq!(bench.ask_as(5, 2, Request::Command(Command::Stop)), Some(Ok(Answer::Done)));
    println!("FIGURE random and mutated frames and lines without a panic = {} pieces", rounds());
}

/// A host that was started again may count from the start on the same connection.
#[test]
fn another_change_with_the_number_of_the_last_one_is_not_answered_as_done() {
    let bench = loaded();
    let ask = |number, command| bench.ask_as(5, number, Request::Command(command)).unwrap();
    assert!(bench.open(5, 0).is_ok());
    assert_eq!([ask(3, Command::Play), ask(3, Command::Play)], [Ok(Answer::Done), Ok(Answer::Done)]);
    for number in [3, 2] {
        assert_eq!(ask(number, Command::Clear), Err(Refusal::NotConnected));
    }
    bench.pass_ms(50);
    assert_eq!(ask(3, Command::Stop), Ok(Answer::Done));
    bench.pass_ms(5);
    assert_eq!(bench.outputs.get().lines, 0, "a stop is never refused");
}
