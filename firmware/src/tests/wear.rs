//! How often a host may have the flash written.

use darm_core::wire::message::{Answer, CHUNK, Calibration, Refusal, Request};

use super::fakes::{Cells, profile, profile_image, table};
use super::{Bench, loaded};
use crate::kept::Kept;

/// Tables and calibrations that may be written at once.
const TABLES: u64 = 200;
const CALIBRATIONS: u64 = 6;

fn calibrate(bench: &Bench, number: u64) -> Result<Answer, Refusal> {
    bench.ask(Request::Calibrate(Calibration::try_from([1e-3 * number as f32; 4]).unwrap()))
}

/// Begins the upload of another table and sends its first piece, which erases a page.
fn begin(bench: &Bench, model: u64) -> Result<Answer, Refusal> {
    let (image, bytes) = table(model, 40, false);
    bench.ask(Request::Begin(image))?;
    bench.ask(Request::Chunk { offset: 0, bytes: &bytes[..CHUNK] })
}

fn wait(refused: Result<Answer, Refusal>) -> u32 {
    match refused {
        Err(Refusal::TooSoon { wait_ms }) => wait_ms,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_seventh_calibration_in_a_row_is_refused_until_the_time_that_the_refusal_names() {
    let bench = loaded();
    for number in 1..=CALIBRATIONS {
        assert_eq!(calibrate(&bench, number), Ok(Answer::Done));
    }
    let before = bench.cells.copy();
    let wait_ms = wait(calibrate(&bench, 7));
    assert!((9_900..=10_000).contains(&wait_ms), "{wait_ms}");
    assert!(bench.cells.is_equal(&before), "the flash was written");
    assert_eq!(calibrate(&bench, CALIBRATIONS), Ok(Answer::Done), "what is stored already is not written");
    bench.pass_ms(wait_ms);
    assert_eq!(calibrate(&bench, 7), Ok(Answer::Done));
    wait(calibrate(&bench, 8));
}

#[test]
fn uploads_that_erase_the_same_page_again_and_again_are_refused_and_leave_the_flash_alone() {
    let bench = loaded();
    for model in 2..=TABLES {
        begin(&bench, model).unwrap();
    }
    let before = bench.cells.copy();
    let wait_ms = wait(begin(&bench, 1_000));
    assert!((50_000..=60_000).contains(&wait_ms), "{wait_ms}");
    assert_eq!(begin(&bench, TABLES).map(|_| ()), Ok(()), "the upload that is under way continues");
    assert!(bench.cells.is_equal(&before), "the flash was written");
    bench.button.set(true);
    assert_eq!(bench.upload(&profile_image(&profile())), Ok(Answer::Done), "a person at the board writes a profile");
    bench.pass_ms(wait_ms);
    assert_eq!(bench.upload(&table(1_000, 10, false)), Ok(Answer::Committed { rows: 10 }));
}

#[test]
fn somebody_who_uploads_one_table_after_the_other_is_not_refused() {
    let bench = loaded();
    for model in 2..=TABLES {
        assert_eq!(bench.upload(&table(model, 4, false)), Ok(Answer::Committed { rows: 4 }));
        bench.pass_ms(20);
    }
}

#[test]
fn a_reset_does_not_allow_more_writes_and_one_without_supply_allows_the_first_ones() {
    let kept: &'static Kept = Box::leak(Box::new(Kept::new()));
    kept.set_missing_ms([0, 0]);
    let mut cells = Cells::with_profile();
    for model in 1..=TABLES {
        // A reset after every other upload.
        let bench = Bench::reset(cells, Some(kept));
        bench.connect();
        begin(&bench, model).unwrap();
        cells = bench.cells;
    }
    let bench = Bench::reset(cells, Some(kept));
    bench.connect();
    wait(begin(&bench, 1_000));
    assert_eq!(calibrate(&bench, 1), Ok(Answer::Done), "calibrations are counted apart");
    let again = Bench::switched_on(bench.cells);
    again.connect();
    begin(&again, 1_001).unwrap();
}
