//! Guests at a port with a scripted board behind it.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use darm_arm::image::UploadImage;
use darm_core::sequencer::{Command, CommandError};
use darm_core::units::ModelHash;
use darm_core::wire::message::Refusal;

use super::{Guest, Rights, attach, is_shared};
use crate::client::fake::{FakeBoard, Memory, until};
use crate::client::stop::{Confirmation, STOP_BOUND, StopHandle, hold};
use crate::client::{Client, ClientError, TransportError};
use crate::link::LinkError;

/// Rights that a test sets, and what was heard of guests.
#[derive(Default)]
struct TestRights {
    /// Who has control, where it is not the guest.
    denied: Mutex<Option<String>>,
    here: Mutex<Vec<String>>,
}

impl Rights for TestRights {
    fn arrive(&self, guest: &Guest) {
        self.here.lock().unwrap().push(guest.name.clone());
    }

    fn stay(&self, _: &Guest) {}

    fn take_control(&self, _: &Guest) -> Result<(), String> {
        self.denied.lock().unwrap().clone().map_or(Ok(()), Err)
    }

    fn leave(&self, guest: &Guest) {
        self.here.lock().unwrap().retain(|name| *name != guest.name);
    }
}

/// A process that has a port.
struct Holder {
    client: Client,
    handle: StopHandle,
    board: Arc<Mutex<Memory>>,
    rights: Arc<TestRights>,
    socket: PathBuf,
    _folder: tempfile::TempDir,
}

impl Holder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("port");
        let (link, board) = FakeBoard::new();
        let (link, handle) = hold(Box::new(link), Some(&socket));
        assert!(
            !is_shared(&socket) && attach("fake", &socket, "early").unwrap().is_none(),
            "not before the client shares it"
        );
        let client = Client::connect_as(link, 1).unwrap();
        let rights = Arc::new(TestRights::default());
        client.share(&handle, Arc::clone(&rights) as _);
        assert!(is_shared(&socket));
        Self { client, handle, board, rights, socket, _folder: folder }
    }

    fn guest(&self, name: &str) -> (Client, StopHandle) {
        let (link, handle) = attach("fake", &self.socket, name).unwrap().unwrap();
        (Client::connect(link).unwrap(), handle)
    }

    fn commands(&self) -> usize {
        self.board.lock().unwrap().commands.len()
    }
}

fn is_not_connected(result: &Result<(), ClientError>) -> bool {
    matches!(result, Err(ClientError::Refused(Refusal::NotConnected | Refusal::Command(CommandError::Stopped))))
}

#[test]
fn guests_read_what_the_holder_reads_without_taking_its_connection() {
    let mut holder = Holder::new();
    let (mut first, _) = holder.guest("`darm status`");
    let (mut second, _) = holder.guest("`darm console`");
    assert_eq!((first.port(), &*first.identity().board), ("fake", "fake"));
    for _ in 0..20 {
        for client in [&mut first, &mut holder.client, &mut second] {
            assert_eq!(client.status().unwrap().rows, 0);
        }
    }
    assert!(first.clock().offset().is_some());
    assert_eq!(*holder.rights.here.lock().unwrap(), ["`darm status`", "`darm console`"]);
    drop(first);
    until(|| *holder.rights.here.lock().unwrap() == ["`darm console`"]);
}

#[test]
fn a_guest_changes_something_only_with_control() {
    let holder = Holder::new();
    let (mut guest, _) = holder.guest("guest");
    *holder.rights.denied.lock().unwrap() = Some("page 3 controls the arm".to_owned());
    let refused = guest.command(Command::Play).unwrap_err();
    assert!(matches!(refused, ClientError::Denied(_)), "{refused:?}");
    assert_eq!(refused.to_string(), "nothing was sent: page 3 controls the arm");
    let image = UploadImage::table(&[], ModelHash(5));
    assert!(matches!(guest.upload(&image, &mut |_| {}), Err(ClientError::Denied(_))));
    guest.status().unwrap();
    // Nor is the arm of the one who has control stopped.
    assert_eq!((holder.commands(), holder.board.lock().unwrap().stops), (0, 0));
    *holder.rights.denied.lock().unwrap() = None;
    guest.command(Command::Play).unwrap();
    assert_eq!(holder.commands(), 1);
}

