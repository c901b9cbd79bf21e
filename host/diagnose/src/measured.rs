//! The quantities that a measurement can be of.

use std::fmt;

use serde::{Serialize, Serializer};

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// Poses of a tool: of an arm of discrete actuators, or of a serial robot.
    ToolPose,
    /// The force of an actuator.
    ActuatorForce,
    /// The position that a joint holds.
    JointPosition,
    /// Torques of the joints of a robot.
    JointTorque,
    /// The wrench between a floating base and a force plate.
    ContactWrench,
    /// Positions of the tool of a serial robot.
    ToolPosition,
    /// Postures in which the tool touches one point.
    PointContact,
}

impl Measured {
    /// Whether an instrument beside the robot measures its tool, in a posture per row.
    pub(crate) const fn is_of_tool(self) -> bool {
        matches!(self, Self::ToolPose | Self::ToolPosition)
    }

    /// The name in files and reports.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::ToolPose => "tool-pose",
            Self::ActuatorForce => "actuator-force",
            Self::JointPosition => "joint-position",
            Self::JointTorque => "joint-torque",
            Self::ContactWrench => "contact-wrench",
            Self::ToolPosition => "tool-position",
            Self::PointContact => "point-contact",
        }
    }
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl Serialize for Measured {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}
