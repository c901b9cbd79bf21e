//! Names the linker scripts of the start-up code and the boot stage.
#[path = "../../board_build.rs"]
mod board_build;

fn main() -> std::io::Result<()> {
    board_build::link(&["--nmagic", "-Tlink.x", "-Tlink-rp.x"])
}
