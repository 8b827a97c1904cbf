//! The smallest effect of each kind that would have been found.

use std::collections::BTreeMap;

use tauscope_dynamics::terms::{Layer, PlaceKind};

use crate::context::Context;
use crate::data::column::Column;
use crate::physics::active::Hypothesis;
use crate::report::schema::Undetectable;
use crate::select::evidence::{LEAST_EVIDENCE, LEAST_SIZE};
use crate::select::explanation::Explanation;
use crate::select::grid::shapes;
use crate::select::propose::Base;
use crate::select::prune::HIDDEN;
use crate::select::search::Search;

/// The smallest effects with one factor that would have been found, for each joint and the tool.
pub fn undetectable(
    search: &Search<'_>,
    found: &Explanation,
    context: &Context<'_>,
    joints: &[String],
) -> Vec<Undetectable> {
    let base = Base::new(search.problem, &found.fit, search.hypotheses.len());
    let mut all = Vec::new();
    for hypothesis in search.hypotheses {
        let Some(told_as) = hypothesis.effect.traits.smallest_told_as else {
            continue;
        };
        let there = found
            .fit
            .actives
            .iter()
            .any(|a| a.hypothesis == *hypothesis);
        if there {
            continue;
        }
        let Some(shape) = shapes(search.problem, *hypothesis).into_iter().next() else {
            continue;
        };
        let columns = found.fit.columns(search.problem, *hypothesis, &shape);
        let Some(column) = columns.factors.first() else {
            continue;
        };
        let Some(smallest) = smallest(&base, *hypothesis, column) else {
            continue;
        };
        let joint = matches!(hypothesis.effect.place, PlaceKind::Joint)
            .then(|| joints[hypothesis.place.joint].clone());
        let link =
            matches!(hypothesis.effect.place, PlaceKind::Tool | PlaceKind::Link).then(|| {
                search.problem.model.links()[hypothesis.place.link]
                    .name
                    .clone()
            });
        // Nobody knows what a joint's current is in N m; a body weighs the same in any unit.
        let is_unknown = |(joint, _): &(usize, f64)| *joint == hypothesis.place.joint;
        let in_amperes =
            hypothesis.effect.layer != Layer::Body && context.unscaled.iter().any(is_unknown);
        all.push(Undetectable {
            effect: hypothesis.effect.name.to_owned(),
            joint,
            link,
            smallest_findable: BTreeMap::from([(told_as.to_owned(), smallest)]),
            in_amperes,
            slides: hypothesis.slides(&search.problem.model),
        });
    }
    all
}

/// The smallest factor of a column that would have been found: its evidence and its size beside what the fit left are
/// sufficient, after the fit's own columns have taken their share of it, and the measurement's noise does not hide it.
fn smallest(base: &Base<'_>, hypothesis: Hypothesis, column: &Column) -> Option<f64> {
    let (problem, fit) = (base.problem, base.fit);
    let lasts = hypothesis.lasts();
    let (mut information, mut share, mut seen) = (0.0, 0.0_f64, 0.0_f64);
    for (j, square) in base.squares_beside(column)?.into_iter().enumerate() {
        let of_row = square / fit.count[j].max(1.0);
        information += problem.effective_samples[j] * square / fit.variance[j];
        share = share.max(of_row / fit.variance[j]);
        seen = seen.max(of_row.sqrt() / problem.unfiltered_noise[j].max(f64::MIN_POSITIVE));
    }
    if information <= 0.0 {
        return None;
    }
    let penalty = base.penalty(1, hypothesis.only_joint());
    let by_evidence = (2.0 * (LEAST_EVIDENCE + penalty) / information).sqrt();
    let by_size = (LEAST_SIZE / share).sqrt();
    let by_noise = if lasts { HIDDEN / seen } else { 0.0 };
    Some(by_evidence.max(by_size).max(by_noise))
}
