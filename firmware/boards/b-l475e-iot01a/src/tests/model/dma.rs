//! DMA1 as far as the receivers of two USARTs use it: RM0351, chapter 11.

/// Channels of USART1_RX and USART2_RX, counted from 1 (11.4.4 "DMA channel mapping").
pub(super) const RECEIVERS: [usize; 2] = [5, 6];
/// Value of CSELR for both.
const USART: u32 = 2;
/// Addresses of their data registers.
const DATA: [u32; 2] = [0x4001_3824, 0x4000_4424];

/// Bits of CCR (11.6.3).
const EN: u32 = 1 << 0;
const DIR: u32 = 1 << 4;
const CIRC: u32 = 1 << 5;
const MINC: u32 = 1 << 7;
const SIZES: u32 = 0xf00;

/// Flags of a channel in ISR (11.6.1).
const GIF: u32 = 1 << 0;
const TCIF: u32 = 1 << 1;
const HTIF: u32 = 1 << 2;
const TEIF: u32 = 1 << 3;

pub(crate) struct Dma {
    isr: u32,
    channels: [Channel; 7],
    cselr: u32,
}

#[derive(Clone, Copy, Default)]
struct Channel {
    ccr: u32,
    left: u32,
    /// What CNDTR was set to, which circular mode reloads.
    length: u32,
    peripheral: u32,
    memory: u32,
}

impl Dma {
    pub(super) fn new() -> Self {
        Self { isr: 0, channels: [Channel::default(); 7], cselr: 0 }
    }

    /// Whether the channel requests its interrupt.
    pub(crate) fn is_pending(&self, channel: usize) -> bool {
        // TCIE, HTIE and TEIE are where the flags are.
        self.isr >> (4 * (channel - 1)) & self.channels[channel - 1].ccr & (TCIF | HTIF | TEIF) != 0
    }

    /// Bus error of a channel: it is disabled, and says so (11.4.7 "Error management").
    pub(crate) fn fail(&mut self, channel: usize) {
        self.channels[channel - 1].ccr &= !EN;
        self.flag(channel, TEIF);
    }

    fn flag(&mut self, channel: usize, flag: u32) {
        self.isr |= (flag | GIF) << (4 * (channel - 1));
    }

    /// Serves a request: where the byte goes. `None` while the channel is off or finished.
    pub(super) fn take(&mut self, channel: usize) -> Option<u32> {
        let index = RECEIVERS.iter().position(|receiver| *receiver == channel)?;
        let Channel { ccr, left, length, peripheral, memory } = self.channels[channel - 1];
        if ccr & EN == 0 || left == 0 {
            return None;
        }
        assert_eq!(self.cselr >> (4 * (channel - 1)) & 0xf, USART, "the channel serves another request (11.6.7)");
        assert_eq!((peripheral, ccr & (DIR | MINC | SIZES)), (DATA[index], MINC), "CPAR, DIR, MINC or sizes (11.6.3)");
        let left = left - 1;
        self.channels[channel - 1].left = if left == 0 && ccr & CIRC != 0 { length } else { left };
        if left == length / 2 {
            self.flag(channel, HTIF);
        }
        if left == 0 {
            self.flag(channel, TCIF);
        }
        Some(memory + length - 1 - left)
    }

    pub(super) fn load(&self, offset: usize) -> u32 {
        match offset {
            0x00 => self.isr,
            0x04 => panic!("IFCR is write-only (11.6.2)"),
            0xa8 => self.cselr,
            _ => {
                let channel = &self.channels[(offset - 8) / 20];
                [channel.ccr, channel.left, channel.peripheral, channel.memory][(offset - 8) % 20 / 4]
            }
        }
    }

    pub(super) fn store(&mut self, offset: usize, value: u32) {
        match offset {
            0x04 => self.isr &= !value,
            0xa8 => self.cselr = value,
            0x00 => panic!("ISR is read-only (11.6.1)"),
            _ => self.store_channel((offset - 8) / 20, (offset - 8) % 20 / 4, value),
        }
    }

    fn store_channel(&mut self, index: usize, word: usize, value: u32) {
        let channel = &mut self.channels[index];
        let is_on = channel.ccr & EN != 0;
        if word > 0 || value & EN != 0 {
            assert!(!is_on, "a channel is set up while it is disabled (11.6.3 to 11.6.6)");
        }
        match word {
            0 => channel.ccr = value,
            1 => (channel.left, channel.length) = (value, value),
            2 => channel.peripheral = value,
            _ => channel.memory = value,
        }
        if word == 0 && value & EN != 0 {
            assert!(self.isr >> (4 * index) & 0xf == 0, "a channel is enabled with its flags cleared (11.4.7)");
        }
    }
}
