//! The client against a scripted board, over good and bad lines.

use std::sync::{Arc, Mutex};

use darm_core::output::SwitchLimit;
use darm_core::sequencer::Command;
use darm_core::table::Record;
use darm_core::units::{Digest, Micros, ModelHash};
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap;
use darm_core::wire::message::{REQUEST, Refusal};

use super::fake::FakeBoard;
use super::{AnswerError, Client, ClientError, TransportError};
use crate::link::faulty::{Faults, Faulty};
use darm_arm::image::UploadImage;

/// An image of about 8 KiB; the fake board does not look inside.
fn image() -> UploadImage {
    let start = Record::Start {
        model: ModelHash(u64::MAX),
        device: None,
        profile: Digest::default(),
        switch_limit: SwitchLimit::default(),
    };
    let end = Record::End { at: Micros(u64::MAX) };
    UploadImage::table(&[vec![start], vec![end; 700]].concat(), ModelHash(5))
}

#[test]
fn connects_and_asks() {
    let (board, _) = FakeBoard::new();
    let mut client = Client::connect_as(Box::new(board), 1).unwrap();
    assert_eq!(client.identity().board, "fake");
    assert_eq!(client.status().unwrap().rows, 0);
    assert_eq!(client.events(0).unwrap_err().refusal(), Some(Refusal::Unknown));
    assert!(client.clock().offset().unwrap().uncertainty_s < 2e-3);
}

#[test]
fn a_silent_board_is_a_failure_of_transport() {
    let (board, memory) = FakeBoard::new();
    memory.lock().unwrap().mute = true;
    let error = Client::connect_as(Box::new(board), 1).err();
    assert!(matches!(error, Some(ClientError::Transport(TransportError::Silent { attempts: 5.., .. }))), "{error:?}");
}

/// Where a line holds everything back, the board finds the stop before it acts.
#[test]
fn a_command_without_an_answer_is_given_up_after_two_seconds_with_a_stop_behind_it() {
    let (board, memory) = FakeBoard::new();
    let mut client = Client::connect_as(Box::new(board), 1).unwrap();
    memory.lock().unwrap().mute = true;
    let begun_s = client.now_s();
    let error = client.command(Command::Play).err();
    assert!(matches!(error, Some(ClientError::Transport(TransportError::Silent { .. }))), "{error:?}");
    // The last try waits for its answer.
    assert!((2.0..4.0).contains(&(client.now_s() - begun_s)), "{} s", client.now_s() - begun_s);
    let tags: Vec<u8> = memory.lock().unwrap().unheard.iter().map(|header| header.tag).collect();
    let (stop, commands) = tags.split_last().unwrap();
    assert_eq!(*stop, bootstrap::Request::Stop.tag());
    assert!(commands.len() > 1 && commands.iter().all(|tag| *tag == REQUEST), "{tags:?}");
}

#[test]
fn only_damaged_answers_are_a_failure_of_frames() {
    let (board, memory) = FakeBoard::new();
    memory.lock().unwrap().garble = true;
    let error = Client::connect_as(Box::new(board), 1).err();
    assert!(matches!(error, Some(ClientError::Frame(AnswerError::Damaged { count: 5.., .. }))), "{error:?}");
}

#[test]
fn another_version_can_still_be_stopped() {
    let (board, memory) = FakeBoard::new();
    memory.lock().unwrap().protocol = 99;
    let mut client = Client::connect_as(Box::new(board), 1).unwrap();
    assert_eq!(client.status().unwrap_err().refusal(), Some(Refusal::Protocol { board: 99 }));
    client.stop_at_once().unwrap();
}

#[test]
fn a_board_of_another_version_is_refused_with_the_side_to_update() {
    let sentence = |protocol| {
        let (board, memory) = FakeBoard::new();
        memory.lock().unwrap().protocol = protocol;
        Client::connect_as(Box::new(board), 1).unwrap().status().unwrap_err().to_string()
    };
    assert!(sentence(PROTOCOL - 1).ends_with("update the firmware, with `darm flash`"), "{}", sentence(PROTOCOL - 1));
    assert!(sentence(PROTOCOL + 1).ends_with("update this tool, `darm`"));
    assert!(sentence(0).contains("held after crashes"));
}

#[test]
fn text_outside_frames_reaches_the_console() {
    let (board, memory) = FakeBoard::new();
    let mut client = Client::connect_as(Box::new(board), 1).unwrap();
    let heard = Arc::new(Mutex::new(Vec::new()));
    let ear = heard.clone();
    client.set_on_text(move |text| ear.lock().unwrap().extend_from_slice(text));
    memory.lock().unwrap().say("fault: none\r\n");
    client.status().unwrap();
    assert_eq!(*heard.lock().unwrap(), b"fault: none\r\n");
}

