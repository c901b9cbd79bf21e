//! A table comes back with its numbers, whatever the dialect in which another program writes it.

use darm_import::read::Dialect;
use darm_import::{Recording, read};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn recording(bytes: &[u8]) -> Result<Recording, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, bytes).unwrap();
    read(&path, Dialect::default()).map_err(|error| error.to_string().replace(&path.display().to_string(), "log.csv"))
}

/// How a program writes tables.
#[derive(Clone, Copy, Debug)]
struct Style {
    delimiter: char,
    has_decimal_comma: bool,
    has_header: bool,
    has_comment: bool,
    is_quoted: bool,
    has_mark: bool,
    has_carriage_return: bool,
    is_closed: bool,
}

impl Style {
    fn text(self, rows: &[Vec<Option<f64>>]) -> Vec<u8> {
        let end = if self.has_carriage_return { "\r\n" } else { "\n" };
        let quoted = |text: String| if self.is_quoted { format!("\"{text}\"") } else { text };
        let cell = |number: &Option<f64>| match number {
            Some(number) if self.has_decimal_comma => quoted(format!("{number:.6}").replace('.', ",")),
            Some(number) => quoted(format!("{number:.6}")),
            None if self.delimiter == ' ' => "nan".into(),
            None => String::new(),
        };
        let mut lines = Vec::new();
        if self.has_comment {
            lines.push("# written by a program, 2.5".into());
        }
        if self.has_header {
            lines.push(
                (0..rows[0].len())
                    .map(|k| quoted(format!("c{k}")))
                    .collect::<Vec<_>>()
                    .join(&self.delimiter.to_string()),
            );
        }
        lines.extend(rows.iter().map(|row| row.iter().map(cell).collect::<Vec<_>>().join(&self.delimiter.to_string())));
        let mark = if self.has_mark { "\u{feff}" } else { "" };
        (mark.to_owned() + &lines.join(end) + if self.is_closed { end } else { "" }).into_bytes()
    }
}

fn styles() -> impl Strategy<Value = Style> {
    let delimiter = prop_oneof![Just('\t'), Just(';'), Just(','), Just(' ')];
    (delimiter, any::<[bool; 7]>()).prop_map(
        |(delimiter, [comma, header, comment, quoted, mark, carriage_return, closed])| Style {
            delimiter,
            has_decimal_comma: comma && delimiter != ',',
            has_header: header,
            has_comment: comment,
            is_quoted: quoted && delimiter != ' ',
            has_mark: mark,
            has_carriage_return: carriage_return,
            is_closed: closed,
        },
    )
}

fn rows() -> impl Strategy<Value = Vec<Vec<Option<f64>>>> {
    let cell = prop_oneof![9 => (-1e4f64..1e4).prop_map(Some), 1 => Just(None)];
    (2usize..6).prop_flat_map(move |width| prop::collection::vec(prop::collection::vec(cell.clone(), width), 4..12))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..Default::default() })]

    #[test]
    fn numbers_come_back_in_every_dialect(style in styles(), mut rows in rows()) {
        // A row without any value is a blank line.
        rows.iter_mut().for_each(|row| row[0] = row[0].or(Some(0.5)));
        let read = recording(&style.text(&rows)).unwrap();
        let columns = &read.parts[0].columns;
        prop_assert_eq!(columns.len(), rows[0].len());
        prop_assert_eq!(&columns[0].name, if style.has_header { "c0" } else { "1" });
        for (k, column) in columns.iter().enumerate() {
            prop_assert_eq!(column.numbers.len(), rows.len());
            for (found, row) in column.numbers.iter().zip(&rows) {
                match row[k] {
                    Some(number) => prop_assert!((found - number).abs() < 1e-6, "{} {}", found, number),
                    None => prop_assert!(found.is_nan()),
                }
            }
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = recording(&bytes);
    }
}

#[test]
fn headers_are_found_in_comments_and_above_units() {
    let names = |text: &str| {
        let recording = recording(text.as_bytes()).unwrap();
        let columns = recording.parts[0].columns.iter();
        columns.map(|column| format!("{}|{}", column.name, column.unit.clone().unwrap_or_default())).collect::<Vec<_>>()
    };
    assert_eq!(names("# t q1 q2\n0 1 2\n1 2 3\n"), ["t|", "q1|", "q2|"]);
    assert_eq!(names("time,angle\n[ms],[deg]\n0,1\n1,2\n"), ["time|ms", "angle|deg"]);
    assert_eq!(names("2024-05-01 12:00:00,1\n2024-05-01 12:00:01,2\n"), ["1|s", "2|"]);
    assert_eq!(names("x [mm];y\n1,5;2,5\n2,5;3,5\n"), ["x [mm]|mm", "y|"]);
}

#[test]
fn rows_that_do_not_fit_are_reported_with_their_line() {
    for (text, expected) in [
        ("a,b\n1,2\n3\n4,5\n", "log.csv:3: 1 cells, the first row has 2"),
        ("# c\n\na;b\n1;2\n1;2;3\n", "log.csv:5: 3 cells, the first row has 2"),
        ("a,b\n", "log.csv: there is a header and no rows"),
        ("", "log.csv: the file is empty"),
        ("# only a comment\n", "log.csv: no rows"),
    ] {
        let error = recording(text.as_bytes()).unwrap_err();
        assert!(error.starts_with(expected), "{text:?}: {error}");
    }
    let cut = recording(b"a,b\n1,2\n3,4\n5").unwrap();
    assert_eq!((cut.parts[0].shape[0], cut.notes.len()), (2, 1));
    let latin = recording(b"winkel [\xb0],b\n1,2\n").unwrap();
    assert_eq!(latin.parts[0].columns[0].unit.as_deref(), Some("°"));
    assert!(recording(&[0xff, 0xfe, b'a', 0]).unwrap_err().contains("UTF-16"));
}
