//! A k-d tree over the products of two sets of frames, without storing the products.
//!
//! # Points
//!
//! A pose with position p and unit quaternion q stands as the point x = (p, 2ℓq) in seven dimensions. Of q and −q,
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
//! looked at. The upper splits come from a sample, so that all products are sorted into buckets in one pass; each
//! bucket is then split near its medians down to the leaves, one bucket in the cache at a time.

use darm_core::se::Pose;
use nalgebra::{Rotation3, UnitQuaternion};
use rayon::prelude::*;

use super::frames::Frames;

/// Coordinates of a point: three of the position, four of the quaternion.
pub(super) const DIMS: usize = 7;

/// A point: position, and 2ℓ times the quaternion w, x, y, z.
pub(super) type Point = [f32; DIMS];

/// Most products in a leaf.
const LEAF: usize = 32;
/// Products in a bucket, about: what fits the cache of a core as points.
const BUCKET: usize = 4096;
/// Products of the sample for one bucket.
const SAMPLES: usize = 32;
/// Points that a split looks at to find its dimension and place.
const LOOKS: usize = 32;
/// Products that are sorted into buckets side by side.
const ABREAST: usize = 16;

/// What a node of the tree is.
#[derive(Clone, Copy, Debug)]
enum Node {
    /// Left of `at` in `dim` is the next node, right of it the node `right`.
    Split { dim: u8, at: f32, right: u32 },
    /// The products `first .. first + len` in the order of the leaves.
    Leaf { len: u8, first: u32 },
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
pub(super) struct Tree {
    lefts: Vec<Left>,
    rights: Vec<Right>,
    /// A product's number is `left << right_bits | right`.
    right_bits: u32,
    /// Twice the length scale ℓ, m.
    chord_scale: f32,
    reference: [f32; 4],
    nodes: Vec<Node>,
    order: Vec<u32>,
    low: Point,
    high: Point,
}

/// A split above the buckets.
#[derive(Clone, Copy, Debug)]
struct Upper {
    dim: u32,
    at: f32,
}

/// A product while the tree grows.
#[derive(Clone, Copy)]
struct Entry {
    point: Point,
    product: u32,
}

/// The quaternion w, x, y, z of a pose.
pub(super) fn quaternion(pose: &Pose<f64>) -> [f64; 4] {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
    [q.w, q.i, q.j, q.k]
}

impl Tree {
    /// The tree of all products `left · right`, with one radian as far as `length_scale_m`.
    ///
    /// There must be fewer than 2³² products, and of the numbers of bits of both counts.
    pub(super) fn new(left: &Frames, right: &Frames, length_scale_m: f64) -> Self {
        let right_bits = usize::BITS - (right.len() - 1).leading_zeros();
        let reference = left.poses.first().map_or(Pose::identity(), |pose| *pose)
            * right.poses.first().map_or(Pose::identity(), |pose| *pose);
        let mut tree = Self {
            lefts: left.poses.iter().map(Left::new).collect(),
            rights: right.poses.iter().map(Right::new).collect(),
            right_bits,
            chord_scale: 2.0 * length_scale_m as f32,
            reference: quaternion(&reference).map(|q| q as f32),
            nodes: Vec::new(),
            order: Vec::new(),
            low: [f32::INFINITY; DIMS],
            high: [f32::NEG_INFINITY; DIMS],
        };
        tree.set_reference();
        tree.grow();
        tree
    }

    /// Bytes that the tree takes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.order) + size_of_val(&*self.lefts) + size_of_val(&*self.rights)
    }

    /// Left and right factor of a product.
    pub(super) fn factors(&self, product: u32) -> (usize, usize) {
        ((product >> self.right_bits) as usize, (product & ((1 << self.right_bits) - 1)) as usize)
    }

