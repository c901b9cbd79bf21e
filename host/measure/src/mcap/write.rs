//! Writing of MCAP containers: one channel of JSON, in chunks with an index, check sums and a summary.

use std::collections::BTreeMap;

use super::{CRC, MAGIC};

/// The number of the only channel and of its schema.
const CHANNEL: u16 = 1;
/// Bytes of records after which a chunk is closed.
const CHUNK_BYTES: usize = 1 << 20;

/// A container that is being written, with one channel of JSON.
#[derive(Debug)]
pub struct Writer {
    /// Bytes that were not taken yet.
    bytes: Vec<u8>,
    /// Bytes of the container so far.
    length: u64,
    data_crc: u32,
    chunk: Chunk,
    summary: Summary,
}

/// Messages that no chunk holds yet.
#[derive(Debug, Default)]
struct Chunk {
    records: Vec<u8>,
    /// Log time of each message, and its place in the records.
    index: Vec<[u64; 2]>,
}

/// What the summary repeats.
#[derive(Debug, Default)]
struct Summary {
    schema: Vec<u8>,
    channel: Vec<u8>,
    chunks: Vec<Vec<u8>>,
    metadata: Vec<Vec<u8>>,
    messages: u32,
    times: Option<[u64; 2]>,
}

impl Writer {
    /// A container with this metadata and one channel: its topic, and the name and text of its JSON Schema.
    pub fn new(metadata: &[(String, String)], topic: &str, (name, schema): (&str, &str)) -> Self {
        let id = || CHANNEL.to_le_bytes().to_vec();
        let schema = record(3, &[id(), text(name), text("jsonschema"), text(schema)]);
        let channel = record(4, &[id(), id(), text(topic), text("json"), long(&[])]);
        let summary = Summary { schema: schema.clone(), channel: channel.clone(), ..Summary::default() };
        let mut writer = Self { bytes: Vec::new(), length: 0, data_crc: 0, chunk: Chunk::default(), summary };
        writer.put(&MAGIC);
        writer.put(&record(1, &[text(""), text("darm")]));
        writer.metadata(metadata);
        writer.put(&schema);
        writer.put(&channel);
        writer
    }

    /// Adds a metadata record.
    pub fn metadata(&mut self, metadata: &[(String, String)]) {
        self.close_chunk();
        let map: Vec<u8> = metadata.iter().flat_map(|(key, value)| [text(key), text(value)]).flatten().collect();
        let record = record(12, &[text("about"), long(&map)]);
        self.summary.metadata.push([&numbers([self.length, record.len() as u64])[..], &text("about")].concat());
        self.put(&record);
    }

    /// Takes the bytes written since the last time, for a file that grows: messages become a chunk.
    pub fn take(&mut self) -> Vec<u8> {
        self.close_chunk();
        std::mem::take(&mut self.bytes)
    }

    /// Adds a message; log time in ns since 1970.
    pub fn message(&mut self, log_time: u64, data: &str) {
        let sequence = self.summary.messages.to_le_bytes().to_vec();
        self.chunk.index.push([log_time, self.chunk.records.len() as u64]);
        let parts = [CHANNEL.to_le_bytes().to_vec(), sequence, numbers([log_time; 2]), data.as_bytes().to_vec()];
        self.chunk.records.extend(record(5, &parts));
        self.summary.messages += 1;
        self.summary.times = Some(spanned(self.summary.times, log_time));
        if self.chunk.records.len() >= CHUNK_BYTES {
            self.close_chunk();
        }
    }

    /// The bytes of the container that were not taken.
    pub fn finish(mut self) -> Vec<u8> {
        self.close_chunk();
        let data_crc = self.data_crc.to_le_bytes().to_vec();
        self.put(&record(15, &[data_crc]));
        let start = self.length;
        let (summary, groups) = self.summary.records(start);
        let groups_start = start + summary.len() as u64;
        let mut checked = [summary, groups].concat();
        let footer = numbers([start, groups_start]);
        checked.push(2);
        checked.extend(numbers([footer.len() as u64 + 4]));
        checked.extend(footer);
        let crc = CRC.checksum(&checked);
        self.put(&checked);
        self.put(&crc.to_le_bytes());
        self.put(&MAGIC);
        self.bytes
    }

