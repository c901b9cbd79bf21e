//! What a stop ends, and what cannot keep it from acting.

use darm_core::profile::{EmergencyStop, Profile};
use darm_core::sequencer::{Command, CommandError};
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap;
use darm_core::wire::message::{Answer, Calibration, Refusal, Request};
use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;

use super::fakes::{Cells, profile, profile_image, run, table, table_under};
use super::{Bench, LINK, loaded};
use crate::app::serve;
use crate::pipe::{Pipe, PipeReader, PipeWriter};
use crate::port::QUEUE;

const STOPPED: Result<Answer, Refusal> = Err(Refusal::Command(CommandError::Stopped));

/// Serves the console for so long; `each` is called in every millisecond with what has passed, to type and to read as much
/// as a line of 115 200 baud brings. Whether the board restarts meanwhile.
fn serve_for(bench: &Bench, millis: u64, mut each: impl FnMut(u64, &Pipe<2048>, &str)) -> bool {
    let (input, output) = (Pipe::<2048>::new(), Pipe::<QUEUE>::new());
    let mut dispatcher = bench.dispatcher.borrow_mut();
    let (mut reader, mut writer) = (PipeReader(&input), PipeWriter(&output));
    let begun = bench.clock.0.get();
    let passed_ms = || (bench.clock.0.get() - begun) / 1000;
    let over = async {
        while passed_ms() < millis {
            yield_now().await;
        }
    };
    let ended = run(select(serve(dispatcher.as_mut().unwrap(), &mut reader, &mut writer), over), || {
        bench.tick();
        let said: String = core::iter::from_fn(|| output.pop()).take(11).map(char::from).collect();
        each(passed_ms(), &input, &said);
    });
    matches!(ended, Either::First(_))
}

/// The first copy of a command may be lost, and somebody else stop the arm before the second one comes.
#[test]
fn a_command_is_not_taken_on_a_connection_that_is_older_than_a_stop() {
    let bench = loaded();
    bench.shared.stop();
    bench.pass_ms(2);
    assert_eq!(bench.command(Command::Play), STOPPED);
    bench.connect();
    assert_eq!(bench.command(Command::Coil { coil: 0, on_ms: 10 }), STOPPED, "a late copy of the same `Hello`");
    assert_eq!(bench.command(Command::Stop), Ok(Answer::Done));
    let later = LINK + 1;
    assert!(bench.open(later, 1).is_ok());
    assert_eq!(bench.ask_as(later, 2, Request::Command(Command::Play)), Some(Ok(Answer::Done)));
}

#[test]
fn a_late_hello_does_not_open_a_connection_again() {
    let bench = loaded();
    bench.shared.stop();
    bench.pass_ms(2);
    assert!(bench.open(5, 1).is_ok());
    assert!(is_challenged(bench.ask(Request::Hello { protocol: PROTOCOL, challenge: 1 << 32 })));
    assert_eq!(bench.command(Command::Coil { coil: 0, on_ms: 10 }), Err(Refusal::NotConnected));
}

fn is_challenged(answer: Result<Answer, Refusal>) -> bool {
    matches!(answer, Err(Refusal::Challenge { .. }))
}

/// A copy of a `Hello` may wait on the line for any time: behind other connections, stops and starts.
#[test]
fn no_copy_of_a_hello_opens_a_connection_after_another_one_a_stop_or_a_start() {
    let bench = loaded();
    let challenge = |bench: &Bench| match bench.ask_as(1, 1, Request::Hello { protocol: PROTOCOL, challenge: 0 }) {
        Some(Err(Refusal::Challenge { challenge })) => challenge,
        other => panic!("{other:?}"),
    };
    let hello = |challenge| Request::Hello { protocol: PROTOCOL, challenge };
    let assert_late = |bench: &Bench, copies: &[(u32, u64)]| {
        for &(link, challenge) in copies {
            assert!(is_challenged(bench.ask_as(link, 1, hello(challenge)).unwrap()), "{link}");
            let command = Request::Command(Command::Coil { coil: 0, on_ms: 10 });
            assert_eq!(bench.ask_as(link, 2, command), Some(Err(Refusal::NotConnected)));
        }
    };
    let mut copies = vec![];
    for link in 100..130 {
        let challenge = challenge(&bench);
        assert!(matches!(bench.ask_as(link, 1, hello(challenge)), Some(Ok(Answer::Hello(_)))));
        assert_late(&bench, &copies);
        copies.push((link, challenge));
    }
    bench.shared.stop();
    assert!(bench.open(200, 1).is_ok());
    assert_late(&bench, &copies);
    assert_late(&Bench::new(bench.cells), &copies);
}

