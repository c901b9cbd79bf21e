//! Which column holds which quantity, other than by its name: exchanged columns, other signs and units, rows that come late.

use std::borrow::Cow;
use std::collections::BTreeMap;

use darm_measure::table::Table;

/// How the columns of a table are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ColumnReading(BTreeMap<String, Source>);

/// Where the numbers of a quantity come from.
#[derive(Clone, Debug, PartialEq)]
struct Source {
    quantity: String,
    factor: f64,
    zero: f64,
    /// Rows after the own one.
    later: isize,
}

impl ColumnReading {
    /// Exchanges what two lists of quantities hold, pair by pair.
    pub(crate) fn exchanged(a: &[String], b: &[String]) -> Self {
        let pairs = a.iter().zip(b).flat_map(|(a, b)| [(a, b), (b, a)]);
        Self(pairs.map(|(own, other)| (own.clone(), Source::of(other, 1.0, 0))).collect())
    }

    /// Each first quantity is the second one times a factor.
    pub(crate) fn taken(from: impl Iterator<Item = (String, String, f64)>) -> Self {
        Self(from.map(|(own, other, factor)| (own, Source::of(&other, factor, 0))).collect())
    }

    /// Quantities times a factor.
    pub(crate) fn scaled(quantities: &[String], factor: f64) -> Self {
        Self(quantities.iter().map(|own| (own.clone(), Source::of(own, factor, 0))).collect())
    }

    /// A quantity less a number.
    pub(crate) fn from_zero(quantity: &str, zero: f64) -> Self {
        Self([(quantity.to_string(), Source { zero, ..Source::of(quantity, 1.0, 0) })].into())
    }

    /// Quantities of rows that are `rows` later.
    pub(crate) fn late(quantities: &[String], rows: isize) -> Self {
        Self(quantities.iter().map(|own| (own.clone(), Source::of(own, 1.0, rows))).collect())
    }

    /// By how many rows numbers are taken from a later row.
    pub(crate) fn rows_later(&self) -> isize {
        self.0.values().map(|source| source.later).max_by_key(|later| later.abs()).unwrap_or_default()
    }

    /// The numbers of a quantity in this reading; `None` where the table has no such column.
    pub(crate) fn numbers<'t>(&self, table: &'t Table, quantity: &str) -> Option<Cow<'t, [f64]>> {
        let source = self.0.iter().find(|(own, _)| own.eq_ignore_ascii_case(quantity)).map(|(_, source)| source);
        let Some(Source { quantity, factor, zero, later }) = source else {
            return Some(Cow::Borrowed(&table.quantity(quantity)?.numbers));
        };
        let numbers = &table.quantity(quantity)?.numbers;
        let last = numbers.len().saturating_sub(1);
        let of = |row: usize| factor * numbers[row.saturating_add_signed(*later).min(last)] - zero;
        Some(Cow::Owned((0..numbers.len()).map(of).collect()))
    }
}

impl Source {
    /// A quantity as it is, but for a factor and rows.
    fn of(quantity: &str, factor: f64, later: isize) -> Self {
        Self { quantity: quantity.into(), factor, zero: 0.0, later }
    }
}
