//! Robots of public URDF files against the values that Pinocchio computed from them, and files that are wrong.

use std::io::Read as _;
use std::path::PathBuf;

use darm_core::dynamics::{self, floating};
use darm_core::real::Vec3;
use darm_core::se::Twist;
use darm_core::tree::Frames;
use serde_json::Value;

use super::*;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data").join(name)
}

fn golden(name: &str) -> Value {
    let mut text = String::new();
    let file = std::fs::File::open(data(&format!("golden/{name}.json.gz"))).unwrap();
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().flat_map(|x| x.as_f64().map_or_else(|| list(x), |x| vec![x])).collect()
}

#[track_caller]
fn near(ours: &[f64], theirs: &[f64], scale: f64) {
    assert_eq!(ours.len(), theirs.len());
    let scale = theirs.iter().fold(scale, |scale, x| scale.max(x.abs()));
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() <= 1e-12 * scale, "{a} is not {b}");
    }
}

/// The first `count` of a sample's numbers, and zeros for the joints that only fill the tree up.
fn padded<const N: usize>(value: &Value, skip: usize) -> [f64; N] {
    let mut padded = [0.0; N];
    let given = list(value);
    padded.iter_mut().zip(&given[skip..]).for_each(|(to, from)| *to = *from);
    padded
}

fn check_arm(name: &str, locks: &Locks, frame: &str) {
    let robot = read(&data(&format!("urdf/{name}.urdf")), locks).unwrap();
    let file = golden(&format!("{name}_urdf"));
    let tree = robot.tree::<8>().unwrap();
    let tool = robot.frame(frame).unwrap().in_tree(&tree);
    let joints = robot.joints.len();
    for (ours, theirs) in robot.joints.iter().zip(file["joints"].as_array().unwrap()) {
        assert_eq!(ours.name, theirs["name"].as_str().unwrap());
        assert_eq!(ours.limits.unwrap().to_vec(), list(&theirs["limits"]));
    }
    for sample in file["samples"].as_array().unwrap() {
        let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| padded::<8>(&sample[key], 0));
        let mut frames = Frames::default();
        tree.place(&q, &mut frames);
        let pose = frames.pose(&tool);
        let matrix: Vec<f64> = (0..3)
            .flat_map(|row| (0..4).map(move |c| if c < 3 { pose.rotation[(row, c)] } else { pose.position[row] }))
            .collect();
        near(&matrix, &list(&sample["T"])[..12], 1.0);
        let torque = dynamics::inverse_dynamics(&tree, &q, &qd, &qdd, None);
        near(&torque[..joints], &list(&sample["tau_rnea"]), 1.0);
        assert!(torque[joints..].iter().all(|torque| *torque == 0.0));
        let mass = dynamics::mass_matrix(&tree, &q);
        let mass: Vec<f64> = (0..joints).flat_map(|row| (0..joints).map(move |column| mass[(row, column)])).collect();
        near(&mass, &list(&sample["M"]), 0.0);
    }
}

#[test]
fn arms_are_those_that_pinocchio_reads() {
    let fingers = [1, 2].map(|finger| (format!("panda_finger_joint{finger}"), 0.0)).into();
    check_arm("panda", &fingers, "panda_hand_tcp");
    check_arm("ur10", &Locks::new(), "tool0");
}

#[test]
fn a_humanoid_with_branches_floats() {
    const N: usize = 32;
    let mut robot = read(&data("urdf/simple_humanoid.urdf"), &Locks::new()).unwrap();
    robot.floating = true;
    let (tree, file) = (robot.tree::<N>().unwrap(), golden("simple_humanoid_floating"));
    // Pinocchio walks children by the order of their names.
    let theirs: Vec<_> = file["joints"].as_array().unwrap()[1..].iter().map(|j| j["name"].as_str().unwrap()).collect();
    let order: Vec<_> = theirs.iter().map(|name| robot.joints.iter().position(|j| j.name == *name).unwrap()).collect();
    assert!((robot.mass() - file["total_mass"].as_f64().unwrap()).abs() < 1e-9);
    for sample in file["samples"].as_array().unwrap() {
        let [q, qd, qdd] = [("q", 7), ("qd", 6), ("qdd", 6)].map(|(key, skip)| {
            let given = padded::<N>(&sample[key], skip);
            let mut ours = [0.0; N];
            order.iter().zip(given).for_each(|(at, value)| ours[*at] = value);
            ours
        });
        let base = list(&sample["q"]);
        let turn =
            nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(base[6], base[3], base[4], base[5]));
        let twist = |key: &str| {
            let v = list(&sample[key]);
            Twist { angular: [v[3], v[4], v[5]].into(), linear: [v[0], v[1], v[2]].into() }
        };
        let pose = darm_core::se::Pose {
            rotation: turn.to_rotation_matrix().into_inner(),
            position: [base[0], base[1], base[2]].into(),
        };
        let motion = floating::BaseMotion { pose, twist: twist("qd"), twist_rate: twist("qdd") };
        let (load, torque) = floating::inverse_dynamics(&tree, &motion, [&q, &qd, &qdd], None);
        let ours: Vec<f64> =
            load.force.iter().chain(&load.moment).copied().chain(order.iter().map(|k| torque[*k])).collect();
        near(&ours, &list(&sample["tau_rnea"]), 0.0);
    }
}

