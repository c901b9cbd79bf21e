//! How the tree grows: products are sorted into buckets by a sample, then split within each bucket.

use rayon::prelude::*;

use super::{DIMS, Node, Point, Tree};

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

impl Tree {
    fn entry(&self, product: u32) -> Entry {
        Entry { point: self.point(product), product }
    }

    /// Sorts all products.
    pub(super) fn grow(&mut self) {
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
        // Every thread reads all keys and places those of the buckets it owns.
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
