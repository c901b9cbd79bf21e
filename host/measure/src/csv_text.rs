//! Comma-separated text: what every file and output of the host is written with.

/// A line of comma-separated values without its end; a cell with a comma, a quote or a line end is quoted.
pub fn csv_line(cells: impl IntoIterator<Item = impl AsRef<[u8]>>) -> String {
    let mut text = csv_text([cells]);
    text.pop();
    text
}

/// Lines of comma-separated values, each with its end.
#[expect(clippy::missing_panics_doc, reason = "memory takes every record, and cells are text")]
pub fn csv_text<Row: IntoIterator<Item = impl AsRef<[u8]>>>(rows: impl IntoIterator<Item = Row>) -> String {
    let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for row in rows {
        writer.write_record(row).expect("memory takes every record");
    }
    let bytes = writer.into_inner().expect("memory takes every record");
    String::from_utf8(bytes).expect("every cell is text")
}

/// The cells of a line, without spaces around them.
pub fn csv_cells(line: &str) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).trim(csv::Trim::All).from_reader(line.as_bytes());
    let first = reader.records().next().and_then(Result::ok);
    first.map_or(Vec::new(), |record| record.iter().map(str::to_owned).collect())
}

#[cfg(test)]
mod tests {
    use super::{csv_cells, csv_line, csv_text};

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        assert_eq!(csv_line(["a", "", "b, \"c\""]), "a,,\"b, \"\"c\"\"\"");
        assert_eq!(csv_text([vec!["x", "y"], vec!["1", "2"]]), "x,y\n1,2\n");
    }

    #[test]
    fn a_line_has_the_cells_that_were_written() {
        assert_eq!(csv_cells(" 1 ,\"b, \"\"c\"\"\",,\n"), ["1", "b, \"c\"", "", ""]);
        assert_eq!(csv_cells(&csv_line(["a", "", "b, \"c\""])), ["a", "", "b, \"c\""]);
        assert_eq!(csv_cells("\n"), [""; 0]);
    }
}
