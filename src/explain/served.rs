//! Selection of the terms of a correction that hold in a pipeline. `explain` computes motions with non-causal
//! filters, which a pipeline cannot use; a term that depends on them makes the residual of a running twin larger.

use std::path::PathBuf;

use tauscope_dynamics::terms::{self, Layer, TermSpec};
use tauscope_pipeline::calibrate::{CalibrateError, Job};
use tauscope_twin::TwinFile;

/// Ratio of the residual without a term to that with it, below which the term is left out.
/// Resolution: a smaller change of an RMS does not matter for a threshold.
const SMALLER: f64 = 0.98;

/// Removes terms from `file` that make the residual of a pipeline's twin larger on these recordings, at their joint.
/// Candidates are all terms of a joint that is worse than with the previous twin, `before`, and terms that model a
/// sensor. Returns a sentence for each removed term, and for each joint that stays worse.
///
/// # Errors
/// If a recording cannot be read, or the twin does not fit the cell.
pub fn keep_what_serves(
    job: &Job<'_>,
    file: &mut TwinFile,
    before: &TwinFile,
    recordings: &[PathBuf],
) -> Result<Vec<String>, CalibrateError> {
    let names = &job.cell.facts.joint_names;
    let was = job.residual_rms(before, recordings)?;
    let mut is = job.residual_rms(file, recordings)?;
    let mut notes = Vec::new();
    for (j, name) in names.iter().enumerate() {
        let worse = |is: &[f64]| is[j] * SMALLER > was[j];
        let doubtful = |spec: &TermSpec, is: &[f64]| {
            spec.joint.as_ref() == Some(name) && (worse(is) || of_a_sensor(spec))
        };
        while let Some((place, without)) = file
            .terms
            .iter()
            .enumerate()
            .filter(|(_, spec)| doubtful(spec, &is))
            .map(|(place, _)| Ok((place, job.residual_rms(&less(file, place), recordings)?)))
            .collect::<Result<Vec<_>, CalibrateError>>()?
            .into_iter()
            .filter(|(_, without)| without[j] < SMALLER * is[j])
            .min_by(|(_, a), (_, b)| a[j].total_cmp(&b[j]))
        {
            let left_out = file.terms.remove(place);
            notes.push(format!(
                "`{}` of {name} is not in the twin for pipelines: the residual there would be {:.3}, and is {:.3} without \
                 it. A pipeline knows no future, which this effect needs.",
                left_out.effect, is[j], without[j]
            ));
            is = without;
        }
        if worse(&is) {
            notes.push(format!(
                "In a pipeline the residual of {name} is larger behind this twin ({:.3}) than behind the one before \
                 ({:.3}).",
                is[j], was[j]
            ));
        }
    }
    Ok(notes)
}

fn less(file: &TwinFile, place: usize) -> TwinFile {
    let mut less = file.clone();
    less.terms.remove(place);
    less
}

/// Whether a term models a sensor of the effort, such as its delay.
fn of_a_sensor(spec: &TermSpec) -> bool {
    terms::effect(&spec.effect).is_some_and(|effect| effect.layer == Layer::Record)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use std::collections::BTreeMap;
    use std::path::Path;

    use tauscope_ingest::Topics;
    use tauscope_pipeline::cell::{Cell, ConstantSpot, EffortUnit};
    use tauscope_pipeline::report::Problem;

    use super::*;

    #[test]
    fn a_term_that_spoils_the_residual_of_a_pipeline_is_left_out_and_no_other() {
        let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
        let problem = |_: ConstantSpot<'_>, title| Problem::new(title);
        let urdf = bundled.join("demo_arm.urdf");
        let cell = Cell::from_urdf(&urdf, EffortUnit::Nm, &BTreeMap::new(), &problem).unwrap();
        let topics = Topics {
            state: "/joint_states".to_owned(),
            command: None,
            twin: None,
            tool: None,
            learn: None,
            commands: None,
        };
        let twin = tauscope_twin::Config::default();
        let job = Job {
            cell: &cell,
            topics: &topics,
            twin: &twin,
            fit: &[],
            validation: &[],
        };
        let text = std::fs::read_to_string(bundled.join("demo.explained.yaml")).unwrap();
        let right: TwinFile = serde_saphyr::from_str(&text).unwrap();
        let mut before = right.clone();
        before.terms.clear();
        let mut file = right.clone();
        file.terms.push(TermSpec {
            effect: "torque_delay".to_owned(),
            joint: Some("joint2".to_owned()),
            parameters: BTreeMap::from([("delay_s".to_owned(), 0.2)]),
            ..TermSpec::default()
        });
        let recordings = [bundled.join("demo_train_sweep.mcap")];
        let notes = keep_what_serves(&job, &mut file, &before, &recordings).unwrap();
        assert_eq!(file.terms, right.terms);
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].starts_with("`torque_delay` of joint2 is not"));
    }
}
