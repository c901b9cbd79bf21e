//! Accepting: a separate thread, faster than any flood, with a short queue to the thread that answers.
//!
//! To answer a connection takes some 60 µs, to accept one 5. Where the server's own thread accepted, a flood filled the queue of the
//! operating system, which drops what finds it full, and a client tries again a second later: too late for a stop. So this
//! thread empties that queue at once. Where its own queue is full the connection that has waited longest is closed, unless what it
//! has sent begins as a stop: such go before all others.

use std::collections::VecDeque;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use tokio::sync::Notify;

/// Most connections in each of the two queues. With those that are answered they stay below the 1 024 files that a process has by default.
const MAX_CONNECTIONS_WAITING: usize = 128;
/// The operating system has no file descriptor left: another connection may end in this time.
const DESCRIPTOR_WAIT: Duration = Duration::from_millis(100);
/// Longest time for the connection that ends the thread.
const LAST: Duration = Duration::from_secs(1);
/// The path of a stop.
pub(crate) const STOP: &str = "/api/stop";
/// The longest beginning of a request that is looked at, in bytes.
const BEGINNING: usize = 32;

/// Connections that are accepted and that nobody answers yet.
#[derive(Default)]
pub(crate) struct Accepted {
    waiting: Mutex<Waiting>,
    more: Notify,
    has_ended: AtomicBool,
}

#[derive(Default)]
struct Waiting {
    stops: VecDeque<TcpStream>,
    others: VecDeque<TcpStream>,
}

impl Accepted {
    /// The next one, once there is one.
    pub(crate) async fn next(&self) -> TcpStream {
        loop {
            let next = self.with(|waiting| waiting.stops.pop_front().or_else(|| waiting.others.pop_front()));
            match next {
                Some(stream) => return stream,
                None => self.more.notified().await,
            }
        }
    }

    /// Ends the thread that accepts at `address`: the standard library waits for a connection and nothing else, so it gets one.
    pub(crate) fn end(&self, address: SocketAddr) {
        self.has_ended.store(true, Ordering::Relaxed);
        let ip = match address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
            ip => ip,
        };
        // A connection that fails found the queue full: the thread accepts one of the queue, and sees the end after it.
        let _ = TcpStream::connect_timeout(&(ip, address.port()).into(), LAST);
    }

    fn add(&self, stream: TcpStream) {
        // What has no place is closed after the lock is free.
        let _closed = self.with(|waiting| waiting.add(stream));
        self.more.notify_one();
    }

    fn with<T>(&self, act: impl FnOnce(&mut Waiting) -> T) -> T {
        act(&mut self.waiting.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Waiting {
    /// Appends a connection; the one that lost its place to it, if any did.
    fn add(&mut self, stream: TcpStream) -> Option<TcpStream> {
        self.others.push_back(stream);
        let oldest = (self.others.len() > MAX_CONNECTIONS_WAITING).then(|| self.others.pop_front())??;
        if !is_stop(&oldest) {
            return Some(oldest);
        }
        self.stops.push_back(oldest);
        (self.stops.len() > MAX_CONNECTIONS_WAITING).then(|| self.stops.pop_front())?
    }
}

/// Whether what the client of a connection has sent begins as a stop.
fn is_stop(stream: &TcpStream) -> bool {
    let mut beginning = [0; BEGINNING];
    let sent = stream.peek(&mut beginning).ok().and_then(|read| beginning.get(..read));
    let path = sent.and_then(|sent| sent.strip_prefix(b"POST ")?.strip_prefix(STOP.as_bytes()));
    path.is_some_and(|behind| behind.starts_with(b" "))
}

/// Accepts connections until [`Accepted::end`].
pub(crate) fn accept(listener: &TcpListener, accepted: &Accepted) {
    while !accepted.has_ended.load(Ordering::Relaxed) {
        // Another thread only watches connections that never wait.
        match listener.accept().and_then(|(stream, _)| stream.set_nonblocking(true).map(|()| stream)) {
            Ok(stream) => accepted.add(stream),
            Err(_) => thread::sleep(DESCRIPTOR_WAIT),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::net::{TcpListener, TcpStream};

    use super::{MAX_CONNECTIONS_WAITING, Waiting};

    /// A client of `listener` that has sent `text`, and its connection.
    fn connect(listener: &TcpListener, text: &str) -> (TcpStream, TcpStream) {
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        client.write_all(text.as_bytes()).unwrap();
        let (stream, _) = listener.accept().unwrap();
        stream.set_nonblocking(true).unwrap();
        (client, stream)
    }

    #[test]
    fn the_oldest_leaves_a_full_queue_and_a_stop_goes_before_all() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut waiting = Waiting::default();
        let texts = ["", "POST /api/stop HTTP/1.1\r\n", "POST /api/sto", "GET /api/live HTTP/1.1\r\n"];
        let mut clients = Vec::new();
        let mut ports = Vec::new();
        let mut closed = Vec::new();
        for k in 0..MAX_CONNECTIONS_WAITING + texts.len() {
            let (client, stream) = connect(&listener, texts.get(k).copied().unwrap_or_default());
            ports.push(client.local_addr().unwrap());
            clients.push(client);
            closed.extend(waiting.add(stream).map(|stream| stream.peer_addr().unwrap()));
        }
        assert_eq!(closed, [ports[0], ports[2], ports[3]]);
        assert_eq!(waiting.stops.len(), 1);
        assert_eq!(waiting.stops[0].peer_addr().unwrap(), ports[1]);
        assert_eq!(waiting.others.len(), MAX_CONNECTIONS_WAITING);
        // Of more stops than there are places the oldest is closed.
        for _ in 0..2 * MAX_CONNECTIONS_WAITING {
            let (client, stream) = connect(&listener, texts[1]);
            clients.push(client);
            waiting.add(stream);
        }
        assert_eq!(waiting.stops.len(), MAX_CONNECTIONS_WAITING);
        assert_ne!(waiting.stops[0].peer_addr().unwrap(), ports[1]);
    }
}
