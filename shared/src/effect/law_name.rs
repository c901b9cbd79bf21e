//! The names of all laws in one list: those of arms of discrete actuators, those along a coordinate ([`basis`](super::basis)), and
//! those that only a regression on the host evaluates.

macro_rules! names {
    ($($law:ident = $name:literal,)+) => {
        /// A law by its name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum LawName {
            $(#[doc = concat!("`", $name, "`")] $law,)+
        }

        impl LawName {
            /// All laws.
            pub const ALL: &[Self] = &[$(Self::$law),+];

            /// The name in kebab-case, as files and reports have it.
            pub const fn as_str(self) -> &'static str {
                match self {
                    $(Self::$law => $name,)+
                }
            }
        }
    };
}

names! {
    AnchorOffset = "anchor-offset",
    AreaAlongStroke = "area-along-stroke",
    AxisError = "axis-error",
    Backlash = "backlash",
    BacklashByLoad = "backlash-by-load",
    BaseDrift = "base-drift",
    BaseOffset = "base-offset",
    BaseStep = "base-step",
    BaseTilt = "base-tilt",
    CoulombFriction = "coulomb-friction",
    Creep = "creep",
    Crowding = "crowding",
    Delay = "delay",
    Drift = "drift",
    EncoderPeriodic = "encoder-periodic",
    EncoderScale = "encoder-scale",
    FittedTerm = "fitted-term",
    FrictionWear = "friction-wear",
    Gain = "gain",
    GearPeriodicCosine = "gear-periodic-cosine",
    GearPeriodicSine = "gear-periodic-sine",
    GravitySag = "gravity-sag",
    Hysteresis = "hysteresis",
    Interaction = "interaction",
    JointCompliance = "joint-compliance",
    JointOffset = "joint-offset",
    LengthOffset = "length-offset",
    LinkCompliance = "link-compliance",
    LinkError = "link-error",
    LoadDependentFriction = "load-dependent-friction",
    LoadDependentPresliding = "load-dependent-presliding",
    LoadDependentViscosity = "load-dependent-viscosity",
    MassDistribution = "mass-distribution",
    Offset = "offset",
    OffsetDrift = "offset-drift",
    Play = "play",
    PositionDependentFriction = "position-dependent-friction",
    PreslidingFriction = "presliding-friction",
    RotorInertia = "rotor-inertia",
    Scale = "scale",
    SensorFrame = "sensor-frame",
    SpeedDependentOffset = "speed-dependent-offset",
    Spring = "spring",
    Step = "step",
    StepInTime = "step-in-time",
    StribeckFriction = "stribeck-friction",
    StrokeLoss = "stroke-loss",
    SupplyStroke = "supply-stroke",
    ThermalDrift = "thermal-drift",
    ThermalGrowth = "thermal-growth",
    ThermalViscosity = "thermal-viscosity",
    ToolFrame = "tool-frame",
    ToolOffset = "tool-offset",
    ViscousFriction = "viscous-friction",
    Wear = "wear",
}

impl LawName {
    /// The law with this name; `None` where there is none such.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|law| law.as_str() == name)
    }
}

impl core::fmt::Display for LawName {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.pad(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_law_is_found_by_its_name() {
        assert!(LawName::ALL.iter().all(|law| LawName::named(law.as_str()) == Some(*law)));
        assert_eq!(LawName::named("nothing-like-it"), None);
        let mut letters = LawName::ALL.iter().flat_map(|law| law.as_str().chars());
        assert!(letters.all(|c| c.is_ascii_lowercase() || c == '-'));
    }
}
