//! The rows of a joint that carry information, in the order of time.

use crate::data::problem::Problem;

/// Fewest pieces that are left out in turn. Resolution: a joint that moves in one recording of two is still predicted by
/// others.
const LEAST_PIECES: usize = 6;

/// Pieces of equal length into which each recording is cut to be left out of a fit in turn.
fn cuts(problem: &Problem) -> usize {
    LEAST_PIECES.div_ceil(problem.tracks.len().max(1))
}

/// Number of pieces of all recordings.
pub fn pieces(problem: &Problem) -> usize {
    problem.tracks.len() * cuts(problem)
}

/// The compared rows of one joint.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Row of the joint in a signal.
    pub row: Vec<usize>,
    /// Recording of each row.
    pub recording: Vec<usize>,
    /// Piece of a recording, of each row.
    pub piece: Vec<usize>,
    /// Time of each row from the start of its recording \[s\].
    pub time_s: Vec<f64>,
}

impl Rows {
    /// The rows of a joint with weight.
    pub fn of(problem: &Problem, joint: usize) -> Self {
        let mut rows = Self {
            row: Vec::new(),
            recording: Vec::new(),
            piece: Vec::new(),
            time_s: Vec::new(),
        };
        for (recording, row, sample) in problem.counted(joint) {
            rows.row.push(row);
            rows.recording.push(recording);
            let time_s = &problem.tracks[recording].track.time_s;
            rows.time_s.push(time_s[sample]);
            let (first, last) = (time_s[0], time_s[time_s.len() - 1]);
            let share = (time_s[sample] - first) / (last - first).max(f64::MIN_POSITIVE);
            let cuts = cuts(problem);
            let piece = ((share * cuts as f64) as usize).min(cuts - 1);
            rows.piece.push(recording * cuts + piece);
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
