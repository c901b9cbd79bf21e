//! What the supply can feed: how many coils may be switched on within a window.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::units::Micros;

/// How many coils may be switched on within a window: what the supply can feed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SwitchLimit {
    /// Coils that may be newly switched on within the window, 1 to [`SwitchLimit::MAX_COILS`].
    pub new_coils: u8,
    /// Length of the window.
    pub window_ms: u16,
}

impl SwitchLimit {
    /// Most coils that a limit may allow in its window.
    pub const MAX_COILS: usize = 16;
    /// Longest window.
    pub const MAX_WINDOW_MS: u16 = 10_000;

    /// Whether this limit bounds anything.
    pub fn is_sound(&self) -> bool {
        (1..=Self::MAX_COILS).contains(&usize::from(self.new_coils))
            && (1..=Self::MAX_WINDOW_MS).contains(&self.window_ms)
    }

    /// Whether this limit of a profile allows that of a table: no more coils, in no shorter a window.
    pub const fn allows(&self, table: &Self) -> bool {
        table.new_coils <= self.new_coils && table.window_ms >= self.window_ms
    }
}

impl fmt::Display for SwitchLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at most {} outputs on within {} ms", self.new_coils, self.window_ms)
    }
}

impl Default for SwitchLimit {
    fn default() -> Self {
        Self { new_coils: 6, window_ms: 10 }
    }
}

/// When coils went on lately, and how many: the memory that the [`SwitchLimit`] needs.
#[derive(Clone, Debug, Default)]
pub struct SwitchClock {
    recent: heapless::Deque<(Micros, u8), { SwitchLimit::MAX_COILS }>,
}

impl SwitchClock {
    /// How many coils may be switched on at `now`.
    pub fn room(&mut self, now: Micros, limit: &SwitchLimit) -> u8 {
        let window = Micros::from_millis(u32::from(limit.window_ms));
        while self.recent.front().is_some_and(|&(then, _)| now - then >= window) {
            self.recent.pop_front();
        }
        self.recent.iter().fold(limit.new_coils, |room, &(_, coils)| room.saturating_sub(coils))
    }

    /// Notes that this many coils, no more than there was [`room`](Self::room) for, went on at `now`.
    pub fn note(&mut self, now: Micros, coils: u8) {
        if coils > 0 {
            // Each note takes room of at least one, so there are never more notes than a limit allows coils.
            let _ = self.recent.push_back((now, coils));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_coils_at_once_and_no_more() {
        let limit = SwitchLimit { new_coils: 2, window_ms: 10 };
        let mut clock = SwitchClock::default();
        clock.note(Micros(0), 1);
        assert_eq!(clock.room(Micros(9_999), &limit), 1);
        clock.note(Micros(9_999), 1);
        assert_eq!(clock.room(Micros(9_999), &limit), 0);
        assert_eq!(clock.room(Micros(10_000), &limit), 1);
    }
}
