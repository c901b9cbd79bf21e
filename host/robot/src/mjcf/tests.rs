//! What a model says and how it is computed, and models that are wrong.

use super::*;

fn parse_text(body: &str) -> Result<Robot, MjcfError> {
    parse(Path::new("m.xml"), &format!("<mujoco model=\"m\">\n{body}\n</mujoco>"), &Locks::new())
}

fn world(body: &str) -> String {
    format!("<worldbody>\n{body}\n</worldbody>")
}

fn refused(body: &str) -> String {
    parse_text(body).unwrap_err().to_string()
}

#[test]
fn errors_name_file_line_and_cure() {
    let cases = [
        (world("<body><joint type=\"ball\"/></body>"), "m.xml:3:7: a joint of type ball is not supported; write"),
        (world("<body><joint type=\"bent\"/></body>"), "m.xml:3:20: type is `bent`; give hinge, slide or free"),
        (world("<joint/>"), "m.xml:3:1: a joint of the world is not supported; give it to a body"),
        (world("<replicate count=\"2\"/>"), "m.xml:3:1: <replicate> in a body is not supported; save"),
        (world("<body pos=\"0 0\"/>"), "m.xml:3:12: pos is `0 0`; give three finite numbers"),
        (world("<body><joint axis=\"0 0 0\"/></body>"), "m.xml:3:20: axis is `0 0 0`; give a direction"),
        (world("<body><geom class=\"c\"/></body>"), "m.xml:3:20: no default class is named `c`; add it"),
        (world("<body><geom type=\"box\" size=\"1\"/></body>"), "m.xml:3:30: size is `1`; give as many sizes"),
        (world("<body><geom type=\"mesh\" mesh=\"m\"/></body>"), "m.xml:3:7: no mesh is named `m`; add it"),
        (world("<body><inertial pos=\"0 0 0\" mass=\"-1\"/></body>"), "m.xml:3:7: mass is -1; give at least 0"),
        (
            world("<body name=\"a\"><joint name=\"j\"/><joint name=\"j\"/></body>"),
            "m.xml:3:33: two of <joint> are named",
        ),
        (
            world("<body><freejoint/></body><body name=\"arm\"><joint/></body>"),
            "m.xml:3:43: a joint beside a body that floats is not supported; read one tree with --root 'body 1' or --root 'arm'",
        ),
        ("<compiler coordinate=\"global\"/>".into(), "m.xml:2:1: coordinate=\"global\" is not supported; save"),
        ("<asset/>".into(), "m.xml:1:1: the model has no <worldbody>; add one"),
        ("<include file=\"none.xml\"/>".into(), "m.xml:2:1: none.xml: cannot be read: No such file"),
        (
            world("<body><joint name=\"j\"/></body>") + "<equality><joint joint1=\"j\" joint2=\"k\"/></equality>",
            "m.xml:4:23: no hinge or slide joint is named `k`; add it",
        ),
        (
            world("<body><joint name=\"j\"/></body>") + "<equality><joint joint1=\"j\" joint2=\"j\"/></equality>",
            "m.xml:1:1: joint `j` follows itself or two others",
        ),
        ("<tendon><fixed armature=\"1\"/></tendon>".into(), "m.xml:2:9: the armature of an actuator or tendon is not"),
        (
            "<asset><mesh name=\"m\" vertex=\"0 0 0\" inertia=\"shell\" face=\"0 0 0\"/></asset>".to_owned()
                + &world("<body><geom type=\"mesh\" mesh=\"m\"/></body>"),
            "m.xml:2:8: the inertia `shell` of a mesh is not supported; give the body an <inertial>",
        ),
    ];
    for (body, expected) in cases {
        let error = refused(&body);
        assert!(error.starts_with(expected), "{body}: {error}");
    }
    let root = parse(Path::new("m.xml"), "<robot/>", &Locks::new()).unwrap_err().to_string();
    assert_eq!(root, "m.xml:1:1: the root element is <robot>, expected <mujoco>; give an MJCF");
    let lock = parse(Path::new("m.xml"), "<mujoco><worldbody/></mujoco>", &[("q".to_owned(), 0.0)].into());
    assert!(lock.unwrap_err().to_string().contains("there is no moving joint `q` to lock"));
}

