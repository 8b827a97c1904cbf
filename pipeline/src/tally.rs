//! What a replay says of a recording: how far the twin was off, and what the detectors found.

use serde::Serialize;
use tauscope_bus::{Detection, EventKind, TwinState, flags};

/// A joint that is faster than this moves \[rad/s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const MOVING_RAD_S: f64 = 0.01;

/// Sums over one twin's samples.
#[derive(Debug, Clone)]
pub struct TwinTally {
    /// The stage.
    pub stage: String,
    /// Samples with an expected effort, and those of them in which some joint moves.
    pub samples: u64,
    /// See above.
    pub moving_samples: u64,
    joints: Vec<JointSums>,
}

#[derive(Debug, Clone, Copy, Default)]
struct JointSums {
    all: f64,
    moving: f64,
    filtered: f64,
}

/// Root mean squares of one joint's residual, in the effort's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointRms {
    /// Measured less expected effort, not filtered, over all samples.
    pub residual_rms: f64,
    /// The same over the samples in which some joint moves.
    pub residual_rms_moving: f64,
    /// Behind the twin's low-pass, over all samples.
    pub filtered_residual_rms: f64,
}

impl TwinTally {
    /// Nothing summed yet, for the twin `stage` of an arm with so many joints.
    pub fn new(stage: &str, joint_count: usize) -> Self {
        Self {
            stage: stage.to_owned(),
            samples: 0,
            moving_samples: 0,
            joints: vec![JointSums::default(); joint_count],
        }
    }

    /// Adds a sample, if it holds a measured effort.
    pub fn add(&mut self, sample: &TwinState) {
        if !sample.header.has(flags::EFFORT_MEASURED) {
            return;
        }
        let n = self.joints.len();
        let moving = sample.velocity[..n].iter().any(|v| v.abs() > MOVING_RAD_S);
        self.samples += 1;
        self.moving_samples += u64::from(moving);
        for (j, sums) in self.joints.iter_mut().enumerate() {
            let square = (sample.effort[j] - sample.expected_effort[j]).powi(2);
            sums.all += square;
            sums.filtered += sample.residual[j].powi(2);
            if moving {
                sums.moving += square;
            }
        }
    }

    /// By joint in URDF order; NaN where there was no sample.
    pub fn rms(&self) -> Vec<JointRms> {
        let root = |sum: f64, count: u64| (sum / count as f64).sqrt();
        self.joints
            .iter()
            .map(|sums| JointRms {
                residual_rms: root(sums.all, self.samples),
                residual_rms_moving: root(sums.moving, self.moving_samples),
                filtered_residual_rms: root(sums.filtered, self.samples),
            })
            .collect()
    }
}

/// One event of a detector, in seconds from the first sample of the recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Event {
    /// Stamp of the sample that raised the alarm.
    pub t: f64,
    /// Stamp of the sample that ended it, or of the recording's last.
    pub t_off: f64,
    /// Estimated beginning of the contact.
    pub t_contact: f64,
    /// `contact`, `collision` or `cooperation`; of a change of the arm the effect's name, or `unknown`.
    pub kind: String,
    /// The touched or changed link, where estimated.
    pub link: Option<String>,
    /// The joints that detected.
    pub joints: Vec<String>,
    /// Force on the robot in the world frame \[N\], where estimated; the largest of the event.
    pub force: Option<[f64; 3]>,
    /// The largest score.
    pub peak_score: f64,
    /// Size of a change of the arm: kg, a factor, or effort unit (per rad/s), by its kind.
    pub size: Option<f64>,
}

/// Follows one detector.
#[derive(Debug, Clone)]
pub struct DetectionTally {
    /// The stage.
    pub stage: String,
    /// The detector's canonical name, once it has spoken.
    pub detector: String,
    /// Samples it judged.
    pub judged: u64,
    /// What it found.
    pub events: Vec<Event>,
    joint_names: Vec<String>,
    start_ns: Option<i64>,
    newest_ns: i64,
    open: bool,
}

impl DetectionTally {
    /// Nothing found yet by the detector `stage` of an arm with these joints.
    pub fn new(stage: &str, joint_names: &[String]) -> Self {
        Self {
            stage: stage.to_owned(),
            detector: String::new(),
            judged: 0,
            events: Vec::new(),
            joint_names: joint_names.to_vec(),
            start_ns: None,
            newest_ns: 0,
            open: false,
        }
    }

    /// Counts seconds from this stamp on instead of the first sample's \[ns since the epoch\].
    #[must_use]
    pub fn since(mut self, start_ns: i64) -> Self {
        self.start_ns = Some(start_ns);
        self
    }

    /// Adds a sample: an event begins, goes on or ends.
    pub fn add(&mut self, sample: &Detection) {
        let start_ns = *self.start_ns.get_or_insert(sample.header.stamp_ns);
        let seconds = |ns: i64| (ns - start_ns) as f64 * 1e-9;
        self.newest_ns = sample.header.stamp_ns;
        if self.detector.is_empty() {
            sample.detector.as_str().clone_into(&mut self.detector);
        }
        self.judged += u64::from(sample.header.has(flags::READY));
        match sample.event() {
            EventKind::Onset => {
                if let Some(last) = self.events.last_mut().filter(|_| self.open) {
                    last.t_off = seconds(sample.header.stamp_ns);
                }
                self.open = true;
                self.events.push(Event {
                    t: seconds(sample.header.stamp_ns),
                    t_off: seconds(sample.header.stamp_ns),
                    t_contact: seconds(sample.contact_ns),
                    kind: sample.state.to_string(),
                    link: None,
                    joints: Vec::new(),
                    force: None,
                    peak_score: sample.score,
                    size: sample.header.has(flags::CHANGE).then_some(sample.size),
                });
            }
            EventKind::Offset => self.open = false,
            EventKind::None => {}
        }
        let Some(event) = self.events.last_mut() else {
            return;
        };
        if sample.event() == EventKind::Offset || self.open {
            event.t_off = seconds(sample.header.stamp_ns);
        }
        // Where the score peaks, the contact is told best.
        if self.open && (event.link.is_none() || sample.score >= event.peak_score) {
            event.peak_score = event.peak_score.max(sample.score);
            event.kind = sample.state.to_string();
            if !sample.link.as_str().is_empty() {
                event.link = Some(sample.link.to_string());
            }
            if sample.header.has(flags::FORCE) {
                event.force = Some(sample.force_n);
            }
            for (j, name) in self.joint_names.iter().enumerate() {
                if sample.joints & (1 << j) != 0 && !event.joints.contains(name) {
                    event.joints.push(name.clone());
                }
            }
        }
    }
}
