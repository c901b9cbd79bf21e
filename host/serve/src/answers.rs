//! The memory of answers: all that wait to be sent have a bound together, and a file is read while it is sent.
//!
//! A client that reads no answer keeps it in memory, and there may be as many as there are connections. What such an answer takes is
//! free when its last byte has been handed to the operating system, or its connection is closed.

use std::pin::Pin;
use std::task::{Context, Poll, ready};

use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{Request, State};
use axum::http::header;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use hyper::body::{Body as HttpBody, Frame};
use tokio::fs::File;
use tokio::io::{AsyncRead as _, ReadBuf};

use crate::memory_budget::{MemoryBudget, Reserved};
use crate::refusal::{Kind, Refused};

/// Most bytes of all answers that wait to be sent: two of the largest that there are in memory, the recording of a page of Replay and
/// a history of years, and with [`MAX_UPLOADS`](crate::upload::MAX_UPLOADS) and the work on both it stays below 1 GiB.
const MAX_ANSWERS: usize = 256 << 20;
/// A shorter answer does not count: a stop is always answered, and what pages ask again and again. 256 connections have 16 MB of them.
const SMALL: usize = 1 << 16;
/// Bytes of a file that are read at once.
const PART: usize = 1 << 16;

/// What is left of the memory of answers.
#[derive(Clone)]
pub(crate) struct AnswerMemory(MemoryBudget);

impl AnswerMemory {
    pub(crate) fn new() -> Self {
        Self(MemoryBudget::new(MAX_ANSWERS))
    }

    /// The answer, counted until it is sent, or a refusal where it finds no room.
    async fn counted(&self, answer: Response) -> Response {
        // Only an answer of a known length is in memory; a file is read as it is sent.
        let bytes = answer.body().size_hint().exact().and_then(|bytes| usize::try_from(bytes).ok());
        let Some(bytes) = bytes.filter(|bytes| *bytes > SMALL) else { return answer };
        let mut memory = self.0.reserved();
        if let Err(none) = memory.grow_to(bytes) {
            let text = format!("too many answers wait to be read: {none}; close other pages and try again");
            return Refused::new(Kind::Busy, text).into_response();
        }
        let (parts, body) = answer.into_parts();
        match to_bytes(body, bytes).await {
            Ok(bytes) => Response::from_parts(parts, Body::from(Bytes::from_owner(Counted { bytes, _memory: memory }))),
            Err(error) => Refused::new(Kind::Refused, error).into_response(),
        }
    }
}

/// Counts the answers of all requests behind it.
pub(crate) async fn count(State(memory): State<AnswerMemory>, request: Request, next: Next) -> Response {
    memory.counted(next.run(request).await).await
}

/// Bytes with the memory that they take: whoever still has a part of them has both.
struct Counted {
    bytes: Bytes,
    _memory: Reserved,
}

impl AsRef<[u8]> for Counted {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// The first bytes of a file, read as they are sent.
pub(crate) struct FileBody {
    file: File,
    left: u64,
}

impl FileBody {
    /// The answer with the bytes that the file has now.
    pub(crate) fn answer(file: std::fs::File, bytes: u64, kind: &'static str) -> Response {
        let body = Body::new(Self { file: File::from_std(file), left: bytes });
        ([(header::CONTENT_TYPE, kind.to_owned()), (header::CONTENT_LENGTH, bytes.to_string())], body).into_response()
    }
}

impl HttpBody for FileBody {
    type Data = Bytes;
    type Error = std::io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, std::io::Error>>> {
        if self.left == 0 {
            return Poll::Ready(None);
        }
        let mut part = vec![0; usize::try_from(self.left).map_or(PART, |left| left.min(PART))];
        let mut buffer = ReadBuf::new(&mut part);
        ready!(Pin::new(&mut self.file).poll_read(context, &mut buffer))?;
        let read = buffer.filled().len();
        if read == 0 {
            return Poll::Ready(Some(Err(std::io::ErrorKind::UnexpectedEof.into())));
        }
        part.truncate(read);
        self.left = self.left.saturating_sub(read as u64);
        Poll::Ready(Some(Ok(Frame::data(part.into()))))
    }
}

#[cfg(test)]
mod tests {
    use axum::body::to_bytes;
    use axum::http::StatusCode;
    use axum::response::{IntoResponse as _, Response};

    use super::{AnswerMemory, FileBody, MAX_ANSWERS, SMALL};

    #[tokio::test]
    async fn answers_share_one_bound_until_their_last_byte_is_gone() {
        let memory = AnswerMemory::new();
        let answer = |bytes: usize| memory.counted(vec![7; bytes].into_response());
        let body = async |answer: Response| to_bytes(answer.into_body(), MAX_ANSWERS).await.unwrap();
        let first = body(answer(MAX_ANSWERS / 2).await).await;
        let end = first.slice(first.len() - 1..);
        drop(first);
        let second = answer(MAX_ANSWERS / 2).await;
        assert_eq!(second.status(), StatusCode::OK);
        let refused = answer(SMALL + 1).await;
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        let text = String::from_utf8(body(refused).await.to_vec()).unwrap();
        assert!(text.contains("too many answers wait to be read: 0 of 256 MB are free"), "{text}");
        assert_eq!(answer(SMALL).await.status(), StatusCode::OK, "a short one");
        drop(end);
        assert_eq!(answer(MAX_ANSWERS / 2).await.status(), StatusCode::OK);
        drop(second);
        assert_eq!(answer(MAX_ANSWERS).await.status(), StatusCode::OK);
        assert_eq!(answer(MAX_ANSWERS + 1).await.status(), StatusCode::SERVICE_UNAVAILABLE);
    }

    #[tokio::test]
    async fn a_file_is_sent_as_it_was_and_takes_no_memory() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let bytes: Vec<u8> = (0..200_000u32).map(|k| k as u8).collect();
        std::fs::write(file.path(), [&bytes[..], b"more"].concat()).unwrap();
        let answer = |length| FileBody::answer(file.reopen().unwrap(), length, "text/csv");
        let sent = AnswerMemory::new().counted(answer(200_000)).await;
        assert_eq!(sent.headers()["content-length"], "200000");
        assert_eq!(to_bytes(sent.into_body(), usize::MAX).await.unwrap(), bytes);
        assert!(to_bytes(answer(300_000).into_body(), usize::MAX).await.is_err(), "it was cut meanwhile");
    }
}
