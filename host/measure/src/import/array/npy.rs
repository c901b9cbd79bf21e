//! Arrays of NumPy: `.npy`, and archives of them, `.npz`.
//!
//! An array is the magic bytes `\x93NUMPY`, the version (2 bytes), the length of its header (u16, from version 2 on u32),
//! the header, a literal of Python with type, order and shape, and the numbers. Source: NumPy 2.4, `numpy.lib.format`.
//! Read here: numbers and truth values of all sizes but `float128` and complex ones, in both orders of bytes and of
//! indices, and records of these, field by field. An `.npz` is a ZIP archive of `.npy` files, plain or deflated.

use std::io::{Cursor, Read as _};

use super::python_literal::{self, Literal};
use super::{Array, Room};
use crate::import::error::Fault;
use darm_robot::files::Limits;

/// Longest header: NumPy itself evaluates no more than 10 000 characters without an option. What is parsed takes tens of times
/// its text.
const MAX_HEADER: usize = 1 << 16;
/// Most dimensions, those that NumPy 1 has (`NPY_MAXDIMS`).
const MAX_DIMENSIONS: usize = 32;
/// What an array begins with.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// The array of a `.npy` file; of records one array for each field.
pub(crate) fn read(name: &str, bytes: &[u8], limits: &Limits) -> Result<Vec<Array>, Fault> {
    match read_array(name, bytes, &mut Room::new(limits))? {
        Content::Numbers(arrays) => Ok(arrays),
        Content::OtherType(unread) => Err(Fault::at(format!("array {name}"), unread.0)),
    }
}

/// What an array holds.
enum Content {
    Numbers(Vec<Array>),
    OtherType(OtherType),
}

/// A type that is not read, as a sentence.
struct OtherType(String);

fn read_array(name: &str, bytes: &[u8], room: &mut Room) -> Result<Content, Fault> {
    let fault = |text: String| Fault::at(format!("array {name}"), text);
    let cut = || fault("the file ends within its header: it is damaged, copy or save it again".into());
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| fault("the bytes do not begin as an array of NumPy".into()))?;
    let (header, data) = split_header(rest).ok_or_else(cut)?;
    if header.len() > MAX_HEADER {
        return Err(fault(format!("its header is longer than {MAX_HEADER} bytes: save it again with numpy.save")));
    }
    let header = python_literal::parse(&String::from_utf8_lossy(header));
    let unknown = || fault("its header is none of NumPy: save it again with numpy.save".into());
    let header = header.ok_or_else(unknown)?;
    let Some(Literal::List(shape)) = header.get("shape") else { return Err(unknown()) };
    let extent = |literal: &Literal| match literal {
        Literal::Integer(n) => Some(*n),
        _ => None,
    };
    let shape: Vec<usize> = shape.iter().map(extent).collect::<Option<_>>().ok_or_else(unknown)?;
    if shape.len() > MAX_DIMENSIONS {
        return Err(unknown());
    }
    let is_fortran = header.get("fortran_order") == Some(&Literal::Truth(true));
    let (fields, size) = match fields(name, header.get("descr").ok_or_else(unknown)?) {
        Ok(fields) => fields,
        Err(other) => return Ok(Content::OtherType(other)),
    };
    let n = shape.iter().try_fold(1usize, |n, extent| n.checked_mul(*extent)).ok_or_else(unknown)?;
    let needed = n.checked_mul(size).ok_or_else(unknown)?;
    if data.len() < needed {
        let text = format!(
            "{} bytes of numbers, its shape {shape:?} needs {needed}: it is damaged, save it again",
            data.len()
        );
        return Err(fault(text));
    }
    for _ in &fields {
        room.take(n)?;
    }
    let order = order(&shape, is_fortran);
    let array = |field: &Field| {
        let number = |at: &usize| field.kind.number(&data[at * size + field.offset..]);
        let numbers = Some(order.iter().map(number).collect());
        Array { name: field.name.clone(), kind: field.kind.shown(), shape: shape.clone(), numbers }
    };
    Ok(Content::Numbers(fields.iter().map(array).collect()))
}

