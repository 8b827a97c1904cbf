//! Findings of an explanation by inference.

use crate::context::Context;
use crate::fit::fitted::Fit;
use crate::fit::interval::parameter_deviations;
use crate::inference::{AS_LIKELY, Inferred};
use crate::report::schema::Finding;
use crate::report::sentences;
use crate::select::search::Search;

use super::scales::{Scales, StartScales};
use super::sizes::{effort_rms, mismatch};
use super::{Named, drop_no_force, numbers, place_of, rival, when};

/// Log-odds of a finding without a margin, and how they grow with the logarithm of one plus the margin. Chosen: with arms of
/// another hand in view; a calibration on seeds of its own is to replace it.
const CONFIDENCE: [f64; 2] = [-0.5, 0.6];

/// The findings of an inferred explanation.
pub fn of_inferred(
    search: &Search<'_>,
    inferred: &Inferred,
    before: &Fit,
    context: &Context<'_>,
    joints: &[String],
) -> Named {
    let (input, fit, unit_nm) = (context.input, &inferred.fit, context.unit_nm);
    let total = mismatch(before, fit, before);
    let share = |less: &Fit| (mismatch(less, fit, before) / total).clamp(0.0, 1.0);
    let scales = Scales::of(search.problem, fit, &inferred.covariance);
    let of_start = StartScales::of(input);
    let mut named = Named {
        notes: scales.notes(joints),
        gain_deviation: scales.deviations().collect(),
        ..Named::default()
    };
    for (index, active) in fit.actives.iter().enumerate() {
        if active.hypothesis.is_torque_scale() {
            continue;
        }
        let deviations = parameter_deviations(search.problem, fit, &inferred.covariance, index);
        let less = fit.without(search.problem, index);
        let untold = vec![false; deviations.len()];
        let known = (&deviations[..], &untold[..]);
        let (mut parameters, mut intervals) = numbers(search.problem, fit, active, known, joints);
        let (joint, link) = place_of(input, joints, &active.hypothesis);
        let place = link.clone().or_else(|| joint.clone()).unwrap_or_default();
        let when = when(search, active, &mut parameters, &mut intervals);
        drop_no_force(&mut parameters, &mut intervals);
        let in_amperes = scales.to_nm(active.hypothesis, &mut parameters, &mut intervals);
        of_start.widen(active.hypothesis, &parameters, &mut intervals);
        let of = (place.as_str(), when.recording.as_deref());
        let mut sentence = sentences::sentence(active, of, &parameters, &intervals, joints);
        let slides = active.hypothesis.slides(&input.model);
        sentence = sentences::in_units(&sentence, in_amperes, slides);
        let margin = inferred.margins[index];
        let alike = inferred.alternatives[index]
            .iter()
            .filter(|other| other.behind < AS_LIKELY);
        named.findings.push(Finding {
            effect: active.hypothesis.said().to_owned(),
            joint,
            link,
            parameters,
            intervals_95: intervals,
            in_amperes,
            slides,
            confidence: confidence_of(margin),
            recording: when.recording,
            t_start: when.start,
            t_end: when.end,
            explains: share(&less),
            over_rest: 0.0,
            evidence_nats: margin,
            effort_rms: effort_rms(&less, fit, unit_nm),
            equivalent_to: alike
                .map(|other| rival(input, joints, &other.hypothesis))
                .collect(),
            sentence,
        });
    }
    named
        .findings
        .sort_by(|a, b| b.explains.total_cmp(&a.explains));
    named
}

/// Confidence of a finding by its margin \[nats\]: what the explanation loses without it.
fn confidence_of(margin: f64) -> f64 {
    let [base, slope] = CONFIDENCE;
    let log_odds = base + slope * margin.max(0.0).ln_1p();
    1.0 / (1.0 + (-log_odds).exp())
}
