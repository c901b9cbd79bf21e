//! The bootstrap set: five requests that every firmware understands, specified by bytes. It never changes.
//!
//! | tag | request      | request payload          | answer payload (all numbers little-endian)                         |
//! |-----|--------------|--------------------------|--------------------------------------------------------------------|
//! | 01  | identify     | empty                    | `64 61 72 6D` ("darm"), 12 bytes device number, 16 bytes board name, zero-padded ASCII |
//! | 02  | version      | empty                    | 2 bytes protocol, 3 bytes firmware major, minor, patch             |
//! | 03  | stop         | empty                    | 1 byte 00: every coil is off; later firmware: a second byte, [`Servos`] |
//! | 04  | read fault   | empty                    | 1 byte kind (00 none, 01 panic, 02 hard fault, 03 watchdog), 8 bytes uptime in µs, 4 bytes pc, 4 bytes lr, 1 byte n ≤ 64, n bytes text |
//! | 05  | reboot       | 1 byte: 00 application, 01 the chip's loader | 1 byte 00: it reboots now; 01: not now, stop first |
//!
//! Later firmware may append bytes to an answer; a host ignores what follows the bytes that it knows.

use serde::{Deserialize, Serialize};

use crate::units::DeviceId;

/// An answer's tag is its request's with this bit.
pub const ANSWER: u8 = 0x80;
/// First bytes of the answer to identify.
pub const MAGIC: [u8; 4] = *b"darm";
/// Longest text of a crash.
pub const MAX_TEXT: usize = 64;
/// Longest payload of the set.
pub const MAX_PAYLOAD: usize = 18 + MAX_TEXT;

/// A request of the bootstrap set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Who are you?
    Identify,
    /// Which protocol and firmware do you have?
    Version,
    /// All coils off, at once.
    Stop,
    /// How did the firmware die last?
    ReadFault,
    /// Start again.
    Reboot(RebootTarget),
}

/// What a board starts into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RebootTarget {
    /// The firmware.
    Application,
    /// The chip's own loader.
    Loader,
}

impl Request {
    /// The tag of its frame.
    pub const fn tag(&self) -> u8 {
        match self {
            Self::Identify => 1,
            Self::Version => 2,
            Self::Stop => 3,
            Self::ReadFault => 4,
            Self::Reboot(_) => 5,
        }
    }

    /// Its payload.
    pub const fn payload(&self) -> &'static [u8] {
        match self {
            Self::Identify | Self::Version | Self::Stop | Self::ReadFault => &[],
            Self::Reboot(RebootTarget::Application) => &[0],
            Self::Reboot(RebootTarget::Loader) => &[1],
        }
    }

    /// The request of a frame; `None` when it is not one of this set.
    pub const fn decode(tag: u8, payload: &[u8]) -> Option<Self> {
        match (tag, payload) {
            (1, []) => Some(Self::Identify),
            (2, []) => Some(Self::Version),
            (3, []) => Some(Self::Stop),
            (4, []) => Some(Self::ReadFault),
            (5, [0]) => Some(Self::Reboot(RebootTarget::Application)),
            (5, [1]) => Some(Self::Reboot(RebootTarget::Loader)),
            _ => None,
        }
    }
}

/// Who a board is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// The chip's unique number.
    pub device: DeviceId,
    /// Name of the board.
    pub board: heapless::String<16>,
}

/// What a board runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    /// Version of the messages.
    pub protocol: u16,
    /// Major, minor, patch.
    pub firmware: [u8; 3],
}

/// What a stop did with the servos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Servos {
    /// The board's profile has none.
    Absent,
    /// They have the order to hold, or in the safe state what the profile says; the bus carries it to those that answer.
    Ordered,
    /// The board does not control them now: it is held after crashes.
    Uncontrolled,
}

/// What the answer to a stop says. That all coils are off is said by every firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped {
    /// `None`: earlier firmware, which does not say.
    pub servos: Option<Servos>,
}

impl Servos {
    /// The byte in the answer.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Absent => 0,
            Self::Ordered => 1,
            Self::Uncontrolled => 2,
        }
    }
}

impl Stopped {
    /// Bytes of the answer.
    pub fn encode(servos: Servos) -> [u8; 2] {
        [0, servos.byte()]
    }

    /// Reads the answer; `None` when it is no confirmation. A byte that is not known is no statement about the servos.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let (first, rest) = payload.split_first()?;
        if *first != 0 {
            return None;
        }
        let known = [Servos::Absent, Servos::Ordered, Servos::Uncontrolled];
        let servos = rest.first().and_then(|byte| known.into_iter().find(|servos| servos.byte() == *byte));
        Some(Self { servos })
    }
}

/// How the firmware died last.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrashRecord {
    /// By what.
    pub kind: CrashKind,
    /// Time since its start, in microseconds.
    pub uptime_us: u64,
    /// Program counter, 0 where it is not known.
    pub pc: u32,
    /// Link register, 0 where it is not known.
    pub lr: u32,
    /// What it said.
    pub text: heapless::String<MAX_TEXT>,
}

/// By what a firmware died.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CrashKind {
    /// A panic.
    Panic,
    /// A fault exception of the processor.
    HardFault,
    /// The watchdog was not fed.
    Watchdog,
}

/// An answer's payload.
pub type Payload = heapless::Vec<u8, MAX_PAYLOAD>;

fn joined(parts: &[&[u8]]) -> Payload {
    parts.iter().flat_map(|part| part.iter().copied()).take(MAX_PAYLOAD).collect()
}