#[test]
fn what_a_file_tells_by_the_way_is_kept() {
    let robot = read(&data("urdf/panda.urdf"), &Locks::new()).unwrap();
    assert_eq!(robot.joints.len(), 9);
    assert_eq!(
        (robot.joints[0].effort, robot.joints[0].velocity, robot.joints[0].damping),
        (Some(87.0), Some(2.175), 0.003)
    );
    assert!(
        robot.warnings.iter().any(|warning| warning.contains("`panda_finger_joint2` mimics `panda_finger_joint1`"))
    );
    let robot = read(&data("urdf/tx40.urdf"), &Locks::new()).unwrap();
    assert_eq!(robot.tool().unwrap().name, "tool0");
    assert_eq!(robot.path(robot.tool().unwrap()), [0, 1, 2, 3, 4, 5]);
    assert_eq!(robot.base.mass, 4.2);
}

/// A robot of a base and the given elements.
fn refused(body: &str) -> String {
    let text = format!("<robot name=\"r\">\n<link name=\"base\"/>\n{body}\n</robot>");
    parse(Path::new("r.urdf"), &text, &Locks::new()).unwrap_err().to_string()
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!(
        "<link name=\"{child}\"/>\n<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{inside}</joint>\n"
    )
}

#[test]
fn errors_name_file_line_and_element() {
    let cases = [
        (
            joint("j", "planar", "base", "a", ""),
            "r.urdf:4:1: joint `j` is planar: write it as two prismatic joints and a revolute one",
        ),
        (
            joint("j", "revolute", "gone", "a", ""),
            "r.urdf:4:1: joint `j` names the link `gone`, which is not in the file; add it",
        ),
        (
            joint("j", "revolute", "base", "a", "<axis xyz=\"0 0 0\"/>"),
            "r.urdf:4:71: joint `j` has an axis without direction; give xyz a length of 1",
        ),
        (
            joint("j", "revolute", "base", "a", "<origin xyz=\"0 NaN 0\"/>"),
            "r.urdf:4:84: xyz is `0 NaN 0`; give 3 finite numbers between blanks",
        ),
        (
            joint("j", "revolute", "base", "a", "<limit lower=\"1\" upper=\"-1\" velocity=\"1\"/>"),
            "r.urdf:4:71: joint `j` has the limits 1 to -1; exchange them",
        ),
        ("<link name=\"base\"/>".into(), "r.urdf:3:1: two <link> elements are named `base`; rename one"),
        (
            "<link name=\"other\"/>".into(),
            "r.urdf:1:1: the robot has 2 root links (base, other), there must be one; connect them by joints, or read one of them with --root",
        ),
        (
            joint("j", "fixed", "base", "a", "")
                + "<joint name=\"k\" type=\"fixed\"><parent link=\"base\"/><child link=\"a\"/></joint>",
            "r.urdf:5:1: link `a` is the child of two joints, `j` and `k`: a loop cannot be computed, cut it",
        ),
        (
            joint("j", "fixed", "b", "a", "") + &joint("k", "fixed", "a", "b", ""),
            "r.urdf:3:1: link `a` is in a loop of joints: cut the loop",
        ),
    ];
    for (body, expected) in cases {
        assert_eq!(refused(&body), expected);
    }
    let locks = [("q".to_owned(), 0.0)].into();
    let error = read(&data("urdf/tx40.urdf"), &locks).unwrap_err().to_string();
    assert!(
        error.ends_with(
            "there is no moving joint `q` to lock; there are joint_1, joint_2, joint_3, joint_4, joint_5, joint_6"
        ),
        "{error}"
    );
}

