//! Power cuts after every word of flash.
use super::layout::RECORDS_BYTES;
use super::*;
use crate::tests::fakes::{Cells, MockFlash, profile, profile_image, run, table};
use darm_core::output::SwitchLimit;
use darm_core::units::{DeviceId, ModelHash};

const ENDLESS: u32 = u32::MAX;

fn calibration() -> Calibration {
    Calibration::try_from([0.1, 0.2, 0.3, 0.4]).unwrap()
}

/// Loads by `load` under the profile of the small arm.
fn with_board<T>(load: impl FnOnce(&Board<'_>) -> T) -> T {
    load(&Board { device: Some(DeviceId([7; 12])), profile: &profile() })
}

fn now<T>(future: impl Future<Output = T>) -> T {
    run(future, || {})
}

fn open(cells: &Cells, words: u32) -> Store<MockFlash> {
    now(Store::open(cells.flash(words)))
}

/// Uploads a table and commits it; whether that was confirmed.
fn upload(store: &mut Store<MockFlash>, model: u64, rows: u64) -> bool {
    let (image, bytes) = table(model, rows, true);
    let Ok(next) = now(store.begin(image)) else { return false };
    let mut next = next as usize;
    while next < bytes.len() {
        let end = bytes.len().min(next + 100);
        match now(store.chunk(next as u32, &bytes[next..end])) {
            Ok(wanted) => next = wanted as usize,
            Err(_) => return false,
        }
    }
    let mut table = Box::<Table>::default();
    with_board(|board| now(store.load_upload(&mut table, board))).is_ok() && now(store.commit()).is_ok()
}

/// The model of the table that a start finds; every row of it must be there.
fn boot(cells: &Cells) -> Option<u64> {
    let mut store = open(cells, ENDLESS);
    let mut table = Box::<Table>::default();
    let loaded = with_board(|board| now(store.load_valid(&mut table, board))).unwrap();
    assert_eq!(now(store.calibration()), Ok(Some(calibration())));
    loaded.then(|| {
        let model = table.model().0;
        assert_eq!(table.rows().len() as u64, rows_of(model));
        model
    })
}

fn rows_of(model: u64) -> u64 {
    3 + model * 7 % 40
}

fn with_table(model: u64) -> Cells {
    let cells = Cells::erased();
    let mut store = open(&cells, ENDLESS);
    now(store.set_calibration(calibration())).unwrap();
    assert!(upload(&mut store, model, rows_of(model)));
    cells
}

#[test]
fn a_cut_after_every_word_leaves_the_old_or_the_new_table() {
    let old = with_table(1);
    let mut outcomes = [0, 0];
    for words in 1.. {
        let cells = old.copy();
        let confirmed = upload(&mut open(&cells, words), 2, rows_of(2));
        let found = boot(&cells).unwrap();
        assert!(if confirmed { found == 2 } else { found == 1 || found == 2 }, "after {words} words: {found}");
        outcomes[found as usize - 1] += 1;
        if confirmed {
            break;
        }
    }
    assert!(outcomes[0] > 256 && outcomes[1] > 0, "{outcomes:?}");
}

#[test]
fn a_life_of_power_cuts_loses_nothing() {
    let cells = with_table(1);
    let mut random = 0x2545_f491_u32;
    let mut held = 1;
    for model in 2..400 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let words = random >> 8 & 0x1ff;
        let confirmed = upload(&mut open(&cells, words), model, rows_of(model));
        let found = boot(&cells).unwrap();
        assert!(found == model || (found == held && !confirmed), "after {words} words: {found}");
        held = found;
    }
    assert!(held > 300);
}

#[test]
fn starts_are_counted_and_the_records_turn_over() {
    let cells = with_table(1);
    for boots in 1..1500 {
        assert_eq!(now(open(&cells, ENDLESS).count_boot()), Ok(boots));
    }
    assert_eq!(boot(&cells), Some(1));
}

