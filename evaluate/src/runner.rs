//! One detector over the session: it learns and its threshold is set on the validation recordings. Then every
//! sample of the validation and test recordings passes through the stage that a pipeline runs.

use std::time::Instant;

use tauscope_bus::{Detection, Emit, LinkError, Stage as _, StageError, TwinState, flags};
use tauscope_detect::{Config, Entry, Lesson, ScoreStatistics, Setup, Sweeps, Training};
use tauscope_pipeline::build::BuildError;
use tauscope_pipeline::tally::{DetectionTally, Event};
use tauscope_pipeline::trained;

use crate::error::EvaluateError;
use crate::recording::{Named, Role};
use crate::registry::Task;
use crate::twin::is_free_of;

/// Output of a detector for one recording.
#[derive(Debug, Clone)]
pub struct Output {
    /// The recording.
    pub recording: String,
    /// Role of the recording.
    pub role: Role,
    /// Stamps \[s from the first joint state\].
    pub t: Vec<f64>,
    /// Score of each sample. A sample that the detector was not ready for has the lowest score of the validation
    /// recordings, so that it cannot raise an alarm. Within validation recordings it has their mean, so that it does
    /// not shift the threshold.
    pub scores: Vec<f64>,
    /// Detected events.
    pub events: Vec<Event>,
    /// Number of samples that the detector was not ready for.
    pub not_judged: usize,
    /// Wall time of the detector \[s\].
    pub took_s: f64,
}

impl Output {
    /// Time from the first to the last sample \[s\].
    pub fn duration_s(&self) -> f64 {
        match (self.t.first(), self.t.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }
}

/// A trained detector that goes through the session. As in a pipeline, it is restarted for each recording and
/// resumes its learnt state.
pub struct Runner {
    /// The detector's entry in the table of detectors.
    pub entry: &'static Entry,
    /// Its seed.
    pub seed: u64,
    /// Its part of a pipeline file, with the state learnt from the training and validation recordings.
    pub config: Config,
    /// Trade-off curves by which it was tuned.
    pub sweeps: Option<Sweeps>,
    /// Wall time of training without the curves \[s\]; NaN if it learns nothing.
    pub training_s: f64,
    /// Statistics of its score on the contact-free part of the validation recordings.
    pub statistics: ScoreStatistics,
    /// Number of samples behind the statistics.
    pub counted: u64,
    /// Score at which it raises an alarm.
    pub threshold: f64,
    /// Upper bound of its score, if there is one.
    pub largest_score: Option<f64>,
    /// Outputs so far.
    pub outputs: Vec<Output>,
    /// Configuration with the state learnt from all recordings so far.
    now: Config,
    setup: Setup,
    lowest: f64,
}

impl Runner {
    /// Trains the detector and sets its threshold to mean + 4 standard deviations of its contact-free score. The
    /// score is measured on the validation recordings, or on the train recordings if there are none. A detector with
    /// its own decision rule keeps that rule.
    ///
    /// # Errors
    /// If it cannot learn from these recordings.
    pub fn new(entry: &'static Entry, task: &Task<'_>) -> Result<Self, EvaluateError> {
        let failed = |source| EvaluateError::Learn {
            detector: entry.name,
            source,
        };
        let began = Instant::now();
        let config = task.learn(entry).map_err(failed)?;
        let training_s = match entry.training {
            Training::None => f64::NAN,
            Training::Twin => task.twin_fit_s.unwrap_or(f64::NAN),
            Training::Own => began.elapsed().as_secs_f64(),
        };
        let sweeps = task.sweeps(&config).map_err(failed)?;
        let measured = match task.lessons.validation {
            [] => task.lessons.train,
            some => some,
        };
        let mut setup = task.setup.clone();
        trained::read(&config, &mut setup).map_err(BuildError::from)?;
        let (statistics, lowest, counted) = statistics(&config, &setup, measured)
            .map_err(|error| failed(error.into()))?
            .ok_or(EvaluateError::NeverReady {
                detector: entry.name,
            })?;
        let trained = setup.trained.get(entry.name);
        let largest_score = trained.and_then(|trained| (entry.largest_score)(trained));
        setup.scores.insert(entry.name.to_owned(), statistics);
        config
            .stage(setup.clone())
            .map_err(|error| failed(error.into()))?;
        Ok(Self {
            entry,
            seed: task.seed,
            now: config.clone(),
            config,
            sweeps,
            training_s,
            statistics,
            counted,
            threshold: f64::NAN,
            largest_score,
            outputs: Vec::new(),
            setup,
            lowest,
        })
    }

