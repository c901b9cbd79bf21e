//! Cholesky factor of a banded symmetric matrix: the unknowns of a trajectory, of which only near frames are coupled.

use nalgebra::DVector;

/// The lower triangle of a symmetric matrix, of which only `width` diagonals below the main one are not zero.
pub(super) struct Banded {
    /// Row by row, the main diagonal last.
    rows: Vec<Vec<f64>>,
    width: usize,
}

impl Banded {
    /// n × n zeros.
    pub(super) fn zeros(n: usize, width: usize) -> Self {
        Self { rows: vec![vec![0.0; width + 1]; n], width }
    }

    /// Adds to an entry in the lower triangle; those above it are the same entries.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        if column <= row {
            self.rows[row][column + self.width - row] += value;
        }
    }

    /// The solution for this right side; `None` when the matrix is not positive definite.
    pub(super) fn solve(mut self, mut right: DVector<f64>) -> Option<DVector<f64>> {
        let (n, w) = (self.rows.len(), self.width);
        for i in 0..n {
            let first = i.saturating_sub(w);
            let (done, rest) = self.rows.split_at_mut(i);
            let row = &mut rest[0];
            for j in first..i {
                let other = &done[j];
                let from = first.max(j.saturating_sub(w));
                let sum = dot(&row[from + w - i..j + w - i], &other[from + w - j..w]);
                row[j + w - i] = (row[j + w - i] - sum) / other[w];
            }
            let known = &row[first + w - i..w];
            let left = row[w] - dot(known, known);
            if left.is_nan() || left <= 0.0 {
                return None;
            }
            row[w] = left.sqrt();
            let sum: f64 = (first..i).map(|j| row[j + w - i] * right[j]).sum();
            right[i] = (right[i] - sum) / row[w];
        }
        for i in (0..n).rev() {
            right[i] /= self.rows[i][w];
            for j in i.saturating_sub(w)..i {
                right[j] -= self.rows[i][j + w - i] * right[i];
            }
        }
        Some(right)
    }
}

/// Products summed in eight lanes: one sum would wait for each of its additions.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    let mut lanes = [0.0; 8];
    for (a, b) in a.zip(b) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(lane, (a, b))| *lane += a * b);
    }
    rest + lanes.iter().sum::<f64>()
}
