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
                "What is left at joint {name} is {ratio:.0} times what the measurement's white noise leaves, and nothing explains it: \
                 slow noise, or something that is not in the library and does not depend on the joint's motion or on time alone."
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
            "Standstill is set-valued: at rest the friction of {} takes any value up to breakaway, whatever the load \
             and the drive leave to it, and no function of the motion tells which. It was left out of the fit and is \
             not named as an effect; on the hold-out it counts.",
            stuck.join(", ")
        ));
    }
    notes
}
