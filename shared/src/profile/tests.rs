//! Profiles and their records: order, soundness, what is refused.

use super::*;
extern crate std;
use std::vec::Vec;

/// Two valves, one with a switch, and a servo.
fn profile() -> Profile {
    let mut profile = Profile::empty();
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };
    profile.outputs[0] = Some(Output { drive: Drive::Hold { line: 0 }, limit, input: Some(3) });
    profile.outputs[7] = Some(Output { drive: Drive::Hold { line: 9 }, limit, input: None });
    let limit =
        ServoWiring { id: 1, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s: 1.0, max_torque: 0.5, timeout_ms: 100 };
    profile.servos.push(Servo { limit, fallback: Fallback::Release }).expect("one fits");
    profile.emergency_stop = Some(EmergencyStop { input: 12, opens: true });
    profile.board = BoardWiring { chips: Some(2), layout: Some(PICO.layout()) };
    profile.sync = true;
    profile.min_supply_mv = Some(4_500);
    profile
}

fn read(records: &[ProfileRecord]) -> Result<Profile, ProfileError> {
    let (mut reader, mut profile) = (ProfileReader::default(), Profile::empty());
    records.iter().try_for_each(|record| reader.push(record, &mut profile))?;
    if reader.is_complete() { Ok(profile) } else { Err(ProfileError::Order) }
}

#[test]
fn a_profile_and_its_records_are_inverse() {
    let records: Vec<_> = profile().records().collect();
    assert_eq!(read(&records), Ok(profile()));
    assert_eq!(records.len(), 8);
    let mut bytes = [0; 64];
    assert!(records.iter().all(|record| postcard::to_slice(record, &mut bytes).is_ok()));
}

#[test]
fn records_out_of_order_and_incomplete_profiles_are_refused() {
    let records: Vec<_> = profile().records().collect();
    for missing in 0..records.len() {
        let mut some = records.clone();
        some.remove(missing);
        let required = [
            ProfileRecord::Start { supply: profile().supply, emergency_stop: profile().emergency_stop },
            ProfileRecord::End,
        ];
        assert_eq!(read(&some).is_ok(), !required.contains(&records[missing]), "without record {missing}");
    }
    for first in [1, 2, 3, 4] {
        let mut swapped = records.clone();
        swapped.swap(first, first + 1);
        assert_eq!(read(&swapped), Err(ProfileError::Order));
    }
    let mut twice = records.clone();
    twice.insert(1, records[1]);
    assert_eq!(read(&twice), Err(ProfileError::Order));
}

#[test]
fn the_profile_that_is_built_in_is_sound_and_cautious() {
    assert_eq!(BUILT_IN.check(), Ok(()));
    let most = BUILT_IN.outputs.iter().flatten().map(|output| output.limit.max_on_ms).max();
    assert_eq!((most, BUILT_IN.servos.len()), (Some(1_000), 0));
}

#[test]
fn what_the_board_cannot_run_safely_is_refused() {
    let broken = |change: fn(&mut Profile)| {
        let mut profile = profile();
        change(&mut profile);
        profile.check().is_err()
    };
    assert!(!broken(|_| {}));
    assert!(broken(|profile| profile.outputs[8] = profile.outputs[7]), "a line is used twice");
    assert!(broken(|profile| profile.emergency_stop = Some(EmergencyStop { input: 3, opens: true })));
    assert!(broken(|profile| profile.supply.new_coils = 0));
    assert!(broken(|profile| profile.servos[0].limit.id = 254));
    assert!(broken(|profile| profile.servos[0].limit.max_speed_rad_s = f32::NAN));
    assert!(broken(|profile| {
        let servo = profile.servos[0];
        let _ = profile.servos.push(servo);
    }));
    assert!(broken(|profile| {
        if let Some(output) = &mut profile.outputs[0] {
            output.limit.window_ms = u32::MAX;
        }
    }));
}

#[test]
fn a_broken_wire_to_the_emergency_stop_stops_too() {
    let stop = EmergencyStop { input: 12, opens: true };
    assert!(stop.is_pressed(0) && !stop.is_pressed(1 << 12));
}

#[test]
fn the_record_of_the_board_has_golden_bytes_and_a_profile_without_it_has_the_former_ones() {
    let mut bytes = [0; 16];
    let record = ProfileRecord::Board(BoardWiring { chips: Some(2), layout: Some(300) });
    assert_eq!(postcard::to_slice(&record, &mut bytes).unwrap(), [4, 1, 2, 1, 0xac, 2]);
    assert_eq!(postcard::from_bytes::<ProfileRecord>(&[4, 1, 2, 1, 0xac, 2]), Ok(record));
    assert_eq!(postcard::to_slice(&ProfileRecord::Sync, &mut bytes).unwrap(), [5]);
    let threshold = ProfileRecord::MinSupply { mv: 4_500 };
    assert_eq!(postcard::to_slice(&threshold, &mut bytes).unwrap(), [6, 0x94, 0x23]);
    assert_eq!(postcard::from_bytes::<ProfileRecord>(&[6, 0x94, 0x23]), Ok(threshold));
    let former = Profile { board: BoardWiring::ANY, sync: false, min_supply_mv: None, ..profile() };
    let bytes: Vec<u8> =
        former.records().flat_map(|record| postcard::to_slice(&record, &mut [0; 64]).unwrap().to_vec()).collect();
    assert_eq!((bytes[0], bytes.last()), (0, Some(&3)));
    let is_new =
        |record| matches!(record, ProfileRecord::Board(_) | ProfileRecord::Sync | ProfileRecord::MinSupply { .. });
    assert!(!former.records().any(is_new));
}

#[test]
fn a_chain_has_one_to_eight_chips_and_no_line_beyond_its_end() {
    let with = |chips| Profile { board: BoardWiring { chips: Some(chips), layout: None }, ..profile() }.check();
    assert_eq!(with(0), Err(ProfileError::ChainLength { chips: 0 }));
    assert_eq!(with(1), Err(ProfileError::ChainLine { line: 9, chips: 1 }));
    assert_eq!((with(2), with(8)), (Ok(()), Ok(())));
    assert_eq!(with(9), Err(ProfileError::ChainLength { chips: 9 }));
}

#[test]
fn a_threshold_of_the_supply_that_no_board_measures_is_refused() {
    let with = |mv| Profile { min_supply_mv: Some(mv), ..profile() }.check();
    assert_eq!((with(1_620), with(5_500)), (Ok(()), Ok(())));
    for mv in [0, 1_619, 5_501] {
        assert_eq!(with(mv), Err(ProfileError::MinSupply { mv }));
    }
}
