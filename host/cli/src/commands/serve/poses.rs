//! Measured poses for the live page: the sources of `darm calibrate --poses`.

use darm_serve::measured::{MeasuredPose, PoseReader, PoseSource};

use crate::commands::camera_lines::Picture;
use crate::commands::record::Camera;
use crate::port::emulated_camera;

/// The camera of `darm sim`.
const SIMULATOR: &str = "sim";

/// The source of this name; it is opened again after it was lost.
pub(super) fn source(name: &str) -> PoseSource {
    let opened = name.to_owned();
    PoseSource { name: name.to_owned(), open: Box::new(move || open(&opened)) }
}

fn open(name: &str) -> Result<Box<dyn PoseReader>, String> {
    let simulator = || emulated_camera().ok_or("no simulator runs; start `darm sim` in another terminal");
    let camera = if name == SIMULATOR { simulator()? } else { name.to_owned() };
    let camera = Camera::open(&camera).map_err(|error| error.to_string())?;
    Ok(Box::new(Reader(camera)))
}

struct Reader(Camera);

impl PoseReader for Reader {
    fn read(&mut self) -> Result<Vec<MeasuredPose>, String> {
        // What arrived before the end is read below.
        let is_closed = self.0.is_closed();
        self.0.poll().map_err(|error| error.to_string())?;
        let pose = |picture: &Picture| MeasuredPose {
            time_s: picture.time_s,
            pose: picture.pose,
            supply_bar: picture.supply_bar,
            temperature_c: picture.temperature_c,
        };
        let poses: Vec<MeasuredPose> = self.0.pictures().iter().map(pose).collect();
        self.0.forget_before(f64::INFINITY);
        if is_closed && poses.is_empty() {
            return Err(format!("{} was closed by the other end", self.0.name()));
        }
        Ok(poses)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // Ends the thread that reads the socket; what it still had to say is not wanted.
        let _ = self.0.finish();
    }
}