/// Such a start has the number, and so the challenges, of every other one that could not be counted.
#[test]
fn a_copy_of_a_hello_from_a_start_that_was_not_counted_either_opens_nothing_that_acts() {
    let cells = loaded().cells;
    let uncounted = || {
        cells.refuse_writes(true);
        let bench = Bench::new(cells.clone());
        cells.refuse_writes(false);
        bench
    };
    let hello = |challenge| Request::Hello { protocol: PROTOCOL, challenge };
    let (link, earlier) = (7, uncounted());
    for (number, challenge) in (0..4).zip(0..) {
        let opened = earlier.ask_as(link + number, 1, hello(challenge));
        assert!(matches!(opened, Some(Ok(Answer::Hello(hello))) if hello.boots == 0), "connection {number}");
    }
    let (bench, before) = (uncounted(), cells.copy());
    assert!(bench.ask_as(link, 1, hello(0)).unwrap().is_ok(), "the copy opens: the board answers questions");
    assert!(bench.ask_as(link, 1, Request::Status).unwrap().is_ok());
    let (image, bytes) = table(2, 4, false);
    for (number, request) in (2..).zip([
        Request::Command(Command::Play),
        Request::Command(Command::Coil { coil: 0, on_ms: 10 }),
        Request::Command(Command::Clear),
        Request::Calibrate(Calibration::try_from([0.3; 4]).unwrap()),
        Request::Begin(image),
        Request::Commit(image),
    ]) {
        assert_eq!(bench.ask_as(link, number, request), Some(Err(Refusal::Storage)), "{request:?}");
    }
    let chunk = Request::Chunk { offset: 0, bytes: &bytes[..64] };
    assert_eq!(bench.ask_as(link, 9, chunk), Some(Err(Refusal::NoUpload)));
    bench.pass_ms(100);
    assert_eq!(bench.outputs.get().lines, 0);
    assert!(cells.is_equal(&before), "the flash was written");
    // A person at the button can have a profile written: that is how records that cannot be read are erased.
    bench.button.set(true);
    assert!(bench.ask_as(link, 10, Request::Begin(profile_image(&profile()).0)).unwrap().is_ok());
    assert!(is_challenged(Bench::new(cells).ask_as(link, 1, hello(0)).unwrap()), "a start that was counted");
}

/// Between the question for the challenge and the `Hello` that carries it.
#[test]
fn a_stop_ends_a_challenge() {
    let bench = loaded();
    let ask = |challenge| bench.ask_as(5, 1, Request::Hello { protocol: PROTOCOL, challenge }).unwrap();
    let Err(Refusal::Challenge { challenge }) = ask(0) else { panic!("a challenge") };
    bench.shared.stop();
    assert!(is_challenged(ask(challenge)));
}

#[test]
fn a_connection_that_is_older_than_a_stop_does_not_calibrate() {
    let bench = loaded();
    bench.shared.stop();
    bench.pass_ms(2);
    assert_eq!(bench.ask(Request::Calibrate(Calibration::try_from([0.3; 4]).unwrap())), STOPPED);
}

