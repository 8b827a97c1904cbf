//! Notes of the report beside the findings.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::read::audit::losses;
use crate::read::input::Input;

/// A residual above this many times the white noise gets a note.
/// Tuned: by hand, on no recorded seeds; not swept.
const LOUD: f64 = 5.0;

/// The notes on an input and on the fit `found`.
pub fn notes(input: &Input, problem: &Problem, found: &Fit, rests_count: &[bool]) -> Vec<String> {
    let mut notes = losses(input);
    let names: Vec<&str> = input.model.joint_names().collect();
    for (j, name) in names.iter().enumerate() {
        let ratio = (found.variance[j].sqrt()) / problem.white_noise[j].max(1e-12);
        if ratio > LOUD {
            notes.push(format!(
                "The remaining error at joint {name} is {ratio:.0} times the measurement's white noise, and no effect explains it. It is \
                 slow noise, or an effect that is not in the library and does not depend on the joint's motion or on time alone."
            ));
        }
    }
    let stuck: Vec<&str> = names
        .iter()
        .zip(rests_count)
        .filter(|(_, counts)| !**counts)
        .map(|(name, _)| *name)
        .collect();
    if !stuck.is_empty() {
        notes.push(format!(
            "At rest, the friction of {} takes any value up to the breakaway torque, and the motion does not determine \
             which. So standstills of these joints were left out of the fit, and no effect is named for them. The error \
             on the held-out recordings includes them.",
            stuck.join(", ")
        ));
    }
    notes
}