    /// Length of its windows \[samples\], if it judges windows.
    pub fn window(&self) -> Option<usize> {
        self.config
            .all()
            .find_map(tauscope_detect::AnySettings::window)
    }

    /// Runs the detector on the next recording of the session.
    ///
    /// # Errors
    /// If the stage fails.
    pub fn pass(
        &mut self,
        recording: &Named,
        samples: &[TwinState],
        joint_names: &[String],
    ) -> Result<(), StageError> {
        let mut last = Last(Detection::default());
        let mut tally = DetectionTally::new(self.entry.name, joint_names).since(recording.start_ns);
        let mut scores = Vec::with_capacity(samples.len());
        let not_ready = match recording.role {
            Role::Test => self.lowest,
            Role::Train | Role::Validation => self.statistics.mean,
        };
        let mut stage = (self.now.stage(self.setup.clone())).map_err(StageError::failed)?;
        let mut not_judged = 0;
        let began = Instant::now();
        for sample in samples {
            stage.accept(sample, &mut last)?;
            let said = &last.0;
            let judged = said.header.has(flags::READY) && said.score.is_finite();
            not_judged += usize::from(!judged);
            scores.push(if judged { said.score } else { not_ready });
            tally.add(said);
        }
        let took_s = began.elapsed().as_secs_f64();
        if let Some(learnt) = stage.learnt() {
            self.now.resume(&learnt).map_err(StageError::failed)?;
        }
        if recording.role != Role::Test {
            self.config.clone_from(&self.now);
        }
        if !samples.is_empty() {
            self.threshold = last.0.threshold;
        }
        let seconds =
            |sample: &TwinState| (sample.header.stamp_ns - recording.start_ns) as f64 / 1e9;
        self.outputs.push(Output {
            recording: recording.name.clone(),
            role: recording.role,
            t: samples.iter().map(seconds).collect(),
            scores,
            events: tally.events,
            not_judged,
            took_s,
        });
        Ok(())
    }
}

/// Keeps the newest sample only.
struct Last(Detection);

impl Emit<Detection> for Last {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        self.0 = Detection::default();
        write(&mut self.0);
        Ok(())
    }
}

/// Statistics of the score on the contact-free part of `lessons`, the lowest score of all samples, and the number of
/// contact-free samples. Samples that the detector is not ready for count as the mean. `None` if it is never ready.
fn statistics(
    config: &Config,
    setup: &Setup,
    lessons: &[Lesson],
) -> Result<Option<(ScoreStatistics, f64, u64)>, tauscope_detect::ConfigError> {
    let mut detector = config.detector(setup)?;
    let (mut scores, mut count) = (Vec::new(), 0_u64);
    let mut lowest = f64::INFINITY;
    for lesson in lessons {
        for sample in &lesson.samples {
            let judgement = detector.judge(sample);
            let judged = judgement.ready && judgement.score.is_finite();
            if judged {
                lowest = lowest.min(judgement.score);
            }
            if is_free_of(lesson, sample.header.stamp_ns) {
                count += 1;
                scores.extend(judged.then_some(judgement.score));
            }
        }
    }
    if scores.is_empty() {
        return Ok(None);
    }
    let mean = scores.iter().sum::<f64>() / scores.len() as f64;
    let squares: f64 = scores.iter().map(|score| (score - mean).powi(2)).sum();
    let statistics = ScoreStatistics {
        mean,
        standard_deviation: (squares / count as f64).sqrt(),
    };
    Ok(Some((statistics, lowest, count)))
}
