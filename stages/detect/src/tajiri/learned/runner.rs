//! Training and inference common to all learned detectors.

use std::sync::Arc;

use tauscope_bus::{TwinState, flags};

use super::demand;
use super::signals::{Signal, Signals};
use crate::frame::rate::Rate;
use crate::frame::{
    ConfigError, Detector, Facts, Judgement, LearnError, ScoreStatistics, Setup, SignalSettings,
    Task, Trained, TrainedError,
};

/// Scores the signals, sample by sample.
pub(crate) trait Scorer: Send {
    /// Returns the score at the next sample, once there are enough samples.
    fn score(&mut self, signal: &Signal) -> Option<f64>;

    /// Discards all samples.
    fn reset(&mut self);
}

/// Reads a scorer from a trained detector.
pub(crate) type Load = fn(&Trained) -> Result<Box<dyn Scorer>, TrainedError>;

/// Builds the detector `name` from its trained state in `setup`.
///
/// # Errors
/// If the trained state is missing, belongs to another detector or to other joints, or lacks an array.
pub(crate) fn build(
    name: &'static str,
    setup: &Setup,
    load: Load,
) -> Result<Box<dyn Detector>, ConfigError> {
    let Some(trained) = setup.trained.get(name) else {
        return Err(ConfigError::NotTrained { detector: name });
    };
    let facts = trained.facts();
    if facts.detector != name {
        return Err(ConfigError::OtherDetector {
            detector: name,
            found: facts.detector.clone(),
        });
    }
    let joints = joint_names(name, setup)?;
    if facts.joints != joints {
        return Err(ConfigError::OtherJoints {
            detector: name,
            trained: facts.joints.join(", "),
            cell: joints.join(", "),
        });
    }
    let signals = Signals::new(&facts.signals, setup, name)?;
    let scorer = load(trained).map_err(|source| ConfigError::Trained {
        detector: name,
        source,
    })?;
    Ok(Box::new(Learned {
        name,
        rate: Rate::new(name, setup, facts.rate_hz),
        signals,
        scorer,
        stamp_ns: i64::MIN,
        judgement: NOT_READY,
    }))
}

fn joint_names(detector: &'static str, setup: &Setup) -> Result<Vec<String>, ConfigError> {
    let model = setup.model.as_ref();
    let model = model.ok_or(ConfigError::NoModel { detector })?;
    Ok(model.joint_names().map(str::to_owned).collect())
}

const NOT_READY: Judgement = Judgement {
    score: 0.0,
    ready: false,
    verdict: None,
};

struct Learned {
    name: &'static str,
    rate: Rate,
    signals: Signals,
    scorer: Box<dyn Scorer>,
    stamp_ns: i64,
    judgement: Judgement,
}

impl Detector for Learned {
    fn name(&self) -> &'static str {
        self.name
    }

    fn fault(&self) -> Option<String> {
        self.rate.fault()
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        self.rate.update(sample);
        let reset = sample.header.has(flags::RESET);
        if reset {
            self.scorer.reset();
        } else if sample.header.stamp_ns == self.stamp_ns {
            // A repeated stamp must not enter windows and recurrent networks again.
            return self.judgement;
        }
        self.stamp_ns = sample.header.stamp_ns;
        let score = (self.signals.update(sample)).and_then(|signal| self.scorer.score(signal));
        let score = score.filter(|_| self.rate.is_right());
        self.judgement = score.map_or(NOT_READY, |score| Judgement {
            score,
            ready: true,
            verdict: None,
        });
        self.judgement
    }
}

/// One training run.
pub(crate) struct Course<'a> {
    name: &'static str,
    settings: SignalSettings,
    task: &'a Task<'a>,
    window: usize,
    joints: Vec<String>,
    stretches: Vec<Vec<Signal>>,
}