#[test]
fn defaults_come_from_the_innermost_class() {
    let defaults = "<default><joint range=\"-90 90\" damping=\"1\"/><geom size=\"0.1 0.5\"/>\
         <default class=\"soft\"><joint damping=\"2\"/><default class=\"softer\"><joint armature=\"3\"/></default></default>\
         </default>";
    let bodies = world(
        "<body childclass=\"softer\"><joint name=\"a\"/><geom type=\"capsule\" size=\"0.2\"/>\
         <body><joint name=\"b\" class=\"main\" damping=\"4\"/><geom mass=\"1\"/></body></body>",
    );
    let robot = parse_text(&(defaults.to_owned() + &bodies)).unwrap();
    let [a, b] = &robot.joints[..] else { panic!("{robot:?}") };
    let right = std::f64::consts::FRAC_PI_2;
    assert_eq!((a.damping, a.armature, a.limits), (2.0, 3.0, Some([-right, right])));
    assert_eq!((b.damping, b.armature), (4.0, 0.0));
    // A capsule of the element's radius and the default's half length.
    let volume = std::f64::consts::PI * (0.04 + 4.0 / 3.0 * 0.008);
    assert!((a.joint.inertia.mass - 1000.0 * volume).abs() < 1e-9, "{}", a.joint.inertia.mass);
}

#[test]
fn joints_of_equalities_follow_and_are_held() {
    let bodies = world(
        "<body name=\"a\"><joint name=\"one\" ref=\"30\"/><geom size=\"1\"/><body name=\"b\"><joint name=\"two\" ref=\"10\"/>\
         <geom size=\"1\"/><body name=\"c\"><joint name=\"three\"/><geom size=\"1\"/></body></body></body>",
    );
    let equalities = "<equality><joint joint1=\"two\" joint2=\"one\" polycoef=\"0.1 2\"/><joint joint1=\"three\"/>\
         <connect body1=\"a\" body2=\"c\" anchor=\"0 0 0\"/><weld active=\"false\" body1=\"a\"/></equality>";
    let robot = parse_text(&(bodies + equalities)).unwrap();
    assert_eq!(robot.joints.len(), 2);
    let positions = robot.coupling().positions(&[30f64.to_radians()]);
    assert!((positions[1] - 10f64.to_radians() - 0.1).abs() < 1e-12, "{positions:?}");
    let said = robot.warnings.join("\n");
    assert!(
        said.contains("m.xml:4:") && said.contains("<connect> is not enforced") && !said.contains("weld"),
        "{said}"
    );
}

#[test]
fn an_attribute_that_is_misspelt_is_reported_with_its_place() {
    let finger = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/finger.xml");
    assert_eq!(read(&finger, &Locks::new()).unwrap().ignored, [""; 0]);
    let text = "<body name=\"a\"><joint rnage=\"0 1\"/><geom size=\"1\" solref=\"1 1\"/><camera foo=\"1\"/></body>";
    let robot =
        parse_text(&format!("{}<equality><joint joint1=\"j\" active=\"false\"/></equality>", world(text))).unwrap();
    let [said] = &robot.ignored[..] else { panic!("{:?}", robot.ignored) };
    assert!(said.ends_with(": unknown attribute `rnage` of <joint> is ignored; correct it"), "{said}");
    assert_eq!(said.split(':').nth(2), Some("23"), "{said}");
}

