//! A k-d tree over the products of two sets of frames, without storing the products.
//!
//! # Points
//!
//! A pose with position p and unit quaternion q is the point x = (p, 2ℓq) in seven dimensions. Of q and −q,
//! which are the same rotation, the one nearer to a quaternion of reference is stored; a query asks for both.
//!
//! # Bound
//!
//! The chord between unit quaternions an angle φ apart is c = 2 sin(φ/2) ≤ φ, and the rotation between them turns by
//! θ = 2φ. Hence 2ℓc ≤ ℓθ, and |x − x'| ≤ d with d² = |Δp|² + ℓ²θ²: what lies outside a ball in the seven dimensions
//! is further away than its radius. For small angles both are equal up to θ³/96·ℓ, so little more is looked at than
//! has to be.
//!
//! # Layout
//!
//! A product is a number of its two factors, 4 bytes, in the order of the leaves; its point is computed when it is
//! looked at. The upper splits come from a sample, so that all products are sorted into buckets in one pass; the
//! splits of a bucket come from a sample of it, and its products are sorted into its leaves, one bucket in the cache at a time.
//!
//! Splits have the numbers of a heap: 1 is the root, 2n and 2n + 1 are below n. Those above the buckets are stored first, then
//! those of each bucket, so that a descent touches few lines of the cache.

mod grow;
mod probe;

use darm_core::se::Pose;
use nalgebra::{Rotation3, UnitQuaternion};

pub(super) use self::probe::{Cell, Probe};
use super::frames::Frames;

/// Coordinates of a point: three of the position, four of the quaternion.
const DIMS: usize = 7;

/// A point: position, and 2ℓ times the quaternion w, x, y, z.
type Point = [f32; DIMS];

/// Points with a smaller coordinate `dim` than `at` are left of it.
#[derive(Clone, Copy, Debug, Default)]
struct Split {
    dim: u32,
    at: f32,
}

/// The corners of the box around the points of a leaf, in 255ths of the box around its bucket, rounded outward.
#[derive(Clone, Copy, Debug, Default)]
struct LeafBox([[u8; DIMS]; 2]);

impl LeafBox {
    fn new([low, high]: &[Point; 2], [from, to]: &[Point; 2]) -> Self {
        let part = |x: f32, dim: usize| 255.0 * (x - from[dim]) / (to[dim] - from[dim]).max(f32::MIN_POSITIVE);
        Self([
            std::array::from_fn(|dim| part(low[dim], dim).floor() as u8),
            std::array::from_fn(|dim| part(high[dim], dim).ceil() as u8),
        ])
    }

    /// The square of its distance from a point.
    #[inline]
    fn distance_squared(&self, point: &Point, [from, to]: &[Point; 2]) -> f32 {
        let Self([low, high]) = self;
        let outside = |dim: usize| {
            let (part, at) = ((to[dim] - from[dim]) / 255.0, point[dim] - from[dim]);
            (f32::from(low[dim]) * part - at).max(at - f32::from(high[dim]) * part).max(0.0)
        };
        (0..DIMS).map(outside).map(|outside| outside * outside).sum()
    }
}

/// The left factor of a product in `f32`.
#[derive(Clone, Copy, Debug)]
struct Left {
    rotation: [[f32; 3]; 3],
    position: [f32; 3],
    quaternion: [f32; 4],
}

/// The right factor.
#[derive(Clone, Copy, Debug)]
struct Right {
    position: [f32; 3],
    quaternion: [f32; 4],
}

/// The products of two sets of frames, ready to be searched.
#[derive(Debug)]
pub(in crate::reach) struct Tree {
    lefts: Vec<Left>,
    rights: Vec<Right>,
    /// A product's number is `left << right_bits | right`.
    right_bits: u32,
    /// Twice the length scale ℓ, m.
    chord_scale: f32,
    reference: [f32; 4],
    /// Levels of splits above the buckets, and within a bucket.
    bucket_levels: u32,
    leaf_levels: u32,
    splits: Vec<Split>,
    /// Where the products of each leaf begin, and of the last one end.
    starts: Vec<u32>,
    order: Vec<u32>,
    /// The corners of the box around the products of each bucket, and of all.
    boxes: Vec<[Point; 2]>,
    leaf_boxes: Vec<LeafBox>,
    corners: [Point; 2],
}

/// The corners of a box around nothing.
const NOTHING: [Point; 2] = [[f32::INFINITY; DIMS], [f32::NEG_INFINITY; DIMS]];

/// The quaternion w, x, y, z of a pose.
fn quaternion(pose: &Pose<f64>) -> [f64; 4] {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
    [q.w, q.i, q.j, q.k]
}

