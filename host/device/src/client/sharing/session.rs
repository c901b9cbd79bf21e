//! The holder's end: what one guest sends, to the board, and the answers back.
//!
//! One thread reads what the guest sends, so that a stop is found while the other waits for the line; that one asks the board in the
//! order of arrival and writes the answers.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use darm_core::sequencer::Phase;
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{ANSWER, Request as Bootstrap, Servos, Stopped};
use darm_core::wire::frame::{Header, MAX_PAYLOAD};
use darm_core::wire::message::{self, Answer, Doing, REPLY, REQUEST, Refusal, Reply, Request};
use darm_core::wire::scan::{Scanner, Stop};

use super::line_kind::{LONGEST, LineKind};
use super::{Guest, Sharing};
use crate::client::exchange::{COMMAND_PATIENCE_S, DENIED, Exchange, Known, encode, overtaken, refusal};
use crate::client::question;
use crate::client::reader::{Piece, Reader};
use crate::client::stop::socket::HOLDER_WORK;
use crate::client::stop::{Confirmation, StopHandle, lock};
use crate::client::{ClientError, NO_TIME, TransportError};
use crate::clock::host_now_s;
use crate::link::LinkError;

/// Pieces that wait for the line at most; a guest waits for the answer before it sends the next, but for the chunks of a table.
const WAITING: usize = 256;
/// A guest that does not read is given up after this time.
const WRITE: Duration = Duration::from_secs(2);
/// How often the rights hear that a guest is there still, while it sends nothing.
const STAY: Duration = Duration::from_millis(500);
/// After a typed line the board's text is read for this time, where the holder itself does not read.
const ANSWER_OF_LINE: Duration = Duration::from_millis(1500);
/// How often, and how long each time, s.
const LISTEN: (Duration, f64) = (Duration::from_millis(20), 0.01);

/// What waits for the line.
enum Job {
    /// A frame of the guest.
    Frame(Header, Vec<u8>, Arrived),
    /// A line that the guest has typed.
    Line(String, Arrived),
    /// Text of the board.
    Text(Vec<u8>),
    /// The guest has gone.
    End,
}

/// A frame with its payload.
type Frame = (Header, Vec<u8>);

/// When something came, and what had happened before.
#[derive(Clone, Copy)]
struct Arrived {
    at: Instant,
    /// Stops of this guest; it counts as one that the guest goes.
    own_stops: u64,
    /// Stops of anybody that this process has sent.
    stops: u64,
}

/// What both threads of a session have.
struct Session {
    guest: Guest,
    sharing: Sharing,
    own_stops: AtomicU64,
    writer: Mutex<UnixStream>,
}

impl Session {
    fn now(&self) -> Arrived {
        let stops = self.handle().map_or(0, |handle| handle.stops());
        Arrived { at: Instant::now(), own_stops: self.own_stops.load(Ordering::Acquire), stops }
    }

    /// Whether what came then is not wanted any more, or nobody expects it: it waited too long, the guest has gone, or somebody has stopped the
    /// arm since.
    fn is_late(&self, arrived: Arrived) -> bool {
        let now = self.now();
        (now.own_stops, now.stops) != (arrived.own_stops, arrived.stops)
            || arrived.at.elapsed().as_secs_f64() > COMMAND_PATIENCE_S
    }

    /// What stops the board at the port that is open now.
    fn handle(&self) -> Option<StopHandle> {
        self.sharing.line.upgrade()?.handle()
    }

    /// False where the guest has gone or does not read.
    fn write(&self, bytes: &[u8]) -> bool {
        lock(&self.writer).write_all(bytes).is_ok()
    }

    fn write_frame(&self, header: Header, payload: &[u8]) -> bool {
        encode(header, &payload[..payload.len().min(MAX_PAYLOAD)]).is_ok_and(|frame| self.write(&frame))
    }
}

/// Serves a guest until it goes, or the holder's client.
pub(super) fn serve(stream: UnixStream, guest: Guest, sharing: Sharing) {
    let Ok(writer) = stream.try_clone() else { return };
    if writer.set_write_timeout(Some(WRITE)).and_then(|()| stream.set_read_timeout(Some(STAY))).is_err() {
        return;
    }
    let (jobs, to_do) = sync_channel(WAITING);
    let session = Arc::new(Session { guest, sharing, own_stops: AtomicU64::new(0), writer: Mutex::new(writer) });
    session.sharing.rights.arrive(&session.guest);
    let working = {
        let (session, jobs) = (Arc::clone(&session), jobs.clone());
        thread::spawn(move || {
            let mut worker =
                Worker { session, hello: None, answered: None, listen_until: Instant::now(), has_changed: false };
            if worker.hear_text(jobs) {
                worker.run(&to_do);
            }
            worker.leave();
        })
    };
    Incoming { session, jobs, reader: Reader::default(), line: Vec::new(), scanner: Scanner::default() }.run(stream);
    let _ = working.join();
}