#[test]
fn a_command_after_many_questions_is_not_taken_for_an_old_one() {
    let bench = loaded();
    assert_eq!(bench.ask_as(LINK, 1000, Request::Command(Command::Play)), Some(Ok(Answer::Done)));
    for number in 1001..=1000 + 33_000 {
        assert!(bench.ask_as(LINK, number, Request::Status).is_some());
    }
    bench.pass_ms(60_000);
    assert_eq!(bench.ask_as(LINK, 1000 + 33_001, Request::Command(Command::Stop)), Some(Ok(Answer::Done)));
}

/// A client counts changes and questions apart.
#[test]
fn a_late_copy_behind_many_questions_does_not_run_again() {
    let bench = loaded();
    let coil = Request::Command(Command::Coil { coil: 0, on_ms: 20 });
    assert_eq!(bench.ask_as(LINK, 1000, coil), Some(Ok(Answer::Done)));
    bench.pass_ms(100);
    assert!(bench.ask_as(LINK, 17_601, Request::Status).unwrap().is_ok());
    assert_eq!(bench.ask_as(LINK, 1000, coil), Some(Ok(Answer::Done)), "the answer is kept");
    bench.pass_ms(5);
    assert_eq!(bench.outputs.get().lines, 0, "the coil went on again");
}

/// Somebody opens a frame and never closes it.
#[test]
fn an_open_frame_does_not_swallow_a_typed_stop() {
    let bench = loaded();
    bench.command(Command::Play).unwrap();
    bench.pass_ms(150);
    serve_for(&bench, 700, |ms, input, _| {
        input.push_slice(match (ms, ms % 50, ms % 100) {
            (1, ..) => b"\0x",
            (_, 0, _) => b"x",
            (.., 30) => b"stop\r",
            _ => b"",
        });
    });
    assert_eq!(bench.shared.stops(), 7);
    assert_eq!(bench.outputs.get().lines, 0);
}

/// When the board answered `ok` to what is typed at these times, all in ms.
fn answered_ms(bench: &Bench, typed: &[(u64, &str)], millis: u64) -> Vec<u64> {
    let (mut answered, mut line) = (vec![], String::new());
    serve_for(bench, millis, |ms, input, said| {
        for (_, text) in typed.iter().filter(|(at_ms, _)| *at_ms == ms) {
            input.push_slice(text.as_bytes());
        }
        for character in said.chars() {
            line.push(character);
            if character == '\n' && core::mem::take(&mut line) == "ok\r\n" {
                answered.push(ms);
            }
        }
    });
    answered
}

#[test]
fn a_typed_stop_is_answered_at_once_while_the_console_prints() {
    for busy in ["log", "limits", "help"] {
        let bench = loaded();
        bench.command(Command::Play).unwrap();
        bench.pass_ms(150);
        let answered = answered_ms(&bench, &[(1, &format!("{busy}\rstop\r"))], 2000);
        assert!(answered.first().is_some_and(|ms| *ms <= 20), "{busy}: stop answered after {answered:?} ms");
    }
}

#[test]
fn a_second_stop_is_answered_at_once() {
    let answered = answered_ms(&loaded(), &[(1, "limits\r"), (4, "stop\r"), (8, "stop\r")], 200);
    assert!(answered.get(1).is_some_and(|ms| *ms <= 28), "typed at 4 and 8 ms, answered at {answered:?}");
}

/// The answer to `reboot`, and what is printed before it, take their time on the line.
#[test]
fn a_stop_drops_a_restart_whose_answer_is_on_its_way() {
    for before in ["", "id\r", "id\rid\r"] {
        for behind_ms in 1..12 {
            let (mut all, mut has_left) = (String::new(), true);
            let restarts = serve_for(&loaded(), 300, |ms, input, said| {
                all += said;
                match ms {
                    1 => _ = input.push_slice(format!("{before}reboot\r").as_bytes()),
                    _ if ms == 1 + behind_ms => {
                        has_left = all.ends_with("restarting\r\n");
                        _ = input.push_slice(b"stop\r");
                    }
                    _ => {}
                }
            });
            assert!(!restarts || has_left, "{before:?}, {behind_ms} ms behind: {all:?}");
            assert!(restarts || all.ends_with("ok\r\n"), "{before:?}, {behind_ms} ms behind: {all:?}");
        }
    }
}