#[test]
fn an_included_file_stands_in_place_and_names_its_errors() {
    let folder = std::env::temp_dir().join(format!("darm-mjcf-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("main.xml", "<mujoco><worldbody><include file=\"body.xml\"/><body name=\"last\"/></worldbody></mujoco>");
    write("body.xml", "<mujoco>\n<body name=\"first\"><joint/><geom size=\"1\"/></body></mujoco>");
    let names = |robot: &Robot| robot.frames.iter().map(|frame| frame.name.clone()).collect::<Vec<_>>();
    let robot = read(&folder.join("main.xml"), &Locks::new()).unwrap();
    assert_eq!(names(&robot), ["world", "first", "last"]);
    write("body.xml", "<mujoco>\n<body><joint type=\"ball\"/></body></mujoco>");
    let error = read(&folder.join("main.xml"), &Locks::new()).unwrap_err().to_string();
    assert!(error.contains("body.xml:2:7: a joint of type ball"), "{error}");
    write("body.xml", "<mujoco><include file=\"body.xml\"/></mujoco>");
    let error = read(&folder.join("main.xml"), &Locks::new()).unwrap_err().to_string();
    assert!(error.contains("more than 1000 files include each other"), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_long_chain_is_read() {
    let count = 3000;
    let text =
        "<body pos=\"0 0 0.1\"><joint axis=\"1 0 0\"/><geom size=\"0.01\"/>".repeat(count) + &"</body>".repeat(count);
    assert_eq!(parse_text(&world(&text)).unwrap().joints.len(), count);
}

/// The tree on one body of a model.
fn tree(root: &str, body: &str) -> Result<Robot, MjcfError> {
    let source = Source::of_text(Path::new("m.xml"), &format!("<mujoco model=\"m\">\n{body}\n</mujoco>"));
    of_source(&source, &Selection { root: Some(root.into()), ..Selection::default() })
}

#[test]
fn a_robot_beside_free_objects_is_read_by_its_root() {
    let scene = world(
        "<body name=\"table\" pos=\"0 0 1\"><geom size=\"1\"/><body name=\"arm\" pos=\"1 0 0\"><joint name=\"q\"/><geom size=\"0.1\"/>\
         </body></body><body name=\"cube\"><freejoint/><geom size=\"0.1\"/><body><joint name=\"lid\" type=\"ball\"/></body></body>\
         <body name=\"ball\"><freejoint name=\"f\"/><geom size=\"0.2\"/></body><replicate count=\"3\"/>",
    );
    let equal = "<equality><joint joint1=\"lid\"/><joint joint1=\"q\" joint2=\"lid\"/></equality>";
    let arm = tree("arm", &(scene.clone() + equal)).unwrap();
    let names: Vec<&str> = arm.frames.iter().map(|frame| frame.name.as_str()).collect();
    assert_eq!((arm.joints.len(), arm.floating, names), (1, false, vec!["world", "table", "arm"]));
    // The body between the world and the root keeps its pose and is no part of the robot.
    let pose = arm.kinematics(arm.frame("arm").unwrap(), &[0.0]).unwrap().pose_base_frame;
    assert_eq!((pose.position.as_slice(), arm.base.mass), (&[1.0, 0.0, 1.0][..], 0.0));
    assert_eq!(
        arm.warnings.iter().filter(|said| said.contains("`lid` is not in the tree")).count(),
        1,
        "{:?}",
        arm.warnings
    );
    let ball = tree("ball", &scene).unwrap();
    let mass = 1000.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.008;
    assert!(ball.floating && ball.joints.is_empty() && (ball.mass() - mass).abs() < 1e-9, "{ball:?}");
    let error = |root: &str| tree(root, &scene).unwrap_err().to_string();
    assert_eq!(error("none"), "m.xml:1:1: no body is named `none`; give one of table, arm, cube, body 4, ball");
    assert!(error("cube").contains("a joint of type ball"), "{}", error("cube"));
    assert!(refused(&scene).contains("<replicate> in a body"), "{}", refused(&scene));
}

/// Of MuJoCo 3: M = diag(m + a, m + a, m + a, I + a, …), and for v = (1, 0, 0), ω = (0, 0, 2) in the axes of the body,
/// which is at the origin with its axes along those of the world, the force that holds v̇ = 0 in these axes is (m + a)·ω × v.
#[test]
fn the_armature_of_a_free_joint_is_on_all_six_axes_of_the_base() {
    use darm_core::dynamics::floating::BaseMotion;
    use darm_core::se::Twist;
    let body = world(
        "<body><joint type=\"free\" armature=\"0.5\"/><inertial pos=\"0 0 0\" mass=\"2\" diaginertia=\"1 2 3\"/></body>",
    );
    let robot = parse_text(&body).unwrap();
    let twist = Twist { angular: [0.0, 0.0, 2.0].into(), linear: [1.0, 0.0, 0.0].into() };
    let base = BaseMotion { twist, ..crate::robot::base_at_rest() };
    let found = robot.dynamics_on(&base, &crate::robot::Motion { state: [&[], &[], &[]], load: None }).unwrap();
    let of_base = found.base.unwrap();
    let diagonal: Vec<f64> = of_base.mass.diagonal().iter().copied().collect();
    assert_eq!(diagonal, [1.5, 2.5, 3.5, 2.5, 2.5, 2.5]);
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
    near(of_base.load.force.y, 2.5 * 2.0);
    near(of_base.load.force.z, 2.0 * 9.81);
    near(found.kinetic_j, 0.5 * (2.5 + 3.5 * 4.0));
    let forces = of_base.coriolis * twist.to_vector();
    near(forces[4], 5.0);
}

#[test]
fn a_site_with_the_name_of_a_body_has_a_frame_that_says_so() {
    let robot =
        parse_text(&world("<body name=\"a\"><site name=\"a\" pos=\"1 0 0\"/><site name=\"s\"/></body>")).unwrap();
    let names: Vec<&str> = robot.frames.iter().map(|frame| frame.name.as_str()).collect();
    assert_eq!(names, ["world", "a", "site:a", "s"]);
}
