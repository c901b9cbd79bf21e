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
    let by_pandas = |what: &str, read: &str| {
        // Lists in a cell, such as the joint positions of LeRobot, become columns NAME_0, NAME_1, …
        let script = format!(
            "import pandas as p; d = p.{read}('{file}'); \
             l = [k for k in d if hasattr(d[k][0], '__len__') and not isinstance(d[k][0], (str, bytes, dict))]; \
             d.drop(columns=l).join([p.DataFrame(d[k].tolist()).add_prefix(k + '_') for k in l]).to_csv('log.csv', index=False)"
        );
        Some(format!("{what} is not read; convert it with `python3 -c \"{script}\"`, then `darm import log.csv`"))
    };
    if bytes.starts_with(b"PAR1") || end == "parquet" {
        return by_pandas("Parquet", "read_parquet");
    }
    if bytes.starts_with(b"ARROW1") || bytes.starts_with(b"FEA1") {
        return by_pandas("Feather", "read_feather");
    }
    if bytes.starts_with(b"PK\x03\x04") && (has(b"xl/workbook") || has(b"opendocument.spreadsheet")) {
        return Some(format!(
            "a spreadsheet is not read; save its sheet as CSV, or convert it with `libreoffice --headless --convert-to csv \
             {file}`, then run `darm import` on that"
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
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Some(format!(
            "the text is in UTF-16; convert it with `iconv -f UTF-16 -t UTF-8 {file} > log.csv`, then run `darm import log.csv`"
        ));
    }
    None
}

/// What a file is that `darm import` reads and no other command does, and the command that converts it.
pub fn imported(path: &Path, bytes: &[u8]) -> Option<String> {
    let what = match bytes {
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => "an array of NumPy",
        [b'P', b'K', 3, 4, ..] => "an archive of NumPy",
        [b'M', b'A', b'T', b'L', b'A', b'B', ..] => "a file of MATLAB",
        _ => return None,
    };
    let file = path.display();
    Some(format!(
        "{what} is no table of measurements; convert it with `darm import {file} -o log.csv`, and give log.csv"
    ))
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
            ("a.csv", b"\xff\xfea\0", "iconv -f UTF-16 -t UTF-8 a.csv"),
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
