//! Power cuts within the operations of the flash, of the store on the driver on the model of the controller (RM0351, 3.3.7): a
//! torn word may fail its check, and takes nothing but zeros. Half of the cuts have another one within the recovery: the next start
//! repairs the records, counts itself, and the host stores again.

use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, SwitchLimit};
use darm_core::profile::{Profile, ProfileRecord};
use darm_core::table::{Board, Record, Row, Table};
use darm_core::units::{DeviceId, Digest, Micros, ModelHash, Word};
use darm_core::wire::message::{Calibration, Image, ImageKind};
use darm_firmware::clock::Clock;
use darm_firmware::store::Store;
use embassy_futures::block_on;
use sha2::{Digest as _, Sha256};

use super::model::{self, ModelClock};
use crate::bank2::Bank2;

/// How many cuts, or as many as the environment variable `DARM_STORE_CUTS` says.
const CUTS: u64 = 60;
/// A look at the clock takes so long: a page erase would else be polled 22 000 times.
const LOOK_US: u64 = 500;

/// The clock of the model, in large steps.
struct FastClock;

impl Clock for FastClock {
    fn now(&self) -> Micros {
        model::pass_us(LOOK_US);
        ModelClock.now()
    }

    async fn wait_until(&self, at: Micros) {
        ModelClock.wait_until(at).await;
    }
}

type BoardStore = Store<Bank2<FastClock>>;

/// What the store has, or will have.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Content {
    model: u64,
    new_coils: u8,
    calibration: u8,
}

fn open() -> BoardStore {
    block_on(Store::open(Bank2::new(FastClock)))
}

fn profile(new_coils: u8) -> Profile {
    let mut profile = Profile { supply: SwitchLimit { new_coils, window_ms: 10 }, ..Profile::empty() };
    let limit = CoilLimit { max_on_ms: 5_000, duty_percent: 90, window_ms: 60_000 };
    let output = darm_core::profile::Output { drive: Drive::Hold { line: 0 }, limit, input: None };
    profile.outputs[0] = Some(output);
    profile
}

/// The image of some records, and its bytes.
fn image(kind: ImageKind, model: ModelHash, records: &[impl serde::Serialize]) -> (Image, Vec<u8>) {
    let mut bytes = Vec::new();
    for record in records {
        let mut encoded = [0; Record::MAX_BYTES];
        bytes.extend_from_slice(postcard::to_slice(record, &mut encoded).expect("a record fits"));
    }
    (Image { kind, len: bytes.len() as u32, digest: Digest(Sha256::digest(&bytes).into()), model }, bytes)
}

fn profile_image(new_coils: u8) -> (Image, Vec<u8>) {
    let records: Vec<ProfileRecord> = profile(new_coils).records().collect();
    image(ImageKind::Profile, ModelHash(0), &records)
}

/// Rows of the table of a model: what is left of another one would show.
fn rows(model: u64) -> u64 {
    20 + model % 60
}

fn table_image(model: u64) -> (Image, Vec<u8>) {
    let limit = CoilLimit { max_on_ms: 5_000, duty_percent: 90, window_ms: 60_000 };
    let (digest, switch_limit) = (Digest::default(), SwitchLimit { new_coils: 1, window_ms: 10 });
    let mut records = vec![
        Record::Start { model: ModelHash(model), device: None, profile: digest, switch_limit },
        Record::Coil(Coil { output: 0, drive: Drive::Hold { line: 0 }, limit }),
        Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 50 }),
    ];
    for row in 0..rows(model) {
        let word = Word::new(&[(row & 1) as u8]).expect("one digit");
        records.push(Record::Row(Row { at: Micros(row * 100_000), word, servos: Default::default() }));
    }
    records.push(Record::End { at: Micros(rows(model) * 100_000) });
    image(ImageKind::Table, ModelHash(model), &records)
}

/// Uploads and commits an image; whether that was confirmed.
fn upload(store: &mut BoardStore, (image, bytes): &(Image, Vec<u8>)) -> bool {
    let mut next = match block_on(store.begin(*image)) {
        Ok(next) => next as usize,
        Err(_) => return false,
    };
    while next < bytes.len() {
        let end = bytes.len().min(next + 256);
        match block_on(store.chunk(next as u32, &bytes[next..end])) {
            Ok(wanted) => next = wanted as usize,
            Err(_) => return false,
        }
    }
    block_on(store.commit()).is_ok()
}

fn calibration(number: u8) -> Calibration {
    Calibration::try_from([0.001 * f32::from(number), 0.0, 0.0, 0.0]).expect("small angles")
}

/// Stores what differs between the two, one after the other; whether all of it was confirmed.
fn store(old: Content, new: Content) -> bool {
    let mut store = open();
    (old.model == new.model || upload(&mut store, &table_image(new.model)))
        && (old.new_coils == new.new_coils || upload(&mut store, &profile_image(new.new_coils)))
        && (old.calibration == new.calibration || block_on(store.set_calibration(calibration(new.calibration))).is_ok())
}

