//! The holder's end: what one guest sends, to the board, and the answers back.
//!
//! One thread reads what the guest sends, so that a stop is found while the other waits for the line; that one asks the board in the
//! order of arrival and writes the answers.

use std::io::{Read as _, Write as _};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{ANSWER, Request as Bootstrap, Servos, Stopped};
use darm_core::wire::frame::{Header, MAX_PAYLOAD};
use darm_core::wire::message::{self, REPLY, REQUEST, Refusal, Reply, Request};

use super::line_kind::{LONGEST, LineKind};
use super::{Guest, Sharing};
use crate::client::exchange::{COMMAND_PATIENCE_S, DENIED, Exchange, encode, refusal};
use crate::client::question::{self, is_change};
use crate::client::reader::{Piece, Reader};
use crate::client::stop::{Confirmation, StopHandle};
use crate::client::{ClientError, NO_TIME, TransportError};
use crate::clock::host_now_s;

/// A requested stop takes at most this long: the guest sends it again.
const STOP_WORK: Duration = Duration::from_millis(350);
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
    /// A frame of the guest, and the number of stops before it.
    Frame(Header, Vec<u8>, u64),
    /// A line that the guest has typed.
    Line(TypedLine),
    /// Text of the board.
    Text(Vec<u8>),
    /// The guest has gone.
    End,
}

/// A line, and what had happened before it.
struct TypedLine {
    text: String,
    at: Instant,
    /// Stops of this guest.
    stops: u64,
    /// Stops of anybody, as far as this process has sent them.
    all_stops: u64,
}

/// Serves a guest until it goes, or the holder's client.
pub(super) fn serve(stream: UnixStream, guest: Guest, sharing: Sharing) {
    let Ok(writer) = stream.try_clone() else { return };
    if writer.set_write_timeout(Some(WRITE)).and_then(|()| stream.set_read_timeout(None)).is_err() {
        return;
    }
    let (handle, (jobs, to_do)) = (sharing.handle.clone(), sync_channel(WAITING));
    let stops = Arc::new(AtomicU64::new(0));
    let writer = Arc::new(Mutex::new(writer));
    let mut worker = Worker {
        guest,
        handle: handle.clone(),
        sharing,
        stops: Arc::clone(&stops),
        writer: Arc::clone(&writer),
        hello: None,
        answered: None,
        listen_until: Instant::now(),
    };
    if !worker.hear_text(&jobs) {
        return;
    }
    worker.sharing.rights.arrive(&worker.guest);
    let working = thread::spawn(move || {
        worker.run(&to_do);
        worker.sharing.rights.leave(&worker.guest);
        // Wakes the reader.
        let _ = lock(&worker.writer).shutdown(Shutdown::Both);
    });
    Incoming { jobs, stops, writer, handle, reader: Reader::default(), line: Vec::new() }.run(stream);
    let _ = working.join();
}

/// What the guest sends, in pieces.
struct Incoming {
    jobs: SyncSender<Job>,
    /// Stops of this guest so far: what it has sent before one of them is not sent after it.
    stops: Arc<AtomicU64>,
    writer: Arc<Mutex<UnixStream>>,
    handle: StopHandle,
    reader: Reader,
    line: Vec<u8>,
}

