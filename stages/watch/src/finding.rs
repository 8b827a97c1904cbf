//! What the watching stage says.

use tauscope_bus::Detection;
use tauscope_dynamics::terms::{
    COULOMB_FRICTION, Effect, PAYLOAD, TORQUE_BIAS, TORQUE_GAIN, UNKNOWN, VISCOUS_FRICTION,
};

/// What is behind a residual that changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// Something touched the arm, and let go again.
    Contact,
    /// The effort at a joint is another by a constant.
    TorqueBias,
    /// The effort at a joint is reported by another factor.
    TorqueGain,
    /// The friction of a joint that does not depend on its speed.
    CoulombFriction,
    /// The friction of a joint that grows with its speed.
    ViscousFriction,
    /// The arm carries more, or less.
    Payload,
    /// Something that no name fits.
    Unknown,
}

impl Cause {
    /// The effect, where it is one.
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

    /// Canonical name: that of the effect, where it is one.
    pub fn name(self) -> &'static str {
        self.effect().map_or(CONTACT, |effect| effect.name)
    }
}

/// What a contact is called.
const CONTACT: &str = "contact";

/// A change that was noticed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finding {
    /// The best name so far.
    pub cause: Cause,
    /// The joints that show it: bit j for joint j in URDF order.
    pub joints: u32,
    /// The link, of a payload and of a contact, where there is a robot.
    pub link: Option<usize>,
    /// Since when \[ns since the epoch\].
    pub since_ns: i64,
    /// How large, in the unit of [`Detection::size`]; 0 where that has no meaning.
    pub size: f64,
    /// How far beyond what is usual: 1 is just enough to be told.
    pub score: f64,
}

impl Finding {
    /// Writes it into a detection.
    pub(super) fn tell(&self, slot: &mut Detection) {
        slot.joints = self.joints;
        slot.contact_ns = self.since_ns;
        slot.size = self.size;
        slot.score = self.score;
    }
}
