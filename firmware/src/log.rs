//! The last events, by number.
use darm_core::sequencer::Event;
use darm_core::units::Micros;
use darm_core::wire::message::Events;

use crate::control::Numbered;

/// Events kept.
const KEPT: usize = 64;

/// What happened last.
#[derive(Default)]
pub struct EventLog {
    list: heapless::Deque<(Micros, Event), KEPT>,
    next: u32,
}

impl EventLog {
    /// Appends an event. After a gap in the numbers the older ones go: the list has no holes.
    pub fn push(&mut self, event: Numbered) {
        if event.number != self.next {
            self.list.clear();
        }
        if self.list.is_full() {
            self.list.pop_front();
        }
        // There is room: the oldest has just gone.
        let _ = self.list.push_back((event.at, event.event));
        self.next = event.number.wrapping_add(1);
    }

    /// Number that the next event will have.
    pub fn next(&self) -> u32 {
        self.next
    }

    /// Number of the oldest event kept.
    pub fn first(&self) -> u32 {
        self.next.wrapping_sub(self.list.len() as u32)
    }

    /// As many events as fit an answer, from a number on.
    pub fn from(&self, from: u32) -> Events {
        let oldest = self.first();
        let first = from.max(oldest).min(self.next);
        let skip = first.saturating_sub(oldest) as usize;
        let mut list = heapless::Vec::new();
        for event in self.list.iter().skip(skip) {
            if list.push(*event).is_err() {
                break;
            }
        }
        Events { first, list }
    }
}

#[cfg(test)]
mod tests {
    use super::{EventLog, KEPT};
    use crate::control::Numbered;
    use darm_core::sequencer::Event;
    use darm_core::units::Micros;

    fn event(number: u32) -> Numbered {
        Numbered { number, at: Micros(u64::from(number)), event: Event::Started }
    }

    #[test]
    fn old_events_go_and_numbers_stay() {
        let mut log = EventLog::default();
        (0..100).for_each(|number| log.push(event(number)));
        assert_eq!((log.first(), log.next()), (100 - KEPT as u32, 100));
        let events = log.from(97);
        assert_eq!((events.first, events.list.len(), events.list[0].0), (97, 3, Micros(97)));
        assert_eq!(log.from(0).first, log.first());
        assert!(log.from(200).list.is_empty());
    }

    #[test]
    fn a_gap_is_not_papered_over() {
        let mut log = EventLog::default();
        [0, 1, 5].into_iter().for_each(|number| log.push(event(number)));
        assert_eq!((log.from(0).first, log.from(0).list.len()), (5, 1));
    }
}
