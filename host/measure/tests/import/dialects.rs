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
    for (big, mark) in [(false, "\u{feff}"), (true, "\u{feff}"), (false, ""), (true, "")] {
        let units = format!("{mark}winkel [°]\tb\r\n1,5\t2\r\n");
        let bytes = units.encode_utf16().flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() });
        let wide = recording(&bytes.collect::<Vec<u8>>()).unwrap();
        assert_eq!((wide.parts[0].columns[0].unit.as_deref(), wide.parts[0].columns[0].numbers[0]), (Some("°"), 1.5));
    }
}

#[test]
fn lines_after_the_table_are_left_out_with_a_note() {
    let (_, numbers, notes) = columns("t,a,b,c\n0,1,2,3\n1,2,3,4\n\nEnd of file\nTotal,2\n");
    assert_eq!(
        (numbers[0].len(), notes),
        (2, vec!["2 lines after the table, from `End of file` on, are not read".into()])
    );
}

#[test]
fn zero_bytes_at_the_end_are_left_out_with_a_note() {
    let (_, numbers, notes) = columns("t,a\n0.5,1\n1.5,2\n2.\0\0\0");
    assert_eq!((numbers[0].len(), notes.len()), (2, 2), "{notes:?}");
}

#[test]
fn decimal_commas_between_commas_are_refused_with_a_cure() {
    let error = recording(b"time_s,q1_deg\n0,01,1,5\n0,02,1,6\n0,03,1,7\n").unwrap_err();
    assert!(error.starts_with("log.csv:1: 2 names above rows of 4 cells") && error.contains("semicolons"), "{error}");
}

#[test]
fn a_header_is_one_row_above_a_cell_without_a_number_and_may_be_any_comment() {
    let (names, numbers, _) = columns("time_s,q1_deg\n0,OVR\n1,2\n2,OVR\n3,4\n4,5\n");
    assert_eq!((names, numbers[0].len()), (vec!["time_s".to_owned(), "q1_deg".into()], 5));
    let (names, ..) = columns("# time_s,q1_deg\n# robot: arm\n0,1\n1,2\n");
    assert_eq!(names, ["time_s", "q1_deg"]);
}

#[test]
fn numbers_are_read_with_units_quotes_bars_and_other_signs() {
    let table = converted("time,q1\n0.5 sec,1.5 deg\n1.0 sec,2.5 deg\n");
    assert_eq!((table.names, table.rows[1].join(" ")), (vec!["time_s".into(), "q1_deg".into()], "1 2.5".into()));
    let (_, numbers, _) = columns("\"t\",\"a\"\n\"0,5\",\"1,25\"\n\"1,0\",\"2,5\"\n");
    assert_eq!(numbers, [[0.5, 1.0], [1.25, 2.5]]);
    // Quoted thousands are no decimal commas.
    let (_, numbers, _) = columns("t,a\n1,\"1,250\"\n2,\"2,500\"\n");
    assert!(numbers[1][0].is_nan());
    let (_, numbers, _) = columns("t|a\n1.5D+00|\u{2212}2.5\n2.5D+00|\u{2212}3\n");
    assert_eq!(numbers, [[1.5, 2.5], [-2.5, -3.0]]);
}

#[test]
fn points_beside_decimal_commas_separate_thousands() {
    let (_, numbers, notes) = columns("t;a;b\n0,5;900;1.234,5\n1,0;1.001;2,5\n1,5;12.002;3,25\n");
    assert_eq!(numbers[1..], [[900.0, 1001.0, 12002.0], [1234.5, 2.5, 3.25]]);
    assert_eq!(notes.len(), 2, "{notes:?}");
    let (_, numbers, _) = columns("t;a;b\n0.025;1,5;1,5\n1.025;1,6;2,5\n2.050;1,7;3,25\n");
    assert_eq!(numbers[0], [0.025, 1.025, 2.05]);
}