#[test]
fn a_newer_host_ends_an_older_ones_connection() {
    let (board, memory) = FakeBoard::new();
    let mut old = Client::connect_as(Box::new(board), 1).unwrap();
    let mut new = Client::connect_as(Box::new(FakeBoard::plug(&memory, None)), 2).unwrap();
    assert_eq!(old.status().unwrap_err().refusal(), Some(Refusal::NotConnected));
    new.status().unwrap();
    old.say_hello().unwrap();
    old.status().unwrap();
}

#[test]
fn a_command_whose_answer_was_lost_in_a_restart_is_not_reported_as_refused() {
    let (board, memory) = FakeBoard::new();
    let mut client = Client::connect_as(Box::new(board), 1).unwrap();
    memory.lock().unwrap().restart_after_command = true;
    let error = client.command(Command::Play).unwrap_err();
    assert_eq!(memory.lock().unwrap().commands, [Command::Play]);
    assert!(matches!(error, ClientError::Transport(_)), "{error:?}");
}

#[test]
fn a_command_that_another_host_kept_from_acting_is_reported_as_refused() {
    let (board, memory) = FakeBoard::new();
    let mut old = Client::connect_as(Box::new(board), 1).unwrap();
    Client::connect_as(Box::new(FakeBoard::plug(&memory, None)), 2).unwrap();
    assert_eq!(old.command(Command::Play).unwrap_err().refusal(), Some(Refusal::NotConnected));
    assert_eq!(memory.lock().unwrap().commands, []);
}

#[test]
fn an_upload_arrives_whole_over_any_line() {
    let image = image();
    for seed in 0..300 {
        let (board, memory) = FakeBoard::new();
        memory.lock().unwrap().keeps_ahead = seed % 2 == 0;
        let line = Faulty::new(board, Faults::all(0.05), seed);
        let mut client = Client::connect_as(Box::new(line), 1 + seed as u32).unwrap();
        let mut done = Vec::new();
        let rows = client.upload(&image, &mut |progress| done.push(progress.done));
        assert!(matches!(rows, Ok(3)), "seed {seed}: {rows:?}");
        assert_eq!(memory.lock().unwrap().committed, [image.bytes().to_vec()], "seed {seed}: once and whole");
        assert!(done.is_sorted() && done.last() == Some(&image.image().len), "seed {seed}");
    }
}

#[test]
fn a_command_runs_exactly_once_over_any_line() {
    for seed in 0..300 {
        let (board, memory) = FakeBoard::new();
        let line = Faulty::new(board, Faults::all(0.08), seed);
        let mut client = Client::connect_as(Box::new(line), 1 + seed as u32).unwrap();
        let wanted: Vec<Command> = (0..5).map(|coil| Command::Coil { coil, on_ms: 10 }).collect();
        wanted.iter().for_each(|&command| client.command(command).unwrap());
        assert_eq!(memory.lock().unwrap().commands, wanted, "seed {seed}");
    }
}

/// More questions than half the range of numbers, from any number on: a board drops what seems older than the last change.
#[test]
fn a_stop_gets_through_after_weeks_of_questions() {
    for start in [1, 0x7fff, 0x8000, 0xffff] {
        let (board, memory) = FakeBoard::new();
        let mut client = Client::connect_as(Box::new(board), start).unwrap();
        client.command(Command::Play).unwrap();
        for questions in [33_000, 40_000, 65_536] {
            (0..questions).for_each(|_| drop(client.status().unwrap()));
            let stopped = client.command(Command::Stop);
            assert!(stopped.is_ok(), "start {start:#x}, {questions} questions: {stopped:?}");
        }
        assert_eq!(memory.lock().unwrap().commands, [Command::Play, Command::Stop, Command::Stop, Command::Stop]);
    }
}

#[test]
fn a_pulled_cable_resumes_where_the_board_says() {
    let image = image();
    let (_, memory) = FakeBoard::new();
    let mut rows = None;
    for plug in 0..50 {
        let board = FakeBoard::plug(&memory, Some(2500));
        let uploaded = Client::connect_as(Box::new(board), 10 + plug).and_then(|mut c| c.upload(&image, &mut |_| {}));
        match uploaded {
            Ok(count) => rows = Some(count),
            Err(error) => assert!(matches!(error, ClientError::Transport(TransportError::Link(_))), "{error}"),
        }
        if rows.is_some() {
            break;
        }
    }
    assert_eq!(rows, Some(3));
    let memory = memory.lock().unwrap();
    assert_eq!(memory.committed, [image.bytes().to_vec()]);
    assert!(memory.resumed_at > image.image().len / 2);
}

#[test]
fn a_board_that_starts_anew_gets_the_table_anew() {
    let image = image();
    let (board, memory) = FakeBoard::new();
    let mut client = Client::connect_as(Box::new(board), 1).unwrap();
    let mut resets = 0;
    let rows = client.upload(&image, &mut |progress| {
        if progress.done > 4000 && resets < 2 {
            resets += 1;
            memory.lock().unwrap().reset();
        }
    });
    assert!(matches!(rows, Ok(3)), "{rows:?}");
    assert_eq!((resets, memory.lock().unwrap().committed.len()), (2, 1));
}