#[test]
fn an_upload_resumes_and_ignores_what_it_has() {
    let cells = with_table(1);
    let mut store = open(&cells, ENDLESS);
    let (image, bytes) = table(2, 5, false);
    assert_eq!(now(store.chunk(0, &bytes[..10])), Err(UploadError::NoUpload));
    assert_eq!(now(store.begin(image)), Ok(0));
    assert_eq!(now(store.chunk(0, &bytes[..10])), Ok(10));
    assert_eq!(now(store.chunk(0, &bytes[..10])), Ok(10));
    assert_eq!(now(store.chunk(20, &bytes[20..30])), Ok(10));
    assert_eq!(now(store.begin(image)), Ok(10));
    assert!(!store.is_complete(image));
    assert_eq!(now(store.chunk(10, &bytes[10..])), Ok(image.len));
    assert!(store.is_complete(image));
    assert_eq!(now(store.begin(Image { digest: Digest([0; 32]), ..image })), Ok(0));
    assert_eq!(
        now(store.begin(Image { len: SLOT_BYTES as u32 + 1, ..image })),
        Err(UploadError::TooLong { max: SLOT_BYTES as u32 })
    );
}

#[test]
fn a_damaged_image_is_refused_and_the_old_table_stays() {
    let cells = with_table(1);
    let mut store = open(&cells, ENDLESS);
    let (image, mut bytes) = table(2, 5, false);
    bytes[20] ^= 1;
    now(store.begin(image)).unwrap();
    now(store.chunk(0, &bytes)).unwrap();
    let mut table = Box::<Table>::default();
    assert_eq!(with_board(|board| now(store.load_upload(&mut table, board))), Err(LoadError::Damaged));
    assert_eq!(now(store.commit()), Err(UploadError::NoUpload));
    assert_eq!(boot(&cells), Some(1));
}

#[test]
fn an_image_of_another_model_is_refused() {
    let cells = with_table(1);
    let mut store = open(&cells, ENDLESS);
    let (image, bytes) = table(2, 5, false);
    now(store.begin(Image { model: ModelHash(3), ..image })).unwrap();
    now(store.chunk(0, &bytes)).unwrap();
    assert_eq!(
        with_board(|board| now(store.load_upload(&mut Box::<Table>::default(), board))),
        Err(LoadError::Damaged)
    );
}

#[test]
fn an_empty_flash_holds_nothing() {
    let mut store = open(&Cells::erased(), ENDLESS);
    let mut table = Box::<Table>::default();
    assert_eq!(with_board(|board| now(store.load_valid(&mut table, board))), Ok(false));
    assert_eq!(now(store.calibration()), Ok(None));
    assert_eq!(now(store.count_boot()), Ok(1));
}

/// A record that is lost would read as one that was never written: no calibration, no profile.
#[test]
fn no_damaged_byte_makes_a_record_absent() {
    let whole = with_table(1);
    assert!(upload_profile(&mut open(&whole, ENDLESS), 1) && upload_profile(&mut open(&whole, ENDLESS), 2));
    (1..=3).for_each(|starts| assert_eq!(now(open(&whole, ENDLESS).count_boot()), Ok(starts)));
    let (mut kept, mut refused) = (0, 0);
    for at in 2 * SLOT_BYTES..2 * SLOT_BYTES + RECORDS_BYTES {
        let Some(cells) = whole.flipped(at) else { continue };
        let mut store = open(&cells, ENDLESS);
        let mut found = Profile::empty();
        let profile = now(store.load_valid_profile(&mut found));
        match (store.is_readable(), now(store.calibration())) {
            (true, Ok(stored)) => {
                assert_eq!((stored, profile), (Some(calibration()), Ok(true)), "byte {at}");
                assert_eq!(found.supply.new_coils, 2, "byte {at}");
                assert_eq!(now(store.count_boot()), Ok(4), "byte {at}: a number of starts repeats its challenges");
                kept += 1;
            }
            _ => refused += 1,
        }
    }
    assert!(kept > 100, "{kept} kept, {refused} refused");
}

/// The flash, with this bit of each copy of the newest record of these bytes flipped, counted from them.
fn harmed(whole: &Cells, bytes: &[u8], bit: isize) -> Cells {
    let cells = whole.copy();
    cells.flip_copies(bytes, bit);
    cells
}

