//! The part to inspect for a finding.

use serde_json::Value;
use tauscope_dynamics::terms::{Against, UNKNOWN, effect, words};

use crate::report::schema::Finding;
use crate::report::slip_words;

/// Returns the part to inspect for a finding; `None` if it is not a fault.
pub fn look_at(finding: &Finding) -> Option<String> {
    let known = finding.known_as();
    let is_curve = known == UNKNOWN.name && finding.link.is_none();
    let template = (is_curve.then(|| of_curve(finding)).flatten())
        .or_else(|| effect(known).map(|effect| effect.words.look_at))
        .or_else(|| slip_words::words(known).map(|words| words.look_at))?;
    if template.is_empty() {
        return None;
    }
    let text = |name: &str| finding.parameters.get(name).and_then(Value::as_str);
    let place = finding.link.as_deref().or(finding.joint.as_deref());
    Some(words::fill(template, |name, _| match name {
        "source" => text("source_joint").unwrap_or("the other joint").to_owned(),
        _ => place.unwrap_or("").to_owned(),
    }))
}

/// Returns the likely part of an unnamed effect by the argument of its curve.
fn of_curve(finding: &Finding) -> Option<&'static str> {
    let against = finding.parameters.get("against")?.clone();
    let against = serde_json::from_value::<Against>(against).ok()?;
    let by_direction = finding
        .parameters
        .get("by_direction")
        .and_then(Value::as_bool);
    Some(match (against, by_direction.unwrap_or(false)) {
        (Against::Position, true) => {
            "Joint {place}: gear, bearing and seal where the curve is largest; a worn tooth, a dent, dirt or a bent shaft?"
        }
        (Against::Position, false) => {
            "Joint {place}: cable, hose, spring or end stop where the curve is largest; gear, motor and encoder, if it repeats."
        }
        (Against::Velocity, _) => {
            "Joint {place}: lubricant and bearings; is the grease cold, old or too much?"
        }
        (Against::VelocityDifference | Against::VelocitySum, _) => {
            "Joint {place}, and the joint that it moves against: do parts of the two rub on each other, such as seals, covers or cables?"
        }
        (Against::Acceleration, _) => {
            "Joint {place}: coupling, belt and screws between motor and link; does something give or swing?"
        }
        (Against::Load, _) => {
            "Joint {place}: its torque sensor or current sensor; is its reading in line with the load?"
        }
        (Against::DrivenLoad, _) => {
            "Joint {place}: gear and lubricant; does it lose more under load, or driving than driven?"
        }
        (Against::LoadTurned, _) => {
            "Joint {place}: gear, belt and torque sensor; does one wind up and lag behind the load?"
        }
        (Against::SinceRest, _) => {
            "Joint {place}: its brake, for it may let go late; and lubricant that sets at rest."
        }
        (Against::SinceTurn, _) => {
            "Joint {place}: belt, coupling, gear and its screws; does something give or wind up each time it turns round?"
        }
        (Against::RecordingTime | Against::SessionTime, _) => {
            "Joint {place}: what changed then? Heat, a brake that drags, a bearing, a loose connector, a sensor that drifts."
        }
    })
}
