//! Damaged and foreign files are errors that say where and what to do, and none panics.

use std::path::{Path, PathBuf};

use darm_measure::import::mapping::{Entry, Mapping};
use darm_measure::import::read::Dialect;
use darm_measure::import::table::Table;
use darm_measure::import::{proposal, read};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// What reading and converting these bytes reports; `ok` where nothing is wrong.
fn reported(name: &str, bytes: &[u8], entries: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let table = read(&path, Dialect::default()).and_then(|recording| {
        let entries: Vec<Entry> = entries.iter().map(|entry| entry.parse().unwrap()).collect();
        let given = Mapping { entries, ..Mapping::default() };
        let mapping = if given.entries.is_empty() { proposal::propose(&recording, &[]) } else { given };
        Table::new(&[recording], &mapping)
    });
    table.map_or_else(|error| error.to_string().replace(&path.display().to_string(), name), |_| "ok".into())
}

#[test]
fn truncated_and_changed_files_are_errors() {
    for name in ["foreign-arrays.npz", "foreign-matlab.mat", "foreign-ros2.mcap"] {
        let good = std::fs::read(root().join("examples").join(name)).unwrap();
        assert_eq!(reported(name, &good, &[]), "ok", "{name}");
        for end in (0..good.len()).step_by(17) {
            let _ = reported(name, &good[..end], &[]);
        }
        for at in (0..good.len()).step_by(13) {
            let mut bad = good.clone();
            bad[at] ^= 0x55;
            let _ = reported(name, &bad, &[]);
        }
    }
    let archive = std::fs::read(root().join("examples/foreign-arrays.npz")).unwrap();
    assert!(reported("a.npz", &archive[..500], &[]).starts_with("a.npz: no ZIP archive that can be read"));
    assert!(reported("a.npy", b"\x93NUMPX", &[]).starts_with("a.npy: array a: the bytes do not begin"));
}

#[test]
fn formats_that_are_not_read_have_a_cure() {
    let version_7_3 = [b"MATLAB 7.3 MAT-file".as_slice(), &[b' '; 493], b"\x89HDF\r\n\x1a\n"].concat();
    for (name, bytes, expected) in [
        ("a.mat", &version_7_3[..], "save it in MATLAB with save('log.mat', '-v7')"),
        ("a.mat", b"1 2 3\n", "no MAT-file of level 5"),
        ("a.db3", b"SQLite format 3\0", "ros2 bag convert"),
        ("a.bag", b"#ROSBAG V2.0\n", "rosbags-convert"),
        ("a.bin", &[1, 0, 2, 0], "no format that is known"),
        ("a.zip", b"PK\x03\x04 log.csv", "unzip"),
        ("a.mcap", b"\x89MCAP", "does not begin as an MCAP log"),
    ] {
        let error = reported(name, bytes, &[]);
        assert!(error.starts_with(name) && error.contains(expected), "{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let bag = |text: &str| {
        std::fs::write(folder.path().join("metadata.yaml"), text).unwrap();
        read(folder.path(), Dialect::default()).unwrap_err().to_string()
    };
    assert!(bag("  storage_identifier: sqlite3\n").contains("ros2 bag convert"));
    assert!(bag("  storage_identifier: mcap\n  relative_file_paths:\n  - a.mcap\n").contains("a.mcap: cannot be read"));
    assert!(bag("storage_identifier: mcap\n").contains("names no file"));
    let other = tempfile::tempdir().unwrap();
    assert!(read(other.path(), Dialect::default()).unwrap_err().to_string().contains("no metadata.yaml"));
}

#[test]
fn mappings_that_do_not_fit_are_reported() {
    let text = b"Time [s],angle [deg],x,x,note\n0,1,2,3,a\n1,nan,2,3,b\n";
    for (entries, expected) in [
        (
            &["q1_rad=angel"][..],
            "log.csv: `q1_rad=angel`: no column `angel`; the recording has Time [s], angle [deg], x_1, x_2, note",
        ),
        (&["x_m=x"], "log.csv: `x_m=x`: no column `x`; the recording has Time [s], angle [deg], x_1, x_2"),
        (&["x_m=angle"], "log.csv: `x_m=angle`: deg (angle) does not convert to m (length)"),
        (&["q1=angle*deg"], "log.csv: `q1=angle*deg`: q1 ends in no unit"),
        (&["q1_rad=note"], "log.csv:2: `q1_rad=note`: column note holds `a`, expected a number"),
        (&["q1_rad=angle", "q1_rad=3"], "log.csv: `q1_rad=3`: the target q1_rad is given twice"),
        (&["q*_rad=z*"], "log.csv: `q*_rad=z*`: no column matches"),
        (&["x_m=3", "q1_rad=angle", "word=note"], "ok"),
    ] {
        let error = reported("log.csv", text, entries);
        assert!(error.starts_with(expected), "{error}");
    }
}

/// What a header or a message says costs memory and time before anything is read: limits hold there too.
#[test]
fn names_and_dimensions_without_end_are_refused() {
    let element = |kind: u32, content: &[u8]| {
        let padding = vec![0; content.len().next_multiple_of(8) - content.len()];
        [&kind.to_le_bytes()[..], &(content.len() as u32).to_le_bytes(), content, &padding].concat()
    };
    // A struct without elements whose fields have names of one byte each.
    let names = |n: usize| {
        let parts = [
            element(6, &[2u32.to_le_bytes(), 0u32.to_le_bytes()].concat()),
            element(5, &[0u32.to_le_bytes(), 1u32.to_le_bytes()].concat()),
            element(1, b"q"),
            element(5, &1u32.to_le_bytes()),
            element(1, &vec![b'a'; n]),
        ];
        let mut header = [b' '; 128];
        header[..6].copy_from_slice(b"MATLAB");
        header[124..].copy_from_slice(&[0, 1, b'I', b'M']);
        [&header[..], &element(14, &parts.concat())].concat()
    };
    let error = reported("a.mat", &names(1 << 20), &[]);
    assert!(error.contains("arrays: save a part of it"), "{error}");
    let array = |n: usize| {
        let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({}), }}\n", "1,".repeat(n));
        [b"\x93NUMPY\x02\x00", &(header.len() as u32).to_le_bytes()[..], header.as_bytes(), &[0]].concat()
    };
    assert!(reported("a.npy", &array(33), &[]).contains("its header is none of NumPy"));
    assert!(reported("a.npy", &array(1 << 16), &[]).contains("its header is longer than 65536 bytes"));
}
