//! Files of other programs, by what their bytes begin with, and the command that converts each.

use std::path::Path;

/// What to do about a bag in SQLite.
pub const CONVERT_BAG: &str = "convert it: write `output_bags: [{uri: bag_mcap, storage_id: mcap, all: true}]` to convert.yaml, \
                               run `ros2 bag convert -i BAG -o convert.yaml`, then `darm import bag_mcap`";

/// What a file is that nothing here reads, and the command that converts it; `None` of other files.
pub fn unread(path: &Path, bytes: &[u8]) -> Option<String> {
    let file = path.display();
    let end = path.extension().and_then(|end| end.to_str()).unwrap_or_default().to_lowercase();
    let has = |text: &[u8]| bytes.windows(text.len()).any(|part| part == text);
    let by_pandas = |what: &str, read: &str, options: &str| {
        // Lists in a cell, such as the joint positions of LeRobot, become columns NAME_0, NAME_1, …
        let script = format!(
            "import pandas as p; d = p.{read}('{file}'{options}); \
             l = [k for k in d if hasattr(d[k][0], '__len__') and not isinstance(d[k][0], (str, bytes, dict))]; \
             d.drop(columns=l).join([p.DataFrame(d[k].tolist()).add_prefix(k + '_') for k in l]).to_csv('log.csv', index=False)"
        );
        Some(format!("{what} is not read; convert it with `python3 -c \"{script}\"`, then `darm import log.csv`"))
    };
    if bytes.starts_with(b"PAR1") || end == "parquet" {
        return by_pandas("Parquet", "read_parquet", "");
    }
    if bytes.starts_with(b"ARROW1") || bytes.starts_with(b"FEA1") {
        return by_pandas("Feather", "read_feather", "");
    }
    if bytes.starts_with(b"PK\x03\x04") && (has(b"xl/workbook") || has(b"opendocument.spreadsheet")) {
        return Some(format!(
            "a spreadsheet is not read; save its sheet as CSV, or convert it with `libreoffice --headless --convert-to csv \
             {file}`, then run `darm import` on that"
        ));
    }
    let packed: [(&[u8], &str); 3] = [(b"PK\x03\x04", "unzip"), (b"BZh", "bunzip2 -k"), (b"\xfd7zXZ\0", "unxz -k")];
    let unpack = packed.into_iter().find(|(start, _)| bytes.starts_with(start) && !has(b".npy"));
    if let Some((_, command)) = unpack {
        return Some(format!(
            "an archive is not read; unpack it with `{command} {file}`, and run `darm import` on a file of it"
        ));
    }
    if bytes.starts_with(b"\x89HDF") && end != "mat" {
        return Some(format!(
            "HDF5 is not read; convert it with `python3 -c \"import h5py as h, numpy as n; d = {{}}; f = h.File('{file}'); \
             f.visititems(lambda k, v: d.update({{k.replace('/', '.'): v[()]}}) if isinstance(v, h.Dataset) else None); \
             n.savez('log.npz', **d)\"`, then `darm import log.npz`"
        ));
    }
    if bytes.starts_with(b"\xd0\xcf\x11\xe0") {
        return Some(format!(
            "an old spreadsheet is not read; convert it with `libreoffice --headless --convert-to csv {file}`, then run `darm \
             import` on that"
        ));
    }
    if bytes.starts_with(b"SQLite format 3\0") {
        return Some(format!("a bag in SQLite is not read, only MCAP is: {CONVERT_BAG}"));
    }
    if bytes.starts_with(b"#ROSBAG V") {
        return Some(format!(
            "a bag of ROS 1 is not read; convert it with `rosbags-convert --src {file} --dst log --dst-storage mcap`, then \
             `darm import log`"
        ));
    }
    if bytes.starts_with(b"ULog\x01\x12\x35") {
        return Some(format!(
            "a ULog is not read; convert it with `ulog2csv {file}`, then run `darm import` on a file of it"
        ));
    }
    if end == "json" {
        return by_pandas("JSON", "read_json", "");
    }
    if matches!(&end[..], "jsonl" | "ndjson") {
        return by_pandas("JSON", "read_json", ", lines=True");
    }
    if bytes.trim_ascii_start().starts_with(b"<") {
        return Some("XML or HTML is no table; save it as CSV with the program that wrote it".into());
    }
    if has(b"\n---\n")
        && bytes.split(|byte| *byte == b'\n').next().is_some_and(|line| line.trim_ascii_end().ends_with(b":"))
    {
        return Some(
            "YAML, as `ros2 topic echo` prints it, is not read; print it with `ros2 topic echo --csv`, or with `rostopic echo -p`"
                .into(),
        );
    }
    None
}

