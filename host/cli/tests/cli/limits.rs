//! Limits of profiles: what a table may ask of servos and outputs, and what a check of a profile reports.

use super::{Board, Home, example, text};

/// A profile with a narrower servo than the arm of the example has.
fn narrow(home: &Home) -> String {
    let profile = std::fs::read_to_string(example("planar4-hybrid.profile.toml")).unwrap();
    home.write("narrow.toml", &profile.replace("max_deg = 60.0", "max_deg = 30.0"));
    example("planar4-hybrid.toml")
}

#[test]
fn rows_that_leave_the_range_of_a_servo_are_refused_where_the_table_is_made() {
    let home = Home::new();
    let arm = narrow(&home);
    let make = |angle: &str| {
        format!("table {arm} --profile narrow.toml --words 000010000000 --q={angle} --dwell 0.2 -o one.darm")
    };
    let refused = "darm: row 0, word 000010000000: servo 0 (base joint) would go to 45.0 deg, but the profile allows \
                   -60.0 to 30.0 deg without a zero offset; choose an angle within the range, or correct the range in the profile";
    home.fails(&make("45"), 1, refused);
    assert!(!home.path("one.darm").exists());
    home.succeeds(&make("30"));
}

#[test]
fn the_check_of_a_profile_shows_limits_in_force_and_warns() {
    let home = Home::new();
    let arm = narrow(&home);
    let checked = home.darm(&format!("profile check narrow.toml --arm {arm}"));
    assert!(checked.status.success());
    let warning = "warning: base joint: servo 0 has the range -60.0 to 60.0 deg in the arm file, but the profile allows \
                   -60.0 to 30.0 deg without a zero offset";
    assert!(text(&checked.stderr).contains(warning), "{}", text(&checked.stderr));
    let said = text(&checked.stdout);
    assert!(said.starts_with("narrow.toml is valid: ") && said.contains("12 outputs, 1 servo\n"), "{said}");
    let output = "number = 0\ndrive = \"hold\"\nline = 0\nmax_on_ms = 9000\nduty_percent = 50\nwindow_ms = 10000\n";
    let head = "format = 1\nname = \"hot\"\nambient_c = 50.0\nderate_percent_per_k = 2.0\n";
    home.write("hot.toml", &format!("{head}[supply]\nnew_outputs = 1\nwindow_ms = 10\n[[output]]\n{output}"));
    let report = home.json("profile check hot.toml");
    assert_eq!((&report["limits"][0]["duty_percent"], &report["limits"][0]["longest_on_s"]), (&40.into(), &4.0.into()));
    assert!(
        report["warnings"][0].as_str().unwrap().starts_with("output 0: max_on_ms = 9000 is never reached"),
        "{report}"
    );
    home.write(
        "two.toml",
        &std::fs::read_to_string(home.path("hot.toml")).unwrap().replace("line = 0", "line = 0\npull = 1"),
    );
    let two = "darm: two.toml:12:8: an output with drive = \"hold\" has no key `pull`, its keys are line; remove `pull`, or \
               correct `drive`";
    home.fails("profile check two.toml", 1, two);
}

#[test]
fn a_table_with_the_default_dwell_fits_the_first_profile() {
    let home = Home::new();
    let arm = example("planar4.toml");
    let made = home.darm(&format!("profile make {arm} -o first.toml"));
    assert!(text(&made.stderr).contains("; replace it by `profile = \""), "{}", text(&made.stderr));
    home.succeeds(&format!("table {arm} --profile first.toml --words 000010000000 -o one.darm"));
}

#[test]
fn an_emergency_stop_that_opens_when_pressed_is_released_in_the_simulator_by_default() {
    let home = Home::new();
    let profile = std::fs::read_to_string(example("planar4.profile.toml")).unwrap();
    home.write(
        "stop.toml",
        &profile.replacen("[[output]]", "[emergency_stop]\ninput = 12\nopens = true\n\n[[output]]", 1),
    );
    let arm = format!("{} --profile stop.toml", example("planar4.toml"));
    let phase = |options: &str| {
        let board = Board::start(&home, &format!("{arm} {options}"));
        let checks = home.json(&format!("doctor {}", board.port))["checks"].clone();
        let state = checks.as_array().unwrap().iter().find(|check| check["name"] == "state").cloned();
        let phase = home.json(&format!("status {}", board.port))["phase"].clone();
        (phase, state.map(|state| state["state"].clone()))
    };
    assert_eq!(phase(""), ("idle".into(), Some("good".into())));
    assert_eq!(phase("--switch-open 12"), ("safe".into(), Some("wrong".into())));
}

