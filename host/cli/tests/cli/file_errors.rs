//! Errors in files: `FILE:LINE:COLUMN: what is wrong; what to do`, in every command that reads them.

use super::{Home, example, text};

/// Files with a fault, the command that reads each, and what it prints.
#[test]
fn a_fault_in_a_file_has_one_form() {
    let home = Home::new();
    let [puma, planar4, frames] = ["puma560.toml", "planar4.toml", "planar4-frames.toml"].map(example);
    let synth = format!("synth {planar4} {frames} -o x.toml --catalogue file");
    let odometry = "odometry --radius 50 --track 300 --ticks-per-turn 100 file".to_owned();
    let parts = "part,stroke_mm,retracted_mm,force_n,price\n";
    let poses = "time_s,word,x_m,y_m,angle_deg\n";
    let missing = "cannot be read: No such file or directory (os error 2); check the path";
    for (command, content, expected) in [
        (&format!("ik {puma} --targets file"), "x_m,y_m,z_m\n1,2\n", "file:2:4: the row has 2 cells, the header has 3; correct the row".into()),
        (&format!("fk {puma} --postures file"), "", "file: the file is empty; give a table with a header".into()),
        (&odometry, "left_ticks,right_ticks\n1,2\n1, x\n", "file:3:4: column right_ticks holds `x`, expected a number; correct the cell".into()),
        (&odometry, "t_s,left_ticks,right_ticks\n1,1,2\n1,1,2\n", "file:3:1: the time does not increase; sort the rows by time".into()),
        (&synth, &format!("{parts}a,0,2,3,4\n"), "file:2:3: column stroke_mm holds `0`, expected a number above 0; correct the cell".into()),
        (&synth, "part\na\n", "file: no column price; the file has part; add or rename a column".into()),
        (&format!("diagnose {planar4} file"), &format!("{poses}0,0a0,1,2,3\n"), "file:2:3: column word holds `0a0`, expected digits 0 to 3; correct the cell".into()),
        (&format!("diagnose {planar4} file"), &format!("{poses}0,000,1,2\n"), "file:2:10: the row has 4 cells, the header has 5; correct the row".into()),
        (&"diagnose file file".to_owned(), "kind = \"cylinder\"\nbore_mm = -1\n", "file:2:11: the length is -1 mm; give a number above 0".into()),
        (&"fk file.toml".to_owned(), "kind = \"robot\"\nurdf = \"none.urdf\"\nobserved = \"torque\"\n", format!("file.toml:2:8: none.urdf: {missing}")),
        (&"dynamics file.toml".to_owned(), "kind = \"robot\"\nnumber = 3\nurdf = \"none.urdf\"\nobserved = \"torc\"\n",
            "file.toml:4:12: unknown variant `torc`, expected one of `torque`, `wrench`, `point-contact`, `tool-position`, `tool-pose`; correct the TOML".into()),
        (&"fk file.toml".to_owned(), "format = \n", "file.toml:1:10: string values must be quoted, expected literal string; correct the TOML".into()),
        (&"fk file.urdf".to_owned(), "<robot name=\"r\">\n<link name=\"l\"></robot>", "file.urdf:2:16: ill-formed document: expected `</link>`, but `</robot>` was found; correct the XML".into()),
        (&"fk file.xml".to_owned(), "<mujoco>\n <include file=\"none.xml\"/></mujoco>", format!("file.xml:2:2: none.xml: {missing}")),
    ] {
        let file = command.split_whitespace().find(|word| word.starts_with("file")).unwrap_or("file");
        home.write(file, content);
        home.fails(command, 1, &format!("darm: {expected}"));
    }
    for command in
        ["fk", "dynamics", "jacobian", "draw -o x.svg", "com", "model", "map", "nearest 1,2,3", "sim", "profile check"]
    {
        let (name, rest) = command.split_once(' ').unwrap_or((command, ""));
        let line =
            if name == "profile" { "profile check none.toml".to_owned() } else { format!("{name} none.toml {rest}") };
        home.fails(&line, 1, &format!("darm: none.toml: {missing}"));
    }
}

#[test]
fn an_attribute_that_no_element_has_is_reported() {
    let home = Home::new();
    home.write(
        "arm.xml",
        "<mujoco><worldbody><body>\n<joint rnage=\"0 1\"/><geom size=\"1\"/></body></worldbody></mujoco>",
    );
    let said = home.darm("fk arm.xml");
    assert!(said.status.success());
    assert_eq!(
        text(&said.stderr).trim(),
        "note: arm.xml:2:8: unknown attribute `rnage` of <joint> is ignored; correct it"
    );
}

#[test]
fn a_robot_without_joints_has_no_torques() {
    let home = Home::new();
    home.write("rod.urdf", "<robot name=\"rod\"><link name=\"rod\"/></robot>");
    let message =
        "darm: run.csv: the robot of the model has no moving joint, so it has no torques; give the model of these data";
    home.write("run.csv", &format!("t_s,q1\n{}", (0..50).map(|k| format!("{k},0\n")).collect::<String>()));
    home.fails("diagnose rod.urdf run.csv", 1, message);
}
