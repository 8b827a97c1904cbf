//! Findings about an arm.

use serde::{Deserialize, Serialize};

use crate::forecast::Forecast;
use crate::series::Quantity;
use crate::shape::Shape;

/// Cause of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Undeclared mass on the tool, or loss of a declared one.
    Payload,
    /// Growing friction of one joint.
    Wear,
    /// Sudden rise of the friction of one joint: a crash, a dragging brake.
    FrictionStep,
    /// Fall of the friction of one joint: a new gear or grease, or a broken tooth.
    FrictionLoss,
    /// Simultaneous change of the friction of most joints: warmth without a sensor, or another method of measurement.
    CommonFriction,
    /// Friction that follows the temperature or the time since the start; no wear.
    Warmth,
    /// Changed scale of a joint's recorded effort.
    Gain,
    /// Changed constant part of a joint's effort.
    Offset,
    /// Changed backlash of a joint's gear.
    Backlash,
}

/// A change of an arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Cause of the change.
    pub cause: Cause,
    /// Joint; `None` for the whole arm.
    pub joint: Option<String>,
    /// Quantity with the strongest evidence.
    pub quantity: Quantity,
    /// Step, drift or episode.
    pub shape: Shape,
    /// Onset \[days since 1970-01-01 UTC\].
    pub from: f64,
    /// Night of the detection \[days since 1970-01-01 UTC\].
    pub told: f64,
    /// End, if it is over \[days since 1970-01-01 UTC\].
    pub until: Option<f64>,
    /// Level before the change.
    pub level: f64,
    /// Deviation from the level now, or during an episode.
    pub size: f64,
    /// 95 % interval of `size`.
    pub interval: [f64; 2],
    /// Forecast of the time at which friction is half as much again.
    pub forecast: Option<Forecast>,
    /// The finding as a sentence.
    pub sentence: String,
}

impl Finding {
    /// Whether the arm needs an inspection. Warmth and changes common to most joints need none.
    pub fn is_alarm(&self) -> bool {
        !matches!(self.cause, Cause::Warmth | Cause::CommonFriction)
    }
}
