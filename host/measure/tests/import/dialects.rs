//! A table comes back with its numbers, whatever the dialect in which another program writes it.

use darm_measure::import::read::Dialect;
use darm_measure::import::table::Table;
use darm_measure::import::{Recording, proposal, read};
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

fn columns(text: &str) -> (Vec<String>, Vec<Vec<f64>>, Vec<String>) {
    let Recording { mut parts, notes, .. } = recording(text.as_bytes()).unwrap();
    let columns = parts.remove(0).columns;
    let names = columns.iter().map(|column| column.name.clone()).collect();
    (names, columns.into_iter().map(|column| column.numbers).collect(), notes)
}

/// The table that is made of a text by the proposal.
fn converted(text: &str) -> Table {
    let recording = recording(text.as_bytes()).unwrap();
    Table::new(std::slice::from_ref(&recording), &proposal::propose(&recording, &[])).unwrap()
}

#[test]
fn a_column_of_text_makes_no_header_of_the_first_row() {
    let (names, numbers, _) = columns("# time_s,state,q1_deg\n0.0,homing,1\n0.1,homing,2\n0.2,moving,3\n");
    assert_eq!(
        (names, numbers[2].clone()),
        (vec!["time_s".into(), "state".into(), "q1_deg".into()], vec![1.0, 2.0, 3.0])
    );
    let (names, numbers, _) = columns("1700000000,5,,elbow,0.1\n1700000000,15,,elbow,0.2\n");
    assert_eq!((names.len(), &numbers[4]), (5, &vec![0.1, 0.2]));
    let (names, numbers, _) = columns("a,b\nx,y\nz,w\n");
    assert_eq!((names, numbers[0].len()), (vec!["a".to_owned(), "b".into()], 2));
}

#[test]
fn lines_before_the_table_are_left_out_with_a_note() {
    let rows: String = (0..20).map(|k| format!("{},0;26,{k:02};Hub 3.5;\n", 10 * k)).collect();
    let text = format!("Messung vom 26.11.2026\nZeit [ms];Achse 1 [deg];Bemerkung;\n{rows}");
    let (names, numbers, notes) = columns(&text);
    assert_eq!((&names[1], numbers[1][3], numbers[0].len()), (&"Achse 1 [deg]".to_owned(), 26.03, 20));
    assert_eq!(notes, ["the line before the table, `Messung vom 26.11.2026`, is not read"]);
    let info = "rig: st_Logger, a b c d; Capacity (B): 26; #logger: 3 of\n";
    let rows: String = (0..20).map(|k| format!("{k} 1.5 {} {}\n", 1_332_019_828 + k / 3, 300_000 * (k % 3))).collect();
    let table = converted(&format!("{info}status position time_s time_us\n{rows}"));
    let times: Vec<&str> = table.rows.iter().take(5).map(|row| row[0].as_str()).collect();
    assert_eq!(times, ["0", "0.3", "0.6", "1", "1.3"]);
    assert_eq!((table.names.len(), &table.about[1].1), (3, &"1332019828.000000000".to_owned()));
    // A row that is short by one cell is damaged, and no preamble.
    let error = recording(b"a,b\n1,2,3\n4,5,6\n7,8,9\n").unwrap_err();
    assert!(error.ends_with("or leave out the lines before the table with --skip-lines 1"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, b"a,b\n1,2,3\n4,5,6\n7,8,9\n").unwrap();
    let skipped = read(&path, Dialect { skip_lines: Some(1), ..Dialect::default() }).unwrap();
    assert_eq!((skipped.parts[0].shape[0], skipped.parts[0].lines[0]), (3, 2));
}

#[test]
fn a_header_of_several_rows_gives_names_that_differ() {
    let rows: String =
        (0..20).map(|k| format!("{k},{:.3},0,0,0,1,{}.5,2,3,\n", 0.01 * f64::from(k), 100 + k)).collect();
    let text = format!(
        "Format Version,1.23,Length Units,Millimeters,Rotation Type,Quaternion,Take Name,arm,Notes,,Frames,20\n\n\
         ,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n\
         ,Name,Tool,Tool,Tool,Tool,Tool,Tool,Tool,Tool\n\
         ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error\n\
         Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,\n{rows}"
    );
    let (names, ..) = columns(&text);
    assert_eq!(names[..3], ["Frame", "Time (Seconds)", "Rotation X"]);
    assert_eq!((&names[6], &names[9]), (&"Position X".to_owned(), &"Mean Marker Error".to_owned()));
    let table = converted(&text);
    assert_eq!(table.names, ["time_s", "Frame", "qx", "qy", "qz", "qw", "x_mm", "y_mm", "z_mm"]);
    assert_eq!(table.rows[3][6], "103.5");
}

#[test]
fn time_since_1970_counts_from_the_first_row_by_nanoseconds() {
    let text = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n\
                1403636580838555648,4,-1.7,0.78,1,0,0,0\n1403636580838555748,4,-1.7,0.78,1,0,0,0\n";
    let table = converted(text);
    assert_eq!(table.names, ["time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"]);
    assert_eq!((&table.rows[1][0], &table.about[1].1), (&"1e-7".to_owned(), &"1403636580.838555648".to_owned()));
    let dated = converted("stamp;q1_deg\n05.01.2024 13:02:03.000;0\n05.01.2024 13:02:03.040;1\n");
    assert_eq!((&dated.rows[1][0], &dated.about[1].1), (&"0.04".to_owned(), &"1704459723.000000000".to_owned()));
    let either = converted("stamp;q1_deg\n1/5/2024 1:02:03.000 PM;0\n1/5/2024 1:02:03.040 PM;1\n");
    assert_eq!((&either.rows[1][0], either.about.len()), (&"0.04".to_owned(), 1));
    let of_day = converted("stamp;q1_deg\n13:02:03.000;0\n13:02:03.040;1\n");
    assert_eq!(of_day.rows[1][0], "46923.04");
    // The integers of a simulation begin at 0.
    let simulated = recording(b"# time,q1_deg\n0,1\n10000000,3\n20000000,5\n").unwrap();
    assert!(simulated.notes[0].contains("they are taken as ns"), "{:?}", simulated.notes);
    let asked = recording(b"stamp;q1_deg\n1/5/2024 13:02:03;0\n1/6/2024 13:02:03;1\n").unwrap();
    assert!(asked.notes[0].contains("--dates day-first"), "{:?}", asked.notes);
}

#[test]
fn cells_without_a_number_in_a_column_of_numbers_are_missing() {
    let rows = |odd: &str| -> String {
        let rows = (0..20).map(|k| format!("{k},{}\n", if k == 7 { odd.to_owned() } else { k.to_string() }));
        format!("time_s,X [mm]\n{}", rows.collect::<String>())
    };
    let dashes = converted(&rows("---"));
    assert_eq!((dashes.names[1].as_str(), dashes.rows[7][1].as_str(), dashes.rows[8][1].as_str()), ("X_mm", "", "8"));
    let stray = converted(&rows("ERR"));
    assert_eq!((stray.names[1].as_str(), stray.rows[7][1].as_str()), ("X_mm", ""));
    assert!(stray.notes[0].starts_with("X [mm]: 1 of 20 cells, such as `ERR`, are no numbers"), "{:?}", stray.notes);
}
