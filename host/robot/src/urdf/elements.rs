//! What the elements of a URDF say: numbers, vectors, poses, references, each with its place when it is wrong.

use std::ops::Range;

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};
use darm_core::tree::Inertia;

use super::fault::UrdfFault;
use crate::assembly::Following;
use crate::xml::Element;

/// What is wrong, and where.
pub(super) type Wrong = (Range<usize>, UrdfFault);

/// An element with a name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Named<'a> {
    pub(super) element: Element<'a>,
    pub(super) name: &'a str,
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Fixed,
    Floating,
    Moving { kind: JointKind, is_continuous: bool },
}

impl<'a> Named<'a> {
    pub(super) fn new(element: Element<'a>) -> Result<Self, Wrong> {
        Ok(Self { element, name: required(element, "name")? })
    }

    /// The fault at the element.
    pub(super) fn wrong(self, fault: UrdfFault) -> Wrong {
        (self.element.span(), fault)
    }

    /// The link that `<parent>` or `<child>` names.
    pub(super) fn link(self, tag: &'static str) -> Result<&'a str, Wrong> {
        let missing = || self.wrong(UrdfFault::Missing { element: "joint", what: tag });
        required(self.element.child(tag).ok_or_else(missing)?, "link")
    }

    pub(super) fn kind(self) -> Result<Kind, Wrong> {
        let refused = |kind, advice| self.wrong(UrdfFault::Kind { joint: self.name.into(), kind, advice });
        let moving = |kind, is_continuous| Ok(Kind::Moving { kind, is_continuous });
        match required(self.element, "type")? {
            "fixed" => Ok(Kind::Fixed),
            "floating" => Ok(Kind::Floating),
            "revolute" => moving(JointKind::Revolute, false),
            "continuous" => moving(JointKind::Revolute, true),
            "prismatic" => moving(JointKind::Prismatic, false),
            "planar" => Err(refused("planar", "two prismatic joints and a revolute one")),
            "spherical" => Err(refused("spherical", "three revolute joints")),
            _ => Err(refused("of an unknown type", "fixed, revolute, continuous, prismatic or floating")),
        }
    }

    /// Its `<origin>`: roll, pitch and yaw about the fixed axes, R = Rot_z(y)·Rot_y(p)·Rot_x(r).
    pub(super) fn origin(self) -> Result<Pose<f64>, Wrong> {
        origin(self.element)
    }

    /// A unit vector, x where the file is silent.
    pub(super) fn axis(self) -> Result<Vec3<f64>, Wrong> {
        let Some(element) = self.element.child("axis") else { return Ok(Vec3::x()) };
        let axis = Vec3::from(numbers(element, "xyz", [1.0, 0.0, 0.0])?);
        let length = axis.norm();
        if !length.is_finite() || length < f64::MIN_POSITIVE.sqrt() {
            return Err((element.span(), UrdfFault::Axis { joint: self.name.into() }));
        }
        // An axis that is a unit vector already keeps its digits.
        Ok(if length == 1.0 { axis } else { axis / length })
    }

    /// A number of a child, 0 where the file is silent.
    pub(super) fn number(self, tag: &str, attribute: &'static str) -> Result<f64, Wrong> {
        self.element.child(tag).map_or(Ok(0.0), |child| number(child, attribute, 0.0))
    }

    /// Least and greatest position; `None` where they are equal or the file is silent.
    pub(super) fn limits(self) -> Result<Option<[f64; 2]>, Wrong> {
        let Some(limit) = self.element.child("limit") else { return Ok(None) };
        let (lower, upper) = (number(limit, "lower", 0.0)?, number(limit, "upper", 0.0)?);
        if lower > upper {
            return Err((limit.span(), UrdfFault::Limits { joint: self.name.into(), lower, upper }));
        }
        Ok((lower < upper).then_some([lower, upper]))
    }

    /// The joint that it mimics.
    pub(super) fn mimic(self) -> Result<Option<(Following, Range<usize>)>, Wrong> {
        let Some(mimic) = self.element.child("mimic") else { return Ok(None) };
        let joint = required(mimic, "joint")?.to_owned();
        let (factor, offset) = (number(mimic, "multiplier", 1.0)?, number(mimic, "offset", 0.0)?);
        Ok(Some((Following { joint, factor, offset }, mimic.span())))
    }

    /// The mass distribution of a link in its frame.
    pub(super) fn inertia(self) -> Result<Inertia<f64>, Wrong> {
        let Some(inertial) = self.element.child("inertial") else { return Ok(Inertia::none()) };
        let mass = inertial.child("mass").map_or(Ok(0.0), |mass| number(mass, "value", 0.0))?;
        if mass < 0.0 {
            let element = inertial.child("mass").unwrap_or(inertial);
            return Err((element.span(), UrdfFault::Mass { link: self.name.into(), mass }));
        }
        let moment = |key| inertial.child("inertia").map_or(Ok(0.0), |inertia| number(inertia, key, 0.0));
        let [xx, xy, xz] = [moment("ixx")?, moment("ixy")?, moment("ixz")?];
        let [yy, yz, zz] = [moment("iyy")?, moment("iyz")?, moment("izz")?];
        let about_com = Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let origin = origin(inertial)?;
        Ok(Inertia { mass, com: Vec3::zeros(), about_com }.placed(&origin.rotation, &origin.position))
    }
}

fn origin(element: Element<'_>) -> Result<Pose<f64>, Wrong> {
    let Some(origin) = element.child("origin") else { return Ok(Pose::identity()) };
    let position = numbers(origin, "xyz", [0.0; 3])?.into();
    if let Some(given) = origin.attribute("quat_xyzw") {
        let wrong = |what| (given.span.clone(), UrdfFault::Quaternion { what });
        if origin.attribute("rpy").is_some() {
            return Err(wrong("and rpy both give the rotation; remove one"));
        }
        let [x, y, z, w] = numbers(origin, "quat_xyzw", [0.0, 0.0, 0.0, 1.0])?;
        let rotation = quaternion([x, y, z, w]).ok_or_else(|| wrong("has no length; give one of length 1"))?;
        return Ok(Pose { rotation, position });
    }
    let [roll, pitch, yaw] = numbers(origin, "rpy", [0.0; 3])?;
    let about = |axis: Vec3<f64>, angle: f64| rotation_exp(&(axis * angle));
    let rotation = about(Vec3::z(), yaw) * about(Vec3::y(), pitch) * about(Vec3::x(), roll);
    Ok(Pose { rotation, position })
}

/// The rotation of a quaternion, which need not have length 1; `None` of one without length.
fn quaternion([x, y, z, w]: [f64; 4]) -> Option<Mat3<f64>> {
    let vector = Vec3::new(x, y, z);
    let length = vector.norm().hypot(w);
    let axis = vector.try_normalize(0.0).unwrap_or(Vec3::x());
    (length > 1e-9 && length.is_finite()).then(|| rotation_exp(&(axis * (2.0 * vector.norm().atan2(w)))))
}

pub(super) fn required<'a>(element: Element<'a>, attribute: &'static str) -> Result<&'a str, Wrong> {
    let missing = || (element.span(), UrdfFault::NoAttribute { element: element.tag().into(), attribute });
    element.value(attribute).ok_or_else(missing)
}

pub(super) fn number(element: Element<'_>, attribute: &'static str, default: f64) -> Result<f64, Wrong> {
    numbers(element, attribute, [default]).map(|[number]| number)
}

pub(super) fn numbers<const N: usize>(
    element: Element<'_>,
    attribute: &'static str,
    default: [f64; N],
) -> Result<[f64; N], Wrong> {
    let Some(given) = element.attribute(attribute) else { return Ok(default) };
    let wrong = || UrdfFault::Numbers { attribute, value: given.value.clone(), expected: N };
    let found = given.numbers().and_then(|numbers| numbers.try_into().ok());
    found.ok_or_else(|| (given.span.clone(), wrong()))
}
