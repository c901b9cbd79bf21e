//! The flash controller: RM0351, chapter 3, and the erratum on read while write.
//!
//! The code runs from bank 1. What would stop it, and with it the control tick, counts as forbidden: an access to a bank
//! that is erased or programmed stalls the bus until the end (3.3.8).

mod power;

use std::collections::BTreeMap;

use power::Power;

/// First byte of each bank, and bytes of a bank and a page (3.3.1).
const BANK_1: usize = 0x0800_0000;
pub(crate) const BANK_2: usize = 0x0808_0000;
const BANK_BYTES: usize = 0x8_0000;
const PAGE_BYTES: usize = 2048;
/// Longest times (DS10969, "Flash memory characteristics"), ns.
const ERASE_NS: u64 = 24_470_000;
const PROGRAM_NS: u64 = 90_760;

/// Bits of ACR (3.7.1).
const DCEN: u32 = 1 << 10;
const DCRST: u32 = 1 << 12;
/// Bits of SR (3.7.5).
pub(crate) const EOP: u32 = 1 << 0;
pub(crate) const OPERR: u32 = 1 << 1;
pub(crate) const PROGERR: u32 = 1 << 3;
pub(crate) const WRPERR: u32 = 1 << 4;
pub(crate) const PGAERR: u32 = 1 << 5;
pub(crate) const SIZERR: u32 = 1 << 6;
pub(crate) const PGSERR: u32 = 1 << 7;
pub(crate) const MISERR: u32 = 1 << 8;
pub(crate) const FASTERR: u32 = 1 << 9;
pub(crate) const RDERR: u32 = 1 << 14;
pub(crate) const OPTVERR: u32 = 1 << 15;
pub(crate) const BSY: u32 = 1 << 16;
const FLAGS: u32 = 0xc3fb;
/// Flags after which PGSERR is set by the next attempt (3.7.5, PGSERR).
const PROGRAM_ERRORS: u32 = PROGERR | WRPERR | PGAERR | SIZERR | PGSERR | MISERR | FASTERR;
/// Bits of CR (3.7.6).
const PG: u32 = 1 << 0;
const PER: u32 = 1 << 1;
const MASS: u32 = 1 << 2 | 1 << 15;
const BKER: u32 = 1 << 11;
const STRT: u32 = 1 << 16;
const FSTPG: u32 = 1 << 18;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const LOCK: u32 = 1 << 31;
/// Bits of ECCR (3.7.7).
const ECCC: u32 = 1 << 30;
const ECCD: u32 = 1 << 31;

/// Where in bank 1.
const WEAK_CODE: u32 = 0x1230;

/// What the check of a double word finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ecc {
    /// One bit is wrong, and corrected.
    Corrected,
    /// Two bits are wrong: the chip raises the NMI.
    Detected,
}

pub(crate) struct Flash {
    acr: u32,
    sr: u32,
    cr: u32,
    eccr: u32,
    /// The option bytes in force: OPTR, WRP2AR and WRP2BR.
    pub(crate) optr: u32,
    pub(crate) protected: [u32; 2],
    /// Keys written so far; `None` after a wrong one, until reset (3.3.5 "Unlocking the Flash memory").
    keys: Option<usize>,
    bytes: Vec<u8>,
    /// Double words that were programmed since their page was erased, by offset.
    programmed: Vec<bool>,
    busy_until_ns: Option<u64>,
    /// What the running operation does at its end.
    operation: Option<Operation>,
    /// First half of a double word.
    half: Option<(usize, u32)>,
    /// Lines of the data cache: what was read while it was on.
    cache: BTreeMap<usize, u8>,
    /// Double words with a wrong check, by offset in bank 2.
    pub(crate) wrong: BTreeMap<usize, Ecc>,
    /// A word of the code has a wrong bit, which is corrected whenever it runs.
    pub(crate) is_code_weak: bool,
    /// NMIs that were raised.
    pub(crate) nmis: u32,
    /// Flags that the next operation ends with, whatever it does: a supply that breaks in, an NVM that fails.
    pub(crate) next_errors: u32,
    /// The next operation never ends.
    pub(crate) hangs: bool,
    power: Power,
    now_ns: u64,
}

enum Operation {
    Erase { page: usize },
    Program { offset: usize, word: [u8; 8] },
}

impl Flash {
    pub(super) fn new() -> Self {
        Self {
            acr: 0x600,
            sr: 0,
            cr: LOCK | 1 << 30,
            eccr: 0,
            optr: 0xffef_f8aa,
            protected: [0xff, 0xff],
            keys: Some(0),
            bytes: vec![0xff; BANK_BYTES],
            programmed: vec![false; BANK_BYTES / 8],
            busy_until_ns: None,
            operation: None,
            half: None,
            cache: BTreeMap::new(),
            wrong: BTreeMap::new(),
            is_code_weak: false,
            nmis: 0,
            next_errors: 0,
            hangs: false,
            power: Power::On,
            now_ns: 0,
        }
    }

