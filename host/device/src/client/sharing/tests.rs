//! Guests at a port with a scripted board behind it.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use darm_arm::image::UploadImage;
use darm_core::sequencer::Command;
use darm_core::units::ModelHash;
use darm_core::wire::message::Refusal;

use super::{Guest, Rights, attach, is_shared};
use crate::client::fake::{FakeBoard, Memory};
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
        assert!(!is_shared(&socket) && attach("fake", &socket, "early").is_none(), "not before the client shares it");
        let client = Client::connect_as(link, 1).unwrap();
        let rights = Arc::new(TestRights::default());
        client.share(&handle, Arc::clone(&rights) as _);
        assert!(is_shared(&socket));
        Self { client, handle, board, rights, socket, _folder: folder }
    }

    fn guest(&self, name: &str) -> (Client, StopHandle) {
        let (link, handle) = attach("fake", &self.socket, name).unwrap();
        (Client::connect(link).unwrap(), handle)
    }

    fn commands(&self) -> usize {
        self.board.lock().unwrap().commands.len()
    }
}

fn is_not_connected(result: &Result<(), ClientError>) -> bool {
    matches!(result, Err(ClientError::Refused(Refusal::NotConnected)))
}

fn until(wanted: impl Fn() -> bool) {
    let since = Instant::now();
    while !wanted() {
        assert!(since.elapsed() < Duration::from_secs(30), "it did not come");
        std::thread::sleep(Duration::from_millis(2));
    }
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
    assert!(handle.stop(STOP_BOUND).is_err() && attach("fake", &socket, "late").is_none());
}
