//! Positions that jump: steps between two samples that the recorded velocity does not explain, as an encoder makes
//! them that loses count, or a position that wraps after a whole turn.

use std::f64::consts::TAU;

use serde::Serialize;

/// Longer steps are not judged \[ns\].
/// Physical: in 50 ms a velocity that changes by 10 rad/s² between two samples misses the step by 2 mrad.
const LONGEST_STEP_NS: i64 = 50_000_000;
/// Smaller steps are no jumps \[rad or m\].
/// Physical: fifty steps of a coarse encoder of 6000 steps per turn.
const SMALLEST: f64 = 0.05;
/// A jump is so many times as large as what the velocity misses other steps by, on average.
/// Physical: positions in degrees miss by about the speed at every step, a jump stands alone.
const TIMES: f64 = 20.0;
/// Jumps that are kept at most.
/// Resolution: memory; more of them are a fault of another kind.
const KEPT: usize = 8;
/// A jump back within this time belongs to the one before \[ns\].
/// Physical: an encoder's glitch lasts for some samples.
const BACK_NS: i64 = 500_000_000;
/// Two jumps of opposite sign and a whole turn are recognised to this share.
/// Physical: what an arm moves beside the jump.
const ALIKE: f64 = 0.1;
/// See [`ALIKE`].
const LIKE_A_TURN: f64 = 0.02;

/// A jump of a position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Jump {
    /// From the first message of the topic to the first sample behind the jump \[s\].
    pub at_s: f64,
    /// What the position changes by beyond what the velocity explains \[rad or m\].
    pub by: f64,
    /// After this time it jumps back \[s\]; `None` if it stays there.
    pub lasts_s: Option<f64>,
}

impl Jump {
    /// Where it is and how large.
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

/// What a span of the comparison of position and velocity adds to its sums.
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

/// The suspects of one joint, with memory for some.
#[derive(Debug, Default)]
pub(super) struct Jumps {
    /// What the velocity misses a step by, and the stamp of the sample behind it; the largest first.
    suspects: Vec<(f64, i64)>,
    /// Suspects that there was no room for.
    further: u64,
    /// Spans that hold suspects, with the largest miss in each; the largest first.
    spans: Vec<(f64, Span)>,
    /// The largest miss in the span that goes on, if that is a suspect.
    in_span: Option<f64>,
    /// Sum of the misses of all steps, and their number.
    missed: f64,
    steps: u64,
}

impl Jumps {
    /// Takes a step that took `step_ns` up to `stamp_ns`, and which the velocity misses by `miss` \[rad or m\].
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

    /// A span has ended: gives what of it, or of those before, may be added to the sums for good.
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

    /// The comparison begins anew.
    pub fn begin_span(&mut self) {
        self.in_span = None;
    }

    /// From which miss on a step is a jump \[rad or m\].
    fn least(&self) -> f64 {
        let of_suspects: f64 = self.suspects.iter().map(|(miss, _)| miss.abs()).sum();
        let others = self.steps - self.suspects.len() as u64;
        let usual = (self.missed - of_suspects).max(0.0) / others.max(1) as f64;
        SMALLEST.max(TIMES * usual)
    }

    /// What spans without a jump add to the sums.
    pub fn without_jump(&self) -> Span {
        let least = self.least();
        let mut sum = Span::default();
        for (_, span) in self.spans.iter().filter(|(largest, _)| *largest < least) {
            sum.add(span);
        }
        sum
    }

    /// The jumps in their order, times from `first_ns` on, and whether there are more of them.
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
