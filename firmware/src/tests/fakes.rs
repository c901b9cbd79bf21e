//! Stand-ins for the board in tests: a clock moved by hand, a flash stricter than the part.
use core::cell::{Cell, RefCell};
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use std::rc::Rc;

use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, ServoWiring, SwitchLimit};
use darm_core::profile::{Profile, ProfileRecord};
use darm_core::table::{Record, Row, wiring};
use darm_core::units::{Digest, Micros, ModelHash, Word};
use darm_core::wire::caps::Caps;
use darm_core::wire::message::{Image, ImageKind};
use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use serde::Serialize;
use sha2::{Digest as _, Sha256};

use crate::clock::Clock;
use crate::dispatch::BUILD;
use crate::store::{FLASH_BYTES, PROFILE_BYTES, SLOT_BYTES, Store};

/// A small arm: two valves with a limit switch each and, where asked for, a servo; one row every 100 ms.
pub(crate) fn table(model: u64, rows: u64, servo: bool) -> (Image, Vec<u8>) {
    table_with(model, rows, servo, &[])
}

/// The same with records of modules and frames.
pub(crate) fn table_with(model: u64, rows: u64, servo: bool, modules: &[Record]) -> (Image, Vec<u8>) {
    table_under(&profile(), model, rows, servo, modules)
}

/// The same under another profile with the same wiring.
pub(crate) fn table_under(
    profile: &Profile,
    model: u64,
    rows: u64,
    servo: bool,
    modules: &[Record],
) -> (Image, Vec<u8>) {
    let model = ModelHash(model);
    let mut records = wired(model, profile.digest, servo);
    records.extend_from_slice(modules);
    for row in 0..rows {
        let word = Word::new(&[(row & 1) as u8, (row >> 1 & 1) as u8]).unwrap();
        let servos = servo.then_some(0.1).into_iter().collect();
        records.push(Record::Row(Row { at: Micros(row * 100_000), word, servos }));
    }
    records.push(Record::End { at: Micros(rows * 100_000) });
    image(ImageKind::Table, model, &records)
}

fn wired(model: ModelHash, profile: Digest, servo: bool) -> Vec<Record> {
    let limit = CoilLimit { max_on_ms: 5_000, duty_percent: 90, window_ms: 60_000 };
    let mut records = vec![Record::Start { model, device: None, profile, switch_limit: SwitchLimit::default() }];
    for index in 0..2 {
        let switch = Some(LimitSwitch { input: index, closed_in: 0b10 });
        records.push(Record::Coil(Coil { output: index, drive: Drive::Hold { line: index }, limit }));
        records.push(Record::Actuator(ActuatorWiring { states: 2, switch, travel_ms: 50 }));
    }
    if servo {
        let (max_speed_rad_s, max_torque, timeout_ms) = (3.0, 0.5, 200);
        let (min_rad, max_rad) = (-1.5, 1.5);
        records.push(Record::Servo(ServoWiring { id: 1, min_rad, max_rad, max_speed_rad_s, max_torque, timeout_ms }));
    }
    records
}

/// The profile of the small arm with its servo.
pub(crate) fn profile() -> Profile {
    let wiring = wiring(&wired(ModelHash(0), Digest::default(), true)).unwrap();
    let profile = Profile::of(&wiring);
    Profile { digest: profile_image(&profile).0.digest, ..profile }
}

pub(crate) fn profile_image(profile: &Profile) -> (Image, Vec<u8>) {
    let records: Vec<ProfileRecord> = profile.records().collect();
    image(ImageKind::Profile, ModelHash(0), &records)
}

pub(crate) fn image(kind: ImageKind, model: ModelHash, records: &[impl Serialize]) -> (Image, Vec<u8>) {
    let bytes: Vec<u8> = records.iter().flat_map(encoded).collect();
    let digest = Digest(Sha256::digest(&bytes).into());
    (Image { kind, len: bytes.len() as u32, digest, model }, bytes)
}

