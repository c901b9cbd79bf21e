//! Files that commands write: which they replace, and which they leave alone.

use super::{Board, Home, example, text};

#[test]
fn a_table_replaces_tables_only() {
    let home = Home::new();
    let arm = example("planar4.toml");
    let make = |output: &str| format!("table {arm} --words 000010000000 -o {output} --force");
    home.write("arm.toml", "precious");
    let other = "darm: arm.toml exists and is not a table of `darm table`; choose another name, or remove it first";
    home.fails(&make("arm.toml"), 1, other);
    assert_eq!(std::fs::read_to_string(home.path("arm.toml")).unwrap(), "precious");
    home.write("one.visits.csv", "time_s,word\n");
    let output = home.darm(&make("one.darm"));
    assert!(text(&output.stderr).starts_with("darm: one.visits.csv exists and is not a visit file"), "{output:?}");
    assert!(!home.path("one.darm").exists(), "neither of the two files is written");
    home.succeeds(&make("two.darm"));
    home.succeeds(&make("two.darm"));
}

#[test]
fn texts_and_pictures_replace_neither_another_kind_nor_an_input() {
    let home = Home::new();
    let read = |file: &str| std::fs::read_to_string(example(file)).unwrap();
    home.write("arm.toml", &read("planar4.toml"));
    home.write("frames.toml", &read("planar4-frames.toml"));
    home.write("run.csv", "time_s,word\n");
    let kind = |file: &str, kind: &str| {
        format!("darm: {file} exists and is not {kind}; choose another name, or remove it first")
    };
    let input = "darm: arm.toml is a file that is read; choose another name";
    home.fails("synth arm.toml frames.toml -o arm.toml --force", 1, input);
    home.fails("synth arm.toml frames.toml -o run.csv --force", 1, &kind("run.csv", "a TOML file"));
    home.fails("draw arm.toml -o run.csv --force", 1, &kind("run.csv", "an SVG picture"));
    home.fails("diagnose arm.toml run.csv --report run.csv --force", 1, &kind("run.csv", "an HTML page"));
    home.fails("diagnose arm.toml run.csv -o arm.toml --force", 1, input);
    home.fails("map arm.toml -o run.csv --force", 1, &kind("run.csv", "a CSV file with the same columns"));
    assert_eq!(std::fs::read_to_string(home.path("run.csv")).unwrap(), "time_s,word\n");
    home.succeeds("draw arm.toml -o arm.svg");
    home.succeeds("draw arm.toml -o arm.svg");
}

#[test]
fn a_recording_replaces_a_measurement_with_force_only() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 --dwell 0.3 -o one.darm"));
    let board = Board::start(&home, &arm);
    home.succeeds(&format!("upload one.darm {}", board.port));
    home.write("arm.toml", "precious");
    for force in ["", " --force"] {
        let output = home.darm(&format!("record one.darm -o arm.toml{force} {}", board.port));
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(text(&output.stderr).starts_with("darm: arm.toml exists and is not a recording"), "{output:?}");
        assert_eq!(std::fs::read_to_string(home.path("arm.toml")).unwrap(), "precious");
    }
    for file in ["run.csv", "run.csv.gz", "run.mcap"] {
        home.succeeds(&format!("record one.darm -o {file} {}", board.port));
        let before = std::fs::read(home.path(file)).unwrap();
        home.fails(
            &format!("record one.darm -o {file} {}", board.port),
            1,
            &format!("darm: {file} exists; overwrite it with --force"),
        );
        assert_eq!(std::fs::read(home.path(file)).unwrap(), before);
        home.succeeds(&format!("record one.darm -o {file} --force {}", board.port));
    }
}
