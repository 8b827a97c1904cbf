//! Tests that the description of every effect is complete and consistent.

use std::collections::BTreeSet;

use super::super::tests::{TwoJoints, motion, run};
use super::super::words::{places, unit};
use super::super::{EFFECTS, Effect, PlaceKind, Traits};
use super::*;

#[test]
fn every_effect_has_words_of_its_own_about_what_it_has() {
    let mut names = BTreeSet::new();
    for effect in EFFECTS {
        let words = &effect.words;
        for name in [words.title, words.noun] {
            assert!(!name.is_empty(), "{}", effect.name);
        }
        assert!(names.insert(words.title), "two are a `{}`", words.title);
        let look_at = Some(words.look_at).filter(|text| !text.is_empty());
        if let Some(sentence) = look_at {
            let ends = sentence.ends_with(['.', '?']);
            let places = places(sentence).all(|(place, _)| matches!(place, "place" | "source"));
            assert!(ends && places, "{}: {sentence}", effect.name);
        }
        let sentences = [Some(words.meaning), Some(words.finding), words.less]
            .into_iter()
            .chain([words.without_numbers]);
        for sentence in sentences.flatten() {
            assert!(sentence.ends_with('.'), "{}: {sentence}", effect.name);
            for (place, _) in places(sentence) {
                let known = match place {
                    "place" | "less" => true,
                    "source" => effect.place == PlaceKind::TwoJoints,
                    "recording" => effect.traits.fills_recording,
                    name => effect.parameters.iter().any(|p| p.name == name),
                };
                assert!(known, "{}: `{place}` in `{sentence}`", effect.name);
            }
        }
        let of_parameters = places(words.finding)
            .filter(|(place, _)| effect.parameters.iter().any(|p| p.name == *place));
        let told = of_parameters.count();
        assert!(told > 0 || effect.parameters.is_empty(), "{}", effect.name);
    }
}

#[test]
fn every_parameter_has_the_unit_of_its_name() {
    let parameters = EFFECTS.iter().flat_map(|effect| effect.parameters);
    for parameter in parameters {
        let of_name = unit(parameter.name).map_or("", |(_, unit)| unit);
        assert_eq!(parameter.unit, of_name, "{}", parameter.name);
    }
}

/// Coordinates with all shapes at an end of their range, the parameters `numbers` at 1, and all others at 0.
fn at_end(effect: &Effect, numbers: &[&str], upper_end: bool) -> Vec<f64> {
    let shape = |c: &Coordinate| match c.kind {
        CoordinateKind::Shape { lower, upper, .. } => {
            if upper_end {
                upper
            } else {
                lower
            }
        }
        _ => 0.0,
    };
    let coordinates: Vec<f64> = effect.coordinates.iter().map(shape).collect();
    let mut parameters = (effect.to_parameters)(&coordinates);
    for (value, parameter) in parameters.iter_mut().zip(effect.parameters) {
        if numbers.contains(&parameter.name) {
            *value = 1.0;
        }
    }
    let mut wanted = (effect.to_coordinates)(&parameters);
    for ((wanted, given), c) in wanted.iter_mut().zip(&coordinates).zip(effect.coordinates) {
        if matches!(c.kind, CoordinateKind::Shape { .. }) {
            *wanted = *given;
        }
    }
    wanted
}

#[test]
fn an_effect_contains_the_simpler_one_that_it_says() {
    let robot = TwoJoints::new();
    let motion = motion(&robot.model, 200);
    for effect in EFFECTS {
        let Some(simpler) = effect.simpler else {
            continue;
        };
        assert_eq!(simpler.effect.parameters.len(), 1, "{}", effect.name);
        assert!(simpler.effect.simpler.is_none(), "{}", effect.name);
        let site = robot.site_for(effect.place);
        let simple = run(&mut *(simpler.effect.build)(&site, &[1.0]), &motion);
        let scale = simple.iter().map(|e| e[0] * e[0]).sum::<f64>();
        let off = |upper: bool| {
            let coordinates = at_end(effect, simpler.numbers, upper);
            let whole = run(&mut *(effect.build)(&site, &coordinates), &motion);
            let pairs = whole.iter().zip(&simple);
            pairs.map(|(a, b)| (a[0] - b[0]).powi(2)).sum::<f64>()
        };
        let least = off(false).min(off(true));
        assert!(least < 0.05 * scale, "{}: {least} of {scale}", effect.name);
    }
}

#[test]
fn what_few_effects_have_fits_them() {
    for effect in EFFECTS {
        let Traits {
            second,
            smallest_told_as,
            only_adds,
            ..
        } = effect.traits;
        assert!(
            second.is_empty() || second.len() == effect.parameters.len(),
            "{}",
            effect.name
        );
        assert!(second.is_empty() || effect.traits.most_at_one_place == 2);
        let first = effect.coordinates.first().map(|c| c.kind);
        let is_factor = matches!(first, Some(CoordinateKind::Factor { .. }));
        assert!(smallest_told_as.is_none() || is_factor, "{}", effect.name);
        assert!(!only_adds || effect.layer == Layer::Record);
        assert!(!effect.traits.describes_only || effect.concealed.is_none());
    }
    // Every named effect can be concealed, unless it depends on the URDF or on the recordings.
    let plain = EFFECTS
        .iter()
        .filter(|e| e.concealed.is_none() && !e.traits.describes_only);
    assert_eq!(
        plain.map(|e| e.name).collect::<Vec<_>>(),
        [
            "viscous_step",
            "bias_step",
            "absent_tool",
            "base_tilt_in_recording",
            "joint_zero_offset_in_recording",
            "joint_zero_slip",
            "gain_step",
            "late_position",
            "payload_in_recording",
            "payload_in_session"
        ]
    );
}

#[test]
fn effects_last_or_come_and_go() {
    let all = |lasts: bool| {
        let names = EFFECTS.iter().filter(|e| e.lasts() == lasts);
        names.map(|e| e.name).collect::<Vec<_>>()
    };
    assert_eq!(
        all(false),
        [
            "base_tilt_in_recording",
            "joint_zero_offset_in_recording",
            "external_push",
            "contact_wall",
            "payload_pickup",
            "payload_in_recording",
            "payload_in_session"
        ]
    );
    let surfaces = EFFECTS.iter().filter(|e| e.is_surface());
    assert_eq!(
        surfaces.map(|e| e.name).collect::<Vec<_>>(),
        ["contact_wall"]
    );
}
