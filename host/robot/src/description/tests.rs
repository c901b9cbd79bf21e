//! Files of both formats against Pinocchio and MuJoCo, and the same tree in both.

use std::io::Read as _;

use proptest::prelude::*;
use serde_json::Value;

use darm_core::real::Vec3;

use std::path::Path;

use super::*;
use crate::robot::Motion;
use crate::shape::Geometry;

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().flat_map(|x| x.as_f64().map_or_else(|| list(x), |x| vec![x])).collect()
}

/// Agreement to 1e-10 of the largest entry.
#[track_caller]
fn near(name: &str, ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len(), "{name}");
    let scale = theirs.iter().fold(0.0, |scale: f64, x| scale.max(x.abs()));
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() <= 1e-10 * scale.max(1e-3), "{name}: {a} is not {b}");
    }
}

/// The robot of a text in a scratch folder.
fn parse(format: &str, text: &str) -> Result<Robot, DescriptionError> {
    let path = Path::new("model").with_extension(format);
    Ok(if format == "urdf" {
        urdf::parse(&path, text, &Locks::new())?
    } else {
        mjcf::parse(&path, text, &Locks::new())?
    })
}

/// Of all coordinates those of the reference, whose order is that of names in a URDF.
fn order(robot: &Robot, names: &[Value]) -> Vec<usize> {
    let ours: Vec<&str> = robot.coordinates().map(|joint| robot.joints[joint].name.as_str()).collect();
    assert_eq!(ours.len(), names.len(), "{}: {ours:?}", robot.name);
    let at = |name: &Value| ours.iter().position(|own| Some(*own) == name.as_str());
    names.iter().enumerate().map(|(number, name)| at(name).unwrap_or(number)).collect()
}

#[test]
fn robots_are_those_that_pinocchio_and_mujoco_read() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/golden/robots.json.gz");
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    for model in serde_json::from_str::<Value>(&text).unwrap().as_array().unwrap() {
        let name = model["name"].as_str().unwrap();
        let robot = parse(model["format"].as_str().unwrap(), model["text"].as_str().unwrap()).unwrap();
        let order = order(&robot, model["joints"].as_array().unwrap());
        let mut q = vec![0.0; order.len()];
        order.iter().zip(list(&model["q"])).for_each(|(joint, position)| q[*joint] = position);
        let found = robot.dynamics(&Motion { state: [&q, &[], &[]], load: None }).unwrap();
        // A floating base comes before the joints, and is left out here.
        let base = if robot.floating { 6 } else { 0 };
        let of = |row: usize| order.iter().map(|column| found.mass[(order[row], *column)]).collect::<Vec<_>>();
        match model["mass"].as_array() {
            Some(rows) => {
                for (row, theirs) in rows.iter().skip(base).enumerate() {
                    near(&format!("{name}, row {row} of M"), &of(row), &list(theirs)[base..]);
                }
            }
            None => {
                let sums: Vec<f64> = (0..order.len()).map(|row| of(row).iter().sum()).collect();
                near(name, &sums, &list(&model["mass_sums"]));
            }
        }
        let gravity: Vec<f64> = order.iter().map(|joint| found.gravity[*joint]).collect();
        near(name, &gravity, &list(&model["gravity"])[base..]);
        // MuJoCo's last body, which may have no name.
        let frame = match model["frame"].as_str() {
            Some(frame) => robot.frame(frame).unwrap(),
            None => robot.frames.iter().rfind(|frame| frame.name.starts_with("body ")).unwrap(),
        };
        let jacobian = robot.kinematics(frame, &q).unwrap().jacobian_base;
        let entries: Vec<f64> =
            (0..6).flat_map(|row| order.iter().map(|column| jacobian[(row, *column)]).collect::<Vec<_>>()).collect();
        near(name, &entries, &list(&model["jacobian"]));
    }
}

/// A link of a random tree.
#[derive(Clone, Debug)]
struct Link {
    parent: usize,
    slides: bool,
    place: [f64; 3],
    turn: [f64; 3],
    axis: [f64; 3],
    com: [f64; 3],
    mass: f64,
    size: [f64; 3],
}

