//! Measurements that are damaged, and those that are diagnosed and identified.

use std::path::Path;
use std::process::Output;

use darm_core::se::Pose2;
use darm_diagnose::measurement_plan::plan;
use darm_diagnose::truth::{Kind, Truth};

use super::{Home, example, robot, text};

/// Damaged measurements: name, model, text, exit code, and what the message or the note must say.
fn damaged() -> Vec<(&'static str, &'static str, String, i32, &'static str)> {
    const HEAD: &str = "t_s,x_mm,p_bar,F_N\n";
    const POSES: &str = "time_s,word,x_m,y_m,angle_deg\n";
    let (force, arm, robot) = ("cylinder.toml", "planar4.toml", "tx40.urdf");
    let rows = |n: u32, row: &dyn Fn(u32) -> String| (0..n).map(|k| row(k) + "\n").collect::<String>();
    let good = |n| rows(n, &|k| format!("{},{},2,{}", f64::from(k) * 0.1, k % 20, 98 + k % 7));
    let wave = |k: u32, size: f64| size * (f64::from(k) / 9.0).sin();
    let joints = (1..7).map(|k| format!(",q{k}")).chain((1..7).map(|k| format!(",tau{k}"))).collect::<String>();
    let angles = rows(200, &|k| f64::from(k).to_string() + &format!(",{}", wave(k, 170.0)).repeat(6) + ",1,2,1,2,1,2");
    let all = |cells: &str| HEAD.to_string() + &rows(60, &|_| cells.into());
    let held = "t_s,x_mm,p_bar,F_N,held_out\n".to_string() + &rows(200, &|k| format!("{k},{k},2,98,1"));
    let runs = "t_s,x_mm,p_bar,F_N,run\n".to_string() + &rows(4, &|k| format!("{k},{k},2,98,{k}"));
    let pose = |word: &str, x: &str| POSES.to_string() + &rows(60, &|k| format!("{k},{word},{x},3.9,1"));
    vec![
        ("empty", force, String::new(), 1, "no rows"),
        ("header-only", force, HEAD.into(), 1, "no rows"),
        ("blank-lines", force, "\n\n".into(), 1, "no rows"),
        ("no-header", force, "1,2,3,4\n5,6,7,8\n".into(), 1, "no column pressure"),
        ("missing-column", force, "t_s,x_mm,p_bar\n1,2,3\n".into(), 1, "--column force=COLUMN"),
        ("short-row", force, format!("{HEAD}1,2,3\n"), 1, ":2:6: the row has 3 cells, the header has 4"),
        ("long-row", force, format!("{HEAD}1,2,3,4,5\n"), 1, ":2:9: the row has 5 cells"),
        ("one-row", force, format!("{HEAD}1,2,3,4\n"), 1, "not enough"),
        ("five-rows", force, HEAD.to_string() + &good(5), 1, "not enough"),
        ("a-run-a-row", force, runs, 1, "not enough"),
        ("all-held-out", force, held, 1, "not enough"),
        ("no-numbers", force, all("nan,nan,nan,nan"), 1, ":2: F_N is `nan`, not a number, as in 60 of 60 rows"),
        ("words", force, all("x,y,z,w"), 1, ":2: F_N is `"),
        ("overflow", force, all("1,2,1e300,1e300"), 1, "time never increases"),
        ("control-characters", force, "\u{1}\n\u{2},\u{3}\n".into(), 1, ":2:3: the row has 2 cells, the header has 1"),
        ("constant", force, all("1,1,1,1"), 1, "time never increases"),
        ("zeros", force, all("0,0,0,0"), 1, "time never increases"),
        ("some-nan", force, HEAD.to_string() + &good(100) + "10,nan,2,98\n", 0, "line 102"),
        ("two-time-bases", force, HEAD.to_string() + &good(100) + &good(100), 0, "line 102: time runs back"),
        ("repeated-row", force, format!("{HEAD}0,1,2,98\n0,1,2,98\n{}", good(100)), 0, "line 3"),
        ("bar-for-pascal", force, "t_s,x_mm,p,F_N\n".to_string() + &good(100), 0, "are these bar"),
        (
            "millimetres",
            force,
            "t_s,x,p_bar,F_N\n".to_string() + &rows(100, &|k| format!("{k},{},2,98", wave(k, 30.0))),
            0,
            "are these millimetres",
        ),
        ("degrees", robot, format!("t{joints}\n{angles}"), 0, "are these degrees"),
        ("wrong-model", robot, HEAD.to_string() + &good(100), 1, "no column q1"),
        ("other-columns", arm, HEAD.to_string() + &good(100), 1, "no column word"),
        ("long-word", arm, pose("0101010101010", "0.1"), 1, "13 digits"),
        ("letters", arm, pose("abc", "0.1"), 1, "digits 0 to 3"),
        ("no-state", arm, pose("000000000003", "0.1"), 1, "no state"),
        ("one-word", arm, pose("000000000000", "0.1"), 1, "not enough"),
        ("poses-of-nan", arm, pose("000000000000", "nan"), 1, "not enough"),
        ("poses-header-only", arm, POSES.into(), 1, "no rows"),
        ("not-a-log.mcap", force, "abc".into(), 1, "does not begin as an MCAP log"),
        ("cut.csv.gz", force, "\u{1f}".into(), 1, "cannot be read"),
    ]
}

