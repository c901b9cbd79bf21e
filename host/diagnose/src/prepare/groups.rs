//! Which rows a fit sees, which are left out together, and which count as one when chance is judged.

/// Folds of cross-validation, where no column says which rows are left out together.
pub const FOLDS: usize = 10;
/// Pieces that the training rows are cut into at least, where there are as many rows.
const PIECES: usize = 24;
/// Runs from which on the spread of a value between them is estimated: with fewer, Student's t makes any interval say nothing.
const MIN_CLUSTERS: usize = 4;
/// The lag beyond which rows do not repeat each other.
const LONGEST_LAG: usize = 200;

/// One row of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalRow {
    /// Line of the file, the header being 1.
    pub line: usize,
    /// When, s; the number of the row where there is no time.
    pub time_s: f64,
    /// The stretch of rows that follow each other without a border.
    pub series: usize,
    /// The motion that it belongs to: it continues where rows begin or end to be held out.
    pub motion: usize,
    /// Number of the value of the column that is held out, where it has few.
    pub key: Option<usize>,
    /// Whether no fit may see it.
    pub held_out: bool,
}

/// Rows that were measured under one condition: they may share an error that the rows of another condition do not have, so that
/// pieces of one of them say nothing about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Clusters {
    /// The cluster of each row.
    pub of_rows: Vec<usize>,
    /// How many there are.
    pub count: usize,
}

impl Clusters {
    /// Rows by the number of their condition; `None` where there are too few conditions to compare them.
    pub fn of(conditions: &[usize]) -> Option<Self> {
        let mut different = conditions.to_vec();
        different.sort_unstable();
        different.dedup();
        let of_rows = conditions.iter().map(|condition| different.partition_point(|other| other < condition)).collect();
        (different.len() >= MIN_CLUSTERS).then_some(Self { of_rows, count: different.len() })
    }
}

/// Groups of the training rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Groups {
    /// Indices of the training rows among all rows.
    pub training: Vec<usize>,
    /// The fold of each training row.
    pub folds: Vec<usize>,
    /// How many folds there are.
    pub n_folds: usize,
    /// The piece of each training row: rows that follow each other.
    pub blocks: Vec<usize>,
    /// How many pieces there are.
    pub n_blocks: usize,
    /// Rows that have a day, a load or a run in common.
    pub clusters: Option<Clusters>,
    /// What is left out together, in words.
    pub left_out: &'static str,
    /// Whether the row before belongs to the same stretch.
    follows: Vec<bool>,
}

impl Groups {
    /// Groups of the rows that are not held out.
    #[expect(clippy::missing_panics_doc, reason = "a key is searched among the keys themselves")]
    pub fn new(rows: &[SignalRow]) -> Self {
        let training: Vec<usize> = (0..rows.len()).filter(|&row| !rows[row].held_out).collect();
        let mut follows = vec![false; training.len()];
        for k in 1..training.len() {
            let (a, b) = (&rows[training[k - 1]], &rows[training[k]]);
            follows[k] = a.series == b.series && a.key == b.key && training[k - 1] + 1 == training[k];
        }
        let (blocks, n_blocks) = pieces(&follows);
        let keys: Vec<usize> = training.iter().filter_map(|&row| rows[row].key).collect();
        let mut different = keys.clone();
        different.sort_unstable();
        different.dedup();
        if keys.len() == training.len() && different.len() >= 3 {
            let folds = keys.iter().map(|key| different.binary_search(key).expect("different has every key")).collect();
            let (n_folds, clusters, left_out) = (different.len(), Clusters::of(&keys), "values of the held-out column");
            return Self { training, folds, n_folds, blocks, n_blocks, clusters, left_out, follows };
        }
        let folds = blocks.iter().map(|block| block % FOLDS).collect();
        let clusters = Clusters::of(&training.iter().map(|&row| rows[row].motion).collect::<Vec<usize>>());
        Self { training, folds, n_folds: FOLDS, blocks, n_blocks, clusters, left_out: "pieces of time", follows }
    }

    /// The autocorrelation time of these residuals in rows: the integral of their autocorrelation, counted over both signs of
    /// the lag.
    pub fn autocorrelation_time(&self, residuals: &[f64], n_axes: usize) -> f64 {
        let n = self.training.len();
        let variance =
            residuals.iter().map(|r| r * r).sum::<f64>().max(f64::MIN_POSITIVE) / residuals.len().max(1) as f64;
        let mut unbroken: Vec<usize> = vec![0; n];
        for k in 1..n {
            unbroken[k] = if self.follows[k] { unbroken[k - 1] + 1 } else { 0 };
        }
        let mut sum = 1.0;
        for lag in 1..LONGEST_LAG.min(n / 4) {
            let (mut products, mut count) = (0.0, 0usize);
            for row in (lag..n).filter(|&row| unbroken[row] >= lag) {
                for axis in 0..n_axes {
                    products += residuals[row * n_axes + axis] * residuals[(row - lag) * n_axes + axis];
                }
                count += n_axes;
            }
            let correlation = if count == 0 { 0.0 } else { products / count as f64 / variance };
            if correlation < 0.05 {
                break;
            }
            sum += 2.0 * correlation;
        }
        sum
    }
}

/// Cuts stretches of rows into pieces of about the same length.
fn pieces(follows: &[bool]) -> (Vec<usize>, usize) {
    let longest = (follows.len() / PIECES).max(1);
    let (mut blocks, mut block, mut length) = (Vec::with_capacity(follows.len()), 0, 0);
    for (row, follows) in follows.iter().enumerate() {
        if row > 0 && (!follows || length >= longest) {
            block += 1;
            length = 0;
        }
        blocks.push(block);
        length += 1;
    }
    let n_blocks = if blocks.is_empty() { 0 } else { block + 1 };
    (blocks, n_blocks)
}