/// A replaced record stays in the flash: it may have other limits, or other zeros.
#[test]
fn a_flipped_bit_in_each_copy_of_the_newest_record_brings_no_replaced_one_back() {
    let whole = with_table(1);
    (1..=2).for_each(|new_coils| assert!(upload_profile(&mut open(&whole, ENDLESS), new_coils)));
    let newest = Calibration::try_from([0.5, 0.6, 0.7, 0.8]).unwrap();
    now(open(&whole, ENDLESS).set_calibration(newest)).unwrap();
    let of_profile = profile_image(&Profile { supply: SwitchLimit { new_coils: 2, window_ms: 10 }, ..profile() }).0;
    let mut buffer = [0; 40];
    let of_calibration = postcard::to_slice(&newest, &mut buffer).unwrap();
    let (mut lost, item) = ([0, 0], -8 * 24..8 * 48);
    for bit in item {
        let cells = harmed(&whole, &of_profile.digest.0, bit);
        let found = in_force(&cells);
        assert!(matches!(found, InForce::Nothing | InForce::Stored(2)), "bit {bit}: {found:?}");
        lost[0] += u32::from(found == InForce::Nothing);
        assert!(upload_profile(&mut open(&cells, ENDLESS), 9), "bit {bit}");
        assert_eq!(in_force(&cells), InForce::Stored(9), "bit {bit}");

        let cells = harmed(&whole, of_calibration, bit);
        let found = now(open(&cells, ENDLESS).calibration());
        assert!(matches!(found, Err(StorageError)) || found == Ok(Some(newest)), "bit {bit}: {found:?}");
        lost[1] += u32::from(found.is_err());
    }
    assert!(lost.iter().all(|lost| *lost > 8 * 20), "{lost:?}");
}

/// Uploads a profile and commits it; whether that was confirmed.
fn upload_profile(store: &mut Store<MockFlash>, new_coils: u8) -> bool {
    let other = Profile { supply: SwitchLimit { new_coils, window_ms: 10 }, ..profile() };
    let (image, bytes) = profile_image(&other);
    let upload = async {
        store.begin(image).await?;
        store.chunk(0, &bytes).await?;
        store.commit().await
    };
    now(upload).is_ok()
}

#[test]
fn a_cut_after_every_word_leaves_the_old_or_the_new_profile() {
    let old = with_table(1);
    assert!(upload_profile(&mut open(&old, ENDLESS), 1));
    let mut outcomes = [0, 0];
    for words in 1.. {
        let cells = old.copy();
        let confirmed = upload_profile(&mut open(&cells, words), 2);
        let mut found = Profile::empty();
        assert_eq!(now(open(&cells, ENDLESS).load_valid_profile(&mut found)), Ok(true));
        let new_coils = found.supply.new_coils;
        assert!(if confirmed { new_coils == 2 } else { (1..=2).contains(&new_coils) }, "after {words} words");
        assert_eq!(boot(&cells), Some(1), "the table is still there");
        outcomes[usize::from(new_coils) - 1] += 1;
        if confirmed {
            break;
        }
    }
    assert!(outcomes[0] > 10 && outcomes[1] > 0, "{outcomes:?}");
}

/// What a start puts in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InForce {
    BuiltIn,
    Nothing,
    /// The profile whose supply feeds so many coils.
    Stored(u8),
}

/// What [`Dispatcher::open`](crate::dispatch::Dispatcher::open) decides by.
fn in_force(cells: &Cells) -> InForce {
    let (mut store, mut found) = (open(cells, ENDLESS), Profile::empty());
    match now(store.load_valid_profile(&mut found)) {
        Ok(true) => InForce::Stored(found.supply.new_coils),
        Ok(false) if !store.is_profile_lost() => InForce::BuiltIn,
        Ok(false) | Err(_) => InForce::Nothing,
    }
}

/// A flash whose profiles 1 to `uploads` were written, the records then treated so.
fn worn(uploads: u8, harm: impl FnOnce(&Cells)) -> Cells {
    let cells = with_table(1);
    (1..=uploads).for_each(|new_coils| assert!(upload_profile(&mut open(&cells, ENDLESS), new_coils)));
    harm(&cells);
    cells
}