#[test]
fn messages_name_ports_profiles_and_refused_lines() {
    let home = Home::new();
    home.fails(
        "status -p /dev/null",
        4,
        "darm: /dev/null is not a serial port; name one: /dev/ttyACM0, unix:PATH or tcp:HOST:PORT",
    );
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 -o one.darm"));
    let board = Board::start(&home, &format!("{arm} --no-profile --folder board"));
    let refused = text(&home.darm(&format!("upload one.darm {}", board.port)).stderr);
    assert!(refused.contains("this board has no profile (built-in limits, or nothing is driven"), "{refused}");
    let mut script = home.command(&format!("console {}", board.port));
    home.write("script", "id\ndance\n");
    let script = script.stdin(std::fs::File::open(home.path("script")).unwrap()).output().unwrap();
    assert_eq!(script.status.code(), Some(3));
    assert!(text(&script.stderr).contains("the board refused 1 of the lines"), "{}", text(&script.stderr));
    for command in ["make", "check", "write", "show"] {
        let help = home.succeeds(&format!("profile {command} --help"));
        assert!(help.contains("Examples:\n  darm profile "), "{command}: {help}");
    }
}

#[test]
fn a_measurement_plan_rests_where_the_first_profile_demands_it() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("profile make {arm} -o first.toml"));
    let make =
        |profile: &str| format!("table {arm} {profile} --measurement-plan --plan-words 28 --dwell 0.1 -o plan.darm");
    let made = home.json(&make("--profile first.toml"));
    assert!(made["rests"].as_u64().unwrap() > 0 && made["rests_s"].as_f64().unwrap() > 1.0, "{}", made["rests"]);
    let said = home.succeeds(&make("--profile first.toml"));
    assert!(said.contains(" s in all keep the on-times and duties of the profile"), "{said}");
    let visits = std::fs::read_to_string(home.path("plan.visits.csv")).unwrap();
    assert!(visits.lines().filter(|line| line.contains("000000000000")).count() >= 3, "{visits}");
    assert_eq!(home.json(&make(""))["rests"], 0);
}

#[test]
fn a_program_waits_until_the_outputs_have_rested() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("profile make {arm} -o first.toml"));
    let first = std::fs::read_to_string(home.path("first.toml")).unwrap();
    let short = first.replace("max_on_ms = 1000", "max_on_ms = 1400").replace("duty_percent = 10", "duty_percent = 50");
    home.write("short.toml", &short.replace("window_ms = 10000", "window_ms = 3000"));
    home.succeeds(&format!("table {arm} --profile short.toml --words 000000000001 --dwell 1 -o one.darm"));
    let board = Board::start(&home, &format!("{arm} --profile short.toml"));
    let port = &board.port;
    home.succeeds(&format!("upload one.darm {port}"));
    home.succeeds(&format!("play --wait {port}"));
    let refused = home.darm(&format!("play {port}"));
    assert_eq!(refused.status.code(), Some(3), "{}", text(&refused.stderr));
    assert!(text(&refused.stderr).contains("`darm play --wait` waits"), "{}", text(&refused.stderr));
    let waited = home.darm(&format!("play --wait {port}"));
    assert!(waited.status.success(), "{}", text(&waited.stderr));
    assert!(text(&waited.stderr).starts_with("outputs have been on: waiting for at most "));
}

#[test]
fn status_shows_which_outputs_recover() {
    let home = Home::new();
    let text = std::fs::read_to_string(example("planar4.profile.toml")).unwrap();
    home.write("free.toml", &text);
    home.write("limited.toml", &text.replacen("duty_percent = 100", "duty_percent = 50", 1));
    for (profile, outputs) in [("free.toml", vec![]), ("limited.toml", vec![0])] {
        let arm = format!("{} --profile {profile}", example("planar4.toml"));
        home.succeeds(&format!("table {arm} --words 100000000000 --dwell 0.2 -o one.darm"));
        let board = Board::start(&home, &arm);
        home.succeeds(&format!("upload one.darm {}", board.port));
        home.darm(&format!("play one.darm {}", board.port));
        let status = home.json(&format!("status {}", board.port));
        let recovering = status["recovering"].as_array().unwrap();
        let numbers: Vec<u64> = recovering.iter().map(|output| output["output"].as_u64().unwrap()).collect();
        assert_eq!(numbers, outputs, "{profile}: {status}");
        assert!(recovering.iter().all(|output| output["recovery_s"].as_f64() > Some(0.0)), "{status}");
    }
}