impl Incoming {
    fn run(mut self, mut stream: UnixStream) {
        let mut bytes = [0; 1024];
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            for piece in self.reader.read(host_now_s(), &bytes[..count]) {
                match piece {
                    Piece::Frame(header, payload) => self.take_frame(header, payload),
                    Piece::Text(text) => text.into_iter().for_each(|byte| self.take_byte(byte)),
                    // The guest sends it again.
                    Piece::Damaged(_) => {}
                }
            }
        }
        // What waits still is of a guest that has gone.
        self.stops.fetch_add(1, Ordering::AcqRel);
        let _ = self.jobs.send(Job::End);
    }

    fn take_frame(&mut self, header: Header, payload: Vec<u8>) {
        let is_bootstrap = Bootstrap::decode(header.tag, &payload) == Some(Bootstrap::Stop);
        if is_bootstrap || (header.tag == REQUEST && message::is_stop(&payload)) {
            let Some(confirmed) = self.stop() else { return };
            let answered = Header { tag: header.tag | ANSWER, ..header };
            if is_bootstrap {
                write_frame(&self.writer, answered, &confirmed);
            } else {
                write_frame(&self.writer, answered, &message::done(NO_TIME));
            }
        } else {
            self.queue(Job::Frame(header, payload, self.stops.load(Ordering::Acquire)));
        }
    }

    fn take_byte(&mut self, byte: u8) {
        match byte {
            b'\r' | b'\n' => {
                let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).into_owned();
                if LineKind::of(&line) == Ok(LineKind::Stops) {
                    let text = match self.stop() {
                        Some(_) => "ok\r\n",
                        None => "? the stop is not confirmed; switch off the arm's supply\r\n",
                    };
                    write(&self.writer, text.as_bytes());
                } else if !line.is_empty() {
                    let (stops, all_stops) = (self.stops.load(Ordering::Acquire), self.handle.stops());
                    self.queue(Job::Line(TypedLine { text: line, at: Instant::now(), stops, all_stops }));
                }
            }
            // One more than a line may have, so that it is refused.
            _ if self.line.len() <= LONGEST => self.line.push(byte),
            _ => {}
        }
    }

    /// The answer to a stop, where the board has confirmed it.
    fn stop(&self) -> Option<[u8; 2]> {
        self.stops.fetch_add(1, Ordering::AcqRel);
        match self.handle.stop(STOP_WORK) {
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
    guest: Guest,
    sharing: Sharing,
    handle: StopHandle,
    stops: Arc<AtomicU64>,
    writer: Arc<Mutex<UnixStream>>,
    /// The guest's connection, and what the board had when it said `Hello`: [`Exchange::known`].
    hello: Option<(u32, (u32, u64))>,
    /// The last request and its answer, for a guest that sends it again.
    answered: Option<(Header, Vec<u8>, Header, Vec<u8>)>,
    listen_until: Instant,
}

impl Worker {
    /// Hands the board's text to the guest from now on; false where the holder's client has gone.
    fn hear_text(&self, jobs: &SyncSender<Job>) -> bool {
        let Some(line) = self.sharing.line.upgrade() else { return false };
        let jobs = jobs.clone();
        line.take().add_guest(Box::new(move |text| jobs.try_send(Job::Text(text.to_vec())).is_ok()));
        true
    }

    fn run(&mut self, to_do: &Receiver<Job>) {
        let mut stayed = Instant::now();
        while self.sharing.line.strong_count() > 0 {
            let listens = Instant::now() < self.listen_until;
            let continues = match to_do.recv_timeout(if listens { LISTEN.0 } else { STAY }) {
                Ok(Job::Frame(header, payload, stops)) => self.take_frame(header, &payload, stops),
                Ok(Job::Line(line)) => self.take_line(&line),
                Ok(Job::Text(text)) => write(&self.writer, &text),
                Ok(Job::End) | Err(RecvTimeoutError::Disconnected) => false,
                Err(RecvTimeoutError::Timeout) if listens => self.with_line(|line| line.listen(LISTEN.1)).is_ok(),
                Err(RecvTimeoutError::Timeout) => true,
            };
            if !continues {
                return;
            }
            if stayed.elapsed() > STAY {
                stayed = Instant::now();
                self.sharing.rights.stay(&self.guest);
            }
        }
    }

    /// Uses the line when it is the guest's turn.
    fn with_line<T>(&self, act: impl FnOnce(&mut Exchange) -> Result<T, ClientError>) -> Result<T, ClientError> {
        let line = self.sharing.line.upgrade().ok_or_else(|| self.handle.closed())?;
        let mut exchange = line.take();
        act(&mut exchange)
    }

    /// The same to change something, if the guest may, and has neither stopped the arm nor gone since it wanted to.
    fn change<T>(
        &self,
        stops: u64,
        act: impl FnOnce(&mut Exchange) -> Result<T, ClientError>,
    ) -> Result<T, ClientError> {
        self.sharing.rights.take_control(&self.guest).map_err(ClientError::Denied)?;
        self.with_line(|line| {
            // Now: it may have waited for the line.
            if stops == self.stops.load(Ordering::Acquire) { act(line) } else { Err(overtaken()) }
        })
    }

    /// Whether the session continues.
    fn take_frame(&mut self, header: Header, payload: &[u8], stops: u64) -> bool {
        if let Some((asked, request, answer, reply)) = &self.answered
            && (*asked, request.as_slice()) == (header, payload)
        {
            return write_frame(&self.writer, *answer, reply);
        }
        let answer = match Bootstrap::decode(header.tag, payload) {
            Some(request) => self.bootstrap(request, stops).map(|payload| (header.tag | ANSWER, payload)),
            None if header.tag == REQUEST => self.request(header, payload, stops).map(|payload| (REPLY, payload)),
            None => return true,
        };
        let (tag, reply) = match answer {
            Ok(answer) => answer,
            Err(ClientError::Denied(reason)) => (DENIED, reason.into_bytes()),
            // The port has failed: the guest is to see it too.
            Err(ClientError::Transport(TransportError::Link(_))) => return false,
            // The guest asks again, and gives up by itself.
            Err(_) => return true,
        };
        let answer = Header { tag, ..header };
        let continues = write_frame(&self.writer, answer, &reply);
        self.answered = Some((header, payload.to_vec(), answer, reply));
        continues
    }

    fn bootstrap(&self, request: Bootstrap, stops: u64) -> Result<Vec<u8>, ClientError> {
        let ask = |line: &mut Exchange| line.ask_bootstrap("a guest's question", request);
        match request {
            // A stop does not come here: it waits for no line.
            Bootstrap::Identify | Bootstrap::Version | Bootstrap::ReadFault | Bootstrap::Stop => self.with_line(ask),
            Bootstrap::Reboot(_) => self.change(stops, ask),
        }
    }

    fn request(&mut self, header: Header, payload: &[u8], stops: u64) -> Result<Vec<u8>, ClientError> {
        let request: Request = match postcard::from_bytes(payload) {
            Ok(request) => request,
            Err(_) => return refused(Refusal::Unknown),
        };
        let hello = self.hello;
        let ask = |line: &mut Exchange| {
            if hello != Some((header.link, line.known())) {
                return Ok((refused(Refusal::NotConnected)?, None));
            }
            let reply = line.ask(&request)?.arrival.payload;
            Ok((reply, Some(line.known())))
        };
        let (reply, known) = match request {
            Request::Hello { protocol, .. } => return self.hello(header.link, protocol),
            request if is_change(&request) => self.change(stops, ask)?,
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
            let has_ended = line.is_stopped() || before.is_some_and(|(_, known)| known.0 != line.known().0);
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
    fn take_line(&mut self, line: &TypedLine) -> bool {
        self.listen_until = Instant::now() + ANSWER_OF_LINE;
        match self.type_line(line) {
            Ok(()) => true,
            Err(ClientError::Denied(reason)) => write(&self.writer, format!("? {reason}\r\n").as_bytes()),
            Err(_) => false,
        }
    }

    /// Sends a line that the guest has typed. It belongs to no connection: one that changes something must not wait until nobody expects
    /// it, nor past a stop.
    fn type_line(&self, line: &TypedLine) -> Result<(), ClientError> {
        let kind = LineKind::of(&line.text).map_err(|error| ClientError::Denied(error.to_string()))?;
        let send = |exchange: &mut Exchange| exchange.send_raw(format!("{}\r", line.text).as_bytes());
        if kind == LineKind::Reads {
            return self.with_line(send);
        }
        self.change(line.stops, |exchange| {
            let is_late = line.at.elapsed().as_secs_f64() > COMMAND_PATIENCE_S;
            if is_late || self.handle.stops() != line.all_stops { Err(overtaken()) } else { send(exchange) }
        })
    }
}

/// What was to be done is not wanted any more, or nobody expects it.
fn overtaken() -> ClientError {
    ClientError::Denied("a stop came meanwhile, or it waited too long".to_owned())
}

/// A reply of the holder, in the board's words. It has no board time.
fn refused(refusal: Refusal) -> Result<Vec<u8>, ClientError> {
    let reply = Reply { at: NO_TIME, result: Err(refusal) };
    let mut bytes = [0; MAX_PAYLOAD];
    let used = postcard::to_slice(&reply, &mut bytes).map_err(|_| ClientError::Refused(refusal))?;
    Ok(used.to_vec())
}

fn write_frame(writer: &Mutex<UnixStream>, header: Header, payload: &[u8]) -> bool {
    encode(header, &payload[..payload.len().min(MAX_PAYLOAD)]).is_ok_and(|frame| write(writer, &frame))
}

/// False where the guest has gone or does not read.
fn write(writer: &Mutex<UnixStream>, bytes: &[u8]) -> bool {
    lock(writer).write_all(bytes).is_ok()
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
