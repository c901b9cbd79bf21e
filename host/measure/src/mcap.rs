//! MCAP containers: the records that a log of measurements needs, byte by byte. [`write`] writes them.
//!
//! A container is [`MAGIC`], records, [`MAGIC`]. A record is an opcode, its length (u64) and its content; numbers are
//! little-endian, a text is its length (u32) and its bytes, a map the length of its bytes (u32) and texts in pairs.
//!
//! | opcode | record | content |
//! | --- | --- | --- |
//! | 1 | header | profile, library |
//! | 2 | footer | where the summary begins (u64), its offsets (u64), CRC of the summary and these (u32) |
//! | 3 | schema | id (u16), name, encoding, data (u32 and bytes) |
//! | 4 | channel | id (u16), schema's id (u16), topic, encoding of its messages, map |
//! | 5 | message | channel's id (u16), sequence (u32), log time and publish time (u64, ns), data |
//! | 6 | chunk | times (2 × u64), size (u64), CRC (u32), compression, records (u64 and bytes) |
//! | 7 | message index | channel's id (u16), log time and place in the chunk of each message (u32 bytes of 2 × u64) |
//! | 8, 13 | index of a chunk, of a metadata record | where it is in the file |
//! | 11 | statistics | counts, first and last time |
//! | 12 | metadata | name, map |
//! | 14 | summary offset | where the summary's records of one kind are |
//! | 15 | end of data | CRC of all bytes before it (u32) |
//!
//! What is read passes over indices, attachments and statistics, and compares every CRC that is not 0 (none). Chunks may be
//! plain, `zstd` or `lz4`. Source: MCAP format
//! specification, mcap.dev/spec, version 0.

mod write;

use std::collections::BTreeMap;
use std::io::Read;

use crc::{CRC_32_ISO_HDLC, Crc};
use darm_robot::files::Limits;

pub use write::Writer;

/// What a container begins and ends with.
pub const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];
/// The check sum of chunks, data and summary.
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Most keys of the metadata of a log.
const MAX_METADATA: usize = 10_000;

/// Why bytes are no container.
#[derive(Debug, thiserror::Error)]
pub enum McapError {
    /// They do not begin as one.
    #[error("the file does not begin as an MCAP log does")]
    Magic,
    /// A record reaches over the end, or the end is missing.
    #[error("the log ends in the middle of a record, after {0} complete messages: was it closed?")]
    Cut(usize),
    /// A compression that is not known.
    #[error("its chunks are in the compression `{0}`, known are none, zstd and lz4; record it with one of these")]
    Compression(String),
    /// Parts that cannot be read, where all are needed.
    #[error("the log is damaged: {0}; use another copy")]
    Lost(String),
    /// Chunks that expand to more than memory is given for.
    #[error("the log has more messages or metadata, or its chunks expand to more bytes, than are read; split the log")]
    TooLarge,
    /// A chunk in a chunk, which the format does not know.
    #[error("a chunk is inside another one: the log is damaged")]
    Nested,
    /// Bytes that have changed since they were written.
    #[error("the check sum of {0} does not match: the log is damaged, use another copy")]
    Damaged(&'static str),
    /// A message of a channel that no record describes.
    #[error("a message belongs to channel {0}, which no record declares")]
    Channel(u16),
}

/// Where messages of one kind go.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name.
    pub topic: String,
    /// How its messages are written: `json`, say.
    pub encoding: String,
    /// Name of the schema of its messages; empty where it has none.
    pub schema: String,
}

/// One message.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Number of its channel.
    pub channel: u16,
    /// When it was logged, ns.
    pub log_time: u64,
    /// What it says.
    pub data: Vec<u8>,
}

