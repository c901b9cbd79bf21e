//! The memory of uploads: all of them together have a bound, whoever sends how many at once, and each is given back after a
//! bounded time, however its bytes arrive.

use std::future::poll_fn;
use std::pin::Pin;
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes};
use axum::extract::{FromRef, FromRequest, Request};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use hyper::body::Body as _;

use crate::memory_budget::{MemoryBudget, NoMemory, Reserved};
use crate::refusal::{Kind, Refused};
use crate::upload::{MAX_FILES, MAX_UPLOADS};

/// First memory of an upload; it doubles as the upload arrives.
const FIRST: usize = 1 << 16;
/// An upload that takes longer ends, at whatever rate it arrives: it holds its memory meanwhile. The slowest rate of Wi-Fi that
/// browsers still load pages at, 2 Mbit/s with half of it lost to acknowledgements and other stations, carries 125 kB/s: the
/// largest upload takes 9 minutes there.
const LONGEST: Duration = Duration::from_mins(10);
/// An upload that is slower over [`PERIOD`] ends before that: a tunnel over a telephone has 50 times as much.
const SLOWEST_PER_S: usize = 8_000;
/// How long an upload is watched before it is called slow: a pause of the network may be as long.
const PERIOD: Duration = Duration::from_secs(10);

/// What is left of the memory of uploads.
#[derive(Clone)]
pub(crate) struct UploadMemory(MemoryBudget);

/// The body of a request with files; its memory is free again when this is dropped.
pub(crate) struct UploadBody {
    pub(crate) bytes: Vec<u8>,
    _memory: Reserved,
}

impl UploadMemory {
    pub(crate) fn new() -> Self {
        Self(MemoryBudget::new(MAX_UPLOADS))
    }
}

/// Why an upload finds no room.
fn full(none: NoMemory) -> Refused {
    Refused::new(Kind::Refused, format!("other pages send files: {none}; try again in a moment"))
}

/// How an upload arrives. Time is an argument.
struct Pace {
    begun: Instant,
    /// The period that runs, and what has arrived in it.
    since: Instant,
    bytes: usize,
}

impl Pace {
    fn new(now: Instant) -> Self {
        Self { begun: now, since: now, bytes: 0 }
    }

    /// How long the next bytes are waited for before [`Self::note`] is to be asked without any.
    fn patience(&self, now: Instant) -> Duration {
        PERIOD.min(LONGEST.saturating_sub(now.saturating_duration_since(self.begun)))
    }

    /// Notes what has arrived; an error once a period had less than it needs, or the upload takes too long.
    fn note(&mut self, now: Instant, bytes: usize) -> Result<(), Refused> {
        self.bytes += bytes;
        if now.saturating_duration_since(self.begun) >= LONGEST {
            let text = format!(
                "the files did not arrive within {} minutes, and would keep other pages waiting; compress the measurements \
                 (.csv.gz), or send them over a faster connection",
                LONGEST.as_secs() / 60
            );
            return Err(Refused::new(Kind::Refused, text));
        }
        let passed = now.saturating_duration_since(self.since);
        if passed < PERIOD {
            return Ok(());
        }
        if (self.bytes as f64) < SLOWEST_PER_S as f64 * passed.as_secs_f64() {
            let text = format!(
                "the files arrive at less than {} kB/s, and would keep other pages waiting; send them over a faster connection",
                SLOWEST_PER_S / 1000
            );
            return Err(Refused::new(Kind::Refused, text));
        }
        (self.since, self.bytes) = (now, 0);
        Ok(())
    }
}

impl<S> FromRequest<S> for UploadBody
where
    S: Send + Sync,
    UploadMemory: FromRef<S>,
{
    type Rejection = Response;

    async fn from_request(request: Request, state: &S) -> Result<Self, Response> {
        let length =
            request.headers().get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok()?.parse().ok());
        let Some(length) = length else { return Err(StatusCode::LENGTH_REQUIRED.into_response()) };
        if length > MAX_FILES {
            return Err(StatusCode::PAYLOAD_TOO_LARGE.into_response());
        }
        let memory = UploadMemory::from_ref(state).0.reserved();
        collected(request.into_body(), length, memory).await.map_err(IntoResponse::into_response)
    }
}

