//! Damaged table files are refused.

use std::path::Path;

use crate::arm::Arm;
use crate::plan::{Visit, plan};
use crate::wired_arm::profile_of;

use super::{TableFile, bytes, digest, records};

fn file() -> Vec<u8> {
    let arm = Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml")).unwrap();
    let visit = Visit { word: "000010000000".parse().unwrap(), servos_rad: vec![], dwell_s: 0.1, label: "A".into() };
    let profile = profile_of(&arm, None).unwrap();
    bytes(&plan(&arm, &[visit], &profile.board(None), &[]).unwrap().image)
}

#[test]
fn a_file_with_any_one_bit_changed_or_cut_off_anywhere_is_refused() {
    let (path, mut file) = (Path::new("a.darm"), file());
    assert!(TableFile::parse(path, &file).is_ok());
    for bit in 0..8 * file.len() {
        file[bit / 8] ^= 1 << (bit % 8);
        assert!(TableFile::parse(path, &file).is_err(), "bit {} of byte {}", bit % 8, bit / 8);
        file[bit / 8] ^= 1 << (bit % 8);
    }
    for end in 0..file.len() {
        assert!(TableFile::parse(path, &file[..end]).is_err(), "{end} bytes");
    }
}

#[test]
fn a_file_that_is_cut_off_is_reported_as_truncated() {
    let file = file();
    let error = TableFile::parse(Path::new("a.darm"), &file[..file.len() - 6]).err().unwrap().to_string();
    let expected = format!("a.darm is truncated: its {} bytes end after 1 rows", file.len() - 6);
    assert!(error.starts_with(&expected), "{error}");
}

#[test]
fn a_digest_has_sixty_four_digits() {
    let table = TableFile::parse(Path::new("a.darm"), &file()).unwrap().digest();
    let text = table.to_string();
    assert_eq!(digest(&text), Some(table));
    for wrong in [&text[1..], &format!("{text}0"), &text.replacen(&text[..1], "+", 1), ""] {
        assert_eq!(digest(wrong), None, "{wrong}");
    }
}

#[test]
fn the_offset_of_invalid_bytes_is_reported() {
    assert_eq!(records(&[]), Ok(vec![]));
    assert_eq!(records(&[0xff, 1]), Err(0));
}