/// What is in a container.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// The channels, by their numbers.
    pub channels: BTreeMap<u16, Channel>,
    /// The messages, in the order of the file.
    pub messages: Vec<Message>,
    /// Keys and values of all metadata records; of one that comes again the last.
    pub metadata: BTreeMap<String, String>,
    /// What of it is damaged and was left out, with its place.
    pub damaged: Vec<String>,
    /// Chunks so far.
    n_chunks: usize,
    /// Whether it has messages that no check sum but that of all data covers.
    has_unchecked: bool,
    /// Names of the schemas, by their numbers.
    schemas: BTreeMap<u16, String>,
}

/// Bytes that are read from their front.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Opcode and content of the next record.
    fn record(&mut self) -> Option<(u8, Self)> {
        let [opcode] = self.array()?;
        let length = usize::try_from(self.u64()?).ok()?;
        Some((opcode, Self(self.take(length)?)))
    }

    fn text(&mut self) -> Option<String> {
        let n = u32::from_le_bytes(self.array()?);
        Some(String::from_utf8_lossy(self.take(n as usize)?).into_owned())
    }
}

impl Log {
    /// The channels and messages of a container.
    ///
    /// # Errors
    ///
    /// The bytes do not begin as an MCAP log, end early, do not match their checksums, have a chunk that cannot be
    /// expanded, or have a message of a channel that no record declares.
    pub fn read(bytes: &[u8]) -> Result<Self, McapError> {
        match Self::read_complete_records(bytes)? {
            (log, _) if !log.damaged.is_empty() => Err(McapError::Lost(log.damaged.join(", "))),
            (log, false) => Ok(log),
            (log, true) => Err(McapError::Cut(log.messages.len())),
        }
    }

