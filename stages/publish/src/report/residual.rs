//! The residual of the last minute in which nothing touched the robot.

use std::collections::VecDeque;

use tauscope_bus::{TwinState, flags};

use crate::message::{JointResidual, ResidualMessage};

/// Duration of a segment of the sums \[ns\]. Resolution: a sixtieth of the window.
const PIECE_NS: i64 = 1_000_000_000;
/// Number of segments kept. Resolution: a minute covers a few cycles of most programs.
const PIECES: usize = 60;

/// Excluded margin before the detection of a contact, and after its last sample \[ns\]. Resolution: a detector takes
/// less to see a contact, and the residual's filters settle within it.
const AROUND_CONTACT_NS: i64 = 1_000_000_000;

#[derive(Debug, Clone)]
struct Piece {
    begin_ns: i64,
    end_ns: i64,
    count: u64,
    sums: Vec<f64>,
    squares: Vec<f64>,
}

/// Sums of the residual over the last minute, in fixed memory.
#[derive(Debug)]
pub struct Residual {
    joints: Vec<String>,
    calibrated: Vec<Option<f64>>,
    pieces: VecDeque<Piece>,
    /// The newest sample at which something touched the robot.
    touched_ns: Option<i64>,
}

impl Residual {
    /// Creates the sums of these joints; `calibrated` is by joint, as far as the twin's file has it \[effort unit\].
    pub fn new(joints: Vec<String>, calibrated: Vec<Option<f64>>) -> Self {
        Self {
            joints,
            calibrated,
            pieces: VecDeque::with_capacity(PIECES + 1),
            touched_ns: None,
        }
    }

    /// Records a contact at this sample, and discards the residual just before it, which the contact may have
    /// changed.
    pub fn touched(&mut self, stamp_ns: i64) {
        self.touched_ns = Some(stamp_ns);
        let near_ns = stamp_ns.saturating_sub(AROUND_CONTACT_NS);
        while self
            .pieces
            .back()
            .is_some_and(|last| last.end_ns >= near_ns)
        {
            self.pieces.pop_back();
        }
    }

    /// Takes a sample of the twin.
    pub fn twin(&mut self, sample: &TwinState) {
        let stamp_ns = sample.header.stamp_ns;
        let residual = &sample.residual[..self.joints.len()];
        if !sample.header.has(flags::READY) || residual.iter().any(|value| !value.is_finite()) {
            return;
        }
        let since_ns = self
            .touched_ns
            .map(|touched_ns| stamp_ns.saturating_sub(touched_ns));
        if since_ns.is_some_and(|since_ns| (0..AROUND_CONTACT_NS).contains(&since_ns)) {
            return;
        }
        // The sums restart after a clock that was set back.
        if self
            .pieces
            .back()
            .is_some_and(|last| stamp_ns < last.begin_ns)
        {
            self.pieces.clear();
        }
        let full = |last: &Piece| stamp_ns.saturating_sub(last.begin_ns) >= PIECE_NS;
        if self.pieces.back().is_none_or(full) {
            self.pieces.push_back(Piece {
                begin_ns: stamp_ns,
                end_ns: stamp_ns,
                count: 0,
                sums: vec![0.0; residual.len()],
                squares: vec![0.0; residual.len()],
            });
            if self.pieces.len() > PIECES {
                self.pieces.pop_front();
            }
        }
        let Some(piece) = self.pieces.back_mut() else {
            return;
        };
        piece.end_ns = stamp_ns;
        piece.count += 1;
        for (j, value) in residual.iter().enumerate() {
            piece.sums[j] += value;
            piece.squares[j] += value * value;
        }
    }

    /// Returns the residual so far; `None` before the first sample.
    pub fn message(&self) -> Option<ResidualMessage> {
        let stamp_ns = self.pieces.back()?.end_ns;
        let spans = self
            .pieces
            .iter()
            .map(|piece| piece.end_ns - piece.begin_ns);
        let count: u64 = self.pieces.iter().map(|piece| piece.count).sum();
        let mean =
            |of: &dyn Fn(&Piece) -> f64| self.pieces.iter().map(of).sum::<f64>() / count as f64;
        let joints = self
            .joints
            .iter()
            .enumerate()
            .map(|(j, name)| JointResidual {
                name: name.clone(),
                rms: mean(&|piece| piece.squares[j]).sqrt(),
                mean: mean(&|piece| piece.sums[j]),
                calibrated: self.calibrated.get(j).copied().flatten(),
            });
        Some(ResidualMessage {
            stamp_ns,
            window_s: spans.sum::<i64>() as f64 * 1e-9,
            joints: joints.collect(),
        })
    }
}
