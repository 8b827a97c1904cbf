//! The smallest effect of each kind that would have been found.

use std::collections::BTreeMap;

use tauscope_dynamics::terms::{Layer, PlaceKind};

use crate::data::column::Column;
use crate::fit::fitted::Fit;
use crate::read::input::Input;
use crate::report::schema::Undetectable;
use crate::select::evidence::{LEAST_EVIDENCE, LEAST_SIZE};
use crate::select::explanation::Explanation;
use crate::select::grid::shapes;
use crate::select::propose::Base;
use crate::select::search::Search;

/// The smallest effects with one factor that would have been found, for each joint and the tool.
pub fn undetectable(
    search: &Search<'_>,
    found: &Explanation,
    input: &Input,
    joints: &[String],
) -> Vec<Undetectable> {
    // Nobody knows what a joint's current is in N m; a body weighs the same in any unit.
    let in_amperes = input.effort_unit == "A" && input.torque_constants_nm_per_a.is_none();
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
        let Some(smallest) = smallest(
            search,
            &found.fit,
            column,
            base.penalty(1, hypothesis.only_joint()),
        ) else {
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
        all.push(Undetectable {
            effect: hypothesis.effect.name.to_owned(),
            joint,
            link,
            smallest_findable: BTreeMap::from([(told_as.to_owned(), smallest)]),
            in_amperes: in_amperes && hypothesis.effect.layer != Layer::Body,
        });
    }
    all
}

/// The smallest factor of a column at which both evidence and size are sufficient.
fn smallest(search: &Search<'_>, fit: &Fit, column: &Column, penalty: f64) -> Option<f64> {
    let problem = search.problem;
    let (mut information, mut share) = (0.0, 0.0_f64);
    for j in 0..problem.joints {
        let Some(values) = column.of_joint(j, problem.rows) else {
            continue;
        };
        let weight = &problem.weight[problem.joint_rows(j)];
        let square: f64 = values.iter().zip(weight).map(|(v, w)| w * v * v).sum();
        information += square / fit.variance[j];
        share = share.max(square / fit.variance[j] / fit.count[j].max(1.0));
    }
    if information <= 0.0 {
        return None;
    }
    let by_evidence = (2.0 * (LEAST_EVIDENCE + penalty) / information).sqrt();
    let by_size = (LEAST_SIZE / share).sqrt();
    Some(by_evidence.max(by_size))
}
