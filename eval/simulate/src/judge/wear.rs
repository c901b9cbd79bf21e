//! Judge 1, the flash: how often a host can have it written while the supply stays on, over resets too. It sees erasures and bytes, never
//! what the board counts.

use super::Verdict;

const JUDGE: &str = "pins";
const S: u64 = 1_000_000_000;
/// This number of tables at once, and one more in each of these times: docs/safety.md, "What wears". Each erases a page of a slot once.
const TABLES: u64 = 200;
const TABLE_S: u64 = 60;
/// The same of zero offsets, and the bytes of their records: two of the offsets and two of the newest versions.
const OFFSETS: u64 = 6;
const OFFSETS_S: u64 = 10;
const OFFSETS_BYTES: u64 = 112;
/// Bytes of the records of one start, with one that a reset has cut, and of one image.
const START_BYTES: u64 = 64;
const IMAGE_BYTES: u64 = 192;
/// Where a page of records is full, those in force are written again: percent of all.
const MOVED_PERCENT: u64 = 130;

/// What the flash has borne since the supply came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Borne {
    /// Erasures of that page of the tables which was erased most often.
    pub table_erasures: u64,
    /// Bytes written among the records.
    pub record_bytes: u64,
}

/// The judge's memory.
#[derive(Debug, Default)]
pub struct Wear {
    powered_ns: u64,
    starts: u64,
    images: u64,
    verdict: Verdict,
}

impl Wear {
    /// The firmware starts, after a pause of the supply or without one.
    pub fn on_start(&mut self, now_ns: u64, power_was_off: bool) {
        if power_was_off {
            (self.powered_ns, self.starts, self.images) = (now_ns, 0, 0);
        }
        self.starts += 1;
    }

    /// What is to put an image in force arrives.
    pub fn on_commit(&mut self) {
        self.images += 1;
    }

    /// What the flash has borne.
    pub fn look(&mut self, now_ns: u64, borne: Borne) {
        let on_s = (now_ns - self.powered_ns).div_ceil(S);
        // The clock of the board may be fast, and one more is always on its way.
        let tokens = |burst: u64, each_s: u64| burst + 1 + on_s * 102 / 100 / each_s;
        let Borne { table_erasures, record_bytes } = borne;
        let tables = tokens(TABLES, TABLE_S);
        if table_erasures > tables {
            self.verdict.note(JUDGE, "table-wear", now_ns, || {
                format!("a page of the tables was erased {table_erasures} times in {on_s} s, allowed are {tables}")
            });
        }
        let offsets = tokens(OFFSETS, OFFSETS_S) * OFFSETS_BYTES;
        let bytes = (offsets + self.starts * START_BYTES + self.images * IMAGE_BYTES) * MOVED_PERCENT / 100;
        if record_bytes > bytes {
            let starts = self.starts;
            self.verdict.note(JUDGE, "record-wear", now_ns, || {
                format!(
                    "{record_bytes} bytes of records were written in {on_s} s and {starts} starts, allowed are {bytes}"
                )
            });
        }
    }

    /// The end of the run.
    pub fn finish(self) -> Verdict {
        self.verdict
    }
}

#[cfg(test)]
mod tests {
    use super::{Borne, S, Wear};

    fn broken(at_s: u64, starts: u64, borne: Borne) -> Vec<&'static str> {
        let mut wear = Wear::default();
        wear.on_start(0, true);
        (1..starts).for_each(|_| wear.on_start(S, false));
        wear.look(at_s * S, borne);
        wear.finish().firsts().iter().map(|(first, _)| first.rule).collect()
    }

    #[test]
    fn what_burst_and_rate_allow_is_no_wear() {
        let borne = |table_erasures, record_bytes| Borne { table_erasures, record_bytes };
        assert!(broken(100, 1, borne(202, 0)).is_empty());
        assert_eq!(broken(100, 1, borne(203, 0)), ["table-wear"]);
        assert_eq!(broken(600, 1, borne(212, 0)), ["table-wear"]);
        // Seven offsets at once and ten in 100 s, and one start.
        assert!(broken(100, 1, borne(0, 2_558)).is_empty());
        assert_eq!(broken(100, 1, borne(0, 2_559)), ["record-wear"]);
        assert!(broken(100, 9, borne(0, 3_200)).is_empty(), "starts write too");
    }
}
