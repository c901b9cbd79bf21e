//! Grey images.
//!
//! Coordinates are in pixels: x to the right, y down, and the centre of the first pixel is (0, 0), as in OpenCV. The AprilTag
//! library counts from the corner of that pixel: its coordinates are larger by 0.5.

/// Pixels along the longer side of an image at most: a bound of the memory.
pub const MAX_SIDE: usize = 16_384;

/// An image of one channel, 8 bits a pixel, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GreyImage {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum GreyImageError {
    /// A side is zero or too long.
    #[error("an image of {width}x{height} pixels is not read, expected 1 to {MAX_SIDE} along each side")]
    Size {
        /// Pixels along a row.
        width: usize,
        /// Number of rows.
        height: usize,
    },
    /// The pixels are not as many as width times height.
    #[error("{found} bytes are no grey image of {width}x{height} pixels, expected {}", .width * .height)]
    Length {
        /// Pixels along a row.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Number of bytes.
        found: usize,
    },
}

impl GreyImage {
    /// An image of these pixels, row by row.
    ///
    /// # Errors
    ///
    /// A side is zero or too long, or the pixels are not `width * height`.
    pub fn new(width: usize, height: usize, pixels: Vec<u8>) -> Result<Self, GreyImageError> {
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(GreyImageError::Size { width, height });
        }
        if pixels.len() != width * height {
            return Err(GreyImageError::Length { width, height, found: pixels.len() });
        }
        Ok(Self { width, height, pixels })
    }

    /// Pixels along a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// The pixel in this column and row; `None` outside.
    pub fn get(&self, column: usize, row: usize) -> Option<u8> {
        (column < self.width).then(|| self.pixels.get(row * self.width + column).copied()).flatten()
    }

    /// The image as a mirror shows it, left and right exchanged.
    pub fn mirrored(&self) -> Self {
        let pixels = self.pixels.chunks(self.width).flat_map(|row| row.iter().rev().copied()).collect();
        Self { pixels, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::{GreyImage, GreyImageError};

    #[test]
    fn an_image_has_as_many_pixels_as_its_sides_say() {
        assert!(matches!(GreyImage::new(2, 2, vec![0; 3]), Err(GreyImageError::Length { found: 3, .. })));
        assert!(matches!(GreyImage::new(0, 2, vec![]), Err(GreyImageError::Size { .. })));
        let image = GreyImage::new(2, 1, vec![7, 9]).unwrap();
        assert_eq!(
            [image.get(0, 0), image.get(1, 0), image.get(2, 0), image.get(0, 1)],
            [Some(7), Some(9), None, None]
        );
        assert_eq!(image.mirrored().pixels(), [9, 7]);
    }
}
