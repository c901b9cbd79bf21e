//! What the supply can still feed: the profile limits how many coils are switched on within a window.

use std::collections::VecDeque;

use darm_core::output::{Drive, SwitchLimit, Wiring};

use crate::view::SupplyView;

/// More coils than any supply feeds.
const ALL: u32 = 1 << 16;

/// The coils that the server has seen switched on lately. One that is switched on and off between two looks is not seen.
#[derive(Debug)]
pub(super) struct Supply {
    /// The coils that the word switches on: bits of the wiring.
    on: u64,
    /// When coils were seen to be switched on, s, and how many; the oldest first.
    recent: VecDeque<(f64, u32)>,
}

impl Supply {
    /// Of a board that started at this time: it counts its supply as exhausted then, since it does not know what was on before.
    pub(super) fn of_start(at_s: f64) -> Self {
        Self { on: 0, recent: VecDeque::from([(at_s, ALL)]) }
    }

    /// Notes which coils are on. A latch is fed when it changes, in either direction.
    pub(super) fn see(&mut self, now_s: f64, wiring: &Wiring, on: u64) {
        let latch = |(index, coil): (usize, &darm_core::output::Coil)| match coil.drive {
            Drive::Latch { .. } => 1 << index,
            _ => 0,
        };
        let latches = wiring.coils.iter().enumerate().map(latch).fold(0, |all, one| all | one);
        let fed = ((on ^ self.on) & (on | latches)).count_ones();
        self.on = on;
        if fed > 0 {
            self.recent.push_back((now_s, fed));
        }
    }

    /// What it can feed now, and when it can feed more.
    pub(super) fn view(&mut self, now_s: f64, limit: &SwitchLimit) -> SupplyView {
        let window_s = 1e-3 * f64::from(limit.window_ms);
        self.recent.retain(|(at_s, _)| now_s - at_s < window_s);
        let all = u32::from(limit.new_coils);
        let mut used: u32 = self.recent.iter().map(|(_, coils)| coils).sum();
        let room = all.saturating_sub(used);
        let mut wait_s = 0.0;
        for (at_s, coils) in &self.recent {
            if used < all {
                break;
            }
            (used, wait_s) = (used - coils, at_s + window_s - now_s);
        }
        let full_s = self.recent.back().map_or(0.0, |(at_s, _)| at_s + window_s - now_s);
        SupplyView { room, all, wait_s, full_s }
    }
}

#[cfg(test)]
mod tests {
    use darm_core::output::{Coil, CoilLimit, Drive, SwitchLimit, Wiring};

    use super::Supply;

    #[test]
    fn the_supply_feeds_what_its_window_has_left_and_counts_down_to_more() {
        let mut wiring = Wiring::default();
        let limit = CoilLimit { max_on_ms: 1, duty_percent: 1, window_ms: 1 };
        let drives = [Drive::Hold { line: 0 }, Drive::Hold { line: 1 }, Drive::Latch { set: 2, reset: 3, pulse_ms: 9 }];
        for (output, drive) in (0..).zip(drives) {
            wiring.coils.push(Coil { output, drive, limit }).unwrap();
        }
        let (mut supply, limit) = (Supply::of_start(-1.5), SwitchLimit { new_coils: 2, window_ms: 1000 });
        let room = |supply: &mut Supply, now_s| supply.view(now_s, &limit).room;
        assert_eq!((room(&mut supply, -0.6), room(&mut supply, -0.4)), (0, 2), "exhausted at the start");
        supply.see(0.0, &wiring, 0b001);
        assert_eq!(room(&mut supply, 0.0), 1);
        supply.see(0.4, &wiring, 0b111);
        let none = supply.view(0.5, &limit);
        assert_eq!((none.room, none.all), (0, 2));
        assert!((none.wait_s - 0.9).abs() < 1e-9 && (none.full_s - 0.9).abs() < 1e-9, "{none:?}");
        assert_eq!(room(&mut supply, 1.1), 0, "three went on where two may");
        // What goes off takes nothing, but a latch does.
        supply.see(1.5, &wiring, 0b000);
        let one = supply.view(1.5, &limit);
        assert_eq!((one.room, one.wait_s), (1, 0.0));
        assert!((one.full_s - 1.0).abs() < 1e-9);
        assert_eq!(room(&mut supply, 2.5), 2);
    }
}
