//! Velocities in both directions, Euler angles, the recursion link by link, bases that move, inertia of solids, odometry.

use serde_json::Value;

use super::{Home, example, robot};

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().flat_map(|x| x.as_f64().map_or_else(|| list(x), |x| vec![x])).collect()
}

#[track_caller]
fn near(ours: &[f64], theirs: &[f64], within: f64) {
    assert_eq!(ours.len(), theirs.len());
    assert!(ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() <= within), "{ours:?} {theirs:?}");
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(",")
}

#[test]
fn a_twist_leads_back_to_the_joint_velocities() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    let line = format!("jacobian {puma} --q 10,20,30,40,50,60");
    let forward = home.json(&format!("{line} --qd 5,-3,2,8,10,-4"))["postures"][0]["forward"].clone();
    let twist = &forward["twist_base"];
    let shown = [list(&twist["angular_rad_s"]), list(&twist["linear_m_s"])].concat();
    let typed: Vec<f64> = shown.iter().enumerate().map(|(k, x)| if k < 3 { x.to_degrees() } else { 1e3 * x }).collect();
    let inverse = home.json(&format!("{line} --twist {}", numbers(&typed)))["postures"][0]["inverse"].clone();
    let rates: Vec<f64> = inverse["joint_velocities"]
        .as_array()
        .unwrap()
        .iter()
        .map(|joint| joint["velocity_rad_s"].as_f64().unwrap().to_degrees())
        .collect();
    near(&rates, &[5.0, -3.0, 2.0, 8.0, 10.0, -4.0], 1e-9);
    assert_eq!((&inverse["is_reached"], &inverse["is_singular"]), (&true.into(), &false.into()));
    let csv = home.succeeds(&format!("{line} --qd 5,-3,2,8,10,-4 --csv"));
    assert!(csv.lines().next().unwrap().ends_with("wx_rad_s,wy_rad_s,wz_rad_s,vx_m_s,vy_m_s,vz_m_s"), "{csv}");
    // The stretched planar arm of the lecture cannot move along itself.
    let planar = example("planar2.toml");
    let said = home.succeeds(&format!("jacobian {planar} --q 30,0 --velocity 86.60254037844386,50,0"));
    assert!(said.contains("the posture is singular: the Jacobian has rank 1 of 2"), "{said}");
    assert!(
        said.contains("the joints cannot do this twist; missing: 0.000 0.000 0.000 deg/s, 86.603 50.000 0.000 mm/s")
    );
    home.fails(
        &format!("jacobian {planar} --twist 1,2"),
        2,
        "darm: --twist 1,2: give six numbers, in deg/s, then in mm/s, such as 0,0,0,100,0,0",
    );
}

#[test]
fn rates_of_euler_angles_exist_but_where_the_angles_are_singular() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    let at = |q2: f64| {
        let line = format!("jacobian {puma} --q 10,{q2},30,40,50,60 --qd 0,1,0,0,0,0 --euler zyx");
        home.json(&line)["postures"][0]["euler"].clone()
    };
    let (before, now, after) = (at(19.999), at(20.0), at(20.001));
    let slope: Vec<f64> = list(&after["angles_rad"])
        .iter()
        .zip(list(&before["angles_rad"]))
        .map(|(after, before)| (after - before) / 0.002)
        .collect();
    near(&list(&now["rates_rad_s"]), &slope, 1e-7);
    // All joints at zero: the flange is turned about z alone, where Z-Y-Z angles are singular.
    let zero = home.json(&format!("jacobian {puma} --euler zyz"))["postures"][0]["euler"].clone();
    assert!(zero["is_singular"] == true && zero["jacobian_euler"].is_null(), "{zero}");
    assert!(home.succeeds(&format!("jacobian {puma} --euler zyz")).contains("the angles are singular here"));
    let output = home.darm(&format!("jacobian {puma} --euler zzy"));
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn the_recursion_of_the_planar_arm_is_the_lectures() {
    let (home, planar) = (Home::new(), example("planar2.toml"));
    let line = format!("dynamics {planar} --q 30,50 --qd 40,-70 --qdd 10,20 --links");
    let state = home.json(&line)["states"][0].clone();
    let links = state["links"].as_array().unwrap();
    let (l1, [a, b]) = (0.5, [40.0f64, -70.0].map(f64::to_radians));
    let (s2, c2) = 50f64.to_radians().sin_cos();
    near(&list(&links[0]["angular_velocity_rad_s"]), &[0.0, 0.0, a], 1e-12);
    near(&list(&links[1]["angular_velocity_rad_s"]), &[0.0, 0.0, a + b], 1e-12);
    near(&list(&links[1]["velocity_m_s"]), &[l1 * s2 * a, l1 * c2 * a, 0.0], 1e-12);
    for (k, link) in links.iter().enumerate() {
        near(&[list(&link["joint_moment_nm"])[2]], &[state["torque"][k].as_f64().unwrap()], 1e-12);
    }
    assert!(home.succeeds(&line).contains("n at the joint, N m"));
}

