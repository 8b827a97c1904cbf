//! Statistics of a replayed recording: residuals of the twins and events of the detectors.

use serde::Serialize;
use tauscope_bus::{Contact, ContactFollower, Detection, EventKind, Name, TwinState, flags};
use tauscope_dynamics::terms::STANDSTILL_RAD_S;

/// Sums over one twin's samples.
#[derive(Debug, Clone)]
pub struct TwinTally {
    /// The stage.
    pub stage: String,
    /// Number of samples with a measured effort.
    pub samples: u64,
    /// Number of these samples in which some joint moves.
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
    /// RMS of measured minus expected effort, unfiltered, over all samples.
    pub residual_rms: f64,
    /// RMS of measured minus expected effort, unfiltered, over the samples in which some joint moves.
    pub residual_rms_moving: f64,
    /// RMS of the residual behind the twin's low-pass, over all samples.
    pub filtered_residual_rms: f64,
}

impl TwinTally {
    /// Creates empty sums for the twin `stage` of an arm with `joint_count` joints.
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
        let moving = sample.velocity[..n]
            .iter()
            .any(|v| v.abs() > STANDSTILL_RAD_S);
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

    /// Root mean squares by joint in URDF order; NaN without samples.
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
    /// Stamp of the sample that ended it, or of the recording's last sample.
    pub t_off: f64,
    /// Estimated beginning of the contact.
    pub t_contact: f64,
    /// `contact`, `collision` or `cooperation`; for a change of the arm, the effect's name or `unknown`.
    pub kind: String,
    /// The touched or changed link, if estimated.
    pub link: Option<String>,
    /// The alternative link, if the first one is ambiguous.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other_link: Option<String>,
    /// The joints that detected.
    pub joints: Vec<String>,
    /// Force on the robot in the world frame at the sample with the largest score, if estimated \[N\].
    pub force: Option<[f64; 3]>,
    /// The largest score.
    pub peak_score: f64,
    /// Size of a change of the arm: kg, a factor, or effort unit (per rad/s), by its kind.
    pub size: Option<f64>,
}

/// Statistics of one detector.
#[derive(Debug, Clone)]
pub struct DetectionTally {
    /// The stage.
    pub stage: String,
    /// The detector's canonical name, after its first sample.
    pub detector: String,
    /// Number of samples it judged.
    pub judged: u64,
    /// Detected events.
    pub events: Vec<Event>,
    joint_names: Vec<String>,
    start_ns: Option<i64>,
    contacts: ContactFollower,
}

impl DetectionTally {
    /// Creates empty statistics of the detector `stage` of an arm with these joints.
    pub fn new(stage: &str, joint_names: &[String]) -> Self {
        Self {
            stage: stage.to_owned(),
            detector: String::new(),
            judged: 0,
            events: Vec::new(),
            joint_names: joint_names.to_vec(),
            start_ns: None,
            contacts: ContactFollower::default(),
        }
    }

    /// Sets the zero of times to this stamp instead of the first sample's \[ns since the epoch\].
    #[must_use]
    pub fn since(mut self, start_ns: i64) -> Self {
        self.start_ns = Some(start_ns);
        self
    }

    /// Zero of times, after the first sample \[ns since the epoch\].
    pub fn start_ns(&self) -> Option<i64> {
        self.start_ns
    }

    /// Adds a sample, which begins, continues or ends an event.
    pub fn add(&mut self, sample: &Detection) {
        let start_ns = *self.start_ns.get_or_insert(sample.header.stamp_ns);
        if self.detector.is_empty() {
            sample.detector.as_str().clone_into(&mut self.detector);
        }
        self.judged += u64::from(sample.header.has(flags::READY));
        if let Some(ended) = self.contacts.push(sample) {
            self.events.pop();
            self.events.push(self.event(&ended, start_ns));
        }
        if let Some(open) = self.contacts.open() {
            // The estimates of the open event have improved.
            if sample.event() == EventKind::None {
                self.events.pop();
            }
            self.events.push(self.event(open, start_ns));
        }
    }

    fn event(&self, contact: &Contact, start_ns: i64) -> Event {
        let seconds = |ns: i64| (ns - start_ns) as f64 * 1e-9;
        let told = |link: &Name| Some(link.to_string()).filter(|link| !link.is_empty());
        let joints = self.joint_names.iter().enumerate();
        let joints = joints.filter(|(j, _)| *j < 32 && contact.joints & (1 << j) != 0);
        Event {
            t: seconds(contact.onset_ns),
            t_off: seconds(contact.end_ns),
            t_contact: seconds(contact.contact_ns),
            kind: contact.kind.to_string(),
            link: told(&contact.link),
            other_link: told(&contact.other_link),
            joints: joints.map(|(_, name)| name.clone()).collect(),
            force: contact.peak().map(|peak| peak.force_n),
            peak_score: contact.peak_score,
            size: contact.size,
        }
    }
}
