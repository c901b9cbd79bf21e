//! Table, visits, board and recording are only joined where their digests agree.

use super::{Board, Home, example, text};

const WORDS: [(&str, &str); 2] = [("a", "000010000000 000001000000"), ("b", "000000100000 000001100000")];

/// Two tables of one model, and a board that holds the first.
fn two_tables(home: &Home) -> Board {
    let arm = example("planar4.toml");
    for (name, words) in WORDS {
        home.succeeds(&format!("table {arm} --words {words} --dwell 0.5 -o {name}.darm"));
    }
    let board = Board::start(home, &arm);
    home.succeeds(&format!("upload a.darm {}", board.port));
    board
}

/// Fails with code 1, names the file to upload, and nothing was played.
#[track_caller]
fn is_refused(home: &Home, board: &Board, line: &str, action: &str) {
    let refused = home.darm(&format!("{line} {}", board.port));
    let said = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "darm {line}: {said}{}", text(&refused.stdout));
    assert!(said.contains(action), "darm {line}: {said}");
    let log = home.types(&format!("console {}", board.port), "log\nquit\n");
    assert!(!log.contains("started"), "{log}");
}

#[test]
fn a_recording_with_the_visits_of_another_table_is_refused() {
    let home = Home::new();
    let board = two_tables(&home);
    is_refused(&home, &board, "record b.darm -o run.csv", "darm upload b.darm");
    assert!(!home.path("run.csv").exists());
}

#[test]
fn play_compares_the_named_table_with_that_of_the_board() {
    let home = Home::new();
    let board = two_tables(&home);
    is_refused(&home, &board, "play b.darm", "darm upload b.darm");
    assert_eq!(home.json(&format!("play a.darm {}", board.port))["end"], "finished");
}

#[test]
fn visits_of_another_table_or_of_none_are_refused() {
    let home = Home::new();
    let board = two_tables(&home);
    let visits = std::fs::read_to_string(home.path("a.visits.csv")).unwrap();
    home.write("b.visits.csv", &visits);
    is_refused(&home, &board, "record b.darm -o run.csv", "b.visits.csv belongs to table");
    let old: String = visits.lines().filter(|line| !line.starts_with("# table ")).map(|l| format!("{l}\n")).collect();
    home.write("a.visits.csv", &old);
    is_refused(&home, &board, "record a.darm -o run.csv", "remake the file with `darm table`");
}

/// Poses of the arm file `name` as a recording of the model `header`.
fn recording(home: &Home, file: &str, header: &str) {
    let mut table = format!("{header}time_s,word,x_m,y_m,angle_deg\n");
    for k in 0..60 {
        let x_m = f64::from(k * 37 % 60) / 60.0;
        table += &format!("{k},{:06b}000000,{x_m:.3},3.9,1\n", k % 64);
    }
    match file.ends_with(".mcap") {
        true => std::fs::write(home.path(file), darm_measure::log::from_text(&table).unwrap()).unwrap(),
        false => home.write(file, &table),
    }
}

#[test]
fn a_recording_of_another_model_is_not_diagnosed_unless_asked_for() {
    let home = Home::new();
    std::fs::copy(example("planar4.toml"), home.path("arm.toml")).unwrap();
    let arm = darm_arm::arm::Arm::read(&home.path("arm.toml")).unwrap();
    for file in ["other.csv", "other.mcap", "other.csv.gz"] {
        let plain = file.trim_end_matches(".gz");
        recording(&home, plain, "# model 0123456789abcdef\n");
        if file != plain {
            let mut encoder = flate2::write::GzEncoder::new(
                std::fs::File::create(home.path(file)).unwrap(),
                flate2::Compression::default(),
            );
            std::io::Write::write_all(&mut encoder, &std::fs::read(home.path(plain)).unwrap()).unwrap();
            encoder.finish().unwrap();
        }
        let refused = home.darm(&format!("diagnose arm.toml {file}"));
        let said = text(&refused.stderr) + &text(&refused.stdout);
        assert_eq!(refused.status.code(), Some(1), "{file}: {said}");
        assert!(said.contains("0123456789abcdef") && said.contains("--other-model"), "{file}: {said}");
        let asked = home.darm(&format!("diagnose arm.toml {file} --other-model"));
        assert!(asked.status.success(), "{file}: {}", text(&asked.stderr));
        assert!(text(&asked.stdout).contains("note: ") && text(&asked.stdout).contains("0123456789abcdef"), "{file}");
    }
    // The same arm with an effect in its file is the next model of the arm that was recorded.
    let geometry = format!("# model 0123456789abcdef\n# geometry {}\n", arm.geometry_hash());
    recording(&home, "next.csv", &geometry);
    let said = home.succeeds("diagnose arm.toml next.csv");
    assert!(said.contains("note: recorded with a table of model 0123456789abcdef"), "{said}");
    // The arm file that is wanted lies beside the one that was given.
    let text_of_other = arm.to_toml().replace("name = ", "name = \"other \" # ");
    home.write("other.toml", &text_of_other);
    let wanted = darm_arm::arm::Arm::read(&home.path("other.toml")).unwrap().hash();
    recording(&home, "wanted.csv", &format!("# model {wanted}\n"));
    let refused = home.darm("diagnose arm.toml wanted.csv");
    assert!(text(&refused.stderr).contains("give ./other.toml, which is that model"), "{}", text(&refused.stderr));
    for header in ["", "# model of a stranger\n", &format!("# model {}\n", arm.hash())] {
        recording(&home, "own.csv", header);
        let said = home.succeeds("diagnose arm.toml own.csv");
        assert!(!said.contains("model 0") && !said.contains("recorded with"), "{said}");
    }
}

