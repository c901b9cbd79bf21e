//! The live page: a board and its arm in a browser.
//!
//! ```text
//!  board ◄─► watcher (one thread, the only user of the client) ─► hub ─► api ─► pages
//!    ▲  ▲                         ▲ orders: play, set, upload             │
//!    │  └── other `darm` commands: guests of the port, with the rights of a page
//!    └── stop: past the watcher, from any page, at any time ◄─────────────┘
//! ```
//!
//! The watcher asks the board 20 times a second and puts what it learns into the `hub`; pages fetch it from there, and
//! a request waits a quarter of a second at most until there is something newer. A browser opens six connections to one server, and a
//! stop must never wait for a free one, so no page holds one open for what it shows; the page with control has one more, for stops
//! alone. A stop goes to the port itself, past watcher and orders, and nothing that was ordered before it is sent after it.
//!
//! The host is not in the real-time path: programs run on the board, which enforces every limit.

mod acceptor;
pub mod access;
mod answers;
mod api;
pub mod assets;
mod attached;
pub mod board_port;
pub mod connections;
mod console;
pub mod control;
mod diagnosis;
pub mod history;
mod hub;
mod job_queue;
mod made_table;
pub mod measured;
mod memory_budget;
mod order;
mod pages;
mod picture;
mod pose_reader;
mod program;
mod reach;
pub mod recording;
mod recording_api;
mod refusal;
mod replay;
mod samples;
mod served_arm;
pub mod server;
mod stop_line;
mod stops;
mod unix_time;
pub mod upload;
mod upload_memory;
mod view;
mod watcher;