    /// How many products there are.
    pub(super) fn len(&self) -> usize {
        self.lefts.len() * self.rights.len()
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

    fn entry(&self, product: u32) -> Entry {
        Entry { point: self.point(product), product }
    }

    fn grow(&mut self) {
        let buckets = (self.len() / BUCKET).max(1).next_power_of_two();
        let upper = self.upper_splits(buckets);
        let (mut order, starts) = self.in_buckets(&upper, buckets);
        let mut rest = order.as_mut_slice();
        let mut parts = Vec::with_capacity(buckets);
        for bounds in starts.windows(2) {
            let (part, after) = rest.split_at_mut(bounds[1] - bounds[0]);
            parts.push((bounds[0] as u32, part));
            rest = after;
        }
        let grown: Vec<_> = parts.into_par_iter().map(|(first, part)| self.bucket(first, part)).collect();
        for (_, (low, high)) in &grown {
            widen(&mut self.low, &mut self.high, low);
            widen(&mut self.low, &mut self.high, high);
        }
        self.nodes.reserve_exact(grown.iter().map(|(nodes, _)| nodes.len()).sum::<usize>() + buckets);
        self.assemble(0, &upper, &grown);
        self.order = order;
    }

    /// The splits down to `buckets`, level by level, from a sample.
    fn upper_splits(&self, buckets: usize) -> Vec<Upper> {
        // Multiples of the golden ratio: a stride would fall in step with the factors.
        let spread = |k: usize| (((k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize * self.len()) >> 32;
        let count = self.len().min(buckets * SAMPLES);
        let mut sample: Vec<_> = (0..count).map(|k| self.entry(self.product(spread(k)))).collect();
        let mut upper = Vec::with_capacity(buckets - 1);
        let mut level: Vec<&mut [Entry]> = vec![&mut sample];
        while level.len() < buckets {
            let mut next = Vec::with_capacity(2 * level.len());
            for part in level {
                let (dim, _) = cut(part);
                let at = if part.is_empty() { 0.0 } else { median(part, dim) };
                upper.push(Upper { dim: dim as u32, at });
                let (left, right) = part.split_at_mut(part.len() / 2);
                next.extend([left, right]);
            }
            level = next;
        }
        upper
    }

    /// All products sorted by bucket, and where each bucket begins.
    fn in_buckets(&self, upper: &[Upper], buckets: usize) -> (Vec<u32>, Vec<usize>) {
        let mut keys = vec![0; self.len()];
        let rows = keys.par_chunks_mut(self.rights.len()).enumerate();
        rows.for_each(|(left, keys)| {
            let first = (left << self.right_bits) as u32;
            for (block, keys) in keys.chunks_mut(ABREAST).enumerate() {
                self.sort_into(upper, first + (block * ABREAST) as u32, keys);
            }
        });
        let mut starts = vec![0; buckets + 1];
        keys.iter().for_each(|key| starts[*key as usize + 1] += 1);
        (0..buckets).for_each(|bucket| starts[bucket + 1] += starts[bucket]);
        let mut order = vec![0; self.len()];
        let share = buckets.div_ceil(rayon::current_num_threads());
        let mut rest = order.as_mut_slice();
        let mut parts = Vec::new();
        for first in (0..buckets).step_by(share) {
            let last = buckets.min(first + share);
            let (part, after) = rest.split_at_mut(starts[last] - starts[first]);
            parts.push((first..last, part));
            rest = after;
        }
        // Every thread reads all keys and places those of its own buckets.
        parts.into_par_iter().for_each(|(own, part)| {
            let mut places: Vec<_> = starts[own.clone()].iter().map(|start| start - starts[own.start]).collect();
            for (index, key) in keys.iter().enumerate() {
                if let Some(place) = (*key as usize).checked_sub(own.start).and_then(|key| places.get_mut(key)) {
                    part[*place] = self.product(index);
                    *place += 1;
                }
            }
        });
        (order, starts)
    }

    /// The buckets of a few products, from `first` on: level by level for all, so that none waits for another.
    fn sort_into(&self, upper: &[Upper], first: u32, keys: &mut [u32]) {
        let mut points = [[0.0; DIMS + 1]; ABREAST];
        let count = keys.len() as u32;
        for (point, product) in points.iter_mut().zip(first..first + count) {
            point[..DIMS].copy_from_slice(&self.point(product));
        }
        keys.fill(0);
        for _ in 0..upper.len().count_ones() {
            for (key, point) in keys.iter_mut().zip(&points) {
                let Upper { dim, at } = upper[*key as usize];
                *key = 2 * *key + 1 + u32::from(point[dim as usize % (DIMS + 1)] >= at);
            }
        }
        keys.iter_mut().for_each(|key| *key -= upper.len() as u32);
    }

    /// Puts the products of one bucket in order: its nodes, numbered from 0, and the corners of its box.
    fn bucket(&self, first: u32, products: &mut [u32]) -> (Vec<Node>, (Point, Point)) {
        let mut entries: Vec<_> = products.iter().map(|product| self.entry(*product)).collect();
        let (mut low, mut high) = ([f32::INFINITY; DIMS], [f32::NEG_INFINITY; DIMS]);
        entries.iter().for_each(|entry| widen(&mut low, &mut high, &entry.point));
        let mut nodes = Vec::with_capacity(4 * entries.len() / LEAF + 1);
        split(&mut entries, first, &mut nodes);
        products.iter_mut().zip(&entries).for_each(|(product, entry)| *product = entry.product);
        (nodes, (low, high))
    }

    /// Appends the nodes below the upper split `at`.
    fn assemble(&mut self, at: usize, upper: &[Upper], grown: &[(Vec<Node>, (Point, Point))]) {
        let Some(&Upper { dim, at: split }) = upper.get(at) else {
            let offset = self.nodes.len() as u32;
            let moved = |node: &Node| match *node {
                Node::Split { dim, at, right } => Node::Split { dim, at, right: right + offset },
                leaf @ Node::Leaf { .. } => leaf,
            };
            self.nodes.extend(grown[at - upper.len()].0.iter().map(moved));
            return;
        };
        let index = self.nodes.len();
        self.nodes.push(Node::Leaf { len: 0, first: 0 });
        self.assemble(2 * at + 1, upper, grown);
        self.nodes[index] = Node::Split { dim: dim as u8, at: split, right: self.nodes.len() as u32 };
        self.assemble(2 * at + 2, upper, grown);
    }
}

/// Splits near the medians down to the leaves.
fn split(entries: &mut [Entry], first: u32, nodes: &mut Vec<Node>) {
    if entries.len() <= LEAF {
        nodes.push(Node::Leaf { len: entries.len() as u8, first });
        return;
    }
    let (dim, mut at) = cut(entries);
    let mut middle = parted(entries, dim, at);
    if middle == 0 || middle == entries.len() {
        // Many points in one place: any order serves, both halves touch the cut.
        middle = entries.len() / 2;
        at = median(entries, dim);
    }
    let index = nodes.len();
    nodes.push(Node::Leaf { len: 0, first });
    let (left, right) = entries.split_at_mut(middle);
    split(left, first, nodes);
    nodes[index] = Node::Split { dim: dim as u8, at, right: nodes.len() as u32 };
    split(right, first + middle as u32, nodes);
}

/// Puts the lower half of the points first, and returns where the upper half begins; there is one point at least.
fn median(entries: &mut [Entry], dim: usize) -> f32 {
    let middle = entries.len() / 2;
    entries.select_nth_unstable_by(middle, |a, b| a.point[dim].total_cmp(&b.point[dim])).1.point[dim]
}

/// Puts the points below `at` first, and returns how many they are. Each is moved, so that no branch is guessed.
fn parted(entries: &mut [Entry], dim: usize, at: f32) -> usize {
    let mut below = 0;
    for index in 0..entries.len() {
        let is_below = entries[index].point[dim] < at;
        entries.swap(index, below);
        below += usize::from(is_below);
    }
    below
}

/// Where to cut points in two: the dimension that a sample of them differs most in, and the sample's median in it.
fn cut(entries: &[Entry]) -> (usize, f32) {
    let (mut low, mut high) = ([f32::INFINITY; DIMS], [f32::NEG_INFINITY; DIMS]);
    let sample = || entries.iter().step_by((entries.len() / LOOKS).max(1)).take(LOOKS);
    sample().for_each(|entry| widen(&mut low, &mut high, &entry.point));
    let dim = (0..DIMS).max_by(|a, b| (high[*a] - low[*a]).total_cmp(&(high[*b] - low[*b]))).unwrap_or(0);
    let mut along = [f32::INFINITY; LOOKS];
    along.iter_mut().zip(sample()).for_each(|(x, entry)| *x = entry.point[dim]);
    let middle = entries.len().min(LOOKS) / 2;
    (dim, *along.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[inline]
fn widen(low: &mut Point, high: &mut Point, point: &Point) {
    for dim in 0..DIMS {
        low[dim] = low[dim].min(point[dim]);
        high[dim] = high[dim].max(point[dim]);
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

/// A ball in the seven dimensions that asks for the products inside.
pub(super) struct Probe<'a> {
    tree: &'a Tree,
    center: Point,
}

impl<'a> Probe<'a> {
    /// The balls around `pose`: for each sign of its quaternion one, where orientation counts.
    pub(super) fn around(tree: &'a Tree, pose: &Pose<f64>) -> impl Iterator<Item = Self> {
        let (p, q) = (pose.position, quaternion(pose));
        let signs: &[f64] = if tree.chord_scale > 0.0 { &[1.0, -1.0] } else { &[1.0] };
        signs.iter().map(move |sign| {
            let scale = sign * f64::from(tree.chord_scale);
            Self {
                tree,
                center: [p.x, p.y, p.z, scale * q[0], scale * q[1], scale * q[2], scale * q[3]].map(|x| x as f32),
            }
        })
    }

    /// The square of the distance of the box around all products.
    pub(super) fn box_distance_squared(&self) -> f32 {
        self.offsets().iter().map(|offset| offset * offset).sum()
    }

    fn offsets(&self) -> Point {
        let (low, high) = (&self.tree.low, &self.tree.high);
        std::array::from_fn(|dim| (low[dim] - self.center[dim]).max(self.center[dim] - high[dim]).max(0.0))
    }

    /// Shows `look` the products of the leaf that the center lies in, those within the square `reach` that it answers.
    pub(super) fn glance(&self, reach: &mut f32, look: &mut dyn FnMut(u32) -> f32) {
        let mut at = 0;
        while let Some(node) = self.tree.nodes.get(at) {
            match *node {
                Node::Split { dim, at: split, right } => {
                    at = if self.center[usize::from(dim)] < split { at + 1 } else { right as usize };
                }
                Node::Leaf { len, first } => return self.leaf(first as usize, len.into(), reach, look),
            }
        }
    }

    /// Shows `look` all products whose point lies within the square `reach`; `look` answers how far to reach from then on.
    pub(super) fn search(&self, reach: &mut f32, look: &mut dyn FnMut(u32) -> f32) {
        let mut offsets = self.offsets();
        let distance = offsets.iter().map(|offset| offset * offset).sum();
        self.visit(0, &mut offsets, distance, reach, look);
    }

    fn visit(&self, at: usize, offsets: &mut Point, distance: f32, reach: &mut f32, look: &mut dyn FnMut(u32) -> f32) {
        if distance > *reach {
            return;
        }
        match self.tree.nodes[at] {
            Node::Leaf { len, first } => self.leaf(first as usize, len.into(), reach, look),
            Node::Split { dim, at: split, right } => {
                let dim = usize::from(dim & 7);
                let (left, right) = (at + 1, right as usize);
                let beyond = self.center[dim] - split;
                let (near, far) = if beyond < 0.0 { (left, right) } else { (right, left) };
                self.visit(near, offsets, distance, reach, look);
                let before = offsets[dim];
                let farther = distance - before * before + beyond * beyond;
                if farther <= *reach {
                    offsets[dim] = beyond.abs();
                    self.visit(far, offsets, farther, reach, look);
                    offsets[dim] = before;
                }
            }
        }
    }

    #[inline]
    fn leaf(&self, first: usize, len: usize, reach: &mut f32, look: &mut dyn FnMut(u32) -> f32) {
        let (tree, c) = (self.tree, &self.center);
        for &product in tree.order.get(first..first + len).unwrap_or_default() {
            let (left, right) = tree.factors(product);
            let (Some(left), Some(right)) = (tree.lefts.get(left), tree.rights.get(right)) else { continue };
            let p = left.carry(&right.position);
            let (x, y, z) = (p[0] - c[0], p[1] - c[1], p[2] - c[2]);
            let apart = x * x + y * y + z * z;
            if apart <= *reach && apart + self.chord_squared(left, right) <= *reach {
                *reach = look(product);
            }
        }
    }

    /// The square of the orientation's part of the distance.
    fn chord_squared(&self, left: &Left, right: &Right) -> f32 {
        let q = self.tree.signed(hamilton(&left.quaternion, &right.quaternion));
        q.iter().zip(&self.center[3..]).map(|(q, c)| (q - c) * (q - c)).sum()
    }
}
