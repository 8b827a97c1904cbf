//! What a detector is.

use tauscope_bus::TwinState;

/// What a detector makes of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    /// The score; the larger, the more likely a contact.
    pub score: f64,
    /// Whether it can be trusted: the twin's and the detector's own filters have settled.
    pub ready: bool,
}

/// Scores every sample of a twin. Pure: time is in the samples; nothing is allocated per sample.
pub trait Detector: Send {
    /// Canonical name, as in the pipeline file and in the archive.
    fn name(&self) -> &'static str;

    /// The score of the next sample.
    fn judge(&mut self, sample: &TwinState) -> Judgement;
}
