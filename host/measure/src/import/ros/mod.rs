//! Logs of ROS 2: MCAP files with messages in CDR or JSON, and bag folders.

pub(crate) mod bag;
mod cdr;
pub(crate) mod log;
mod message;
