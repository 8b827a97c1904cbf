//! The motion that would tell apart what this data cannot.

use tauscope_dynamics::terms::PlaceKind;

use crate::active::Hypothesis;
use crate::explain::Input;
use crate::report::{NextMotion, Rival};

/// What to record next, for a finding with rivals that tie.
pub fn of(winner: &Hypothesis, ties: &[Hypothesis], input: &Input, joints: &[String]) -> Option<NextMotion> {
    if ties.is_empty() {
        return None;
    }
    let rival = |h: &Hypothesis| Rival {
        effect: h.effect.name.to_owned(),
        joint: matches!(h.effect.place, PlaceKind::Joint | PlaceKind::TwoJoints)
            .then(|| joints[h.place.joint].clone()),
        link: matches!(h.effect.place, PlaceKind::Link | PlaceKind::Tool)
            .then(|| input.model.links()[h.place.link].name.clone()),
    };
    let separates: Vec<Rival> = std::iter::once(winner).chain(ties).map(rival).collect();
    let joint = &joints[winner.place.joint];
    let sentence = format!("Move joint {joint} over its whole range, slowly and fast, with the arm stretched and folded.");
    Some(NextMotion {
        separates,
        sentence,
        trajectory: None,
    })
}
