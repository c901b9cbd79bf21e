//! The arm file of a new arm.

use std::fmt::Write as _;

use super::{Choices, Topology, Valve};

/// Height of a contracted module over the width of its plates.
const PLANAR_HEIGHT: f64 = 0.75;
const SPATIAL_HEIGHT: f64 = 0.6;
/// Radius of the top anchors over that of the base anchors, and half the angle between the two of a pair, degrees.
const TOP_RADIUS: f64 = 0.7;
const BASE_SPREAD_DEG: f64 = 15.0;
const TOP_SPREAD_DEG: f64 = 45.0;
/// Masses until those of the parts are known, kg.
const MODULE_KG: f64 = 0.5;
const TOOL_KG: f64 = 0.2;
/// Longest time to the stop, ms.
const TRAVEL_MS: u16 = 150;

/// A leg: its name, its anchors, and its length with the top plate at rest.
struct Leg {
    name: String,
    base_m: Vec<f64>,
    top_m: Vec<f64>,
    length_m: f64,
}

/// The text of the arm file, which names this profile.
pub(super) fn arm_text(choices: &Choices, profile: &str) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_arm(&mut text, choices, profile);
    text
}

fn write_arm(w: &mut String, choices: &Choices, profile: &str) -> std::fmt::Result {
    let Choices { name, topology, modules, valve, .. } = choices;
    let (what, gravity) = match topology {
        Topology::Planar => ("planar modules on three cylinders each", "[0.0, -9.81, 0.0]"),
        Topology::Spatial => ("modules on six cylinders each", "[0.0, 0.0, -9.81]"),
        Topology::Serial => ("joints with two positions", "[0.0, -9.81, 0.0]"),
    };
    let fed_by = match valve {
        Valve::Monostable => "5/2 valves with a spring",
        Valve::Bistable => "5/2 valves with two coils",
    };
    writeln!(w, "# {name}: {modules} {what}, fed by {fed_by}.")?;
    writeln!(
        w,
        "# Lengths in m, angles in degrees; digit 0 is contracted, 1 extended. Masses are guesses: correct them.\n"
    )?;
    writeln!(w, "format = 2\nname = \"{name}\"\nprofile = \"{profile}\"")?;
    writeln!(w, "length_scale_m = {}\n", number(0.5 * choices.size_m))?;
    writeln!(w, "[conditions]\ngravity_m_s2 = {gravity}\nsupply_bar = 6.0\ntemperature_c = 20.0\n")?;
    writeln!(w, "[tool]\nmass_kg = {TOOL_KG:?}")?;
    for module in 0..*modules {
        match topology {
            Topology::Planar => write_platform(w, choices, module, "planar-platform", &planar_legs(choices.size_m))?,
            Topology::Spatial => write_platform(w, choices, module, "spatial-platform", &spatial_legs(choices.size_m))?,
            Topology::Serial => write_joint(w, choices, module)?,
        }
    }
    Ok(())
}

/// Left and right upright, the diagonal between them.
fn planar_legs(width: f64) -> Vec<Leg> {
    let (half, height) = (0.5 * width, PLANAR_HEIGHT * width);
    let leg = |name: &str, base: f64, top: f64| Leg {
        name: name.into(),
        base_m: vec![base, 0.0],
        top_m: vec![top, 0.0],
        length_m: height.hypot(top - base),
    };
    vec![leg("left", -half, -half), leg("diagonal", -half, half), leg("right", half, half)]
}

/// Three pairs that are apart at the base and meet other neighbours at the top.
fn spatial_legs(width: f64) -> Vec<Leg> {
    let (radius, height) = (0.5 * width, SPATIAL_HEIGHT * width);
    let on_circle = |radius: f64, degrees: f64| {
        let angle = degrees.to_radians();
        [radius * angle.cos(), radius * angle.sin()]
    };
    let leg = |number: u8| {
        let (middle, side) = (120.0 * f64::from(number / 2), if number.is_multiple_of(2) { -1.0 } else { 1.0 });
        let [bx, by] = on_circle(radius, middle + side * BASE_SPREAD_DEG);
        let [tx, ty] = on_circle(TOP_RADIUS * radius, middle + side * TOP_SPREAD_DEG);
        let length_m = (tx - bx).hypot(ty - by).hypot(height);
        Leg { name: (number + 1).to_string(), base_m: vec![bx, by, 0.0], top_m: vec![tx, ty, 0.0], length_m }
    };
    (0..6).map(leg).collect()
}

fn write_platform(w: &mut String, choices: &Choices, module: usize, kind: &str, legs: &[Leg]) -> std::fmt::Result {
    let height = if choices.topology == Topology::Planar { PLANAR_HEIGHT } else { SPATIAL_HEIGHT } * choices.size_m;
    let middle = number(height + 0.5 * choices.stroke);
    let home = match choices.topology {
        Topology::Planar => format!("{{ position_m = [0.0, {middle}], angle_deg = 0.0 }}"),
        _ => format!("{{ position_m = [0.0, 0.0, {middle}], rotation_deg = [0.0, 0.0, 0.0] }}"),
    };
    write_stage(w, kind, &format!("module {}", module + 1))?;
    writeln!(w, "mass_kg = {MODULE_KG:?}\nhome = {home}")?;
    for (index, leg) in legs.iter().enumerate() {
        let [bore, rod] = choices.cylinder_m.map(number);
        writeln!(w, "\n[[stage.leg]]\nname = \"{}\"", leg.name)?;
        writeln!(w, "base_m = {}\ntop_m = {}", list(&leg.base_m), list(&leg.top_m))?;
        writeln!(w, "length_m = {}", list(&[leg.length_m, leg.length_m + choices.stroke]))?;
        writeln!(w, "cylinder = {{ bore_m = {bore}, rod_m = {rod} }}")?;
        write_output(w, choices, module * legs.len() + index)?;
    }
    Ok(())
}

/// A joint that turns to either side of straight on, and the link on it.
fn write_joint(w: &mut String, choices: &Choices, module: usize) -> std::fmt::Result {
    let half = number(0.5 * choices.stroke.to_degrees());
    write_stage(w, "discrete-joint", &format!("joint {}", module + 1))?;
    writeln!(w, "motion = \"revolute\"\naxis = [0.0, 0.0, 1.0]\nvalue_deg = [-{half}, {half}]")?;
    writeln!(w, "torque_nm = {}", number(choices.torque_nm))?;
    write_output(w, choices, module)?;
    write_stage(w, "link", &format!("link {}", module + 1))?;
    writeln!(w, "mass_kg = {MODULE_KG:?}\npose = {{ position_m = [0.0, {}], angle_deg = 0.0 }}", number(choices.size_m))
}

fn write_stage(w: &mut String, kind: &str, name: &str) -> std::fmt::Result {
    writeln!(w, "\n[[stage]]\nkind = \"{kind}\"\nname = \"{name}\"")
}

fn write_output(w: &mut String, choices: &Choices, actuator: usize) -> std::fmt::Result {
    writeln!(w, "output = {actuator}")?;
    if actuator < choices.n_switches() {
        writeln!(w, "switch = {{ closed_in = [1] }}")?;
    }
    writeln!(w, "travel_ms = {TRAVEL_MS}")
}

/// A number of the file, to a hundredth of a millimetre or degree.
fn number(value: f64) -> String {
    format!("{:?}", (1e5 * value).round() / 1e5)
}

fn list(numbers: &[f64]) -> String {
    let numbers: Vec<_> = numbers.iter().map(|&value| number(value + 0.0)).collect();
    format!("[{}]", numbers.join(", "))
}