#[test]
fn a_table_file_that_names_another_digest_is_refused() {
    let home = Home::new();
    let board = two_tables(&home);
    let mut bytes = std::fs::read(home.path("b.darm")).unwrap();
    let digest_at = b"darm table 2\n".len();
    bytes[digest_at] ^= 1;
    let content = bytes.len() - 4;
    let check = darm_core::wire::frame::CRC.checksum(&bytes[..content]);
    bytes[content..].copy_from_slice(&check.to_le_bytes());
    std::fs::write(home.path("b.darm"), bytes).unwrap();
    is_refused(&home, &board, "upload b.darm", "b.darm is damaged");
}

#[test]
fn a_table_file_shows_its_contents() {
    let home = Home::new();
    let arm = example("planar4-hybrid.toml");
    let words: Vec<String> = (1..15).map(|k| format!("0000{k:04b}0000")).collect();
    let words = words.join(" ");
    let made = home.json(&format!("table {arm} --words {words} --q 10 -o a.darm"));
    let shown = home.json("table --show a.darm");
    for key in ["digest", "model", "end_s", "device"] {
        assert_eq!(shown[key], made[key], "{key}");
    }
    let words = |table: &serde_json::Value| -> Vec<String> {
        table["rows"].as_array().unwrap().iter().map(|row| row["word"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(words(&shown), words(&made));
    assert_eq!(
        (&shown["rows"][0]["servos_rad"], shown["servos"].as_array().unwrap().len()),
        (&made["rows"][0]["servos_rad"], 1)
    );
    let angle_rad = shown["rows"][0]["servos_rad"][0].as_f64().unwrap();
    assert!((angle_rad - 10f64.to_radians()).abs() < 1e-6, "{angle_rad}");
    assert_eq!((shown["outputs"].as_array().unwrap().len(), shown["actuators"].as_array().unwrap().len()), (12, 12));
    assert!(shown["outputs"][0]["max_on_s"].as_f64() > Some(0.0) && shown["outputs"][0]["drive"].is_string());
    let (some, all) = (home.succeeds("table --show a.darm"), home.succeeds("table --show a.darm --all"));
    assert!(some.starts_with(&format!("table    {}\n", shown["digest"].as_str().unwrap())), "{some}");
    assert!(some.contains("more rows; --all shows them") && some.len() < all.len(), "{some}");
    assert!(all.contains(words(&shown).last().unwrap()), "{all}");
    home.write("a.visits.csv", "");
    assert_eq!(home.darm("table --show a.visits.csv").status.code(), Some(1));
    assert_eq!(home.darm(&format!("table {arm} --show a.darm")).status.code(), Some(2));
    assert_eq!(home.darm(&format!("table {arm} --words 000010000000")).status.code(), Some(2), "no output");
}

#[test]
fn a_damaged_table_never_reaches_the_board() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 -o one.darm"));
    let board = Board::start(&home, &arm);
    let sound = std::fs::read(home.path("one.darm")).unwrap();
    for at in (0..sound.len()).step_by(29).chain([sound.len() - 1]) {
        let mut bytes = sound.clone();
        bytes[at] ^= 1 << (at % 8);
        std::fs::write(home.path("flipped.darm"), bytes).unwrap();
        let refused = home.darm(&format!("upload flipped.darm {}", board.port));
        assert_eq!(refused.status.code(), Some(1), "byte {at}: {}", text(&refused.stderr));
    }
    assert_eq!(home.json(&format!("status {}", board.port))["table"], serde_json::Value::Null);
}
