//! Numbers, units and sentences.

use std::collections::BTreeMap;

use serde_json::Value;
use tauscope_dynamics::terms::Against;

use crate::physics::active::Active;
use crate::physics::friction;
use crate::physics::parameter_units::unit;

/// `value` with three significant digits and no trailing zeros, e.g. `4.1`, `0.0235`, `21`.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let magnitude = value.abs().log10().floor() as i32;
    let decimals = usize::try_from(2 - magnitude).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if !text.contains('.') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// How much likelier something is that is ahead by so many nats, e.g. `40`, `10^17`.
pub fn odds(nats: f64) -> String {
    /// From here on powers of ten are easier to read.
    const MANY: f64 = 1000.0;
    let odds = nats.max(0.0).exp();
    if odds < MANY {
        return format!("{odds:.0}");
    }
    format!("10^{:.0}", nats / std::f64::consts::LN_10)
}

/// A sentence on an effort whose numbers are in A.
pub fn in_amperes(sentence: &str) -> String {
    sentence.replace("N m", "A").replace("kg m²", "A s²/rad")
}

/// What an effect is called in words.
pub fn name(effect: &str) -> String {
    match effect {
        "stribeck_friction" => "Stribeck friction".to_owned(),
        "coulomb_friction" => "Coulomb friction".to_owned(),
        "asymmetric_coulomb" => "Coulomb friction that differs by direction".to_owned(),
        "temperature_viscous" => "viscous friction that falls as the joint warms up".to_owned(),
        "friction_step" => "Coulomb friction that changed once".to_owned(),
        "payload" => "a payload".to_owned(),
        "payload_pickup" => "a payload for a while".to_owned(),
        "link_mass" => "another mass".to_owned(),
        "link_com" => "another centre of mass".to_owned(),
        "base_tilt" => "a base that is tilted".to_owned(),
        "external_push" => "a push from outside".to_owned(),
        "contact_wall" => "contact with something stiff".to_owned(),
        "unknown" => "something that no name fits".to_owned(),
        other => other.replace('_', " "),
    }
}

/// A friction that is less than the twin says.
fn less_friction(
    effect: &str,
    place: &str,
    parameters: &BTreeMap<String, Value>,
) -> Option<String> {
    friction::plain(effect)?;
    let (parameter, value) = parameters.iter().next()?;
    let value = value.as_f64().filter(|value| *value < 0.0)?;
    let (less, unit, name) = (number(-value), unit(parameter), name(effect));
    Some(format!(
        "Joint {place} has {less} {unit} less {name} than the twin says."
    ))
}

