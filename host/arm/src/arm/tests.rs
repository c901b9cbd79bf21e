//! Round trips of the arm file, and what it says to files that are wrong.

use darm_core::effect::fitted_term::{FittedTerm, Variable};
use darm_core::effect::{Effect, Frame, Place as EffectPlace, Plate};
use darm_core::real::Vec3;

use super::*;

const PLANAR4: &str = include_str!("../../../../examples/planar4.toml");

/// A link, both kinds of discrete joints, a servo.
const MIXED: &str = r#"
format = 2
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
outputs = [7, 2]
switch = { closed_in = [0, 2] }

[[stage]]
kind = "discrete-joint"
value_deg = [-30.0, 12.345678901234]
output = 4

[[stage]]
kind = "servo"
offset_deg = 1.5
servo = { id = 2, min_deg = -90, max_deg = 90 }
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
    for text in [PLANAR4, include_str!("../../../../examples/planar4-hybrid.toml"), MIXED] {
        assert_round_trip(&parse(text).unwrap());
    }
    let arm = parse(PLANAR4).unwrap();
    assert_eq!(parse(&arm.to_toml()).unwrap(), arm);
}

#[test]
fn a_platform_in_space_reads_as_it_was() {
    let mut text = String::from("format = 2\nname = \"hexapod\"\n\n[[stage]]\nkind = \"spatial-platform\"\n");
    text += "home = { position_m = [0.0, 0.0, 0.6], rotation_deg = [0.0, 0.0, 0.0] }\n";
    for leg in 0..6 {
        let on_circle = |radius: f64, degrees: f64| {
            let angle = (120.0 * f64::from(leg / 2) + if leg % 2 == 0 { -degrees } else { degrees }).to_radians();
            Vec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
        };
        let (base, top) = (on_circle(0.5, 15.0), on_circle(0.35, 45.0));
        let length = (top + Vec3::new(0.0, 0.0, 0.6) - base).norm();
        text +=
            &format!("[[stage.leg]]\nbase_m = [{}, {}, 0.0]\ntop_m = [{}, {}, 0.0]\n", base.x, base.y, top.x, top.y);
        text += &format!("length_m = [{length}, {}]\noutput = {leg}\n", 1.25 * length);
    }
    let arm = parse(&text).unwrap();
    assert_eq!((arm.n_actuators(), arm.model.chain.is_planar()), (6, false));
    assert_round_trip(&arm);
}

#[test]
fn every_effect_reads_as_it_was() {
    let hybrid = include_str!("../../../../examples/planar4-hybrid.toml");
    let mut arm = parse(hybrid).unwrap();
    let at = EffectPlace::Module(2);
    let variables = [
        Variable::Supply { center: 5.5e5, span: 1e5 / 3.0 },
        Variable::Temperature { center: 298.15, span: 5.0 },
        Variable::Servo { servo: 0, center: 0.1, span: 0.2 },
        Variable::Digits { first: (4, 1), second: None },
        Variable::Digits { first: (4, 1), second: Some((7, 0)) },
        Variable::Stayed { actuator: 11, share: 0.45 },
    ];
    let values = [0.0, 0.0, 1e-2, 1e-3, -2e-3, 0.0];
    let terms = variables.map(|of| Effect::FittedTerm(FittedTerm { of, square: true, frame: Frame::Base, values }));
    let effects: [Effect<f64>; 19] = [
        Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 1.0 / 3.0 },
        Effect::AnchorOffset { actuator: 7, plate: Plate::Top, offset: [1e-3, -2e-3, 0.0] },
        Effect::GravitySag { at: EffectPlace::Arm, compliance_m_per_n: 1.2e-7 },
        Effect::Play { at, width_m: 1e-3 },
        Effect::SupplyStroke { at: EffectPlace::Actuator(3), gain: 0.1 },
        Effect::ThermalGrowth { at, expansion_per_k: 1.2e-5 },
        Effect::Step { actuator: 2, since_s: 12.5, shift_m: -1e-3 },
        Effect::LengthOffset { actuator: 2, offset_m: -1e-3 },
        Effect::Interaction { actuator: 2, other: 9, shift_m: -1e-3 },
        Effect::Creep { at, dwell_s: 1.5, values: [1e-3, -2e-3] },
        Effect::BaseStep { since_s: 12.5, values: [0.0, 0.0, 1e-2, 1e-3, -2e-3, 0.0] },
        Effect::BaseDrift { until_s: 80.0, values: [0.0, 0.0, 1e-5, 1e-6, -2e-6, 0.0] },
        Effect::Drift { at: EffectPlace::Arm, until_s: 80.0, values: [1e-5, -1e-8] },
        Effect::Wear { actuator: 11, until_switches: 150.0, per_switch_m: 1e-5 },
        Effect::Crowding { at, values: [1e-3, -2e-3] },
        Effect::FrameOffset { frame: Frame::Base, values: [0.0, 0.0, 1e-2, 1e-3, -2e-3, 0.0] },
        Effect::FrameOffset { frame: Frame::Tool, values: [0.0, 0.0, 1e-2, 1e-3, -2e-3, 0.0] },
        Effect::Scale { stretch: 1e-3 },
        Effect::JointOffset { servo: 0, offset_rad: 0.01 },
    ];
    for effect in effects.into_iter().chain(terms) {
        arm.model.effects = [effect].into_iter().collect();
        assert_eq!(parse(&arm.to_toml()).unwrap(), arm);
    }
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
    let again = Arm::read(&path).unwrap();
    assert_eq!(again.hash(), arm.hash(), "where its profile is does not make it another model");
    assert_eq!(Arm { profile: arm.profile.clone(), ..again }, arm);
    let missing = Arm::read(&folder.path().join("none.toml")).unwrap_err().to_string();
    assert!(
        missing.ends_with("none.toml: cannot be read: No such file or directory (os error 2); check the path"),
        "{missing}"
    );
}

