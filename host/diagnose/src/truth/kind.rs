//! The kinds of effects that a true arm may have, with the laws that are right for them.

use std::fmt;
use std::str::FromStr;

use crate::effect::LawName;

/// A kind of effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The arm is as its drawing.
    Nothing,
    /// One leg does not reach one of its stops.
    StrokeLoss,
    /// One anchor of one leg sits elsewhere.
    AnchorOffset,
    /// Legs give way under the weight of the arm.
    GravitySag,
    /// A leg that is not moved comes off its stop.
    Play,
    /// The stroke depends on the supply.
    SupplyStroke,
    /// Legs grow with the temperature.
    ThermalGrowth,
    /// A leg is knocked out of its place in the middle of the run.
    Step,
    /// A leg creeps.
    Drift,
    /// A stop wears with each blow.
    Wear,
    /// Legs that switch together do not get as far.
    Crowding,
    /// A leg is longer in every state.
    LengthOffset,
    /// A leg is longer while another one is extended.
    Interaction,
    /// A leg that stays in its state continues to move for some seconds.
    Creep,
    /// The camera is knocked in the middle of the run.
    BaseStep,
    /// The camera is elsewhere.
    BaseOffset,
    /// The tool sits elsewhere.
    ToolOffset,
    /// The camera's scale is off.
    Scale,
    /// A servo's zero is off.
    JointOffset,
    /// The stand sways: no law knows it.
    Sway,
    /// The tool bends with the temperature: no law knows it.
    Bimetal,
    /// The tool bends with the supply: no law knows it.
    Hose,
    /// A valve remembers too long: no law knows it.
    Echo,
    /// Two legs together pull the tool aside: no law knows it.
    Cable,
}

impl Kind {
    /// The kinds that a demo draws from.
    pub const EFFECTS: [Self; 6] =
        [Self::StrokeLoss, Self::AnchorOffset, Self::GravitySag, Self::Play, Self::SupplyStroke, Self::ThermalGrowth];

    /// The law that is right for it.
    pub fn law(self) -> Option<LawName> {
        LawName::named(self.name())
    }

    /// Name of the law that is right for it; `none` of no effect, `no law` where none is right.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "none",
            Self::StrokeLoss => "stroke-loss",
            Self::AnchorOffset => "anchor-offset",
            Self::GravitySag => "gravity-sag",
            Self::Play => "play",
            Self::SupplyStroke => "supply-stroke",
            Self::ThermalGrowth => "thermal-growth",
            Self::Step => "step",
            Self::Drift => "drift",
            Self::Wear => "wear",
            Self::Crowding => "crowding",
            Self::LengthOffset => "length-offset",
            Self::Interaction => "interaction",
            Self::Creep => "creep",
            Self::BaseStep => "base-step",
            Self::BaseOffset => "base-offset",
            Self::ToolOffset => "tool-offset",
            Self::Scale => "scale",
            Self::JointOffset => "joint-offset",
            Self::Sway | Self::Bimetal | Self::Hose | Self::Echo | Self::Cable => "no law",
        }
    }

    /// Unit of its size.
    pub(crate) fn unit(self) -> &'static str {
        match self {
            Self::Nothing | Self::SupplyStroke | Self::Scale => "1",
            Self::GravitySag => "m/N",
            Self::ThermalGrowth => "1/K",
            Self::JointOffset => "rad",
            _ => "m",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that is no [`Kind`]'s.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no effect: use none, stroke-loss, anchor-offset, gravity-sag, play, supply-stroke or thermal-growth")]
pub struct NoSuchKind(String);

impl FromStr for Kind {
    type Err = NoSuchKind;

    fn from_str(name: &str) -> Result<Self, NoSuchKind> {
        let all = Self::EFFECTS.into_iter().chain([Self::Nothing]);
        all.into_iter().find(|kind| kind.name() == name).ok_or_else(|| NoSuchKind(name.into()))
    }
}
