//! What was odd in the recordings of a set.

use tauscope_bus::flags;

use super::EvaluateError;
use super::input::{Named, Request, Role};
use super::session::Played;

/// What was odd, over all recordings behind one twin.
#[derive(Debug, Default)]
pub struct Heard {
    /// Samples and stretches that were lost or refused.
    pub lost: u64,
    /// What the reader should know.
    pub notes: Vec<String>,
}

impl Heard {
    /// Takes down what was odd in `recording`.
    ///
    /// # Errors
    /// If no sample of it holds efforts: there is nothing that any detector could judge.
    pub fn add(&mut self, recording: &Named, played: &Played) -> Result<(), EvaluateError> {
        let (name, samples) = (&recording.name, &played.samples);
        let holds = |flag| samples.iter().any(|sample| sample.header.has(flag));
        if !holds(flags::EFFORT_MEASURED) {
            let recording = recording.path.display().to_string();
            return Err(EvaluateError::NoEffort { recording });
        }
        let damaged = played.damage.len() as u64;
        self.lost += played.refused + damaged;
        let mut note = |text: String| self.notes.push(format!("{name}: {text}"));
        for damage in &played.damage {
            note(format!("{damage}; what can be read of it is evaluated"));
        }
        if played.refused > 0 {
            note(format!("{} samples were lost or refused", played.refused));
        }
        let count = samples.len();
        if played.unsettled == count as u64 {
            note(format!(
                "none of its {count} samples could be judged: the twin's filters never settled; what stands for it is silence"
            ));
        } else if played.gaps > 0 {
            note(format!(
                "{} gap(s) in time; {} of {count} samples passed over while the filters settled",
                played.gaps, played.unsettled
            ));
        }
        Ok(())
    }
}

/// Says which recordings are learnt from as free of contacts because nobody has said what touched the robot
/// in them.
pub fn unlabelled(request: &Request) -> Option<String> {
    let learnt_from =
        |recording: &&Named| recording.role != Role::Test && recording.truth.is_none();
    let names: Vec<&str> = (request.recordings.iter())
        .filter(learnt_from)
        .map(|recording| recording.name.as_str())
        .collect();
    (!names.is_empty()).then(|| {
        let names = names.join(", ");
        format!("without labels, and taken to be free of contacts: {names}")
    })
}