/// A finding in a sentence; `place` is what the joint or link is called.
#[expect(clippy::too_many_lines, reason = "one sentence per effect")]
pub fn sentence(
    active: &Active,
    place: &str,
    parameters: &BTreeMap<String, Value>,
    intervals: &BTreeMap<String, [f64; 2]>,
    joints: &[String],
) -> String {
    let effect = active.hypothesis.effect.name;
    let with = |parameter: &str| -> String {
        let value = parameters
            .get(parameter)
            .and_then(Value::as_f64)
            .unwrap_or(f64::NAN);
        let between = intervals
            .get(parameter)
            .map_or_else(String::new, |[low, high]| {
                format!(" ({} to {})", number(*low), number(*high))
            });
        format!("{} {}{between}", number(value), unit(parameter)).replace("  ", " ")
    };
    let left_out = "that the twin leaves out";
    if let Some(less) = less_friction(effect, place, parameters) {
        return less;
    }
    match effect {
        "viscous_friction" => format!(
            "Joint {place} has viscous friction of {} {left_out}.",
            with("viscous_nms_per_rad")
        ),
        "coulomb_friction" => format!(
            "Joint {place} has Coulomb friction of {} {left_out}.",
            with("coulomb_nm")
        ),
        "stribeck_friction" => format!(
            "Joint {place} has friction that falls from {} at standstill to {} in motion, over {} {left_out}.",
            with("static_nm"),
            with("coulomb_nm"),
            with("stribeck_velocity_rad_s")
        ),
        "asymmetric_coulomb" => format!(
            "Joint {place} has Coulomb friction of {} forward and {} backward {left_out}.",
            with("coulomb_positive_nm"),
            with("coulomb_negative_nm")
        ),
        "load_dependent_friction" => format!(
            "The friction of joint {place} grows with the load on its gear, by {} of it.",
            with("coefficient")
        ),
        "presliding_hysteresis" => format!(
            "The friction of joint {place}, {}, builds up over its bristles after each reversal, with {}.",
            with("coulomb_nm"),
            with("bristle_stiffness_nm_per_rad")
        ),
        "quadratic_drag" => format!(
            "Joint {place} has a drag of {} {left_out}.",
            with("drag_nms2_per_rad2")
        ),
        "temperature_viscous" => format!(
            "The viscous friction of joint {place} falls as it warms up: {} warm and {} more when cold, within {}.",
            with("viscous_warm_nms_per_rad"),
            with("viscous_extra_cold_nms_per_rad"),
            with("time_constant_s")
        ),
        "friction_step" => format!(
            "The Coulomb friction of joint {place} jumped from {} to {}, {} into the session.",
            with("coulomb_before_nm"),
            with("coulomb_after_nm"),
            with("change_time_session_s")
        ),
        "rotor_inertia" => format!(
            "Joint {place} turns a rotor of {} (armature) {left_out}.",
            with("inertia_kgm2")
        ),
        "joint_elasticity" => format!(
            "Joint {place} is elastic, {}, behind a rotor of {}.",
            with("stiffness_nm_per_rad"),
            with("rotor_inertia_kgm2")
        ),
        "backlash" => format!(
            "Joint {place} has a play of {} behind a rotor of {}.",
            with("gap_rad"),
            with("rotor_inertia_kgm2")
        ),
        "payload" => format!(
            "The arm carries {} that nobody told the twin of.",
            with("mass_kg")
        ),
        "payload_pickup" => format!(
            "The arm carries {} for a while in each recording, from {} to {}.",
            with("mass_kg"),
            with("t_start_s"),
            with("t_end_s")
        ),
        "link_mass" => format!(
            "Link {place} is heavier than in the URDF by {}.",
            with("delta_mass_kg")
        ),
        "link_com" => format!(
            "The centre of mass of link {place} is off by ({}, {}, {}) in its frame.",
            with("delta_com_x_m"),
            with("delta_com_y_m"),
            with("delta_com_z_m")
        ),
        "link_inertia" => {
            let value = |parameter: &str| parameters.get(parameter).and_then(Value::as_f64);
            let moment = ["x", "y", "z"].map(|axis| {
                let value = value(&format!("delta_first_moment_{axis}_kgm"));
                number(value.unwrap_or(f64::NAN))
            });
            format!(
                "Link {place} is another body than its URDF says, and no one name fits that: its mass is off by {}, its first moment \
                 (mass times centre) by ({}) kg m, and so is its inertia; \
                 what is left depends on the motion of all joints that carry it.",
                with("delta_mass_kg"),
                moment.join(", ")
            )
        }
        "base_tilt" => format!(
            "The base is tilted: roll {}, pitch {}.",
            with("roll_rad"),
            with("pitch_rad")
        ),
        "counterbalance_spring" => format!(
            "A counterbalance of {} acts on joint {place}, at rest at {}.",
            with("amplitude_nm"),
            with("rest_angle_rad")
        ),
        "cable_spring" => format!(
            "A cable or dress pack pulls at joint {place} with {}, at rest at {}.",
            with("stiffness_nm_per_rad"),
            with("rest_angle_rad")
        ),
        "torque_ripple" => format!(
            "The effort of joint {place} ripples by {}, {} times a revolution.",
            with("amplitude_nm"),
            with("cycles_per_rev")
        ),
        "torque_gain" => format!(
            "The effort of joint {place} is recorded {} times too large.",
            with("gain")
        ),
        "torque_bias" => format!(
            "The effort of joint {place} is recorded with an offset of {}.",
            with("bias_nm")
        ),
        "torque_delay" => format!("The effort is recorded {} late.", with("delay_s")),
        "torque_lowpass" => format!(
            "The effort is recorded through a low-pass of {}.",
            with("cutoff_hz")
        ),
        "torque_saturation" => format!(
            "The recorded effort of joint {place} saturates at {}.",
            with("limit_nm")
        ),
        "transmission_coupling" => format!(
            "Joint {place} carries {} times the effort of joint {}.",
            with("coefficient"),
            joints[active.hypothesis.place.source]
        ),
        "external_push" if !parameters.contains_key("force_x_n") => format!(
            "Something pushed link {place} or one further out: how hard, and where on it, a force at the link's frame cannot say."
        ),
        "external_push" => format!(
            "Something pushed link {place} with ({}, {}, {}).",
            with("force_x_n"),
            with("force_y_n"),
            with("force_z_n")
        ),
        "contact_wall" => format!(
            "The end of the arm runs into something stiff, {}.",
            with("stiffness_n_per_m")
        ),
        _ => curve(active, place, joints, |name| parameters.get(name)?.as_f64()),
    }
}

fn curve(
    active: &Active,
    place: &str,
    joints: &[String],
    value: impl Fn(&str) -> Option<f64>,
) -> String {
    let Some(curve) = &active.curve else {
        return format!("Something in joint {place} has no name.");
    };
    let of = if curve.of_joint == active.hypothesis.place.joint {
        "its own".to_owned()
    } else {
        format!("joint {}'s", joints[curve.of_joint])
    };
    let against = match curve.against {
        Against::Position => format!("{of} position"),
        Against::Velocity => format!("{of} velocity"),
        Against::Acceleration => format!("{of} acceleration"),
        Against::Load => "its load".to_owned(),
        Against::RecordingTime => "the time since the start of the recording".to_owned(),
        Against::SessionTime => "the time since the start of the session".to_owned(),
    };
    let direction = if curve.by_direction {
        ", and turns its sign with the direction of motion, as friction does"
    } else {
        ""
    };
    let repeated = curve.period.map_or_else(String::new, |period_s| {
        format!(
            ", and repeats every {} s ({} Hz)",
            number(period_s),
            number(1.0 / period_s)
        )
    });
    let peak = match (value("largest_nm"), value("largest_at")) {
        (Some(most), Some(at)) => {
            format!("; it is largest, {} N m, at {}", number(most), number(at))
        }
        _ => String::new(),
    };
    if active.is_friction_curve() {
        return format!(
            "The friction of joint {place} is more than a constant and a share of its velocity, and no effect of the library bends it so{peak} rad/s."
        );
    }
    format!(
        "Joint {place} has an effort that no effect of the library explains: it depends on {against}{direction}{repeated}{peak}."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_enough() {
        for (value, text) in [
            (4.1, "4.1"),
            (0.023_46, "0.0235"),
            (21.0, "21"),
            (1234.5, "1234"),
            (-0.5, "-0.5"),
            (0.0, "0"),
            (100.0, "100"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn odds_are_told_in_powers_of_ten_where_they_are_long() {
        assert_eq!(odds(0.0), "1");
        assert_eq!(odds(3.0), "20");
        assert_eq!(odds(100.0), "10^43");
    }
}
