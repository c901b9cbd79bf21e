//! How the tree grows: products are sorted into buckets by a sample, then into leaves within each bucket by another one.

use rayon::prelude::*;

use super::{DIMS, LeafBox, NOTHING, Point, Split, Tree};

/// Products in a leaf, at most in the mean.
const LEAF: usize = 16;
/// Products in a bucket, about: what fits the cache of a core as points.
const BUCKET: usize = 4096;
/// Products of the sample for one bucket, and for one leaf.
const BUCKET_SAMPLES: usize = 32;
const LEAF_SAMPLES: usize = 4;
/// Points that a split looks at to find its dimension.
const LOOKS: usize = 32;
/// Products that are sorted side by side.
const ABREAST: usize = 16;

/// A point with room for an index that is masked in place of checked.
type Padded = [f32; DIMS + 1];

impl Tree {
    fn padded(&self, product: u32) -> Padded {
        let [x, y, z, a, b, c, d] = self.point(product);
        [x, y, z, a, b, c, d, 0.0]
    }

    /// Sorts all products; `false` where `go_on` says no before the end, and the tree is of no use.
    pub(super) fn grow(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> bool {
        let leaves = self.len().div_ceil(LEAF).next_power_of_two();
        let buckets = (self.len() / BUCKET).max(1).next_power_of_two().min(leaves);
        self.bucket_levels = buckets.trailing_zeros();
        self.leaf_levels = (leaves / buckets).trailing_zeros();
        let upper = self.upper_splits(buckets);
        let (mut order, firsts) = self.in_buckets(&upper, go_on);
        let in_each = leaves / buckets;
        let mut lower = vec![Split::default(); leaves];
        let mut leaf_boxes = vec![LeafBox::default(); leaves];
        let mut starts = vec![0; leaves + 1];
        starts[leaves] = self.len() as u32;
        let mut rest = order.as_mut_slice();
        let mut parts = Vec::with_capacity(buckets);
        let own = lower.chunks_mut(in_each).zip(starts.chunks_mut(in_each)).zip(leaf_boxes.chunks_mut(in_each));
        for (bounds, ((splits, starts), boxes)) in firsts.windows(2).zip(own) {
            let (products, after) = rest.split_at_mut(bounds[1] - bounds[0]);
            parts.push(Bucket { first: bounds[0] as u32, products, splits, starts, boxes });
            rest = after;
        }
        let sorted = parts.into_par_iter().map(|bucket| go_on().then(|| self.in_leaves(bucket)));
        let Some(boxes) = sorted.collect::<Option<Vec<_>>>() else { return false };
        boxes.iter().for_each(|corners| join(&mut self.corners, corners));
        (self.boxes, self.leaf_boxes) = (boxes, leaf_boxes);
        self.splits = upper;
        self.splits.extend(lower);
        (self.starts, self.order) = (starts, order);
        true
    }

    /// The splits down to `buckets` from a sample of all products.
    fn upper_splits(&self, buckets: usize) -> Vec<Split> {
        // Multiples of the golden ratio: a stride would fall in step with the factors.
        let spread = |k: usize| (((k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize * self.len()) >> 32;
        let count = if buckets > 1 { self.len().min(buckets * BUCKET_SAMPLES) } else { 0 };
        let mut sample: Vec<_> = (0..count).map(|k| self.padded(self.product(spread(k)))).collect();
        let mut upper = vec![Split::default(); buckets];
        split(&mut sample, &mut upper);
        upper
    }

    /// All products sorted by bucket, and where each bucket begins. Once `go_on` says no they are in any bucket.
    fn in_buckets(&self, upper: &[Split], go_on: &(dyn Fn() -> bool + Sync)) -> (Vec<u32>, Vec<usize>) {
        let buckets = upper.len();
        let mut keys = vec![0; self.len()];
        let rows = keys.par_chunks_mut(self.rights.len()).enumerate();
        rows.filter(|_| go_on()).for_each(|(left, keys)| {
            let first = (left << self.right_bits) as u32;
            let mut points = [[0.0; DIMS + 1]; ABREAST];
            for (block, keys) in keys.chunks_mut(ABREAST).enumerate() {
                let products = first + (block * ABREAST) as u32..;
                points
                    .iter_mut()
                    .zip(products)
                    .take(keys.len())
                    .for_each(|(point, product)| *point = self.padded(product));
                route(upper, &points, keys);
            }
        });
        let mut firsts = vec![0; buckets + 1];
        keys.iter().for_each(|key| firsts[*key as usize + 1] += 1);
        (0..buckets).for_each(|bucket| firsts[bucket + 1] += firsts[bucket]);
        let mut order = vec![0; self.len()];
        let share = buckets.div_ceil(rayon::current_num_threads());
        let mut rest = order.as_mut_slice();
        let mut parts = Vec::new();
        for first in (0..buckets).step_by(share) {
            let last = buckets.min(first + share);
            let (part, after) = rest.split_at_mut(firsts[last] - firsts[first]);
            parts.push((first..last, part));
            rest = after;
        }
        // Every thread reads all keys and places those of the buckets it owns.
        parts.into_par_iter().for_each(|(own, part)| {
            let mut places: Vec<_> = firsts[own.clone()].iter().map(|first| first - firsts[own.start]).collect();
            for (index, key) in keys.iter().enumerate() {
                if let Some(place) = (*key as usize).checked_sub(own.start).and_then(|key| places.get_mut(key)) {
                    part[*place] = self.product(index);
                    *place += 1;
                }
            }
        });
        (order, firsts)
    }

    /// Puts the products of one bucket in the order of its leaves; the corners of their box.
    fn in_leaves(&self, Bucket { first, products, splits, starts, boxes }: Bucket<'_>) -> [Point; 2] {
        let points: Vec<_> = products.iter().map(|product| self.padded(*product)).collect();
        let step = (points.len() / (LEAF_SAMPLES * splits.len())).max(1);
        let mut sample: Vec<_> = points.iter().step_by(step).copied().collect();
        split(&mut sample, splits);
        let mut keys = vec![0; points.len()];
        for (points, keys) in points.chunks(ABREAST).zip(keys.chunks_mut(ABREAST)) {
            route(splits, points, keys);
        }
        let corners = boxed(&points, &keys, boxes);
        keys.iter().for_each(|key| starts[*key as usize] += 1);
        let mut next = 0;
        for start in starts.iter_mut() {
            next += std::mem::replace(start, next);
        }
        let mut places = starts.to_vec();
        let mut sorted = vec![0; products.len()];
        for (product, key) in products.iter().zip(&keys) {
            let place = &mut places[*key as usize];
            sorted[*place as usize] = *product;
            *place += 1;
        }
        products.copy_from_slice(&sorted);
        starts.iter_mut().for_each(|start| *start += first);
        corners
    }
}

/// A bucket while its products are sorted into leaves.
struct Bucket<'a> {
    /// The place of its first product.
    first: u32,
    products: &'a mut [u32],
    splits: &'a mut [Split],
    starts: &'a mut [u32],
    boxes: &'a mut [LeafBox],
}

/// The boxes around the points of each leaf, and the corners of that around all.
fn boxed(points: &[Padded], keys: &[u32], boxes: &mut [LeafBox]) -> [Point; 2] {
    let mut leaves = vec![NOTHING; boxes.len()];
    keys.iter().zip(points).for_each(|(key, point)| widen(&mut leaves[*key as usize], point));
    let mut corners = NOTHING;
    leaves.iter().for_each(|leaf| join(&mut corners, leaf));
    boxes.iter_mut().zip(&leaves).for_each(|(own, leaf)| *own = LeafBox::new(leaf, &corners));
    corners
}

/// Splits a sample at its medians, level by level, into as many parts as there are `splits`; the first one is not used.
fn split(sample: &mut [Padded], splits: &mut [Split]) {
    let mut level = vec![sample];
    let mut at = 1;
    while at < splits.len() {
        let mut next = Vec::with_capacity(2 * level.len());
        for part in level {
            let dim = widest(part);
            let middle = part.len() / 2;
            if middle > 0 {
                let order = |a: &Padded, b: &Padded| a[dim].total_cmp(&b[dim]);
                let value = part.select_nth_unstable_by(middle, order).1[dim];
                splits[at] = Split { dim: dim as u32, at: value };
            }
            at += 1;
            let (left, right) = part.split_at_mut(middle);
            next.extend([left, right]);
        }
        level = next;
    }
}

/// The parts in which points lie: level by level for all, so that none waits for another.
#[inline]
fn route(splits: &[Split], points: &[Padded], keys: &mut [u32]) {
    keys.fill(1);
    for _ in 0..splits.len().trailing_zeros() {
        for (key, point) in keys.iter_mut().zip(points) {
            let Split { dim, at } = splits[*key as usize];
            *key = 2 * *key + u32::from(point[dim as usize % (DIMS + 1)] >= at);
        }
    }
    keys.iter_mut().for_each(|key| *key -= splits.len() as u32);
}

/// The dimension that a sample of points differs most in.
fn widest(points: &[Padded]) -> usize {
    let mut corners = NOTHING;
    let sample = points.iter().step_by((points.len() / LOOKS).max(1)).take(LOOKS);
    sample.for_each(|point| widen(&mut corners, point));
    let extent = |dim: &usize| corners[1][*dim] - corners[0][*dim];
    (0..DIMS).max_by(|a, b| extent(a).total_cmp(&extent(b))).unwrap_or(0)
}

#[inline]
fn widen([low, high]: &mut [Point; 2], point: &[f32]) {
    for ((low, high), x) in low.iter_mut().zip(high).zip(point) {
        *low = low.min(*x);
        *high = high.max(*x);
    }
}

/// Widens a box to hold another one.
fn join([low, high]: &mut [Point; 2], [other_low, other_high]: &[Point; 2]) {
    low.iter_mut().zip(other_low).for_each(|(low, x)| *low = low.min(*x));
    high.iter_mut().zip(other_high).for_each(|(high, x)| *high = high.max(*x));
}
