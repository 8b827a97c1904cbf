//! The rows of a joint that carry information, in the order of time.

use crate::data::problem::Problem;

/// The compared rows of one joint.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Row of the joint in a signal.
    pub row: Vec<usize>,
    /// Recording of each row.
    pub recording: Vec<usize>,
    /// Time of each row from the start of its recording \[s\].
    pub time_s: Vec<f64>,
}

impl Rows {
    /// The rows of a joint with weight.
    pub fn of(problem: &Problem, joint: usize) -> Self {
        let mut rows = Self {
            row: Vec::new(),
            recording: Vec::new(),
            time_s: Vec::new(),
        };
        for (recording, row, sample) in problem.counted(joint) {
            rows.row.push(row);
            rows.recording.push(recording);
            let track = &problem.tracks[recording].track;
            rows.time_s.push(track.time_s[sample]);
        }
        rows
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.row.len()
    }

    /// Picks the rows from a joint's part of a signal.
    pub fn pick(&self, values: &[f64]) -> Vec<f64> {
        self.row.iter().map(|&row| values[row]).collect()
    }
}