/// A text in UTF-16, with or without a byte order mark, as spreadsheets save it; `None` of other bytes.
pub(crate) fn utf_16(bytes: &[u8]) -> Option<String> {
    // Without a mark a text shows it by its first character, which is of ASCII in every table.
    let is_big = match bytes {
        [0xff, 0xfe, ..] => false,
        [0xfe, 0xff, ..] => true,
        [0, 1..=255, ..] => true,
        [1..=255, 0, ..] => false,
        _ => return None,
    };
    let unit = |pair: &[u8; 2]| if is_big { u16::from_be_bytes(*pair) } else { u16::from_le_bytes(*pair) };
    // The last one may be cut.
    let units: Vec<u16> = bytes.as_chunks().0.iter().map(unit).collect();
    let text = String::from_utf16(&units)
        .ok()
        .filter(|text| !text.contains(|c: char| c.is_control() && !c.is_whitespace()))?;
    Some(text.trim_start_matches('\u{feff}').to_owned())
}

/// What a file is that `darm import` reads and no other command does, and the command that converts it.
pub fn imported(path: &Path, bytes: &[u8]) -> Option<String> {
    let what = match bytes {
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => "an array of NumPy",
        [b'P', b'K', 3, 4, ..] => "an archive of NumPy",
        [b'M', b'A', b'T', b'L', b'A', b'B', ..] => "a file of MATLAB",
        _ if utf_16(bytes).is_some() => "a text in UTF-16",
        _ => return None,
    };
    let file = path.display();
    Some(format!(
        "{what} is no table of measurements; convert it with `darm import {file} -o log.csv`, and give log.csv"
    ))
}

/// What to do about a table with a row of units below its header.
pub(crate) fn row_of_units(path: &Path, line: usize) -> String {
    let file = path.display();
    format!("line {line} has units, which `darm import` reads; run `darm import {file} -o log.csv`, and give log.csv")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_programs_have_the_command_that_converts_them() {
        let said =
            |name: &str, bytes: &[u8]| unread(Path::new(name), bytes).or_else(|| imported(Path::new(name), bytes));
        for (name, bytes, command) in [
            ("a.parquet", &b"PAR1\0"[..], "p.read_parquet('a.parquet')"),
            ("a.feather", b"ARROW1\0", "p.read_feather('a.feather')"),
            ("a.xlsx", b"PK\x03\x04..xl/workbook.xml", "libreoffice --headless --convert-to csv a.xlsx"),
            ("a.db3", b"SQLite format 3\0", "ros2 bag convert"),
            ("a.bag", b"#ROSBAG V2.0\n", "rosbags-convert --src a.bag"),
            ("a.csv", b"\xff\xfea\0", "darm import a.csv -o log.csv"),
            ("a.jsonl", b"{\"t\":1}\n", "p.read_json('a.jsonl', lines=True)"),
            ("a.csv", b"\n<?xml version", "save it as CSV"),
            ("a.zip", b"PK\x03\x04 log.csv", "unzip a.zip"),
            ("a.h5", b"\x89HDF\r\n", "h.File('a.h5')"),
            ("a.npz", b"PK\x03\x04 q.npy", "darm import a.npz -o log.csv"),
            ("a.npy", b"\x93NUMPY", "darm import a.npy -o log.csv"),
            ("a.mat", b"MATLAB 5.0", "darm import a.mat -o log.csv"),
        ] {
            let said = said(name, bytes).unwrap_or_default();
            assert!(said.contains(command), "{name}: {said}");
        }
        assert_eq!(said("a.csv", b"time_s,q1_deg\n0,1\n"), None);
    }
}