/// The arrays of a `.npz` file.
pub(crate) fn read_archive(bytes: &[u8], limits: &Limits) -> Result<Vec<Array>, Fault> {
    let damaged = |error: zip::result::ZipError| {
        Fault::of_file(format!(
            "no ZIP archive that can be read ({error}): copy the file again, or save it again with numpy.savez"
        ))
    };
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(damaged)?;
    let (mut arrays, mut room) = (Vec::new(), Room::new(limits));
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?.trim_end_matches(".npy").to_owned();
        let fault = |text: String| Fault::at(format!("array {name}"), text);
        let mut content = Vec::new();
        let read = entry.take(room.bytes + 1).read_to_end(&mut content);
        read.map_err(|error| fault(format!("cannot be expanded ({error}): the file is damaged, save it again")))?;
        let text = || {
            format!("expands, with the arrays before it, to more than {} MiB: save a part of it", limits.bytes >> 20)
        };
        room.bytes = room.bytes.checked_sub(content.len() as u64).ok_or_else(|| fault(text()))?;
        arrays.extend(read_member(&name, &content, &mut room)?);
    }
    Ok(arrays)
}

/// An array of an archive; of a type that is not read an array without numbers whose type says so.
fn read_member(name: &str, content: &[u8], room: &mut Room) -> Result<Vec<Array>, Fault> {
    Ok(match read_array(name, content, room)? {
        Content::Numbers(arrays) => arrays,
        Content::OtherType(OtherType(kind)) => {
            room.take(0)?;
            vec![Array { name: name.into(), kind, shape: Vec::new(), numbers: None }]
        }
    })
}

fn split_header(rest: &[u8]) -> Option<(&[u8], &[u8])> {
    let (version, rest) = rest.split_at_checked(2)?;
    let (length, rest) = match version[0] {
        1 => {
            let (length, rest) = rest.split_at_checked(2)?;
            (usize::from(u16::from_le_bytes(length.try_into().ok()?)), rest)
        }
        _ => {
            let (length, rest) = rest.split_at_checked(4)?;
            (u32::from_le_bytes(length.try_into().ok()?) as usize, rest)
        }
    };
    rest.split_at_checked(length)
}

/// Places in the file of the elements, the first index running fastest.
fn order(shape: &[usize], is_fortran: bool) -> Vec<usize> {
    let n: usize = shape.iter().product();
    if is_fortran || shape.len() < 2 {
        return (0..n).collect();
    }
    (0..n).map(|element| place(shape, element)).collect()
}

/// Place in a file with the last index running fastest of an element counted with the first one running fastest.
fn place(shape: &[usize], element: usize) -> usize {
    let (mut rest, mut place) = (element, 0);
    for (k, extent) in shape.iter().enumerate() {
        place += (rest % extent) * shape[k + 1..].iter().product::<usize>();
        rest /= extent;
    }
    place
}

/// Where in an element a number is, and of which type.
struct Field {
    name: String,
    offset: usize,
    kind: Kind,
}

/// A type of numbers, such as `<f8`.
#[derive(Clone, Copy)]
struct Kind {
    is_big_endian: bool,
    letter: u8,
    bytes: usize,
}

/// The fields of an element and its size in bytes.
fn fields(name: &str, description: &Literal) -> Result<(Vec<Field>, usize), OtherType> {
    match description {
        Literal::Text(text) => {
            let kind = Kind::named(text)?;
            Ok((vec![Field { name: name.into(), offset: 0, kind }], kind.bytes))
        }
        Literal::List(parts) => {
            let (mut fields, mut offset) = (Vec::new(), 0);
            for part in parts {
                let Literal::List(part) = part else { return Err(Kind::unknown(&format!("{part:?}"))) };
                let [Literal::Text(field), Literal::Text(kind)] = &part[..] else {
                    return Err(Kind::unknown("a record of records or of arrays"));
                };
                let kind = Kind::named(kind)?;
                fields.push(Field { name: format!("{name}.{field}"), offset, kind });
                offset += kind.bytes;
            }
            Ok((fields, offset))
        }
        other => Err(Kind::unknown(&format!("{other:?}"))),
    }
}

