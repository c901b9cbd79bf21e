//! Collecting views of the board from pictures until they determine the lens: what is used, what is refused and why, and which
//! views are missing.

use darm_core::real::Vec2;

use crate::calibrate::{CalibrateError, Calibration, calibrate, guess};
use crate::camera::{Camera, CameraError, Quality};
use crate::grey::GreyImage;
use crate::missing_views::{Coverage, MIN_VIEWS, Missing, is_one_tilt, missing_tilts, spread_rad};
use crate::target::Target;
use crate::view::{View, ViewError};

/// Views that are kept at most, with their pictures: more add little, and memory is bounded.
const MAX_VIEWS: usize = 60;

/// Pictures that are listed as unusable at most.
const MAX_UNUSABLE: usize = 200;

/// A view whose corners are all this close to those of one that is kept is the same one, px: a camera's video repeats itself.
const SAME_VIEW_PX: f64 = 15.0;

/// Times that edges are fitted again with the lens of the fit before. The first lens is off by what bent edges move corners,
/// the second by a hundredth of that.
const REFINEMENTS: usize = 2;

/// Largest deviation of a focal length, as a part of it, with which a calibration is of use: an error of 0.5 mm in every 100 mm.
const MAX_FOCAL_DEVIATION: f64 = 0.005;

