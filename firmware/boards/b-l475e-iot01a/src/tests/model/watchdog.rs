//! The independent watchdog: RM0351, chapter 36.

/// Slowest and fastest LSI over temperature and supply, Hz (DS10969, "LSI oscillator characteristics").
pub(crate) const LSI_HZ: [f64; 2] = [29_500.0, 34_000.0];
/// An update of PR, RLR or WINR takes up to five cycles of the LSI (36.4.4).
const UPDATE_CYCLES: f64 = 5.0;

pub(crate) struct Watchdog {
    /// The LSI of this chip, Hz.
    pub(crate) lsi_hz: f64,
    /// When the chip was reset, ns.
    pub(crate) bitten_at_ns: Option<u64>,
    is_open: bool,
    /// Values in force, and what replaces them when its update ends.
    prescaler: Updated,
    reload: Updated,
    window: Updated,
    running: Option<Counter>,
}

/// A register in the clock domain of the LSI.
#[derive(Clone, Copy)]
struct Updated {
    now: u32,
    next: u32,
    done_ns: u64,
}

#[derive(Clone, Copy)]
struct Counter {
    from: u32,
    since_ns: u64,
}

impl Updated {
    fn new(value: u32) -> Self {
        Self { now: value, next: value, done_ns: 0 }
    }
}

impl Watchdog {
    pub(super) fn new() -> Self {
        Self {
            lsi_hz: 32_000.0,
            bitten_at_ns: None,
            is_open: false,
            prescaler: Updated::new(0),
            reload: Updated::new(0xfff),
            window: Updated::new(0xfff),
            running: None,
        }
    }

    fn ns(&self, lsi_cycles: f64) -> u64 {
        (lsi_cycles * 1e9 / self.lsi_hz) as u64
    }

    /// Cycles of the LSI to a count: 4 to 256 (36.4.2).
    fn divider(&self) -> f64 {
        f64::from(4 << self.prescaler.now.min(6))
    }

    pub(super) fn pass(&mut self, now_ns: u64) {
        for register in [&mut self.prescaler, &mut self.reload, &mut self.window] {
            if now_ns >= register.done_ns {
                register.now = register.next;
            }
        }
        if self.count(now_ns) == Some(0) && self.bitten_at_ns.is_none() {
            self.bitten_at_ns = Some(now_ns);
        }
    }

    fn count(&self, now_ns: u64) -> Option<u32> {
        let counter = self.running?;
        let passed = (now_ns - counter.since_ns) as f64 * 1e-9 * self.lsi_hz / self.divider();
        Some(counter.from.saturating_sub(passed as u32))
    }

    pub(super) fn load(&self, offset: usize) -> u32 {
        let pending = |register: &Updated| u32::from(register.now != register.next);
        match offset {
            0x04 => self.prescaler.now,
            0x08 => self.reload.now,
            // PVU, RVU and WVU (36.4.4).
            0x0c => pending(&self.prescaler) | pending(&self.reload) << 1 | pending(&self.window) << 2,
            0x10 => self.window.now,
            _ => panic!("IWDG register {offset:#x} cannot be read (36.4)"),
        }
    }

    pub(super) fn store(&mut self, offset: usize, value: u32, now_ns: u64) {
        match (offset, value) {
            (0x00, 0x5555) => self.is_open = true,
            (0x00, 0xaaaa) => self.refresh(now_ns),
            (0x00, 0xcccc) => {
                self.is_open = false;
                self.running.get_or_insert(Counter { from: 0xfff, since_ns: now_ns });
            }
            (0x00, _) => panic!("{value:#x} is no key of the watchdog (36.4.1)"),
            (0x04, 0..=7) => self.update(|watchdog| &mut watchdog.prescaler, value, now_ns),
            (0x08, 0..=0xfff) => self.update(|watchdog| &mut watchdog.reload, value, now_ns),
            (0x10, 0..=0xfff) => {
                self.update(|watchdog| &mut watchdog.window, value, now_ns);
                // A write of the window reloads the counter (36.3.2).
                self.running = self.running.map(|_| Counter { from: self.reload.now, since_ns: now_ns });
            }
            _ => panic!("IWDG register {offset:#x} cannot take {value:#x} (36.4)"),
        }
    }

    fn refresh(&mut self, now_ns: u64) {
        self.is_open = false;
        if let Some(count) = self.count(now_ns) {
            // Too early: the counter is above the window (36.3.2).
            if count > self.window.now && self.bitten_at_ns.is_none() {
                self.bitten_at_ns = Some(now_ns);
            }
            self.running = Some(Counter { from: self.reload.now, since_ns: now_ns });
        }
    }

    fn update(&mut self, register: impl Fn(&mut Self) -> &mut Updated, value: u32, now_ns: u64) {
        assert!(self.is_open, "a write without the key 0x5555 is ignored (36.3.5 \"Register access protection\")");
        assert!(self.running.is_some(), "without the LSI, which 0xCCCC starts, no update ever ends (36.3.1)");
        let done_ns = now_ns + self.ns(UPDATE_CYCLES);
        let register = register(self);
        assert!(register.now == register.next, "PVU, RVU or WVU is set: the value must not change (36.4.4)");
        *register = Updated { now: register.now, next: value, done_ns };
    }
}
