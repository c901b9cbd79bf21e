//! Comma-separated text.

/// A line of comma-separated values without its end; a cell with a comma, a quote or a line end is quoted.
pub(crate) fn csv_line(cells: impl IntoIterator<Item = impl AsRef<[u8]>>) -> String {
    let mut text = csv_text([cells]);
    text.pop();
    text
}

/// Lines of comma-separated values, each with its end.
pub(crate) fn csv_text<Row: IntoIterator<Item = impl AsRef<[u8]>>>(rows: impl IntoIterator<Item = Row>) -> String {
    let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for row in rows {
        writer.write_record(row).expect("memory takes every record");
    }
    let bytes = writer.into_inner().expect("memory takes every record");
    String::from_utf8(bytes).expect("every cell is text")
}

#[cfg(test)]
mod tests {
    use super::{csv_line, csv_text};

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        assert_eq!(csv_line(["a", "", "b, \"c\""]), "a,,\"b, \"\"c\"\"\"");
        assert_eq!(csv_text([vec!["x", "y"], vec!["1", "2"]]), "x,y\n1,2\n");
    }
}