fn spoil_profile_records(cells: &Cells, uploads: u8) {
    let other = Profile { supply: SwitchLimit { new_coils: uploads, window_ms: 10 }, ..profile() };
    cells.spoil_copies(&profile_image(&other).0.digest.0);
}

/// A start counts itself and the host writes a profile, with power for so many words; the power then fails again within the next
/// start's repair and upload. No start finds the limits that are built in, or zero offsets in place of those that were erased.
#[test]
fn no_power_cut_makes_a_board_that_had_a_profile_a_new_one() {
    let histories = [
        ("one profile", worn(1, |_| ())),
        ("two profiles", worn(2, |_| ())),
        ("unreadable after one", worn(1, Cells::spoil_records)),
        ("unreadable after two", worn(2, Cells::spoil_records)),
        ("both copies damaged after one", worn(1, |cells| spoil_profile_records(cells, 1))),
        ("both copies damaged after two", worn(2, |cells| spoil_profile_records(cells, 2))),
    ];
    for (history, old) in histories {
        let before = in_force(&old);
        assert_ne!(before, InForce::BuiltIn, "{history}");
        let (mut n_cuts, mut done) = (0, false);
        while !done {
            n_cuts += 1;
            let cells = old.copy();
            let mut store = open(&cells, n_cuts);
            // Where the records cannot be read a start cannot count itself either.
            let _ = now(store.count_boot());
            done = upload_profile(&mut store, 9);
            let found = in_force(&cells);
            let allowed = [before, InForce::Stored(9)];
            assert!(
                if done { found == allowed[1] } else { allowed.contains(&found) },
                "{history}, {n_cuts}: {found:?}"
            );
            let again = 1 + n_cuts.wrapping_mul(2_654_435_761) % n_cuts.max(2);
            let confirmed = upload_profile(&mut open(&cells, again), 8);
            let found = in_force(&cells);
            assert!(found != InForce::BuiltIn && (!confirmed || found == InForce::Stored(8)), "{history}: {found:?}");
            let offsets = now(open(&cells, ENDLESS).calibration());
            assert!(offsets != Ok(None), "{history}, {n_cuts}");
        }
        assert!(n_cuts > 30, "{history}: {n_cuts}");
    }
}

#[test]
fn a_first_profile_that_a_power_cut_interrupts_leaves_never_written_lost_or_stored() {
    let mut found = Vec::new();
    for words in 1.. {
        let cells = with_table(1);
        let confirmed = upload_profile(&mut open(&cells, words), 2);
        found.push(in_force(&cells));
        if confirmed {
            break;
        }
    }
    assert!(found.is_sorted_by_key(|state| match state {
        InForce::BuiltIn => 0,
        InForce::Nothing => 1,
        InForce::Stored(_) => 2,
    }));
    assert_eq!((found[0], found.last()), (InForce::BuiltIn, Some(&InForce::Stored(2))));
}

/// Starts, tables, a calibration, and records that a power cut has torn say nothing of a profile.
#[test]
fn a_board_that_never_had_a_profile_has_the_limits_that_are_built_in() {
    assert_eq!(in_force(&Cells::erased()), InForce::BuiltIn);
    let whole = with_table(1);
    assert_eq!(in_force(&whole), InForce::BuiltIn);
    for words in 1..40 {
        let cells = whole.copy();
        let _ = now(open(&cells, words).count_boot());
        assert_eq!(in_force(&cells), InForce::BuiltIn, "{words}");
    }
    whole.spoil_records();
    assert_eq!(in_force(&whole), InForce::Nothing, "a profile may have been among what cannot be read");
}

/// The store has its records for at most one flipped bit in each copy, wherever the profile's image is.
#[test]
fn no_flipped_bit_in_the_slots_of_profiles_makes_a_board_new() {
    let old = worn(1, |cells| spoil_profile_records(cells, 1));
    for at in 2 * SLOT_BYTES + RECORDS_BYTES..FLASH_BYTES {
        let Some(cells) = old.flipped(at) else { continue };
        assert_eq!(in_force(&cells), InForce::Nothing, "byte {at}");
    }
}
