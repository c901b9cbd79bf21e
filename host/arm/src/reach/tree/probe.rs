//! Queries of the tree.

use darm_core::se::Pose;

use super::{Left, Node, Point, Right, Tree, hamilton, quaternion};

/// A ball in the seven dimensions that asks for the products inside.
pub(in crate::reach) struct Probe<'a> {
    tree: &'a Tree,
    center: Point,
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
        self.offsets().iter().map(|offset| offset * offset).sum()
    }

    fn offsets(&self) -> Point {
        let (low, high) = (&self.tree.low, &self.tree.high);
        std::array::from_fn(|dim| (low[dim] - self.center[dim]).max(self.center[dim] - high[dim]).max(0.0))
    }

    /// Shows `look` the products of the leaf that the center lies in, those within the square `reach` that it answers.
    pub(in crate::reach) fn glance(&self, reach: &mut f32, look: &mut dyn FnMut(u32) -> f32) {
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
    pub(in crate::reach) fn search(&self, reach: &mut f32, look: &mut dyn FnMut(u32) -> f32) {
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
        for &product in &tree.order[first..first + len] {
            let (left, right) = tree.factors(product);
            let (left, right) = (&tree.lefts[left], &tree.rights[right]);
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
