//! Frames: tag, connection, number, payload and CRC in COBS between zero bytes.

use core::fmt;

/// Checksum of a body: CRC-32 of ISO HDLC, as in zip and Ethernet.
pub const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
/// Longest payload.
pub const MAX_PAYLOAD: usize = 300;
/// Bytes before the payload.
pub const HEADER: usize = 7;
/// Longest body.
pub const MAX_BODY: usize = HEADER + MAX_PAYLOAD + 4;
/// Longest frame on the line, with COBS's overhead and both zero bytes.
pub const MAX_FRAME: usize = MAX_BODY + MAX_BODY / 254 + 1 + 2;

/// What is before the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// What the payload is.
    pub tag: u8,
    /// The host's connection.
    pub link: u32,
    /// Number of the request.
    pub number: u16,
}

/// Why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// No valid COBS.
    Cobs,
    /// Shorter than the shortest or longer than the longest body.
    Length {
        /// Bytes of the body.
        len: usize,
    },
    /// The checksum differs: bytes were damaged on the way.
    Crc,
    /// The payload or the buffer for the frame does not suffice.
    TooLong,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cobs => f.write_str("the frame is no valid COBS"),
            Self::Length { len } => write!(f, "a body of {len} bytes is no frame"),
            Self::Crc => f.write_str("the checksum of the frame differs"),
            Self::TooLong => write!(f, "the payload of a frame is at most {MAX_PAYLOAD} bytes"),
        }
    }
}

impl core::error::Error for FrameError {}

/// Decodes what stood between two zero bytes, in place.
///
/// # Errors
///
/// [`FrameError::Cobs`]: the bytes are not valid COBS. [`FrameError::Length`]: the body is shorter or longer than any.
/// [`FrameError::Crc`]: the checksum differs.
pub fn decode(encoded: &mut [u8]) -> Result<(Header, &[u8]), FrameError> {
    let len = cobs::decode_in_place(encoded).map_err(|_| FrameError::Cobs)?;
    let body = encoded.get(..len).filter(|body| body.len() <= MAX_BODY);
    let Some((content, crc)) = body.and_then(<[u8]>::split_last_chunk) else {
        return Err(FrameError::Length { len });
    };
    let [tag, l0, l1, l2, l3, n0, n1, payload @ ..] = content else {
        return Err(FrameError::Length { len });
    };
    if CRC.checksum(content) != u32::from_le_bytes(*crc) {
        return Err(FrameError::Crc);
    }
    let header =
        Header { tag: *tag, link: u32::from_le_bytes([*l0, *l1, *l2, *l3]), number: u16::from_le_bytes([*n0, *n1]) };
    Ok((header, payload))
}

/// Writes a complete frame with both its zero bytes into `frame` and returns its length.
///
/// `frame` is best [`MAX_FRAME`] bytes long.
///
/// # Errors
///
/// [`FrameError::TooLong`]: the payload does not fit a body, or `frame` is too short.
pub fn encode(header: Header, payload: &[u8], frame: &mut [u8]) -> Result<usize, FrameError> {
    let mut body = heapless::Vec::<u8, MAX_BODY>::new();
    let mut append = |bytes: &[u8]| body.extend_from_slice(bytes).map_err(|_| FrameError::TooLong);
    append(&[header.tag])?;
    append(&header.link.to_le_bytes())?;
    append(&header.number.to_le_bytes())?;
    append(payload)?;
    let crc = CRC.checksum(&body);
    body.extend_from_slice(&crc.to_le_bytes()).map_err(|_| FrameError::TooLong)?;
    let [first, rest @ ..] = frame else { return Err(FrameError::TooLong) };
    let encoded = cobs::try_encode(&body, rest).map_err(|_| FrameError::TooLong)?;
    let last = rest.get_mut(encoded).ok_or(FrameError::TooLong)?;
    (*first, *last) = (0, 0);
    Ok(encoded.saturating_add(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER_OF_STATUS: Header = Header { tag: 0x10, link: 0x0403_0201, number: 0x0605 };
    /// Payload 2A 00; the checksum is that of Python's `binascii.crc32`.
    const FRAME: [u8; 16] = [0, 9, 0x10, 1, 2, 3, 4, 5, 6, 0x2A, 5, 174, 211, 208, 62, 0];

    #[test]
    fn golden_bytes_both_ways() {
        let mut frame = [0xA5; MAX_FRAME];
        let len = encode(HEADER_OF_STATUS, &[0x2A, 0], &mut frame).unwrap();
        assert_eq!(frame[..len], FRAME);
        let decoded = decode(&mut frame[1..len - 1]).unwrap();
        assert_eq!(decoded, (HEADER_OF_STATUS, &[0x2A, 0][..]));
    }

    #[test]
    fn any_flipped_bit_is_found() {
        for bit in 8..8 * 15 {
            let mut frame = FRAME;
            frame[bit / 8] ^= 1 << (bit % 8);
            assert!(decode(&mut frame[1..15]).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn longest_payload_fits() {
        let mut frame = [0; MAX_FRAME];
        let len = encode(HEADER_OF_STATUS, &[0xFF; MAX_PAYLOAD], &mut frame).unwrap();
        assert_eq!(decode(&mut frame[1..len - 1]).unwrap().1, [0xFF; MAX_PAYLOAD]);
        assert_eq!(encode(HEADER_OF_STATUS, &[0; MAX_PAYLOAD + 1], &mut frame), Err(FrameError::TooLong));
    }
}
