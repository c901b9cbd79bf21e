//! Recordings that NumPy, SciPy and ROS 2 wrote (`tests/data/foreign/make.py`) come out with their numbers.

use std::path::{Path, PathBuf};

use darm_measure::import::mapping::{Entry, Mapping};
use darm_measure::import::read::Dialect;
use darm_measure::import::table::Table;
use darm_measure::import::{Column, ImportError, Recording, proposal, read};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn foreign(name: &str) -> Recording {
    let folder = if name.starts_with("foreign") { "examples" } else { "tests/data/foreign" };
    read(&root().join(folder).join(name), Dialect::default()).unwrap()
}

fn column<'a>(recording: &'a Recording, name: &str) -> &'a Column {
    let mut all = recording.parts.iter().flat_map(|part| &part.columns);
    all.find(|column| column.name == name).unwrap_or_else(|| panic!("{name}: {:?}", names(recording)))
}

fn names(recording: &Recording) -> Vec<&str> {
    recording.parts.iter().flat_map(|part| &part.columns).map(|column| column.name.as_str()).collect()
}

fn mapping(entries: &[&str]) -> Mapping {
    let entries = entries.iter().map(|entry| entry.parse::<Entry>().unwrap()).collect();
    Mapping { entries, ..Mapping::default() }
}

fn table(recording: &Recording, entries: &[&str]) -> Result<Table, ImportError> {
    Table::new(std::slice::from_ref(recording), &mapping(entries))
}

fn proposed(recording: &Recording) -> Table {
    Table::new(std::slice::from_ref(recording), &proposal::propose(recording, &[])).unwrap()
}

fn numbers(table: &Table, name: &str) -> Vec<f64> {
    let at = table.names.iter().position(|own| own == name).unwrap_or_else(|| panic!("{name}: {:?}", table.names));
    table.rows.iter().map(|row| row[at].parse().unwrap_or(f64::NAN)).collect()
}

fn is_near(found: &[f64], expected: impl Fn(f64) -> f64) -> bool {
    found.iter().enumerate().all(|(k, x)| (x - expected(k as f64)).abs() < 1e-4)
}

#[test]
fn a_text_with_semicolons_and_decimal_commas_is_read() {
    let recording = foreign("foreign-robot.csv");
    let table = proposed(&recording);
    assert_eq!(table.names, ["time_s", "q1_deg", "q2_deg", "tau1_nm", "Ventil"]);
    assert!(is_near(&numbers(&table, "time_s"), |k| 0.025 * k));
    assert!(is_near(&numbers(&table, "q1_deg"), |k| 30.0 * (0.1 * k).sin()));
    assert_eq!((table.rows[7][3].as_str(), table.rows[7][4].as_str()), ("", "an"));
    assert!(table.notes[0].starts_with("1 of 40 rows have an empty cell"), "{:?}", table.notes);
}

#[test]
fn arrays_of_numpy_are_read() {
    let recording = foreign("foreign-arrays.npz");
    let mapped = table(&recording, &["time_s=t*ms", "q#_rad=q[:,*]*deg", "tau2_nm=tau(:,2)"]).unwrap();
    assert_eq!(mapped.names, ["time_s", "q1_rad", "q2_rad", "tau2_nm"]);
    assert!(is_near(&numbers(&mapped, "q2_rad"), |k| (20.0 * (0.1 * k).cos()).to_radians()));
    assert!(is_near(&numbers(&mapped, "tau2_nm"), |k| 2.0 * (0.1 * k).cos()));
    let error = table(&recording, &["time_s=t*ms", "rate=rate"]).unwrap_err().to_string();
    assert!(error.contains("rate has 1 rows, t has 40"), "{error}");
    assert_eq!(proposed(&recording).names, ["time_s", "q1_rad", "q2_rad", "tau1_nm", "tau2_nm"]);
    let big = foreign("big-endian.npy");
    assert!(is_near(&column(&big, "big-endian[:,0]").numbers, |k| 30.0 * (0.1 * k).sin()));
    let records = foreign("records.npy");
    let all: Vec<f64> =
        ["t", "n", "on"].iter().flat_map(|name| column(&records, &format!("records.{name}")).numbers.clone()).collect();
    assert_eq!(all, [0.0, 0.5, 1.0, -2.0, 1.0, 0.0]);
}

