//! Formatting of numbers, units and sentences.

use std::collections::BTreeMap;

use serde_json::Value;
use tauscope_dynamics::Joint;
use tauscope_dynamics::terms::words::{self, Told, number};
use tauscope_dynamics::terms::{Effect, PlaceKind, Words};

use crate::physics::active::Active;
use crate::physics::parameter_units::unit;

/// Returns the likelihood ratio of a lead in nats as text, e.g. `40`, `10^17`.
pub fn odds(nats: f64) -> String {
    /// Ratio above which powers of ten are easier to read.
    /// Layout: by eye; no number depends on it.
    const MANY: f64 = 1000.0;
    let odds = nats.max(0.0).exp();
    if odds < MANY {
        return format!("{odds:.0}");
    }
    format!("10^{:.0}", nats / std::f64::consts::LN_10)
}

/// Ratio of the errors after and before a correction above which the error is reported as unchanged.
/// Chosen: 2 % of the error is of no use to a reader; only sentences depend on it.
pub const UNCHANGED: f64 = 0.98;

/// Returns the remaining share of the error on held-out recordings: RMS over all joints, after over before. NaN where
/// one of them is unknown.
pub fn error_left(before: &[f64], after: &[f64]) -> f64 {
    let norm = |all: &[f64]| all.iter().map(|x| x * x).sum::<f64>().sqrt();
    norm(after) / norm(before)
}

/// Replaces the units of a sentence, or a unit, whose numbers are in A and not in N m, or belong to a prismatic
/// joint.
pub fn in_units(sentence: &str, amperes: bool, slides: bool) -> String {
    let mut text = sentence.to_owned();
    if amperes {
        text = text.replace("N m", "A").replace("kg m²", "A s²/rad");
    }
    if slides { of_a_slide(&text) } else { text }
}

/// Replaces the units of a rotary joint (N m, rad) by those of a prismatic one (N, m).
fn of_a_slide(sentence: &str) -> String {
    let forces = sentence.replace("N m", "N").replace("kg m²", "kg");
    let forces = forces.replace("(N)", "N");
    // Replaces no part of a word.
    let mut text = String::with_capacity(forces.len());
    let mut rest = forces.as_str();
    while let Some(at) = rest.find("rad") {
        let (before, after) = (&rest[..at], &rest[at + "rad".len()..]);
        let is_letter = |c: Option<char>| c.is_some_and(char::is_alphabetic);
        let is_word = is_letter(before.chars().last()) || is_letter(after.chars().next());
        text += before;
        text += if is_word { "rad" } else { "m" };
        rest = after;
    }
    text + rest
}

/// Returns the unit of a joint's effort, given that of rotary joints.
pub fn unit_at<'u>(unit: &'u str, joint: &Joint) -> &'u str {
    if unit == "N m" && joint.slides() {
        "N"
    } else {
        unit
    }
}

/// Upper bound of the interval of a share below which it is reported as zero.
/// Physical: the response of a torque sensor to a joint that it does not measure.
const MOST_OF_NOTHING: f64 = 0.05;

/// Returns a finding as a sentence. `place` is the name of the joint or link, `recording` the name of the recording
/// of its times.
pub fn sentence(
    active: &Active,
    (place, recording): (&str, Option<&str>),
    parameters: &BTreeMap<String, Value>,
    intervals: &BTreeMap<String, [f64; 2]>,
    joints: &[String],
) -> String {
    let effect = active.hypothesis.effect;
    let value = |name: &str| parameters.get(name).and_then(Value::as_f64);
    if let Some(curve) = &active.curve {
        let peak = value("largest_nm").zip(value("largest_at"));
        return curve.sentence(active.hypothesis.place.joint, place, joints, peak);
    }
    let first = effect.parameters.first().map_or("", |p| p.name);
    let less = value(first).filter(|value| *value < 0.0);
    let is_missing = |(name, _): &(&str, Told)| {
        let is_parameter = effect.parameters.iter().any(|p| p.name == *name);
        is_parameter && !parameters.contains_key(*name)
    };
    let has_missing = words::places(effect.words.finding).any(|place| is_missing(&place));
    let is_nothing = intervals
        .get(first)
        .is_some_and(|[low, high]| *low <= 0.0 && *high < MOST_OF_NOTHING);
    let Words {
        less: of_less,
        nothing,
        without_numbers,
        ..
    } = effect.words;
    let template = match (of_less, nothing, without_numbers) {
        (Some(template), ..) if less.is_some() => template,
        (_, Some(template), _) if is_nothing => template,
        (.., Some(template)) if has_missing => template,
        _ if has_missing => return undetermined(effect, place, parameters, intervals),
        _ => effect.words.finding,
    };
    words::fill(template, |name, told| match name {
        "place" => place.to_owned(),
        "recording" => recording.unwrap_or_default().to_owned(),
        "source" => joints[active.hypothesis.place.source].clone(),
        "less" => {
            let interval = intervals.get(first).map(|[low, high]| [-high, -low]);
            with_interval(-less.unwrap_or(f64::NAN), unit(first), interval.as_ref())
        }
        name => {
            let unit = if told == Told::Whole { unit(name) } else { "" };
            let interval = intervals.get(name).filter(|_| told != Told::Number);
            with_interval(value(name).unwrap_or(f64::NAN), unit, interval)
        }
    })
}

