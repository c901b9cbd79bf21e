//! The server over HTTP, with the firmware's library as its board: its time passes only while somebody waits for it, or
//! lets it pass.

mod access;
mod accessible;
mod attack;
mod board;
mod browser;
mod console;
mod diagnosis;
mod editor;
mod guests;
mod history;
mod hostile;
mod http;
mod live;
mod logs;
mod measured;
mod moves;
mod page_load;
mod reach;
mod recording;
mod replay;
mod screenshots;
mod stop_line;
mod tab;
mod table;
mod webdriver;
