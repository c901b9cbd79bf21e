//! What confirms a stop that the scanner has found on the line.
use darm_core::units::Micros;
use darm_core::wire::bootstrap::{ANSWER, Servos, Stopped};
use darm_core::wire::frame::{self, Header};
use darm_core::wire::message;
use darm_core::wire::scan::Stop;
use embassy_futures::yield_now;

use crate::control::Shared;

/// What confirms a stop on the line.
pub(crate) type Confirmation = heapless::Vec<u8, 80>;

const TYPED: &[u8] = b"ok\r\n";
const TYPED_OUTPUTS_ALONE: &[u8] = b"outputs off; servos are not controlled by this board now: cut their supply\r\n";

/// What confirms a stop, in its own language.
pub(crate) fn confirmation(stop: Stop, servos: Servos, now: Micros) -> Confirmation {
    match stop {
        Stop::Typed if servos == Servos::Uncontrolled => copied(TYPED_OUTPUTS_ALONE),
        Stop::Typed => copied(TYPED),
        Stop::Bootstrap(header) => framed(header, &Stopped::encode(servos)),
        Stop::Message(header) => framed(header, &message::done(now)),
    }
}

/// Waits until the outputs are off and the servos have their orders; what then confirms it.
pub(crate) async fn obeyed(stop: Stop, shared: &Shared<'_>, now: impl Fn() -> Micros) -> Confirmation {
    while !shared.has_stopped() {
        yield_now().await;
    }
    confirmation(stop, shared.servos(), now())
}

fn copied(bytes: &[u8]) -> Confirmation {
    Confirmation::from_slice(bytes).unwrap_or_default()
}

fn framed(header: Header, payload: &[u8]) -> Confirmation {
    let mut bytes = [0; 40];
    let len = frame::encode(Header { tag: header.tag | ANSWER, ..header }, payload, &mut bytes);
    copied(len.ok().and_then(|len| bytes.get(..len)).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use crate::port::{Item, Port};
    use darm_core::sequencer::Command;
    use darm_core::units::Micros;
    use darm_core::wire::bootstrap;
    use darm_core::wire::frame::{self, Header, MAX_FRAME, encode};
    use darm_core::wire::message::{REQUEST, Request};
    use darm_core::wire::scan::{Scanner, Stop};

    const HEADER: Header = Header { tag: bootstrap::Request::Stop.tag(), link: 0, number: 9 };
    const MESSAGE: Header = Header { tag: REQUEST, link: 0xdead_0000, number: 0xff00 };

    fn frame_of(header: Header, payload: &[u8]) -> Vec<u8> {
        let mut frame = [0; MAX_FRAME];
        let len = encode(header, payload, &mut frame).unwrap();
        frame[..len].to_vec()
    }

    fn stop_frames() -> [Vec<u8>; 2] {
        let mut payload = [0; 8];
        let message = postcard::to_slice(&Request::Command(Command::Stop), &mut payload).unwrap().to_vec();
        [frame_of(HEADER, &[]), frame_of(MESSAGE, &message)]
    }

    struct Random(u64);

    impl Random {
        fn below(&mut self, n: usize) -> usize {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as usize % n
        }
    }

    /// Whatever the parser takes for a stop the scanner has found with the same byte: nothing that means a stop can wait.
    #[test]
    fn the_parser_finds_no_stop_that_the_scanner_has_not_found() {
        let (mut random, frames) = (Random(3), stop_frames());
        let (mut scanner, mut port) = (Scanner::default(), Port::default());
        let mut parsed = 0;
        for _ in 0..40_000 {
            let piece: Vec<u8> = match random.below(8) {
                0 => frames[random.below(frames.len())].clone(),
                1 => b"stop".to_vec(),
                2 => b"\r".to_vec(),
                3 => vec![8; random.below(4)],
                4 => vec![b' '; [0, 1, 3, 40][random.below(4)]],
                5 => vec![0],
                6 => b"sto"[..random.below(4)].to_vec(),
                _ => vec![b"stopx \r\n\x7f\xff"[random.below(10)]],
            };
            for byte in piece {
                let found = scanner.push(byte);
                let means_stop = match port.push(byte, Micros(0)) {
                    Some(Item::Frame(encoded)) => frame::decode(encoded).is_ok_and(|(h, p)| Stop::of(h, p).is_some()),
                    Some(Item::Line(line)) => line.eq_ignore_ascii_case("stop"),
                    Some(Item::Dropped) | None => false,
                };
                parsed += usize::from(means_stop);
                assert!(found.is_some() || !means_stop);
            }
        }
        assert!(parsed > 500, "{parsed}");
    }
}
