//! A migrated arm is the old one: byte by byte in its tables, and in its comments.

use std::path::{Path, PathBuf};

use darm_core::table::Record;
use darm_core::units::Digest;

use super::edit::DEFAULT;
use super::read;
use crate::arm::Arm;
use crate::board_profile::BoardProfile;
use crate::plan::{Visit, plan};

fn old(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/arms-format-1").join(name)
}

/// The image in a table file: behind the first line and the digest, before the check sum.
fn golden(name: &str) -> Vec<u8> {
    let file = std::fs::read(old(name)).unwrap();
    file["darm table 2\n".len() + 32..file.len() - 4].to_vec()
}

fn records(image: &[u8]) -> Vec<Record> {
    let (mut records, mut rest) = (Vec::new(), image);
    while !rest.is_empty() {
        let (record, after) = postcard::take_from_bytes(rest).unwrap();
        records.push(record);
        rest = after;
    }
    records
}

/// The image with another number of its model, which names the text of the arm file and so changes with its format.
fn with_model(image: &[u8], of: &Record) -> Vec<u8> {
    let mut records = records(image);
    let (Record::Start { model, .. }, Record::Start { model: wanted, .. }) = (&mut records[0], of) else {
        panic!("a table begins with its start");
    };
    *model = *wanted;
    records.iter().flat_map(|record| postcard::to_stdvec(record).unwrap()).collect()
}

#[test]
fn the_table_of_a_migrated_arm_is_that_of_the_old_version_byte_by_byte() {
    let cases: [(&str, &[&str], Option<f64>, f64); 3] = [
        ("planar4", &["000010000000", "111111110000", "000000000000"], None, 0.5),
        ("planar4-hybrid", &["000010000000", "111111110000"], Some(20.0), 0.5),
        ("mixed", &["101", "210", "000"], Some(30.0), 0.1),
    ];
    for (name, words, servo_deg, dwell_s) in cases {
        let migrated = read(&old(&format!("{name}.toml")), Path::new("new.toml"), Path::new("board.toml")).unwrap();
        let arm = Arm::parse(Path::new("new.toml"), &migrated.arm).unwrap();
        assert_eq!(arm.profile.as_deref(), Some(Path::new("board.toml")));
        let profile = BoardProfile::parse(Path::new("board.toml"), &migrated.profile.to_toml()).unwrap();
        assert_ne!(profile.profile.digest, Digest::default());
        let visits = words.iter().map(|word| Visit {
            word: word.parse().unwrap(),
            servos_rad: servo_deg.map(f64::to_radians).into_iter().collect(),
            dwell_s,
            label: (*word).to_owned(),
        });
        let plan = plan(&arm, &visits.collect::<Vec<_>>(), &profile.board(None), &[]).unwrap();
        let golden = golden(&format!("{name}.darm"));
        assert_eq!(with_model(plan.image.bytes(), &records(&golden)[0]), golden, "{name}");
    }
}

#[test]
fn limits_that_the_old_file_did_not_have_are_marked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.toml");
    let text = std::fs::read_to_string(old("mixed.toml")).unwrap();
    std::fs::write(&path, &text).unwrap();
    let given = text.matches("duty_percent").count();
    let made = read(&path, Path::new("new.toml"), Path::new("board.toml")).unwrap();
    let marked =
        |key: &str| made.profile_text.lines().filter(|line| line.starts_with(key) && line.ends_with(DEFAULT)).count();
    assert_eq!(marked("duty_percent"), made.profile.profile.outputs.iter().flatten().count() - given);
    assert!(marked("duty_percent") > 0 && marked("line") == 0, "{}", made.profile_text);
    let read = BoardProfile::parse(Path::new("board.toml"), &made.profile_text).unwrap();
    assert_eq!(read, made.profile, "comments change nothing");
}

#[test]
fn comments_and_layout_are_kept() {
    let text = std::fs::read_to_string(old("mixed.toml")).unwrap();
    let new = read(&old("mixed.toml"), Path::new("arms/new.toml"), Path::new("boards/board.toml")).unwrap().arm;
    let comments = |text: &str| -> Vec<String> {
        text.lines().filter_map(|line| line.split_once('#')).map(|(_, comment)| comment.to_owned()).collect()
    };
    assert_eq!(comments(&new), comments(&text));
    let lines = [
        "profile = \"../boards/board.toml\"",
        "outputs = [7, 1]",
        "switch = { closed_in = [0, 2] } # a reed contact",
        "output = 9 # the black one",
        "servo = { id = 2, min_deg = -90, max_deg = 90 } # elbow",
    ];
    for line in lines {
        assert!(new.lines().any(|new| new == line), "{line} is not in\n{new}");
    }
    let kept = new.lines().filter(|line| text.lines().any(|old| old == *line)).count();
    assert_eq!(kept, new.lines().count() - 7, "format, profile, outputs, switch and servo\n{new}");
}

#[test]
fn what_is_not_of_format_1_or_makes_no_profile_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.toml");
    let text = std::fs::read_to_string(old("mixed.toml")).unwrap();
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = read(&path, &folder.path().join("new.toml"), Path::new("board.toml")).unwrap_err();
        error.to_string().replace(&format!("{}/", folder.path().display()), "")
    };
    assert_eq!(
        refused("format = 1", "format = 2"),
        "old.toml:2:10: the file has format 2; only files of format 1 are brought over"
    );
    let twice = refused("line = 4", "line = 3");
    assert!(twice.contains("make no profile: ") && twice.contains("line 3 is used twice"), "{twice}");
    let twice = refused("output = 9", "output = 7");
    assert!(twice.contains("output 7 is used twice"), "{twice}");
    let unknown = refused("travel_ms", "travels_ms");
    assert!(unknown.contains("is refused: new.toml:") && unknown.contains("`travels_ms`"), "{unknown}");
}
