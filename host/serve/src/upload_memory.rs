//! The memory of uploads: all of them together have a bound, whoever sends how many at once.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{FromRef, FromRequest, Request};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::refusal::{Kind, Refused};
use crate::upload::{MAX_FILES, MAX_UPLOADS};

/// Bytes that one permit is for.
const BLOCK: usize = 1 << 10;

/// What is left of the memory of uploads.
#[derive(Clone)]
pub(crate) struct UploadMemory(Arc<Semaphore>);

/// The body of a request with files; its memory is free again when this is dropped.
pub(crate) struct UploadBody {
    pub(crate) bytes: Bytes,
    _memory: OwnedSemaphorePermit,
}

impl UploadMemory {
    pub(crate) fn new() -> Self {
        Self(Arc::new(Semaphore::new(MAX_UPLOADS / BLOCK)))
    }

    /// Memory for a body of this length, before any of it is read.
    fn reserve(&self, bytes: usize) -> Result<OwnedSemaphorePermit, Refused> {
        let blocks = u32::try_from(bytes.div_ceil(BLOCK)).unwrap_or(u32::MAX);
        Arc::clone(&self.0).try_acquire_many_owned(blocks).map_err(|_| self.full(bytes))
    }

    fn full(&self, bytes: usize) -> Refused {
        let (all, wanted, free) = (MAX_UPLOADS >> 20, bytes >> 20, (self.0.available_permits() * BLOCK) >> 20);
        let text = format!(
            "other pages send files: {free} of {all} MB for files are free, and these have {wanted} MB; try again in a moment"
        );
        Refused::new(Kind::Refused, text)
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
        let memory = UploadMemory::from_ref(state).reserve(length).map_err(IntoResponse::into_response)?;
        let bytes = Bytes::from_request(request, state).await.map_err(IntoResponse::into_response)?;
        Ok(Self { bytes, _memory: memory })
    }
}

#[cfg(test)]
mod tests {
    use super::UploadMemory;
    use crate::upload::{MAX_FILES, MAX_UPLOADS};

    #[test]
    fn uploads_share_one_bound_and_give_their_memory_back() {
        let memory = UploadMemory::new();
        let reserved: Vec<_> = (0..MAX_UPLOADS / MAX_FILES).map(|_| memory.reserve(MAX_FILES).unwrap()).collect();
        let refused = memory.reserve(1).unwrap_err();
        assert!(refused.text.starts_with("other pages send files: 0 of 128 MB"), "{}", refused.text);
        drop(reserved);
        assert!(memory.reserve(MAX_FILES).is_ok());
        assert!(memory.reserve(usize::MAX).is_err());
    }
}
