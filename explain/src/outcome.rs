//! The result of an explanation.

use tauscope_dynamics::terms::TermSpec;

use crate::report::schema::{RecordingPicture, Report};

/// The result of an explanation.
#[derive(Debug)]
pub struct Outcome {
    /// The report.
    pub report: Report,
    /// The corrected twin's lasting terms: those of the start and those that were found.
    pub terms: Vec<TermSpec>,
    /// Gain of each joint's bodies \[effort unit per model unit\].
    pub gain: Vec<f64>,
    /// Standard deviation of each gain that stands for a torque constant; 0 for the others.
    pub gain_deviation: Vec<f64>,
    /// The corrected twin's effort on each hold-out recording: row-major, one row per recorded row \[effort unit\].
    pub predictions: Vec<(String, Vec<f64>)>,
    /// The series of the report's pictures.
    pub pictures: Vec<RecordingPicture>,
    /// Trajectories to record next: file name and CSV text.
    pub trajectories: Vec<(String, String)>,
}
