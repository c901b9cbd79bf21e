//! What is written is read back, and what is wrong with a file is said.

use std::path::Path;

use super::*;

use crate::{write, write_text};

fn read(text: &str) -> Result<(Run, Vec<Finding>), ReadError> {
    choosing(text, &Names::new(), &Which::default())
}

fn choosing(text: &str, names: &Names, which: &Which) -> Result<(Run, Vec<Finding>), ReadError> {
    of_table(&Table::read_text(Path::new("run.csv"), text.as_bytes(), names)?.0, which)
}

const HEADER: &str = "time_s,word,previous,x_m,y_m,angle_deg,supply_bar,temperature_c,run,visit,held_out\n";

#[test]
fn what_is_written_is_read() {
    let text = format!(
        "{HEADER}0.250000,010,,1.5000000,-0.2500000,90.000000,5.9000,21.5000,0,0,0\n0.500000,110,010,1.4000000,0.1000000,-3.500000,,,0,1,1\n"
    );
    let (run, findings) = read(&text).unwrap();
    assert_eq!((write_text(&run), findings), (text, vec![]));
}

#[test]
fn a_pose_in_space_is_read_as_it_was_written() {
    let text = "time_s,word,previous,servo0_deg,x_m,y_m,z_m,rx_deg,ry_deg,rz_deg,supply_bar,temperature_c,run,visit,held_out\n\
                1.000000,3,,12.5000,0.1000000,0.2000000,0.3000000,10.000000,20.000000,30.000000,,,0,0,0\n";
    assert_eq!(write_text(&read(text).unwrap().0), text);
}

#[test]
fn without_its_column_the_word_before_is_that_of_the_row_before() {
    let (run, _) = read("time_s,word,x_m,y_m,angle_deg\n0,01,0,0,0\n1,11,0,0,0\n").unwrap();
    assert_eq!(run.samples.iter().map(|s| s.previous).collect::<Vec<_>>(), [None, "01".parse().ok()]);
}

#[test]
fn rows_with_an_empty_cell_are_left_out_and_counted() {
    let text = "time_s,word,x_m,y_m,angle_deg,supply_bar\n0,01,,0,0,5\n1,11,0,0,0,\n2,,0,0,0,5\n";
    let (run, findings) = read(text).unwrap();
    assert_eq!(run.lines, [3]);
    let expected = "2 of 3 rows are left out because a cell is empty, the first in line 2, column x_m";
    assert_eq!(
        (findings.len(), findings[0].kind, findings[0].to_string().as_str()),
        (1, FindingKind::MissingValue, expected)
    );
}

#[test]
fn a_row_whose_load_is_not_known_is_left_out() {
    let (run, findings) = read("time_s,word,x_m,y_m,angle_deg,load_kg\n0,01,0,0,0,0\n1,11,0,0,0,\n").unwrap();
    assert_eq!((run.samples.len(), findings[0].kind), (1, FindingKind::MissingValue));
}

#[test]
fn a_row_without_a_pose_is_left_out_and_told() {
    let (run, findings) = read("time_s,word,x_m,y_m,angle_deg\n0,01,NaN,0,0\n1,11,0,0,0\n").unwrap();
    assert_eq!(run.samples.len(), 1);
    assert_eq!(findings[0].to_string(), "line 2: x_m is not a number, the row is left out");
    assert_eq!(run.line(0), 3);
}

#[test]
fn errors_say_where_and_what() {
    let reported = |text: &str| read(text).unwrap_err().to_string();
    assert_eq!(
        reported("time_s,word,x_deg,y_m,angle_deg\n0,1,0,0,0\n"),
        "run.csv: no column x_m; the file has time_s, word, x_deg, y_m, angle_deg; rename a column so that it carries this quantity and unit, or \
         give it that meaning with --column x_m=COLUMN"
    );
    assert_eq!(
        reported("time_s,word,x_m,y_m,angle_deg\n0,15,0,0,0\n"),
        "run.csv:2:3: column word holds `15`, expected digits 0 to 3; correct the cell"
    );
    assert_eq!(reported(HEADER), "run.csv: no rows, there is nothing to diagnose; record again");
}

#[test]
fn other_columns_are_told() {
    let (_, findings) = read("time_s,word,x_m,y_m,angle_deg,humidity\n0,01,0,0,0,40\n").unwrap();
    assert_eq!(findings[0].to_string(), "columns not read: humidity");
}

