//! What the watching stage says.

use tauscope_bus::Detection;

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
    /// Canonical name: that of the effect, where it is one.
    pub fn name(self) -> &'static str {
        match self {
            Self::Contact => "contact",
            Self::TorqueBias => "torque_bias",
            Self::TorqueGain => "torque_gain",
            Self::CoulombFriction => "coulomb_friction",
            Self::ViscousFriction => "viscous_friction",
            Self::Payload => "payload",
            Self::Unknown => "unknown",
        }
    }
}

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
