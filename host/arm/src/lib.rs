//! Discretely actuated arms: their files, board profiles, synthesis, reach, and the table of a list of words with its file.

pub mod arm;
pub mod board_profile;
pub mod draw;
pub mod image;
pub mod load;
pub mod new_arm;
pub mod plan;
pub mod reach;
mod stage_settings;
pub mod stops;
pub mod synthesis;
pub mod table_file;
mod toml_text;
pub mod wired_arm;
pub mod wiring_list;