/// Returns the sentence of a finding of which the recordings determine only some parameters or none.
fn undetermined(
    effect: &Effect,
    place: &str,
    parameters: &BTreeMap<String, Value>,
    intervals: &BTreeMap<String, [f64; 2]>,
) -> String {
    let (mut known, mut missing) = (Vec::new(), Vec::new());
    for (name, _) in words::places(effect.words.finding) {
        if let Some(value) = parameters.get(name).and_then(Value::as_f64) {
            let value = with_interval(value, unit(name), intervals.get(name));
            known.push(format!("{} {value}", words::quantity(name)));
        } else if effect.parameters.iter().any(|p| p.name == name) {
            missing.push(words::quantity(name));
        }
    }
    let noun = effect.words.noun;
    let at = at(effect.place, place);
    let known = if known.is_empty() {
        String::new()
    } else {
        format!(" ({})", known.join(", "))
    };
    let missing = missing.join(" and ");
    format!("The recordings show {noun}{at}{known}; they do not determine its {missing}.")
}

/// Returns the place, such as ` at joint elbow`; empty for an effect that has only one place.
fn at(kind: PlaceKind, place: &str) -> String {
    match kind {
        PlaceKind::Joint | PlaceKind::TwoJoints => format!(" at joint {place}"),
        PlaceKind::Link => format!(" at link {place}"),
        PlaceKind::Tool | PlaceKind::Base | PlaceKind::All => String::new(),
    }
}

/// Returns a value with its interval, such as `4.1 N m (3.9 to 4.3)`.
fn with_interval(value: f64, unit: &str, interval: Option<&[f64; 2]>) -> String {
    let mut text = number(value);
    if !unit.is_empty() {
        text += &format!(" {unit}");
    }
    if let Some([low, high]) = interval.map(|ends| ends.map(number)) {
        // A time may be known more precisely than its text.
        if low != high {
            text += &format!(" ({low} to {high})");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::physics::active::{Hypothesis, Whereabouts};

    #[test]
    fn what_slides_is_told_in_newtons_and_metres() {
        for (turning, sliding) in [
            (
                "viscous friction of 3.1 N m s/rad (3 to 3.2)",
                "viscous friction of 3.1 N s/m (3 to 3.2)",
            ),
            ("2 1/(N m) at 0.2 rad, 3 rad/s", "2 1/N at 0.2 m, 3 m/s"),
            (
                "a rotor of 0.4 kg m², gradually, radial",
                "a rotor of 0.4 kg, gradually, radial",
            ),
            ("7 A s²/rad", "7 A s²/m"),
        ] {
            assert_eq!(of_a_slide(turning), sliding);
        }
    }

    #[test]
    fn a_number_that_the_recordings_do_not_determine_makes_another_sentence() {
        let of = |name: &str, numbers: &[(&str, f64)]| {
            let effect = effect(name).unwrap();
            let place = Whereabouts::default();
            let active = Hypothesis { effect, place }.with(vec![0.0; effect.coordinates.len()]);
            let numbers = numbers.iter();
            let parameters = numbers.map(|(name, value)| ((*name).to_owned(), (*value).into()));
            let intervals = BTreeMap::from([("delta_com_x_m".to_owned(), [0.01, 0.03])]);
            let parameters = parameters.collect();
            sentence(&active, ("fore", None), &parameters, &intervals, &[])
        };
        for (name, numbers, said) in [
            (
                "payload",
                &[("mass_kg", 0.59)][..],
                "The arm carries an undeclared payload of 0.59 kg.",
            ),
            (
                "payload",
                &[],
                "The recordings show a payload; they do not determine its mass.",
            ),
            (
                "link_com",
                &[("delta_com_x_m", 0.02)],
                "The recordings show another centre of mass at link fore (centre of mass x 0.02 m (0.01 to 0.03)); they do not determine its centre of mass y and centre of mass z.",
            ),
        ] {
            assert_eq!(of(name, numbers), said);
        }
        let body = of("link_inertia", &[]);
        assert!(
            body.ends_with("The recordings do not determine all of its numbers."),
            "{body}"
        );
    }

    #[test]
    fn odds_are_told_in_powers_of_ten_where_they_are_long() {
        assert_eq!(odds(0.0), "1");
        assert_eq!(odds(3.0), "20");
        assert_eq!(odds(100.0), "10^43");
    }
}
