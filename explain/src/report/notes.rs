//! Notes of the report in addition to the findings.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::read::audit::losses;
use crate::read::excerpt::Excerpts;
use crate::read::input::Input;
use crate::read::recording::Recording;
use crate::report::holdout::Proof;
use crate::report::schema::Remaining;
use crate::report::sentences::{UNCHANGED, unit_at};
use tauscope_dynamics::Model;
use tauscope_dynamics::terms::words::number;

/// Smallest residual with a note, in standard deviations of the white noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const LOUD: f64 = 5.0;

/// Smallest delay of the external twin with a note \[s\].
/// Resolution: half a sample at 500 Hz.
const LATE_S: f64 = 0.001;

/// Returns the note on the delay of an external twin.
pub fn late_twin(late_s: f64) -> Option<String> {
    (late_s > LATE_S).then(|| {
        let late_ms = number(1e3 * late_s);
        format!(
            "The effort of the twin's topic is {late_ms} ms late. Therefore it was compared with the effort that was measured {late_ms} ms \
             before its stamp. Detectors that use the topic directly see the delay."
        )
    })
}

/// Returns notes on the joints whose correction is withheld, or increases the error on the held-out recordings.
pub fn not_handed_out(proof: &Proof, found: &Fit, model: &Model, unit: &str) -> Vec<String> {
    let mut notes = Vec::new();
    for (joint, of_joint) in model.joints().iter().enumerate() {
        let (name, unit) = (&of_joint.name, unit_at(unit, of_joint));
        if proof.kept.contains(&joint) {
            notes.push(format!(
                "The correction of joint {name} does not predict fitted recordings that were left out. Therefore twin.yaml and the \
                 predictions keep the initial twin at this joint."
            ));
        }
        let (before, after) = (proof.before[joint], proof.after[joint]);
        if after * UNCHANGED > before {
            notes.push(format!(
                "The correction makes the error of joint {name} on the held-out recordings larger: {} {unit} after {} {unit}.",
                number(after),
                number(before)
            ));
        }
    }
    notes.extend(over_time(found, model));
    notes
}

/// Returns the note that the only recording was split.
pub fn is_parted() -> String {
    "There is one recording: its last quarter was held out. A second recording with another motion is the better test.".to_owned()
}

/// Returns the note that a long session was fitted in excerpts.
pub fn in_excerpts(excerpts: Excerpts) -> String {
    let Excerpts { whole_s, kept_s } = excerpts;
    format!(
        "The fitted recordings last {whole_s:.0} s together. Excerpts of {kept_s:.0} s were fitted, spread evenly over them. \
         Temporary effects between them were not searched for: explain fewer recordings to find these."
    )
}

/// Returns notes on the curves over time, which another run does not repeat.
fn over_time(found: &Fit, model: &Model) -> impl Iterator<Item = String> {
    let curves = (found.actives.iter()).filter(|active| active.is_curve_over_time());
    curves.map(|active| {
        format!(
            "The curve of joint {} over time is not in twin.yaml, because it cannot be extrapolated.",
            model.joints()[active.hypothesis.place.joint].name
        )
    })
}

/// Returns the notes on an input and on the fit `found`.
pub fn notes(
    input: &Input,
    problem: &Problem,
    found: &Fit,
    at_rest: bool,
    remaining: &[Remaining],
) -> Vec<String> {
    let mut notes = losses(input);
    notes.extend(remaining.iter().map(|remaining| remaining.sentence.clone()));
    let of_poses = input.fit.iter().any(Recording::is_of_poses);
    let names: Vec<&str> = input.model.joint_names().collect();
    for (j, name) in names.iter().enumerate() {
        let ratio = (found.variance[j].sqrt()) / problem.white_noise[j].max(1e-12);
        let is_told = remaining.iter().any(|remaining| remaining.joint == *name);
        if ratio > LOUD && !is_told && !of_poses {
            notes.push(format!(
                "The remaining error at joint {name} is {ratio:.0} times the measurement's white noise. No curve of the motion or of \
                 time predicts it from one recording to the next, so it is slow noise, or an effect of something that was not recorded."
            ));
        }
    }
    if of_poses {
        notes.push(
            "The samples are too far apart to determine a motion, so they were compared as held poses. Poses show gravity, \
             loads, springs, offsets and gains, but no friction, rotor, elasticity or delay: record motions for these."
                .to_owned(),
        );
    }
    if !at_rest && !of_poses {
        notes.push(
            "While a joint stands still, its friction can have any value up to the breakaway torque. Such rows were not used for \
             the fit; they are included in the error on the held-out recordings."
                .to_owned(),
        );
    }
    notes
}
