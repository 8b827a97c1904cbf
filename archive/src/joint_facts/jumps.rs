//! Detection of position jumps: changes between two samples that the recorded velocity does not explain. They occur
//! if an encoder loses counts, or if a position wraps after a full turn.

use std::f64::consts::TAU;

use serde::Serialize;

/// Longest time between two samples in which a jump is detected \[ns\].
/// Physical: if the acceleration changes by Δa = 10 rad/s² within h = 50 ms, the trapezoidal integral of the velocity
/// is wrong by h² Δa / 12 = 2 mrad.
const LONGEST_STEP_NS: i64 = 50_000_000;
/// Smallest residual of a jump \[rad or m\].
/// Physical: fifty counts of a coarse encoder with 6000 counts per turn.
const SMALLEST: f64 = 0.05;
/// Smallest ratio of the residual of a jump to the mean residual of the other steps.
/// Physical: with positions in degrees, every step has a residual of about the speed, while a jump is isolated.
const TIMES: f64 = 20.0;
/// Maximum number of jumps kept.
/// Resolution: bounds memory; more jumps indicate a fault of another kind.
const KEPT: usize = 8;
/// Longest time between a jump and the jump back \[ns\].
/// Physical: a glitch of an encoder lasts a few samples.
const BACK_NS: i64 = 500_000_000;
/// Relative tolerance between the sizes of a jump and its return.
/// Physical: covers the motion of the arm during the jump.
const ALIKE: f64 = 0.1;
/// Relative tolerance between a jump and a whole number of turns.
/// Physical: covers the motion of the arm during the jump.
const LIKE_A_TURN: f64 = 0.02;

/// A jump of a position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Jump {
    /// Time of the first sample after the jump, from the first message of the topic \[s\].
    pub at_s: f64,
    /// Residual: change of the position minus the integral of the velocity \[rad or m\].
    pub by: f64,
    /// Time until the position jumps back \[s\]; `None` if it does not.
    pub lasts_s: Option<f64>,
}

impl Jump {
    /// Describes the size and the time of the jump.
    pub fn in_words(&self) -> String {
        let (by, at_s) = (self.by, self.at_s);
        let mut text = format!("by {by:.3} rad or m at {at_s:.3} s");
        if let Some(lasts_s) = self.lasts_s {
            text += &format!(", and back after {lasts_s:.3} s");
        }
        let turns = (by / TAU).round();
        if turns != 0.0 && (by - turns * TAU).abs() < LIKE_A_TURN * by.abs() {
            text += " (a whole turn: it wraps, and is read as one motion)";
        }
        text
    }
}

/// Contribution of one span to the regression of the integrated velocity on the change of position.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Span {
    /// Position change squared.
    pub squares: f64,
    /// Position change times the integral of the velocity.
    pub products: f64,
    /// Position change, absolute.
    pub moved: f64,
}

impl Span {
    pub fn add(&mut self, other: &Self) {
        self.squares += other.squares;
        self.products += other.products;
        self.moved += other.moved;
    }
}

/// Suspected jumps of one joint, at most [`KEPT`].
///
/// The residual of a step is the change of the position minus the integral of the velocity.
#[derive(Debug, Default)]
pub(super) struct Jumps {
    /// Residual of a step and stamp of the sample after it \[ns\], largest first.
    suspects: Vec<(f64, i64)>,
    /// Number of suspects that were dropped.
    further: u64,
    /// Spans with suspects and the largest residual in each, largest first.
    spans: Vec<(f64, Span)>,
    /// Largest residual of the suspects in the current span, if any.
    in_span: Option<f64>,
    /// Sum of the absolute residuals of all steps.
    missed: f64,
    /// Number of steps.
    steps: u64,
}

impl Jumps {
    /// Adds a step of duration `step_ns` that ends at `stamp_ns` and has the residual `miss` \[rad or m\].
    pub fn step(&mut self, stamp_ns: i64, step_ns: i64, miss: f64) {
        if !(1..=LONGEST_STEP_NS).contains(&step_ns) {
            return;
        }
        self.missed += miss.abs();
        self.steps += 1;
        if miss.abs() < SMALLEST {
            return;
        }
        self.in_span = Some(self.in_span.unwrap_or(0.0).max(miss.abs()));
        let rank = (self.suspects).partition_point(|(other, _)| other.abs() >= miss.abs());
        self.suspects.insert(rank, (miss, stamp_ns));
        if self.suspects.len() > KEPT {
            self.suspects.pop();
            self.further += 1;
        }
    }

    /// Ends the current span, and keeps it if it has suspects. Returns the span to add to the sums: this one if it
    /// has no suspects, or the one with the smallest residual if more than [`KEPT`] are kept.
    pub fn end_span(&mut self, span: Span) -> Option<Span> {
        let Some(largest) = self.in_span.take() else {
            return Some(span);
        };
        let rank = (self.spans).partition_point(|(other, _)| *other >= largest);
        self.spans.insert(rank, (largest, span));
        (self.spans.len() > KEPT)
            .then(|| self.spans.pop())
            .flatten()
            .map(|(_, span)| span)
    }

    /// Restarts the comparison with an empty span.
    pub fn begin_span(&mut self) {
        self.in_span = None;
    }

    /// Returns the smallest residual that is a jump \[rad or m\].
    fn least(&self) -> f64 {
        let of_suspects: f64 = self.suspects.iter().map(|(miss, _)| miss.abs()).sum();
        let others = self.steps - self.suspects.len() as u64;
        // The mean excludes the suspects, which could otherwise raise the threshold above themselves.
        let usual = (self.missed - of_suspects).max(0.0) / others.max(1) as f64;
        SMALLEST.max(TIMES * usual)
    }

    /// Returns the sums over the kept spans without a jump.
    pub fn without_jump(&self) -> Span {
        let least = self.least();
        let mut sum = Span::default();
        for (_, span) in self.spans.iter().filter(|(largest, _)| *largest < least) {
            sum.add(span);
        }
        sum
    }

    /// Returns the jumps in the order of time, relative to `first_ns`, and whether some were dropped.
    pub fn found(&self, first_ns: i64) -> (Vec<Jump>, bool) {
        let least = self.least();
        let mut jumps: Vec<(f64, i64)> = self.suspects.clone();
        jumps.retain(|(miss, _)| miss.abs() >= least);
        let more = jumps.len() == KEPT && self.further > 0;
        jumps.sort_by_key(|(_, stamp_ns)| *stamp_ns);
        let mut all: Vec<Jump> = Vec::new();
        let mut open: Option<(f64, i64)> = None;
        for (by, stamp_ns) in jumps {
            let of_before = open.filter(|(before, from_ns)| {
                (before + by).abs() < ALIKE * by.abs() && stamp_ns - from_ns <= BACK_NS
            });
            if let (Some((_, from_ns)), Some(last)) = (of_before, all.last_mut()) {
                last.lasts_s = Some((stamp_ns - from_ns) as f64 * 1e-9);
                open = None;
                continue;
            }
            open = Some((by, stamp_ns));
            all.push(Jump {
                at_s: (stamp_ns - first_ns) as f64 * 1e-9,
                by,
                lasts_s: None,
            });
        }
        (all, more)
    }
}
