//! Merges two findings of one effect at a joint, such as torque ripple with two waves.

use serde_json::Value;
use tauscope_dynamics::terms::{Effect, effect};

use crate::report::schema::Finding;

/// The effect of a finding, if two of this effect at one place are merged.
fn said_as_one(finding: &Finding) -> Option<&'static Effect> {
    effect(&finding.effect).filter(|effect| !effect.traits.second.is_empty())
}

/// Merges two findings of one effect at one joint; the larger comes first.
pub fn merge_waves(findings: &mut Vec<Finding>) {
    let mut index = 0;
    while index < findings.len() {
        let known = said_as_one(&findings[index]);
        let twin = (index + 1..findings.len()).find(|&other| {
            known.is_some()
                && said_as_one(&findings[other]) == known
                && findings[index].joint == findings[other].joint
        });
        if let (Some(other), Some(effect)) = (twin, known) {
            let mut second = findings.remove(other);
            let size = |finding: &Finding| {
                let first = finding.parameters.get(effect.parameters[0].name);
                first.and_then(Value::as_f64).unwrap_or(0.0)
            };
            if size(&second) > size(&findings[index]) {
                std::mem::swap(&mut second, &mut findings[index]);
            }
            let first = &mut findings[index];
            for (parameter, renamed) in effect.parameters.iter().zip(effect.traits.second) {
                if let Some(value) = second.parameters.remove(parameter.name) {
                    first.parameters.insert((*renamed).to_owned(), value);
                }
                if let Some(interval) = second.intervals_95.remove(parameter.name) {
                    first.intervals_95.insert((*renamed).to_owned(), interval);
                }
            }
            first.effort_rms = first.effort_rms.hypot(second.effort_rms);
            first.explains = (first.explains + second.explains).min(1.0);
            first.sentence = format!("{} {}", first.sentence, second.sentence);
        }
        index += 1;
    }
}