impl Tree {
    /// The tree of all products `left · right`, with one radian as far as `length_scale_m`; `None` where `go_on` says no before it
    /// is complete.
    ///
    /// There must be fewer than 2³² products, and of the numbers of bits of both counts.
    pub(in crate::reach) fn new(
        left: &Frames,
        right: &Frames,
        length_scale_m: f64,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Option<Self> {
        let right_bits = usize::BITS - (right.len() - 1).leading_zeros();
        let reference = left.poses.first().map_or(Pose::identity(), |pose| *pose)
            * right.poses.first().map_or(Pose::identity(), |pose| *pose);
        let mut tree = Self {
            lefts: left.poses.iter().map(Left::new).collect(),
            rights: right.poses.iter().map(Right::new).collect(),
            right_bits,
            chord_scale: 2.0 * length_scale_m as f32,
            reference: quaternion(&reference).map(|q| q as f32),
            bucket_levels: 0,
            leaf_levels: 0,
            splits: Vec::new(),
            starts: Vec::new(),
            order: Vec::new(),
            boxes: Vec::new(),
            leaf_boxes: Vec::new(),
            corners: NOTHING,
        };
        tree.set_reference();
        tree.grow(go_on).then_some(tree)
    }

    /// Bytes that the tree takes.
    pub(in crate::reach) fn bytes(&self) -> usize {
        let tree = size_of_val(&*self.splits) + size_of_val(&*self.starts) + size_of_val(&*self.order);
        let boxes = size_of_val(&*self.boxes) + size_of_val(&*self.leaf_boxes);
        tree + boxes + size_of_val(&*self.lefts) + size_of_val(&*self.rights)
    }

    /// Left and right factor of a product.
    pub(in crate::reach) fn factors(&self, product: u32) -> (usize, usize) {
        ((product >> self.right_bits) as usize, (product & ((1 << self.right_bits) - 1)) as usize)
    }

    /// How many products there are.
    pub(in crate::reach) fn len(&self) -> usize {
        self.lefts.len() * self.rights.len()
    }

    /// The split of this number.
    #[inline]
    fn split(&self, number: usize) -> Split {
        let level = usize::BITS - 1 - number.leading_zeros();
        let Some(below) = level.checked_sub(self.bucket_levels) else { return self.splits[number] };
        let bucket = number >> below;
        let within = 1 << below | (number & ((1 << below) - 1));
        self.splits[(bucket << self.leaf_levels) - (((1 << self.leaf_levels) - 1) << self.bucket_levels) + within]
    }

    #[inline]
    fn is_leaf(&self, number: u32) -> bool {
        number >> (self.bucket_levels + self.leaf_levels) != 0
    }

    /// The products of the leaf of this number.
    #[inline]
    fn leaf(&self, number: u32) -> &[u32] {
        let leaf = (number as usize) - (1 << (self.bucket_levels + self.leaf_levels));
        &self.order[self.starts[leaf] as usize..self.starts[leaf + 1] as usize]
    }

    /// Reads the ends of leaves that are searched next: the memory fetches all of them at once, where a search would wait for each.
    pub(in crate::reach) fn fetch(&self, leaves: impl Iterator<Item = u32>) {
        let ends = leaves.map(|number| {
            let leaf = self.leaf(number);
            leaf.first().copied().unwrap_or(0) ^ leaf.last().copied().unwrap_or(0)
        });
        std::hint::black_box(ends.fold(0, |all, end| all ^ end));
    }

    fn product(&self, index: usize) -> u32 {
        (((index / self.rights.len()) << self.right_bits) | (index % self.rights.len())) as u32
    }

    /// The rotation that the others lie around: the sum of a sample of quaternions, each with the sign of the first.
    fn set_reference(&mut self) {
        let mut sum = [0.0; 4];
        for index in (0..self.len()).step_by((self.len() / 1024).max(1)) {
            let point = self.point(self.product(index));
            sum.iter_mut().zip(&point[3..]).for_each(|(sum, q)| *sum += q);
        }
        if sum.iter().any(|q| *q != 0.0) {
            self.reference = sum;
        }
    }

    #[inline]
    fn point(&self, product: u32) -> Point {
        let (left, right) = self.factors(product);
        let (left, right) = (&self.lefts[left], &self.rights[right]);
        let p = left.carry(&right.position);
        let q = self.signed(hamilton(&left.quaternion, &right.quaternion));
        [p[0], p[1], p[2], q[0], q[1], q[2], q[3]]
    }

    /// 2ℓ times the quaternion, of its two signs the one nearer to the reference.
    #[inline]
    fn signed(&self, q: [f32; 4]) -> [f32; 4] {
        let r = &self.reference;
        let same = q[0] * r[0] + q[1] * r[1] + q[2] * r[2] + q[3] * r[3];
        let scale = if same < 0.0 { -self.chord_scale } else { self.chord_scale };
        q.map(|q| scale * q)
    }
}

impl Left {
    fn new(pose: &Pose<f64>) -> Self {
        let r = &pose.rotation;
        Self {
            rotation: [0, 1, 2].map(|row| [0, 1, 2].map(|column| r[(row, column)] as f32)),
            position: [0, 1, 2].map(|row| pose.position[row] as f32),
            quaternion: quaternion(pose).map(|q| q as f32),
        }
    }

    #[inline]
    fn carry(&self, p: &[f32; 3]) -> [f32; 3] {
        let row = |row: usize| {
            let r = &self.rotation[row];
            self.position[row] + (r[0] * p[0] + r[1] * p[1] + r[2] * p[2])
        };
        [row(0), row(1), row(2)]
    }
}

impl Right {
    fn new(pose: &Pose<f64>) -> Self {
        Self {
            position: [0, 1, 2].map(|row| pose.position[row] as f32),
            quaternion: quaternion(pose).map(|q| q as f32),
        }
    }
}

/// The product of two quaternions w, x, y, z.
#[inline]
fn hamilton(a: &[f32; 4], b: &[f32; 4]) -> [f32; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}
