//! Former names of commands and options: they work for one more release, and no help shows them.

use super::{Home, example, robot, text};

/// Options of a command that the help no longer shows.
const OPTIONS: [(&str, &[&str]); 14] = [
    ("adjust", &["--resolution-mm"]),
    ("synth", &["--draw", "--repair", "--frames-out", "--tolerance", "--worth"]),
    ("nearest", &["--dead", "--k ", "-k", "--servos", "--board"]),
    ("map", &["--picture", "--servos", "--csv"]),
    ("table", &["--programme", "--servos", "--size"]),
    ("path", &["--servos", "--tube", "--at-once"]),
    ("profile migrate", &["--profile"]),
    ("diagnose", &["--map", "--split", "--write-model", "--within", "--settled"]),
    ("ik", &["--picture", "--angles", "--most", "--tolerance-mm", "--tolerance-deg"]),
    ("bench-ik", &["--figures", "--angles"]),
    ("jacobian", &["--wrench"]),
    ("dynamics", &["--wrench"]),
    ("grasp solve", &["--picture", "--tip-radius-mm"]),
    ("grasp train", &["--figures", "--n ", "--file"]),
];

#[test]
fn no_help_shows_a_former_name() {
    let home = Home::new();
    let overview = home.succeeds("--help");
    assert!(![" plant,", " stops,"].iter().any(|former| overview.contains(former)), "{overview}");
    for (command, options) in OPTIONS {
        let help = home.succeeds(&format!("{command} --help"));
        for option in options {
            let shown = help.lines().any(|line| line.trim_start().starts_with(option));
            assert!(!shown && !help.contains(&format!(" {option}")), "{command} {option}: {help}");
        }
    }
}

/// The same command line by its former and its present names gives the same JSON, without the time that it took.
#[track_caller]
fn same(home: &Home, former: &str, present: &str) {
    let json = |line: &str| {
        let mut json = home.json(line);
        json.as_object_mut().unwrap().remove("took_s");
        json
    };
    assert!(home.darm(former).status.success(), "{former}");
    assert_eq!(json(former), json(present), "{former}");
}

#[test]
fn former_names_mean_the_same() {
    let home = Home::new();
    let (arm, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    home.succeeds(&format!("synth {arm} {frames} -o arm.toml"));
    same(&home, &format!("stops {arm} arm.toml"), &format!("adjust {arm} arm.toml"));
    let adjust = format!("adjust {arm} arm.toml");
    same(&home, &format!("{adjust} --resolution-mm 1"), &format!("{adjust} --resolution 1"));
    let synth = format!("synth arm.toml {frames} -o new.toml");
    same(&home, &format!("{synth} --repair 4=0 --draw plots"), &format!("{synth} --stuck 4=0 --plot plots"));
    let hybrid = format!("nearest {} 300,4200,10", example("planar4-hybrid.toml"));
    same(&home, &format!("{hybrid} --servos -20"), &format!("{hybrid} --q -20"));
    let run = format!("diagnose {arm} {}", example("planar4-run.csv"));
    same(
        &home,
        &format!("{run} --split held_out --map run=run --write-model a.toml"),
        &format!("{run} --hold-out-column held_out --column run=run -o a.toml"),
    );
    let table = format!("table {arm} -o plan.darm");
    same(&home, &format!("{table} --programme --size 28"), &format!("{table} --measurement-plan --plan-words 28"));
    let nearest = format!("nearest {arm} 300,4200,10");
    same(&home, &format!("{nearest} --dead 4=0 --k 3"), &format!("{nearest} --stuck 4=0 --count 3"));
    same(&home, &format!("{nearest} -k 3"), &format!("{nearest} --count 3"));
    same(&home, &format!("map {arm} --picture map.svg"), &format!("map {arm} --plot map.svg"));
    same(&home, &format!("map {arm} --csv map.csv"), &format!("map {arm} -o map.csv"));
    let path = format!("path {arm} 000000000000 111000111000");
    same(&home, &format!("{path} --tube 2000 --at-once 2"), &format!("{path} --deviation 2000 --max-switches 2"));
    let robust = format!("synth {arm} {frames} -o robust.toml");
    same(
        &home,
        &format!("{robust} --tolerance 0.05 --worth 500"),
        &format!("{robust} --part-error 0.05 --adjustment-per-halving 500"),
    );
    let ik = format!("ik {} --to 400,150,900", example("puma560.toml"));
    same(
        &home,
        &format!("{ik} --tolerance-mm 1 --tolerance-deg 1"),
        &format!("{ik} --tolerance 1 --angle-tolerance 1"),
    );
    let all = format!("{ik} --all --starts 50");
    same(&home, &format!("{all} --most 3 --picture all.svg"), &format!("{all} --count 3 --plot all.svg"));
    let (hand, contacts) = (example("allegro_hand.urdf"), example("grasp-contacts.toml"));
    let solve = format!("grasp solve {hand} {contacts}");
    same(
        &home,
        &format!("{solve} --tip-radius-mm 12 --picture g.svg"),
        &format!("{solve} --tip-radius 12 --plot g.svg"),
    );
    let train = format!("grasp train {} --lambdas 3", example("allegro_hand.toml"));
    same(&home, &format!("{train} --n 5 --figures g"), &format!("{train} --constraints 5 --plot g"));
    let refused = home.darm(&format!("plant {arm} --line-low 64"));
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("line 64 does not exist"), "{}", text(&refused.stderr));
}

