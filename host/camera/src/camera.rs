//! A calibrated camera, and its file.
//!
//! ```toml
//! version = 1
//! width = 1280
//! height = 720
//! blur_px = 0.76          # median of the views: sharper than this no picture is expected to be
//! reprojection_px = 0.041 # root mean square of all views
//! noise_scale = 1.08      # χ² of the corners by its degrees of freedom
//! parameters = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]
//! values = [900.1, …]     # px and 1, see the lens model
//! covariance = [[0.02, …], …]
//! ```

use std::path::{Path, PathBuf};

use nalgebra::{Cholesky, SMatrix, SVector};
use serde::{Deserialize, Serialize};

use crate::lens::{Lens, LensError, NAMES, PARAMETERS};

/// Version of the format.
const VERSION: u32 = 1;

/// A camera with its lens and what its pictures are like.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    width: usize,
    height: usize,
    lens: Lens,
    covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
    blur_px: f64,
    reprojection_px: f64,
    noise_scale: f64,
}

/// Quality of the pictures that a camera was calibrated with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Median width of the blur, px.
    pub blur_px: f64,
    /// Root mean square of the distance between seen and predicted corners, px.
    pub reprojection_px: f64,
    /// χ² of the corners by its degrees of freedom.
    pub noise_scale: f64,
}

/// Why values are no camera.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CameraError {
    /// The lens is impossible.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The covariance is none.
    #[error("the covariance of the lens is not symmetric and positive definite; calibrate again")]
    Covariance,
    /// A number is not one that a calibration writes.
    #[error("{name} is {value}, expected a positive number; calibrate again")]
    Number {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A later or unknown format.
    #[error("version {found} of the format is not read, expected {VERSION}")]
    Version {
        /// The version in the file.
        found: u32,
    },
    /// Other parameters than those of the lens model.
    #[error("the parameters are not {}", NAMES.join(", "))]
    Parameters,
}

/// Why a file is no camera.
#[derive(Debug, thiserror::Error)]
pub enum CameraFileError {
    /// It cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is not TOML of this format.
    #[error("{path}: {source}")]
    Toml {
        /// The file.
        path: PathBuf,
        /// With line and column.
        source: Box<toml::de::Error>,
    },
    /// Its values are no camera.
    #[error("{path}: {source}")]
    Value {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: CameraError,
    },
}

/// The file as it is written.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Document {
    version: u32,
    width: usize,
    height: usize,
    blur_px: f64,
    reprojection_px: f64,
    noise_scale: f64,
    parameters: [String; PARAMETERS],
    values: [f64; PARAMETERS],
    covariance: [[f64; PARAMETERS]; PARAMETERS],
}

impl Camera {
    /// A camera with pictures of this size.
    ///
    /// # Errors
    ///
    /// The covariance is not symmetric and positive definite, or a number is not positive.
    pub fn new(
        [width, height]: [usize; 2],
        lens: Lens,
        covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
        quality: Quality,
    ) -> Result<Self, CameraError> {
        let Quality { blur_px, reprojection_px, noise_scale } = quality;
        let positive = [
            ("width", width as f64),
            ("height", height as f64),
            ("blur_px", blur_px),
            ("reprojection_px", reprojection_px),
            ("noise_scale", noise_scale),
        ];
        if let Some((name, value)) = positive.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return Err(CameraError::Number { name, value });
        }
        let is_symmetric = (covariance - covariance.transpose()).abs().max() <= 1e-6 * covariance.abs().max();
        if !is_symmetric || Cholesky::new(covariance).is_none() {
            return Err(CameraError::Covariance);
        }
        Ok(Self { width, height, lens, covariance, blur_px, reprojection_px, noise_scale })
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// It cannot be read, or is no camera.
    pub fn read(path: &Path) -> Result<Self, CameraFileError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| CameraFileError::Read { path: path.to_owned(), source })?;
        let document: Document = toml::from_str(&text)
            .map_err(|source| CameraFileError::Toml { path: path.to_owned(), source: Box::new(source) })?;
        Self::from_document(&document).map_err(|source| CameraFileError::Value { path: path.to_owned(), source })
    }

    fn from_document(document: &Document) -> Result<Self, CameraError> {
        if document.version != VERSION {
            return Err(CameraError::Version { found: document.version });
        }
        if document.parameters != NAMES {
            return Err(CameraError::Parameters);
        }
        let lens = Lens::new(&SVector::from(document.values))?;
        let covariance = SMatrix::from_row_iterator(document.covariance.iter().flatten().copied());
        let Document { blur_px, reprojection_px, noise_scale, .. } = *document;
        let quality = Quality { blur_px, reprojection_px, noise_scale };
        Self::new([document.width, document.height], lens, covariance, quality)
    }

    /// The text of its file.
    ///
    /// # Errors
    ///
    /// A number cannot be written in TOML.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        let entry = |k: usize| [0, 1, 2, 3, 4, 5, 6, 7].map(|j| self.covariance[(k, j)]);
        toml::to_string(&Document {
            version: VERSION,
            width: self.width,
            height: self.height,
            blur_px: self.blur_px,
            reprojection_px: self.reprojection_px,
            noise_scale: self.noise_scale,
            parameters: NAMES.map(str::to_owned),
            values: self.lens.parameters().into(),
            covariance: [0, 1, 2, 3, 4, 5, 6, 7].map(entry),
        })
    }

    /// Width and height of its pictures, px.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Its lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// Covariance of the lens's parameters.
    pub fn covariance(&self) -> &SMatrix<f64, PARAMETERS, PARAMETERS> {
        &self.covariance
    }

    /// What its pictures were like.
    pub fn quality(&self) -> Quality {
        let Self { blur_px, reprojection_px, noise_scale, .. } = *self;
        Quality { blur_px, reprojection_px, noise_scale }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};

    use super::{Camera, CameraError, CameraFileError, Quality};
    use crate::lens::Lens;

    fn camera() -> Camera {
        let lens = Lens::new(&SVector::from([900.0, 905.5, 640.25, 350.0, -0.25, 0.08, 1e-3, -5e-4])).unwrap();
        let quality = Quality { blur_px: 0.8, reprojection_px: 0.04, noise_scale: 1.1 };
        Camera::new([1280, 720], lens, SMatrix::identity() * 0.01, quality).unwrap()
    }

    #[test]
    fn a_file_that_is_read_again_is_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.toml");
        let text = camera().to_toml().unwrap();
        std::fs::write(&path, &text).unwrap();
        assert_eq!(Camera::read(&path).unwrap(), camera());
        std::fs::write(&path, text.replace("900.0", "-900.0")).unwrap();
        assert!(matches!(Camera::read(&path), Err(CameraFileError::Value { source: CameraError::Lens(_), .. })));
        std::fs::write(&path, &text[..text.len() / 2]).unwrap();
        assert!(matches!(Camera::read(&path), Err(CameraFileError::Toml { .. })));
    }

    #[test]
    fn a_covariance_is_positive_definite() {
        let wrong = Camera::new([1280, 720], *camera().lens(), -SMatrix::identity(), camera().quality());
        assert_eq!(wrong.unwrap_err(), CameraError::Covariance);
    }
}
