//! The detector: behind which twin, and what it has learnt.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context as _;
use tauscope_detect::{Config, tauscope};
use tauscope_dynamics::terms::words::{counted, number};
use tauscope_evaluate::{Evaluation, Options, Output, Progress, Role};
use tauscope_twin::TwinFile;

use super::write;
use crate::exit::Failure;

/// Canonical name of the detector.
const DETECTOR: &str = "tauscope";
/// The twin that a line per joint corrects.
const REGRESSION: &str = "regression";

/// A detector that has learnt, behind the twin that suits it.
#[derive(Debug)]
pub struct Learnt {
    /// The twin.
    pub twin: TwinFile,
    /// Whether it is the explained one.
    pub is_explained: bool,
    /// What was found, a sentence each.
    pub sentences: Vec<String>,
}

/// How a detector did behind a twin on recordings that neither had seen.
#[derive(Debug)]
struct Trial {
    /// The twin's path or name, as an evaluation takes it.
    twin: String,
    /// Alarms, each of them false.
    alarms: usize,
    /// Of the recordings without contacts \[s\].
    seen_s: f64,
    /// The outermost link that a push is told on, and the force that is found in half of all directions \[N\].
    push: Option<(String, f64)>,
}

/// Lets the detector learn from the set at `set`, behind the twin at `explained` or behind a regression, whichever
/// gives fewer false alarms on the validation recordings or, with as many, finds the weaker push. Writes what it
/// has learnt to `out`.
///
/// # Errors
/// If nothing can be learnt from these recordings.
pub fn learn(
    set: &Path,
    explained: Option<&Path>,
    out: &Path,
    progress: &Progress<'_>,
) -> Result<Learnt, Failure> {
    const TRIED: f64 = 0.6;
    let explained = explained.map(|path| path.display().to_string());
    let twins: Vec<String> = explained
        .into_iter()
        .chain([REGRESSION.to_owned()])
        .collect();
    let tried = evaluate(set, &twins, true, &|share, what| {
        progress(TRIED * share, what);
    })?;
    let mut trials = trials(&tried, &twins);
    trials.sort_by(|a, b| {
        let force =
            |trial: &Trial| (trial.push.as_ref()).map_or(f64::INFINITY, |(_, force_n)| *force_n);
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
    sentences.extend(trials.iter().map(Trial::sentence));
    sentences.extend(taught.notes.iter().cloned());
    Ok(Learnt {
        twin: taught.twins[0].file.clone(),
        is_explained,
        sentences,
    })
}

/// Evaluates the detector on the set; with `unseen` the validation recordings are kept from it and judged.
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
    // This detector has no weights that would go to a folder.
    let result = tauscope_evaluate::run(request, Path::new(""), progress);
    result.map_err(|error| Failure::rejected(error.to_string()))
}

fn trials(evaluation: &Evaluation, twins: &[String]) -> Vec<Trial> {
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
        // From the base on: the last is the one that is touched most.
        let mut outermost =
            (forces.into_iter().flatten()).filter_map(|link| Some((link.link, link.half_n?)));
        Trial {
            twin: twins[run.twin].clone(),
            alarms: unseen().map(|output| output.events.len()).sum(),
            seen_s: unseen().map(Output::duration_s).sum(),
            push: outermost.next_back(),
        }
    });
    trials.collect()
}

impl Trial {
    /// Its twin.
    fn words(&self) -> &'static str {
        if self.twin == REGRESSION {
            "a gain and an offset per joint"
        } else {
            "the explained twin"
        }
    }

    fn sentence(&self) -> String {
        let twin = self.words();
        let force = self.push.as_ref().map_or_else(String::new, |(link, force_n)| {
            format!(
                " While the arm moves as it does there, a push on {link} is found from {} N in half of all \
                 directions; while the arm stands, weaker ones are found.",
                number(*force_n)
            )
        });
        format!(
            "With {twin}: {} in {:.0} s of recordings that neither twin nor detector had seen.{force}",
            counted(self.alarms, "false alarm"),
            self.seen_s
        )
    }
}
