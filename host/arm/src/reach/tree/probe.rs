//! Queries of the tree.

use darm_core::se::Pose;

use super::{Left, Point, Right, Tree, hamilton, quaternion};

/// A ball in the seven dimensions that asks for the products inside.
pub(in crate::reach) struct Probe<'a> {
    tree: &'a Tree,
    center: Point,
}

/// The leaf that a center lies in.
#[derive(Clone, Copy)]
pub(in crate::reach) struct Cell {
    /// The number of the leaf.
    pub(in crate::reach) number: u32,
    /// The square of the distance from the center to the next split: nothing nearer lies in another leaf.
    pub(in crate::reach) free: f32,
}

impl<'a> Probe<'a> {
    /// The balls around `pose`: for each sign of its quaternion one, where orientation counts.
    pub(in crate::reach) fn around(tree: &'a Tree, pose: &Pose<f64>) -> impl Iterator<Item = Self> {
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
    pub(in crate::reach) fn box_distance_squared(&self) -> f32 {
        self.offsets(&self.tree.corners).1
    }

    /// How far a box is from the center in each dimension, and the square of its distance.
    #[inline]
    fn offsets(&self, [low, high]: &[Point; 2]) -> (Point, f32) {
        let offsets: Point =
            std::array::from_fn(|dim| (low[dim] - self.center[dim]).max(self.center[dim] - high[dim]).max(0.0));
        (offsets, offsets.iter().map(|offset| offset * offset).sum())
    }

    /// The leaf that each center lies in: level by level for all, so that none waits for another's memory.
    pub(in crate::reach) fn cells(tree: &Tree, probes: &[Self]) -> Vec<Cell> {
        let mut cells = vec![Cell { number: 1, free: f32::INFINITY }; probes.len()];
        for _ in 0..tree.bucket_levels + tree.leaf_levels {
            for (cell, probe) in cells.iter_mut().zip(probes) {
                let split = tree.split(cell.number as usize);
                let beyond = probe.center[split.dim as usize] - split.at;
                cell.free = cell.free.min(beyond * beyond);
                cell.number = 2 * cell.number + u32::from(beyond >= 0.0);
            }
        }
        cells
    }

    /// Calls `look` with the number of each leaf whose cell is within the square `reach`; `look` answers how far to reach from
    /// then on.
    pub(in crate::reach) fn leaves(&self, mut reach: f32, look: &mut dyn FnMut(u32) -> f32) {
        let (mut offsets, distance) = self.offsets(&self.tree.corners);
        self.visit(1, &mut offsets, distance, &mut reach, look);
    }

    fn visit(&self, at: u32, offsets: &mut Point, distance: f32, reach: &mut f32, look: &mut dyn FnMut(u32) -> f32) {
        if distance > *reach {
            return;
        }
        if at >> self.tree.bucket_levels == 1 {
            let (mut offsets, distance) = self.offsets(&self.tree.boxes[at as usize - (1 << self.tree.bucket_levels)]);
            return self.visit_below(at, &mut offsets, distance, reach, look);
        }
        self.visit_below(at, offsets, distance, reach, look);
    }

    fn visit_below(
        &self,
        at: u32,
        offsets: &mut Point,
        distance: f32,
        reach: &mut f32,
        look: &mut dyn FnMut(u32) -> f32,
    ) {
        if distance > *reach {
            return;
        }
        if self.tree.is_leaf(at) {
            *reach = look(at);
            return;
        }
        let split = self.tree.split(at as usize);
        let dim = split.dim as usize;
        let beyond = self.center[dim] - split.at;
        let near = 2 * at + u32::from(beyond >= 0.0);
        self.visit(near, offsets, distance, reach, look);
        let before = offsets[dim];
        let farther = distance - before * before + beyond * beyond;
        if farther <= *reach {
            offsets[dim] = beyond.abs();
            self.visit(near ^ 1, offsets, farther, reach, look);
            offsets[dim] = before;
        }
    }

    /// Whether the box around the products of a leaf is within the square `reach`.
    #[inline]
    pub(in crate::reach) fn reaches(&self, number: u32, reach: f32) -> bool {
        let tree = self.tree;
        let leaf = number as usize - (1 << (tree.bucket_levels + tree.leaf_levels));
        tree.leaf_boxes[leaf].distance_squared(&self.center, &tree.boxes[leaf >> tree.leaf_levels]) <= reach
    }

    /// Shows `look` the products of a leaf that lie within the square `reach`; `look` answers how far to reach from then on.
    #[inline]
    pub(in crate::reach) fn leaf(&self, number: u32, mut reach: f32, mut look: impl FnMut(u32) -> f32) {
        let (tree, c) = (self.tree, &self.center);
        for &product in tree.leaf(number) {
            let (left, right) = tree.factors(product);
            let (left, right) = (&tree.lefts[left], &tree.rights[right]);
            let p = left.carry(&right.position);
            let (x, y, z) = (p[0] - c[0], p[1] - c[1], p[2] - c[2]);
            let apart = x * x + y * y + z * z;
            if apart <= reach && apart + self.chord_squared(left, right) <= reach {
                reach = look(product);
            }
        }
    }

    /// The square of the orientation's part of the distance.
    fn chord_squared(&self, left: &Left, right: &Right) -> f32 {
        let q = self.tree.signed(hamilton(&left.quaternion, &right.quaternion));
        q.iter().zip(&self.center[3..]).map(|(q, c)| (q - c) * (q - c)).sum()
    }
}
