//! What came of an explanation.

use tauscope_dynamics::terms::TermSpec;

use crate::report::schema::{RecordingPicture, Report};

/// What came of it.
#[derive(Debug)]
pub struct Outcome {
    /// What is said.
    pub report: Report,
    /// The physics of the corrected twin that lasts: what the start had and what was found.
    pub terms: Vec<TermSpec>,
    /// Gain of each joint's bodies \[effort unit per model unit\].
    pub gain: Vec<f64>,
    /// Standard deviation of each gain that stands for a torque constant; 0 where none does.
    pub gain_deviation: Vec<f64>,
    /// The corrected twin's effort on each hold-out recording: row-major, one row per recorded row \[effort unit\].
    pub predictions: Vec<(String, Vec<f64>)>,
    /// What is drawn.
    pub pictures: Vec<RecordingPicture>,
    /// Trajectories to record next: file name and CSV text.
    pub trajectories: Vec<(String, String)>,
}
