//! Packets of the STS bus, both ways.
//!
//! | bytes | meaning                                                    |
//! |-------|------------------------------------------------------------|
//! | FF FF | start                                                      |
//! | id    | address, 0 to 253                                          |
//! | n     | number of bytes that follow                                |
//! | code  | instruction of a request (02 read, 03 write), error bits of an answer |
//! | n − 2 | parameters                                                 |
//! | sum   | complement of the sum of all bytes after the start         |

/// Longest list of parameters in use: a register and ten values.
const MAX_PARAMETERS: usize = 12;
/// Start, address, length, code and checksum around the parameters.
const MAX_BYTES: usize = MAX_PARAMETERS + 6;
const START: u8 = 0xff;
const READ: u8 = 2;
const WRITE: u8 = 3;

/// One packet.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Packet {
    pub(super) id: u8,
    /// Instruction, or error bits.
    pub(super) code: u8,
    parameters: heapless::Vec<u8, MAX_PARAMETERS>,
}

impl Packet {
    /// Asks for `n` registers from `register` on.
    pub(super) fn read(id: u8, register: u8, n: u8) -> Self {
        Self { id, code: READ, parameters: first_of([register, n]) }
    }

    /// Writes registers from `register` on; what does not fit a packet is cut.
    pub(super) fn write(id: u8, register: u8, values: &[u8]) -> Self {
        let parameters = first_of(core::iter::once(register).chain(values.iter().copied()));
        Self { id, code: WRITE, parameters }
    }

    /// What a servo answers.
    #[cfg(test)]
    pub(super) fn answer(id: u8, error: u8, parameters: &[u8]) -> Self {
        Self { id, code: error, parameters: parameters.iter().copied().collect() }
    }

    pub(super) fn parameters(&self) -> &[u8] {
        &self.parameters
    }

    /// The bytes on the bus.
    pub(super) fn encode(&self) -> heapless::Vec<u8, MAX_BYTES> {
        let head = [START, START, self.id, self.len(), self.code];
        first_of(head.into_iter().chain(self.parameters.iter().copied()).chain([self.checksum()]))
    }

    fn len(&self) -> u8 {
        (self.parameters.len() as u8).saturating_add(2)
    }

    fn checksum(&self) -> u8 {
        let head = self.id.wrapping_add(self.len()).wrapping_add(self.code);
        !self.parameters.iter().fold(head, |sum, byte| sum.wrapping_add(*byte))
    }
}

/// The first bytes, as many as there is room for.
fn first_of<const N: usize>(bytes: impl IntoIterator<Item = u8>) -> heapless::Vec<u8, N> {
    let mut first = heapless::Vec::new();
    for byte in bytes {
        if first.push(byte).is_err() {
            break;
        }
    }
    first
}

/// Finds packets in bytes.
#[derive(Default)]
pub(super) struct Parser {
    bytes: heapless::Vec<u8, MAX_BYTES>,
}

impl Parser {
    /// Takes the next byte. Bytes that cannot belong to a packet go one by one, so a packet after noise is found.
    pub(super) fn push(&mut self, byte: u8) -> Option<Packet> {
        if self.bytes.push(byte).is_err() {
            self.bytes.clear();
        }
        loop {
            match self.look() {
                Look::Wait => return None,
                Look::Noise => {
                    self.bytes.remove(0);
                }
                Look::Packet(packet) => {
                    self.bytes.clear();
                    return Some(packet);
                }
            }
        }
    }

    fn look(&self) -> Look {
        match *self.bytes.as_slice() {
            [] | [START] | [START, START] => Look::Wait,
            [START, START, START, ..] => Look::Noise,
            [START, START, _] => Look::Wait,
            [START, START, id, n, ref rest @ ..] => look_inside(id, n, rest),
            _ => Look::Noise,
        }
    }
}

enum Look {
    Wait,
    Noise,
    Packet(Packet),
}

fn look_inside(id: u8, n: u8, rest: &[u8]) -> Look {
    let n = usize::from(n);
    if !(2..=MAX_PARAMETERS + 2).contains(&n) {
        return Look::Noise;
    }
    let Some(inside) = rest.get(..n) else { return Look::Wait };
    let [code, parameters @ .., sum] = inside else { return Look::Noise };
    let packet = Packet { id, code: *code, parameters: first_of(parameters.iter().copied()) };
    if packet.checksum() == *sum { Look::Packet(packet) } else { Look::Noise }
}

#[cfg(test)]
mod tests {
    use super::{Packet, Parser};

    /// Reading of 6 registers from 56 of servo 1, and an answer; by the rules of the memory table.
    const REQUEST: [u8; 8] = [0xff, 0xff, 1, 4, 2, 56, 6, 0xba];
    const ANSWER: [u8; 12] = [0xff, 0xff, 1, 8, 0, 0x00, 0x08, 0, 0, 0x2c, 0x01, 0xc1];

    fn parse(bytes: &[u8]) -> Vec<Packet> {
        let mut parser = Parser::default();
        bytes.iter().filter_map(|byte| parser.push(*byte)).collect()
    }

    #[test]
    fn a_request_has_these_bytes() {
        assert_eq!(Packet::read(1, 56, 6).encode(), REQUEST);
    }

    #[test]
    fn an_answer_is_found_after_noise() {
        for noise in [&[][..], &[0xff], &[0xff, 0xff, 0xff], &[0, 1, 2], &[0xff, 0xff, 9, 3, 0, 1, 1]] {
            let packets = parse(&[noise, &ANSWER].concat());
            assert_eq!(packets.len(), 1, "after {noise:?}");
            assert_eq!(packets[0].parameters(), [0, 8, 0, 0, 0x2c, 1]);
        }
    }

    #[test]
    fn a_damaged_answer_is_none() {
        for at in 0..ANSWER.len() {
            let mut bytes = ANSWER;
            bytes[at] ^= 0x10;
            assert!(parse(&bytes).is_empty(), "byte {at}");
        }
    }
}
