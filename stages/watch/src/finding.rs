//! Findings of the stage: changes and contacts.

use tauscope_bus::Detection;
use tauscope_dynamics::terms::{
    COULOMB_FRICTION, Effect, PAYLOAD, TORQUE_BIAS, TORQUE_GAIN, UNKNOWN, VISCOUS_FRICTION,
};

/// Cause of a changed residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// A contact that began and ended.
    Contact,
    /// A constant offset of the effort at a joint.
    TorqueBias,
    /// A factor on the measured effort of a joint.
    TorqueGain,
    /// Coulomb friction of a joint.
    CoulombFriction,
    /// Viscous friction of a joint.
    ViscousFriction,
    /// A changed mass carried by the tool.
    Payload,
    /// A change that none of the others explains.
    Unknown,
}

impl Cause {
    /// Returns the effect in the library; `None` for a contact.
    pub fn effect(self) -> Option<&'static Effect> {
        match self {
            Self::Contact => None,
            Self::TorqueBias => Some(&TORQUE_BIAS),
            Self::TorqueGain => Some(&TORQUE_GAIN),
            Self::CoulombFriction => Some(&COULOMB_FRICTION),
            Self::ViscousFriction => Some(&VISCOUS_FRICTION),
            Self::Payload => Some(&PAYLOAD),
            Self::Unknown => Some(&UNKNOWN),
        }
    }

    /// Returns the canonical name: that of the effect, or `contact`.
    pub fn name(self) -> &'static str {
        self.effect().map_or(CONTACT, |effect| effect.name)
    }
}

/// Name of a contact.
const CONTACT: &str = "contact";

/// A change or a contact that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finding {
    /// The most likely cause.
    pub cause: Cause,
    /// The joints at which it is evident: bit j for joint j in URDF order.
    pub joints: u32,
    /// The joint whose child link was touched; `None` for a change, or if the link is unknown.
    pub link: Option<usize>,
    /// Start of the change or contact \[ns since the epoch\].
    pub since_ns: i64,
    /// Size in the unit of [`Detection::size`]; 0 where it has none.
    pub size: f64,
    /// Likelihood ratio over its threshold: 1 is just enough to be reported.
    pub score: f64,
}

impl Finding {
    /// Writes the finding into a detection.
    pub(super) fn tell(&self, slot: &mut Detection) {
        slot.joints = self.joints;
        slot.contact_ns = self.since_ns;
        slot.size = self.size;
        slot.score = self.score;
    }
}
