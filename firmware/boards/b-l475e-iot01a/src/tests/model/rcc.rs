//! Clocks, and the two bits of the power controller that they need: RM0351, chapters 5 and 6.

const MSI_HZ: f64 = 4e6;
const HSI16_HZ: f64 = 16e6;

/// Bits of CR (6.4.1).
const MSION: u32 = 1 << 0;
const MSIRDY: u32 = 1 << 1;
const MSIPLLEN: u32 = 1 << 2;
const MSI_SETTINGS: u32 = 0xf8;
const HSION: u32 = 1 << 8;
const HSIRDY: u32 = 1 << 10;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;
/// Bits of BDCR (6.4.29).
const LSEON: u32 = 1 << 0;
const LSERDY: u32 = 1 << 1;
const LSECSSON: u32 = 1 << 5;
const LSECSSD: u32 = 1 << 6;
const RTCSEL: u32 = 3 << 8;
const BDRST: u32 = 1 << 16;
/// Reset flags of CSR (6.4.30).
pub(crate) const BORRSTF: u32 = 1 << 27;
pub(crate) const IWDGRSTF: u32 = 1 << 29;
const RMVF: u32 = 1 << 23;
/// PWR_CR1 (5.4.1).
const DBP: u32 = 1 << 8;

/// What the 32 kHz crystal does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Crystal {
    /// It starts after this time, ms; 2 s typically (DS10969, "LSE oscillator characteristics").
    StartsIn(u64),
    /// It is missing or does not start.
    Dead,
}

pub(crate) struct Rcc {
    pub(crate) crystal: Crystal,
    /// Oscillators that never become ready: a mask of HSIRDY and PLLRDY.
    pub(crate) broken: u32,
    /// Real over nominal frequency of the MSI while it is not locked to the crystal.
    pub(crate) msi_error: f64,
    cr: u32,
    cfgr: u32,
    pllcfgr: u32,
    cifr: u32,
    bdcr: u32,
    csr: u32,
    /// AHB1ENR, AHB2ENR, APB1ENR1, APB2ENR.
    enabled: [u32; 4],
    pwr_cr1: u32,
    lse_since_ns: u64,
}

impl Rcc {
    pub(super) fn new() -> Self {
        Self {
            crystal: Crystal::StartsIn(2_000),
            broken: 0,
            msi_error: 1.0,
            cr: 0x63,
            cfgr: 0,
            pllcfgr: 0x1000,
            cifr: 0,
            bdcr: 0,
            csr: BORRSTF | 0x600,
            enabled: [1 << 8, 0, 0, 0],
            pwr_cr1: 0x200,
            lse_since_ns: 0,
        }
    }

    /// A system reset: the backup domain keeps what it has (6.1.3), the reason is added to the flags.
    pub(crate) fn reset(&mut self, reason: u32) {
        let fresh = Self::new();
        let (csr, bdcr) = (self.csr | reason, self.bdcr);
        *self = Self { csr, bdcr, crystal: self.crystal, lse_since_ns: self.lse_since_ns, ..fresh };
    }

    /// The crystal stops: with its CSS on, that is found, and the PLL mode of the MSI ends (6.2.11).
    pub(crate) fn stop_crystal(&mut self) {
        self.crystal = Crystal::Dead;
        self.bdcr &= !LSERDY;
        if self.bdcr & LSECSSON != 0 {
            self.bdcr |= LSECSSD;
            self.cifr |= 1 << 9;
            self.cr &= !MSIPLLEN;
        }
    }

    /// Whether the MSI is locked to the crystal.
    pub(crate) fn is_locked(&self) -> bool {
        self.cr & MSIPLLEN != 0
    }

    fn msi_hz(&self) -> f64 {
        assert_eq!(self.cr & MSI_SETTINGS, 0x60, "the model knows the 4 MHz of the MSI's reset state only");
        if self.is_locked() { MSI_HZ } else { MSI_HZ * self.msi_error }
    }

