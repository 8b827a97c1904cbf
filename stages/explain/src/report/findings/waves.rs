//! Ripple of two waves is one finding.

use serde_json::Value;

use crate::report::schema::Finding;

/// Two waves of ripple at one joint are told as one finding, the larger first.
pub fn merge_waves(findings: &mut Vec<Finding>) {
    const WAVE: [&str; 3] = ["amplitude_nm", "cycles_per_rev", "phase_rad"];
    let amplitude = |f: &Finding| {
        f.parameters
            .get(WAVE[0])
            .and_then(Value::as_f64)
            .unwrap_or(0.0)
    };
    let mut index = 0;
    while index < findings.len() {
        let twin = (index + 1..findings.len()).find(|&other| {
            findings[index].effect == "torque_ripple"
                && findings[other].effect == "torque_ripple"
                && findings[index].joint == findings[other].joint
        });
        if let Some(other) = twin {
            let mut second = findings.remove(other);
            if amplitude(&second) > amplitude(&findings[index]) {
                std::mem::swap(&mut second, &mut findings[index]);
            }
            let first = &mut findings[index];
            for name in WAVE {
                let (stem, unit) = name.split_once('_').unwrap_or((name, ""));
                let renamed = match name {
                    "cycles_per_rev" => "cycles_per_rev2".to_owned(),
                    _ => format!("{stem}2_{unit}"),
                };
                if let Some(value) = second.parameters.remove(name) {
                    first.parameters.insert(renamed.clone(), value);
                }
                if let Some(interval) = second.intervals_95.remove(name) {
                    first.intervals_95.insert(renamed, interval);
                }
            }
            first.explains = (first.explains + second.explains).min(1.0);
            first.sentence = format!("{} {}", first.sentence, second.sentence);
        }
        index += 1;
    }
}