#[test]
fn damaged_measurements_are_told_and_none_panics() {
    let home = Home::new();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for model in ["tests/data/measured/cylinder.toml", "tests/data/measured/tx40.urdf", "examples/planar4.toml"] {
        let name = Path::new(model).file_name().unwrap();
        std::fs::copy(examples.join(model), home.0.path().join(name)).unwrap();
    }
    for (name, model, content, code, message) in damaged() {
        let file = if name.contains('.') { name.to_string() } else { format!("{name}.csv") };
        home.write(&file, &content);
        let output = home.darm(&format!("diagnose {model} {file}"));
        let reported = text(&output.stdout) + &text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{name}: {reported}");
        assert!(
            reported.contains(message) && !reported.contains("panicked") && !reported.contains("NaN kg"),
            "{name}: {reported}"
        );
    }
}

#[test]
fn points_that_make_no_sense_are_told() {
    let home = Home::new();
    let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/measured/panda.urdf");
    std::fs::copy(robot, home.path("panda.urdf")).unwrap();
    let postures = (0..60).map(|k| format!("p{},{},0.1,0.2,0.3,-{k},0.5,0.6,0.7\n", k % 2, k % 3)).collect::<String>();
    home.write("touched.csv", &format!("place,socket,q1,q2,q3,q4,q5,q6,q7\n{postures}"));
    for (keys, message) in [
        ("", "model.toml:3:12: the key `point` is missing"),
        ("point = ['place']\npair = 'socket'", "pair and distance_mm go together"),
        ("point = ['place']\npair = 'socket'\ndistance_mm = 50", "one of the columns of `point`"),
        ("point = ['place', 'socket']\npair = 'socket'\ndistance_mm = 0", "give a number above 0"),
        ("point = ['place']", "joint panda_finger_joint1 before the tool slides"),
        (
            "point = ['place', 'socket']\npair = 'socket'\ndistance_mm = 50\ntool = 'ball_link'",
            "p0 has more than two values of socket",
        ),
        ("point = ['place']\ntool = 'hook'", "no frame hook; give one of"),
        ("point = ['where']\ntool = 'ball_link'", "no column where"),
    ] {
        home.write("model.toml", &format!("kind = 'robot'\nurdf = 'panda.urdf'\nobserved = 'point-contact'\n{keys}\n"));
        let output = home.darm("diagnose model.toml touched.csv");
        let reported = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{keys}: {reported}");
        assert!(reported.contains(message) && !reported.contains("panicked"), "{keys}: {reported}");
    }
}