/// A stop ends the connection, and the holder opens another one: a guest that does not know of the stop must not act on it.
#[test]
fn a_guest_acts_on_no_connection_that_it_does_not_know_of() {
    let mut holder = Holder::new();
    let (mut guest, _) = holder.guest("guest");
    guest.command(Command::Play).unwrap();
    holder.client.say_hello().unwrap();
    assert!(is_not_connected(&guest.command(Command::Play)) && is_not_connected(&guest.renew_hello()));
    assert!(is_not_connected(&guest.command(Command::Play)), "the question has opened nothing");
    guest.say_hello().unwrap();
    guest.command(Command::Play).unwrap();
    assert_eq!(holder.commands(), 2);
}

/// Whoever connects first after a stop opens the connection, and the others change nothing on it before they know of it.
#[test]
fn after_a_stop_the_first_opens_a_connection_and_the_others_join_it() {
    let mut holder = Holder::new();
    let (mut guest, _) = holder.guest("guest");
    let (mut other, _) = holder.guest("other");
    holder.handle.stop(STOP_BOUND).unwrap();
    holder.board.lock().unwrap().end_connection();
    for client in [&mut guest, &mut other, &mut holder.client] {
        assert!(is_not_connected(&client.command(Command::Play)));
    }
    guest.say_hello().unwrap();
    guest.command(Command::Play).unwrap();
    assert!(!holder.client.knows_connection());
    for client in [&mut other, &mut holder.client] {
        assert!(is_not_connected(&client.command(Command::Play)));
    }
    holder.client.join().unwrap();
    other.say_hello().unwrap();
    for client in [&mut guest, &mut other, &mut holder.client] {
        client.command(Command::Play).unwrap();
    }
    assert_eq!(holder.commands(), 4);
}

#[test]
fn a_guest_plays_no_table_that_it_does_not_know_of() {
    let mut holder = Holder::new();
    let (mut guest, _) = holder.guest("guest");
    let image = UploadImage::table(&[], ModelHash(5));
    holder.client.upload(&image, &mut |_| {}).unwrap();
    assert!(is_not_connected(&guest.command(Command::Play)));
    guest.renew_hello().unwrap();
    guest.upload(&image, &mut |_| {}).unwrap();
    guest.command(Command::Play).unwrap();
    let (mut other, _) = holder.guest("other");
    guest.upload(&image, &mut |_| {}).unwrap();
    assert!(is_not_connected(&other.command(Command::Play)));
}

#[test]
fn a_stop_of_a_guest_needs_no_control_and_waits_for_nothing() {
    let holder = Holder::new();
    *holder.rights.denied.lock().unwrap() = Some("nobody may".to_owned());
    let (mut guest, handle) = holder.guest("guest");
    assert_eq!(guest.stop().unwrap(), Confirmation::Confirmed);
    guest.command(Command::Stop).unwrap();
    // The line is in use: a long upload.
    let line = Arc::clone(&holder.client.line);
    let taken = line.take();
    let began = Instant::now();
    assert_eq!(handle.stop(STOP_BOUND).unwrap(), Confirmation::Confirmed);
    assert_eq!(guest.stop().unwrap(), Confirmation::Confirmed);
    assert!(began.elapsed() < Duration::from_secs(2));
    drop(taken);
}

/// What a guest wanted before it has stopped the arm, or before it went, is not sent afterwards.
#[test]
fn what_waits_for_the_line_is_dropped_by_a_stop_and_when_the_guest_goes() {
    let holder = Holder::new();
    for goes in [false, true] {
        let (mut guest, handle) = holder.guest("guest");
        let line = Arc::clone(&holder.client.line);
        let taken = line.take();
        let waiting = std::thread::spawn(move || guest.command(Command::Play));
        // The request is on its way to the line, which is given up after 2 s with a stop.
        std::thread::sleep(Duration::from_millis(300));
        if !goes {
            handle.stop(STOP_BOUND).unwrap();
        }
        let stops = holder.board.lock().unwrap().stops;
        let waited = waiting.join().unwrap();
        assert!(waited.is_err(), "{waited:?}");
        // The stop behind it has come; without it the line would let the request through before.
        until(|| holder.board.lock().unwrap().stops > stops);
        drop(taken);
        until(|| holder.rights.here.lock().unwrap().is_empty());
    }
    assert_eq!(holder.commands(), 0);
    assert_eq!(holder.handle.stop(STOP_BOUND).unwrap(), Confirmation::Confirmed);
}