#[test]
fn a_floating_base_is_where_it_is_said_to_be_and_moves() {
    let (home, humanoid) = (Home::new(), robot("simple_humanoid.urdf"));
    let state = |options: &str| home.json(&format!("dynamics {humanoid} --floating {options}"))["states"][0].clone();
    let (rest, raised) = (state(""), state("--base-position 0,0,1000 --base-rotation 0,0,90"));
    let mass = home.json(&format!("com {humanoid} --floating"))["mass_kg"].as_f64().unwrap();
    let potential = |state: &Value| state["potential_j"].as_f64().unwrap();
    assert!((potential(&raised) - potential(&rest) - 9.81 * mass).abs() < 1e-9 * mass);
    // Turned about the vertical, gravity is the same along the axes of the base.
    near(&list(&raised["base"]["wrench"]), &list(&rest["base"]["wrench"]), 1e-9);
    let moving = state("--base-twist 0,0,0,300,-400,0");
    assert!((moving["kinetic_j"].as_f64().unwrap() - 0.5 * mass * 0.25).abs() < 1e-9);
    near(&list(&moving["torque"]), &list(&rest["torque"]), 1e-9);
    let free = state(&format!("--base-rotation 20,30,40 --base-twist 10,20,30,0,0,0 --torque {}", numbers(&[0.0; 29])));
    assert!(free["base_acceleration"].as_array().unwrap().len() == 6);
    home.fails(
        &format!("dynamics {} --base-position 0,0,1", example("planar2.toml")),
        2,
        "darm: the base of planar robot of two links is fixed; give it --floating, or leave --base-… out",
    );
}

