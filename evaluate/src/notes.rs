//! Notes on irregularities in the recordings of a set.

mod totals;

use std::collections::{BTreeMap, BTreeSet};

use tauscope_bus::flags;
use tauscope_dynamics::terms::words::counted;
use tauscope_pipeline::suggest;
use tauscope_session::Finding;

use self::totals::Totals;
use crate::error::EvaluateError;
use crate::input::Request;
use crate::metrics::events::{LAST_S, TOLERANCE_S};
use crate::recording::{Named, Role};
use crate::runner::Runner;
use crate::session::Played;

/// Largest number of recordings for which an irregularity is noted one by one.
/// Layout: by eye; no number depends on it.
const MOST_SINGLY: usize = 4;

/// Irregularities of all recordings behind one twin.
#[derive(Debug, Default)]
pub struct Notes {
    /// Number of samples and damaged parts that were lost or refused.
    pub lost: u64,
    /// Remarks for the reader.
    pub all: Vec<String>,
    /// Findings by recording.
    pub findings: Vec<(String, Vec<Finding>)>,
    /// Recordings in which the twin's filters had not settled for more than half of the samples.
    unsettled: BTreeSet<String>,
    /// Sums over all recordings.
    totals: Totals,
}

impl Notes {
    /// Records the irregularities of `recording`.
    ///
    /// # Errors
    /// If no sample of it holds efforts, so that no detector can judge it.
    pub fn add(&mut self, recording: &Named, played: &Played) -> Result<(), EvaluateError> {
        let (name, samples) = (&recording.name, &played.samples);
        let holds = |flag| samples.iter().any(|sample| sample.header.has(flag));
        if !holds(flags::EFFORT_MEASURED) {
            let recording = recording.path.display().to_string();
            return Err(EvaluateError::NoEffort { recording });
        }
        let damaged = played.damage.len() as u64;
        self.lost += played.refused + damaged;
        self.findings.push((name.clone(), played.findings.clone()));
        let mut note = |text: String| self.all.push(format!("{name}: {text}"));
        for damage in &played.damage {
            note(format!("{damage}; what can be read of it is evaluated"));
        }
        let count = samples.len();
        if 2 * played.unsettled > count as u64 {
            self.unsettled.insert(name.clone());
        }
        if played.unsettled == count as u64 {
            note(format!(
                "none of its {count} samples could be judged: the twin's filters never settled; its samples count as no contact"
            ));
        } else if 2 * played.unsettled > count as u64 {
            note(format!(
                "{} of its {count} samples were not judged: the twin's filters had not settled; these samples count as no contact",
                played.unsettled
            ));
        } else if played.gaps > 0 {
            note(format!(
                "{} in time; {} of {count} samples were not judged while the filters settled",
                counted(played.gaps as usize, "gap"),
                played.unsettled
            ));
        }
        let last_s = (samples.last()).map_or(0.0, |last| {
            (last.header.stamp_ns - recording.start_ns) as f64 / 1e9
        });
        for text in beyond(recording, last_s) {
            note(text);
        }
        self.totals.add(recording, samples);
        Ok(())
    }

    /// Adds the irregularities of all recordings taken together, after the last one was added.
    pub fn close(&mut self, request: &Request) {
        self.all.extend(self.totals.notes(request));
    }

    /// Notes test recordings in which detectors judged less than half of the samples, although the twin's filters had
    /// settled.
    pub fn unjudged(&self, runners: &[Runner]) -> Vec<String> {
        let mut by_recording: BTreeMap<&str, (usize, Vec<String>)> = BTreeMap::new();
        for runner in runners.iter().filter(|runner| runner.seed == 0) {
            for output in &runner.outputs {
                let count = output.t.len();
                if output.role == Role::Test
                    && !self.unsettled.contains(&output.recording)
                    && 2 * output.not_judged > count
                {
                    let of_it = by_recording.entry(&output.recording).or_default();
                    of_it.0 = count;
                    of_it
                        .1
                        .push(format!("{} {}", runner.entry.name, output.not_judged));
                }
            }
        }
        let names: Vec<&str> = by_recording.keys().copied().collect();
        if names.len() > MOST_SINGLY {
            return vec![format!(
                "of {} test recordings some detectors judged less than half of the samples, because their filters had not settled; the samples that were not judged count as no contact: {}",
                names.len(),
                suggest::some(&names)
            )];
        }
        let note = |(name, (count, who)): (&str, (usize, Vec<String>))| {
            format!(
                "{name}: of its {count} samples were not judged, because their filters had not settled: {}; these samples count as no contact",
                who.join(", ")
            )
        };
        by_recording.into_iter().map(note).collect()
    }
}

/// Notes labels that reach beyond the end of a recording.
fn beyond(recording: &Named, last_s: f64) -> Vec<String> {
    let Some(truth) = &recording.truth else {
        return Vec::new();
    };
    let mut notes = Vec::new();
    if let Some(duration) = truth
        .duration
        .filter(|labelled| *labelled > last_s + LAST_S)
    {
        notes.push(format!(
            "the labels give it a length of {duration} s, but its samples end at {last_s:.2} s: the samples count"
        ));
    }
    let reach = |t: f64| !(-TOLERANCE_S..=last_s + LAST_S).contains(&t);
    let events = || truth.events.iter();
    let reaching = events().filter(|event| reach(event.t_on) || reach(event.t_off));
    let outside = events().filter(|event| event.t_off < 0.0 || event.t_on > last_s);
    let beyond = |count| {
        let contacts = counted(count, "labelled contact");
        let reach = if count == 1 { "reaches" } else { "reach" };
        format!("{contacts} {reach} beyond the recording")
    };
    match (reaching.count(), outside.count()) {
        (0, _) => {}
        (count, 0) => notes.push(format!(
            "{}, which lasts {last_s:.2} s: counted as far as it goes",
            beyond(count)
        )),
        (count, outside) => notes.push(format!(
            "{}, which lasts {last_s:.2} s: counted as far as it goes, and as missed where outside ({outside} of them)",
            beyond(count)
        )),
    }
    notes
}

/// Notes detectors whose threshold no score can reach.
pub fn silent(runners: &[Runner]) -> Vec<String> {
    let note = |runner: &Runner| {
        let largest = runner.largest_score?;
        (runner.seed == 0 && runner.threshold >= largest).then(|| {
            format!(
                "{} can never raise an alarm: its threshold is {:.4}, and its score is always below {largest:.4}; give a lower one in the set, `detectors: {{threshold: {{sigmas: ...}}}}`",
                runner.entry.name, runner.threshold
            )
        })
    };
    runners.iter().filter_map(note).collect()
}

/// Notes recordings that are treated as contact-free because they have no labels.
pub fn unlabelled(request: &Request) -> Option<String> {
    let learnt_from =
        |recording: &&Named| recording.role != Role::Test && recording.truth.is_none();
    let mut names: Vec<&str> = (request.recordings.iter())
        .filter(learnt_from)
        .map(|recording| recording.name.as_str())
        .collect();
    names.sort_unstable();
    (!names.is_empty()).then(|| {
        let names = suggest::some(&names);
        format!("Recordings without labels are treated as free of contacts: {names}.")
    })
}