    /// Writes the messages since the last chunk as a chunk and its index.
    fn close_chunk(&mut self) {
        let Chunk { records, index } = std::mem::take(&mut self.chunk);
        let Some([first, last]) = index.iter().fold(None, |span, [time, _]| Some(spanned(span, *time))) else {
            return;
        };
        let start = self.length;
        let size = records.len() as u64;
        let crc = CRC.checksum(&records).to_le_bytes().to_vec();
        let chunk = record(6, &[numbers([first, last, size]), crc, text(""), numbers([size]), records]);
        let entries: Vec<u8> = index.into_iter().flat_map(numbers).collect();
        let messages = record(7, &[CHANNEL.to_le_bytes().to_vec(), long(&entries)]);
        let offsets = [&CHANNEL.to_le_bytes()[..], &numbers([start + chunk.len() as u64])].concat();
        self.summary.chunks.push(
            [
                numbers([first, last, start, chunk.len() as u64]),
                long(&offsets),
                numbers([messages.len() as u64]),
                text(""),
                numbers([size, size]),
            ]
            .concat(),
        );
        self.put(&chunk);
        self.put(&messages);
    }

    fn put(&mut self, bytes: &[u8]) {
        // What the sum so far began from: its algorithm reflects and inverts.
        let mut digest = CRC.digest_with_initial((!self.data_crc).reverse_bits());
        digest.update(bytes);
        self.data_crc = digest.finalize();
        self.length += bytes.len() as u64;
        self.bytes.extend_from_slice(bytes);
    }
}

impl Summary {
    /// The records of a summary that begins there, and those that name its groups.
    fn records(&self, start: u64) -> (Vec<u8>, Vec<u8>) {
        let several = |opcode: u8, contents: &[Vec<u8>]| -> Vec<u8> {
            contents.iter().flat_map(|content| record(opcode, std::slice::from_ref(content))).collect()
        };
        let groups = BTreeMap::from([
            (3, self.schema.clone()),
            (4, self.channel.clone()),
            (8, several(8, &self.chunks)),
            (11, several(11, &[self.statistics()])),
            (13, several(13, &self.metadata)),
        ]);
        let (mut records, mut offsets) = (Vec::new(), Vec::new());
        for (opcode, group) in groups.into_iter().filter(|(_, group)| !group.is_empty()) {
            let span = numbers([start + records.len() as u64, group.len() as u64]);
            offsets.extend(record(14, &[vec![opcode], span]));
            records.extend(group);
        }
        (records, offsets)
    }

    fn statistics(&self) -> Vec<u8> {
        let count = |n: usize| (n as u32).to_le_bytes().to_vec();
        let messages = u64::from(self.messages).to_le_bytes();
        let of_channel = [&CHANNEL.to_le_bytes()[..], &messages].concat();
        [
            messages.to_vec(),
            1u16.to_le_bytes().to_vec(),
            count(1),
            count(0),
            count(self.metadata.len()),
            count(self.chunks.len()),
            numbers(self.times.unwrap_or_default()),
            long(&of_channel),
        ]
        .concat()
    }
}

/// First and last of the times so far and this one.
fn spanned(span: Option<[u64; 2]>, time: u64) -> [u64; 2] {
    span.map_or([time; 2], |[first, last]| [first.min(time), last.max(time)])
}

fn record(opcode: u8, parts: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = vec![opcode];
    bytes.extend((parts.iter().map(Vec::len).sum::<usize>() as u64).to_le_bytes());
    parts.iter().for_each(|part| bytes.extend(part));
    bytes
}

fn numbers<const N: usize>(numbers: [u64; N]) -> Vec<u8> {
    numbers.into_iter().flat_map(u64::to_le_bytes).collect()
}

/// Bytes after their length.
fn long(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat()
}

fn text(text: &str) -> Vec<u8> {
    long(text.as_bytes())
}