    /// The same of a container that may end early, as when its writer was killed; true if it does. Chunks that are damaged are
    /// left out and named in [`damaged`](Self::damaged).
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read), but for an early end and damaged chunks.
    pub fn read_complete_records(bytes: &[u8]) -> Result<(Self, bool), McapError> {
        Self::read_within(bytes, &Limits::COMMAND)
    }

    /// The same within other limits: each message takes memory as a cell of a table does.
    ///
    /// # Errors
    ///
    /// As [`read_complete_records`](Self::read_complete_records).
    pub fn read_within(bytes: &[u8], limits: &Limits) -> Result<(Self, bool), McapError> {
        let mut log = Self::default();
        let records = bytes.strip_prefix(&MAGIC).ok_or(McapError::Magic)?;
        let complete = records.strip_suffix(&MAGIC);
        let mut room = Room { left: limits.bytes, messages: limits.cells, is_in_chunk: false };
        let cut = match log.records(complete.unwrap_or(records), &mut room) {
            Err(McapError::Cut(_)) => true,
            end => end.map(|()| complete.is_none())?,
        };
        log.check_sums(bytes)?;
        if !log.damaged.is_empty() {
            // Their channel may have been declared in a chunk that is lost.
            let channels = &log.channels;
            log.messages.retain(|message| channels.contains_key(&message.channel));
        }
        match log.messages.iter().find(|message| !log.channels.contains_key(&message.channel)) {
            Some(message) => Err(McapError::Channel(message.channel)),
            None => Ok((log, cut)),
        }
    }

    fn records(&mut self, bytes: &[u8], room: &mut Room) -> Result<(), McapError> {
        let mut rest = Bytes(bytes);
        while !rest.0.is_empty() {
            self.record(&mut rest, room)?;
        }
        Ok(())
    }

    /// Compares the check sums of the data and of the summary, as far as they are there.
    fn check_sums(&mut self, bytes: &[u8]) -> Result<(), McapError> {
        let mut rest = Bytes(&bytes[MAGIC.len()..]);
        let place = |rest: &Bytes| bytes.len() - rest.0.len();
        loop {
            let start = place(&rest);
            let Some((opcode, mut content)) = rest.record() else { return Ok(()) };
            match opcode {
                15 => match expect_sum(&mut content, &bytes[..start], "the data") {
                    // Which chunks are damaged is known by their own sums; records around them have no messages.
                    Err(_) if !self.damaged.is_empty() => {}
                    Err(_) if !self.has_unchecked => self.damaged.push("records between its chunks".into()),
                    end => end?,
                },
                2 => {
                    let summary = content.u64().and_then(|at| usize::try_from(at).ok());
                    let _offsets = content.u64();
                    // Without a summary the sum is of the footer alone.
                    let from = summary.filter(|at| *at > 0 && *at <= start).unwrap_or(start);
                    let summary = &bytes[from..place(&rest).saturating_sub(4)];
                    if expect_sum(&mut content, summary, "the summary").is_err() {
                        self.damaged.push("its summary".into());
                    }
                }
                _ => {}
            }
        }
    }

    fn record(&mut self, rest: &mut Bytes, room: &mut Room) -> Result<(), McapError> {
        let cut = McapError::Cut(self.messages.len());
        let Some((opcode, mut content)) = rest.record() else { return Err(cut) };
        match opcode {
            // No record: what a file that was never written out is filled with.
            0 => Err(cut),
            3 => self.schema(&mut content).ok_or(cut),
            4 => self.channel(&mut content).ok_or(cut),
            5 => {
                room.messages = room.messages.checked_sub(1).ok_or(McapError::TooLarge)?;
                self.has_unchecked |= !room.is_in_chunk;
                self.message(&mut content).ok_or(cut)
            }
            6 if room.is_in_chunk => Err(McapError::Nested),
            6 => {
                let Some(Chunk { mut crc, compression, records }) = chunk(&mut content) else { return Err(cut) };
                self.n_chunks += 1;
                let Some(expanded) = expanded(&compression, records, room.left)? else {
                    self.lose(&format!("cannot be expanded from {compression}"));
                    return Ok(());
                };
                room.left = room.left.checked_sub(expanded.len() as u64).ok_or(McapError::TooLarge)?;
                self.has_unchecked |= crc.0.iter().all(|byte| *byte == 0);
                if expect_sum(&mut crc, &expanded, "a chunk").is_err() {
                    self.lose("does not match its check sum");
                    return Ok(());
                }
                room.is_in_chunk = true;
                let end = self.records(&expanded, room);
                room.is_in_chunk = false;
                match end {
                    Err(McapError::Cut(_)) => {
                        self.lose("ends in the middle of a record");
                        Ok(())
                    }
                    end => end,
                }
            }
            12 if self.metadata.len() > MAX_METADATA => Err(McapError::TooLarge),
            12 => self.metadata(&mut content).ok_or(cut),
            _ => Ok(()),
        }
    }

    /// Leaves a chunk out, and says which.
    fn lose(&mut self, why: &str) {
        self.damaged.push(format!("chunk {} {why}", self.n_chunks));
    }

    fn metadata(&mut self, content: &mut Bytes) -> Option<()> {
        let _name = content.text()?;
        let length = u32::from_le_bytes(content.array()?);
        let mut pairs = Bytes(content.take(length as usize)?);
        while !pairs.0.is_empty() && self.metadata.len() <= MAX_METADATA {
            self.metadata.insert(pairs.text()?, pairs.text()?);
        }
        Some(())
    }

    fn channel(&mut self, content: &mut Bytes) -> Option<()> {
        let (id, schema) = (content.u16()?, content.u16()?);
        let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
        self.channels.insert(id, Channel { topic: content.text()?, encoding: content.text()?, schema });
        Some(())
    }

    fn schema(&mut self, content: &mut Bytes) -> Option<()> {
        self.schemas.insert(content.u16()?, content.text()?);
        Some(())
    }

    fn message(&mut self, content: &mut Bytes) -> Option<()> {
        let (channel, _sequence) = (content.u16()?, content.array::<4>()?);
        let (log_time, _published) = (content.u64()?, content.u64()?);
        self.messages.push(Message { channel, log_time, data: content.0.to_vec() });
        Some(())
    }
}

