//! The smallest effect of each kind that would have been found.

use std::collections::BTreeMap;

use tauscope_dynamics::terms::{Layer, PlaceKind};

use super::place_of;
use crate::context::Context;
use crate::physics::active::Hypothesis;
use crate::report::schema::Undetectable;

/// The smallest effects of the kinds that a reader asks for, for each joint and the tool. `smallest` is the first factor of
/// each hypothesis that would have been found.
pub fn undetectable(
    smallest: &[(Hypothesis, f64)],
    context: &Context<'_>,
    joints: &[String],
) -> Vec<Undetectable> {
    let of = |(hypothesis, factor): &(Hypothesis, f64)| {
        let told_as = hypothesis.effect.traits.smallest_told_as?;
        let (joint, link) = place_of(context.input, joints, hypothesis);
        // Nobody knows what a joint's current is in N m; a body weighs the same in any unit.
        let is_unknown = |(joint, _): &(usize, f64)| *joint == hypothesis.place.joint;
        let is_of_joint = matches!(hypothesis.effect.place, PlaceKind::Joint);
        Some(Undetectable {
            effect: hypothesis.effect.name.to_owned(),
            joint: joint.filter(|_| is_of_joint),
            link,
            smallest_findable: BTreeMap::from([(told_as.to_owned(), *factor)]),
            in_amperes: hypothesis.effect.layer != Layer::Body
                && context.unscaled.iter().any(is_unknown),
            slides: hypothesis.slides(&context.input.model),
        })
    };
    smallest.iter().filter_map(of).collect()
}
