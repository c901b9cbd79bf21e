//! A camera over the plant: time-stamped frames at a fixed rate.
//!
//! A frame holds where the actuators are; which tool pose that is, with which noise, the owner of the true arm computes.

use std::sync::{Arc, Mutex, PoisonError};

use super::{Plant, PlantState};

/// Time between two frames.
pub const PERIOD_S: f64 = 0.02;

/// One picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Host time of the exposure.
    pub at_s: f64,
    /// What stood before the camera.
    pub state: PlantState,
}

/// Frames that one thread takes and others read. Clones see the same frames.
#[derive(Clone, Debug, Default)]
pub struct Film {
    frames: Arc<Mutex<Vec<Frame>>>,
}

impl Film {
    /// Adds a frame.
    fn push(&self, frame: Frame) {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner).push(frame);
    }

    /// Takes all frames so far and leaves none.
    pub fn take(&self) -> Vec<Frame> {
        std::mem::take(&mut self.frames.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The last frame at rest that was taken between two host times.
    pub fn at_rest_between(&self, from_s: f64, to_s: f64) -> Option<Frame> {
        let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let within = |frame: &&Frame| (from_s..to_s).contains(&frame.at_s) && !frame.state.moving;
        frames.iter().rev().find(within).cloned()
    }
}

/// Takes the frames that are due.
#[derive(Clone, Debug, Default)]
pub struct Camera {
    film: Film,
    due_s: f64,
}

impl Camera {
    /// What it has taken and will take.
    pub fn film(&self) -> Film {
        self.film.clone()
    }

    /// When the next frame is due.
    pub fn due_s(&self) -> f64 {
        self.due_s
    }

    /// Takes a frame if one is due; a camera that comes late leaves frames out rather than piling them up.
    pub fn look(&mut self, now_s: f64, plant: &Plant) {
        if now_s >= self.due_s {
            self.film.push(Frame { at_s: now_s, state: plant.state() });
            let late = now_s > self.due_s + PERIOD_S;
            self.due_s = PERIOD_S + if late { now_s } else { self.due_s };
        }
    }
}

#[cfg(test)]
mod tests {
    use darm_core::output::Wiring;

    use super::Camera;
    use crate::plant::Plant;

    #[test]
    fn fifty_frames_a_second_and_none_piled_up() {
        let plant = Plant::new(&Wiring::default(), &[]);
        let mut camera = Camera::default();
        (0..1000).for_each(|ms| camera.look(1e-3 * f64::from(ms), &plant));
        assert_eq!(camera.film().take().len(), 50);
        camera.look(10.0, &plant);
        camera.look(10.001, &plant);
        assert_eq!(camera.film().take().len(), 1);
        assert!(camera.film().at_rest_between(0.0, 99.0).is_none());
    }
}
