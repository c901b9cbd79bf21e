//! The canonical text of an arm file.

use std::fmt::{self, Write};
use std::path::Path;

use darm_core::actuator::{Axis, JointKind, Leg, Stage};
use darm_core::model::Mass;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};

use super::{Arm, FORMAT, Servo, ZERO_CELSIUS, effects};

/// Every key in one order; what is read back and written again is the same text. `profile` is the path of the board's
/// profile as the file names it.
pub(super) fn toml(arm: &Arm, profile: Option<&Path>) -> String {
    let mut text = String::new();
    // A string takes whatever is written to it.
    let _ = write_arm(&mut text, arm, profile);
    text
}

fn write_arm(w: &mut String, arm: &Arm, profile: Option<&Path>) -> fmt::Result {
    let model = &arm.model;
    writeln!(w, "format = {FORMAT}\nname = {}", quoted(&arm.name))?;
    if let Some(profile) = profile {
        writeln!(w, "profile = {}", quoted(&profile.to_string_lossy()))?;
    }
    writeln!(w, "model = {}", model.number)?;
    writeln!(w, "length_scale_m = {:?}\n", arm.length_scale_m)?;
    writeln!(w, "[conditions]\ngravity_m_s2 = {}", list(model.gravity.as_slice()))?;
    writeln!(w, "supply_bar = {:?}", converted(model.nominal_supply / 1e5))?;
    writeln!(w, "temperature_c = {:?}", converted(model.reference_temperature_k - ZERO_CELSIUS))?;
    writeln!(w, "working_supply_bar = {:?}", converted(model.working_supply / 1e5))?;
    writeln!(w, "working_temperature_c = {:?}\n", converted(model.working_temperature_k - ZERO_CELSIUS))?;
    writeln!(w, "[mount]\n{}\n", pose_lines(&model.chain.mount))?;
    writeln!(w, "[tool]\npose = {}", pose(&model.chain.tool))?;
    write_mass(w, &model.payload)?;
    let mut parts = Parts { arm, actuator: 0, servo: 0 };
    for index in 0..model.chain.stages.len() {
        parts.write_stage(w, index)?;
    }
    for effect in &model.effects {
        write!(w, "\n[[effect]]\nlaw = \"{}\"\n{}", effect.name(), effects::place_keys(effect))?;
        let pairs = effect.quantities().iter().zip(effect.values());
        let values: Vec<_> =
            pairs.map(|(quantity, value)| format!("{} = {value:?}", effects::value_key(quantity))).collect();
        writeln!(w, "values = {{ {} }}", values.join(", "))?;
    }
    Ok(())
}

/// The arm, and the actuator and servo that come next.
struct Parts<'a> {
    arm: &'a Arm,
    actuator: usize,
    servo: usize,
}

