//! Borders between a black and a white region of connected pixels.

use super::binary::{Colour, Colours};

/// Pixels that a region must have.
const MIN_REGION: u32 = 25;

/// Points that the border of a tag has at least.
const MIN_POINTS: usize = 24;

/// A point halfway between a black and a white pixel, in half pixels, with the direction from black to white.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BorderPoint {
    pub(super) x2: u32,
    pub(super) y2: u32,
    pub(super) to_white: [i8; 2],
}

/// Regions of connected pixels: each pixel points towards the first of its region.
struct Regions {
    parent: Vec<u32>,
    size: Vec<u32>,
}

impl Regions {
    /// Black pixels are connected by sides, white ones by corners as well, so that two regions never cross.
    fn new(colours: &Colours) -> Self {
        let Colours { width, ref pixels, .. } = *colours;
        let mut regions = Self { parent: (0..pixels.len() as u32).collect(), size: vec![1; pixels.len()] };
        for (at, colour) in pixels.iter().enumerate() {
            if *colour == Colour::Neither {
                continue;
            }
            let (x, above) = (at % width, at.checked_sub(width));
            if x > 0 && pixels[at - 1] == *colour {
                regions.join(at, at - 1);
            }
            let Some(above) = above else { continue };
            if pixels[above] == *colour {
                regions.join(at, above);
            } else if *colour == Colour::White {
                // With the pixel above, both diagonal ones are already in the region.
                if x > 0 && pixels[above - 1] == *colour {
                    regions.join(at, above - 1);
                }
                if x + 1 < width && pixels[above + 1] == *colour {
                    regions.join(at, above + 1);
                }
            }
        }
        regions
    }

    fn first(&mut self, mut at: usize) -> usize {
        while self.parent[at] as usize != at {
            let above = self.parent[self.parent[at] as usize];
            self.parent[at] = above;
            at = above as usize;
        }
        at
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first(a), self.first(b));
        if a == b {
            return;
        }
        let (large, small) = if self.size[a] >= self.size[b] { (a, b) } else { (b, a) };
        self.parent[small] = large as u32;
        self.size[large] += self.size[small];
    }
}

/// The borders between all pairs of regions that are large enough, each a set of points in no order.
pub(super) fn borders(colours: &Colours) -> Vec<Vec<BorderPoint>> {
    let Colours { width, height, ref pixels } = *colours;
    let mut regions = Regions::new(colours);
    let firsts: Vec<u32> = (0..pixels.len()).map(|at| regions.first(at) as u32).collect();
    let mut points: Vec<(u64, BorderPoint)> = Vec::new();
    for y in 0..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let at = y * width + x;
            if pixels[at] == Colour::Neither || regions.size[firsts[at] as usize] < MIN_REGION {
                continue;
            }
            for (right, down) in [(1, 0), (0, 1), (-1, 1), (1, 1)] {
                let other = (at + down * width).wrapping_add_signed(right);
                let toward_white = match (pixels[at], pixels[other]) {
                    (Colour::Black, Colour::White) => 1,
                    (Colour::White, Colour::Black) => -1,
                    _ => continue,
                };
                let (a, b) = (firsts[at].min(firsts[other]), firsts[at].max(firsts[other]));
                if regions.size[firsts[other] as usize] < MIN_REGION {
                    continue;
                }
                let x2 = (2 * x).wrapping_add_signed(right) as u32;
                let to_white = [toward_white * right as i8, toward_white * down as i8];
                points
                    .push((u64::from(a) << 32 | u64::from(b), BorderPoint { x2, y2: (2 * y + down) as u32, to_white }));
            }
        }
    }
    // The sort is stable: each border keeps its points row by row, and the result does not depend on the sort.
    points.sort_by_key(|(regions, _)| *regions);
    let longest = 3 * 2 * (width + height);
    let of_one_border = points.chunk_by(|a, b| a.0 == b.0);
    let possible = of_one_border.filter(|points| (MIN_POINTS..=longest).contains(&points.len()));
    possible.map(|points| points.iter().map(|(_, point)| *point).collect()).collect()
}