fn encoded(record: &impl Serialize) -> Vec<u8> {
    let mut bytes = [0; Record::MAX_BYTES];
    postcard::to_slice(record, &mut bytes).unwrap().to_vec()
}

/// Time that moves when nothing else can go on.
#[derive(Default)]
pub(crate) struct HandClock(pub(crate) Cell<u64>);

impl Clock for HandClock {
    fn now(&self) -> Micros {
        Micros(self.0.get())
    }

    fn wait_until(&self, at: Micros) -> impl Future<Output = ()> {
        poll_fn(move |_| if self.now() >= at { Poll::Ready(()) } else { Poll::Pending })
    }
}

/// Runs a future to its end; `step` is called whenever it waits.
pub(crate) fn run<T>(future: impl Future<Output = T>, mut step: impl FnMut()) -> T {
    let mut future = pin!(future);
    for _ in 0..10_000_000 {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return value;
        }
        step();
    }
    panic!("the future waits for ever");
}

pub(crate) const PAGE: usize = 2048;
pub(crate) const WORD: usize = 8;

/// The bytes of a flash, which outlive a power cut, and whether it refuses to be written.
#[derive(Clone)]
pub(crate) struct Cells(Rc<RefCell<Vec<u8>>>, Rc<Cell<bool>>);

/// Flash that is stricter than the part: a written word takes nothing but zeros, and power goes after a number of
/// written or erased words, in the middle of one.
pub(crate) struct MockFlash {
    cells: Cells,
    /// Words until the power goes.
    pub(crate) words_left: u32,
    noise: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MockError {
    Bounds,
    NotErased,
    PowerLost,
    Refused,
}

impl NorFlashError for MockError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Cells {
    pub(crate) fn erased() -> Self {
        Self::of(vec![0xff; FLASH_BYTES])
    }

    /// The flash of a board whose profile fits the small arm.
    pub(crate) fn with_profile() -> Self {
        Self::under(&profile())
    }

    /// The flash of a board with this profile.
    pub(crate) fn under(profile: &Profile) -> Self {
        let cells = Self::erased();
        let (image, bytes) = profile_image(profile);
        let stored = async {
            let mut store = Store::open(cells.flash(u32::MAX)).await;
            store.begin(image).await.unwrap();
            store.chunk(0, &bytes).await.unwrap();
            store.commit().await.unwrap();
        };
        run(stored, || {});
        cells
    }

    pub(crate) fn copy(&self) -> Self {
        Self::of(self.0.borrow().clone())
    }

    fn of(bytes: Vec<u8>) -> Self {
        Self(Rc::new(RefCell::new(bytes)), Rc::default())
    }

    /// It refuses to be written or erased from now on, or no longer.
    pub(crate) fn refuse_writes(&self, refuses: bool) {
        self.1.set(refuses);
    }

    /// Fills what the records lie in with items that end nowhere, as a failed part does.
    pub(crate) fn spoil_records(&self) {
        let mut cells = self.0.borrow_mut();
        for page in cells[2 * SLOT_BYTES..FLASH_BYTES - 2 * PROFILE_BYTES].chunks_mut(PAGE) {
            page[..WORD].fill(0);
            page[WORD..].fill(0x5a);
        }
    }

    /// Damages the copy of these bytes that lies in the flash.
    pub(crate) fn spoil(&self, bytes: &[u8]) {
        let mut cells = self.0.borrow_mut();
        let at = cells.windows(bytes.len()).position(|window| window == bytes).expect("the bytes are stored");
        cells[at + 3] ^= 1;
    }

    /// Damages all copies of these bytes.
    pub(crate) fn spoil_copies(&self, bytes: &[u8]) {
        self.flip_copies(bytes, 8 * 3);
    }

