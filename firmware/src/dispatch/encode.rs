//! A header and a payload as a frame on the line.

use darm_core::wire::frame::{self, Header, MAX_FRAME};

use super::Frame;

pub(crate) fn encode(header: Header, payload: &[u8]) -> Option<Frame> {
    let mut frame = Frame::new();
    frame.resize_default(MAX_FRAME).ok()?;
    let len = frame::encode(header, payload, &mut frame).ok()?;
    frame.truncate(len);
    Some(frame)
}