#[test]
fn matrices_and_structs_of_matlab_are_read() {
    let recording = foreign("foreign-matlab.mat");
    let mapped = table(&recording, &["time_s=log.t", "q#_rad=log.q(:,*)", "Fz_n=log.sensor.Fz"]).unwrap();
    assert!(is_near(&numbers(&mapped, "q1_rad"), |k| (30.0 * (0.1 * k).sin()).to_radians()));
    assert!(is_near(&numbers(&mapped, "Fz_n"), |k| (700.0 + 30.0 * (0.1 * k).sin()).floor()));
    let note = recording.parts.iter().find(|part| part.name == "note").unwrap();
    assert!(note.kind.starts_with("text, not read") && note.columns.is_empty());
    let plain = foreign("plain.mat");
    assert_eq!(column(&plain, "q[1,:]").numbers.len(), 3);
    assert_eq!((column(&plain, "two[0].q").numbers.len(), column(&plain, "two[1].q").numbers.len()), (3, 4));
    let kinds: Vec<&str> = plain.parts.iter().map(|part| part.kind.split(',').next().unwrap()).collect();
    assert_eq!(kinds, ["float64", "float64", "float64", "cell", "complex matrix"]);
}

#[test]
fn topics_of_ros_are_joined_by_time_and_joints_by_name() {
    let recording = foreign("foreign-ros2.mcap");
    let entries = [
        "time_s=/joint_states/stamp",
        "base_rad=position.base",
        "elbow_rad=position.elbow",
        "tau_base_nm=effort.base",
        "Fx_n=force.x",
    ];
    let mapped = table(&recording, &entries).unwrap();
    // The first stamp of the log is one of the wrench, 3 ms before.
    assert!(is_near(&numbers(&mapped, "time_s"), |k| 0.003 + 0.02 * k));
    assert!(
        is_near(&numbers(&mapped, "base_rad"), |k| 0.02 * k),
        "each third message has the joints in the other order"
    );
    assert!(is_near(&numbers(&mapped, "elbow_rad"), |k| 0.5 - 0.02 * k));
    assert!(is_near(&numbers(&mapped, "tau_base_nm"), |k| 1.0 + 0.02 * k));
    let force = numbers(&mapped, "Fx_n");
    let missing: Vec<usize> = (0..20).filter(|k| force[*k].is_nan()).collect();
    assert_eq!(missing, [10, 11, 12, 13, 14], "the gap");
    assert!(force.iter().enumerate().all(|(k, x)| x.is_nan() || (x - (0.3 + 2.0 * k as f64)).abs() < 1e-9));
    assert_eq!(mapped.about[1], ("first_row_unix_s".into(), "1700000000.000000000".into()));
    let unread = recording.parts.iter().find(|part| part.name == "/rosout").unwrap();
    assert_eq!(unread.kind, "std_msgs/msg/String in cdr, not read");
}

#[test]
fn poses_have_a_rotation_vector_and_are_proposed_as_the_base() {
    let recording = foreign("foreign-ros2.mcap");
    let all = proposed(&recording);
    assert_eq!(all.rows.len(), 10, "the rows of the poses");
    assert!(is_near(&numbers(&all, "rz_rad")[..8], |k| 0.4 * k), "below half a turn");
    assert!(is_near(&numbers(&all, "x_m"), |k| 0.2 * k));
    assert!(is_near(&numbers(&all, "base_rad"), |k| 0.04 * k));
}

#[test]
fn a_bag_folder_is_read() {
    let recording = foreign("bag");
    let mapped = table(&recording, &["time_s=stamp", "slider_mm=position.slider*m", "base_deg=position.base"]).unwrap();
    assert!(is_near(&numbers(&mapped, "time_s"), |k| 0.01 * k));
    assert!(is_near(&numbers(&mapped, "slider_mm"), |k| 10.0 * k));
    assert!(is_near(&numbers(&mapped, "base_deg"), |_| 1f64.to_degrees()));
}

#[test]
fn files_are_appended_or_joined() {
    let two = [foreign("foreign-robot.csv"), foreign("foreign-robot.csv")];
    let entries = mapping(&["time_s=Zeit", "q1_deg=Achse 1"]);
    let all = Table::new(&two, &entries).unwrap();
    assert_eq!((all.rows.len(), &all.names[2..]), (80, &["run".to_owned(), "file".to_owned()][..]));
    assert_eq!(all.rows[40][2..], ["1", "foreign-robot"]);
    let joined = darm_measure::import::join::side_by_side(two.into()).unwrap();
    assert!(names(&joined).contains(&"foreign-robot/Achse 1 [deg]"));
}