#[test]
fn what_is_not_read_cannot_fail() {
    let visual =
        "<visual><geometry><mesh/><ellipsoid radii=\"1 2 3\"/></geometry><material><texture/></material></visual>";
    let inside = format!(
        "{visual}<collision><geometry/></collision><inertial><mass value=\"2\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>"
    );
    let text = format!(
        "<robot name=\"r\"><material name=\"m\"><texture/></material><transmission/>\n<link name=\"base\">{inside}</link></robot>"
    );
    let robot = parse(Path::new("r.urdf"), &text, &Locks::new()).unwrap();
    assert_eq!(robot.base.mass, 2.0);
}

/// q₃ = 0.5 q₂ + 0.1 and q₄ = −2 q₃ + 0.2 = −q₂; a lock of joint 2 holds both, one of joint 3 frees joint 4 of joint 2.
#[test]
fn a_joint_follows_through_others() {
    let mimic = |of: &str, factor: f64, offset: f64| {
        format!("<mimic joint=\"{of}\" multiplier=\"{factor}\" offset=\"{offset}\"/>")
    };
    let body = joint("j4", "continuous", "c", "d", &mimic("j3", -2.0, 0.2))
        + &joint("j2", "continuous", "base", "b", "")
        + &joint("j3", "continuous", "b", "c", &mimic("j2", 0.5, 0.1));
    let text = format!("<robot name=\"r\"><link name=\"base\"/>{body}</robot>");
    let read = |locks: &Locks| parse(Path::new("r.urdf"), &text, locks).unwrap();
    let robot = read(&Locks::new());
    assert_eq!(robot.coordinates().collect::<Vec<_>>(), [0]);
    assert_eq!(robot.coupling().positions(&[0.6]), [0.6, 0.4, -0.6]);
    let jacobian = robot.kinematics(robot.frame("d").unwrap(), &[0.6]).unwrap().jacobian_base;
    assert_eq!(jacobian.column(0).iter().copied().collect::<Vec<_>>(), [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(read(&[("j2".to_owned(), 0.2)].into()).joints.is_empty());
    let freed = read(&[("j3".to_owned(), 0.2)].into());
    assert_eq!(freed.coordinates().count(), 1, "joint 4 is held at -0.2");
    assert!(robot.kinematics(robot.frame("d").unwrap(), &[0.0; 3]).is_err(), "one coordinate, three numbers");
}

#[test]
fn a_mimic_joint_of_none_or_itself_is_an_error() {
    let mimic = |joint: &str| format!("<mimic joint=\"{joint}\"/>");
    let unknown = joint("j", "continuous", "base", "a", &mimic("k"));
    assert_eq!(refused(&unknown), "r.urdf:4:73: joint `j` mimics `k`, which is no moving joint; there are j");
    let circle = joint("j", "continuous", "base", "a", &mimic("k")) + &joint("k", "continuous", "a", "b", &mimic("j"));
    assert_eq!(
        refused(&circle),
        "r.urdf:4:73: joint `j` mimics itself, directly or through others; remove one <mimic>"
    );
}

#[test]
fn what_does_not_parse_has_a_place() {
    let cases = [
        (
            "<link name=\"a\"><inertial><mass value=\"1x\"/></inertial></link>\n\
             <joint name=\"j\" type=\"fixed\"><parent link=\"base\"/><child link=\"a\"/></joint>",
            "r.urdf:3:39: value is `1x`; give 1 finite number",
        ),
        ("<joint name=\"j\" type=\"bent\"/>", "r.urdf:3:1: <joint> has no <parent>; add it"),
        ("<link name=\"a\"/><joint type=\"fixed\"/>", "r.urdf:3:17: <joint> has no name; add name=\"…\""),
        ("<link name=\"a\">", "r.urdf:4:1: "),
        ("  <link", "r.urdf:3:3: "),
    ];
    for (body, expected) in cases {
        let error = refused(body);
        assert!(error.starts_with(expected), "{body}: {error}");
    }
}

#[test]
fn no_text_makes_it_panic() {
    let whole = std::fs::read_to_string(data("urdf/tx40.urdf")).unwrap();
    for cut in (0..whole.len()).step_by(97) {
        let _ = parse(Path::new("cut.urdf"), &whole[..cut], &Locks::new());
        let _ = parse(
            Path::new("hole.urdf"),
            &format!("{}{}", &whole[..cut], &whole[(cut + 60).min(whole.len())..]),
            &Locks::new(),
        );
    }
}

fn small(body: &str) -> Result<Robot, String> {
    parse(Path::new("r.urdf"), &format!("<robot name=\"r\">\n{body}\n</robot>"), &Locks::new())
        .map_err(|e| e.to_string())
}

#[test]
fn a_rotation_is_read_as_a_quaternion_and_unknown_attributes_are_reported() {
    let joint = |origin: &str| {
        format!(
            "<link name=\"a\"/><link name=\"b\"/><joint name=\"j\" type=\"fixed\"><origin {origin}/><parent link=\"a\"/>\
             <child link=\"b\"/></joint>"
        )
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let robot = small(&joint(&format!("xyz=\"1 2 3\" quat_xyzw=\"{half} 0 0 {half}\""))).unwrap();
    let pose = robot.frame("b").unwrap().pose;
    // A quarter of a turn about x takes y to z.
    assert!((pose.rotation * Vec3::y() - Vec3::z()).norm() < 1e-12 && pose.position == Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(robot.ignored, [""; 0]);
    let both = small(&joint("quat_xyzw=\"0 0 0 1\" rpy=\"0 0 0\"")).unwrap_err();
    assert!(both.ends_with("quat_xyzw and rpy both give the rotation; remove one"), "{both}");
    assert!(small(&joint("quat_xyzw=\"0 0 0 0\"")).unwrap_err().contains("has no length"));
    let [said] = &small(&joint("xyz=\"0 0 0\" ryp=\"1 0 0\"")).unwrap().ignored[..] else { panic!() };
    assert_eq!(said, "r.urdf:2:82: unknown attribute `ryp` of <origin> is ignored; correct it");
    let ignored = small(&joint("xyz=\"0 0 0\"/><orgin xyz=\"0 0 1\"/><origin xyz=\"0 0 2\"")).unwrap().ignored;
    let said: Vec<&str> = ignored.iter().filter_map(|said| said.splitn(4, ':').nth(3)).collect();
    let expected = ["unknown element <orgin>", "second element <origin>"];
    assert_eq!(said, expected.map(|what| format!(" {what} of <joint> is ignored; correct it")));
}

#[test]
fn xacro_is_refused_with_the_command_that_expands_it() {
    for body in ["<link name=\"a\"/><xacro:seg n=\"1\"/>", "<xacro:macro name=\"m\"><link name=\"a\"/></xacro:macro>"] {
        let error = small(body).unwrap_err();
        assert!(
            error.contains("xacro") && error.ends_with("run `xacro r.urdf > expanded.urdf` and give expanded.urdf"),
            "{error}"
        );
    }
    let error = small("<link name=\"a\"/><link name=\"${p}b\"/>").unwrap_err();
    assert!(error.contains("`${p}b` is xacro"), "{error}");
    let other = "<robot name=\"r\" xmlns:x=\"http://www.ros.org/wiki/xacro\"><link name=\"a\"/><x:seg/></robot>";
    let error = parse(Path::new("r.urdf"), other, &Locks::new()).unwrap_err().to_string();
    assert!(error.contains("<x:seg> is xacro"), "{error}");
    assert!(small("<link name=\"a\"/>").is_ok());
}

#[test]
fn one_of_several_trees_is_read_by_its_root() {
    let text = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/><joint name=\"j\" type=\"continuous\">\
                <parent link=\"b\"/><child link=\"c\"/></joint></robot>";
    let source = Source::of_text(Path::new("r.urdf"), text);
    let rooted = |root: Option<&str>| {
        let selection = Selection { root: root.map(str::to_owned), ..Selection::default() };
        of_parsed(&source, Document::parse(&source), &selection).map_err(|error| error.to_string())
    };
    let names: Vec<String> = rooted(Some("b")).unwrap().frames.into_iter().map(|frame| frame.name).collect();
    assert_eq!(names, ["b", "c"]);
    assert!(rooted(None).unwrap_err().ends_with("connect them by joints, or read one of them with --root"));
    assert!(rooted(Some("x")).unwrap_err().ends_with("no link is named `x`; give one of a, b, c"));
}

#[test]
fn a_robot_that_does_not_move_has_the_mass_zero() {
    let mass = small("<link name=\"a\"><inertial><mass value=\"1\"/></inertial></link>").unwrap().mass();
    assert!(mass == 0.0 && mass.is_sign_positive(), "{mass:?}");
}