#[test]
fn the_profile_is_named_by_its_path_from_the_arm_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("arms/new")).unwrap();
    let [old, new] = ["arms/old.toml", "arms/new/arm.toml"].map(|name| folder.path().join(name));
    std::fs::write(&old, PLANAR4.replace("\"planar4.profile.toml\"", "\"../board.toml\"")).unwrap();
    let arm = Arm::read(&old).unwrap();
    assert_eq!(arm.profile, Some(folder.path().join("arms/../board.toml")));
    std::fs::write(folder.path().join("board.toml"), "").unwrap();
    arm.write(&new).unwrap();
    let text = std::fs::read_to_string(&new).unwrap();
    assert!(text.contains("\nprofile = \"../../board.toml\"\n"), "{text}");
    Arm { profile: None, ..arm }.write(&new).unwrap();
    assert_eq!(Arm::read(&new).unwrap().profile, None);
}

#[test]
fn a_file_of_another_kind_is_no_old_arm() {
    for (file, holds) in [
        ("planar4-frames.toml", "4:10: the file holds desired frames, and no arm"),
        ("grasp-contacts.toml", "2:10: the file holds contacts of a grasp, and no arm"),
        ("planar4.profile.toml", "4:10: the file holds the outputs of a board: a profile, and no arm"),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file);
        let error = Arm::read(&path).unwrap_err().to_string();
        assert!(error.contains(holds), "{error}");
    }
}

