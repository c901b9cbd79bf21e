//! MCAP containers: the records that a log of measurements needs, byte by byte.
//!
//! A container is [`MAGIC`], records, [`MAGIC`]. A record is an opcode, its length (u64) and its content; numbers are
//! little-endian, a text is its length (u32) and its bytes, a map the length of its bytes (u32) and texts in pairs.
//!
//! | opcode | record | content |
//! | --- | --- | --- |
//! | 1 | header | profile, library |
//! | 2 | footer | where the summary begins (u64), its offsets (u64), CRC (u32); 0: there is none |
//! | 3 | schema | id (u16), name, encoding, data (u32 and bytes) |
//! | 4 | channel | id (u16), schema's id (u16), topic, encoding of its messages, map |
//! | 5 | message | channel's id (u16), sequence (u32), log time and publish time (u64, ns), data |
//! | 6 | chunk | times (2 × u64), size (u64), CRC (u32), compression, records (u64 and bytes) |
//! | 12 | metadata | name, map |
//! | 15 | end of data | CRC (u32), 0: not told |
//!
//! Others (indices, attachments, statistics) are passed over. Chunks may be plain, `zstd` or `lz4`. Source: MCAP format
//! specification, mcap.dev/spec, version 0.

use std::collections::BTreeMap;
use std::io::Read;

/// What a container begins and ends with.
pub const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];
/// A chunk may expand to as many bytes.
const LARGEST_CHUNK: u64 = 1 << 30;

/// Why bytes are no container.
#[derive(Debug, thiserror::Error)]
pub enum McapError {
    /// They do not begin as one.
    #[error("the file does not begin as an MCAP log does")]
    Magic,
    /// A record reaches over the end, or the end is missing.
    #[error("the log ends in the middle of a record, after {0} whole messages: was it closed?")]
    Cut(usize),
    /// A chunk that cannot be expanded.
    #[error("a chunk in the compression `{0}` cannot be expanded; known are none, zstd and lz4")]
    Compression(String),
    /// A message of a channel that no record tells.
    #[error("a message belongs to channel {0}, which no record tells")]
    Channel(u16),
}

/// Where messages of one kind go.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name.
    pub topic: String,
    /// How its messages are written: `json`, say.
    pub encoding: String,
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
    pub fn read(bytes: &[u8]) -> Result<Self, McapError> {
        match Self::read_whole_records(bytes)? {
            (log, false) => Ok(log),
            (log, true) => Err(McapError::Cut(log.messages.len())),
        }
    }

    /// The same of a container that may end early, as when its writer was killed; true if it does.
    pub fn read_whole_records(bytes: &[u8]) -> Result<(Self, bool), McapError> {
        let mut log = Self::default();
        let records = bytes.strip_prefix(&MAGIC).ok_or(McapError::Magic)?;
        let whole = records.strip_suffix(&MAGIC);
        let cut = match log.records(whole.unwrap_or(records)) {
            Err(McapError::Cut(_)) => true,
            end => end.map(|()| whole.is_none())?,
        };
        match log.messages.iter().find(|message| !log.channels.contains_key(&message.channel)) {
            Some(message) => Err(McapError::Channel(message.channel)),
            None => Ok((log, cut)),
        }
    }

    fn records(&mut self, bytes: &[u8]) -> Result<(), McapError> {
        let mut rest = Bytes(bytes);
        while !rest.0.is_empty() {
            self.record(&mut rest)?;
        }
        Ok(())
    }

    fn record(&mut self, rest: &mut Bytes) -> Result<(), McapError> {
        let cut = McapError::Cut(self.messages.len());
        let Some((opcode, mut content)) = rest.record() else { return Err(cut) };
        match opcode {
            4 => self.channel(&mut content).ok_or(cut),
            5 => self.message(&mut content).ok_or(cut),
            6 => {
                let Some((compression, records)) = chunk(&mut content) else { return Err(cut) };
                let expanded = expanded(&compression, records).ok_or(McapError::Compression(compression))?;
                self.records(&expanded)
            }
            12 => self.metadata(&mut content).ok_or(cut),
            _ => Ok(()),
        }
    }

    fn metadata(&mut self, content: &mut Bytes) -> Option<()> {
        let _name = content.text()?;
        let length = u32::from_le_bytes(content.array()?);
        let mut pairs = Bytes(content.take(length as usize)?);
        while !pairs.0.is_empty() {
            self.metadata.insert(pairs.text()?, pairs.text()?);
        }
        Some(())
    }

    fn channel(&mut self, content: &mut Bytes) -> Option<()> {
        let (id, _schema) = (content.u16()?, content.u16()?);
        self.channels.insert(id, Channel { topic: content.text()?, encoding: content.text()? });
        Some(())
    }

    fn message(&mut self, content: &mut Bytes) -> Option<()> {
        let (channel, _sequence) = (content.u16()?, content.array::<4>()?);
        let (log_time, _published) = (content.u64()?, content.u64()?);
        self.messages.push(Message { channel, log_time, data: content.0.to_vec() });
        Some(())
    }
}

