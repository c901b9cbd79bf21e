//! What is said about tables whose contents are known.

use super::*;
use crate::measured::Measured;

/// The overview of a table with this text.
fn of(text: &str) -> Overview {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, text).unwrap();
    overview(&path, &Names::new(), &Preparation::default()).unwrap()
}

fn rows(n: usize, row: impl Fn(usize) -> String) -> String {
    (0..n).map(|k| row(k) + "\n").collect()
}

fn kinds(overview: &Overview) -> Vec<Measured> {
    overview.possible.iter().map(|one| one.kind).collect()
}

#[test]
fn columns_have_meaning_range_and_what_is_empty() {
    let row = |k: usize| format!("{:.2},{},{},7,{}", 0.01 * k as f64, k % 5, if k == 3 { "" } else { "4" }, k % 2);
    let found = of(&("t_s,q1_rad,tau1_nm,temp_c,note\n".to_string() + &rows(100, row)));
    let meanings: Vec<&str> = found.columns.iter().map(|column| &column.meaning[..]).collect();
    assert_eq!(meanings, ["time", "position of joint 1", "torque of joint 1", "temperature", ""]);
    let torque = &found.columns[2];
    assert_eq!((torque.numbers, torque.empty, torque.unit, torque.is_constant), (99, 1, "N·m", false));
    assert_eq!((found.columns[1].min, found.columns[1].max), (Some(0.0), Some(4.0)));
    assert!(found.columns[3].is_constant && !found.columns[1].is_constant);
    assert_eq!(
        (found.rows, found.held_out.rows),
        (100, 24),
        "the row with an empty cell is in a held-out block or not"
    );
    let sampling = found.sampling.as_ref().unwrap();
    assert!((sampling.rate_hz.unwrap() - 100.0).abs() < 0.1 && sampling.missing_rows == 1, "{sampling:?}");
    assert_eq!(kinds(&found), [Measured::JointTorque]);
}

#[test]
fn gaps_repeated_stamps_and_order_are_counted() {
    let row = |k: usize| {
        let time = 0.01 * k as f64 + if k >= 50 { 3.0 } else { 0.0 };
        format!(
            "{:.2},{},1",
            if k == 20 {
                0.19
            } else if k == 30 {
                0.05
            } else {
                time
            },
            k % 7
        )
    };
    let found = of(&("t_s,pressure_bar,force_n\n".to_string() + &rows(100, row)));
    let sampling = found.sampling.unwrap();
    assert_eq!((sampling.gaps, sampling.same_time, sampling.time_runs_back), (2, 1, 1));
}

#[test]
fn repeats_are_rows_with_equal_conditions_and_words_with_equal_words_before() {
    let force = of(&("t_s,pressure_bar,force_n\n".to_string() + &rows(60, |k| format!("{k},{},{k}", k % 20))));
    assert_eq!(force.repeats, Repeats { of: "rows", conditions: 20, dof: 40 });
    assert_eq!(force.possible[0].missing, ["the position, for friction and what else depends on motion"]);
    let word = |k: usize| format!("{k},0{:03b},0000,{k},1,2", k / 3 % 8);
    let poses = of(&("time_s,word,previous,x_m,y_m,angle_deg\n".to_string() + &rows(24, word)));
    assert_eq!(poses.repeats, Repeats { of: "words", conditions: 8, dof: 16 });
    assert_eq!(kinds(&poses), [Measured::ToolPose]);
    let missing = &poses.possible[0].missing;
    assert!(missing[0].ends_with("different words at least, there are 8") && missing.len() == 3, "{missing:?}");
}

#[test]
fn each_kind_of_measurement_is_recognised_by_its_columns() {
    for (header, kind, line) in [
        ("t_s,target_count,position_count", Measured::JointPosition, "kind = \"servo\""),
        ("t_s,p_bar,F_n", Measured::ActuatorForce, "bore_mm = …"),
        ("t_s,elbow_rad,tau_elbow_nm", Measured::JointTorque, ""),
        ("q1_rad,x_m,y_m,z_m", Measured::ToolPosition, "observed = \"tool-position\""),
        ("q1_rad,x_m,y_m,z_m,qx,qy,qz,qw", Measured::ToolPosition, "observed = \"tool-pose\""),
        ("t_s,q1_rad,px_m,py_m,pz_m,qx,qy,qz,qw,Fx_n,Fy_n,Fz_n", Measured::ContactWrench, ""),
    ] {
        let n = header.split(',').count();
        let row = |k: usize| (0..n).map(|column| (k + column).to_string()).collect::<Vec<_>>().join(",");
        let found = of(&format!("{header}\n{}", rows(40, row)));
        assert_eq!(kinds(&found), [kind], "{header}");
        let lines = found.possible[0].lines.join("\n");
        assert!(lines.contains(line) && lines.is_empty() == line.is_empty(), "{header}: {lines}");
    }
    let touched = of(&("q1_rad,socket\n".to_string() + &rows(40, |k| format!("{k},s{}", k % 3))));
    assert_eq!(kinds(&touched), [Measured::PointContact]);
    assert!(touched.possible[0].lines.contains(&"point = [\"socket\"]".to_string()));
    assert_eq!(kinds(&of(&("a,b\n".to_string() + &rows(40, |k| format!("{k},{k}"))))), []);
}

#[test]
fn units_that_look_wrong_are_asked_about_with_the_option_that_corrects_them() {
    for (column, value, question) in [
        ("q1_rad", 170.0, "goes up to 170 rad: are these degrees? --column q1_deg=q1_rad reads them so"),
        ("x_m", 350.0, "goes up to 350 m: are these millimetres? --column x_mm=x_m reads them so"),
        ("p", 5.0, "goes up to 5 Pa: are these bar? --column p_bar=p reads them so"),
        ("p_bar", 5e5, "goes up to 50000000000 Pa: are these pascal? --column p_pa=p_bar reads them so"),
        ("temp_c", 293.0, "is usually 293 °C: are these kelvin? --column temp_k=temp_c reads them so"),
        ("temp_k", 21.0, "is usually 21 K: are these degrees Celsius? --column temp_c=temp_k reads them so"),
        ("q1_deg", 1.5, "never exceeds 1.50 deg: are these radians? --column q1_rad=q1_deg reads them so"),
    ] {
        let text = format!("t_s,{column}\n{}", rows(40, |k| format!("{k},{value}")));
        let [asked] = &of(&text).questions[..] else { panic!("{column}") };
        assert_eq!(asked.text, format!("{column} {question}"));
        assert_eq!(asked.column.as_deref(), Some(column));
    }
    let good = "t_s,q1_deg,x_mm,p_bar,temp_c\n".to_string() + &rows(40, |k| format!("{k},170,350,5,21"));
    assert_eq!(of(&good).questions, []);
}
