//! A fit and the evidence for it.

use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};

/// A fit and the evidence for it, all penalties counted.
#[derive(Debug, Clone)]
pub struct Explanation {
    /// The fit.
    pub fit: Fit,
    /// Penalty by active.
    pub penalties: Vec<f64>,
}

impl Explanation {
    /// Evidence for this rather than another \[nats\], rows weighted by `effective`, the independent samples per row of each joint.
    pub fn ahead_of(&self, other: &Self, effective: &[f64]) -> f64 {
        let penalty = |e: &Self| e.penalties.iter().sum::<f64>();
        self.fit.gain_over(&other.fit, effective) - penalty(self) + penalty(other)
    }
}

/// A piece of physics: a hypothesis, and the how-manieth of its kind it is.
pub type Piece = (Hypothesis, usize);

/// The pieces of an explanation, torque scales left out.
pub fn pieces(explanation: &Explanation) -> Vec<Piece> {
    let all: Vec<Hypothesis> = explanation
        .fit
        .actives
        .iter()
        .map(|a| a.hypothesis)
        .collect();
    let alike_before = |i: usize| all[..i].iter().filter(|h| **h == all[i]).count();
    let numbered = (0..all.len()).map(|i| (all[i], alike_before(i)));
    numbered.filter(|(h, _)| !h.is_torque_scale()).collect()
}

/// Where a piece is in an explanation, if it still is.
pub fn place_of(explanation: &Explanation, (hypothesis, alike_before): Piece) -> Option<usize> {
    let actives = explanation.fit.actives.iter().enumerate();
    let mut alike = actives.filter(|(_, a)| a.hypothesis == hypothesis);
    alike.nth(alike_before).map(|(index, _)| index)
}

/// An explanation in a line, for progress.
pub fn describe(explanation: &Explanation) -> String {
    let one = |active: &Active| {
        let place = active.hypothesis.place;
        let values: Vec<String> = active
            .coordinates
            .iter()
            .map(|v| format!("{v:.4}"))
            .collect();
        format!(
            "{}@{}/{}/{} [{}]",
            active.hypothesis.effect.name,
            place.joint,
            place.source,
            place.link,
            values.join(", ")
        )
    };
    let all: Vec<String> = explanation.fit.actives.iter().map(one).collect();
    all.join("; ")
}
