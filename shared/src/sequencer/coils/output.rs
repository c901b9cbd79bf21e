//! One output as the board drives it: its lines, its limits and its times.

use crate::duty::MeterLimit;
use crate::output::{Drive, MAX_COILS};
use crate::profile;
use crate::units::Micros;

/// One output: its lines, its limits and its times.
#[derive(Clone, Copy, Debug)]
pub(super) struct Output {
    pub(super) wires: Wires,
    pub(super) limit: MeterLimit,
    /// Length of its peak or pulse.
    pub(super) burst: Micros,
    /// Least time from the beginning of a peak of this table to that of the next; 0 without a peak.
    pub(super) pause: Micros,
    /// When it may have a peak again: the last peak set it, and no other table makes it earlier.
    pub(super) peak_from: Micros,
    /// When its last peak or pulse began.
    pub(super) changed: Micros,
    /// How long it is on by hand, and when it goes off: counted from when the supply has let it be switched on.
    pub(super) on_for: Micros,
    pub(super) off_at: Micros,
    /// When its current began or ended last.
    pub(super) switched: Micros,
    /// Until when its meter has counted.
    pub(super) counted: Micros,
}

/// Lines of one coil, as masks: a shift of 64 bits by a variable costs the chip ten instructions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wires {
    /// High while a coil pulls in; sets a latch.
    pub(super) first: u64,
    /// High while a coil is on; resets a latch.
    pub(super) second: u64,
}

pub(super) const NO_OUTPUT: Output = Output {
    wires: Wires { first: 0, second: 0 },
    limit: MeterLimit::NONE,
    burst: Micros(0),
    pause: Micros(0),
    peak_from: Micros(0),
    changed: Micros(0),
    on_for: Micros(0),
    off_at: Micros(0),
    switched: Micros(0),
    counted: Micros(0),
};

impl Output {
    pub(super) fn wire(&mut self, drive: &Drive) {
        let bit = |line: u8| 1u64.checked_shl(line.into()).unwrap_or(0);
        let (first, second, burst_ms) = match *drive {
            Drive::Hold { line } => (0, bit(line), 0),
            Drive::PeakHold { pull, hold, peak_ms } => (bit(pull), bit(hold), peak_ms),
            Drive::Latch { set, reset, pulse_ms } => (bit(set), bit(reset), pulse_ms),
        };
        self.wires = Wires { first, second };
        self.burst = Micros::from_millis(burst_ms.into());
        self.pause = drive.peak_pause();
        // A peak also waits for its own pause after a shorter one.
        self.peak_from = self.peak_from.max(self.changed + self.pause);
    }
}

/// An output that the profile does not have counts nothing: nothing ever feeds it.
pub(super) fn limit_of(output: Option<&profile::Output>) -> MeterLimit {
    output.map_or(MeterLimit::NONE, |output| MeterLimit::of(&output.limit))
}

/// The mask of one output; none where there is no such output.
pub(super) fn bit_of(number: u8) -> u64 {
    if usize::from(number) < MAX_COILS { 1 << number } else { 0 }
}
