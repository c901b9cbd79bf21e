//! The last events, by number, in memory that outlives resets: those of earlier starts stay until newer ones need their place.
//!
//! Each entry has a check, so that noise after power-up and an entry that a reset has cut count as none. Events are counted
//! over all starts; the number that a host sees is counted from the begin of this one.
use darm_core::sequencer::Event;
use darm_core::units::Micros;
use darm_core::wire::message::{EVENTS, Events};

use crate::control::Numbered;

/// Events kept.
pub const KEPT: usize = 64;
/// Bytes of the longest event: a fault, or a row with its word.
const MAX_EVENT: usize = 28;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// One event as bytes.
#[derive(Clone, Copy)]
#[repr(C)]
struct Entry {
    check: u32,
    /// Counts the events of all starts, and wraps.
    sequence: u32,
    at_us: [u32; 2],
    event: [u8; MAX_EVENT],
}

impl Entry {
    const EMPTY: Self = Self { check: 0, sequence: 0, at_us: [0; 2], event: [0; MAX_EVENT] };

    /// `None` where the event needs more bytes, which no event does.
    fn new(sequence: u32, at: Micros, event: &Event) -> Option<Self> {
        let at_us = [at.0 as u32, (at.0 >> 32) as u32];
        let mut entry = Self { check: 0, sequence, at_us, event: [0; MAX_EVENT] };
        postcard::to_slice(event, &mut entry.event).ok()?;
        entry.check = entry.sum();
        Some(entry)
    }

    fn sum(&self) -> u32 {
        let mut digest = CRC.digest();
        let [low, high] = self.at_us;
        for word in [self.sequence, low, high] {
            digest.update(&word.to_le_bytes());
        }
        digest.update(&self.event);
        digest.finalize()
    }

    fn is_valid(&self) -> bool {
        self.check == self.sum()
    }

    fn decode(&self) -> Option<(Micros, Event)> {
        let [low, high] = self.at_us;
        let (event, _) = postcard::take_from_bytes(&self.event).ok()?;
        Some((Micros(u64::from(high) << 32 | u64::from(low)), event))
    }
}

/// Memory of the events. Any content is valid.
#[repr(C)]
pub struct LogMemory([Entry; KEPT]);

impl LogMemory {
    /// No event.
    pub const fn new() -> Self {
        Self([Entry::EMPTY; KEPT])
    }

    fn slot(&mut self, sequence: u32) -> Option<&mut Entry> {
        self.0.get_mut(sequence as usize % KEPT)
    }

    /// The event of this sequence number, if it is still there.
    fn get(&self, sequence: u32) -> Option<(Micros, Event)> {
        let entry = self.0.get(sequence as usize % KEPT)?;
        (entry.sequence == sequence && entry.is_valid()).then(|| entry.decode())?
    }

    /// The number behind the newest event.
    fn next(&self) -> u32 {
        let valid = self.0.iter().filter(|entry| entry.is_valid()).map(|entry| entry.sequence);
        // Numbers wrap: the newer of two is the one that lies ahead by less than half the circle.
        let newest = valid.reduce(|a, b| if (b.wrapping_sub(a) as i32) > 0 { b } else { a });
        newest.map_or(0, |newest| newest.wrapping_add(1))
    }
}

impl Default for LogMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// What happened last.
pub struct EventLog<'m> {
    memory: &'m mut LogMemory,
    /// Sequence number of event 0 of this start.
    begin: u32,
    next: u32,
}

impl<'m> EventLog<'m> {
    /// Continues what memory has of earlier starts.
    pub fn new(memory: &'m mut LogMemory) -> Self {
        let begin = memory.next();
        Self { memory, begin, next: 0 }
    }

    /// Appends an event. After a gap in the numbers the older ones are no longer reached: the list has no holes.
    pub fn push(&mut self, event: Numbered) {
        let sequence = self.begin.wrapping_add(event.number);
        if let Some(entry) = Entry::new(sequence, event.at, &event.event)
            && let Some(slot) = self.memory.slot(sequence)
        {
            *slot = entry;
        }
        self.next = event.number.wrapping_add(1);
    }

    /// Number that the next event will have.
    pub fn next(&self) -> u32 {
        self.next
    }

    /// Number of the oldest event of this start that is kept, without a hole up to the newest.
    pub fn first(&self) -> u32 {
        let kept =
            (1..=self.next.min(KEPT as u32)).take_while(|back| self.event(self.next.wrapping_sub(*back)).is_some());
        self.next.wrapping_sub(kept.count() as u32)
    }

    fn event(&self, number: u32) -> Option<(Micros, Event)> {
        self.memory.get(self.begin.wrapping_add(number))
    }

    /// As many events as fit an answer, from a number on.
    pub fn from(&self, from: u32) -> Events {
        let first = from.max(self.first()).min(self.next);
        Events { first, list: answer((first..self.next).map_while(|number| self.event(number))) }
    }