/// Compression and records of a chunk.
fn chunk<'a>(content: &mut Bytes<'a>) -> Option<(String, &'a [u8])> {
    content.take(3 * 8 + 4)?;
    let compression = content.text()?;
    let length = usize::try_from(content.u64()?).ok()?;
    Some((compression, content.take(length)?))
}

fn expanded(compression: &str, records: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    match compression {
        "" => bytes.extend_from_slice(records),
        "zstd" => {
            let decoder = ruzstd::decoding::StreamingDecoder::new(records).ok()?;
            decoder.take(LARGEST_CHUNK).read_to_end(&mut bytes).ok()?;
        }
        "lz4" => {
            let decoder = lz4_flex::frame::FrameDecoder::new(records);
            decoder.take(LARGEST_CHUNK).read_to_end(&mut bytes).ok()?;
        }
        _ => return None,
    }
    Some(bytes)
}

/// A container that is being written, with one channel of JSON.
#[derive(Debug)]
pub struct Writer {
    bytes: Vec<u8>,
    sequence: u32,
}

impl Writer {
    /// A container with this metadata and one channel: its topic, and the name and text of its JSON Schema.
    pub fn new(metadata: &[(String, String)], topic: &str, (name, schema): (&str, &str)) -> Self {
        let mut writer = Self { bytes: MAGIC.to_vec(), sequence: 0 };
        writer.record(1, &[text(""), text("darm")]);
        writer.metadata(metadata);
        let id = 1u16.to_le_bytes().to_vec();
        writer.record(3, &[id.clone(), text(name), text("jsonschema"), text(schema)]);
        writer.record(4, &[id.clone(), id, text(topic), text("json"), long(&[])]);
        writer
    }

    /// Adds a metadata record.
    pub fn metadata(&mut self, metadata: &[(String, String)]) {
        let map: Vec<u8> = metadata.iter().flat_map(|(key, value)| [text(key), text(value)]).flatten().collect();
        self.record(12, &[text("about"), long(&map)]);
    }

    /// Takes the bytes written since the last time, for a file that grows.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }

    /// Adds a message; log time in ns.
    pub fn message(&mut self, log_time: u64, data: &str) {
        let times = [log_time.to_le_bytes(), log_time.to_le_bytes()].concat();
        let sequence = self.sequence.to_le_bytes().to_vec();
        self.record(5, &[1u16.to_le_bytes().to_vec(), sequence, times, data.as_bytes().to_vec()]);
        self.sequence += 1;
    }

    /// The whole container, or what follows the bytes that were taken.
    pub fn finish(mut self) -> Vec<u8> {
        self.record(15, &[vec![0; 4]]);
        self.record(2, &[vec![0; 20]]);
        self.bytes.extend(MAGIC);
        self.bytes
    }

    fn record(&mut self, opcode: u8, parts: &[Vec<u8>]) {
        self.bytes.push(opcode);
        self.bytes.extend((parts.iter().map(Vec::len).sum::<usize>() as u64).to_le_bytes());
        parts.iter().for_each(|part| self.bytes.extend(part));
    }
}

/// Bytes after their length.
fn long(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat()
}

fn text(text: &str) -> Vec<u8> {
    long(text.as_bytes())
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
        include_bytes!("../../../../tests/data/measured/none.mcap"),
        include_bytes!("../../../../tests/data/measured/zstd.mcap"),
        include_bytes!("../../../../tests/data/measured/lz4.mcap"),
    ];

    #[test]
    fn what_is_written_is_read() {
        let log = Log::read(&written()).unwrap();
        assert_eq!(log.channels[&1], Channel { topic: "/a".into(), encoding: "json".into() });
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

    #[test]
    fn a_log_that_was_cut_or_is_none_is_told() {
        let whole = written();
        for end in 8..whole.len() {
            assert!(matches!(Log::read(&whole[..end]), Err(McapError::Cut(_))), "{end}");
            assert!(matches!(Log::read_whole_records(&whole[..end]), Ok((_, true))), "{end}");
        }
        assert!(matches!(Log::read(b"t_s,x_mm\n1,2\n"), Err(McapError::Magic)));
    }
}
