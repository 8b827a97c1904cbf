//! The trait of a detector and its result for a sample.

use tauscope_bus::TwinState;

use super::isolation::Contact;

/// A detector's result for one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    /// The score; the larger, the more likely a contact.
    pub score: f64,
    /// Whether the score is valid: the twin's and the detector's own filters have settled.
    pub ready: bool,
    /// Decision by the detector's own rules; `None` leaves it to the threshold.
    pub verdict: Option<Verdict>,
}

/// A decision by a detector's own rules. Such a detector decides on every sample for which it is ready, and declares
/// this by [`Detector::threshold`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Name of the detector's state. During an alarm it is the kind of the event: `contact`, `collision` or
    /// `cooperation`.
    pub state: &'static str,
    /// The contact that the detector sees, if any.
    pub contact: Option<Seen>,
}

/// A contact that a detector sees. An event lasts while its kind and its start are unchanged; a change of either
/// starts a new event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Estimated start \[ns since the epoch\].
    pub contact_ns: i64,
    /// The joints that detected the contact, bit j for joint j; `None` derives them from the residual.
    pub joints: Option<u32>,
    /// The touched link (an index into the model's links), the force on the robot in the world frame \[N\] and its
    /// assumed point of application \[m\]; `None` derives them from the residual.
    pub place: Option<Contact>,
}

/// Intermediate results of a detector's newest judgement, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Details {
    /// External force within the monitored frequency band, by direction \[N\].
    pub content_n: [f64; 3],
    /// Unit vectors of the force's change at the detection of the current contact and of the tool's velocity at its
    /// start; zeros for a vector without length.
    pub directions: Option<[[f64; 3]; 2]>,
}

/// State that a detector learns while running; its structure is defined by the detector.
pub type State = serde_json::Value;

/// Scores every sample of a twin. Deterministic: time comes from the samples. Nothing is allocated per sample.
pub trait Detector: Send {
    /// Canonical name, as in the pipeline file and in the archive.
    fn name(&self) -> &'static str;

    /// Returns the score of the next sample.
    fn judge(&mut self, sample: &TwinState) -> Judgement;

    /// Returns the score at which a detector with its own rules detects a contact. `None`: the stage compares the
    /// score with the configured threshold.
    fn threshold(&self) -> Option<f64> {
        None
    }

    /// Returns the intermediate results of the newest judgement, if there are any.
    fn details(&self) -> Option<Details> {
        None
    }

    /// Returns the state learnt while running, to be kept for the next run; `None` if it learns nothing.
    fn learnt(&self) -> Option<State> {
        None
    }

    /// Returns whether the detector is learning, so that its learnt state is incomplete.
    fn is_learning(&self) -> bool {
        false
    }

    /// Returns the reason why the detector can never judge this stream, once that is known; the stage then fails with
    /// it. A temporary problem is no fault: the detector is not ready while it lasts.
    fn fault(&self) -> Option<String> {
        None
    }
}
