//! Golden bytes of messages.

use super::{Answer, Calibration, Coordinates, Found, Refusal, Reply, Request, done, hello_protocol, is_stop};
use crate::sequencer::{Command, Event, FaultKind};
use crate::units::Micros;
use crate::wire::bootstrap::{CrashKind, CrashRecord};

#[test]
fn what_has_come_since_changes_no_bytes_of_what_there_was() {
    let mut bytes = [0; 64];
    let mut first = |request: Request| postcard::to_slice(&request, &mut bytes).map(|bytes| bytes[0]);
    assert_eq!((first(Request::Status), first(Request::Calibration)), (Ok(1), Ok(8)));
    assert_eq!(first(Request::Calibrate(Calibration::default())), Ok(7));
    let mut bytes = [0; 64];
    let refused = Reply { at: Micros(0), result: Err(Refusal::Storage) };
    assert_eq!(postcard::to_slice(&refused, &mut bytes).unwrap(), [0, 1, 12]);
    let refused = Reply { at: Micros(0), result: Err(Refusal::TooSoon { wait_ms: 300 }) };
    assert_eq!(postcard::to_slice(&refused, &mut bytes).unwrap(), [0, 1, 17, 0xac, 2]);
    let low = FaultKind::Supply { mv: 300, min_mv: 3 };
    assert_eq!(postcard::to_slice(&low, &mut bytes).unwrap(), [16, 0xac, 2, 3]);
}

#[test]
fn what_was_before_this_start_is_these_bytes() {
    let mut bytes = [0; 64];
    assert_eq!(postcard::to_slice(&Request::PastEvents { skip: 300 }, &mut bytes).unwrap(), [12, 0xac, 2]);
    assert_eq!(postcard::to_slice(&Request::PastCrash { back: 3 }, &mut bytes).unwrap(), [13, 3]);
    let mut list = heapless::Vec::new();
    list.extend([(Micros(7), Event::Finished), (Micros(6), Event::Booted)]);
    let events = Reply { at: Micros(5), result: Ok(Answer::PastEvents(list)) };
    assert_eq!(postcard::to_slice(&events, &mut bytes).unwrap(), [5, 0, 10, 2, 7, 3, 6, 0]);
    let text = "no".try_into().unwrap();
    let crash = CrashRecord { kind: CrashKind::Watchdog, uptime_us: 300, pc: 1, lr: 2, text };
    let crash = Reply { at: Micros(5), result: Ok(Answer::PastCrash(Some(crash))) };
    let encoded = postcard::to_slice(&crash, &mut bytes).unwrap();
    assert_eq!(encoded, [5, 0, 11, 1, 2, 0xac, 2, 1, 2, 2, b'n', b'o']);
    assert_eq!(postcard::from_bytes::<Reply>(encoded), Ok(crash));
}

#[test]
fn a_challenge_is_these_bytes_and_the_hello_of_every_version_begins_with_its_version() {
    let mut bytes = [0; 64];
    let challenge = 3 << 32 | 5;
    let hello = postcard::to_slice(&Request::Hello { protocol: 5, challenge }, &mut bytes).unwrap();
    assert_eq!((&*hello, hello_protocol(hello)), (&[0, 5, 0x85, 0x80, 0x80, 0x80, 0x30][..], Some(5)));
    let refused = Reply { at: Micros(5), result: Err(Refusal::Challenge { challenge }) };
    let refused = postcard::to_slice(&refused, &mut bytes).unwrap();
    assert_eq!(refused, [5, 1, 16, 0x85, 0x80, 0x80, 0x80, 0x30]);
    assert_eq!([&[0, 4][..], &[0, 6, 1, 2, 3], &[1], &[]].map(hello_protocol), [Some(4), Some(6), None, None]);
}

#[test]
fn a_pose_and_its_word_are_these_bytes() {
    let mut bytes = [0; 64];
    let pose = Coordinates { turn_rad: [0.0, 0.0, 1.0], position_m: [2.0, 0.0, -0.5] };
    let request = postcard::to_slice(&Request::Nearest(pose), &mut bytes).unwrap();
    assert_eq!(request, [9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0, 0, 0, 0, 0, 0xbf]);
    let word = "1101".parse().unwrap();
    let found = Found { word, distance_m: 1.0, error_m: 2.0, error_rad: 0.5 };
    let reply = Reply { at: Micros(5), result: Ok(Answer::Nearest(found)) };
    let reply = postcard::to_slice(&reply, &mut bytes).unwrap();
    assert_eq!(reply, [5, 0, 7, 4, 0x45, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0, 0x3f]);
}

/// Every payload of up to three bytes, and longer ones made of the bytes that matter: both decoders agree.
#[test]
fn a_payload_means_a_stop_exactly_where_the_request_does() {
    let means_stop = |payload: &[u8]| {
        matches!(postcard::take_from_bytes::<Request>(payload), Ok((Request::Command(Command::Stop), [])))
    };
    let mut stops = 0;
    let mut check = |payload: &[u8]| {
        assert_eq!(is_stop(payload), means_stop(payload), "{payload:?}");
        stops += usize::from(is_stop(payload));
    };
    for number in 0..1u32 << 24 {
        check(&number.to_le_bytes()[..3]);
    }
    let interesting = [0, 1, 6, 0x80, 0x81, 0x86];
    for len in 0..=8u32 {
        for number in 0..(interesting.len() as u32).pow(len) {
            let mut bytes = [0; 8];
            for (digit, byte) in (0..len).zip(&mut bytes) {
                *byte = interesting[(number / (interesting.len() as u32).pow(digit)) as usize % interesting.len()];
            }
            check(&bytes[..len as usize]);
        }
    }
    check(&[0x86, 0x80, 0x80, 0x80, 0, 0x81, 0x80, 0x80, 0x80, 0]);
    assert!(stops > 8, "{stops}");
}

#[test]
fn done_without_a_reply_is_the_same_bytes() {
    for at in [0, 1, 127, 128, 60_000_000, u64::MAX] {
        let mut bytes = [0; 64];
        let reply = Reply { at: Micros(at), result: Ok(Answer::Done) };
        assert_eq!(postcard::to_slice(&reply, &mut bytes).unwrap(), done(Micros(at)));
    }
    let mut bytes = [0; 64];
    assert_eq!(postcard::to_slice(&Request::Command(Command::Stop), &mut bytes).unwrap(), [6, 1]);
}