/// What the guest sends, in pieces.
struct Incoming {
    session: Arc<Session>,
    jobs: SyncSender<Job>,
    reader: Reader,
    line: Vec<u8>,
    scanner: Scanner,
}

impl Incoming {
    fn run(mut self, mut stream: UnixStream) {
        let mut bytes = [0; 1024];
        loop {
            // Also while the other thread waits for the line.
            self.session.sharing.rights.stay(&self.session.guest);
            match stream.read(&mut bytes) {
                Ok(count @ 1..) => self.take(&bytes[..count]),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                }
                Ok(_) | Err(_) => break,
            }
        }
        self.session.own_stops.fetch_add(1, Ordering::AcqRel);
        // The other thread may have ended already.
        let _ = self.jobs.send(Job::End);
    }

    fn take(&mut self, bytes: &[u8]) {
        let now_s = host_now_s();
        for &byte in bytes {
            // As on the board, ahead of frames and lines: noise that looks like half a frame, or a line that is too long, keeps no stop out.
            let stop = self.scanner.push(byte);
            if let Some(stop) = stop {
                self.take_stop(stop);
            }
            for piece in self.reader.read(now_s, &[byte]) {
                match piece {
                    Piece::Frame(header, payload) => self.take_frame(header, payload),
                    Piece::Text(text) => text.into_iter().for_each(|byte| self.take_byte(byte, stop.is_some())),
                    // The guest sends it again.
                    Piece::Damaged(_) => {}
                }
            }
        }
    }

    /// Sends a stop that the scanner has found, and answers it in its own language.
    fn take_stop(&self, stop: Stop) {
        let confirmed = self.stop();
        let answered = |header: Header| Header { tag: header.tag | ANSWER, ..header };
        match (stop, confirmed) {
            (Stop::Typed, Some(_)) => self.session.write(b"ok\r\n"),
            (Stop::Typed, None) => self.session.write(b"? the stop is not confirmed; switch off the arm's supply\r\n"),
            (Stop::Bootstrap(header), Some(confirmed)) => self.session.write_frame(answered(header), &confirmed),
            (Stop::Message(header), Some(_)) => self.session.write_frame(answered(header), &message::done(NO_TIME)),
            // The guest sends it again.
            (Stop::Bootstrap(_) | Stop::Message(_), None) => true,
        };
    }

    fn take_frame(&mut self, header: Header, payload: Vec<u8>) {
        // The scanner has found a stop with the same byte.
        if Stop::of(header, &payload).is_none() {
            self.queue(Job::Frame(header, payload, self.session.now()));
        }
    }

    fn take_byte(&mut self, byte: u8, has_stopped: bool) {
        match byte {
            b'\r' | b'\n' => {
                let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).into_owned();
                if has_stopped || line.is_empty() {
                    return;
                }
                // More than the board would take for one: whoever types `stop now` means it.
                if LineKind::of(&line) == Ok(LineKind::Stops) {
                    self.take_stop(Stop::Typed);
                } else {
                    self.queue(Job::Line(line, self.session.now()));
                }
            }
            // One more than a line may have, so that it is refused.
            _ if self.line.len() <= LONGEST => self.line.push(byte),
            _ => {}
        }
    }

    /// The answer to a stop, where the board has confirmed it.
    fn stop(&self) -> Option<[u8; 2]> {
        self.session.own_stops.fetch_add(1, Ordering::AcqRel);
        match self.session.handle()?.stop(HOLDER_WORK) {
            Ok(Confirmation::Confirmed) => Some(Stopped::encode(Servos::Ordered)),
            Ok(Confirmation::OutputsAlone) => Some(Stopped::encode(Servos::Uncontrolled)),
            Ok(Confirmation::Missing) | Err(_) => None,
        }
    }

    /// Where too much waits the guest sends it again.
    fn queue(&self, job: Job) {
        let _ = self.jobs.try_send(job);
    }
}

/// Asks the board for a guest.
struct Worker {
    session: Arc<Session>,
    /// The number under which the guest has said `Hello`, and what it knows since.
    hello: Option<(u32, Known)>,
    /// The last request and its answer, where there was one, for a guest that sends it again.
    answered: Option<(Frame, Option<Frame>)>,
    listen_until: Instant,
    /// Whether it may have moved something.
    has_changed: bool,
}

