//! The text of a URDF: the elements that are not read are blanked, and what does not parse has a place.

use std::ops::Range;

use quick_xml::Reader;
use quick_xml::events::Event;

/// Elements that mean nothing to kinematics and dynamics, wherever they stand.
const NOT_READ: [&[u8]; 6] = [b"visual", b"collision", b"transmission", b"gazebo", b"material", b"sensor"];

/// A file that is not XML: the byte where that is found, and why.
pub(super) struct NotXml {
    pub(super) span: Range<usize>,
    pub(super) reason: String,
}

/// The text with spaces in place of the elements that are not read, so that everything else keeps its place, and the
/// spans of the children of the root.
pub(super) struct Outline {
    pub(super) text: String,
    pub(super) children: Vec<Range<usize>>,
}

/// Reads the structure of a file.
pub(super) fn outline(text: &str) -> Result<Outline, NotXml> {
    let mut reader = Reader::from_str(text);
    let (mut kept, mut children) = (text.as_bytes().to_vec(), Vec::new());
    let mut open: Vec<usize> = Vec::new();
    // Start of the element that is not read, and how many elements are open around it.
    let mut skipped: Option<(usize, usize)> = None;
    loop {
        let start = position(reader.buffer_position(), text);
        let event = reader.read_event().map_err(|error| {
            let at = position(reader.error_position(), text);
            NotXml { span: at..text.len(), reason: error.to_string() }
        })?;
        let end = position(reader.buffer_position(), text);
        let is_skipped = |name: &[u8]| NOT_READ.contains(&name);
        match event {
            Event::Start(tag) => {
                if skipped.is_none() && is_skipped(tag.local_name().as_ref()) {
                    skipped = Some((start, open.len()));
                }
                open.push(start);
            }
            Event::Empty(tag) => {
                if skipped.is_none() && is_skipped(tag.local_name().as_ref()) {
                    blank(&mut kept[start..end]);
                } else if open.len() == 1 {
                    children.push(start..end);
                }
            }
            Event::End(_) => {
                let first = open.pop().unwrap_or(start);
                match skipped {
                    Some((from, depth)) if depth == open.len() => {
                        blank(&mut kept[from..end]);
                        skipped = None;
                    }
                    None if open.len() == 1 => children.push(first..end),
                    _ => {}
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if let Some(&start) = open.last() {
        return Err(NotXml { span: start..text.len(), reason: "the element is not closed".into() });
    }
    // Elements begin and end between characters, and a blank is one byte for each byte.
    Ok(Outline { text: String::from_utf8(kept).unwrap_or_else(|_| text.into()), children })
}

fn position(offset: u64, text: &str) -> usize {
    usize::try_from(offset).map_or(text.len(), |offset| offset.min(text.len()))
}

fn blank(bytes: &mut [u8]) {
    bytes.iter_mut().filter(|byte| **byte != b'\n').for_each(|byte| *byte = b' ');
}
