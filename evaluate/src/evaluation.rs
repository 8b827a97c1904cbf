//! Sequence of an evaluation: prepare the twins, train the detectors, judge the recordings.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use tauscope_bus::StageError;
use tauscope_detect::{Entry, Lesson, Lessons};
use tauscope_pipeline::parallel;
use tauscope_session::by_recording;

use crate::error::EvaluateError;
use crate::input::Request;
use crate::notes::{self, Notes};
use crate::recording::{Named, Role};
use crate::registry::{SEEDS, Task};
use crate::runner::Runner;
use crate::session::{Played, Session};
use crate::twin::Prepared;
use crate::{bad_readings, session};

/// A detector behind a twin, with each of its seeds.
pub struct Run {
    /// Index of the twin in [`Evaluation::twins`].
    pub twin: usize,
    /// The trained detectors, one per seed; a single one if training is deterministic.
    pub seeds: Vec<Runner>,
}

/// Result of an evaluation.
pub struct Evaluation {
    /// The request.
    pub request: Request,
    /// The twins.
    pub twins: Vec<Prepared>,
    /// Trained detectors, ordered by twin and detector.
    pub runs: Vec<Run>,
    /// Number of samples that were lost or refused.
    pub lost: u64,
    /// Findings about the recordings, a sentence each.
    pub findings: Vec<String>,
    /// Remarks for the reader of the results.
    pub notes: Vec<String>,
}

impl Evaluation {
    /// Findings and notes.
    pub fn all_notes(&self) -> Vec<String> {
        self.findings.iter().chain(&self.notes).cloned().collect()
    }
}

/// Progress callback: completed fraction, 0 to 1, and current activity.
pub type Progress<'a> = dyn Fn(f64, &str) + Sync + 'a;

/// Runs the evaluation. Trained weights are written to `out`.
///
/// # Errors
/// If a recording cannot be read or a detector that was named cannot learn. A detector that was not named and cannot
/// learn from this set is left out and noted instead.
pub fn run(
    request: Request,
    out: &Path,
    progress: &Progress<'_>,
) -> Result<Evaluation, EvaluateError> {
    let mut evaluation = Evaluation {
        notes: (request.notes.iter().cloned())
            .chain(notes::unlabelled(&request))
            .collect(),
        twins: Vec::new(),
        runs: Vec::new(),
        lost: 0,
        findings: Vec::new(),
        request,
    };
    let count = evaluation.request.twins.len() as f64;
    for index in 0..evaluation.request.twins.len() {
        let from = index as f64 / count;
        let step = |share: f64, what: &str| progress(from + share / count, what);
        evaluation.behind(index, out, &step)?;
    }
    Ok(evaluation)
}

impl Evaluation {
    /// Evaluates all detectors behind one twin.
    fn behind(
        &mut self,
        index: usize,
        out: &Path,
        progress: &Progress<'_>,
    ) -> Result<(), EvaluateError> {
        /// Completed fraction when the twins are fitted.
        /// Layout: of the progress shown; no number depends on it.
        const FITTED: f64 = 0.1;
        /// Completed fraction when the detectors have learnt.
        /// Layout: of the progress shown; no number depends on it.
        const LEARNT: f64 = 0.6;
        let request = &self.request;
        let name = format!("twin {}", request.twins[index].name);
        let count = request.recordings.len() as f64;
        let what = format!("{name}: fitting");
        let mut twin = Prepared::new(request, &request.twins[index], &|at, fraction| {
            progress(FITTED * (at as f64 + fraction) / count, &what);
        })?;
        let mut session = twin.session(request)?;
        let mut odd = Notes::default();
        let [train, validation] = lessons(request, &mut session, &mut odd, &|what| {
            progress(FITTED, &format!("{name}: {what}"));
        })?;
        let measured: &[Lesson] = if validation.is_empty() {
            &train
        } else {
            &validation
        };
        twin.measure(request, measured)?;
        let lessons = Lessons {
            train: &train,
            validation: &validation,
        };
        let (mut runners, mut notes) = learn(request, &twin, lessons, out, &|share, what| {
            progress(
                FITTED + (LEARNT - FITTED) * share,
                &format!("{name}: {what}"),
            );
        })?;
        for (at, recording) in request.recordings.iter().enumerate() {
            let played;
            let samples = match recording.role {
                Role::Train => continue,
                Role::Validation => validation
                    .iter()
                    .find(|l| l.name == recording.name)
                    .map(|l| &l.samples),
                Role::Test => {
                    played = play(&mut session, recording, &mut odd, &mut |_| {})?;
                    Some(&played.samples)
                }
            };
            let Some(samples) = samples else { continue };
            let joints = &request.cell.facts.joint_names;
            let results = parallel::map(request.jobs, runners.iter_mut().collect(), |runner| {
                runner.pass(recording, samples, joints)
            });
            leave_out_failed(&mut runners, results, recording, request, &mut notes)?;
            let share = LEARNT + (1.0 - LEARNT) * (at + 1) as f64 / count;
            progress(share, &format!("{name}: {}", recording.name));
        }
        odd.close(request);
        notes.extend(twin.doubts());
        notes.extend(twin.passing_all(request));
        notes.extend(odd.unjudged(&runners));
        notes.extend(notes::silent(&runners));
        self.lost += odd.lost;
        // Twins behind one source report the same findings.
        self.findings = by_recording(&odd.findings);
        for note in notes.into_iter().chain(odd.all) {
            if !self.notes.contains(&note) {
                self.notes.push(note);
            }
        }
        self.keep(index, runners);
        self.twins.push(twin);
        Ok(())
    }

