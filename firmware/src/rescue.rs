//! The console of a board that is held after crashes: the bootstrap set and `reboot`, nothing else.
//!
//! Neither the control tick nor the store runs, as either may be what crashes, nor the servo bus, whose limits are in the store. The
//! board answers version 0 of the messages: a host then identifies it, stops it, reads the crash record and reboots it, and asks
//! for nothing else. A stop is found as everywhere, in every form; its confirmation says that the outputs are off and that nobody
//! controls the servos.
use darm_core::wire::bootstrap::{self, ANSWER, CrashRecord, Payload, Request, Servos, Version};
use darm_core::wire::frame::{self, Header};
use darm_core::wire::scan::Scanner;
use embassy_futures::yield_now;
use embedded_io_async::{Read, Write};

use crate::clock::Clock;
use crate::dispatch::{Board, FIRMWARE};
use crate::port::{Item, Port};
use crate::scan::confirmation;

/// Version of the messages of a held board: the bootstrap set alone.
pub const RECOVERY_PROTOCOL: u16 = 0;

/// Bytes of the longest answer on the line: header, payload, checksum, COBS's overhead and both zero bytes.
const MAX_ANSWER: usize = frame::HEADER + bootstrap::MAX_PAYLOAD + 4 + 1 + 2;

const HELP: &str =
    "outputs disabled after several crashes in a row, servos not controlled; read the fault, then: reboot\r\n";
const REBOOTS: &str = "ok, reboots\r\n";
const NO_LOADER: &str = "refused: close the jumper of the board first\r\n";

/// Serves the bootstrap set until somebody asks for a reboot; what the board is to start into. No tick looks at the button
/// here: that it is closed allows the loader.
pub async fn serve(
    board: &Board<'_>,
    is_button_closed: impl Fn() -> bool,
    clock: &impl Clock,
    reader: &mut impl Read,
    writer: &mut impl Write,
) -> bootstrap::RebootTarget {
    let allows = |into| into != bootstrap::RebootTarget::Loader || !board.guards_loader || is_button_closed();
    let (mut scanner, mut port) = (Scanner::default(), Port::default());
    let mut bytes = [0; 16];
    loop {
        let n = reader.read(&mut bytes).await.unwrap_or(0);
        if n == 0 {
            // A port that fails at once must not keep the processor from what else the board does.
            yield_now().await;
        }
        for &byte in bytes.iter().take(n) {
            if let Some(stop) = scanner.push(byte) {
                // Every output is disabled already.
                let _ = writer.write_all(&confirmation(stop, Servos::Uncontrolled, clock.now())).await;
                port = Port::default();
                continue;
            }
            let into = match port.push(byte, clock.now()) {
                Some(Item::Frame(encoded)) => answer(board, &allows, encoded, writer).await,
                Some(Item::Line(line)) => execute(&allows, line, writer).await,
                Some(Item::Dropped) | None => None,
            };
            if let Some(into) = into {
                // The board reboots whether the answer leaves or not.
                let _ = writer.flush().await;
                return into;
            }
        }
    }
}

/// Answers a frame of the bootstrap set; what to start into, if it asks for that. A failed write has no reader.
async fn answer(
    board: &Board<'_>,
    allows: &impl Fn(bootstrap::RebootTarget) -> bool,
    encoded: &mut [u8],
    writer: &mut impl Write,
) -> Option<bootstrap::RebootTarget> {
    let (header, payload) = frame::decode(encoded).ok()?;
    let request = Request::decode(header.tag, payload)?;
    let into = if let Request::Reboot(into) = request { Some(into) } else { None };
    let is_refused = into.is_some_and(|into| !allows(into));
    let payload = if is_refused { [1].into_iter().collect() } else { reply(board, request) };
    let mut bytes = [0; MAX_ANSWER];
    let len = frame::encode(Header { tag: header.tag | ANSWER, ..header }, &payload, &mut bytes).ok()?;
    let _ = writer.write_all(bytes.get(..len)?).await;
    into.filter(|_| !is_refused)
}

fn reply(board: &Board, request: Request) -> Payload {
    match request {
        Request::Identify => board.identity.encode(),
        Request::Version => Version { protocol: RECOVERY_PROTOCOL, firmware: FIRMWARE }.encode(),
        Request::ReadFault => CrashRecord::encode(board.crash.as_ref()),
        Request::Reboot(_) => [0].into_iter().collect(),
        // The scanner has found and confirmed it.
        Request::Stop => Payload::new(),
    }
}