    pub(super) fn latency(&self) -> u32 {
        self.acr & 7
    }

    /// Whether the data cache is on.
    pub(crate) fn is_cached(&self) -> bool {
        self.acr & DCEN != 0
    }

    /// Whether the controller is locked and nothing is selected, as it has to be between operations.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.cr & (LOCK | PG | PER | MASS | FSTPG) == LOCK && self.busy_until_ns.is_none()
    }

    /// Bytes of bank 2 as they are, past cache and check.
    pub(crate) fn raw(&self, offset: usize, len: usize) -> &[u8] {
        &self.bytes[offset..offset + len]
    }

    pub(super) fn pass(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        if self.busy_until_ns.is_some_and(|until| now_ns >= until) && !self.hangs {
            self.busy_until_ns = None;
            self.finish();
        }
    }

    fn finish(&mut self) {
        if !self.has_power() {
            self.operation = None;
            return self.fail(OPERR | PGSERR);
        }
        let errors = core::mem::take(&mut self.next_errors);
        match self.operation.take() {
            Some(_) if errors != 0 => self.fail(errors),
            Some(Operation::Erase { page }) => {
                self.bytes[page * PAGE_BYTES..][..PAGE_BYTES].fill(0xff);
                self.programmed[page * PAGE_BYTES / 8..][..PAGE_BYTES / 8].fill(false);
                self.wrong.retain(|offset, _| offset / PAGE_BYTES != page);
            }
            Some(Operation::Program { offset, word }) => {
                self.bytes[offset..][..8].copy_from_slice(&word);
                self.programmed[offset / 8] = true;
                // All zeros over a torn word make a valid one (3.3.7).
                self.wrong.remove(&offset);
            }
            None => {}
        }
        if errors == 0 && self.cr & EOPIE != 0 {
            self.sr |= EOP;
        }
    }

    /// Sets error flags; OPERR only with the error interrupt (3.7.5).
    fn fail(&mut self, flags: u32) {
        self.sr |= flags;
        if self.cr & ERRIE != 0 {
            self.sr |= OPERR;
        }
    }

    /// A byte as the core reads it.
    pub(crate) fn read(&mut self, address: usize) -> u8 {
        if (BANK_1..BANK_2).contains(&address) {
            return 0xff;
        }
        let offset =
            address.checked_sub(BANK_2).filter(|offset| *offset < BANK_BYTES).expect("a read outside the flash");
        assert!(self.busy_until_ns.is_none(), "a read of the bank that is written stalls the core (3.3.8)");
        if self.is_cached()
            && let Some(byte) = self.cache.get(&offset)
        {
            return *byte;
        }
        self.check(offset & !7);
        if self.is_cached() {
            let line = offset & !15;
            self.cache.extend((line..line + 16).zip(self.bytes[line..line + 16].iter().copied()));
        }
        self.bytes[offset]
    }

    /// 3.3.2 and 3.7.7: the address is that of the first error since the flags were cleared.
    fn check(&mut self, word: usize) {
        if self.is_code_weak && self.eccr & (ECCC | ECCD) == 0 {
            self.eccr = self.eccr & 1 << 24 | ECCC | WEAK_CODE;
        }
        let Some(ecc) = self.wrong.get(&word) else { return };
        if self.eccr & (ECCC | ECCD) == 0 {
            self.eccr = self.eccr & 1 << 24 | word as u32 | 1 << 19;
        }
        match ecc {
            Ecc::Corrected => self.eccr |= ECCC,
            Ecc::Detected => {
                self.eccr |= ECCD;
                self.nmis += 1;
            }
        }
    }

    pub(super) fn load(&self, offset: usize) -> u32 {
        match offset {
            0x00 => self.acr,
            0x10 => self.sr | if self.busy_until_ns.is_some() { BSY } else { 0 },
            0x14 => self.cr,
            0x18 => self.eccr,
            0x20 => self.optr,
            0x4c => self.protected[0],
            0x50 => self.protected[1],
            0x04 | 0x08 | 0x0c => panic!("the key registers cannot be read (3.7.2 to 3.7.4)"),
            _ => panic!("FLASH register {offset:#x} is not modelled"),
        }
    }

    pub(super) fn store(&mut self, offset: usize, value: u32, now_ns: u64) {
        match offset {
            0x00 => self.store_acr(value),
            0x08 => self.store_key(value),
            // Flags are cleared by writing 1 (3.7.5).
            0x10 => self.sr &= !(value & FLAGS),
            0x14 => self.store_cr(value, now_ns),
            0x18 => self.eccr = self.eccr & !(value & (ECCC | ECCD)) & !(1 << 24) | value & 1 << 24,
            0x20 | 0x4c | 0x50 => panic!("option bytes need OPTLOCK cleared, which no driver may (3.4.2)"),
            _ => panic!("FLASH register {offset:#x} is not modelled"),
        }
    }

    fn store_acr(&mut self, value: u32) {
        if value & DCRST != 0 {
            assert!(self.acr & DCEN == 0 && value & DCEN == 0, "the cache is reset only while it is off (3.7.1)");
            self.cache.clear();
        }
        if value & DCEN != 0 {
            assert!(
                self.busy_until_ns.is_none(),
                "erratum \"Data cache might be corrupted during Flash memory read-while-write operation\": the data cache is on"
            );
        }
        self.acr = value;
    }

    fn store_key(&mut self, value: u32) {
        assert!(self.cr & LOCK != 0, "a key for an open controller is a wrong sequence: bus error (3.3.5)");
        let expected = self.keys.and_then(|n| [0x4567_0123, 0xcdef_89ab].get(n));
        assert_eq!(expected, Some(&value), "a wrong key: bus error, and locked until the next reset (3.3.5)");
        self.keys = self.keys.map(|n| n + 1);
        if self.keys == Some(2) {
            self.keys = Some(0);
            self.cr &= !LOCK;
        }
    }

    /// Makes the controller refuse its keys until reset, as after a wrong sequence.
    pub(crate) fn lock_up(&mut self) {
        self.keys = None;
    }

    fn store_cr(&mut self, value: u32, now_ns: u64) {
        assert!(self.busy_until_ns.is_none(), "a write of CR while BSY is set stalls the core (3.7.6)");
        assert!(self.cr & LOCK == 0, "CR is locked: the write has no effect (3.3.5)");
        self.cr = value & !STRT;
        if value & STRT != 0 {
            self.start(now_ns);
        }
        if value & PG == 0 {
            self.half = None;
        }
    }

    fn start(&mut self, now_ns: u64) {
        assert!(self.cr & MASS == 0, "a mass erase would take the records with it");
        // 3.7.5, PGSERR: another mode is selected, or an error has not been cleared.
        if self.cr & (PG | FSTPG) != 0 || self.cr & PER == 0 || self.sr & PROGRAM_ERRORS != 0 {
            return self.fail(PGSERR);
        }
        assert!(self.cr & BKER != 0, "an erase of bank 1 stops the code that runs from it (3.3.8)");
        let page = (self.cr >> 3 & 0xff) as usize;
        if self.is_protected(page) {
            return self.fail(WRPERR);
        }
        self.begin(Operation::Erase { page }, now_ns + ERASE_NS);
    }

    fn begin(&mut self, operation: Operation, until_ns: u64) {
        assert!(
            !self.is_cached(),
            "erratum \"Data cache might be corrupted during Flash memory read-while-write operation\": the data cache is on"
        );
        self.operation = Some(operation);
        self.busy_until_ns = Some(until_ns);
    }

    /// 3.5.3: areas A and B of bank 2, first page in bits 0 to 7, last in bits 16 to 23; none where first is above last.
    fn is_protected(&self, page: usize) -> bool {
        self.protected.iter().any(|area| (area & 0xff..=area >> 16 & 0xff).contains(&(page as u32)))
    }

    /// A word is written to the memory (3.3.7 "Standard programming").
    pub(super) fn program(&mut self, address: usize, value: u32, now_ns: u64) {
        assert!(address >= BANK_2, "programming bank 1 stops the code that runs from it (3.3.8)");
        assert!(self.busy_until_ns.is_none(), "a write while BSY is set stalls the core (3.3.7)");
        let offset = address - BANK_2;
        if self.cr & (PG | FSTPG) == 0 || self.cr & (PER | MASS) != 0 || self.sr & PROGRAM_ERRORS != 0 {
            return self.fail(PGSERR);
        }
        if self.cr & FSTPG != 0 {
            return self.fail(FASTERR);
        }
        match self.half.take() {
            None if !offset.is_multiple_of(8) => self.fail(PGAERR),
            None => self.half = Some((offset, value)),
            Some((first, _)) if first + 4 != offset => self.fail(PGAERR),
            Some((first, low)) => self.program_double(first, low, value, now_ns),
        }
    }

    fn program_double(&mut self, offset: usize, low: u32, high: u32, now_ns: u64) {
        if self.is_protected(offset / PAGE_BYTES) {
            return self.fail(WRPERR);
        }
        // A programmed double word takes nothing but zeros (3.3.7).
        if (self.programmed[offset / 8] || self.wrong.contains_key(&offset)) && (low, high) != (0, 0) {
            return self.fail(PROGERR);
        }
        let word = (u64::from(high) << 32 | u64::from(low)).to_le_bytes();
        self.begin(Operation::Program { offset, word }, now_ns + PROGRAM_NS);
    }
}