/// Where records are read, and how many bytes chunks may still expand to, and how many messages there may still be.
struct Room {
    left: u64,
    messages: usize,
    is_in_chunk: bool,
}

/// A chunk as it is stored.
struct Chunk<'a> {
    crc: Bytes<'a>,
    compression: String,
    records: &'a [u8],
}

fn chunk<'a>(content: &mut Bytes<'a>) -> Option<Chunk<'a>> {
    content.take(3 * 8)?;
    let crc = Bytes(content.take(4)?);
    let compression = content.text()?;
    let length = usize::try_from(content.u64()?).ok()?;
    Some(Chunk { crc, compression, records: content.take(length)? })
}

/// Compares the check sum that comes next with that of `checked`; 0 is none.
fn expect_sum(content: &mut Bytes, checked: &[u8], what: &'static str) -> Result<(), McapError> {
    match content.array().map(u32::from_le_bytes) {
        Some(sum) if sum != 0 && sum != CRC.checksum(checked) => Err(McapError::Damaged(what)),
        _ => Ok(()),
    }
}

/// The records of a chunk, cut behind the first byte for which no room is `left`; `None` of damaged ones.
fn expanded(compression: &str, records: &[u8], left: u64) -> Result<Option<Vec<u8>>, McapError> {
    let mut bytes = Vec::new();
    let read = match compression {
        "" => {
            bytes.extend_from_slice(records);
            true
        }
        "zstd" => ruzstd::decoding::StreamingDecoder::new(records)
            .is_ok_and(|decoder| decoder.take(left + 1).read_to_end(&mut bytes).is_ok()),
        "lz4" => lz4_flex::frame::FrameDecoder::new(records).take(left + 1).read_to_end(&mut bytes).is_ok(),
        _ => return Err(McapError::Compression(compression.into())),
    };
    Ok(read.then_some(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written() -> Vec<u8> {
        let mut writer = Writer::new(&[("model".into(), "7".into())], "/a", ("A", "{}"));
        writer.message(5, "{}");
        writer.finish()
    }

    /// Made once with the package `mcap` 1.6 of Python, with one message in a chunk of each compression.
    const OTHERS: [&[u8]; 3] = [
        include_bytes!("../../../tests/data/measured/none.mcap"),
        include_bytes!("../../../tests/data/measured/zstd.mcap"),
        include_bytes!("../../../tests/data/measured/lz4.mcap"),
    ];

    #[test]
    fn what_is_written_is_read() {
        let log = Log::read(&written()).unwrap();
        assert_eq!(log.channels[&1], Channel { topic: "/a".into(), encoding: "json".into(), schema: "A".into() });
        assert_eq!(log.messages, [Message { channel: 1, log_time: 5, data: b"{}".to_vec() }]);
    }

    #[test]
    fn logs_of_another_program_are_read_in_each_compression() {
        for bytes in OTHERS {
            let log = Log::read(bytes).unwrap();
            assert_eq!(log.channels.values().next().unwrap().topic, "/joints");
            assert_eq!(log.messages.len(), 3);
            assert_eq!((log.messages[2].log_time, &log.messages[2].data[..6]), (2_000_000_000, &b"{\"q\": "[..]));
        }
    }

    /// Three messages, two in one chunk, which the reader of the package `mcap` 1.6 of Python has validated with all its check
    /// sums, and found by time.
    #[test]
    fn the_bytes_are_those_that_another_program_has_validated() {
        let mut writer = Writer::new(&[("model".into(), "7".into())], "/measurement", ("A", "{\"type\":\"object\"}"));
        writer.message(1_700_000_000_000_000_000, "{\"q\":1}");
        writer.message(1_700_000_001_000_000_000, "{\"q\":2}");
        let mut bytes = writer.take();
        writer.message(1_700_000_002_000_000_000, "{\"q\":3}");
        bytes.extend(writer.finish());
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/golden/indexed.mcap");
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(path, &bytes).unwrap();
        }
        assert_eq!(bytes, std::fs::read(path).unwrap());
    }

    #[test]
    fn every_changed_byte_of_data_and_summary_is_noticed() {
        let complete = written();
        let footer = complete.len() - MAGIC.len() - 29;
        let summary = u64::from_le_bytes(complete[footer + 9..footer + 17].try_into().unwrap()) as usize;
        let data_end = summary - 13;
        for at in (MAGIC.len()..data_end).chain(summary..footer) {
            let mut damaged = complete.clone();
            damaged[at] ^= 0x10;
            assert!(Log::read(&damaged).is_err(), "byte {at} of {}", complete.len());
        }
    }

    /// A record with a chunk that is not compressed and has no check sum.
    fn in_chunk(records: &[u8]) -> Vec<u8> {
        let stored = [&[0; 3 * 8 + 4 + 4][..], &(records.len() as u64).to_le_bytes(), records].concat();
        [&[6][..], &(stored.len() as u64).to_le_bytes(), &stored].concat()
    }

    #[test]
    fn chunks_in_chunks_are_refused() {
        let records = (0..3_000).fold(Vec::new(), |records, _| in_chunk(&records));
        assert!(Log::read(&[&MAGIC, &in_chunk(&[])[..], &MAGIC].concat()).is_ok());
        assert!(matches!(Log::read(&[&MAGIC, &records[..], &MAGIC].concat()), Err(McapError::Nested)));
    }

    #[test]
    fn chunks_expand_to_no_more_than_there_is_room_for() {
        let records = in_chunk(&[7; 100]);
        let read =
            |left| Log::default().records(&records, &mut Room { left, messages: usize::MAX, is_in_chunk: false });
        assert!(matches!(read(99), Err(McapError::TooLarge)));
        assert!(!matches!(read(100), Err(McapError::TooLarge)));
        for other in &OTHERS[1..] {
            let end = Log::default()
                .records(&other[MAGIC.len()..], &mut Room { left: 10, messages: usize::MAX, is_in_chunk: false });
            assert!(matches!(end, Err(McapError::TooLarge)));
        }
    }

    #[test]
    fn a_damaged_chunk_is_left_out_and_named_and_the_others_are_read() {
        let mut writer = Writer::new(&[], "/a", ("A", "{}"));
        writer.message(1, "{\"q\":1}");
        let mut bytes = writer.take();
        writer.message(2, "{\"q\":2}");
        let second = bytes.len();
        bytes.extend(writer.take());
        writer.message(3, "{\"q\":3}");
        bytes.extend(writer.finish());
        let at = second + bytes[second..].windows(5).position(|part| part == b"\"q\":2").unwrap();
        let mut flipped = bytes.clone();
        flipped[at + 4] ^= 1;
        let (log, is_cut) = Log::read_complete_records(&flipped).unwrap();
        let times: Vec<u64> = log.messages.iter().map(|message| message.log_time).collect();
        assert_eq!(
            (times, is_cut, log.damaged),
            (vec![1, 3], false, vec!["chunk 2 does not match its check sum".into()])
        );
        assert!(matches!(Log::read(&flipped), Err(McapError::Lost(_))));
        // A file whose end was never written to the disk.
        let mut zeroed = bytes.clone();
        zeroed[at..].fill(0);
        let (log, is_cut) = Log::read_complete_records(&zeroed).unwrap();
        assert_eq!((log.messages.len(), log.damaged.len(), is_cut), (1, 1, true));
    }

    #[test]
    fn a_log_that_was_cut_or_is_none_is_told() {
        let complete = written();
        for end in 8..complete.len() {
            assert!(matches!(Log::read(&complete[..end]), Err(McapError::Cut(_))), "{end}");
            assert!(matches!(Log::read_complete_records(&complete[..end]), Ok((_, true))), "{end}");
        }
        assert!(matches!(Log::read(b"t_s,x_mm\n1,2\n"), Err(McapError::Magic)));
    }
}