/// What a start finds; every row of the table must be there.
fn found() -> Content {
    let mut store = open();
    assert!(store.is_readable());
    let (mut table, mut stored) = (Box::<Table>::default(), Profile::empty());
    assert_eq!(block_on(store.load_valid_profile(&mut stored)), Ok(true));
    let board =
        Board { device: Some(DeviceId([7; 12])), profile: &Profile { digest: Digest::default(), ..profile(1) } };
    assert_eq!(block_on(store.load_valid(&mut table, &board)), Ok(true));
    let model = table.model().0;
    assert_eq!(table.rows().len() as u64, rows(model), "rows of model {model}");
    let numbers = (0..=u8::MAX).find(|number| block_on(store.calibration()) == Ok(Some(calibration(*number))));
    Content { model, new_coils: stored.supply.new_coils, calibration: numbers.expect("a calibration of this test") }
}

/// Operations of the flash that `store` takes, when no power fails.
fn operations(old: Content, new: Content) -> u32 {
    const ENDLESS: u32 = u32::MAX;
    model::with(|chip| chip.flash.cut_after(ENDLESS, 1));
    assert!(store(old, new));
    ENDLESS - model::with(|chip| chip.flash.operations_left())
}

/// Within how many operations of a recovery the second cut falls, in half of the cases: those of the start alone.
const START_OPERATIONS: u32 = 6;

/// Random numbers.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = u64::wrapping_add(u64::wrapping_mul(self.0, 6_364_136_223_846_793_005), 1_442_695_040_888_963_407);
        self.0
    }

    /// After how many of these operations the power fails, and the noise that decides what is left.
    fn cut(&mut self, operations: u32) -> (u32, u64) {
        let drawn = self.next();
        ((drawn >> 33) as u32 % operations, drawn)
    }
}

/// Stores what differs, with the power failing as given, each time it is tried; whether it was confirmed in the end, and how often the
/// power failed.
fn store_through(old: Content, new: Content, cuts: &[(u32, u64)]) -> (bool, usize) {
    for (index, (operations, noise)) in cuts.iter().enumerate() {
        model::with(|chip| chip.flash.cut_after(*operations, *noise));
        if index > 0 {
            // What a start writes; without power it fails.
            let _ = block_on(open().count_boot());
        }
        let confirmed = store(old, new);
        let is_cut = model::with(|chip| chip.flash.is_off());
        model::with(|chip| chip.flash.restart());
        assert!(confirmed || is_cut, "a store failed with its power on: {old:?} to {new:?}");
        if confirmed {
            return (true, index + usize::from(is_cut));
        }
    }
    (false, cuts.len())
}

#[test]
fn a_power_cut_within_any_operation_of_the_driver_leaves_the_old_or_the_new() {
    let cuts = std::env::var("DARM_STORE_CUTS").map_or(CUTS, |text| text.parse().expect("a number"));
    let mut random = Random(0x5eed ^ std::env::var("DARM_SEED").map_or(0, |text| text.parse().expect("a number")));
    model::power_on();
    let mut held = Content { model: 1, new_coils: 1, calibration: 1 };
    let longest = operations(Content { model: 0, new_coils: 0, calibration: 0 }, held);
    let (mut old, mut new, mut done, mut doubled) = (0, 0, 0, 0);
    while done < cuts {
        let mut next = held;
        model::with(|chip| chip.flash.is_code_weak = !chip.flash.is_code_weak);
        match random.next() >> 60 {
            0..10 => next.model += 1,
            10..13 => next.new_coils = 1 + held.new_coils % 16,
            _ => next.calibration = held.calibration.wrapping_add(1),
        }
        let again = [None, Some(START_OPERATIONS), None, Some(longest)][(random.next() >> 62) as usize];
        let power: Vec<(u32, u64)> =
            [Some(longest), again].into_iter().flatten().map(|most| random.cut(most)).collect();
        let (confirmed, n_cuts) = store_through(held, next, &power);
        let found = found();
        assert!(
            if confirmed { found == next } else { found == held || found == next },
            "{found:?}, {held:?}, {next:?}"
        );
        if n_cuts > 0 {
            done += 1;
            doubled += u64::from(n_cuts > 1);
            *if found == next { &mut new } else { &mut old } += 1;
        }
        held = found;
    }
    assert!(old > 0 && new > 0 && doubled > 0, "{old} old, {new} new, {doubled} with a second cut");
    println!("FIGURE stm32: power cuts within an operation of the flash model = {done} cuts");
    println!("FIGURE stm32: power cuts with another one within the recovery = {doubled} cuts");
    println!("FIGURE stm32: power cuts with the old content complete = {old} cuts");
    println!("FIGURE stm32: power cuts with the new content complete = {new} cuts");
    println!("FIGURE stm32: power cuts with a mixture or a lost record = 0 cuts");
}
