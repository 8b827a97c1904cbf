//! What a detector is.

use tauscope_bus::TwinState;

use super::isolation::Contact;

/// What a detector makes of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    /// The score; the larger, the more likely a contact.
    pub score: f64,
    /// Whether it can be trusted: the twin's and the detector's own filters have settled.
    pub ready: bool,
    /// What the detector decided by rules of its own; `None` leaves it to the threshold.
    pub verdict: Option<Verdict>,
}

/// What a detector decided by rules of its own. A detector that decides so does for every sample that
/// it is ready for, and says so by [`Detector::threshold`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// The detector's state in its own words. While an alarm lasts it is the kind of the event:
    /// `contact`, `collision` or `cooperation`.
    pub state: &'static str,
    /// The contact it sees, if it sees one.
    pub contact: Option<Seen>,
}

/// A contact that a detector sees. One event is as long as its kind and its beginning stay the same:
/// a change of either begins another event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Estimated beginning \[ns since the epoch\].
    pub contact_ns: i64,
    /// The joints that detected, bit j for joint j; `None` leaves it to the residuals' size.
    pub joints: Option<u32>,
    /// The touched link, an index into the model's links, and the force on the robot in the world
    /// frame \[N\] with the point where it is taken to act \[m\]; `None` leaves it to the residual's pattern.
    pub place: Option<Contact>,
}

/// What a detector saw on the way to its newest judgement. World frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Details {
    /// By direction, how much of the external force lies in the band that is watched \[N\].
    pub content_n: [f64; 3],
    /// Of the contact that goes on, unit vectors of the force's change at its detection and of the tool's
    /// velocity at its beginning; zeros for one without length.
    pub directions: Option<[[f64; 3]; 2]>,
}

/// What a detector has learnt while running: whatever its own file makes of it.
pub type State = serde_json::Value;

/// Scores every sample of a twin. Pure: time is in the samples; nothing is allocated per sample.
pub trait Detector: Send {
    /// Canonical name, as in the pipeline file and in the archive.
    fn name(&self) -> &'static str;

    /// The score of the next sample.
    fn judge(&mut self, sample: &TwinState) -> Judgement;

    /// The score from which on a detector with rules of its own sees a contact. `None`: the frame
    /// holds the score against the configured threshold.
    fn threshold(&self) -> Option<f64> {
        None
    }

    /// What it saw on the way to its newest judgement; `None` where there is no more than that.
    fn details(&self) -> Option<Details> {
        None
    }

    /// What it has learnt while running, to be kept for its next life; `None` if it learns nothing.
    fn learnt(&self) -> Option<State> {
        None
    }

    /// Whether it is learning just now, so that what it has learnt is not whole yet.
    fn is_learning(&self) -> bool {
        false
    }

    /// Why it can never judge this stream, once that shows: the stage ends with it. What may pass is no fault; the
    /// detector is not ready while it lasts.
    fn fault(&self) -> Option<String> {
        None
    }
}
