//! MAT-files of MATLAB, level 5 (`save -v6` and `-v7`): numeric matrices, and structs of them, plain or compressed.
//!
//! A file is a header of 128 bytes, whose last two say the order of bytes, and elements: type and length (u32 each, or
//! both in the first u32 of a small element) and content, padded to 8 bytes. A matrix is an element of elements: flags,
//! dimensions, name, numbers. Source: MathWorks, *MAT-File Format*, 2023, chapter 1.
//!
//! Fields of a struct are named `log.q`, those of an array of structs `log[1].q`. Texts, cells, sparse and complex
//! matrices and objects (`timeseries`, `timetable`, `table`) are listed as not read.

use std::io::Read as _;

use flate2::read::ZlibDecoder;

use super::{Array, Room};
use crate::import::error::Fault;
use darm_robot::files::Limits;

const HEADER_BYTES: usize = 128;
/// What a file of HDF5 has at its beginning or after a header of MATLAB.
const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Structs within structs.
const MAX_DEPTH: usize = 16;
/// Elements of an array of structs.
const MAX_STRUCTS: usize = 10_000;

/// Types of elements.
mod element {
    pub(super) const INT8: u32 = 1;
    pub(super) const UINT8: u32 = 2;
    pub(super) const INT16: u32 = 3;
    pub(super) const UINT16: u32 = 4;
    pub(super) const INT32: u32 = 5;
    pub(super) const UINT32: u32 = 6;
    pub(super) const SINGLE: u32 = 7;
    pub(super) const DOUBLE: u32 = 9;
    pub(super) const INT64: u32 = 12;
    pub(super) const UINT64: u32 = 13;
    pub(super) const MATRIX: u32 = 14;
    pub(super) const COMPRESSED: u32 = 15;
}