#[test]
fn typed_lines_read_without_control_and_change_with_it() {
    let mut holder = Holder::new();
    let (mut guest, _) = holder.guest("guest");
    let heard: Arc<Mutex<Vec<u8>>> = Arc::default();
    let to = Arc::clone(&heard);
    guest.set_on_text(move |text| to.lock().unwrap().extend(text));
    let text = || String::from_utf8(heard.lock().unwrap().clone()).unwrap();
    *holder.rights.denied.lock().unwrap() = Some("page 3 controls the arm".to_owned());
    for (line, answer) in [
        ("coil 1 on 200", "? page 3 controls the arm"),
        ("Word 0110", "? page 3 controls the arm"),
        ("wrd 0110", "? page 3 controls the arm"),
        ("help \x08\x08\x08\x08\x08coil 1 on", "? a line has at most 200 letters, digits and signs, and nothing else"),
        ("stop", "ok\r\n"),
    ] {
        heard.lock().unwrap().clear();
        guest.type_line(line).unwrap();
        let since = Instant::now();
        while !text().contains(answer) && since.elapsed() < Duration::from_secs(30) {
            guest.listen(0.01).unwrap();
        }
        assert!(text().contains(answer), "{line}: {}", text());
    }
    assert_eq!(holder.board.lock().unwrap().typed, b"");
    guest.type_line("status").unwrap();
    until(|| holder.board.lock().unwrap().typed == b"status\r");
    // What the board says is heard by everybody.
    holder.board.lock().unwrap().say("idle\r\n");
    holder.client.listen(0.1).unwrap();
    let since = Instant::now();
    while !text().contains("idle") && since.elapsed() < Duration::from_secs(30) {
        guest.listen(0.01).unwrap();
    }
    assert!(text().contains("idle"), "{}", text());
}

#[test]
fn a_guest_sees_the_end_of_the_holder_as_the_end_of_the_port() {
    let holder = Holder::new();
    let (mut guest, handle) = holder.guest("guest");
    let Holder { client, socket, _folder, .. } = holder;
    drop(client);
    let error = guest.status().unwrap_err();
    assert!(matches!(error, ClientError::Transport(TransportError::Link(LinkError::Closed { .. }))), "{error:?}");
    assert!(handle.stop(STOP_BOUND).is_err() && attach("fake", &socket, "late").unwrap().is_none());
}

/// Stops, guests and ports that come and go at the same time.
mod at_once {
    use std::io::{Read as _, Write as _};
    use std::os::unix::net::UnixStream;
    use std::sync::{Arc, Mutex};
    use std::time::{Duration, Instant};

    use darm_arm::image::UploadImage;
    use darm_core::sequencer::Command;
    use darm_core::units::ModelHash;
    use darm_core::wire::bootstrap::{RebootTarget, Request as Bootstrap};
    use darm_core::wire::frame::{Header, encode};
    use darm_core::wire::message::{REQUEST, Request};

    use super::{Holder, attach};
    use crate::client::Client;
    use crate::client::exchange::Exchange;
    use crate::client::fake::{FakeBoard, until};
    use crate::client::question;
    use crate::client::sharing::MAX_GUESTS;
    use crate::client::stop::{Confirmation, STOP_BOUND, hold, is_in_use, stop_at};
    use crate::link::{Link, LinkError};

    const SOON: Duration = Duration::from_millis(300);

    /// A board behind a line on which each read takes real time.
    struct Slow(FakeBoard, Duration);

