//! Texts about detections, shared by the archive and the picture.

use tauscope_bus::{Contact, Detection, flags};
use tauscope_dynamics::terms::UNKNOWN;

/// Severity of a detection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Severity {
    /// No contact and no change.
    Ok,
    /// A contact, or a change of the arm.
    Contact,
    /// A collision.
    Collision,
    /// The detector cannot judge.
    NotReady,
}

impl Severity {
    pub fn of(detection: &Detection) -> Self {
        match (detection.alarm(), detection.state.as_str()) {
            (true, "collision") => Self::Collision,
            (true, _) => Self::Contact,
            (false, "not_ready") => Self::NotReady,
            (false, _) => Self::Ok,
        }
    }
}

/// Names of the joints that detected (bit j for joint j).
pub(crate) fn loaded_joints(bits: u32, joints: &[String]) -> Vec<&str> {
    let loaded = |j: &usize| bits & (1 << j) != 0;
    (0..joints.len().min(32))
        .filter(loaded)
        .map(|j| joints[j].as_str())
        .collect()
}

/// A detection's state in a few words, e.g. `contact at link5`.
pub(crate) fn headline(detection: &Detection) -> String {
    let state = detection.state.as_str().replace('_', " ");
    if detection.header.has(flags::CHANGE) && detection.state.as_str() == UNKNOWN.name {
        return "changed, no name fits".to_owned();
    }
    let state = if detection.header.has(flags::CHANGE) {
        format!("{state} {:.3}", detection.size)
    } else {
        state
    };
    match (detection.alarm(), detection.link.as_str()) {
        (true, link) if !link.is_empty() => format!("{state} at {}", detection.links()),
        _ => state,
    }
}

/// Text for the end of an alarm: a contact has ended, or a change of the arm was learnt.
pub(crate) fn over(ended: &Contact) -> String {
    if ended.size.is_some() {
        return "learned: the rule from now on".to_owned();
    }
    let kind = ended.kind.as_str().replace('_', " ");
    let mut text = format!("{kind} ended after {}", ended.duration_in_words());
    if ended.peak().is_some() {
        text += &format!(", at its strongest {ended}");
    }
    text
}

#[cfg(test)]
mod tests {
    use tauscope_bus::{Name, flags};

    use super::*;

    #[test]
    fn a_detection_in_words() {
        let mut detection = Detection {
            state: "not_ready".into(),
            joints: 0b101,
            ..Detection::default()
        };
        assert_eq!(headline(&detection), "not ready");
        assert_eq!(Severity::of(&detection), Severity::NotReady);
        detection.header.flags = flags::ALARM;
        detection.state = "collision".into();
        detection.link = "link5".into();
        assert_eq!(headline(&detection), "collision at link5");
        detection.other_link = "link4".into();
        assert_eq!(headline(&detection), "collision at link5 or link4");
        detection.other_link = Name::default();
        assert_eq!(Severity::of(&detection), Severity::Collision);
        let joints = ["a", "b", "c"].map(str::to_owned);
        assert_eq!(loaded_joints(detection.joints, &joints), ["a", "c"]);
        detection.header.flags |= flags::CHANGE;
        (detection.state, detection.size) = ("torque_gain".into(), 1.08);
        assert_eq!(headline(&detection), "torque gain 1.080 at link5");
    }
}
