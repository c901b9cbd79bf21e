//! `darm diagnose` of a log without a model, and the questions that it asks about units.

use super::{Home, example, text};

/// A cylinder's table in these units.
fn force(pressure: &str, factor: f64) -> String {
    let row = |k: u32| {
        let t = f64::from(k) * 0.05;
        format!("{t:.2},{:.4},{:.5},{:.3}\n", 20.0 * t.sin(), factor * (2.0 + 0.5 * (0.3 * t).sin()), 98.0 + t.cos())
    };
    format!("t_s,x_mm,{pressure},F_N\n{}", (0..400).map(row).collect::<String>())
}

#[test]
fn a_log_without_a_model_says_what_can_be_diagnosed_and_how() {
    let home = Home::new();
    std::fs::copy(example("planar4-run.csv"), home.path("run.csv")).unwrap();
    std::fs::copy(example("planar4.toml"), home.path("ARM.toml")).unwrap();
    let found = home.json("diagnose run.csv --where run=0");
    assert_eq!(found["possible"][0]["kind"], "tool-pose");
    let word = &found["columns"].as_array().unwrap()[1];
    assert_eq!((&word["name"], &word["min"]), (&"word".into(), &serde_json::Value::Null));
    assert!(found["held_out"]["rows"].as_u64().unwrap() > 0 && found["repeats"]["dof"].as_u64().unwrap() > 10);
    // The line that is printed runs as it is.
    let command = found["commands"][0].as_str().unwrap();
    assert_eq!(command, "darm diagnose ARM.toml run.csv --where run=0");
    assert!(home.succeeds(command.strip_prefix("darm ").unwrap()).contains("verdict: "));
    let printed = home.succeeds("diagnose run.csv");
    assert!(printed.starts_with("run.csv: ") && printed.contains("\n  darm diagnose ARM.toml run.csv\n"), "{printed}");
}

#[test]
fn tables_logs_and_compressed_tables_give_the_same_overview() {
    let home = Home::new();
    let table = force("p_bar", 1.0);
    home.write("run.csv", &table);
    std::fs::write(home.path("run.mcap"), darm_measure::log::from_text(&table).unwrap()).unwrap();
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, table.as_bytes()).unwrap();
    std::fs::write(home.path("run.csv.gz"), packed.finish().unwrap()).unwrap();
    let [csv, gz, mcap] = ["run.csv", "run.csv.gz", "run.mcap"].map(|file| {
        let mut found = home.json(&format!("diagnose {file}"));
        for key in ["file", "commands"] {
            found[key].take();
        }
        // Keys of messages have no order.
        found["columns"].as_array_mut().unwrap().sort_by_key(|column| column["name"].to_string());
        found
    });
    assert!(csv == gz && csv == mcap, "{csv} {gz} {mcap}");
    assert_eq!(csv["possible"][0]["kind"], "actuator-force");
    assert!((csv["sampling"]["rate_hz"].as_f64().unwrap() - 20.0).abs() < 1e-6);
}

#[test]
fn a_recording_of_another_program_names_the_line_that_converts_it() {
    let home = Home::new();
    for (file, converted) in
        [("foreign-arrays.npz", "foreign-arrays.table.csv"), ("foreign-robot.csv", "foreign-robot.table.csv")]
    {
        std::fs::copy(example(file), home.path(file)).unwrap();
        let message = format!(
            "darm: {file} is a recording that only `darm import` reads; run `darm import {file} -o {converted}`, then `darm \
             diagnose {converted}`"
        );
        home.fails(&format!("diagnose {file}"), 1, &message);
        home.succeeds(&format!("import {file} -o {converted}"));
        home.succeeds(&format!("diagnose {converted}"));
    }
    home.fails(
        "diagnose arm.toml",
        2,
        "darm: arm.toml is a model; give the measurements after it: darm diagnose arm.toml DATA",
    );
    home.fails(
        "diagnose none.csv",
        1,
        "darm: none.csv: cannot be read: No such file or directory (os error 2); check the path",
    );
    assert_eq!(home.darm("diagnose run.csv -o new.toml").status.code(), Some(2), "a model is needed to write one");
}

#[test]
fn a_unit_that_looks_wrong_is_asked_about_before_a_diagnosis_and_the_option_corrects_it() {
    let home = Home::new();
    home.write("cylinder.toml", "kind = \"cylinder\"\nbore_mm = 25\n");
    home.write("run.csv", &force("p", 1.0));
    let question = "question: p goes up to 2.5 Pa: are these bar? --column p_bar=p reads them so";
    assert!(home.succeeds("diagnose run.csv").contains(question));
    let output = home.darm("diagnose cylinder.toml run.csv");
    assert_eq!(text(&output.stderr).trim_end(), question);
    assert!(!text(&output.stdout).contains("are these bar"), "it is asked once");
    let asked = |line: &str| home.json(line)["findings"].to_string().contains("are these bar");
    assert!(asked("diagnose cylinder.toml run.csv") && !asked("diagnose cylinder.toml run.csv --column p_bar=p"));
    assert_eq!(home.json("diagnose run.csv --column p_bar=p")["questions"], serde_json::json!([]));
}
