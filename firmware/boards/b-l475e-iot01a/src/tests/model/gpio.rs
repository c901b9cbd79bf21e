//! Ports A to D: RM0351, chapter 8.

/// Registers of one port in words: MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFRL, AFRH, BRR.
const WORDS: usize = 11;
const IDR: usize = 4;
const ODR: usize = 5;
const BSRR: usize = 6;

/// A change of a port's output register, or of what a pin is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Edge {
    /// Output register of a port.
    Level { port: usize, odr: u32 },
    /// Mode register of a port.
    Mode { port: usize, moder: u32 },
}

pub(crate) struct Gpio {
    ports: [[u32; WORDS]; 4],
    /// What came from outside, per port.
    pub(crate) inputs: [u32; 4],
    pub(crate) edges: Vec<Edge>,
}

impl Gpio {
    pub(super) fn new() -> Self {
        let mut ports = [[0; WORDS]; 4];
        // 8.5.1: all pins are analog but those of the debugger.
        for (port, moder) in ports.iter_mut().zip([0xabff_ffff, 0xffff_febf, 0xffff_ffff, 0xffff_ffff]) {
            port[0] = moder;
        }
        ports[0][3] = 0x6400_0000;
        ports[1][3] = 0x0000_0100;
        ports[0][2] = 0x0c00_0000;
        Self { ports, inputs: [0; 4], edges: Vec::new() }
    }

    /// OSPEEDR of a port (8.5.3), two bits a pin.
    pub(crate) fn speed(&self, port: usize, pin: usize) -> u32 {
        self.ports[port][2] >> (2 * pin) & 3
    }

    pub(super) fn load(&self, address: usize) -> u32 {
        let (port, word) = (address >> 10, (address & 0x3ff) / 4);
        match word {
            IDR => self.inputs[port],
            BSRR => panic!("BSRR is write-only (8.5.7)"),
            word => self.ports[port][word],
        }
    }

    pub(super) fn store(&mut self, address: usize, value: u32) {
        let (port, word) = (address >> 10, (address & 0x3ff) / 4);
        match word {
            IDR => panic!("IDR is read-only (8.5.5)"),
            BSRR => {
                let odr = self.ports[port][ODR] & !(value >> 16) | value & 0xffff;
                self.ports[port][ODR] = odr;
                self.edges.push(Edge::Level { port, odr });
            }
            word => {
                self.ports[port][word] = value;
                if word == 0 {
                    self.edges.push(Edge::Mode { port, moder: value });
                }
            }
        }
    }
}