fn links() -> impl Strategy<Value = Vec<Link>> {
    let three = || prop::array::uniform3(-1.0..1.0f64);
    let size = prop::array::uniform3(0.1..1.0f64);
    let link = ((any::<usize>(), any::<bool>()), three(), three(), three(), three(), (0.1..5.0f64, size));
    let link = link.prop_map(|((parent, slides), place, turn, mut axis, com, (mass, size))| {
        axis[2] += 1.5;
        Link { parent, slides, place, turn, axis, com, mass, size }
    });
    prop::collection::vec(link, 1..9)
}

fn three([x, y, z]: [f64; 3]) -> String {
    format!("{x:?} {y:?} {z:?}")
}

impl Link {
    /// Of a box of constant density.
    fn moments(&self) -> [f64; 3] {
        let [a, b, c] = self.size.map(|side| side * side * self.mass / 3.0);
        [b + c, a + c, a + b]
    }
}

fn as_urdf(links: &[Link]) -> String {
    let one = |(k, link): (usize, &Link)| {
        let [xx, yy, zz] = link.moments();
        let (parent, kind) = (link.parent % (k + 1), if link.slides { "prismatic" } else { "revolute" });
        format!(
            "<link name='l{}'><inertial><origin xyz='{}'/><mass value='{:?}'/>\
             <inertia ixx='{xx:?}' iyy='{yy:?}' izz='{zz:?}' ixy='0' ixz='0' iyz='0'/></inertial></link>\n\
             <joint name='j{}' type='{kind}'><origin xyz='{}' rpy='{}'/><parent link='l{parent}'/><child link='l{}'/>\
             <axis xyz='{}'/></joint>\n",
            k + 1,
            three(link.com),
            link.mass,
            k + 1,
            three(link.place),
            three(link.turn),
            k + 1,
            three(link.axis),
        )
    };
    format!("<robot name='r'><link name='l0'/>{}</robot>", links.iter().enumerate().map(one).collect::<String>())
}

fn as_mjcf(links: &[Link]) -> String {
    let mut bodies: Vec<String> = vec![String::new(); links.len() + 1];
    for (k, link) in links.iter().enumerate().rev() {
        let kind = if link.slides { "slide" } else { "hinge" };
        let body = format!(
            "<body name='l{}' pos='{}' euler='{}'><joint name='j{}' type='{kind}' axis='{}'/>\
             <geom type='box' pos='{}' size='{}' mass='{:?}'/>{}</body>\n",
            k + 1,
            three(link.place),
            three(link.turn),
            k + 1,
            three(link.axis),
            three(link.com),
            three(link.size),
            link.mass,
            bodies[k + 1],
        );
        bodies[link.parent % (k + 1)].insert_str(0, &body);
    }
    // Roll, pitch and yaw of a URDF are about the fixed axes.
    let settings = "<compiler angle='radian' eulerseq='XYZ'/>";
    format!("<mujoco model='r'>{settings}<worldbody>{}</worldbody></mujoco>", bodies[0])
}

proptest! {
    #![proptest_config(crate::testing::seeded(48))]

    #[test]
    fn a_tree_is_the_same_in_both_formats(links in links(), seed in -1.0..1.0f64) {
        let (one, other) = (parse("urdf", &as_urdf(&links)).unwrap(), parse("xml", &as_mjcf(&links)).unwrap());
        let names = |robot: &Robot| robot.joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
        prop_assert_eq!(names(&one), names(&other));
        let q: Vec<f64> = (0..links.len()).map(|k| seed + (3.0 * k as f64).sin()).collect();
        let mass = |robot: &Robot| robot.dynamics(&Motion { state: [&q, &[], &[]], load: None }).unwrap().mass;
        let (one, other) = (mass(&one), mass(&other));
        prop_assert!((&one - &other).amax() <= 1e-12 * one.amax(), "{} {}", one, other);
    }

    #[test]
    fn no_bytes_make_it_panic(
        cuts in prop::collection::vec((any::<prop::sample::Index>(), prop::collection::vec(any::<u8>(), 0..6)), 1..5),
        links in links(),
    ) {
        for (format, text) in [("urdf", as_urdf(&links)), ("xml", as_mjcf(&links))] {
            let mut bytes = text.into_bytes();
            for (at, put) in &cuts {
                let at = at.index(bytes.len());
                let end = (at + put.len() / 2).min(bytes.len());
                bytes.splice(at..end, put.iter().copied());
            }
            let _ = parse(format, &String::from_utf8_lossy(&bytes));
        }
    }
}