#[test]
fn a_stop_drops_a_restart_unless_a_new_profile_waits_for_it() {
    let bench = loaded();
    let restart_due = || bench.dispatcher.borrow_mut().as_mut().unwrap().restart_due(true);
    assert_eq!(bench.type_line("reboot"), "ok, restarting\r\n");
    assert_eq!(restart_due(), None);
    bench.button.set(true);
    assert_eq!(bench.upload(&profile_image(&profile())), Ok(Answer::Done));
    assert_eq!(restart_due(), Some(bootstrap::RebootTarget::Application));
}

/// docs/safety.md: "a stop switches all outputs off within 5 ms after its last byte, …, whatever the console does". The messages
/// have a stop of their own (docs/wire.md, command 1), which `darm record` and `darm bringup` send.
#[test]
fn a_stop_of_the_messages_acts_at_once_while_the_console_prints() {
    use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
    let (mut payload, mut encoded) = ([0; MAX_PAYLOAD], [0; MAX_FRAME]);
    let used = postcard::to_slice(&Request::Command(Command::Stop), &mut payload).unwrap();
    let header = Header { tag: darm_core::wire::message::REQUEST, link: LINK, number: 2000 };
    let len = frame::encode(header, used, &mut encoded).unwrap();
    let mut late = Vec::new();
    for busy in ["id", "help", "limits", "log"] {
        let bench = loaded();
        bench.command(Command::Coil { coil: 0, on_ms: 4_000 }).unwrap();
        bench.pass_ms(20);
        assert_eq!(bench.outputs.get().lines, 1);
        let mut off_ms = None;
        serve_for(&bench, 3_000, |ms, input, _| {
            if ms == 1 {
                input.push_slice(format!("{busy}\r").as_bytes());
                input.push_slice(&encoded[..len]);
            }
            if bench.outputs.get().lines == 0 {
                off_ms.get_or_insert(ms);
            }
        });
        late.extend(off_ms.filter(|ms| *ms > 7).map(|ms| (busy, ms)));
    }
    assert!(late.is_empty(), "the coil went off after so many ms: {late:?}");
}

/// docs/wire.md: "After a stop the board takes no command on a connection that was opened before it".
#[test]
fn a_stop_of_the_messages_ends_the_connection_as_every_other_stop() {
    let bench = loaded();
    assert_eq!(bench.ask_as(LINK, 1000, Request::Command(Command::Stop)), Some(Ok(Answer::Done)));
    let coil = Request::Command(Command::Coil { coil: 0, on_ms: 20 });
    assert_eq!(bench.ask_as(LINK, 1001, coil), Some(STOPPED));
}

/// What waits behind the port of a board leaves at 11.5 bytes a millisecond.
#[test]
fn a_typed_stop_is_answered_within_20_ms_behind_what_waits() {
    let mut late = Vec::new();
    for (busy, typed_ms) in [("help", 1), ("help", 2), ("limits", 20), ("log", 20), ("profile", 20)] {
        let bench = loaded();
        bench.command(Command::Play).unwrap();
        bench.pass_ms(150);
        let (mut all, mut answered) = (String::new(), None);
        serve_for(&bench, 300, |ms, input, said| {
            all.push_str(said);
            if ms == 1 {
                input.push_slice(format!("{busy}\r").as_bytes());
            }
            if ms == typed_ms + 1 {
                input.push_slice(b"stop\r");
            }
            if all.ends_with("ok\r\n") {
                answered.get_or_insert(ms - typed_ms - 1);
            }
        });
        late.push((busy, typed_ms, answered));
    }
    assert!(late.iter().all(|(.., ms)| ms.is_some_and(|ms| ms <= 20)), "answered after ms: {late:?}");
}

