//! What is written is read back, and what is wrong with a file is said.

use super::*;

fn read(text: &str) -> Result<(Run, Vec<Finding>), ReadError> {
    read_text(Path::new("run.csv"), text.as_bytes())
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
    let text = "time_s,word,previous,servo1_deg,x_m,y_m,z_m,rx_deg,ry_deg,rz_deg,supply_bar,temperature_c,run,visit,held_out\n\
                1.000000,3,,12.5000,0.1000000,0.2000000,0.3000000,10.000000,20.000000,30.000000,,,0,0,0\n";
    assert_eq!(write_text(&read(text).unwrap().0), text);
}

#[test]
fn without_its_column_the_word_before_is_that_of_the_row_before() {
    let (run, _) = read("time_s,word,x_m,y_m,angle_deg\n0,01,0,0,0\n1,11,0,0,0\n").unwrap();
    assert_eq!(run.samples.iter().map(|s| s.previous).collect::<Vec<_>>(), [None, "01".parse().ok()]);
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
    let told = |text: &str| read(text).unwrap_err().to_string();
    assert_eq!(
        told("time_s,word,x_mm,y_m,angle_deg\n0,1,0,0,0\n"),
        "run.csv: no column x_m; the file has time_s, word, x_mm, y_m, angle_deg; rename a column so that it carries this quantity and unit"
    );
    assert_eq!(
        told("time_s,word,x_m,y_m,angle_deg\n0,15,0,0,0\n"),
        "run.csv: line 2: column word holds `15`, expected digits 0 to 3"
    );
    assert_eq!(told(HEADER), "run.csv: no rows, there is nothing to diagnose");
}

#[test]
fn other_columns_are_told() {
    let (_, findings) = read("time_s,word,x_m,y_m,angle_deg,humidity\n0,01,0,0,0,40\n").unwrap();
    assert_eq!(findings[0].to_string(), "columns left unread: humidity");
}

#[test]
fn a_compressed_file_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let (run, _) = read(&format!("{HEADER}0.25,010,,1.5,-0.25,90,5.9,21.5,0,0,0\n")).unwrap();
    for name in ["run.csv", "run.csv.gz"] {
        let path = folder.path().join(name);
        write(&path, "", &run).unwrap();
        assert_eq!(super::read(&path).unwrap().0, run);
    }
}