/// Reads a body of this length, with memory for what has arrived.
async fn collected(mut body: Body, length: usize, mut memory: Reserved) -> Result<UploadBody, Refused> {
    let cut = || Refused::new(Kind::Invalid, "the files arrived incomplete; choose them again");
    let (mut bytes, mut pace) = (Vec::new(), Pace::new(Instant::now()));
    while bytes.len() < length {
        let next = poll_fn(|context| Pin::new(&mut body).poll_frame(context));
        let frame = tokio::time::timeout(pace.patience(Instant::now()), next).await;
        let part = match frame {
            Ok(Some(Ok(frame))) => frame.into_data().unwrap_or_default(),
            Ok(Some(Err(_)) | None) => return Err(cut()),
            Err(_) => Bytes::new(),
        };
        pace.note(Instant::now(), part.len())?;
        if bytes.len() + part.len() > bytes.capacity() {
            let next = (2 * bytes.capacity()).max(FIRST).max(bytes.len() + part.len()).min(length.max(part.len()));
            memory.grow_to(next).map_err(full)?;
            bytes.reserve_exact(next - bytes.len());
        }
        bytes.extend_from_slice(&part);
    }
    Ok(UploadBody { bytes, _memory: memory })
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use rand::rngs::StdRng;
    use rand::{RngExt as _, SeedableRng as _};

    use super::{LONGEST, PERIOD, Pace, SLOWEST_PER_S, UploadMemory};
    use crate::upload::{MAX_FILES, MAX_UPLOADS};

    #[test]
    fn uploads_take_memory_as_they_arrive_share_one_bound_and_give_it_back() {
        let memory = UploadMemory::new();
        let reserved = || memory.0.reserved();
        let mut begun: Vec<_> = (0..400).map(|_| reserved()).collect();
        assert!(begun.iter_mut().all(|one| one.grow_to(1).is_ok()), "what has not arrived takes none");
        let mut large = reserved();
        assert!(large.grow_to(MAX_FILES).is_ok());
        drop((begun, large));
        let reserve = || {
            let mut one = reserved();
            one.grow_to(MAX_FILES).unwrap();
            one
        };
        let all: Vec<_> = (0..MAX_UPLOADS / MAX_FILES).map(|_| reserve()).collect();
        let refused = super::full(reserved().grow_to(1).unwrap_err());
        assert!(refused.text.starts_with("other pages send files: 0 of 128 MB"), "{}", refused.text);
        drop(all);
        assert!(reserved().grow_to(MAX_FILES).is_ok());
        assert!(reserved().grow_to(usize::MAX).is_err());
    }

    /// What becomes of an upload that has something to send every `every`, `bytes` of it each time: when it has arrived, or why not
    /// and when.
    fn arrival(length: usize, mut next: impl FnMut() -> (Duration, usize)) -> Result<Duration, (Duration, String)> {
        let start = Instant::now();
        let (mut now, mut pace, mut arrived) = (start, Pace::new(start), 0);
        while arrived < length {
            let (mut wait, bytes) = next();
            loop {
                let patience = pace.patience(now);
                let is_here = wait <= patience;
                now += wait.min(patience);
                let part = if is_here { bytes } else { 0 };
                pace.note(now, part).map_err(|refused| (now - start, refused.text))?;
                assert!(now - start < LONGEST, "it goes on after {:?}", now - start);
                arrived += part;
                if is_here {
                    break;
                }
                wait -= patience;
            }
        }
        Ok(now - start)
    }

    #[test]
    fn an_upload_that_sends_a_byte_at_a_time_ends_and_one_that_pauses_does_not() {
        let (_, text) = arrival(MAX_FILES, || (Duration::from_secs(1), 1)).unwrap_err();
        assert!(text.contains("less than 8 kB/s"), "{text}");
        let start = Instant::now();
        let mut pausing = Pace::new(start);
        pausing.note(start, 2 * SLOWEST_PER_S * 10).unwrap();
        pausing.note(start + PERIOD + Duration::from_secs(1), 1).unwrap();
    }

    #[test]
    fn the_largest_upload_arrives_over_a_slow_wifi() {
        let taken = arrival(MAX_FILES, || (Duration::from_millis(40), 5_000)).unwrap();
        assert!(taken < LONGEST, "{taken:?}");
    }

    /// Just above the slowest rate, in bursts as rare as they may be, nearly all at once and then little, and anything else.
    #[test]
    fn memory_is_given_back_in_time_however_the_bytes_arrive() {
        let least = SLOWEST_PER_S * PERIOD.as_secs() as usize;
        let mut first = true;
        let mut at_once = || match std::mem::take(&mut first) {
            true => (Duration::ZERO, MAX_FILES - (8 << 20)),
            false => (Duration::from_secs(1), SLOWEST_PER_S + 100),
        };
        let mut all = vec![
            arrival(MAX_FILES, || (Duration::from_secs(1), SLOWEST_PER_S + 100)),
            arrival(MAX_FILES, || (PERIOD - Duration::from_millis(1), least)),
            arrival(MAX_FILES, &mut at_once),
            arrival(MAX_FILES, || (Duration::from_hours(2), MAX_FILES)),
        ];
        let mut random = StdRng::seed_from_u64(7);
        all.extend((0..50).map(|_| {
            let most = random.random_range(1..60);
            arrival(MAX_FILES, || {
                let wait = Duration::from_millis(random.random_range(0..1_000));
                (wait, random.random_range(1..=most * SLOWEST_PER_S))
            })
        }));
        for end in &all {
            let at = match end {
                Ok(at) | Err((at, _)) => *at,
            };
            assert!(at <= LONGEST, "{end:?}");
        }
        let (_, text) = all[0].as_ref().unwrap_err();
        assert!(text.contains("within 10 minutes") && text.contains("compress"), "{text}");
    }
}