#[test]
fn mistakes_are_told_by_line_and_column() {
    let cases = [
        ("format = 2", "format = 3", "5:10: the file has format 3, this program reads format 2"),
        ("model = 0", "model = ", "8:9: string values must be quoted, expected literal string; correct the TOML"),
        (
            "model = 0",
            "modle = 0",
            "8:1: unknown field `modle`, expected one of `format`, `name`, `profile`, `model`, `length_scale_m`, `conditions`, \
             `mount`, `tool`, `stage`, `effect`; correct the TOML",
        ),
        (
            "[1.0, 1.25]",
            "[1.0, 0.75]",
            "29:12: state 1 at 0.75 is below state 0 at 1: a stroke below zero; give the states in growing order (digit 0: all \
             outputs off, 1: the first on, 2: the second on, 3: both on). A spring-centred actuator of two opposed coils is \
             not supported yet",
        ),
        ("[1.0, 1.25]", "[1.0, nan]", "29:12: the number has to be finite; correct the TOML"),
        ("[1.0, 1.25]", "[1.0]", "29:12: the actuator has 1 states; give 2 to 4, digit 0 first"),
        ("[-0.5, 0.0]", "[-0.5, 0.0, 0.0]", "27:10: 3 coordinates are given; give 2, in metres"),
        (
            "output = 1\n",
            "output = 0\n",
            "39:10: output 0 feeds both actuator 0 (module 1, left) and actuator 1 (module 1, diagonal); give each an output \
             that nothing else uses",
        ),
        (
            "output = 4\n",
            "output = 48\n",
            "72:10: output 48 is used twice or is not one of 0 to 47; correct the wiring",
        ),
        (
            "output = 4\n",
            "outputs = [4, 14]\n",
            "72:11: the actuator has 2 outputs; give 1: `output` for two states, two in `outputs` for three or four",
        ),
        (
            "closed_in = [1]",
            "closed_in = [2]",
            "31:10: the switch is closed in state 2, which the actuator does not have; correct `closed_in`",
        ),
        (
            "{ closed_in",
            "{ input = 3, closed_in",
            "31:12: unknown field `input`, expected `closed_in`; correct the TOML",
        ),
        ("planar-platform", "link", "20:8: a link has no key `home`; remove it"),
    ];
    for (from, to, expected) in cases {
        assert_eq!(message(from, to), format!("arm.toml:{expected}"));
    }
}

#[test]
fn a_base_line_that_does_not_stand_is_told_by_module_and_word() {
    let parallel = message("top_m = [0.5, 0.0]\nlength_m = [1.4", "top_m = [-0.5, 0.0]\nlength_m = [1.0");
    assert_eq!(
        parallel,
        "arm.toml:20:8: module 1 has no pose for the word 000000000000: the platform is near a singular posture: \
         determinant -0.0e0 of at least 1e-2; change its leg lengths, anchors or home"
    );
    let too_long = message("1.25]", "9.0]");
    assert!(too_long.starts_with("arm.toml:20:8: module 1 has no pose for the word 111111111111: "), "{too_long}");
}

#[test]
fn effects_that_cannot_be_are_told() {
    let message = |effect: &str| parse(&format!("{PLANAR4}\n[[effect]]\nlaw = {effect}\n")).unwrap_err().to_string();
    assert_eq!(
        message("\"sag\"\nvalues = {}"),
        "arm.toml:152:7: there is no law `sag`; the laws are anchor-offset, base-drift, base-offset, \
         base-step, creep, crowding, drift, fitted-term, gravity-sag, interaction, joint-offset, length-offset, play, scale, \
         step, stroke-loss, supply-stroke, thermal-growth, tool-offset, wear"
    );
    let values = "values = {}";
    for (effect, said) in [
        ("\"wear\"\nactuator = 0", "wear needs the key `until_switches`; add it"),
        ("\"wear\"\nmodule = 0", "wear has no key `module`; remove it"),
        ("\"stroke-loss\"\nactuator = 0", "stroke-loss needs the key `state`; add it"),
        ("\"base-offset\"\nactuator = 0", "base-offset has no key `actuator`; remove it"),
        ("\"gravity-sag\"\nstate = 0", "gravity-sag has no key `state`; remove it"),
        ("\"joint-offset\"", "joint-offset needs the key `servo`; add it"),
        ("\"interaction\"\nactuator = 0", "interaction needs the key `other`; add it"),
        (
            "\"interaction\"\nactuator = 1\nother = 1",
            "interaction: `other` is actuator 1 itself; name another actuator",
        ),
        ("\"length-offset\"\nactuator = 0\nother = 1", "length-offset has no key `other`; remove it"),
    ] {
        assert_eq!(message(&format!("{effect}\n{values}")), format!("arm.toml:152:7: {said}"));
    }
    assert_eq!(message("\"play\"\nvalues = { w = 1.0 }"), "arm.toml:152:7: the values of this law are width_m");
    assert_eq!(
        message("\"play\"\nmodule = 4\nvalues = { width_m = 1.0 }"),
        "arm.toml:152:7: play: there is no module 4; give 0 to 3, counted from the base"
    );
    assert_eq!(
        message("\"stroke-loss\"\nactuator = 12\nstate = 1\nvalues = { loss_m = 1.0 }"),
        "arm.toml:152:7: stroke-loss: there is no actuator 12; give 0 to 11, counted from the base"
    );
    assert_eq!(
        message("\"stroke-loss\"\nactuator = 4\nstate = 2\nvalues = { loss_m = 1.0 }"),
        "arm.toml:152:7: stroke-loss: there is no state 2 of actuator 4; give 0 to 1"
    );
}

