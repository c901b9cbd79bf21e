//! Receiving by DMA: a channel of DMA1 writes bytes around a ring, and the core takes them out behind it.
//! RM0351, chapter 11.
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

use stm32_metapac::DMA1;
use stm32_metapac::bdma::regs;
use stm32_metapac::bdma::vals::Pl;

use crate::bus;

/// Bytes of the ring. The core has the time of half of it: 320 µs at 1 Mbaud, 2.8 ms at 115 200.
pub(crate) const RING: usize = 64;
/// Value of CSELR for the receivers of USART1 and USART2 (RM0351, 11.4.4 "DMA channel mapping").
const USART: u8 = 2;

/// A channel of DMA1 that serves a receiver (RM0351, 11.4.4 "DMA channel mapping").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Channel 5: USART1_RX.
    Usart1,
    /// Channel 6: USART2_RX.
    Usart2,
}

impl Channel {
    /// Its number, counted from 0.
    const fn index(self) -> usize {
        match self {
            Self::Usart1 => 4,
            Self::Usart2 => 5,
        }
    }
}

/// A channel with its ring.
pub(crate) struct Receiver {
    channel: Channel,
    ring: [AtomicU8; RING],
    /// Where the next byte is taken.
    taken: AtomicUsize,
}

/// What the channel has brought since the last look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Brought {
    /// This number of bytes; [`Receiver::take`] gives them.
    Bytes(usize),
    /// The channel may have overtaken the core: what the ring has is lost.
    Lapped,
    /// A bus error has stopped the channel, which runs again.
    Failed,
}

impl Receiver {
    /// The channel with an empty ring.
    pub(crate) const fn new(channel: Channel) -> Self {
        Self { channel, ring: [const { AtomicU8::new(0) }; RING], taken: AtomicUsize::new(0) }
    }

    /// Starts the channel on the data register at this address. RM0351, 11.4.5.
    pub(crate) fn start(&'static self, peripheral: u32) {
        let channel = DMA1.ch(self.channel.index());
        bus::write_value(channel.cr(), regs::Cr(0));
        self.clear(self.flags());
        bus::modify(DMA1.cselr(), |w| w.set_cs(self.channel.index(), USART));
        bus::write_value(channel.par(), peripheral);
        bus::write_value(channel.mar(), bus::dma_address(&self.ring));
        self.run();
    }

    /// Sets the channel to the begin of its ring and enables it.
    fn run(&self) {
        let channel = DMA1.ch(self.channel.index());
        bus::write(channel.ndtr(), |w| w.set_ndt(RING as u16));
        self.taken.store(0, Ordering::Relaxed);
        bus::write(channel.cr(), |w| {
            w.set_minc(true);
            w.set_circ(true);
            w.set_pl(Pl::VERY_HIGH);
            w.set_tcie(true);
            w.set_htie(true);
            w.set_teie(true);
            w.set_en(true);
        });
    }

    /// Looks where the channel is, and clears its flags.
    pub(crate) fn look(&self) -> Brought {
        let (flags, at) = self.settled();
        self.clear(flags);
        if flags.teif(self.channel.index()) {
            bus::write_value(DMA1.ch(self.channel.index()).cr(), regs::Cr(0));
            self.run();
            return Brought::Failed;
        }
        let taken = self.taken.load(Ordering::Relaxed);
        match brought(taken, at, flags.htif(self.channel.index()), flags.tcif(self.channel.index())) {
            Some(count) => Brought::Bytes(count),
            None => {
                self.taken.store(at, Ordering::Relaxed);
                Brought::Lapped
            }
        }
    }

    /// The next byte, of those that [`Receiver::look`] has counted.
    pub(crate) fn take(&self) -> u8 {
        let at = self.taken.load(Ordering::Relaxed) % RING;
        self.taken.store((at + 1) % RING, Ordering::Relaxed);
        self.ring[at].load(Ordering::Relaxed)
    }

    /// Flags and place of one moment.
    fn settled(&self) -> (regs::Isr, usize) {
        loop {
            let (before, flags) = (self.place(), self.flags());
            if before == self.place() {
                return (flags, before);
            }
        }
    }

    /// Where the channel writes next.
    fn place(&self) -> usize {
        (RING - usize::from(bus::read(DMA1.ch(self.channel.index()).ndtr()).ndt())) % RING
    }

    /// The flags of this channel.
    fn flags(&self) -> regs::Isr {
        regs::Isr(bus::read(DMA1.isr()).0 & 0xf << (4 * self.channel.index()))
    }

    /// Clears these flags alone: those of another channel belong to another handler.
    fn clear(&self, flags: regs::Isr) {
        bus::write_value(DMA1.ifcr(), flags);
    }
}

/// Bytes between two places of the channel. `half` and `full`: it has come past the middle, past the end. `None` where it has
/// passed both: then it may have run around, and what it has overwritten cannot be distinguished from what it has not.
const fn brought(from: usize, to: usize, half: bool, full: bool) -> Option<usize> {
    if half && full { None } else { Some((to + RING - from) % RING) }
}

#[cfg(test)]
mod tests {
    use super::{RING, brought};

    /// All ways of up to two rings.
    #[test]
    fn each_distance_is_found_or_known_to_be_too_long() {
        for from in 0..RING {
            for distance in 0..2 * RING {
                let passed = |mark: usize| (from + 1..=from + distance).any(|place| place % RING == mark);
                let found = brought(from, (from + distance) % RING, passed(RING / 2), passed(0));
                let expected =
                    (distance < RING).then_some(distance).filter(|_| found.is_some() || distance <= RING / 2);
                assert_eq!(found, expected, "from {from} over {distance}");
            }
        }
    }
}