async fn execute(
    allows: &impl Fn(bootstrap::RebootTarget) -> bool,
    line: &str,
    writer: &mut impl Write,
) -> Option<bootstrap::RebootTarget> {
    let asked = match line {
        "reboot" => Some(bootstrap::RebootTarget::Application),
        "reboot loader" => Some(bootstrap::RebootTarget::Loader),
        _ => None,
    };
    let into = asked.filter(|into| allows(*into));
    let text = match (asked, into) {
        (_, Some(_)) => REBOOTS,
        (Some(_), None) => NO_LOADER,
        (None, None) => HELP,
    };
    let _ = writer.write_all(text.as_bytes()).await;
    into
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::fakes::{HandClock, caps, run};
    use core::convert::Infallible;
    use darm_core::units::DeviceId;
    use darm_core::wire::bootstrap::{CrashKind, Identity};
    use darm_core::wire::frame::MAX_FRAME;
    use darm_core::wire::health::Health;
    use embedded_io_async::ErrorType;

    /// Everything that the host sends, and what the board wrote.
    struct Line(Vec<u8>);

    impl ErrorType for Line {
        type Error = Infallible;
    }
    impl Read for Line {
        async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
            assert!(!self.0.is_empty(), "the board reads on after the last request");
            let n = bytes.len().min(self.0.len());
            bytes[..n].copy_from_slice(&self.0[..n]);
            self.0.drain(..n);
            Ok(n)
        }
    }
    impl Write for Line {
        async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
            self.0.extend_from_slice(bytes);
            Ok(bytes.len())
        }
        async fn flush(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }

    fn board() -> Board<'static> {
        let identity = Identity { device: DeviceId([7; 12]), board: heapless::String::try_from("test").unwrap() };
        let text = heapless::String::try_from("why").unwrap();
        let crash = Some(CrashRecord { kind: CrashKind::Watchdog, uptime_us: 1, pc: 2, lr: 3, text });
        Board { identity, crash, caps: caps(), guards_loader: true, health: Health::default, kept: None }
    }

    /// What the board answers to these bytes, and into what it reboots.
    fn exchange(sent: &[u8]) -> (Vec<u8>, bootstrap::RebootTarget) {
        exchange_with(true, sent)
    }

    fn exchange_with(closed: bool, sent: &[u8]) -> (Vec<u8>, bootstrap::RebootTarget) {
        let (mut reader, mut writer) = (Line(sent.to_vec()), Line(Vec::new()));
        let into = run(serve(&board(), || closed, &HandClock::default(), &mut reader, &mut writer), || {});
        (writer.0, into)
    }

    fn frame_of(tag: u8, payload: &[u8]) -> Vec<u8> {
        let mut bytes = [0; MAX_FRAME];
        let len = frame::encode(Header { tag, link: 1, number: 2 }, payload, &mut bytes).unwrap();
        bytes[..len].to_vec()
    }

    #[test]
    fn the_bootstrap_set_is_answered_and_ends_with_a_reboot() {
        let Board { identity, crash, .. } = board();
        let requests = [
            Request::Identify,
            Request::Version,
            Request::Stop,
            Request::ReadFault,
            Request::Reboot(bootstrap::RebootTarget::Loader),
        ];
        let sent: Vec<u8> = requests.iter().flat_map(|request| frame_of(request.tag(), request.payload())).collect();
        let version = Version { protocol: 0, firmware: FIRMWARE };
        let payloads = [
            identity.encode(),
            version.encode(),
            Payload::from_slice(&[0, 2]).unwrap(),
            CrashRecord::encode(crash.as_ref()),
        ];
        let answers = payloads.iter().zip(1..).flat_map(|(payload, tag): (_, u8)| frame_of(tag | ANSWER, payload));
        let expected: Vec<u8> = answers.chain(frame_of(5 | ANSWER, &[0])).collect();
        assert_eq!(exchange(&sent), (expected, bootstrap::RebootTarget::Loader));
    }

    #[test]
    fn a_person_reads_why_and_reboots() {
        let (text, into) = exchange(b"play\rreboot\r");
        assert_eq!(
            (String::from_utf8(text).unwrap(), into),
            (format!("{HELP}{REBOOTS}"), bootstrap::RebootTarget::Application)
        );
    }

    #[test]
    fn every_form_of_a_stop_is_confirmed_and_says_that_nobody_controls_the_servos() {
        let message = frame_of(0x10, &[6, 1]);
        let noise = [&b"\0\x07abc"[..], &[0x55; 400]].concat();
        let sent = [&noise, &b"\rxstop\r"[..], &noise, &frame_of(3, &[]), &noise, &message, b"reboot\r"].concat();
        let typed = b"outputs off; servos are not controlled by this board now: cut their supply\r\n";
        let done = darm_core::wire::message::done(darm_core::units::Micros(0));
        let expected = [&typed[..], &frame_of(0x83, &[0, 2]), &frame_of(0x90, &done), REBOOTS.as_bytes()].concat();
        assert_eq!(String::from_utf8_lossy(&exchange(&sent).0), String::from_utf8_lossy(&expected));
    }

    #[test]
    fn a_guarded_loader_is_entered_only_while_the_button_is_closed() {
        let request = Request::Reboot(bootstrap::RebootTarget::Loader);
        let sent = [&frame_of(request.tag(), request.payload()), &b"reboot loader\rreboot\r"[..]].concat();
        let expected = [&frame_of(request.tag() | ANSWER, &[1]), NO_LOADER.as_bytes(), REBOOTS.as_bytes()].concat();
        assert_eq!(exchange_with(false, &sent), (expected, bootstrap::RebootTarget::Application));
    }

    #[test]
    fn requests_beyond_the_bootstrap_set_are_not_answered() {
        let sent = [frame_of(0x10, &[0]), frame_of(9, &[]), b"\0\x01\x02\0".to_vec(), b"reboot\r".to_vec()].concat();
        assert_eq!(exchange(&sent).0, REBOOTS.as_bytes());
    }
}
