//! Training of the detector, and choice of the twin behind which it runs.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context as _;
use tauscope_detect::{Config, tauscope};
use tauscope_dynamics::Model;
use tauscope_dynamics::terms::words::{counted, number};
use tauscope_evaluate::{Evaluation, Options, Output, Progress, Role};
use tauscope_twin::TwinFile;

use super::write;
use crate::exit::Failure;

/// Canonical name of the detector.
const DETECTOR: &str = "tauscope";
/// Name of the twin that a gain and an offset per joint correct.
const REGRESSION: &str = "regression";

/// A trained detector, with the twin behind which it runs.
#[derive(Debug)]
pub struct Learnt {
    /// The twin.
    pub twin: TwinFile,
    /// Whether this is the explained twin.
    pub is_explained: bool,
    /// Findings, a sentence each.
    pub sentences: Vec<String>,
}

/// Test of a detector behind a twin, on recordings on which neither was trained.
#[derive(Debug)]
struct Trial {
    /// The twin's path or name, as an evaluation takes it.
    twin: String,
    /// Number of alarms, all of them false.
    alarms: usize,
    /// Duration of these contact-free recordings \[s\].
    seen_s: f64,
    /// For each end of the chain, the outermost link with a known force, and the force that is detected in half of
    /// all directions \[N\].
    pushes: Vec<(String, f64)>,
}

/// Trains the detector on the set at `set`, behind the twin at `explained` or, with `has_line`, behind a regression:
/// whichever causes fewer false alarms on the validation recordings or, with equally many, detects the weaker push.
/// Writes the trained settings to `out`.
///
/// # Errors
/// If nothing can be learnt from these recordings.
pub fn learn(
    set: &Path,
    (explained, has_line): (Option<&Path>, bool),
    model: Option<&Model>,
    out: &Path,
    progress: &Progress<'_>,
) -> Result<Learnt, Failure> {
    const TRIED: f64 = 0.6;
    let explained = explained.map(|path| path.display().to_string());
    let twins: Vec<String> = explained
        .into_iter()
        .chain(has_line.then(|| REGRESSION.to_owned()))
        .collect();
    let tried = evaluate(set, &twins, true, &|share, what| {
        progress(TRIED * share, what);
    })?;
    let mut trials = trials(&tried, &twins, model);
    trials.sort_by(|a, b| {
        let force = |trial: &Trial| {
            let forces_n = trial.pushes.iter().map(|(_, force_n)| *force_n);
            forces_n.max_by(f64::total_cmp).unwrap_or(f64::INFINITY)
        };
        a.alarms.cmp(&b.alarms).then(force(a).total_cmp(&force(b)))
    });
    let best = trials.first().context("no detector has learnt")?;
    let rest = |share: f64, what: &str| progress(TRIED + (1.0 - TRIED) * share, what);
    let taught = evaluate(set, std::slice::from_ref(&best.twin), false, &rest)?;
    let run = taught.runs.first().context("no detector has learnt")?;
    let learnt: BTreeMap<&str, &Config> = BTreeMap::from([(DETECTOR, &run.first().config)]);
    let text = serde_saphyr::to_string(&learnt).context("what was learnt")?;
    write(out, text.as_bytes())?;
    let is_explained = best.twin != REGRESSION;
    let mut sentences = vec![format!("The detector uses {}.", best.words())];
    let tried = trials.iter().enumerate();
    sentences.extend(tried.map(|(place, trial)| trial.sentence(place == 0)));
    sentences.extend(taught.notes.iter().cloned());
    Ok(Learnt {
        twin: taught.twins[0].file.clone(),
        is_explained,
        sentences,
    })
}

/// Evaluates the detector on the set; with `unseen` the validation recordings are used for the test, not for
/// training.
fn evaluate(
    set: &Path,
    twins: &[String],
    unseen: bool,
    progress: &Progress<'_>,
) -> Result<Evaluation, Failure> {
    let options = Options {
        detectors: vec![DETECTOR.to_owned()],
        twins: twins.to_vec(),
        jobs: 1,
        ..Options::default()
    };
    let mut request = tauscope_evaluate::load(set, &options)?;
    if unseen {
        for recording in &mut request.recordings {
            if recording.role == Role::Validation {
                recording.role = Role::Test;
            }
        }
    }
    // This detector has no weight files, so it needs no folder.
    let result = tauscope_evaluate::run(request, Path::new(""), progress);
    result.map_err(|error| Failure::rejected(error.to_string()))
}

fn trials(evaluation: &Evaluation, twins: &[String], model: Option<&Model>) -> Vec<Trial> {
    let runs = evaluation.runs.iter();
    let trials = runs.map(|run| {
        let runner = run.first();
        let unseen = || {
            runner
                .outputs
                .iter()
                .filter(|output| output.role == Role::Test)
        };
        let settings = runner.config.settings::<tauscope::Settings>();
        let forces =
            settings.map(|settings| settings.smallest_forces(settings.false_alarms_per_hour));
        let forces =
            (forces.into_iter().flatten()).filter_map(|link| Some((link.link, link.half_n?)));
        Trial {
            twin: twins[run.twin].clone(),
            alarms: unseen().map(|output| output.events.len()).sum(),
            seen_s: unseen().map(Output::duration_s).sum(),
            pushes: at_ends(&forces.collect::<Vec<_>>(), model),
        }
    });
    trials.collect()
}

/// Returns the forces on the links that carry no other link of `forces`.
fn at_ends(forces: &[(String, f64)], model: Option<&Model>) -> Vec<(String, f64)> {
    let carries = |link: &str, other: &str| {
        let parent = |link: usize| model.and_then(|model| model.links()[link].parent);
        let index = |name: &str| model.and_then(|model| model.link_index(name));
        let carried = std::iter::successors(index(other), |&link| parent(link));
        carried.skip(1).any(|carrier| Some(carrier) == index(link))
    };
    let is_end = |(link, _): &&(String, f64)| !forces.iter().any(|(other, _)| carries(link, other));
    forces.iter().filter(is_end).cloned().collect()
}

impl Trial {
    /// Returns the name of its twin, in words.
    fn words(&self) -> &'static str {
        if self.twin == REGRESSION {
            "only a gain and an offset per joint"
        } else {
            "the explained twin"
        }
    }

    fn sentence(&self, is_best: bool) -> String {
        let with = if is_best {
            format!("With {}", self.words())
        } else {
            format!("For comparison, with {}", self.words())
        };
        let of_link = |(link, force_n): &(String, f64)| {
            format!("on link {link} is detected from {} N on", number(*force_n))
        };
        let pushes: Vec<String> = self.pushes.iter().map(of_link).collect();
        let force = if pushes.is_empty() {
            String::new()
        } else {
            format!(
                " While the arm moves as in these recordings, a push {} in half of all directions; at standstill weaker pushes \
                 are detected.",
                pushes.join(" and one ")
            )
        };
        format!(
            "{with}: {} in {:.0} s of recordings that neither twin nor detector had seen.{force}",
            counted(self.alarms, "false alarm"),
            self.seen_s
        )
    }
}