impl<'a> Course<'a> {
    /// Collects the training data of the detector `name`, whose scores use `window` samples: the contact-free part of
    /// the training recordings.
    ///
    /// # Errors
    /// If there is no robot model, or less than one window of data.
    pub fn new(
        name: &'static str,
        settings: &SignalSettings,
        window: usize,
        task: &'a Task<'a>,
    ) -> Result<Self, LearnError> {
        if let Some(what) = settings.fault() {
            return Err(LearnError::Setting {
                detector: name,
                what,
            });
        }
        demand(name, window > 0, "a window must hold at least one sample")?;
        let joints = joint_names(name, task.setup)?;
        let mut signals = Signals::new(settings, task.setup, name)?;
        let mut stretches = signals.stretches(task.lessons.train);
        let longest = stretches.iter().map(Vec::len).max().unwrap_or(0);
        let wanted = window.max(2);
        if longest < wanted {
            return Err(LearnError::TooLittle {
                detector: name,
                wanted: format!("{wanted} settled, contact-free samples in a row"),
                found: longest.to_string(),
            });
        }
        stretches.retain(|stretch| stretch.len() >= wanted);
        Ok(Self {
            name,
            settings: *settings,
            task,
            window,
            joints,
            stretches,
        })
    }

    /// Returns the contact-free segments of the signals, each at least a window long.
    pub fn stretches(&self) -> &[Vec<Signal>] {
        &self.stretches
    }

    /// Returns the number of joints of the robot.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Returns a training error.
    pub fn failed(&self, error: impl std::fmt::Display) -> LearnError {
        LearnError::Failed {
            detector: self.name,
            reason: error.to_string(),
        }
    }

    /// Returns the trained detector. `save` fills in its arrays; its score is measured on the contact-free part of
    /// the validation recordings (of the training recordings if there are none).
    ///
    /// # Errors
    /// If the training gave non-finite numbers, or there is no data to measure the score.
    pub fn end(self, save: impl FnOnce(&mut Trained), load: Load) -> Result<Trained, LearnError> {
        let samples = self.stretches.iter().map(Vec::len).sum::<usize>();
        let span_s = |stretch: &Vec<Signal>| match (stretch.first(), stretch.last()) {
            (Some(first), Some(last)) => (last.stamp_ns - first.stamp_ns) as f64 * 1e-9,
            _ => 0.0,
        };
        let seconds = self.stretches.iter().map(span_s).sum::<f64>();
        let mut trained = Trained::new(Facts {
            version: 0,
            detector: self.name.to_owned(),
            joints: self.joints.clone(),
            // Three decimals survive writing to and reading from JSON.
            rate_hz: (1e3 * (samples - self.stretches.len()) as f64 / seconds).round() / 1e3,
            samples: samples as u64,
            seed: self.task.seed,
            signals: self.settings,
            window: self.window,
            provenance: std::collections::BTreeMap::new(),
        });
        save(&mut trained);
        let mut setup = self.task.setup.clone();
        let key = self.name.to_owned();
        setup.trained.insert(key, Arc::new(trained.clone()));
        let mut detector = build(self.name, &setup, load)?;
        let lessons = match self.task.lessons.validation {
            [] => self.task.lessons.train,
            validation => validation,
        };
        let mut scores = Vec::new();
        for lesson in lessons {
            for sample in lesson.anew() {
                let judgement = detector.judge(&sample);
                if judgement.ready && !lesson.touches(sample.header.stamp_ns) {
                    scores.push(judgement.score);
                }
            }
        }
        if scores.is_empty() {
            return Err(LearnError::TooLittle {
                detector: self.name,
                wanted: format!("{} settled, contact-free validation samples", self.window),
                found: "none".to_owned(),
            });
        }
        let count = scores.len() as f64;
        let mean = scores.iter().sum::<f64>() / count;
        let variance = scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / count;
        if !variance.is_finite() {
            return Err(self.failed("the training diverged: a smaller `learning_rate` may help"));
        }
        trained.set_score(ScoreStatistics {
            mean,
            standard_deviation: variance.sqrt(),
        });
        Ok(trained)
    }
}