    impl Link for Slow {
        fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
            self.0.send(bytes)
        }
        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
            std::thread::sleep(self.1);
            self.0.receive(buffer, timeout)
        }
        fn now_s(&self) -> f64 {
            self.0.now_s()
        }
        fn name(&self) -> &str {
            self.0.name()
        }
    }

    /// A guest that sends frames and lines as it likes.
    fn raw_guest(holder: &Holder) -> Exchange {
        let (link, _) = attach("fake", &holder.socket, "raw").unwrap().unwrap();
        let mut raw = Exchange::new(link, 77);
        raw.ask(&question::hello(0).request).unwrap();
        raw
    }

    /// What counts is when the line arrived, not when its turn comes.
    #[test]
    fn a_typed_line_that_waits_behind_another_does_not_pass_a_stop() {
        let holder = Holder::new();
        let (mut guest, _) = holder.guest("guest");
        let line = Arc::clone(&holder.client.line);
        let taken = line.take();
        guest.type_line("status").unwrap();
        guest.type_line("coil 1 on 400").unwrap();
        std::thread::sleep(SOON);
        // A page, `darm stop` or another guest.
        holder.handle.stop(STOP_BOUND).unwrap();
        drop(taken);
        until(|| holder.board.lock().unwrap().typed.starts_with(b"status\r"));
        std::thread::sleep(SOON);
        let typed = String::from_utf8(holder.board.lock().unwrap().typed.clone()).unwrap();
        assert_eq!(typed, "status\r", "switched on after the stop");
    }

    /// The holder's own console waits for guests.
    #[test]
    fn a_line_typed_at_the_holder_does_not_pass_a_stop() {
        let Holder { mut client, handle, board, rights: _rights, socket: _socket, _folder } = Holder::new();
        let line = Arc::clone(&client.line);
        // A guest's exchange: up to 2 s for its command, 8 s for its question, 30 s for its table.
        let taken = line.take();
        let (stops, counted) = (handle.stops(), handle.clone());
        let typing = std::thread::spawn(move || client.type_change("coil 1 on 400", || counted.stops() != stops));
        std::thread::sleep(SOON);
        handle.stop(STOP_BOUND).unwrap();
        drop(taken);
        let _ = typing.join().unwrap();
        assert_eq!(board.lock().unwrap().typed, b"", "switched on after the stop");
    }

    /// A reboot belongs to no connection: the board cannot refuse it.
    #[test]
    fn a_reboot_that_waits_for_the_line_does_not_pass_a_stop() {
        let holder = Holder::new();
        let (mut guest, _) = holder.guest("guest");
        let line = Arc::clone(&holder.client.line);
        let taken = line.take();
        let waiting = std::thread::spawn(move || guest.reboot(RebootTarget::Application));
        std::thread::sleep(SOON);
        holder.handle.stop(STOP_BOUND).unwrap();
        drop(taken);
        let rebooted = waiting.join().unwrap();
        assert!(rebooted.is_err(), "the board was rebooted after the stop");
    }

    /// Control may go while a guest waits for the line.
    #[test]
    fn control_that_is_lost_while_a_request_waits_for_the_line_is_lost() {
        let holder = Holder::new();
        let (mut guest, _) = holder.guest("guest");
        let line = Arc::clone(&holder.client.line);
        let taken = line.take();
        let waiting = std::thread::spawn(move || guest.command(Command::Play));
        std::thread::sleep(SOON);
        *holder.rights.denied.lock().unwrap() = Some("page 3 controls the arm".to_owned());
        drop(taken);
        let _ = waiting.join().unwrap();
        assert_eq!(holder.commands(), 0, "a guest without control has moved the arm");
    }

    /// The age of a command is known to the guest alone; one that is suspended (or is no `darm`) sends no stop behind it.
    #[test]
    fn a_command_that_has_waited_too_long_for_the_line_is_not_sent() {
        let holder = Holder::new();
        let mut raw = raw_guest(&holder);
        let line = Arc::clone(&holder.client.line);
        let taken = line.take();
        let (_, frame) = raw.prepare(&Request::Command(Command::Play)).unwrap();
        raw.send(&frame, false).unwrap();
        // SIGSTOP, or Ctrl-Z.
        std::thread::sleep(Duration::from_millis(3000));
        drop(taken);
        std::thread::sleep(SOON);
        assert_eq!(holder.commands(), 0, "the arm moves 3 s after it was ordered to");
    }

    /// What follows an upload would act if it opened the connection again after a stop.
    #[test]
    fn a_stop_during_an_upload_keeps_what_follows_it_from_acting() {
        let holder = Holder::new();
        let (mut guest, _) = holder.guest("`darm calibrate`");
        let image = UploadImage::table(&[], ModelHash(5));
        let (handle, board) = (holder.handle.clone(), Arc::clone(&holder.board));
        let mut stopped = false;
        let uploaded = guest.upload(&image, &mut |_| {
            if !std::mem::replace(&mut stopped, true) {
                handle.stop(STOP_BOUND).unwrap();
                board.lock().unwrap().end_connection();
            }
        });
        assert!(stopped);
        let played = uploaded.and_then(|_| guest.command(Command::Play));
        assert!(played.is_err() && holder.commands() == 0, "the arm plays after the stop");
    }

    /// The board finds a stop at the end of any line, after corrections, and behind noise.
    #[test]
    fn a_typed_stop_is_heard_behind_anything() {
        for line in ["plystop", "sti\x08op", "stopp\x08", "\u{1}stop"] {
            let holder = Holder::new();
            *holder.rights.denied.lock().unwrap() = Some("page 3 controls the arm".to_owned());
            let (mut guest, _) = holder.guest("guest");
            guest.type_line(line).unwrap();
            let since = Instant::now();
            while holder.board.lock().unwrap().stops == 0 && since.elapsed() < Duration::from_secs(1) {
                std::thread::sleep(Duration::from_millis(5));
            }
            assert_eq!(holder.board.lock().unwrap().stops, 1, "{line:?} stops a board, and not through the holder");
        }
    }

    /// As the board would hear it: neither an open frame nor a line that is too long keeps a stop from being one.
    #[test]
    fn a_stop_in_any_form_is_found_behind_anything_and_sent_once() {
        let framed = |tag| {
            let mut frame = [0; 64];
            let payload: &[u8] = if tag == REQUEST { &[6, 1] } else { &[] };
            let len = encode(Header { tag, link: 0, number: 9 }, payload, &mut frame).unwrap();
            frame[..len].to_vec()
        };
        let lines = [
            b"garbage\0\x05 stop\r".to_vec(),
            [&[b'x'; 250][..], b"stop\r"].concat(),
            [b"\0\x05", &framed(Bootstrap::Stop.tag())[..]].concat(),
            [b"text", &framed(REQUEST)[..]].concat(),
            b"stop now\r\n".to_vec(),
            b"stop\r\n".to_vec(),
        ];
        for line in lines {
            let holder = Holder::new();
            let (mut guest, _) = attach("fake", &holder.socket, "guest").unwrap().unwrap();
            guest.send(&line).unwrap();
            let since = Instant::now();
            while holder.handle.stops() == 0 && since.elapsed() < Duration::from_secs(2) {
                std::thread::sleep(Duration::from_millis(5));
            }
            std::thread::sleep(SOON);
            assert_eq!(holder.handle.stops(), 1, "{:?}", line.escape_ascii().to_string());
        }
    }

    /// A holder without a free descriptor takes no stop.
    #[test]
    fn guests_are_few_and_a_stop_gets_through() {
        let holder = Holder::new();
        let attach = || attach("fake", &holder.socket, "idle");
        let mut guests: Vec<_> = (0..MAX_GUESTS).map(|_| attach().unwrap().unwrap()).collect();
        let refused = attach().err().unwrap().to_string();
        let text = "fake is used by 32 other programs, the most there may be; end one of them and try again";
        assert_eq!(refused, text);
        assert_eq!(stop_at("fake", Some(holder.socket.clone())).unwrap(), Confirmation::Confirmed);
        guests.pop();
        let since = Instant::now();
        while attach().is_err() {
            assert!(since.elapsed() < Duration::from_secs(10), "no place is free again");
        }
    }

    /// Each asker has a thread.
    #[test]
    fn an_asker_that_says_nothing_more_keeps_no_stop_out() {
        let holder = Holder::new();
        let path = holder.socket.clone();
        let mut slow = UnixStream::connect(&path).unwrap();
        let trickle = std::thread::spawn(move || {
            for _ in 0..12 {
                let _ = slow.write_all(b"a");
                std::thread::sleep(Duration::from_millis(200));
            }
        });
        std::thread::sleep(Duration::from_millis(50));
        let began = Instant::now();
        let mut asker = UnixStream::connect(&holder.socket).unwrap();
        asker.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
        asker.write_all(b"stop\n").unwrap();
        let mut byte = [0];
        let stopped = asker.read_exact(&mut byte).ok();
        let took = began.elapsed();
        trickle.join().unwrap();
        assert!(stopped.is_some() && took < Duration::from_secs(1), "{stopped:?} after {took:?}");
    }

    /// A guest's exchange does not keep the socket of the port from whoever opens it next.
    #[test]
    fn a_port_that_is_opened_again_while_a_guest_asks_takes_stops() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("port");
        let (board, memory) = FakeBoard::new();
        let (link, handle) = hold(Box::new(Slow(board, Duration::from_millis(150))), Some(&socket));
        let client = Client::connect_as(link, 1).unwrap();
        client.share(&handle, Arc::<super::TestRights>::default() as _);
        let (guest, _) = attach("fake", &socket, "guest").unwrap().unwrap();
        let asking = std::thread::spawn(move || {
            if let Ok(mut client) = Client::connect(guest) {
                while client.status().is_ok() {}
            }
        });
        std::thread::sleep(SOON);
        drop(client);
        // As the console does after `upload`.
        let (_link, _handle) = hold(Box::new(FakeBoard::plug(&memory, None)), Some(&socket));
        let _ = asking.join();
        std::thread::sleep(SOON);
        assert!(is_in_use(&socket), "nobody can stop the arm through the process that holds the port");
    }

    /// A session outlives the port with which it began.
    #[test]
    fn a_guest_that_was_there_before_the_port_was_lost_can_stop_afterwards() {
        let Holder { mut client, handle, board, rights, socket, _folder } = Holder::new();
        let (link, _) = attach("fake", &socket, "guest").unwrap().unwrap();
        let mut guest = Client::connect(link).unwrap();
        let heard: Arc<Mutex<Vec<u8>>> = Arc::default();
        let to = Arc::clone(&heard);
        guest.set_on_text(move |text| to.lock().unwrap().extend(text));
        client.unplug();
        drop(handle);
        let plug = FakeBoard::plug(&board, None);
        let (link, handle) = hold(Box::new(plug), Some(&socket));
        client.share(&handle, rights as _);
        client.replug(link).unwrap();
        guest.say_hello().unwrap();
        guest.type_line("stop").unwrap();
        let since = Instant::now();
        while heard.lock().unwrap().is_empty() && since.elapsed() < Duration::from_secs(5) {
            guest.listen(0.01).unwrap();
        }
        let said = String::from_utf8(heard.lock().unwrap().clone()).unwrap();
        assert_eq!((said.as_str(), board.lock().unwrap().stops), ("ok\r\n", 1));
    }

    /// The socket may be that of whoever has taken the port since.
    #[test]
    fn who_lets_go_of_a_port_leaves_the_socket_of_the_next_one() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("port");
        let (board, memory) = FakeBoard::new();
        let first = hold(Box::new(board), Some(&socket));
        // Two processes have started at the same moment: both have found nobody at the socket, and the second removes "what a
        // process that was killed has left".
        std::fs::remove_file(&socket).unwrap();
        let second = hold(Box::new(FakeBoard::plug(&memory, None)), Some(&socket));
        drop(first);
        let mut asker = UnixStream::connect(&socket).expect("the socket of the one that is there is gone");
        asker.write_all(b"shared?\n").unwrap();
        let mut said = String::new();
        asker.read_to_string(&mut said).unwrap();
        assert_eq!(said, "alone\n");
        drop(second);
    }
}
