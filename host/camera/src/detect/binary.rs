//! Black and white: a threshold from the neighbourhood of each pixel, of an image in full or in half the resolution.

use crate::grey::GreyImage;

/// Pixels along a tile; the threshold of a tile is halfway between the darkest and the lightest pixel of it and its neighbours.
const TILE: usize = 4;

/// Difference of the darkest and the lightest pixel below which a neighbourhood is neither black nor white, in full and in half
/// the resolution: that of noise, whose mean over four pixels is half. A standard deviation of 4 grey levels in full resolution
/// makes a picture of nothing but noise speckled.
const MIN_CONTRAST: [u8; 2] = [24, 12];

/// What a pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Colour {
    Black,
    White,
    /// In a neighbourhood without contrast.
    Neither,
}

/// The image in full resolution, or in half of it: each pixel is then the mean of four.
pub(super) struct Level {
    /// Pixels of the image along a pixel of the level.
    pub(super) factor: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pixels: Vec<u8>,
}

/// The colours of the pixels of a level, row by row.
pub(super) struct Colours {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<Colour>,
}

impl Level {
    pub(super) fn full(image: &GreyImage) -> Self {
        Self { factor: 1, width: image.width(), height: image.height(), pixels: image.pixels().to_vec() }
    }

    pub(super) fn half(image: &GreyImage) -> Self {
        let (width, height) = (image.width() / 2, image.height() / 2);
        let mut pixels = Vec::with_capacity(width * height);
        for rows in image.pixels().chunks_exact(2 * image.width()) {
            let (upper, lower) = rows.split_at(image.width());
            pixels.extend(upper.chunks_exact(2).zip(lower.chunks_exact(2)).map(|(upper, lower)| {
                let sum: u16 = upper.iter().chain(lower).map(|pixel| u16::from(*pixel)).sum();
                ((sum + 2) / 4) as u8
            }));
        }
        Self { factor: 2, width, height, pixels }
    }

    /// The length of the gradient at a pixel, grey levels; 0 at the rim.
    pub(super) fn gradient(&self, x: usize, y: usize) -> f64 {
        if x == 0 || y == 0 || x + 1 >= self.width || y + 1 >= self.height {
            return 0.0;
        }
        let at = y * self.width + x;
        let difference = |a: usize, b: usize| f64::from(self.pixels[a]) - f64::from(self.pixels[b]);
        difference(at + 1, at - 1).hypot(difference(at + self.width, at - self.width))
    }

    pub(super) fn colours(&self) -> Colours {
        let (columns, rows) = (self.width.div_ceil(TILE), self.height.div_ceil(TILE));
        let ranges = self.tile_ranges(columns, rows);
        let mut thresholds = vec![None; columns * rows];
        for (tile, threshold) in thresholds.iter_mut().enumerate() {
            let (column, row) = (tile % columns, tile / columns);
            let (mut darkest, mut lightest) = (u8::MAX, 0);
            for near_row in row.saturating_sub(1)..=(row + 1).min(rows - 1) {
                for near_column in column.saturating_sub(1)..=(column + 1).min(columns - 1) {
                    let (low, high) = ranges[near_row * columns + near_column];
                    (darkest, lightest) = (darkest.min(low), lightest.max(high));
                }
            }
            let contrast = lightest.saturating_sub(darkest);
            *threshold = (contrast >= MIN_CONTRAST[self.factor - 1]).then(|| darkest + contrast / 2);
        }
        let mut pixels = Vec::with_capacity(self.pixels.len());
        for (y, row) in self.pixels.chunks_exact(self.width).enumerate() {
            let thresholds = &thresholds[y / TILE * columns..][..columns];
            for (tile, threshold) in row.chunks(TILE).zip(thresholds) {
                pixels.extend(tile.iter().map(|pixel| match threshold {
                    None => Colour::Neither,
                    Some(threshold) if pixel > threshold => Colour::White,
                    Some(_) => Colour::Black,
                }));
            }
        }
        Colours { width: self.width, height: self.height, pixels }
    }

    /// The darkest and the lightest pixel of each tile.
    fn tile_ranges(&self, columns: usize, rows: usize) -> Vec<(u8, u8)> {
        let mut ranges = vec![(u8::MAX, 0); columns * rows];
        for (y, row) in self.pixels.chunks_exact(self.width).enumerate() {
            let ranges = &mut ranges[y / TILE * columns..][..columns];
            for (tile, range) in row.chunks(TILE).zip(ranges) {
                for pixel in tile {
                    *range = (range.0.min(*pixel), range.1.max(*pixel));
                }
            }
        }
        ranges
    }
}
