//! Explanations: a fit, the penalties of its effects, and the evidence for one explanation over another.

use crate::fit::fitted::Fit;
use crate::physics::active::Hypothesis;

/// A fit and the penalties of its effects.
#[derive(Debug, Clone)]
pub struct Explanation {
    /// The fit.
    pub fit: Fit,
    /// Penalty by effect \[nats\].
    pub penalties: Vec<f64>,
}

impl Explanation {
    /// Evidence for this explanation over another \[nats\], with rows weighted by `effective`, the independent samples
    /// per row of each joint.
    pub fn ahead_of(&self, other: &Self, effective: &[f64]) -> f64 {
        let penalty = |e: &Self| e.penalties.iter().sum::<f64>();
        self.fit.gain_over(&other.fit, effective) - penalty(self) + penalty(other)
    }
}

/// An effect of an explanation: its hypothesis, and how many of the same hypothesis come before it.
pub type Piece = (Hypothesis, usize);

/// The effects of an explanation without torque scales.
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

/// Index of a piece in an explanation, if it is still there.
pub fn place_of(explanation: &Explanation, (hypothesis, alike_before): Piece) -> Option<usize> {
    let actives = explanation.fit.actives.iter().enumerate();
    let mut alike = actives.filter(|(_, a)| a.hypothesis == hypothesis);
    alike.nth(alike_before).map(|(index, _)| index)
}

/// How far an explanation has come, for the progress that people see.
pub fn describe(explanation: &Explanation) -> String {
    let effects = explanation.fit.actives.iter().map(|a| a.hypothesis);
    let effects: Vec<Hypothesis> = effects.filter(|h| !h.is_torque_scale()).collect();
    match effects.as_slice() {
        [] => "looking for what is missing".to_owned(),
        [only] => format!("1 effect: {}", only.effect.words.title),
        [.., last] => format!(
            "{} effects, the last: {}",
            effects.len(),
            last.effect.words.title
        ),
    }
}

/// That an effect of an explanation is not needed, for the progress that people see.
pub fn left_out(explanation: &Explanation, index: usize) -> String {
    let active = explanation.fit.actives.get(index);
    let title = active.map_or("an effect", |active| active.hypothesis.effect.words.title);
    format!("{title} is not needed")
}