#[test]
fn a_row_of_units_may_have_some_that_are_not_known_and_equal_names_get_numbers() {
    let text = "time,q1,q1,duty,mode\ns,deg,deg,%,-\n0,1,2,3,4\n1,2,3,4,5\n";
    let table = converted(text);
    assert_eq!(table.names, ["time_s", "q1_1_deg", "q1_2_deg", "duty", "mode"]);
    let columns = recording(text.as_bytes()).unwrap().parts.remove(0).columns;
    assert_eq!((columns[2].name.as_str(), columns[3].unit.as_deref()), ("q1_2", Some("%")));
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
fn time_is_found_by_what_its_numbers_do() {
    let converted_of = |head: &str, times: [&str; 4]| {
        let rows: String = times.iter().zip(1..).map(|(time, k)| format!("{time},{k}\n")).collect();
        converted(&format!("{head},q1_deg\n{rows}"))
    };
    for (head, times) in [
        ("__time", ["1717158600.5", "1717158600.6", "1717158600.7", "1717158600.8"]),
        ("time [h]", ["0.25", "0.250027777778", "0.250055555556", "0.250083333333"]),
        ("time", ["45443.520833333333", "45443.520834490741", "45443.520835648148", "45443.520836805556"]),
        ("unix_time", ["1717158600.5", "1717158600.6", "1717158600.7", "1717158600.8"]),
        ("tick_ms", ["500", "600", "700", "800"]),
        (".header.stamp.nsecs", ["500000000", "600000000", "700000000", "800000000"]),
        (
            "stamp",
            ["31-May-2024 23:59:59.9", "01-Jun-2024 00:00:00.0", "01-Jun-2024 00:00:00.1", "01-Jun-2024 00:00:00.2"],
        ),
        ("stamp", ["20240531T235959.9Z", "20240601T000000.0Z", "20240601T000000.1Z", "20240601T000000.2Z"]),
        ("stamp", ["2024/05/31/23:59:59.9", "2024/06/01/00:00:00.0", "2024/06/01/00:00:00.1", "2024/06/01/00:00:00.2"]),
        (
            "Date,Time",
            ["31.05.2024,23:59:59.9", "01.06.2024,00:00:00.0", "01.06.2024,00:00:00.1", "01.06.2024,00:00:00.2"],
        ),
    ] {
        let table = converted_of(head, times);
        let at =
            table.names.iter().position(|name| name == "time_s").unwrap_or_else(|| panic!("{head}: {:?}", table.names));
        let time = |row: usize| table.rows[row][at].parse::<f64>().unwrap();
        assert!((time(3) - time(0) - 0.3).abs() < 1e-5, "{head}: {:?}", table.rows);
    }
    let whole = recording(b"t,q1_deg\n0,1\n25,2\n50,3\n").unwrap();
    assert!(whole.notes[0].contains("taken as s; if they are not, give it with --unit 't=ms'"), "{:?}", whole.notes);
    assert_eq!(converted_of("time [fortnight]", ["1", "2", "3", "4"]).names[0], "time_fortnight");
    // A duration does not increase row by row.
    assert_eq!(converted_of("stroke_time_ms", ["31", "29", "30", "33"]).names[0], "stroke_time_ms");
    // Two clocks are not one time.
    let table = converted("stamp_s,elapsed_ms\n1717158600,0\n1717158600,300\n1717158601,600\n1717158601,900\n");
    assert_eq!(table.names.len(), 2, "{:?}", table.names);
    // The parts may be first.
    let table = converted("nsec,sec,q1_deg\n900000000,5,1\n950000000,5,2\n0,6,3\n");
    assert_eq!((table.names[0].as_str(), table.rows[2][0].as_str()), ("time_s", "6"));
    let text = recording(b"time;q1_deg\n1.23:59:00;1\n1.23:59:01;2\n").unwrap();
    assert!(text.notes[0].contains("`1.23:59:00` is not a number or a date that is read"), "{:?}", text.notes);
    let back = recording(b"time_s,q1_deg\n0,1\n1,2\n1,3\n0,4\n").unwrap();
    assert_eq!(back.notes, ["column time_s: time runs back in 1 rows, and is that of the row before in 1 rows"]);
}

#[test]
fn words_for_a_missing_value_are_empty_cells() {
    for word in ["#N/A", "<NA>", "#DIV/0!", "#NAME?", "1.#QNAN", "-nan(ind)", "NaT", ".", "missing", "-inf", "1e999"] {
        let rows: String = (0..6).map(|k| format!("{k},{}\n", if k % 3 == 1 { word } else { "0.5" })).collect();
        let table = converted(&format!("time_s,q1_deg\n{rows}"));
        assert_eq!((table.names[1].as_str(), table.rows[1][1].as_str()), ("q1_deg", ""), "{word}");
    }
    // A column with a unit has numbers, where most are.
    let table = converted("time_s,q1_deg\n0,1\n1,OVR\n2,3\n3,OVR\n4,5\n");
    assert_eq!((table.names[1].as_str(), table.rows[1][1].as_str()), ("q1_deg", ""));
}

#[test]
fn a_number_far_from_all_others_is_questioned_and_left_out_on_request() {
    let rows = |odd: &str| -> String {
        let rows = (0..20).map(|k| format!("{k},{}\n", if k % 9 == 7 { odd.to_owned() } else { format!("{k}.5") }));
        format!("time_s,q1_deg\n{}", rows.collect::<String>())
    };
    for (odd, is_questioned) in [("-9999", true), ("1e30", true), ("0", false), ("60", false)] {
        let notes = converted(&rows(odd)).notes;
        assert_eq!(notes.iter().any(|note| note.contains("--missing")), is_questioned, "{odd}: {notes:?}");
    }
    assert!(converted(&rows("-9999")).notes[0].contains("2 numbers are -9999, far from the others, 0.5 to 19.5"));
    let mut recording = recording(rows("-9999").as_bytes()).unwrap();
    recording.leave_out(&[-9999.0]);
    let table = Table::new(&[recording.clone()], &proposal::propose(&recording, &[])).unwrap();
    assert_eq!((table.rows[7][1].as_str(), table.rows[8][1].as_str()), ("", "8.5"));
    assert!(table.notes[0].starts_with("2 of 20 rows have an empty cell"), "{:?}", table.notes);
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
