//! The stage's detections in words.

use tauscope_bus::{Detection, flags};
use tauscope_dynamics::terms::{UNKNOWN, effect};

/// A change or contact in words: `payload +0.99 kg at tool, seen in joint2 and joint4`. `joints` are the cell's
/// joint names, `effort_unit` is `Nm` or `A`.
pub fn in_words(detection: &Detection, joints: &[String], effort_unit: &str) -> String {
    let state = detection.state.as_str();
    let is_unknown = state == UNKNOWN.name;
    let mut text = if is_unknown {
        UNKNOWN.words.noun.to_owned()
    } else {
        state.replace('_', " ")
    };
    if detection.header.has(flags::CHANGE) && !is_unknown {
        text += &format!(" {}", amount(state, detection.size, effort_unit));
    }
    let named = joints.iter().enumerate();
    let shown: Vec<&str> = named
        .filter(|(j, _)| detection.joints & (1 << j) != 0)
        .map(|(_, name)| name.as_str())
        .collect();
    match (detection.link.as_str(), shown.as_slice()) {
        ("", []) => {}
        ("", shown) => text += &format!(" at {}", list(shown)),
        (link, []) => text += &format!(" at {link}"),
        (link, shown) => text += &format!(" at {link}, seen in {}", list(shown)),
    }
    text
}

/// The size of a change with its unit, e.g. `+1.02 N m` or `x 1.08`. The unit is that of the effect's first parameter,
/// with `effort_unit` in place of N m.
pub fn amount(state: &str, size: f64, effort_unit: &str) -> String {
    match &size_unit(state, effort_unit)[..] {
        "" => format!("x {size:.3}"),
        unit => format!("{size:+.2} {unit}"),
    }
}

/// The unit of the size of a change of the kind `state`; empty for a factor.
pub fn size_unit(state: &str, effort_unit: &str) -> String {
    let first = effect(state).and_then(|effect| effect.parameters.first());
    let unit = first.map_or("N m", |parameter| parameter.unit);
    let effort = if effort_unit == "Nm" {
        "N m"
    } else {
        effort_unit
    };
    unit.replace("N m", effort)
}

fn list(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_names_its_size_and_its_place() {
        let joints = ["a", "b", "c"].map(str::to_owned);
        let mut detection = Detection {
            state: "coulomb_friction".into(),
            joints: 0b10,
            size: 1.018,
            ..Detection::default()
        };
        detection.header.flags = flags::ALARM | flags::CHANGE;
        let words = in_words(&detection, &joints, "Nm");
        assert_eq!(words, "coulomb friction +1.02 N m at b");
        detection.state = "payload".into();
        detection.link = "tool".into();
        detection.joints = 0b111;
        let words = in_words(&detection, &joints, "Nm");
        assert_eq!(words, "payload +1.02 kg at tool, seen in a, b and c");
        detection.header.flags = flags::ALARM;
        detection.state = "contact".into();
        let words = in_words(&detection, &joints, "Nm");
        assert_eq!(words, "contact at tool, seen in a, b and c");
    }
}
