//! What is told of an arm.

use serde::{Deserialize, Serialize};

use crate::forecast::Forecast;
use crate::series::Quantity;
use crate::shape::Shape;

/// What is behind a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// A mass on the tool that the twin does not know of, or a lost one.
    Payload,
    /// The friction of one joint grows.
    Wear,
    /// The friction of one joint has grown at once: a crash, a brake that drags.
    FrictionStep,
    /// The friction of one joint has become less: a new gear or grease, or a tooth that is gone.
    FrictionLoss,
    /// The friction of most joints has changed at once: warmth without a sensor, or another way of measuring.
    CommonFriction,
    /// Friction follows the temperature, or the time since the start: no wear.
    Warmth,
    /// A joint's effort is recorded on another scale.
    Gain,
    /// A joint's effort has another constant part.
    Offset,
    /// The play of a joint's gear has changed.
    Backlash,
}

/// A change of an arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What is behind it.
    pub cause: Cause,
    /// The joint; `None` for the whole arm.
    pub joint: Option<String>,
    /// The quantity that tells it best.
    pub quantity: Quantity,
    /// Step, drift or episode.
    pub shape: Shape,
    /// When it began \[days since 1970-01-01 UTC\].
    pub from: f64,
    /// The night in which it was certain \[days since 1970-01-01 UTC\].
    pub told: f64,
    /// When it was over.
    pub until: Option<f64>,
    /// The level before.
    pub level: f64,
    /// By how much it is off that now, or was while it lasted.
    pub size: f64,
    /// The 95 % interval of that.
    pub interval: [f64; 2],
    /// When half as much friction again is reached.
    pub forecast: Option<Forecast>,
    /// The finding as a sentence.
    pub sentence: String,
}

impl Finding {
    /// Whether somebody should look at the arm. Warmth is only explained, and so is what most joints share.
    pub fn is_alarm(&self) -> bool {
        !matches!(self.cause, Cause::Warmth | Cause::CommonFriction)
    }
}