    /// Stores the detectors behind a twin, grouped by detector with one entry per seed.
    fn keep(&mut self, twin: usize, runners: Vec<Runner>) {
        for runner in runners {
            match self.runs.last_mut() {
                Some(run) if run.twin == twin && run.seeds[0].entry.name == runner.entry.name => {
                    run.seeds.push(runner);
                }
                _ => self.runs.push(Run {
                    twin,
                    seeds: vec![runner],
                }),
            }
        }
    }
}

/// Plays a recording through the twin and notes its irregularities.
fn play(
    session: &mut Session<'_>,
    recording: &Named,
    odd: &mut Notes,
    progress: &mut dyn FnMut(f64),
) -> Result<Played, EvaluateError> {
    let played = session.play(recording, progress);
    let played = played.map_err(|source| EvaluateError::Recording {
        recording: recording.path.display().to_string(),
        source,
    })?;
    odd.add(recording, &played)?;
    Ok(played)
}

/// Plays the train and validation recordings through the twin and excludes corrupt readings.
fn lessons(
    request: &Request,
    session: &mut Session<'_>,
    odd: &mut Notes,
    progress: &dyn Fn(&str),
) -> Result<[Vec<Lesson>; 2], EvaluateError> {
    let (mut train, mut validation) = (Vec::new(), Vec::new());
    for recording in &request.recordings {
        let lessons = match recording.role {
            Role::Train => &mut train,
            Role::Validation => &mut validation,
            Role::Test => continue,
        };
        let what = format!("reading {}", recording.name);
        let played = play(session, recording, odd, &mut |_| progress(&what))?;
        let mut lesson = session::lesson(recording, played.samples);
        let bad = bad_readings::leave_out(&mut lesson, &request.cell.facts);
        odd.all.extend(bad);
        lessons.push(lesson);
    }
    Ok([train, validation])
}

/// Removes the detectors that could not judge `recording`, and notes why. Fails if such a detector was named by the
/// user, or if no detector remains.
fn leave_out_failed(
    runners: &mut Vec<Runner>,
    results: Vec<Result<(), StageError>>,
    recording: &Named,
    request: &Request,
    notes: &mut Vec<String>,
) -> Result<(), EvaluateError> {
    let mut results = results.into_iter();
    let mut faults = Vec::new();
    runners.retain(|runner| match results.next() {
        Some(Err(source)) => {
            faults.push((runner.entry.name, source));
            false
        }
        _ => true,
    });
    for (detector, source) in faults {
        if request.explicit || runners.is_empty() {
            return Err(EvaluateError::Recording {
                recording: recording.path.display().to_string(),
                source: source.into(),
            });
        }
        notes.push(format!(
            "{detector} is left out: {}: {source}",
            recording.name
        ));
    }
    Ok(())
}

/// Training time of a detector relative to one that is not a neural network.
fn effort(entry: &Entry) -> usize {
    /// Layout: of the progress shown; no number depends on it.
    const OF_NETS: usize = 30;
    if entry.random { OF_NETS } else { 1 }
}

/// Trains every detector. One that cannot learn is noted; if the user named the detectors, it is an error.
fn learn(
    request: &Request,
    twin: &Prepared,
    lessons: Lessons<'_>,
    out: &Path,
    progress: &Progress<'_>,
) -> Result<(Vec<Runner>, Vec<String>), EvaluateError> {
    let setup = twin.setup(request)?;
    let seeds = |entry: &Entry| if entry.random { SEEDS } else { 1 };
    let pupils: Vec<(&'static Entry, u64)> = (request.detectors.iter())
        .flat_map(|entry| (0..seeds(entry)).map(move |seed| (*entry, seed)))
        .collect();
    let all: usize = pupils.iter().map(|(entry, _)| effort(entry)).sum();
    let done = AtomicUsize::new(0);
    let share = || done.load(Ordering::Relaxed) as f64 / all.max(1) as f64;
    let results = parallel::map(request.jobs, pupils, |(entry, seed)| {
        let what = match seeds(entry) {
            1 => format!("training {}", entry.name),
            all => format!("training {} (seed {} of {all})", entry.name, seed + 1),
        };
        progress(share(), &what);
        let file = format!("{}.{}.{seed}", twin.name, entry.name);
        let task = Task {
            setup: &setup,
            lessons,
            free_first_s: request.set.free_first_s,
            seed,
            twin_fit_s: twin.fit_s,
            given: &request.set.detectors,
            weights: out.join("models").join(file),
        };
        let runner = Runner::new(entry, &task);
        done.fetch_add(effort(entry), Ordering::Relaxed);
        progress(share(), &what);
        runner
    });
    let (mut runners, mut notes) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(runner) => {
                // All seeds of a detector give the same warning; keep one.
                let warning = runner.config.warning(&setup);
                notes.extend(warning.filter(|warning| !notes.contains(warning)));
                notes.extend(
                    runner
                        .config
                        .all()
                        .filter_map(tauscope_detect::AnySettings::note),
                );
                runners.push(runner);
            }
            Err(EvaluateError::Learn { detector, source }) if !request.explicit => {
                notes.push(format!("{detector} is left out: {source}"));
            }
            Err(error) => return Err(error),
        }
    }
    if runners.is_empty() {
        let why = notes.join("; ");
        return Err(EvaluateError::NoDetector { why });
    }
    Ok((runners, notes))
}
