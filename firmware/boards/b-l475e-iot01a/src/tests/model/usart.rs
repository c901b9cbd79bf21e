//! USART1 and USART2: RM0351, chapter 40. 8 data bits, no parity, one stop bit, oversampling by 16.

use std::collections::VecDeque;

/// Bits of CR1 (40.8.1).
const UE: u32 = 1 << 0;
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const IDLEIE: u32 = 1 << 4;
const RXNEIE: u32 = 1 << 5;
/// PCE, M0, OVER8, M1: the frame, which changes only while the USART is off.
const FRAME: u32 = 1 << 10 | 1 << 12 | 1 << 15 | 1 << 28;
/// Bits of CR3 (40.8.3).
const EIE: u32 = 1 << 0;
const HDSEL: u32 = 1 << 3;
const DMAR: u32 = 1 << 6;
/// EIE, DMAR and DMAT, which change at any time.
const ANY_TIME: u32 = EIE | DMAR | 1 << 7;
/// Bits of ISR (40.8.8).
pub(crate) const PE: u32 = 1 << 0;
pub(crate) const FE: u32 = 1 << 1;
pub(crate) const NF: u32 = 1 << 2;
pub(crate) const ORE: u32 = 1 << 3;
pub(crate) const IDLE: u32 = 1 << 4;
pub(crate) const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
/// What ICR clears (40.8.9).
const CLEARED: u32 = PE | FE | NF | ORE | IDLE | TC;
/// Bits of a frame on the line.
const BITS: f64 = 10.0;
/// Largest difference of the rates (40.5.5 "Tolerance of the USART receiver to clock deviation").
const TOLERANCE: f64 = 0.0375;

/// A byte on its way in.
#[derive(Clone, Copy)]
struct Coming {
    start_ns: u64,
    end_ns: u64,
    byte: u8,
    /// Flags with which it arrives: [`FE`], [`NF`], [`PE`].
    flags: u32,
    baud: f64,
}

pub(crate) struct Usart {
    cr1: u32,
    cr3: u32,
    brr: u32,
    isr: u32,
    rdr: u8,
    tdr: Option<u8>,
    /// What leaves now, and when its stop bit ends.
    shifting: Option<(u8, u64)>,
    coming: VecDeque<Coming>,
    /// When the line counts as idle.
    idle_ns: Option<u64>,
    /// Bytes that have left, with the end of their stop bits, ns.
    pub(crate) sent: Vec<(u8, u64)>,
    /// Duration of a bit, ns.
    bit_ns: f64,
}

impl Usart {
    pub(super) fn new() -> Self {
        Self {
            cr1: 0,
            cr3: 0,
            brr: 0,
            isr: TC | TXE,
            rdr: 0,
            tdr: None,
            shifting: None,
            coming: VecDeque::new(),
            idle_ns: None,
            sent: Vec::new(),
            bit_ns: 0.0,
        }
    }