/// The shapes of a text in a scratch folder, or the message.
fn shapes(format: &str, body: &str) -> Result<Vec<LinkShape>, String> {
    let path = Path::new("model").with_extension(format);
    match format {
        "urdf" => urdf::parse_shapes(&path, &format!("<robot>\n{body}\n</robot>")).map_err(|error| error.to_string()),
        _ => mjcf::parse_shapes(&path, &format!("<mujoco>\n{body}\n</mujoco>")).map_err(|error| error.to_string()),
    }
}

#[test]
fn shapes_that_collide_are_the_same_in_both_formats() {
    let of_link = |geometry: &str| {
        format!(
            "<collision><origin xyz='1 2 3'/><geometry>{geometry}</geometry></collision><collision><geometry><sphere radius='9'/></geometry></collision>"
        )
    };
    let pairs = [
        ("<box size='2 4 6'/>", "type='box' size='1 2 3'"),
        ("<sphere radius='2'/>", "size='2'"),
        ("<cylinder radius='2' length='6'/>", "type='cylinder' size='2 3'"),
        ("<capsule radius='2' length='6'/>", "type='capsule' fromto='1 2 0 1 2 6' size='2'"),
    ];
    for (urdf, mjcf) in pairs {
        let urdf = shapes("urdf", &format!("<link name='a'>{}</link>", of_link(urdf))).unwrap();
        let pos = if mjcf.contains("fromto") { "" } else { "pos='1 2 3'" };
        let geoms = format!("<geom {pos} {mjcf}/><geom size='9'/><geom contype='0' conaffinity='0' size='1'/>");
        let mjcf =
            shapes("xml", &format!("<worldbody><body name='a'>{geoms}<site/></body><geom type='plane'/></worldbody>"));
        let mjcf: Vec<_> = mjcf.unwrap();
        assert_eq!((urdf.len(), mjcf.len()), (2, 2));
        for (one, other) in urdf.iter().zip(&mjcf) {
            assert_eq!((&one.link, &one.geometry), (&other.link, &other.geometry));
            assert_eq!(one.pose.position, other.pose.position);
        }
    }
}

#[test]
fn meshes_collide_as_their_corners() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let shapes = read_shapes(&folder.join("leap_hand.xml")).unwrap();
    let tips: Vec<_> = shapes.iter().filter(|shape| matches!(shape.geometry, Geometry::Hull(_))).collect();
    assert_eq!(tips.iter().map(|tip| tip.link.as_str()).collect::<Vec<_>>(), ["if_ds", "mf_ds", "rf_ds", "th_ds"]);
    let Geometry::Hull(corners) = &tips[0].geometry else { panic!("{:?}", tips[0]) };
    assert_eq!((corners.len(), corners[0]), (52, Vec3::new(0.00200284, -0.0199396, 0.0266029)));
}

#[test]
fn shapes_that_cannot_be_read_have_a_place() {
    let urdf = |geometry: &str| {
        shapes("urdf", &format!("<link name='a'><collision>{geometry}</collision></link>")).unwrap_err()
    };
    assert!(urdf("").starts_with("model.urdf:2:16: <collision> of link `a` has no shape"), "{}", urdf(""));
    let none = urdf("<geometry><plane/></geometry>");
    assert!(none.contains("give it a <geometry> with a box"), "{none}");
    let flat = urdf("<geometry><box size='1 0 1'/></geometry>");
    assert!(flat.starts_with("model.urdf:2:48: size has a number that is not above 0"), "{flat}");
    let lost = urdf("<geometry><mesh filename='package://none/a.stl'/></geometry>");
    assert!(lost.starts_with("model.urdf:2:53: none/a.stl: cannot be read: No such file"), "{lost}");
    let dae = urdf("<geometry><mesh filename='a.dae'/></geometry>");
    assert!(dae.starts_with("model.urdf:2:53: a.dae: "), "{dae}");
    let fitted = shapes("xml", "<worldbody><geom type='box' mesh='m'/></worldbody>").unwrap_err();
    assert!(fitted.contains("a shape that is fitted to a mesh is not supported; give it a size"), "{fitted}");
}