    fn pll_hz(&self) -> f64 {
        let source = match self.pllcfgr & 3 {
            1 => self.msi_hz(),
            2 => HSI16_HZ,
            source => panic!("PLL without a modelled source: PLLSRC = {source} (6.4.4)"),
        };
        let m = f64::from((self.pllcfgr >> 4 & 7) + 1);
        let n = f64::from(self.pllcfgr >> 8 & 0x7f);
        let r = f64::from(2 * ((self.pllcfgr >> 25 & 3) + 1));
        source / m * n / r
    }

    /// Frequency of the core and of both buses, whose dividers nobody sets.
    pub(crate) fn hclk_hz(&self) -> f64 {
        match self.cfgr >> 2 & 3 {
            0 => self.msi_hz(),
            1 => HSI16_HZ,
            _ => self.pll_hz(),
        }
    }

    pub(super) fn pass(&mut self, now_ns: u64) {
        if let Crystal::StartsIn(ms) = self.crystal
            && self.bdcr & LSEON != 0
            && now_ns >= self.lse_since_ns + ms * 1_000_000
        {
            self.bdcr |= LSERDY;
        }
    }

    /// A peripheral without its clock does not answer (6.2.17 "Peripheral clock enable register").
    pub(super) fn require_clock(&self, block: usize) {
        let (register, bit) = match block {
            0x4002_0000 => (0, 0),
            0x4800_0000..=0x4800_0c00 => (1, (block - 0x4800_0000) / 0x400),
            0x5004_0000 => (1, 13),
            0x4000_4400 => (2, 17),
            0x4000_7000 => (2, 28),
            0x4001_0000 => (3, 0),
            0x4001_3800 => (3, 14),
            _ => return,
        };
        assert!(self.enabled[register] >> bit & 1 == 1, "{block:#010x} has no clock (6.2.17)");
    }

    pub(super) fn load(&self, offset: usize) -> u32 {
        match offset {
            0x00 => self.cr,
            0x08 => self.cfgr,
            0x0c => self.pllcfgr,
            0x1c => self.cifr,
            0x48 => self.enabled[0],
            0x4c => self.enabled[1],
            0x58 => self.enabled[2],
            0x60 => self.enabled[3],
            0x90 => self.bdcr,
            0x94 => self.csr,
            _ => panic!("RCC register {offset:#x} is not modelled"),
        }
    }

    pub(super) fn store(&mut self, offset: usize, value: u32, now_ns: u64, latency: u32) {
        match offset {
            0x00 => self.store_cr(value),
            0x08 => self.switch(value, latency),
            0x0c => self.store_pllcfgr(value),
            0x48 => self.enabled[0] = value,
            0x4c => self.enabled[1] = value,
            0x58 => self.enabled[2] = value,
            0x60 => self.enabled[3] = value,
            0x90 => self.store_bdcr(value, now_ns),
            0x94 if value & RMVF != 0 => self.csr &= 0x7f_ffff,
            0x94 => self.csr = self.csr & !0xf01 | value & 0xf01,
            _ => panic!("RCC register {offset:#x} is not modelled"),
        }
    }

    fn store_cr(&mut self, value: u32) {
        let in_use = [MSION, HSION, 0, PLLON][(self.cfgr >> 2 & 3) as usize];
        assert!(value & in_use == in_use, "the clock in use cannot be stopped (6.2.8 \"System clock selection\")");
        assert_eq!(value & MSI_SETTINGS, self.cr & MSI_SETTINGS, "the model knows no other range of the MSI");
        let was_on = self.cr & PLLON != 0;
        let mut cr = value & (MSION | MSIPLLEN | MSI_SETTINGS | HSION | PLLON);
        if cr & MSIPLLEN != 0 {
            assert!(self.bdcr & LSERDY != 0, "MSIPLLEN needs a crystal that is ready (6.4.1)");
        }
        if cr & PLLON != 0 && !was_on {
            self.check_pll();
        }
        for (on, ready) in [(MSION, MSIRDY), (HSION, HSIRDY), (PLLON, PLLRDY)] {
            if cr & on != 0 && self.broken & ready == 0 {
                cr |= ready;
            }
        }
        self.cr = cr;
    }