impl Kind {
    fn unknown(text: &str) -> OtherType {
        OtherType(format!("type {text} is not read, only numbers are: save it with .astype(float)"))
    }

    fn named(text: &str) -> Result<Self, OtherType> {
        let unknown = || Self::unknown(text);
        let mut letters = text.bytes();
        let (order, letter) = (letters.next().ok_or_else(unknown)?, letters.next().ok_or_else(unknown)?);
        let bytes = text.get(2..).and_then(|digits| digits.parse().ok()).ok_or_else(unknown)?;
        let is_known = matches!((letter, bytes), (b'f', 2 | 4 | 8) | (b'i' | b'u', 1 | 2 | 4 | 8) | (b'b', 1));
        let is_order = matches!(order, b'<' | b'>' | b'|' | b'=');
        (is_known && is_order).then_some(Self { is_big_endian: order == b'>', letter, bytes }).ok_or_else(unknown)
    }

    fn shown(self) -> String {
        let name = match self.letter {
            b'f' => "float",
            b'i' => "int",
            b'u' => "uint",
            _ => return "bool".into(),
        };
        format!("{name}{}", 8 * self.bytes)
    }

    /// The number that `bytes` begin with.
    fn number(self, bytes: &[u8]) -> f64 {
        let mut raw = [0u8; 8];
        let own = &bytes[..self.bytes];
        // Least significant byte first.
        raw[..self.bytes].copy_from_slice(own);
        if self.is_big_endian {
            raw[..self.bytes].reverse();
        }
        let bits = u64::from_le_bytes(raw);
        let unused = 64 - 8 * self.bytes as u32;
        match (self.letter, self.bytes) {
            (b'f', 8) => f64::from_bits(bits),
            (b'f', 4) => f64::from(f32::from_bits(bits as u32)),
            (b'f', _) => half(bits as u16),
            (b'i', _) => ((bits << unused) as i64 >> unused) as f64,
            _ => bits as f64,
        }
    }
}

/// A number of 16 bits (IEEE 754 binary16).
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        0x1f if fraction == 0.0 => f64::INFINITY,
        0x1f => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits::COMMAND;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
    }

    #[test]
    fn orders_and_types_are_read() {
        let big = file("{'descr': '>i2', 'fortran_order': False, 'shape': (2, 2)}", &[0, 1, 0, 2, 0, 3, 0xff, 0xfc]);
        assert_eq!(read("a", &big, &LIMITS).unwrap()[0].numbers, Some(vec![1.0, 3.0, 2.0, -4.0]));
        let record =
            file("{'descr': [('t', '<u1'), ('x', '<f4')], 'fortran_order': False, 'shape': (1,)}", &[7, 0, 0, 0, 0x40]);
        let read = read("r", &record, &LIMITS).unwrap();
        assert_eq!([&read[0].name, &read[1].name], ["r.t", "r.x"]);
        assert_eq!([&read[0].numbers, &read[1].numbers], [&Some(vec![7.0]), &Some(vec![2.0])]);
        assert_eq!([half(0x3c00), half(0xc000), half(1)], [1.0, -2.0, 2f64.powi(-24)]);
    }

    #[test]
    fn damaged_files_are_errors() {
        let good = file("{'descr': '<f8', 'fortran_order': False, 'shape': (2,)}", &[0; 16]);
        assert!(read("a", &good, &LIMITS).is_ok());
        for end in 0..good.len() {
            assert!(read("a", &good[..end], &LIMITS).is_err(), "{end}");
        }
        for header in [
            "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 99999999999)}",
            "{'descr': '<c16', 'fortran_order': False, 'shape': (1,)}",
            "{'descr': '|O', 'fortran_order': False, 'shape': (1,)}",
            "{'descr': '<f8', 'shape': 'x'}",
            "{}",
            "no header",
        ] {
            assert!(read("a", &file(header, &[0; 16]), &LIMITS).is_err(), "{header}");
        }
        assert!(read_archive(b"PK\x03\x04", &LIMITS).is_err() && read_archive(b"", &LIMITS).is_err());
    }
}