#[test]
fn a_solid_has_the_inertia_of_its_shape() {
    let home = Home::new();
    let solid = home.json("inertia box --size 100,200,300 --mass 12");
    near(&list(&solid["inertia_kg_m2"]), &[0.13, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.05], 1e-12);
    near(&[solid["density_kg_m3"].as_f64().unwrap()], &[2000.0], 1e-9);
    let placed = home.json("inertia box --size 100,200,300 --mass 12 --at 50,100,150 --rotation 0,0,90");
    near(&list(&placed["inertia_kg_m2"]), &[0.1, 0.0, 0.0, 0.0, 0.13, 0.0, 0.0, 0.0, 0.05], 1e-12);
    // About a corner: I + m (c² E − c cᵀ).
    let corner = [0.49, -0.06, -0.09, -0.06, 0.43, -0.18, -0.09, -0.18, 0.2];
    near(&list(&placed["inertia_about_origin_kg_m2"]), &corner, 1e-12);
    home.write("tetrahedron.obj", "v 0 0 0\nv 60 0 0\nv 0 60 0\nv 0 0 60\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    let mesh = home.json("inertia mesh --mesh tetrahedron.obj --scale 0.001 --density 1000");
    near(&[mesh["mass_kg"].as_f64().unwrap()], &[0.036], 1e-9);
    near(&list(&mesh["com_m"]), &[0.015; 3], 1e-9);
    assert!(home.succeeds("inertia sphere --size 50 --mass 1").contains("ixx=\"1.000000000e-3\""));
    home.fails(
        "inertia tube --size 18,20,300 --mass 1",
        2,
        "darm: --size 18,20,300: a tube has an outer radius, a smaller inner one and a length, such as 20,18,300",
    );
    home.fails("inertia box --size 1,0,1 --mass 1", 2, "darm: --size: 0 mm is not a length; give sizes above 0");
    assert_eq!(home.darm("inertia box --size 1,1,1").status.code(), Some(2));
}

#[test]
fn odometry_and_its_inverse_agree() {
    let home = Home::new();
    let drive = "odometry --radius 33 --track 160 --ticks-per-turn 4096";
    let to = home.json(&format!("{drive} --to 500,200"));
    let ticks = list(&to["ticks"]);
    let end = home.json(&format!("{drive} --ticks {}", numbers(&ticks)))["poses"][0].clone();
    near(&[end["x_m"].as_f64().unwrap(), end["y_m"].as_f64().unwrap()], &[0.5, 0.2], 1e-12);
    near(&[end["heading_rad"].as_f64().unwrap()], &[to["heading_rad"].as_f64().unwrap()], 1e-12);
    let wheels = list(&home.json(&format!("{drive} --velocity 200,-30"))["speeds_rad_s"]);
    let degrees: Vec<f64> = wheels.iter().map(|speed| speed.to_degrees()).collect();
    let moved = home.json(&format!("{drive} --speeds {} --time 3", numbers(&degrees)))["poses"][0].clone();
    near(&[moved["v_m_s"].as_f64().unwrap(), moved["w_rad_s"].as_f64().unwrap()], &[0.2, -30f64.to_radians()], 1e-12);
    // A quarter of a circle of radius v/ω.
    near(&[moved["heading_rad"].as_f64().unwrap()], &[-90f64.to_radians()], 1e-12);
    let radius = 0.2 / 30f64.to_radians();
    near(&[moved["x_m"].as_f64().unwrap(), moved["y_m"].as_f64().unwrap()], &[radius, -radius], 1e-12);
    home.fails(
        &format!("{drive} --to 500,0,90"),
        2,
        "darm: --to 500,0,90: the arc to this place ends at the heading 0.000 deg, not 90; leave the heading out, or drive two arcs",
    );
}

#[test]
fn ticks_counts_and_speeds_of_a_table_are_one_path() {
    let home = Home::new();
    let drive = "--radius 33 --track 160 --ticks-per-turn 4096";
    let (mut counts, mut speeds) =
        ("t_s,left_count,right_count\n0,0,0\n".to_owned(), "t_s,left_rad_s,right_rad_s\n".to_owned());
    let (mut sum, mut before) = ([0.0; 2], "0".to_owned());
    for line in std::fs::read_to_string(example("drive.csv")).unwrap().lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let ticks = [1, 2].map(|k| cells[k].parse::<f64>().unwrap());
        sum = [0, 1].map(|k| sum[k] + ticks[k]);
        counts += &format!("{},{},{}\n", cells[0], sum[0], sum[1]);
        let duration = cells[0].parse::<f64>().unwrap() - before.parse::<f64>().unwrap();
        let rate = ticks.map(|ticks| std::f64::consts::TAU * ticks / 4096.0 / duration);
        speeds += &format!("{before},{:?},{:?}\n", rate[0], rate[1]);
        before = cells[0].to_owned();
    }
    home.write("counts.csv", &counts);
    home.write("speeds.csv", &(speeds + &format!("{before},0,0\n")));
    let end = |file: &str| {
        let poses = home.json(&format!("odometry {file} {drive} --variance 40"))["poses"].clone();
        let last = poses.as_array().unwrap().last().unwrap().clone();
        ["x_m", "y_m", "heading_rad", "x_sd_m", "heading_sd_rad"].map(|key| last[key].as_f64().unwrap())
    };
    let ticks = end(&example("drive.csv"));
    near(&end("counts.csv"), &ticks, 1e-12);
    near(&end("speeds.csv"), &ticks, 1e-12);
    assert!(ticks[3] > 0.0 && ticks[4] > 0.0);
    home.write("back.csv", "t_s,left_ticks,right_ticks\n0,1,1\n0,1,1\n");
    home.fails(
        &format!("odometry back.csv {drive}"),
        1,
        "darm: back.csv:3:1: the time does not increase; sort the rows by time",
    );
    home.fails(
        &format!("odometry {} --radius 33 --track 160", example("drive.csv")),
        2,
        &format!("darm: {}: the columns are ticks; give --ticks-per-turn", example("drive.csv")),
    );
}