impl Worker {
    /// Hands the board's text to the guest from now on; false where the holder's client has gone.
    fn hear_text(&self, jobs: SyncSender<Job>) -> bool {
        let hear =
            move |text: &[u8]| !matches!(jobs.try_send(Job::Text(text.to_vec())), Err(TrySendError::Disconnected(_)));
        let adds = |line: &mut Exchange| {
            line.add_guest(Box::new(hear));
            Ok(())
        };
        self.with_line(adds).is_ok()
    }

    fn run(&mut self, to_do: &Receiver<Job>) {
        while self.session.sharing.line.strong_count() > 0 {
            let listens = Instant::now() < self.listen_until;
            let continues = match to_do.recv_timeout(if listens { LISTEN.0 } else { STAY }) {
                Ok(Job::Frame(header, payload, arrived)) => self.take_frame(header, payload, arrived),
                Ok(Job::Line(line, arrived)) => self.take_line(&line, arrived),
                Ok(Job::Text(text)) => self.session.write(&text),
                Ok(Job::End) | Err(RecvTimeoutError::Disconnected) => false,
                Err(RecvTimeoutError::Timeout) if listens => self.with_line(|line| line.listen(LISTEN.1)).is_ok(),
                Err(RecvTimeoutError::Timeout) => true,
            };
            if !continues {
                return;
            }
        }
    }

    /// Nobody is left who would switch off what the guest has moved by hand. A program on the board continues.
    fn leave(&self) {
        let is_by_hand = || {
            let status = self.with_line(|line| Ok(line.ask(&question::status().request)?.arrival));
            let reply =
                status.ok().and_then(|arrival| Some(postcard::from_bytes::<Reply>(&arrival.payload).ok()?.result));
            // What is not known may be on.
            !matches!(reply, Some(Ok(Answer::Status(status))) if status.phase != Phase::Manual)
        };
        if self.has_changed && is_by_hand() {
            let _ = self.session.handle().map(|handle| handle.stop(HOLDER_WORK));
        }
        self.session.sharing.rights.leave(&self.session.guest);
        // Wakes the reader.
        let _ = lock(&self.session.writer).shutdown(Shutdown::Both);
    }

    /// Uses the line when it is the guest's turn.
    fn with_line<T>(&self, act: impl FnOnce(&mut Exchange) -> Result<T, ClientError>) -> Result<T, ClientError> {
        let gone = || LinkError::Closed { port: "the port".to_owned() };
        let line = self.session.sharing.line.upgrade().ok_or_else(gone)?;
        let mut exchange = line.take();
        act(&mut exchange)
    }

    /// The same to change something, if the guest may.
    fn change<T>(
        &mut self,
        arrived: Arrived,
        act: impl FnOnce(&mut Exchange) -> Result<T, ClientError>,
    ) -> Result<T, ClientError> {
        let take_control =
            || self.session.sharing.rights.take_control(&self.session.guest).map_err(ClientError::Denied);
        // Who has no control does not wait for the line.
        take_control()?;
        let done = self.with_line(|line| {
            // It may have waited for the line: longer than anybody expects it, past a stop, or past its control.
            if self.session.is_late(arrived) {
                return Err(overtaken());
            }
            take_control()?;
            act(line)
        });
        self.has_changed |= !matches!(done, Err(ClientError::Denied(_)));
        done
    }

    /// Whether the session continues.
    fn take_frame(&mut self, header: Header, payload: Vec<u8>, arrived: Arrived) -> bool {
        let asked = (header, payload);
        if let Some((before, answer)) = &self.answered
            && *before == asked
        {
            // One that has failed is not asked again by a copy that waited behind it.
            return answer.as_ref().is_none_or(|(header, reply)| self.session.write_frame(*header, reply));
        }
        let answer = match Bootstrap::decode(header.tag, &asked.1) {
            Some(request) => self.bootstrap(request, arrived).map(|payload| (header.tag | ANSWER, payload)),
            None if header.tag == REQUEST => self.request(header, &asked.1, arrived).map(|payload| (REPLY, payload)),
            None => return true,
        };
        let answer = match answer {
            Ok(answer) => Some(answer),
            Err(ClientError::Denied(reason)) => Some((DENIED, reason.into_bytes())),
            // The port has failed: the guest is to see it too.
            Err(ClientError::Transport(TransportError::Link(_))) => return false,
            // The guest gives up by itself.
            Err(_) => None,
        };
        let answer = answer.map(|(tag, reply)| (Header { tag, ..header }, reply));
        let continues = answer.as_ref().is_none_or(|(header, reply)| self.session.write_frame(*header, reply));
        self.answered = Some((asked, answer));
        continues
    }

