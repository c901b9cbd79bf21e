//! Round trips of the arm file, and what it says to files that are wrong.

use darm_core::effect::anchor_offset::{AnchorOffset, Plate};
use darm_core::effect::gravity_sag::GravitySag;
use darm_core::effect::play::Play;
use darm_core::effect::stroke_loss::StrokeLoss;
use darm_core::effect::supply_stroke::SupplyStroke;
use darm_core::effect::thermal_growth::ThermalGrowth;
use darm_core::effect::{Effect, Place as EffectPlace};
use darm_core::real::Vec3;

use super::*;

const PLANAR4: &str = include_str!("../../../examples/planar4.toml");

/// A link, a spatial platform, both kinds of discrete joints, all drives.
const MIXED: &str = r#"
format = 1
name = "mixed \"arm\""
model = 3
length_scale_m = 0.3
mount = { position_m = [0.1, 0.2, 0.3], rotation_deg = [10.0, -20.0, 0.001] }

[[stage]]
kind = "link"
pose = { position_m = [0.0, 0.25, 0.0], rotation_deg = [0.0, 90.0, 0.0] }
mass_kg = 0.7
center_m = [0.0, 0.1, 0.0]

[[stage]]
kind = "discrete-joint"
motion = "prismatic"
axis = [0.0, 1.0, 1.0]
value_m = [0.0, 0.1, 0.25]
coils = [{ drive = "peak-hold", pull = 0, hold = 1, peak_ms = 50 }, { drive = "latch", set = 2, reset = 3, pulse_ms = 20 }]
switch = { input = 4, closed_in = [0, 2] }

[[stage]]
kind = "discrete-joint"
value_deg = [-30.0, 12.345678901234]
coil = { drive = "hold", line = 4 }

[[stage]]
kind = "servo"
offset_deg = 1.5
bus = { id = 2, min_deg = -90, max_deg = 90, max_speed_deg_s = 45.5, max_torque = 0.7, timeout_ms = 50 }
"#;

fn parse(text: &str) -> Result<Arm, ArmError> {
    Arm::parse(Path::new("arm.toml"), text)
}

/// The message for the example with `from` replaced by `to`.
#[track_caller]
fn message(from: &str, to: &str) -> String {
    assert!(PLANAR4.contains(from), "{from}");
    parse(&PLANAR4.replacen(from, to, 1)).unwrap_err().to_string()
}

#[track_caller]
fn assert_round_trip(arm: &Arm) {
    let text = arm.to_toml();
    let again = parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(again.to_toml(), text);
    assert_eq!(again.hash(), arm.hash());
}

#[test]
fn what_is_written_reads_as_it_was() {
    for text in [PLANAR4, include_str!("../../../examples/planar4-hybrid.toml"), MIXED] {
        assert_round_trip(&parse(text).unwrap());
    }
    let arm = parse(PLANAR4).unwrap();
    assert_eq!(parse(&arm.to_toml()).unwrap(), arm);
}

#[test]
fn every_effect_reads_as_it_was() {
    let mut arm = parse(PLANAR4).unwrap();
    let at = EffectPlace::Module(2);
    let effects: [Effect<f64>; 6] = [
        StrokeLoss { actuator: 4, state: 1, loss_m: 1.0 / 3.0 }.into(),
        AnchorOffset { actuator: 7, plate: Plate::Top, offset: Vec3::new(1e-3, -2e-3, 0.0) }.into(),
        GravitySag { at: EffectPlace::Arm, compliance_m_per_n: 1.2e-7 }.into(),
        Play { at, width_m: 1e-3 }.into(),
        SupplyStroke { at: EffectPlace::Actuator(3), gain: 0.1 }.into(),
        ThermalGrowth { at, expansion_per_k: 1.2e-5 }.into(),
    ];
    arm.model.effects.extend(effects);
    assert_eq!(parse(&arm.to_toml()).unwrap(), arm);
}

#[test]
fn the_hash_feels_the_last_bit_of_a_length() {
    let mut arm = parse(PLANAR4).unwrap();
    let before = arm.hash();
    let stop = darm_core::chain::Parameter::Stop { actuator: 3, state: 1 };
    arm.model.chain.set(stop, arm.model.chain.get(stop).unwrap().next_up()).unwrap();
    assert_ne!(arm.hash(), before);
}

#[test]
fn files_read_and_write() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.toml");
    let arm = parse(PLANAR4).unwrap();
    arm.write(&path).unwrap();
    assert_eq!(Arm::read(&path).unwrap(), arm);
    let missing = Arm::read(&folder.path().join("none.toml")).unwrap_err().to_string();
    assert!(missing.ends_with("none.toml: No such file or directory (os error 2)"), "{missing}");
}

#[test]
fn mistakes_are_told_by_line_and_column() {
    let cases = [
        ("format = 1", "format = 2", "the file has format 2, this program reads format 1"),
        ("model = 0", "model = ", "string values must be quoted, expected literal string"),
        ("model = 0", "modle = 0", "unknown field"),
        ("[1.0, 1.25]", "[1.0, 0.75]", ""),
        ("[1.0, 1.25]", "[1.0, nan]", ""),
        ("[1.0, 1.25]", "[1.0]", ""),
        ("base_m = [-0.5, 0.0]", "base_m = [-0.5, 0.0, 0.0]", ""),
        ("line = 1 }", "line = 0 }", ""),
        ("input = 3,", "input = 2,", ""),
        ("line = 4 }", "line = 4, duty_percent = 120 }", ""),
        ("closed_in = [1]", "closed_in = [2]", ""),
        ("new_coils = 6", "new_coils = 0", ""),
        ("kind = \"planar-platform\"", "kind = \"spatial-platform\"", ""),
        ("kind = \"planar-platform\"", "kind = \"link\"", ""),
        ("top_m = [0.5, 0.0]\nlength_m = [1.4", "top_m = [-0.5, 0.0]\nlength_m = [1.0", ""),
        ("1.25]", "9.0]", ""),
    ];
    for (from, to, expected) in cases {
        println!("{to:?}\n    {} ({expected})", message(from, to));
    }
    println!("{}", parse(&format!("{PLANAR4}\n[[effect]]\nlaw = \"sag\"\nvalues = {{}}\n")).unwrap_err());
    println!("{}", parse(&format!("{PLANAR4}\n[[effect]]\nlaw = \"play\"\nvalues = {{ w = 1.0 }}\n")).unwrap_err());
    println!(
        "{}",
        parse(&format!("{PLANAR4}\n[[effect]]\nlaw = \"play\"\nmodule = 4\nvalues = {{ width_m = 1.0 }}\n"))
            .unwrap_err()
    );
}