#[test]
fn former_conventions_keep_their_meaning() {
    let home = Home::new();
    let puma = example("puma560.toml");
    // Half a turn about y: as a rotation vector, and as Z-Y-X Euler angles.
    let ik = format!("ik {puma} --to 400,150,900");
    same(&home, &format!("{ik} --angles 0,180,0"), &format!("{ik} --rotation 0,180,0"));
    let refused = home.darm(&format!("{ik} --angles 0,180,0 --rotation 0,180,0"));
    assert_eq!(refused.status.code(), Some(2));
    // What the tool exerted is the opposite of what the environment exerts on it.
    let q = "--q 0,45,-90,0,0,0";
    let [jacobian, dynamics] = ["jacobian", "dynamics"].map(|command| format!("{command} {puma} {q}"));
    let wrench = |sign: &str| format!("0,0,0,0,0,{sign}10");
    same(
        &home,
        &format!("{jacobian} --wrench {}", wrench("")),
        &format!("{jacobian} --external-wrench {}", wrench("-")),
    );
    same(
        &home,
        &format!("{dynamics} --wrench {}", wrench("")),
        &format!("{dynamics} --external-wrench {}", wrench("")),
    );
    let panda = robot("panda.urdf");
    assert_eq!(home.darm(&format!("dynamics {panda} --frame panda_hand_tcp")).status.code(), Some(2), "no wrench");
}

#[test]
fn columns_of_former_versions_are_read() {
    let home = Home::new();
    let puma = example("puma560.toml");
    let poses = home.succeeds(&format!("fk {puma} --q 10,20,30,40,50,60 --csv"));
    let columns: Vec<&str> = poses.lines().next().unwrap().split(',').collect();
    let former = ["posture", "frame", "x_m", "y_m", "z_m", "euler_z_deg", "euler_y_deg", "euler_x_deg"];
    assert_eq!((&columns[..8], &columns[8..]), (&former[..], &["rx_deg", "ry_deg", "rz_deg"][..]));
    home.write("both.csv", &poses);
    let cut = |line: &str| line.split(',').take(8).collect::<Vec<_>>().join(",");
    home.write("former.csv", &poses.lines().map(|line| cut(line) + "\n").collect::<String>());
    let [both, former] = ["both.csv", "former.csv"].map(|file| {
        let answer = home.json(&format!("ik {puma} --targets {file}"))["answers"][0].clone();
        assert_eq!(answer["status"], "reached", "{file}");
        answer["pose"]["rotation_vector_rad"]
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_f64().unwrap())
            .collect::<Vec<_>>()
    });
    assert!(both.iter().zip(&former).all(|(a, b)| (a - b).abs() < 1e-4), "{both:?} {former:?}");
}
