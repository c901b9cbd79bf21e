//! Golden bytes of messages.

use super::{Answer, Calibration, Coordinates, Found, Refusal, Reply, Request};
use crate::sequencer::Event;
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