impl Parts<'_> {
    fn write_stage(&mut self, w: &mut String, index: usize) -> fmt::Result {
        let stage = &self.arm.model.chain.stages[index];
        let kind = match stage {
            Stage::Link(_) => "link",
            Stage::Planar(_) => "planar-platform",
            Stage::Spatial(_) => "spatial-platform",
            Stage::Discrete(_) => "discrete-joint",
            Stage::Servo(_) => "servo",
        };
        writeln!(w, "\n[[stage]]\nkind = \"{kind}\"\nname = {}", quoted(&self.arm.stage_name(index)))?;
        write_mass(w, &self.arm.model.masses[index])?;
        match stage {
            Stage::Link(link) => writeln!(w, "pose = {}", pose(link)),
            Stage::Planar(platform) => {
                writeln!(w, "home = {}", pose(&platform.home))?;
                platform.legs.iter().try_for_each(|leg| self.write_leg(w, leg, 2))
            }
            Stage::Spatial(platform) => {
                writeln!(w, "home = {}", pose(&platform.home))?;
                platform.legs.iter().try_for_each(|leg| self.write_leg(w, leg, 3))
            }
            Stage::Discrete(joint) => {
                let values = &joint.values[..joint.states.into()];
                match joint.axis.kind {
                    JointKind::Revolute => writeln!(w, "motion = \"revolute\"\nvalue_deg = {}", degrees(values))?,
                    JointKind::Prismatic => writeln!(w, "motion = \"prismatic\"\nvalue_m = {}", list(values))?,
                }
                write_axis(w, &joint.axis)?;
                self.write_connection(w)
            }
            Stage::Servo(joint) => {
                write_axis(w, &joint.axis)?;
                writeln!(w, "offset_deg = {:?}", converted(joint.offset.to_degrees()))?;
                let own = self.arm.servos.get(self.servo);
                self.servo += 1;
                own.map_or(Ok(()), |own| writeln!(w, "servo = {}", servo(own)))
            }
        }
    }

    fn write_leg(&mut self, w: &mut String, leg: &Leg<f64>, dimension: usize) -> fmt::Result {
        let name = self.arm.labels.actuators.get(self.actuator).map_or("", String::as_str);
        writeln!(w, "\n[[stage.leg]]\nname = {}", quoted(name))?;
        writeln!(w, "base_m = {}", list(&leg.base.as_slice()[..dimension]))?;
        writeln!(w, "top_m = {}", list(&leg.top.as_slice()[..dimension]))?;
        writeln!(w, "length_m = {}", list(&leg.length_m[..leg.states.into()]))?;
        self.write_connection(w)
    }

    fn write_connection(&mut self, w: &mut String) -> fmt::Result {
        let Some(connection) = self.arm.connections.get(self.actuator) else { return Ok(()) };
        let strength = self.arm.strengths.get(self.actuator).and_then(Option::as_ref);
        self.actuator += 1;
        if let Some(strength) = strength {
            writeln!(w, "{}", strength.line())?;
        }
        match connection.outputs.as_slice() {
            [] => {}
            [one] => writeln!(w, "output = {one}")?,
            more => writeln!(w, "outputs = {more:?}")?,
        }
        if let Some(closed_in) = connection.closed_in {
            let states: Vec<u8> = (0..u8::BITS as u8).filter(|state| closed_in >> state & 1 == 1).collect();
            writeln!(w, "switch = {{ closed_in = {states:?} }}")?;
        }
        writeln!(w, "travel_ms = {}", connection.travel_ms)
    }
}

fn write_mass(w: &mut String, mass: &Mass<f64>) -> fmt::Result {
    if *mass == Mass::none() {
        return Ok(());
    }
    writeln!(w, "mass_kg = {:?}\ncenter_m = {}", mass.mass_kg, list(mass.center.as_slice()))
}

fn write_axis(w: &mut String, axis: &Axis<f64>) -> fmt::Result {
    if axis.direction == Vec3::z() {
        return Ok(());
    }
    writeln!(w, "axis = {}", list(axis.direction.as_slice()))
}

fn servo(servo: &Servo) -> String {
    // Coarser than the steps of an f32, so that 90 degrees read are 90 degrees written.
    let degrees = |angle_rad: f32| rounded(f64::from(angle_rad).to_degrees(), 4);
    let Servo { id, min_rad, max_rad } = *servo;
    format!("{{ id = {id}, min_deg = {:?}, max_deg = {:?} }}", degrees(min_rad), degrees(max_rad))
}

/// The pose as an inline table.
pub(super) fn pose(pose: &Pose<f64>) -> String {
    format!("{{ {} }}", pose_lines(pose).replace('\n', ", "))
}

fn pose_lines(pose: &Pose<f64>) -> String {
    if pose.is_planar() {
        let flat = Pose2::projection(pose);
        let angle_deg = converted(flat.angle_rad.to_degrees());
        return format!("position_m = {}\nangle_deg = {angle_deg:?}", list(flat.position.as_slice()));
    }
    let rotation = pose.log().angular;
    format!("position_m = {}\nrotation_deg = {}", list(pose.position.as_slice()), degrees(rotation.as_slice()))
}

fn list(numbers: &[f64]) -> String {
    let numbers: Vec<_> = numbers.iter().map(|number| format!("{:?}", number + 0.0)).collect();
    format!("[{}]", numbers.join(", "))
}

fn degrees(angles_rad: &[f64]) -> String {
    list(&angles_rad.iter().map(|angle| converted(angle.to_degrees())).collect::<Vec<_>>())
}

/// A number in another unit, rounded to 10⁻¹², coarser than what a conversion of units loses: so the text of what was read does not change.
fn converted(value: f64) -> f64 {
    rounded(value, 12)
}

fn rounded(value: f64, decimals: usize) -> f64 {
    format!("{value:.decimals$}").parse::<f64>().unwrap_or(value) + 0.0
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}