/// What became of a picture.
#[derive(Debug)]
pub enum Outcome {
    /// It is a view.
    Used,
    /// It shows the board where another one shows it.
    Repeated,
    /// There are enough views.
    Full,
    /// It is no view.
    Unusable,
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// Too few usable views.
    #[error("{found} usable views, expected at least {MIN_VIEWS}; {}", wanted(.missing))]
    FewViews {
        /// Usable views.
        found: usize,
        /// What is missing.
        missing: Vec<Missing>,
    },
    /// A picture of another size.
    #[error("{name} has {}x{} pixels, the pictures before {}x{}; give pictures of one camera and one resolution", .found[0], .found[1], .expected[0], .expected[1])]
    Size {
        /// Name of the picture.
        name: String,
        /// Its size.
        found: [usize; 2],
        /// The size of those before.
        expected: [usize; 2],
    },
    /// All views show the board in one direction.
    #[error("all views show the board tilted alike, within {spread_deg:.0}°: that does not determine the focal length; {}", wanted(.missing))]
    OneTilt {
        /// Largest angle between two views.
        spread_deg: f64,
        /// What is missing.
        missing: Vec<Missing>,
    },
    /// The board was never in some parts of the picture.
    #[error("the board does not cover the picture, and distortion is not known where it was not seen; {}", wanted(.missing))]
    Uncovered {
        /// What is missing.
        missing: Vec<Missing>,
    },
    /// The views leave the focal length uncertain.
    #[error("the focal length is known to {percent:.1} % only; {}", wanted(.missing))]
    Uncertain {
        /// Standard deviation.
        percent: f64,
        /// What is missing.
        missing: Vec<Missing>,
    },
    /// The fit failed.
    #[error(transparent)]
    Fit(#[from] CalibrateError),
    /// The result is no camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

fn wanted(missing: &[Missing]) -> String {
    if missing.is_empty() {
        return "add views with other tilts and distances".into();
    }
    let all: Vec<String> = missing.iter().map(ToString::to_string).collect();
    format!("add {}", all.join("; "))
}

/// A picture with the view that it is.
struct Kept {
    name: String,
    image: GreyImage,
    view: View,
}

/// Collects views.
pub struct Collector {
    target: Target,
    size: Option<[usize; 2]>,
    kept: Vec<Kept>,
    unusable: Vec<(String, ViewError)>,
    coverage: Coverage,
}

/// A calibrated camera with how well it fits each picture.
#[derive(Debug)]
pub struct Report {
    /// The camera.
    pub camera: Camera,
    /// The fit.
    pub calibration: Calibration,
    /// Names of the pictures that were used, in the order of the fit.
    pub used: Vec<String>,
    /// Pictures that were not, with the reason.
    pub unusable: Vec<(String, ViewError)>,
    /// Views that would make it better.
    pub missing: Vec<Missing>,
}

impl Collector {
    /// Collects views of this target.
    pub fn new(target: Target) -> Self {
        let (kept, unusable) = (Vec::new(), Vec::new());
        Self { target, size: None, kept, unusable, coverage: Coverage::default() }
    }

    /// Takes a picture.
    ///
    /// # Errors
    ///
    /// It has another size than those before.
    pub fn add(&mut self, name: &str, image: GreyImage) -> Result<Outcome, Refusal> {
        let found = [image.width(), image.height()];
        let expected = *self.size.get_or_insert(found);
        if found != expected {
            return Err(Refusal::Size { name: name.to_owned(), found, expected });
        }
        if self.kept.len() >= MAX_VIEWS {
            return Ok(Outcome::Full);
        }
        let view = match View::find(&image, &self.target, None) {
            Ok(view) => view,
            Err(error) => {
                if self.unusable.len() < MAX_UNUSABLE {
                    self.unusable.push((name.to_owned(), error));
                }
                return Ok(Outcome::Unusable);
            }
        };
        if self.kept.iter().any(|kept| is_same(&kept.view, &view)) {
            return Ok(Outcome::Repeated);
        }
        view.pairs().for_each(|(_, pixel)| self.coverage.add(&pixel, found[0], found[1]));
        self.kept.push(Kept { name: name.to_owned(), image, view });
        Ok(Outcome::Used)
    }

    /// Number of views.
    pub fn views(&self) -> usize {
        self.kept.len()
    }

    /// Why the last picture was unusable.
    pub fn last_error(&self) -> Option<&ViewError> {
        self.unusable.last().map(|(_, error)| error)
    }

    /// What is missing so far.
    pub fn missing(&self) -> Vec<Missing> {
        let few = MIN_VIEWS.saturating_sub(self.kept.len());
        let count = (few > 0).then_some(Missing::Views { count: few });
        let views: Vec<View> = self.kept.iter().map(|kept| kept.view.clone()).collect();
        let [width, height] = self.size.unwrap_or([1, 1]);
        let poses = guess(&views, width, height).map(|(_, poses)| poses).unwrap_or_default();
        count.into_iter().chain(self.coverage.missing()).chain(missing_tilts(&poses)).collect()
    }

    /// Calibrates the camera.
    ///
    /// # Errors
    ///
    /// The views do not determine its lens.
    pub fn finish(self) -> Result<Report, Refusal> {
        let missing = self.missing();
        let Self { kept, unusable, coverage, size, .. } = self;
        let found = kept.len();
        let Some(size) = size.filter(|_| found >= MIN_VIEWS) else {
            return Err(Refusal::FewViews { found, missing });
        };
        let mut views: Vec<View> = kept.iter().map(|kept| kept.view.clone()).collect();
        let (lens, poses) = guess(&views, size[0], size[1])?;
        if is_one_tilt(&poses) {
            return Err(Refusal::OneTilt { spread_deg: spread_rad(&poses).to_degrees(), missing });
        }
        if !coverage.missing().is_empty() {
            return Err(Refusal::Uncovered { missing });
        }
        let mut calibration = calibrate(&views, lens, poses)?;
        for _ in 0..REFINEMENTS {
            views = kept.iter().map(|kept| kept.view.refined(&kept.image, &calibration.lens)).collect();
            calibration = calibrate(&views, calibration.lens, calibration.poses)?;
        }
        let deviation = calibration.deviations()[0] / calibration.lens.parameters()[0];
        let is_certain = deviation <= MAX_FOCAL_DEVIATION;
        if !is_certain {
            return Err(Refusal::Uncertain { percent: 100.0 * deviation, missing });
        }
        let mut blurs: Vec<f64> = views.iter().map(|view| view.blur_px).collect();
        blurs.sort_by(f64::total_cmp);
        let Calibration { overall_px, noise_scale, lens, covariance, .. } = calibration;
        let quality = Quality { blur_px: blurs[found / 2], reprojection_px: overall_px, noise_scale };
        let camera = Camera::new(size, lens, covariance, quality)?;
        let used = kept.into_iter().map(|kept| kept.name).collect();
        Ok(Report { camera, calibration, used, unusable, missing })
    }
}

/// Whether two views show the board at the same place.
fn is_same(first: &View, second: &View) -> bool {
    let near = |a: &Vec2<f64>, b: &Vec2<f64>| (a - b).norm() < SAME_VIEW_PX;
    let mut both = first.tags.iter().filter_map(|a| Some((a, second.tags.iter().find(|b| b.id == a.id)?))).peekable();
    both.peek().is_some() && both.all(|(a, b)| a.corners.pixels.iter().zip(&b.corners.pixels).all(|(a, b)| near(a, b)))
}
