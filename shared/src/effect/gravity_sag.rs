//! Gravity sag: legs give way along their axis under the weight that they carry.
//!
//! # Model
//!
//! l = l₀ − c·F
//!
//! | symbol | field                 | unit | meaning                                              |
//! |--------|-----------------------|------|------------------------------------------------------|
//! | l₀     | `Setting::value`      | m    | length of the leg without load                       |
//! | c      | `compliance_m_per_n`  | m/N  | shortening per force, ≥ 0                            |
//! | F      | argument `force`      | N    | what the leg pushes with; positive in compression    |
//!
//! Frame: a scalar along the actuator. F carries all masses further out, by statics in the posture with sag.
//! Valid while the sag is small against the levers of the weights. A revolute joint does not sag.
//! Source: Merlet, Parallel Robots, Springer, 2006, chapter 9 (stiffness).
//!
//! # Example
//!
//! ```
//! use darm_core::effect::{Law, Place, Site, gravity_sag::GravitySag};
//! let law = GravitySag { at: Place::Arm, compliance_m_per_n: 2e-5 };
//! // A leg that carries 50 N gets shorter by 2e-5 m/N · 50 N = 1 mm.
//! let growth_m: f64 = law.deflection(&Site::default(), 50.0);
//! assert!((growth_m + 1e-3).abs() < 1e-15);
//! ```

use core::slice;

use super::{Detail, Law, LawName, Place, Quantity, Site};
use crate::actuator::JointKind;
use crate::real::{Real, real};

/// Legs that give way under load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravitySag<T: Real> {
    /// The legs concerned; one compliance serves all.
    pub at: Place,
    /// Shortening per force, m/N.
    pub compliance_m_per_n: T,
}

impl<T: Real> Law<T> for GravitySag<T> {
    fn at(place: Place, detail: Detail) -> Option<Self> {
        (detail == Detail::All && place.is_actuators()).then_some(Self { at: place, compliance_m_per_n: T::zero() })
    }

    fn name(&self) -> LawName {
        LawName::GravitySag
    }

    fn place(&self) -> Place {
        self.at
    }

    fn quantities(&self) -> &'static [Quantity] {
        &[Quantity { name: "compliance", unit: "m/N" }]
    }

    fn values(&self) -> &[T] {
        slice::from_ref(&self.compliance_m_per_n)
    }

    fn values_mut(&mut self) -> &mut [T] {
        slice::from_mut(&mut self.compliance_m_per_n)
    }

    fn deflection(&self, site: &Site<T>, force: T) -> T {
        match site.kind {
            JointKind::Prismatic => -self.compliance_m_per_n * force,
            JointKind::Revolute => T::zero(),
        }
    }

    fn bears_load(&self) -> bool {
        true
    }
}

impl GravitySag<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> GravitySag<U> {
        GravitySag { at: self.at, compliance_m_per_n: real(self.compliance_m_per_n) }
    }
}