#[test]
fn a_condition_without_a_unit_is_reported_by_itself() {
    let (run, findings) = read("time_s,word,x_m,y_m,angle_deg,temp,humidity,supply\n0,01,0,0,0,20,40,6\n").unwrap();
    assert_eq!((run.samples[0].temperature_c, run.samples[0].supply), (None, None));
    let texts: Vec<String> = findings.iter().map(ToString::to_string).collect();
    assert_eq!(
        texts,
        [
            "column supply is not read: supply, unit missing; name it supply_bar or supply_kpa or supply_pa",
            "column temp is not read: temperature, unit missing; name it temperature_c or temperature_k",
            "columns not read: humidity"
        ]
    );
}

#[test]
fn a_compressed_file_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let (run, _) = read(&format!("{HEADER}0.25,010,,1.5,-0.25,90,5.9,21.5,0,0,0\n")).unwrap();
    for name in ["run.csv", "run.csv.gz"] {
        let path = folder.path().join(name);
        write(&path, "", &run).unwrap();
        assert_eq!(super::read(&path, &Names::new(), &Which::default()).unwrap().0, run);
    }
}

const POSES: &str = "time_s,word,x_m,y_m,angle_deg\n";

#[test]
fn other_units_and_names_are_read() {
    let text = "t_ms,word,right_mm,y_um,angle_rad,temperature_k,supply_kpa\n250,01,1500,-250000,0.5,300,540\n";
    let (run, findings) = choosing(text, &[("x_mm".into(), "right_mm".into())].into(), &Which::default()).unwrap();
    let sample = &run.samples[0];
    let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(close(sample.time_s, 0.25) && close(sample.pose.position.x, 1.5) && close(sample.pose.position.y, -0.25));
    assert!(close(sample.temperature_c.unwrap(), 26.85) && close(sample.supply.unwrap(), 5.4e5));
    assert!(close(Pose2::projection(&sample.pose).angle_rad, 0.5) && findings.is_empty(), "{findings:?}");
}

#[test]
fn a_row_that_does_not_count_still_tells_what_came_before() {
    let text = format!("{POSES}0,01,0,0,0\n1,11,0,0,0\n2,10,0,0,0\n");
    let keep = |text: &str| Which { keep: Some(text.parse().unwrap()), ..Which::default() };
    let (run, _) = choosing(&text, &Names::new(), &keep("time_s != 1")).unwrap();
    assert_eq!(run.training().map(|(index, _)| index).collect::<Vec<_>>(), [0, 2]);
    assert_eq!(run.samples[2].previous, "11".parse().ok());
}

#[test]
fn rows_are_held_out_as_asked() {
    let text = "time_s,word,x_m,y_m,angle_deg,arm\n0,01,0,0,0,a\n1,11,0,0,0,b\n2,10,nan,0,0,b\n3,10,0,0,0,b\n";
    let held = |hold_out: HoldOut| {
        let (run, _) = choosing(text, &Names::new(), &Which { keep: None, hold_out }).unwrap();
        (run.samples.iter().map(|sample| sample.held_out).collect::<Vec<_>>(), run.choice)
    };
    assert_eq!(held(HoldOut::Where("arm = b".parse().unwrap())).0, [false, true, true]);
    let which = Which { hold_out: HoldOut::Where("arm = c".parse().unwrap()), ..Which::default() };
    let (_, findings) = choosing(text, &Names::new(), &which).unwrap();
    assert_eq!(findings.last().unwrap().to_string(), "no row is held out by the rows that --hold-out names");
    assert_eq!(held(HoldOut::Last(0.25)).0, [false, false, true]);
    let (none, choice) = held(HoldOut::Each("arm".into()));
    assert_eq!(
        (none, choice.parts, &choice.description[..]),
        (vec![false; 3], Some(vec![0, 1, 1]), "each arm in turn")
    );
    assert_eq!(held(HoldOut::Own), (vec![false; 3], Choice { unused: vec![false; 3], ..Choice::default() }));
}

#[test]
fn a_selection_that_makes_no_sense_is_told_with_the_file() {
    let text = format!("{}0,01,0,0,0,maybe\n", POSES.replace('\n', ",held_out\n"));
    assert_eq!(read(&text).unwrap_err().to_string(), "run.csv: line 2: column held_out holds `maybe`, expected 0 or 1");
    let which = Which { hold_out: HoldOut::Each("arm".into()), ..Which::default() };
    let error = choosing(&format!("{POSES}0,01,0,0,0\n"), &Names::new(), &which).unwrap_err().to_string();
    assert!(error.starts_with("run.csv: no column arm; the file has time_s"), "{error}");
}

#[test]
fn lines_are_counted_whatever_they_end_in() {
    for end in ["\n", "\r\n"] {
        let text = format!("{POSES}0,01,0,0,0\n1,x,0,0,0\n").replace('\n', end);
        assert!(read(&text).unwrap_err().to_string().starts_with("run.csv:3:3:"), "{end:?}");
    }
}
