//! Numbers in TOML texts, with comments and layout kept.

use toml_edit::{TableLike, value};

/// Sets a number and keeps the comment behind it; the same number stays as it is written.
pub(crate) fn set_number(table: &mut dyn TableLike, key: &str, number: impl Into<i64>) {
    let number = number.into();
    let old = table.get(key).and_then(|old| old.as_value());
    if old.and_then(|old| old.as_integer()) == Some(number) {
        return;
    }
    let decor = old.map(|old| old.decor().clone());
    let mut new = value(number);
    if let (Some(decor), Some(new)) = (decor, new.as_value_mut()) {
        *new.decor_mut() = decor;
    }
    table.insert(key, new);
}