#[test]
fn frames_that_cannot_be_are_told() {
    let arm = parse(PLANAR4).unwrap();
    let good = include_str!("../../../../examples/planar4-frames.toml");
    let message = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        frames::parse(Path::new("frames.toml"), &good.replacen(from, to, 1), &arm).unwrap_err().to_string()
    };
    assert_eq!(
        message("111,111,000,000", "111,000,000,000"),
        "frames.toml:18:8: the word 111000000000 serves B already; one word reaches one frame, give another word"
    );
    assert_eq!(
        message("111,111,000,000", "111,111,000"),
        "frames.toml:18:8: the word 111111000 has 9 digits; give 12, one for each actuator"
    );
    assert_eq!(
        message("111,111,000,000", "111,211,000,000"),
        "frames.toml:18:8: the word 111211000000 asks for a state that module 2, left leg does not have; its digits \
         are 0 to 1"
    );
    assert_eq!(
        message("[0.04, 3.97]", "[0.04, 3.97, 0.0]"),
        "frames.toml:9:8: the position has 3 coordinates; give 2, in metres"
    );
    let frames = frames::parse(Path::new("frames.toml"), good, &arm).unwrap();
    assert_eq!(frames::parse(Path::new("again.toml"), &frames::to_toml(&frames), &arm).unwrap(), frames);
}

#[test]
fn two_servos_with_one_address_are_refused_by_line_and_column() {
    let servo = MIXED.rsplit_once("[[stage]]").unwrap().1;
    let twice = format!("{MIXED}\n[[stage]]\nname = \"wrist\"{servo}");
    let error = parse(&twice).unwrap_err().to_string();
    assert_eq!(error, "arm.toml:36:9: module 3 and wrist have the bus address 2; give each servo a separate `id`");
    assert!(parse(&twice.replacen("id = 2", "id = 3", 1)).is_ok());
}

#[test]
fn the_strength_of_an_actuator_reads_as_it_was_and_does_not_change_the_hash() {
    let with = |line: &str| PLANAR4.replacen("travel_ms = 150", &format!("travel_ms = 150\n{line}"), 1);
    let plain = parse(PLANAR4).unwrap();
    for line in ["cylinder = { bore_m = 0.032, rod_m = 0.012 }", "force = { push_n = 80.0, pull_n = 35.5 }"] {
        let arm = parse(&with(line)).unwrap();
        assert!(arm.strengths[0].is_some() && arm.strengths[1].is_none());
        assert_eq!((parse(&arm.to_toml()).unwrap(), arm.hash()), (arm, plain.hash()));
    }
    let joint = parse(&MIXED.replace("output = 4", "output = 4\ntorque_nm = 2.5")).unwrap();
    assert_eq!(joint.strengths, [None, Some(Strength::Torque { torque_nm: 2.5 })]);
    assert_round_trip(&joint);
}

#[test]
fn a_strength_that_means_nothing_is_refused() {
    let refused = |line: &str| {
        let text = PLANAR4.replacen("travel_ms = 150", &format!("travel_ms = 150\n{line}"), 1);
        let message = parse(&text).unwrap_err().to_string();
        message.splitn(4, ':').last().unwrap().trim().to_owned()
    };
    assert_eq!(
        refused("cylinder = { bore_m = 0.01, rod_m = 0.02 }"),
        "`rod_m` is 0.02; give at least 0, and less than `bore_m` = 0.01"
    );
    assert_eq!(refused("force = { push_n = 0.0, pull_n = 1.0 }"), "push_n is 0; give a number above zero, at most 1e9");
    assert_eq!(
        refused("force = { push_n = 1.0, pull_n = 1.0 }\ncylinder = { bore_m = 0.01 }"),
        "`cylinder` and `force` both say what the actuator gives; remove one"
    );
    let joint = MIXED.replace("output = 4", "output = 4\ncylinder = { bore_m = 0.01 }");
    assert!(parse(&joint).unwrap_err().to_string().ends_with("a revolute joint has no key `cylinder`; remove it"));
}
