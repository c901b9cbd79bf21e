//! Names the linker scripts of the start-up code.
#[path = "../../board_build.rs"]
mod board_build;

fn main() -> std::io::Result<()> {
    board_build::link(&["--nmagic", "-Tlink.x"])
}
