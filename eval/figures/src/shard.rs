//! Which items a process runs: given by hand, or by the launcher that started it.

use std::fmt;
use std::str::FromStr;

use anyhow::{Context as _, Result, bail, ensure};

/// One of several processes that share the items of a command: every `count`-th item, beginning at `index`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 0.
    index: usize,
    count: usize,
}

impl Shard {
    /// One process runs all items.
    pub const ALL: Self = Self { index: 0, count: 1 };

    /// The shard with this index, from 0, of `count`.
    ///
    /// # Errors
    ///
    /// The index is not below the count.
    pub fn new(index: usize, count: usize) -> Result<Self> {
        ensure!(index < count, "shard {} of {count} does not exist; the last is {count}/{count}", index + 1);
        Ok(Self { index, count })
    }

    /// Whether this process runs the item with this index.
    pub fn has(self, item: usize) -> bool {
        item % self.count == self.index
    }

    /// Whether other processes run some of the items.
    pub fn is_part(self) -> bool {
        self.count > 1
    }

    /// The number of the shard, from 1.
    pub fn number(self) -> usize {
        self.index + 1
    }

    /// The shard of a process that Slurm (as an array) or Open MPI has started; else [`Shard::ALL`].
    ///
    /// # Errors
    ///
    /// The launcher's variables contradict each other or are not numbers.
    pub fn from_launcher(variable: impl Fn(&str) -> Option<String>) -> Result<Self> {
        let number = |name: &str| -> Result<Option<usize>> {
            let text = variable(name);
            text.map(|text| text.parse().with_context(|| format!("{name} is {text:?}, not a number"))).transpose()
        };
        if let (Some(rank), Some(size)) = (number("OMPI_COMM_WORLD_RANK")?, number("OMPI_COMM_WORLD_SIZE")?) {
            return Self::new(rank, size).context("OMPI_COMM_WORLD_RANK and OMPI_COMM_WORLD_SIZE");
        }
        if let (Some(id), Some(count)) = (number("SLURM_ARRAY_TASK_ID")?, number("SLURM_ARRAY_TASK_COUNT")?) {
            let first = number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0);
            let index = id.checked_sub(first).context("SLURM_ARRAY_TASK_ID is below SLURM_ARRAY_TASK_MIN")?;
            return Self::new(index, count).context("the array is to have consecutive numbers, such as --array=1-4");
        }
        Ok(Self::ALL)
    }
}

impl FromStr for Shard {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse::<usize>().ok()?, n.parse().ok()?)));
        match parts {
            Some((number @ 1.., count)) => Self::new(number - 1, count),
            _ => bail!("{text:?} is not a shard; write 1/4 for the first of four"),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number(), self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::Shard;

    fn launched(variables: &[(&str, &str)]) -> anyhow::Result<Shard> {
        let value = |name: &str| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        Shard::from_launcher(value)
    }

    #[test]
    fn each_item_is_in_one_shard() {
        let shards: Vec<Shard> = (1..=3).map(|i| format!("{i}/3").parse().unwrap()).collect();
        for item in 0..10 {
            assert_eq!(shards.iter().filter(|shard| shard.has(item)).count(), 1, "item {item}");
        }
        assert!((0..10).all(|item| Shard::ALL.has(item)));
    }

    #[test]
    fn a_shard_outside_its_range_is_refused() {
        for text in ["0/3", "4/3", "1/0", "-1/3", "1", "a/b", "1/3/5"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    #[test]
    fn the_rank_of_the_launcher_is_taken() {
        let two_of_four = "2/4".parse().unwrap();
        assert_eq!(launched(&[]).unwrap(), Shard::ALL);
        let mpi = [("OMPI_COMM_WORLD_RANK", "1"), ("OMPI_COMM_WORLD_SIZE", "4")];
        assert_eq!(launched(&mpi).unwrap(), two_of_four);
        let from_one = [("SLURM_ARRAY_TASK_ID", "2"), ("SLURM_ARRAY_TASK_COUNT", "4"), ("SLURM_ARRAY_TASK_MIN", "1")];
        assert_eq!(launched(&from_one).unwrap(), two_of_four);
        let from_zero = [("SLURM_ARRAY_TASK_ID", "1"), ("SLURM_ARRAY_TASK_COUNT", "4")];
        assert_eq!(launched(&from_zero).unwrap(), two_of_four);
    }

    #[test]
    fn contradicting_variables_are_refused() {
        assert!(launched(&[("OMPI_COMM_WORLD_RANK", "4"), ("OMPI_COMM_WORLD_SIZE", "4")]).is_err());
        assert!(launched(&[("OMPI_COMM_WORLD_RANK", "x"), ("OMPI_COMM_WORLD_SIZE", "4")]).is_err());
        assert!(launched(&[("SLURM_ARRAY_TASK_ID", "9"), ("SLURM_ARRAY_TASK_COUNT", "4")]).is_err());
    }
}