/// Names of the classes of numeric matrices, the first being class 6.
const NUMERIC: [&str; 10] =
    ["float64", "float32", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"];
/// Names of the classes before them, the first being class 1.
const OTHERS: [&str; 5] = ["cell", "struct", "object", "text", "sparse matrix"];

/// The variables of a file.
pub(crate) fn read(bytes: &[u8], limits: &Limits) -> Result<Vec<Array>, Fault> {
    if bytes.starts_with(HDF5) || bytes.get(512..).is_some_and(|rest| rest.starts_with(HDF5)) {
        let text = "a MAT-file of version 7.3 (HDF5) is not read: save it in MATLAB with save('log.mat', '-v7'), \
                    in Python with scipy.io.savemat";
        return Err(Fault::of_file(text));
    }
    let (header, body) = bytes.split_at_checked(HEADER_BYTES).ok_or_else(no_mat_file)?;
    let is_big_endian = match &header[126..] {
        b"IM" => false,
        b"MI" => true,
        _ => return Err(no_mat_file()),
    };
    let mut reader = Reader { rest: body, is_big_endian };
    let (mut arrays, mut room) = (Vec::new(), Room::new(limits));
    while !reader.rest.is_empty() {
        let place = format!("variable {}", arrays.len() + 1);
        let cut = |what: &str| {
            Fault::at(place.clone(), format!("{what}: the file is damaged or was not closed, save it again"))
        };
        let (kind, content) = reader.element().ok_or_else(|| cut("it ends early"))?;
        let expanded;
        let (kind, content) = match kind {
            element::COMPRESSED => {
                expanded = expand(content, room.bytes).map_err(|text| cut(&text))?;
                room.bytes -= expanded.len() as u64;
                let mut inner = Reader { rest: &expanded, is_big_endian };
                inner.element().ok_or_else(|| cut("it ends early"))?
            }
            _ => (kind, content),
        };
        // Objects keep their data in an element of another kind, without a name.
        if kind == element::MATRIX {
            let inside = Reader { rest: content, is_big_endian };
            let mut found = Variables { is_big_endian, arrays: Vec::new(), room, full: None };
            let fits = found.matrix(inside, "", 0);
            if let Some(full) = found.full {
                return Err(full);
            }
            fits.ok_or_else(|| cut("its parts do not fit together"))?;
            room = found.room;
            arrays.extend(found.arrays);
        }
    }
    Ok(arrays)
}

fn no_mat_file() -> Fault {
    Fault::of_file(
        "no MAT-file of level 5: save it in MATLAB with save('log.mat', '-v7'), in Python with scipy.io.savemat",
    )
}

/// Expands what may take as many bytes as are `left`.
fn expand(content: &[u8], left: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let read = ZlibDecoder::new(content).take(left + 1).read_to_end(&mut bytes);
    read.map_err(|error| format!("it cannot be expanded ({error})"))?;
    match bytes.len() as u64 > left {
        true => Err(format!("it expands, with the variables before it, to more than {} MiB", left >> 20)),
        false => Ok(bytes),
    }
}

/// Elements that are read from the front.
#[derive(Clone, Copy)]
struct Reader<'a> {
    rest: &'a [u8],
    is_big_endian: bool,
}

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(n)?;
        self.rest = rest;
        Some(taken)
    }

    fn u32(&mut self) -> Option<u32> {
        let bytes = self.take(4)?.try_into().ok()?;
        Some(if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// Type and content of the next element.
    fn element(&mut self) -> Option<(u32, &'a [u8])> {
        let first = self.u32()?;
        if first >> 16 != 0 {
            let content = self.take(4)?;
            return Some((first & 0xffff, content.get(..(first >> 16) as usize)?));
        }
        let length = self.u32()? as usize;
        let content = self.take(length)?;
        if first != element::COMPRESSED {
            let padding = length.next_multiple_of(8) - length;
            self.rest = self.rest.get(padding..).unwrap_or_default();
        }
        Some((first, content))
    }

    /// The integers of an element.
    fn integers(&mut self) -> Option<Vec<u32>> {
        let (_, content) = self.element()?;
        let mut inside = Self { rest: content, ..*self };
        (0..content.len() / 4).map(|_| inside.u32()).collect()
    }
}

/// Variables found so far.
struct Variables {
    is_big_endian: bool,
    arrays: Vec<Array>,
    room: Room,
    /// Why no more is read.
    full: Option<Fault>,
}

impl Variables {
    /// Takes room for an array, or ends the reading.
    fn take(&mut self, numbers: usize) -> Option<()> {
        self.room.take(numbers).map_err(|full| self.full = Some(full)).ok()
    }

    /// Adds the matrix of an element, named `own`, or by itself where that is empty.
    fn matrix(&mut self, mut inside: Reader, own: &str, depth: usize) -> Option<()> {
        if inside.rest.is_empty() {
            return Some(());
        }
        let flags = *inside.integers()?.first()?;
        let (class, is_complex) = (flags & 0xff, flags & 0x800 != 0);
        let not_read = |name: &str, what: &str, shape| {
            let kind = format!("{what}, not read: save numeric matrices, or structs of them");
            Array { name: name.into(), kind, shape, numbers: None }
        };
        if !(1..=15).contains(&class) {
            // An opaque object: its name follows at once, and no dimensions.
            self.take(0)?;
            let name = String::from_utf8_lossy(inside.element()?.1).into_owned();
            self.arrays.push(not_read(if own.is_empty() { &name } else { own }, "object", Vec::new()));
            return Some(());
        }
        let shape: Vec<usize> = inside.integers()?.into_iter().map(|n| n as usize).collect();
        let named = String::from_utf8_lossy(inside.element()?.1).into_owned();
        let name = if own.is_empty() { named } else { own.into() };
        let n = shape.iter().try_fold(1usize, |n, extent| n.checked_mul(*extent))?;
        self.take(if (6..=15).contains(&class) { n } else { 0 })?;
        match class {
            2 if depth < MAX_DEPTH && n <= MAX_STRUCTS => self.fields(inside, &name, n, depth)?,
            6..=15 if !is_complex => {
                let (kind, content) = inside.element()?;
                let numbers = self.numbers(kind, content).filter(|numbers| numbers.len() == n)?;
                let kind = NUMERIC[class as usize - 6].into();
                self.arrays.push(Array { name, kind, shape, numbers: Some(numbers) });
            }
            6..=15 => self.arrays.push(not_read(&name, "complex matrix", Vec::new())),
            _ => self.arrays.push(not_read(&name, OTHERS[class as usize - 1], Vec::new())),
        }
        Some(())
    }

    /// Adds the fields of `n` structs.
    fn fields(&mut self, mut inside: Reader, name: &str, n: usize, depth: usize) -> Option<()> {
        let length = *inside.integers()?.first()? as usize;
        let (_, names) = inside.element()?;
        let n_names = names.len().div_ceil(length.max(1));
        self.room.check_names(n_names).map_err(|full| self.full = Some(full)).ok()?;
        let text =
            |bytes: &[u8]| String::from_utf8_lossy(bytes.split(|byte| *byte == 0).next().unwrap_or(bytes)).into_owned();
        let names: Vec<String> = names.chunks(length.max(1)).map(text).collect();
        for k in 0..n {
            for field in &names {
                let own = if n == 1 { format!("{name}.{field}") } else { format!("{name}[{k}].{field}") };
                let (_, content) = inside.element()?;
                self.matrix(Reader { rest: content, ..inside }, &own, depth + 1)?;
            }
        }
        Some(())
    }

    /// The numbers of an element: MATLAB stores them in the smallest type that holds them.
    fn numbers(&self, kind: u32, content: &[u8]) -> Option<Vec<f64>> {
        fn all<const N: usize>(
            content: &[u8],
            number: impl Fn([u8; N]) -> f64,
            is_big_endian: bool,
        ) -> Option<Vec<f64>> {
            let chunks = content.chunks_exact(N);
            let ordered = |chunk: &[u8]| {
                let mut bytes: [u8; N] = chunk.try_into().ok()?;
                if is_big_endian {
                    bytes.reverse();
                }
                Some(number(bytes))
            };
            chunks.map(ordered).collect()
        }
        let big = self.is_big_endian;
        match kind {
            element::INT8 => all(content, |b| f64::from(i8::from_le_bytes(b)), big),
            element::UINT8 => all(content, |b| f64::from(u8::from_le_bytes(b)), big),
            element::INT16 => all(content, |b| f64::from(i16::from_le_bytes(b)), big),
            element::UINT16 => all(content, |b| f64::from(u16::from_le_bytes(b)), big),
            element::INT32 => all(content, |b| f64::from(i32::from_le_bytes(b)), big),
            element::UINT32 => all(content, |b| f64::from(u32::from_le_bytes(b)), big),
            element::SINGLE => all(content, |b| f64::from(f32::from_le_bytes(b)), big),
            element::DOUBLE => all(content, f64::from_le_bytes, big),
            element::INT64 => all(content, |b| i64::from_le_bytes(b) as f64, big),
            element::UINT64 => all(content, |b| u64::from_le_bytes(b) as f64, big),
            _ => None,
        }
    }
}