impl Identity {
    /// Bytes of the answer.
    pub fn encode(&self) -> Payload {
        let mut board = [0; 16];
        board.iter_mut().zip(self.board.bytes()).for_each(|(to, from)| *to = from);
        joined(&[&MAGIC, &self.device.0, &board])
    }

    /// Reads the answer; `None` when it is not from a board of this kind.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let (magic, rest) = payload.split_first_chunk()?;
        let (device, rest) = rest.split_first_chunk()?;
        let (board, _) = rest.split_first_chunk::<16>()?;
        let name = core::str::from_utf8(board).ok()?.trim_end_matches('\0');
        (*magic == MAGIC).then_some(Self { device: DeviceId(*device), board: heapless::String::try_from(name).ok()? })
    }
}

impl Version {
    /// Bytes of the answer.
    pub fn encode(&self) -> Payload {
        joined(&[&self.protocol.to_le_bytes(), &self.firmware])
    }

    /// Reads the answer.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let (protocol, rest) = payload.split_first_chunk()?;
        let (firmware, _) = rest.split_first_chunk()?;
        Some(Self { protocol: u16::from_le_bytes(*protocol), firmware: *firmware })
    }
}

impl CrashRecord {
    /// Bytes of the answer: of no crash where `crash` is `None`.
    pub fn encode(crash: Option<&Self>) -> Payload {
        let Some(crash) = crash else {
            return joined(&[&[0; 18]]);
        };
        let kind = match crash.kind {
            CrashKind::Panic => 1,
            CrashKind::HardFault => 2,
            CrashKind::Watchdog => 3,
        };
        let text = crash.text.as_bytes();
        let (uptime, pc, lr) = (crash.uptime_us.to_le_bytes(), crash.pc.to_le_bytes(), crash.lr.to_le_bytes());
        joined(&[&[kind], &uptime, &pc, &lr, &[text.len() as u8], text])
    }

    /// Reads the answer: `Some(None)` for no crash, `None` when the bytes make no sense.
    pub fn decode(payload: &[u8]) -> Option<Option<Self>> {
        let (&kind, rest) = payload.split_first()?;
        let (uptime, rest) = rest.split_first_chunk()?;
        let (pc, rest) = rest.split_first_chunk()?;
        let (lr, rest) = rest.split_first_chunk()?;
        let (&len, rest) = rest.split_first()?;
        let kind = match kind {
            0 => return Some(None),
            1 => CrashKind::Panic,
            2 => CrashKind::HardFault,
            3 => CrashKind::Watchdog,
            _ => return None,
        };
        let text = core::str::from_utf8(rest.get(..usize::from(len))?).ok()?;
        Some(Some(Self {
            kind,
            uptime_us: u64::from_le_bytes(*uptime),
            pc: u32::from_le_bytes(*pc),
            lr: u32::from_le_bytes(*lr),
            text: heapless::String::try_from(text).ok()?,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_and_their_bytes_are_inverse() {
        let all = [Request::Identify, Request::Version, Request::Stop, Request::ReadFault]
            .into_iter()
            .chain([Request::Reboot(RebootTarget::Application), Request::Reboot(RebootTarget::Loader)]);
        for (request, tag) in all.zip([1, 2, 3, 4, 5, 5]) {
            assert_eq!(request.tag(), tag);
            assert_eq!(Request::decode(tag, request.payload()), Some(request));
        }
        assert_eq!(Request::decode(3, &[0]), None);
    }

    #[test]
    fn identity_is_frozen() {
        let identity = Identity {
            device: DeviceId([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]),
            board: heapless::String::try_from("B-L475E-IOT01A").unwrap(),
        };
        let bytes = b"darm\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\x0cB-L475E-IOT01A\0\0";
        assert_eq!(identity.encode(), bytes[..]);
        assert_eq!(Identity::decode(bytes), Some(identity));
    }

    #[test]
    fn version_is_frozen_and_may_grow() {
        let version = Version { protocol: 0x0201, firmware: [3, 4, 5] };
        assert_eq!(version.encode(), [1, 2, 3, 4, 5]);
        assert_eq!(Version::decode(&[1, 2, 3, 4, 5, 99]), Some(version));
    }

    #[test]
    fn the_first_byte_of_a_stop_is_frozen_and_the_second_is_about_servos() {
        assert_eq!(Stopped::encode(Servos::Ordered), [0, 1]);
        for servos in [Servos::Absent, Servos::Ordered, Servos::Uncontrolled] {
            let bytes = [&Stopped::encode(servos)[..], &[7]].concat();
            assert_eq!(Stopped::decode(&bytes), Some(Stopped { servos: Some(servos) }));
        }
        for unsaid in [&[0][..], &[0, 9]] {
            assert_eq!(Stopped::decode(unsaid), Some(Stopped { servos: None }));
        }
        assert_eq!((Stopped::decode(&[]), Stopped::decode(&[1, 1])), (None, None));
    }

    #[test]
    fn death_is_frozen() {
        let crash = CrashRecord {
            kind: CrashKind::Panic,
            uptime_us: 0x0102,
            pc: 3,
            lr: 4,
            text: heapless::String::try_from("hi").unwrap(),
        };
        let bytes = [1, 2, 1, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 2, b'h', b'i'];
        assert_eq!(CrashRecord::encode(Some(&crash)), bytes);
        assert_eq!(CrashRecord::decode(&bytes), Some(Some(crash)));
        assert_eq!(CrashRecord::encode(None), [0; 18]);
        assert_eq!(CrashRecord::decode(&[0; 18]), Some(None));
    }
}