#[test]
fn a_log_is_diagnosed_as_its_table_is() {
    let home = Home::new();
    let force = "kind = \"cylinder\"\nbore_mm = 25\n";
    home.write("cylinder.toml", force);
    let rows: String =
        (0..200).map(|k| format!("{:.1},{},{},{}\n", f64::from(k) * 0.1, k % 20, 2 + k % 3, 98 + k % 7)).collect();
    let table = format!("t_s,x_mm,p_bar,F_N\n{rows}");
    home.write("run.csv", &table);
    std::fs::write(home.path("run.mcap"), darm_measure::log::from_text(&table).unwrap()).unwrap();
    let [csv, log] =
        ["run.csv", "run.mcap"].map(|file| text(&home.darm(&format!("--json diagnose cylinder.toml {file}")).stdout));
    assert!(csv.len() > 1000);
    assert_eq!(csv, log);
    let help = text(&home.darm("diagnose --help").stdout);
    assert!(help.contains("-o, --output <NEW.toml>"));
}

/// The 88 golden postures as a table, each row changed by `change`.
fn postures(change: impl Fn(&mut Vec<f64>)) -> String {
    let packed = include_bytes!("../../../../tests/data/golden/planar5_sit_to_stand.json.gz");
    let golden: serde_json::Value = serde_json::from_reader(flate2::read::GzDecoder::new(&packed[..])).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let joints = ["ankle", "knee", "hip", "torso_pitch"];
    let head = joints.map(|joint| format!("{joint}_rad")).into_iter().chain(joints.map(|j| format!("tau_{j}_nm")));
    let mut text = head.chain(["Fx_n", "Fz_n", "My_nm"].map(str::to_owned)).collect::<Vec<_>>().join(",") + "\n";
    for posture in golden["postures"].as_array().unwrap() {
        let (q, f) = (numbers(&posture["q"]), numbers(&posture["f"]));
        let mut row = [&q[4..], &f[3..], &[f[0], f[1], -f[2]]].concat();
        change(&mut row);
        text += &(row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

#[test]
fn masses_are_identified_and_bad_postures_are_told() {
    let (home, planar) = (Home::new(), robot("planar5.urdf"));
    home.write("good.csv", &postures(|_| ()));
    let reported = home.json(&format!("com identify {planar} good.csv --splits 5 -o masses.json"));
    assert_eq!((reported["rank"].as_u64(), reported["physically_consistent"].as_bool()), (Some(10), Some(true)));
    assert!(reported["held_out"]["identified_m"][0].as_f64().unwrap() < 1e-6, "{reported}");
    assert!(reported["missing"]["named"].as_array().unwrap().is_empty(), "{reported}");
    assert!(std::fs::read_to_string(home.path("masses.json")).unwrap().contains("torso"));
    let refused = |table: String| {
        home.write("bad.csv", &table);
        let output = home.darm(&format!("com identify {planar} bad.csv"));
        assert_eq!(output.status.code(), Some(1));
        text(&output.stderr)
    };
    let one = postures(|_| ()).lines().take(2).collect::<Vec<_>>().join("\n");
    assert!(refused(one).contains("1 posture(s) determine"));
    let reversed = refused(postures(|row| row[8..].iter_mut().for_each(|x| *x = -*x)));
    assert!(reversed.starts_with("darm: bad.csv:2: the contacts pull the robot down"), "{reversed}");
    let human = example("../tests/data/measured/human.urdf");
    let setup = example("../tests/data/stand/stand.toml");
    home.write(
        "capture.csv",
        &(0..12).fold("t_s,LASI_x,LASI_y,LASI_z,Fz_n,Mx_nm,My_nm\n".to_owned(), |text, k| {
            text + &format!("{},0,0,1,700,0,0\n", 0.02 * f64::from(k))
        }),
    );
    let output = home.darm(&format!("com map {human} {planar} {setup} capture.csv"));
    assert!(text(&output.stderr).contains("no marker C7"), "{}", text(&output.stderr));
}

/// Poses of an arm one leg of which stops short, as a table that nobody prepared: millimetres, no rows held out.
fn poses_in_mm(home: &Home) {
    let base = darm_arm::arm::Arm::read(&home.path("planar4.toml")).unwrap();
    let frames = include_str!("../../../../examples/planar4-frames.toml");
    let desired = darm_arm::arm::frames::parse(Path::new("frames.toml"), frames, &base).unwrap();
    let truth = Truth::draw(&base, &desired, 4, Some(Kind::StrokeLoss)).unwrap();
    let run = truth.measure(&plan(&base, &Default::default()), 0.0, 4).unwrap();
    let mut text = String::from("time_s,word,right_mm,up_mm,angle_deg,day\n");
    for (k, sample) in run.samples.iter().enumerate() {
        let (p, angle) = (sample.pose.position * 1e3, Pose2::projection(&sample.pose).angle_rad.to_degrees());
        let [x, y, day] = [p.x, p.y, (k * 3 / run.samples.len()) as f64];
        text += &format!("{:.6},{},{x:.4},{y:.4},{angle:.6},{day}\n", sample.time_s, sample.word);
    }
    home.write("run.csv", &text);
}

#[test]
fn rows_of_poses_are_named_chosen_held_out_and_drawn() {
    let home = Home::new();
    std::fs::copy(example("planar4.toml"), home.path("planar4.toml")).unwrap();
    poses_in_mm(&home);
    let ask = "diagnose planar4.toml run.csv --column x_mm=right_mm,y_mm=up_mm";
    let reported = home.json(&format!("{ask} --report page.html"));
    assert_eq!(reported["held_out"], "each word in turn, in 10 parts");
    assert_eq!((&reported["verdict"], &reported["effects"][0]["law"]), (&"effect-found".into(), &"stroke-loss".into()));
    let [before, after] =
        ["before", "after"].map(|when| reported["error"][when]["held_out"]["norm"]["value"].as_f64().unwrap());
    assert!(after < 0.2 * before, "{before} {after}");
    let page = std::fs::read_to_string(home.path("page.html")).unwrap();
    assert!(page.contains("<b>Next: </b>") && page.contains("stroke-loss") && page.contains("<svg"));
    let rows = reported["rows"]["train"].as_u64().unwrap();
    for (how, held_out, rows) in [
        ("--hold-out-each day", "each day in turn", &rows.into()),
        ("--hold-out-last 0.25", "the last 25 %", &(rows / 4).into()),
    ] {
        let reported = home.json(&format!("{ask} {how}"));
        assert_eq!((&reported["held_out"], &reported["rows"]["held_out"]), (&held_out.into(), rows));
    }
    let some = home.json(&format!("{ask} --where day!=1"));
    assert!(some["rows"]["train"].as_u64() < Some(rows));
    home.fails(
        &format!("{ask} --lowpass 3"),
        2,
        "darm: --lowpass is for signals, not for an arm file: each row is a separate visit, there is no signal to \
         filter",
    );
    home.fails(
        &format!("{ask} --where day=1 --hold-out-each day"),
        1,
        "darm: run.csv: cross-validation needs at least 2 groups, and all rows are in one (each day in turn): choose a column \
         with several values",
    );
}

#[test]
fn poses_in_another_unit_are_asked_about_before_any_fit() {
    let home = Home::new();
    let (arm, run) = (example("planar4.toml"), std::fs::read_to_string(example("planar4-run.csv")).unwrap());
    let scaled = |columns: &[&str], factor: f64| {
        let mut header = Vec::new();
        let lines = run.lines().map(|line| {
            let cells: Vec<_> = line.split(',').map(str::to_owned).collect();
            if line.starts_with('#') || header.is_empty() {
                header = if line.starts_with('#') { Vec::new() } else { cells };
                return format!("{line}\n");
            }
            let cell = |(name, cell): (&String, &String)| match columns.contains(&&name[..]) {
                true => (cell.parse::<f64>().unwrap() * factor).to_string(),
                false => cell.clone(),
            };
            header.iter().zip(&cells).map(cell).collect::<Vec<_>>().join(",") + "\n"
        });
        lines.collect::<String>()
    };
    let refused = |name: &str, expected: [&str; 2]| {
        let said = home.darm(&format!("diagnose {arm} {name} --other-model"));
        assert_eq!(said.status.code(), Some(1), "{name}");
        let said = text(&said.stderr);
        assert!(expected.iter().all(|part| said.contains(part)), "{name}: {said}");
    };
    home.write("mm.csv", &scaled(&["x_m", "y_m"], 1e3));
    refused("mm.csv", ["m measured and ", "rename these to x_mm, y_mm, z_mm"]);
    home.write("m.csv", &run.replace("x_m,y_m", "x_mm,y_mm"));
    refused("m.csv", ["m measured and ", "rename these to x_m, y_m, z_m"]);
    home.write("deg.csv", &run.replace("angle_deg", "angle_rad"));
    refused("deg.csv", ["deg predicted", "let the names end in _deg"]);
    home.write("rad.csv", &scaled(&["angle_deg"], 1f64.to_radians()));
    refused("rad.csv", ["deg predicted", "let the names end in _rad"]);
}

/// `darm diagnose` of a recording in the examples, with effects rejected.
fn rejecting(home: &Home, options: &[&str]) -> Output {
    let files = [example("planar4.toml"), example("planar4-run.csv")];
    home.command("--json diagnose").args(files).args(options).output().unwrap()
}

#[test]
fn a_rejected_effect_is_neither_named_nor_written_and_its_reason_is_kept() {
    let home = Home::new();
    let found: serde_json::Value = serde_json::from_slice(&rejecting(&home, &[]).stdout).unwrap();
    let effect = &found["effects"][0];
    assert_eq!((&effect["law"], &effect["place_name"]), (&"supply-stroke".into(), &"module 2, diagonal leg".into()));
    let why = "supply-stroke, module 2, diagonal leg: new\n[[effect]] regulator";
    let also = "stroke-loss at actuator 4: measured with a gauge";
    let options = ["--reject", why, "--reject", also, "-o", "new.toml", "--keep-terms", "--report", "page.html"];
    let output = rejecting(&home, &options);
    let without: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let effects = without["effects"].as_array().unwrap().iter().chain(without["alternatives"].as_array().unwrap());
    let out = |effect: &&serde_json::Value| effect["where"].as_str().unwrap().starts_with("actuator 4");
    let laws = ["supply-stroke", "stroke-loss"];
    assert_eq!(effects.filter(out).filter(|effect| laws.iter().any(|law| effect["law"] == *law)).count(), 0);
    let reason = "new [[effect]] regulator";
    assert_eq!(
        (&without["rejected"][0]["law"], &without["rejected"][0]["reason"]),
        (&"supply-stroke".into(), &reason.into())
    );
    assert_eq!(without["rejected"][1]["where"], "actuator 4");
    assert!(std::fs::read_to_string(home.path("page.html")).unwrap().contains(reason));
    let model = std::fs::read_to_string(home.path("new.toml")).unwrap();
    let comment = "\n# Rejected by the user: supply-stroke, module 2, diagonal leg: new [[effect]] regulator\n";
    assert!(model.contains(comment) && model.ends_with("gauge\n"), "{model}");
    home.succeeds("model new.toml");
}

#[test]
fn a_rejection_that_means_nothing_is_an_error() {
    let home = Home::new();
    let refusal = |rejection: &str| text(&rejecting(&home, &["--reject", rejection]).stderr);
    let unknown = refusal("sag: checked");
    assert!(unknown.contains(": no law sag here; there are anchor-offset, base-drift, "), "{unknown}");
    let nowhere = refusal("play, joint 3: checked");
    assert!(nowhere.contains(": no play at joint 3 here; it is tried at actuator 0; actuator 1; "), "{nowhere}");
    assert!(refusal("play").contains("give LAW, PLACE: REASON"));
}
