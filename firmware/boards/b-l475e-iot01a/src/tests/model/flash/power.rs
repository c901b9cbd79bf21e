//! A supply that fails within an operation, and what that leaves.

use super::{Ecc, Flash, Operation, PAGE_BYTES};

/// Whether the supply lasts.
#[derive(Clone, Copy)]
pub(super) enum Power {
    On,
    /// Fails within the operation after this many; the noise decides what that leaves.
    Fails {
        operations: u32,
        noise: u64,
    },
    Off,
}

impl Flash {
    /// Lets the supply fail within the operation after this many.
    pub(crate) fn cut_after(&mut self, operations: u32, noise: u64) {
        self.power = Power::Fails { operations, noise };
    }

    /// How many operations are left until then.
    pub(crate) fn operations_left(&self) -> u32 {
        if let Power::Fails { operations, .. } = self.power { operations } else { 0 }
    }

    /// Whether it has failed.
    pub(crate) fn is_off(&self) -> bool {
        matches!(self.power, Power::Off)
    }

    /// Power comes back: the bytes and their checks are as they were left, the controller is as after a reset.
    pub(crate) fn restart(&mut self) {
        let (bytes, programmed) = (core::mem::take(&mut self.bytes), core::mem::take(&mut self.programmed));
        let wrong = core::mem::take(&mut self.wrong);
        *self = Self { bytes, programmed, wrong, is_code_weak: self.is_code_weak, ..Self::new() };
    }

    /// Counts an operation that ends; whether its power was there until then. What it leaves else is torn.
    pub(super) fn has_power(&mut self) -> bool {
        match self.power {
            Power::On => true,
            Power::Off => false,
            Power::Fails { operations: 0, noise } => {
                self.power = Power::Off;
                self.tear(noise);
                false
            }
            Power::Fails { operations, noise } => {
                self.power = Power::Fails { operations: operations - 1, noise };
                true
            }
        }
    }

    /// What an operation leaves that its power did not last for: some bits have changed, and the check of a word that has some of
    /// them may find one wrong bit, two, or nothing.
    fn tear(&mut self, noise: u64) {
        let mut random = noise | 1;
        let mut next = || {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random
        };
        let (words, new) = match self.operation {
            Some(Operation::Erase { page }) => (page * PAGE_BYTES..(page + 1) * PAGE_BYTES, None),
            Some(Operation::Program { offset, word }) => (offset..offset + 8, Some(word)),
            None => return,
        };
        for offset in words.step_by(8) {
            let old = u64::from_le_bytes(self.bytes[offset..][..8].try_into().expect("eight bytes"));
            let new = new.map_or(u64::MAX, u64::from_le_bytes);
            let chosen = match next() % 3 {
                0 => 0,
                1 => u64::MAX,
                _ => next(),
            };
            let torn = old & !chosen | new & chosen;
            self.bytes[offset..][..8].copy_from_slice(&torn.to_le_bytes());
            let ecc = [None, Some(Ecc::Corrected), Some(Ecc::Detected)][(next() % 3) as usize];
            // A word that has all of the old or of the new bits has a valid check; one that is erased may not be known to be.
            if let Some(ecc) = ecc.filter(|_| torn != old && torn != new) {
                self.wrong.insert(offset, ecc);
            }
            self.programmed[offset / 8] = torn != u64::MAX;
        }
    }
}