    /// As many events of earlier starts as fit an answer, the newest first, without this number of the newest. Their times are
    /// those of their start, which begins with `Booted`.
    pub fn before(&self, skip: u32) -> heapless::Vec<(Micros, Event), EVENTS> {
        let back = (1..=KEPT as u32).map(|back| self.begin.wrapping_sub(back));
        answer(back.map_while(|sequence| self.memory.get(sequence)).skip(skip as usize))
    }
}

/// The first of these events, as many as fit an answer.
fn answer(events: impl Iterator<Item = (Micros, Event)>) -> heapless::Vec<(Micros, Event), EVENTS> {
    let mut list = heapless::Vec::new();
    for event in events {
        if list.push(event).is_err() {
            break;
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::{EventLog, KEPT, LogMemory};
    use crate::control::Numbered;
    use darm_core::output::MAX_ACTUATORS;
    use darm_core::sequencer::{Event, Fault, FaultKind};
    use darm_core::units::{Micros, Word};

    fn event(number: u32) -> Numbered {
        Numbered { number, at: Micros(u64::from(number)), event: Event::Started }
    }

    fn push(log: &mut EventLog, numbers: impl IntoIterator<Item = u32>) {
        numbers.into_iter().for_each(|number| log.push(event(number)));
    }

    #[test]
    fn old_events_go_and_numbers_stay() {
        let mut memory = LogMemory::default();
        let mut log = EventLog::new(&mut memory);
        push(&mut log, 0..100);
        assert_eq!((log.first(), log.next()), (100 - KEPT as u32, 100));
        let events = log.from(97);
        assert_eq!((events.first, events.list.len(), events.list[0].0), (97, 3, Micros(97)));
        assert_eq!(log.from(0).first, log.first());
        assert!(log.from(200).list.is_empty());
    }

    #[test]
    fn a_gap_is_not_papered_over() {
        let mut memory = LogMemory::default();
        let mut log = EventLog::new(&mut memory);
        push(&mut log, [0, 1, 5]);
        assert_eq!((log.from(0).first, log.from(0).list.len()), (5, 1));
    }

    #[test]
    fn the_longest_events_fit() {
        let mut memory = LogMemory::default();
        let mut log = EventLog::new(&mut memory);
        let mut word = Word::zeros(MAX_ACTUATORS as u8).unwrap();
        (0..MAX_ACTUATORS).for_each(|actuator| word = word.with_digit(actuator, 3));
        let kind = FaultKind::ServoRange { servo: u8::MAX, angle_rad: 1.0 };
        let fault = Fault { at: Micros(u64::MAX), row: Some(u16::MAX), kind };
        let events = [Event::Row { row: u16::MAX, word }, Event::Fault(fault)];
        for (number, event) in (0..).zip(events) {
            log.push(Numbered { number, at: Micros(u64::MAX), event });
        }
        assert_eq!(log.from(0).list, events.map(|event| (Micros(u64::MAX), event)));
    }

    #[test]
    fn events_of_earlier_starts_stay_until_newer_ones_need_their_place() {
        let mut memory = LogMemory::default();
        for count in [40, 10] {
            push(&mut EventLog::new(&mut memory), 0..count);
        }
        let mut log = EventLog::new(&mut memory);
        assert_eq!((log.first(), log.next()), (0, 0));
        let times = |log: &EventLog, skip| log.before(skip).iter().map(|(at, _)| at.0).collect::<Vec<_>>();
        assert_eq!(times(&log, 0), [9, 8, 7, 6, 5, 4, 3, 2]);
        assert_eq!(times(&log, 8), [1, 0, 39, 38, 37, 36, 35, 34]);
        assert_eq!(times(&log, 48), [1, 0]);
        push(&mut log, 0..30);
        assert_eq!(log.from(0).first, 0);
        assert_eq!(times(&log, 32), [17, 16], "30 new ones leave 34 old ones");
    }

    #[test]
    fn noise_and_a_cut_entry_are_no_events() {
        let mut memory = LogMemory::default();
        push(&mut EventLog::new(&mut memory), 0..5);
        for (entry, noise) in memory.0.iter_mut().skip(5).zip(1u32..) {
            entry.sequence = noise.wrapping_mul(0x9e37_79b9);
            entry.check = noise;
        }
        memory.0[4].event[0] ^= 1;
        let log = EventLog::new(&mut memory);
        assert_eq!(log.before(0).len(), 4);
        assert!(EventLog::new(&mut LogMemory::new()).before(0).is_empty());
    }

    #[test]
    fn sequence_numbers_wrap() {
        let mut memory = LogMemory::default();
        let mut log = EventLog { memory: &mut memory, begin: u32::MAX - 1, next: 0 };
        push(&mut log, 0..4);
        assert_eq!(log.from(0).list.len(), 4);
        assert_eq!(EventLog::new(&mut memory).before(0).len(), 4);
    }
}
