//! Canonical names, units and numbers in the words of whoever runs the cell.

use serde_json::Value;

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

fn sentence_case(name: &str) -> String {
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => words,
    }
}

/// Endings of canonical names and the units they stand for, longer ones before those they end in.
const UNITS: [(&str, &str); 20] = [
    ("_nms2_per_rad2", "N m s²/rad²"),
    ("_nms_per_rad", "N m s/rad"),
    ("_nm_per_rad", "N m/rad"),
    ("_as2_per_rad2", "A s²/rad²"),
    ("_as_per_rad", "A s/rad"),
    ("_a_per_rad", "A/rad"),
    ("_n_per_m", "N/m"),
    ("_per_rad", "1/rad"),
    ("_per_rev", "per turn"),
    ("_rad_s2", "rad/s²"),
    ("_rad_s", "rad/s"),
    ("_kgm2", "kg m²"),
    ("_nm", "N m"),
    ("_hz", "Hz"),
    ("_kg", "kg"),
    ("_rad", "rad"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
    ("_a", "A"),
];

/// A parameter's name in words and its unit (empty for a pure number), from its canonical name.
pub(super) fn parameter(name: &str) -> (String, &'static str) {
    let found = |name: &str| {
        UNITS
            .iter()
            .find_map(|(ending, unit)| Some((name.strip_suffix(ending)?.to_owned(), *unit)))
    };
    let second = || {
        let (stem, unit) = found(name.strip_suffix('2')?)?;
        Some((stem + "2", unit))
    };
    let (stem, unit) = found(name)
        .or_else(second)
        .unwrap_or_else(|| (name.to_owned(), ""));
    (parameter_label(&stem), unit)
}

fn parameter_label(stem: &str) -> String {
    let mut words: Vec<String> = stem
        .split('_')
        .map(|word| match word {
            "com" => "centre of mass".to_owned(),
            "delta" => "change of".to_owned(),
            "ixx" | "iyy" | "izz" | "ixy" | "ixz" | "iyz" => format!("inertia {}", &word[1..]),
            "coulomb" => "Coulomb".to_owned(),
            "stribeck" => "Stribeck".to_owned(),
            "q" => "position".to_owned(),
            word => word.to_owned(),
        })
        .collect();
    // `amplitude2` is that of the second wave.
    if let Some(last) = words.last_mut()
        && let Some(stem) = last.strip_suffix('2')
        && stem.len() > 1
    {
        *last = format!("{stem} (second)");
    }
    sentence_case(&words.join(" "))
}

/// A unit of effort as it is written in text.
pub(super) fn effort_unit(unit: &str) -> &str {
    if unit == "Nm" { "N m" } else { unit }
}

/// A parameter's value; numbers with as many digits as their interval warrants.
pub(super) fn value(value: &Value, interval: Option<[f64; 2]>) -> String {
    match (value, interval) {
        (Value::Number(number), interval) => {
            let number_value = number.as_f64().unwrap_or(f64::NAN);
            match interval {
                Some(interval) => with_digits_of(number_value, interval),
                None => number_text(number_value),
            }
        }
        (Value::String(text), _) => text.clone(),
        (Value::Null, _) => number_text(f64::NAN),
        (other, _) => other.to_string(),
    }
}

/// A number with two digits of its interval's half width.
pub(super) fn with_digits_of(number: f64, [low, high]: [f64; 2]) -> String {
    let half_width = (high - low).abs() / 2.0;
    if !half_width.is_finite() || half_width == 0.0 || !number.is_finite() {
        return number_text(number);
    }
    let decimals = 1 - half_width.log10().floor() as i32;
    if decimals > 7 || number.abs() >= 1e7 {
        return number_text(number);
    }
    fixed(number, decimals.max(0) as usize)
}

/// A number with three digits that count; a dash for one that is none.
pub(super) fn number_text(number: f64) -> String {
    if !number.is_finite() {
        return "–".to_owned();
    }
    if number == 0.0 {
        return "0".to_owned();
    }
    let magnitude = number.abs().log10().floor() as i32;
    if !(-4..6).contains(&magnitude) {
        let mantissa = number / 10_f64.powi(magnitude);
        return format!("{} × 10{}", fixed(mantissa, 2), superscript(magnitude));
    }
    fixed(number, (2 - magnitude).max(0) as usize)
}

/// With a true minus sign, and none before a zero.
pub(super) fn fixed(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|digit| matches!(digit, b'0' | b'.')) => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|digit| match digit {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            digit => digit
                .to_digit(10)
                .and_then(|value| char::from_u32(0x2070 + value))
                .unwrap_or(digit),
        })
        .collect()
}

/// A share as a percentage; a dash for one that is no number.
pub(super) fn percent(share: f64) -> String {
    if !share.is_finite() {
        return "–".to_owned();
    }
    let percent = share * 100.0;
    if percent > 0.0 && percent < 1.0 {
        "< 1 %".to_owned()
    } else {
        format!("{} %", fixed(percent, 0))
    }
}

/// How sure: never 100 %.
pub(super) fn confidence(confidence: f64) -> String {
    if confidence > 0.99 {
        "> 99 %".to_owned()
    } else {
        percent(confidence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_canonical_names() {
        let all = [
            ("coulomb_nm", "Coulomb", "N m"),
            ("viscous_nms_per_rad", "Viscous", "N m s/rad"),
            ("drag_nms2_per_rad2", "Drag", "N m s²/rad²"),
            ("stribeck_velocity_rad_s", "Stribeck velocity", "rad/s"),
            ("inertia_kgm2", "Inertia", "kg m²"),
            ("com_x_m", "Centre of mass x", "m"),
            ("delta_com_z_m", "Change of centre of mass z", "m"),
            ("ixx_kgm2", "Inertia xx", "kg m²"),
            ("cycles_per_rev", "Cycles", "per turn"),
            ("cycles_per_rev2", "Cycles (second)", "per turn"),
            ("amplitude2_nm", "Amplitude (second)", "N m"),
            ("change_time_session_s", "Change time session", "s"),
            ("stiffness_n_per_m", "Stiffness", "N/m"),
            ("gain", "Gain", ""),
            ("force_x_n", "Force x", "N"),
            ("cutoff_hz", "Cutoff", "Hz"),
            ("mass_kg", "Mass", "kg"),
        ];
        for (name, label, unit) in all {
            assert_eq!(parameter(name), (label.to_owned(), unit), "{name}");
        }
    }

    #[test]
    fn numbers_have_the_digits_that_count() {
        assert_eq!(with_digits_of(4.1234, [3.9, 4.3]), "4.12");
        assert_eq!(with_digits_of(-1234.5, [-1300.0, -1200.0]), "−1234");
        assert_eq!(number_text(0.012_345), "0.0123");
        assert_eq!(number_text(-0.000_001_234), "−1.23 × 10⁻⁶");
        assert_eq!(number_text(f64::NAN), "–");
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(percent(0.634), "63 %");
        assert_eq!(percent(f64::INFINITY), "–");
    }
}