    /// 6.4.4: input of 4 to 16 MHz after PLLM, VCO of 64 to 344 MHz, and the source ready.
    fn check_pll(&self) {
        let (m, n) = (f64::from((self.pllcfgr >> 4 & 7) + 1), f64::from(self.pllcfgr >> 8 & 0x7f));
        let r = f64::from(2 * ((self.pllcfgr >> 25 & 3) + 1));
        let input = self.pll_hz() * r / n;
        assert!(
            (4e6..=16e6).contains(&(input * 0.95)) || (4e6..=16e6).contains(&(input * 1.05)),
            "PLL input {input} Hz"
        );
        assert!((64e6..=344e6).contains(&(input * n)), "VCO at {} Hz (6.4.4)", input * n);
        assert!(m <= 8.0 && (8.0..=86.0).contains(&n), "PLLM and PLLN (6.4.4)");
        let ready = if self.pllcfgr & 3 == 1 { MSIRDY } else { HSIRDY };
        assert!(self.cr & ready != 0, "the source of the PLL must be ready (6.2.5)");
    }

    fn store_pllcfgr(&mut self, value: u32) {
        assert!(self.cr & (PLLON | PLLRDY) == 0, "the PLL is configured while it is off (6.2.5)");
        self.pllcfgr = value;
    }

    fn switch(&mut self, value: u32, latency: u32) {
        assert_eq!(value & 0x3ff0, 0, "the model knows no divided buses");
        let (sw, before) = (value & 3, self.cfgr >> 2 & 3);
        let ready = [MSIRDY, HSIRDY, 1 << 17, PLLRDY][sw as usize];
        // 6.2.8: a switch to a clock that is not ready waits until it is.
        let sws = if self.cr & ready != 0 { sw } else { before };
        if sws == 3 {
            assert!(self.pllcfgr >> 24 & 1 == 1, "PLLREN: the PLL's output for the core is off (6.4.4)");
        }
        self.cfgr = value & !0xc | sws << 2;
        let hclk_hz = self.hclk_hz();
        // 3.3.3, range 1 of the core voltage: one wait state for each 16 MHz.
        assert!(self.pwr_cr1 >> 9 & 3 == 1, "range 1 is the only one for more than 26 MHz (6.2.9)");
        let needed = ((hclk_hz * 0.99) / 16e6).ceil() as u32 - 1;
        assert!(latency >= needed, "{latency} wait states at {hclk_hz} Hz, which needs {needed} (3.3.3)");
    }

    fn store_bdcr(&mut self, value: u32, now_ns: u64) {
        assert!(self.pwr_cr1 & DBP != 0, "the backup domain is write-protected until DBP is set (5.4.1)");
        if value & BDRST != 0 {
            self.bdcr = BDRST;
            return;
        }
        if value & LSEON != 0 && self.bdcr & LSEON == 0 {
            self.lse_since_ns = now_ns;
        }
        let rtcsel = self.bdcr & RTCSEL;
        assert!(rtcsel == 0 || value & RTCSEL == rtcsel, "RTCSEL is written once (6.4.29)");
        if value & LSECSSON != 0 {
            assert!(self.bdcr & (LSERDY | LSECSSON) != 0, "LSECSSON needs a crystal that is ready (6.4.29)");
            assert!(value & RTCSEL != 0, "LSECSSON needs RTCSEL (6.4.29)");
        } else {
            assert!(self.bdcr & LSECSSON == 0, "LSECSSON stays until a failure (6.4.29)");
        }
        let kept = self.bdcr & (LSERDY | LSECSSD);
        self.bdcr = value & !(LSERDY | LSECSSD) | if value & LSEON == 0 { 0 } else { kept };
    }

    pub(super) fn load_power(&self, offset: usize) -> u32 {
        assert_eq!(offset, 0, "of the power controller only CR1 is modelled");
        self.pwr_cr1
    }

    pub(super) fn store_power(&mut self, offset: usize, value: u32) {
        assert_eq!(offset, 0, "of the power controller only CR1 is modelled");
        self.pwr_cr1 = value;
    }
}