    /// The other side sends, from now on or after what it sends already.
    pub(crate) fn hear(&mut self, now_ns: u64, baud: f64, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.hear_with(now_ns, baud, *byte, 0));
    }

    /// The other side sends a byte that arrives with these flags.
    pub(crate) fn hear_with(&mut self, now_ns: u64, baud: f64, byte: u8, flags: u32) {
        let start_ns = self.coming.back().map_or(now_ns, |last| last.end_ns.max(now_ns));
        let end_ns = start_ns + (BITS * 1e9 / baud) as u64;
        self.coming.push_back(Coming { start_ns, end_ns, byte, flags, baud });
    }

    /// Rate of this USART, baud.
    pub(crate) fn baud(&self) -> f64 {
        1e9 / self.bit_ns
    }

    /// Whether the USART requests its interrupt (40.6).
    pub(crate) fn is_pending(&self) -> bool {
        // IDLEIE, RXNEIE, TCIE and TXEIE are where the flags are.
        self.isr & self.cr1 & (IDLE | RXNE | TC | TXE) != 0
            || self.cr1 & RXNEIE != 0 && self.isr & ORE != 0
            || self.cr3 & EIE != 0 && self.isr & (FE | NF | ORE) != 0
    }

    pub(super) fn next_ns(&self) -> Option<u64> {
        let shifted = self.shifting.map(|(_, end_ns)| end_ns);
        let came = self.coming.front().map(|coming| coming.end_ns);
        [shifted, came, self.idle_ns].into_iter().flatten().min()
    }

    pub(super) fn pass(&mut self, now_ns: u64) {
        while let Some(coming) = self.coming.pop_front_if(|coming| coming.end_ns <= now_ns) {
            self.receive(coming);
        }
        if let Some((byte, end_ns)) = self.shifting.filter(|(_, end_ns)| *end_ns <= now_ns) {
            self.sent.push((byte, end_ns));
            self.shifting = None;
            if self.cr3 & HDSEL != 0 {
                // One wire: the receiver hears what is sent (40.5.12).
                self.receive(Coming { start_ns: end_ns, end_ns, byte, flags: 0, baud: self.baud() });
            }
            self.shift(end_ns);
        }
        if let Some(idle_ns) = self.idle_ns.filter(|idle_ns| *idle_ns <= now_ns) {
            self.idle_ns = None;
            // A start bit before that ends the idle time.
            if self.coming.front().is_none_or(|coming| coming.start_ns >= idle_ns) {
                self.isr |= IDLE;
            }
        }
    }

    fn receive(&mut self, coming: Coming) {
        if self.cr1 & (UE | RE) != UE | RE {
            return;
        }
        self.idle_ns = Some(coming.end_ns + (BITS * self.bit_ns) as u64);
        let wrong_rate = (coming.baud / self.baud() - 1.0).abs() > TOLERANCE;
        self.isr |= coming.flags | if wrong_rate { FE } else { 0 };
        if self.isr & RXNE != 0 {
            // 40.5.3 "Overrun error": the register keeps its byte, the new one is lost.
            self.isr |= ORE;
            return;
        }
        self.rdr = if wrong_rate { !coming.byte } else { coming.byte };
        self.isr |= RXNE;
    }

    /// 40.5.2: the register moves to the shift register as soon as that is empty.
    fn shift(&mut self, now_ns: u64) {
        match self.tdr.take() {
            Some(byte) => {
                self.shifting = Some((byte, now_ns + (BITS * self.bit_ns) as u64));
                self.isr |= TXE;
            }
            None => self.isr |= TC,
        }
    }

    pub(super) fn requests_dma(&self) -> bool {
        self.cr3 & DMAR != 0 && self.isr & RXNE != 0
    }

    pub(super) fn read_data(&mut self) -> u32 {
        self.isr &= !RXNE;
        self.rdr.into()
    }

    pub(super) fn load(&mut self, offset: usize) -> u32 {
        match offset {
            0x00 => self.cr1,
            0x08 => self.cr3,
            0x0c => self.brr,
            0x1c => self.isr,
            0x24 => self.read_data(),
            _ => panic!("USART register {offset:#x} is not modelled, or cannot be read"),
        }
    }

    pub(super) fn store(&mut self, offset: usize, value: u32, now_ns: u64, clock_hz: f64) {
        match offset {
            0x00 => self.store_cr1(value, clock_hz),
            0x08 => {
                let changed = value ^ self.cr3;
                assert!(self.is_off() || changed & !ANY_TIME == 0, "HDSEL is written while UE is clear (40.8.3)");
                self.cr3 = value;
            }
            0x0c => {
                assert!(self.is_off(), "BRR is written while UE is clear (40.8.4)");
                assert!((16..=0xffff).contains(&value), "USARTDIV is at least 16 (40.5.4)");
                self.brr = value;
            }
            0x1c => panic!("ISR is read-only (40.8.8)"),
            0x20 => self.isr &= !(value & CLEARED),
            0x28 => self.send(value as u8, now_ns),
            _ => panic!("USART register {offset:#x} is not modelled, or cannot be written"),
        }
    }

    fn is_off(&self) -> bool {
        self.cr1 & UE == 0
    }

    fn store_cr1(&mut self, value: u32, clock_hz: f64) {
        assert!(self.is_off() || (value ^ self.cr1) & FRAME == 0, "the frame is set while UE is clear (40.8.1)");
        assert_eq!(value & FRAME, 0, "the model knows 8 data bits without parity");
        assert!(value & IDLEIE == 0 || value & RE != 0, "idle frames are detected by a receiver that is on (40.5.3)");
        assert!(value & RXNEIE == 0 || self.cr3 & DMAR == 0, "the byte would be taken twice (40.5.15)");
        if value & UE != 0 && self.is_off() {
            assert!(self.brr >= 16, "the rate is set before UE (40.5.2)");
            self.bit_ns = f64::from(self.brr) * 1e9 / clock_hz;
        }
        self.cr1 = value;
    }

    fn send(&mut self, byte: u8, now_ns: u64) {
        assert!(self.cr1 & (UE | TE) == UE | TE, "the transmitter is off (40.5.2)");
        assert!(self.isr & TXE != 0, "a byte over one that has not left: it is lost (40.5.2)");
        self.isr &= !(TC | TXE);
        self.tdr = Some(byte);
        if self.shifting.is_none() {
            self.shift(now_ns);
        }
    }
}