    fn bootstrap(&mut self, request: Bootstrap, arrived: Arrived) -> Result<Vec<u8>, ClientError> {
        let ask = |line: &mut Exchange| line.ask_bootstrap("a guest's question", request);
        match request {
            // A stop does not come here: it waits for no line.
            Bootstrap::Identify | Bootstrap::Version | Bootstrap::ReadFault | Bootstrap::Stop => self.with_line(ask),
            Bootstrap::Reboot(_) => self.change(arrived, ask),
        }
    }

    fn request(&mut self, header: Header, payload: &[u8], arrived: Arrived) -> Result<Vec<u8>, ClientError> {
        let request: Request = match postcard::from_bytes(payload) {
            Ok(request) => request,
            Err(_) => return refused(Refusal::Unknown),
        };
        let changes = request.doing() != Doing::Reads;
        let hello = self.hello.filter(|(link, _)| *link == header.link);
        let ask = |line: &mut Exchange| {
            let now = line.known();
            let allowed = match hello {
                None => Err(Refusal::NotConnected),
                Some((_, known)) if changes => line.check_known(known).and(same(known.stores, now.stores)),
                Some((_, known)) => same(known.connection, now.connection),
            };
            if let Err(refusal) = allowed {
                return Ok((refused(refusal)?, None));
            }
            let reply = line.ask(&request)?.arrival.payload;
            Ok((reply, changes.then(|| line.known())))
        };
        let (reply, known) = match request {
            Request::Hello { protocol, .. } => return self.hello(header.link, protocol),
            _ if changes => self.change(arrived, ask)?,
            _ => self.with_line(ask)?,
        };
        self.hello = known.map(|known| (header.link, known)).or(self.hello);
        Ok(reply)
    }

    /// What the board says on the connection that is open; where a stop has ended it, or the board has, another one is opened.
    fn hello(&mut self, link: u32, protocol: u16) -> Result<Vec<u8>, ClientError> {
        if protocol != PROTOCOL {
            return refused(Refusal::Protocol { board: PROTOCOL });
        }
        let before = self.hello;
        let (reply, known) = self.with_line(|line| {
            // Under the same number it asks whether its connection is open still.
            let is_new = before.is_none_or(|(same, _)| same != link);
            let has_ended =
                line.is_stopped() || before.is_some_and(|(_, known)| known.connection != line.known().connection);
            if !is_new && has_ended {
                return Ok((refused(Refusal::Challenge { challenge: 0 })?, None));
            }
            let joined = if is_new { line.join_connection() } else { line.ask(&question::hello(0).request) };
            let arrival = joined?.arrival;
            let known = refusal(&arrival).is_none().then(|| line.known());
            Ok((arrival.payload, known))
        })?;
        self.hello = known.map(|known| (link, known)).or(self.hello);
        Ok(reply)
    }

    /// Whether the session continues.
    fn take_line(&mut self, line: &str, arrived: Arrived) -> bool {
        self.listen_until = Instant::now() + ANSWER_OF_LINE;
        match self.type_line(line, arrived) {
            Ok(()) => true,
            Err(ClientError::Denied(reason)) => self.session.write(format!("? {reason}\r\n").as_bytes()),
            Err(_) => false,
        }
    }

    fn type_line(&mut self, line: &str, arrived: Arrived) -> Result<(), ClientError> {
        let kind = LineKind::of(line).map_err(|error| ClientError::Denied(error.to_string()))?;
        if kind == LineKind::Reads {
            return self.with_line(|exchange| exchange.send_raw(format!("{line}\r").as_bytes()));
        }
        let session = Arc::clone(&self.session);
        self.change(arrived, |exchange| exchange.type_change(line, || session.is_late(arrived)))
    }
}

/// Whether what the guest knows is so still.
fn same<T: PartialEq>(known: T, now: T) -> Result<(), Refusal> {
    if known == now { Ok(()) } else { Err(Refusal::NotConnected) }
}

/// A reply of the holder, in the board's words. It has no board time.
fn refused(refusal: Refusal) -> Result<Vec<u8>, ClientError> {
    let reply = Reply { at: NO_TIME, result: Err(refusal) };
    let mut bytes = [0; MAX_PAYLOAD];
    let used = postcard::to_slice(&reply, &mut bytes).map_err(|_| ClientError::Refused(refusal))?;
    Ok(used.to_vec())
}