/// What a program requested before it may wait on the line until the button is released.
#[test]
fn the_emergency_stop_ends_every_connection() {
    use super::fakes::{Cells, table_under};
    use darm_core::profile::{EmergencyStop, Profile};
    let stops = Profile { emergency_stop: Some(EmergencyStop { input: 12, opens: false }), ..profile() };
    let stops = Profile { digest: profile_image(&stops).0.digest, ..stops };
    let bench = Bench::new(Cells::under(&stops));
    bench.connect();
    assert_eq!(bench.upload(&table_under(&stops, 1, 4, false, &[])), Ok(Answer::Committed { rows: 4 }));
    bench.command(Command::Coil { coil: 0, on_ms: 400 }).unwrap();
    bench.pass_ms(20);
    assert_eq!(bench.outputs.get().lines, 1);
    bench.stuck.set(Some(1 << 12 | 1));
    bench.pass_ms(20);
    assert_eq!(bench.outputs.get().lines, 0);
    bench.stuck.set(None);
    bench.pass_ms(20);
    let late = [Command::Clear, Command::Coil { coil: 0, on_ms: 400 }].map(|command| bench.command(command));
    bench.pass_ms(5);
    assert_eq!((bench.outputs.get().lines, &late[1]), (0, &STOPPED), "Clear: {:?}", late[0]);
}

/// Forty texts of 84 ms each are on their way when the emergency stop is pressed, or are asked for while it is; behind them wait a `clear`
/// and a command.
#[test]
fn what_waits_on_the_line_while_the_emergency_stop_is_pressed_does_not_act_after_its_release() {
    let stops = Profile { emergency_stop: Some(EmergencyStop { input: 12, opens: false }), ..profile() };
    let stops = Profile { digest: profile_image(&stops).0.digest, ..stops };
    let pressed = 300..1_300;
    for (pressed, texts_ms, command_ms, acts) in [
        (pressed.clone(), 1, 2, false),
        (pressed.clone(), 400, 401, false),
        (pressed, 1, 1_400, true),
        (0..0, 1, 2, true),
    ] {
        let bench = Bench::new(Cells::under(&stops));
        bench.connect();
        assert_eq!(bench.upload(&table_under(&stops, 1, 4, false, &[])), Ok(Answer::Committed { rows: 4 }));
        let mut lit = None;
        serve_for(&bench, 6_000, |ms, input, _| {
            if ms == texts_ms {
                input.push_slice(&b"help\r".repeat(40));
            }
            if ms == command_ms {
                input.push_slice(b"clear\rcoil 0 on 400\r");
            }
            bench.stuck.set(pressed.contains(&ms).then_some(1 << 12));
            if bench.outputs.get().lines != 0 {
                lit.get_or_insert(ms);
            }
        });
        assert_eq!(lit.is_some(), acts, "{pressed:?} {texts_ms} {command_ms}: {lit:?}");
        // Typed after the release it acts at once: the texts are gone.
        assert!(pressed.is_empty() || lit.is_none_or(|ms| ms < command_ms + 200), "{lit:?}");
    }
}

/// More is typed than the board keeps while it prints: the line that lost its end does not go on with the next one.
#[test]
fn bytes_that_are_lost_join_no_two_lines() {
    for pad in 0..29 {
        let bench = loaded();
        let mut lit = false;
        serve_for(&bench, 3_200, |ms, input, _| {
            if ms == 1 {
                input.push_slice(b"help\r");
            }
            if ms == 5 {
                let lines = b"coil 0 off\rcoil 1 on 4\rid 100\r".repeat(48);
                input.push_slice(&[&b"?".repeat(pad), b"\r".as_slice(), &lines].concat());
            }
            if ms == 3_000 {
                input.push_slice(b"000\r");
            }
            lit |= ms >= 3_000 && bench.outputs.get().lines & 2 != 0;
        });
        assert!(!lit, "{pad} bytes before: nobody typed `coil 1 on 4000`");
    }
}
