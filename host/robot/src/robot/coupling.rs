//! Joints that follow others: the positions of all joints, q = C θ + d, from those that move independently, θ.
//!
//! What is linear in the rates of the joints is reduced by the constant C: a Jacobian J to J C, a mass matrix M to Cᵀ M C,
//! torques τ to Cᵀ τ. A joint whose position another prescribes has no motor: its torque is borne by the one it follows.

use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DefaultAllocator, Dim, Dyn, OMatrix};

use super::Robot;

/// How the joints of a robot follow its coordinates; the position of joint k is factor · θ\[coordinate\] + offset.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    rows: Vec<Row>,
    coordinates: Vec<usize>,
}

/// The row of C and d of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Number of the coordinate that moves the joint.
    pub coordinate: usize,
    /// rad or m of the joint per rad or m of the coordinate.
    pub factor: f64,
    /// rad or m where the coordinate is zero.
    pub offset: f64,
}

impl Robot {
    /// The joints that move independently, in the order of the coordinates.
    pub fn coordinates(&self) -> impl Iterator<Item = usize> {
        self.joints.iter().enumerate().filter(|(_, joint)| joint.mimic.is_none()).map(|(index, _)| index)
    }

    /// C and d of this robot.
    pub fn coupling(&self) -> Coupling {
        let coordinates: Vec<usize> = self.coordinates().collect();
        let mut number = vec![0; self.joints.len()];
        coordinates.iter().enumerate().for_each(|(coordinate, &joint)| number[joint] = coordinate);
        let row = |(index, mimic): (usize, Option<super::Mimic>)| match mimic {
            Some(mimic) => Row { coordinate: number[mimic.joint], factor: mimic.factor, offset: mimic.offset },
            None => Row { coordinate: number[index], factor: 1.0, offset: 0.0 },
        };
        let rows = self.joints.iter().map(|joint| joint.mimic).enumerate().map(row).collect();
        Coupling { rows, coordinates }
    }
}

impl Coupling {
    /// Number of coordinates.
    pub fn len(&self) -> usize {
        self.coordinates.len()
    }

    /// Whether nothing moves.
    pub fn is_empty(&self) -> bool {
        self.coordinates.is_empty()
    }

    /// The row of each joint.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The joint of each coordinate.
    pub fn coordinates(&self) -> &[usize] {
        &self.coordinates
    }

    /// C θ + d: positions of all joints, rad or m; a missing coordinate is 0.
    pub fn positions(&self, coordinates: &[f64]) -> Vec<f64> {
        let at = |row: &Row| row.factor * coordinates.get(row.coordinate).copied().unwrap_or(0.0) + row.offset;
        self.rows.iter().map(at).collect()
    }

    /// C θ̇: rates of all joints, rad/s or m/s; a missing one is 0.
    pub fn rates(&self, coordinates: &[f64]) -> Vec<f64> {
        let at = |row: &Row| row.factor * coordinates.get(row.coordinate).copied().unwrap_or(0.0);
        self.rows.iter().map(at).collect()
    }

    /// Cᵀ τ: what the torques of all joints are at the coordinates, N·m or N.
    pub fn torques(&self, joints: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.len()];
        self.rows.iter().zip(joints).for_each(|(row, torque)| sums[row.coordinate] += row.factor * torque);
        sums
    }

    /// J C.
    pub fn columns<R: Dim>(&self, joints: &OMatrix<f64, R, Dyn>) -> OMatrix<f64, R, Dyn>
    where
        DefaultAllocator: Allocator<R, Dyn>,
    {
        let mut sums = OMatrix::zeros_generic(joints.shape_generic().0, Dyn(self.len()));
        for (row, column) in self.rows.iter().zip(joints.column_iter()) {
            sums.column_mut(row.coordinate).axpy(row.factor, &column, 1.0);
        }
        sums
    }

    /// Cᵀ M C.
    pub fn square(&self, joints: &DMatrix<f64>) -> DMatrix<f64> {
        self.columns(&self.columns(joints).transpose()).transpose()
    }
}
