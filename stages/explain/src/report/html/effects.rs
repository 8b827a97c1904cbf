//! What effects are called, and what they mean at the arm.

use super::number_format::sentence_case;

/// What an effect is called and what it means at the arm.
const EFFECTS: [(&str, &str, &str); 30] = [
    (
        "viscous_friction",
        "Viscous friction",
        "Resistance that grows with speed: grease, seals, gear churning.",
    ),
    (
        "coulomb_friction",
        "Coulomb friction",
        "A constant resistance against the motion, whatever the speed: dry friction in gear and bearings.",
    ),
    (
        "stribeck_friction",
        "Stribeck friction",
        "Friction that is highest when motion begins and falls with speed: the joint sticks before it slips.",
    ),
    (
        "asymmetric_coulomb",
        "Direction-dependent friction",
        "Dry friction that is larger in one direction than in the other.",
    ),
    (
        "load_dependent_friction",
        "Load-dependent friction",
        "Friction that grows with the torque through the gear: the joint rubs more the more it carries.",
    ),
    (
        "presliding_hysteresis",
        "Pre-sliding hysteresis",
        "The joint gives like a spring before it slips, so that friction lags behind each reversal.",
    ),
    (
        "quadratic_drag",
        "Quadratic drag",
        "Resistance that grows with the square of the speed: fast gears in oil.",
    ),
    (
        "temperature_viscous",
        "Warm-up friction",
        "Viscous friction that fades while the joint gets warm.",
    ),
    (
        "friction_step",
        "Friction step",
        "Friction that changed once and stayed: a brake that drags, a bearing that failed, grease that was renewed.",
    ),
    (
        "rotor_inertia",
        "Rotor inertia",
        "Inertia of motor and gear, seen through the gear, that only acceleration shows.",
    ),
    (
        "joint_elasticity",
        "Joint elasticity",
        "The gear or its flexspline twists under load, so that the link follows behind the motor.",
    ),
    (
        "backlash",
        "Backlash",
        "Play in the gear: for a moment after each reversal the motor turns alone.",
    ),
    (
        "payload",
        "Payload",
        "Something is mounted on or held by the tool that the twin does not know of.",
    ),
    (
        "payload_pickup",
        "Payload for a while",
        "Something was picked up and put down again that the twin does not know of.",
    ),
    (
        "link_mass",
        "Link mass",
        "A link is heavier or lighter than its model says.",
    ),
    (
        "link_com",
        "Link centre of mass",
        "A link's mass is distributed otherwise than its model says.",
    ),
    (
        "base_tilt",
        "Base tilt",
        "The base does not stand level, or is mounted otherwise than the model says.",
    ),
    (
        "counterbalance_spring",
        "Counterbalance spring",
        "A spring or gas strut carries part of the weight.",
    ),
    (
        "cable_spring",
        "Cable spring",
        "A cable or hose pulls the joint back to where it hangs freely.",
    ),
    (
        "torque_ripple",
        "Torque ripple",
        "A wave in the torque that repeats with each turn of motor or gear.",
    ),
    (
        "torque_gain",
        "Torque gain",
        "The torque is reported too large or too small by a factor: sensor gain, torque constant, gear efficiency.",
    ),
    (
        "torque_bias",
        "Torque offset",
        "The torque is reported with a constant offset: a sensor that was not zeroed.",
    ),
    (
        "torque_delay",
        "Torque delay",
        "The torque is reported late against the position.",
    ),
    (
        "torque_lowpass",
        "Torque low-pass filter",
        "The reported torque is smoothed, so that fast changes are missing.",
    ),
    (
        "torque_saturation",
        "Torque saturation",
        "The torque stops at a limit: of the sensor's range, or of the drive.",
    ),
    (
        "transmission_coupling",
        "Transmission coupling",
        "Torque of one joint shows in another: coupled gears or belts, as in a wrist.",
    ),
    (
        "external_push",
        "External push",
        "Something or somebody pushed the arm for a while.",
    ),
    (
        "contact_wall",
        "Contact with a wall",
        "The arm pressed against something firm.",
    ),
    (
        "unknown",
        "Unknown",
        "Something that no name of the library fits; the correction only describes it.",
    ),
    ("contact", "Contact", "The arm touched something."),
];

/// An effect's name in words.
pub(super) fn effect_title(effect: &str) -> String {
    EFFECTS
        .iter()
        .find(|(name, ..)| *name == effect)
        .map_or_else(
            || sentence_case(effect),
            |(_, title, _)| (*title).to_owned(),
        )
}

/// What an effect is, in a sentence; nothing for one that is not known here.
pub(super) fn effect_meaning(effect: &str) -> Option<&'static str> {
    EFFECTS
        .iter()
        .find(|(name, ..)| *name == effect)
        .map(|(.., meaning)| *meaning)
}

/// An effect and where it is: `Coulomb friction of joint3`.
pub(super) fn effect_at(effect: &str, joint: Option<&str>, link: Option<&str>) -> String {
    let title = effect_title(effect);
    match place(joint, link) {
        Some(place) => format!("{title}, {place}"),
        None => title,
    }
}

/// `joint3`, `link tool`; nothing for an effect of the whole arm.
pub(super) fn place(joint: Option<&str>, link: Option<&str>) -> Option<String> {
    match (joint, link) {
        (Some(joint), _) if mentions(joint, "joint") => Some(joint.to_owned()),
        (Some(joint), _) => Some(format!("joint {joint}")),
        (None, Some(link)) if mentions(link, "link") => Some(link.to_owned()),
        (None, Some(link)) => Some(format!("link {link}")),
        (None, None) => None,
    }
}

fn mentions(name: &str, word: &str) -> bool {
    name.to_ascii_lowercase().contains(word)
}
