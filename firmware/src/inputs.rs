//! The last changes of the inputs, by number. The control tick writes, the dispatcher reads.

use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use darm_core::output::MAX_INPUTS;
use darm_core::units::Micros;
use darm_core::wire::inputs::InputChanges;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

/// Changes kept. A power of two: numbers wrap.
const KEPT: usize = 64;

/// When, in 48 bits of µs (8.9 years), and the inputs from then on in the lowest 16.
#[derive(Clone, Copy)]
struct Change(u64);

const _: () = assert!(MAX_INPUTS <= 16);

impl Change {
    const fn new(at: Micros, inputs: u32) -> Self {
        Self(at.0 << 16 | (inputs & 0xffff) as u64)
    }

    fn parts(self) -> (Micros, u32) {
        (Micros(self.0 >> 16), (self.0 & 0xffff) as u32)
    }
}

/// The last changes. Each place has a separate lock, so that none is held for long.
pub(crate) struct InputLog {
    places: [Mutex<CriticalSectionRawMutex, Cell<Change>>; KEPT],
    /// Number of the next change.
    next: AtomicU32,
}

impl InputLog {
    /// No change.
    pub(crate) const fn new() -> Self {
        Self { places: [const { Mutex::new(Cell::new(Change(0))) }; KEPT], next: AtomicU32::new(0) }
    }

    /// Takes in a change. From the control tick only.
    pub(crate) fn push(&self, at: Micros, inputs: u32) {
        let next = self.next.load(Ordering::Relaxed);
        if let Some(place) = self.places.get(next as usize % KEPT) {
            place.lock(|place| place.set(Change::new(at, inputs)));
        }
        self.next.store(next.wrapping_add(1), Ordering::Release);
    }

    /// As many changes as fit an answer, from a number on.
    pub(crate) fn from(&self, from: u32) -> InputChanges {
        let next = self.next.load(Ordering::Acquire);
        let first = from.max(next.saturating_sub(KEPT as u32)).min(next);
        let mut changes = InputChanges { first, ..InputChanges::default() };
        for number in first..next {
            let Some(place) = self.places.get(number as usize % KEPT) else { break };
            if changes.list.push(place.lock(Cell::get).parts()).is_err() {
                break;
            }
        }
        // What the control tick has overwritten meanwhile is not what its number says.
        let lost = self.next.load(Ordering::Acquire).saturating_sub(KEPT as u32).saturating_sub(first);
        if lost > 0 { InputChanges { first: next, ..InputChanges::default() } } else { changes }
    }
}

#[cfg(test)]
mod tests {
    use super::{InputLog, KEPT};
    use darm_core::units::Micros;
    use darm_core::wire::inputs::INPUT_CHANGES;

    #[test]
    fn years_and_all_inputs_are_kept() {
        let (log, years) = (InputLog::new(), Micros(8 * 365 * 24 * 3600 * 1_000_000));
        log.push(years, 0xffff);
        assert_eq!(log.from(0).list.as_slice(), [(years, 0xffff)]);
    }

    #[test]
    fn changes_are_numbered_and_old_ones_are_lost() {
        let log = InputLog::new();
        assert_eq!((log.from(0).first, log.from(7).first, log.from(0).list.len()), (0, 0, 0));
        (0..100).for_each(|number| log.push(Micros(number), number as u32));
        let first = log.from(0);
        assert_eq!((first.first, first.list.len()), (100 - KEPT as u32, INPUT_CHANGES));
        assert_eq!(first.list[0], (Micros(36), 36));
        let last = log.from(98);
        assert_eq!((last.first, last.list.as_slice()), (98, &[(Micros(98), 98), (Micros(99), 99)][..]));
        assert_eq!((log.from(500).first, log.from(500).list.len()), (100, 0));
    }
}