    /// Flips the bit of this number, from the first one of these bytes, in or beside all copies of them.
    pub(crate) fn flip_copies(&self, bytes: &[u8], bit: isize) {
        let mut cells = self.0.borrow_mut();
        let places: Vec<usize> =
            cells.windows(bytes.len()).enumerate().filter(|(_, window)| *window == bytes).map(|(at, _)| at).collect();
        assert_eq!(places.len(), 2, "two copies are stored");
        let (byte, bit) = (bit.div_euclid(8), bit.rem_euclid(8));
        places.into_iter().for_each(|at| cells[at.strict_add_signed(byte)] ^= 1 << bit);
    }

    /// Whether the same bytes are in both.
    pub(crate) fn is_equal(&self, other: &Self) -> bool {
        *self.0.borrow() == *other.0.borrow()
    }

    /// A copy with one bit of a byte flipped, where something is written.
    pub(crate) fn flipped(&self, at: usize) -> Option<Self> {
        let copy = self.copy();
        let byte = copy.0.borrow()[at];
        copy.0.borrow_mut()[at] = byte ^ 1 << (at % 8);
        (byte != 0xff).then_some(copy)
    }

    /// The device on these cells, with power for this many words.
    pub(crate) fn flash(&self, words_left: u32) -> MockFlash {
        MockFlash { cells: self.clone(), words_left, noise: words_left.wrapping_mul(2_654_435_761) | 1 }
    }
}

impl MockFlash {
    fn random(&mut self) -> u32 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 17;
        self.noise ^= self.noise << 5;
        self.noise
    }

    /// Takes the power for one word; when it is the last, says so.
    fn spend(&mut self) -> Result<bool, MockError> {
        if self.cells.1.get() {
            return Err(MockError::Refused);
        }
        self.words_left = self.words_left.checked_sub(1).ok_or(MockError::PowerLost)?;
        Ok(self.words_left == 0)
    }
}

fn range(offset: u32, len: usize, grain: usize) -> Result<core::ops::Range<usize>, MockError> {
    let start = offset as usize;
    let fits = start + len <= FLASH_BYTES && start.is_multiple_of(grain) && len.is_multiple_of(grain);
    if fits { Ok(start..start + len) } else { Err(MockError::Bounds) }
}

impl ErrorType for MockFlash {
    type Error = MockError;
}

impl ReadNorFlash for MockFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MockError> {
        if self.words_left == 0 {
            return Err(MockError::PowerLost);
        }
        bytes.copy_from_slice(&self.cells.0.borrow()[range(offset, bytes.len(), 1)?]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for MockFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    /// Power lost in an erase leaves noise in the rest of the page.
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), MockError> {
        for word in range(from, (to - from) as usize, PAGE)?.step_by(WORD) {
            let last = self.spend()?;
            let noise = self.random().to_le_bytes();
            let cells = &mut self.cells.0.borrow_mut()[word..];
            cells[..WORD].fill(0xff);
            if last {
                let rest = PAGE - word % PAGE;
                cells[..rest].iter_mut().zip(noise.iter().cycle()).for_each(|(cell, noise)| *cell |= noise);
                return Err(MockError::PowerLost);
            }
        }
        Ok(())
    }

    /// Power lost in a write leaves some bits of the word unwritten.
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MockError> {
        let range = range(offset, bytes.len(), WORD)?;
        for (at, word) in range.step_by(WORD).zip(bytes.chunks_exact(WORD)) {
            let last = self.spend()?;
            let noise = u64::from(self.random()) << 32 | u64::from(self.random());
            let cells = &mut self.cells.0.borrow_mut()[at..at + WORD];
            if cells.iter().any(|byte| *byte != 0xff) && word.iter().any(|byte| *byte != 0) {
                return Err(MockError::NotErased);
            }
            let unwritten = if last { noise.to_le_bytes() } else { [0; WORD] };
            for ((cell, byte), keep) in cells.iter_mut().zip(word).zip(unwritten) {
                *cell &= byte | keep;
            }
            if last {
                return Err(MockError::PowerLost);
            }
        }
        Ok(())
    }
}

impl MultiwriteNorFlash for MockFlash {}

/// A board with all that the firmware supports.
pub(crate) fn caps() -> Caps {
    Caps::largest("bench", SLOT_BYTES as u32, BUILD)
}
