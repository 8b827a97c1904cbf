//! Friction that is more or less than a twin says: told beside it, kept with it.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Against, Effect, Layer, PlaceKind, TermSpec};

use crate::data::problem::Problem;
use crate::physics::active::Hypothesis;
use crate::physics::parameter_units::is_of_effort;

/// The plain friction that an effect is or contains, with the parameters of it that grow as that does.
fn contained(effect: &'static Effect) -> Option<(&'static Effect, Vec<&'static str>)> {
    if effect.is_plain_friction() {
        return Some((effect, effect.parameters.iter().map(|p| p.name).collect()));
    }
    let simpler = effect.simpler?;
    let plain = simpler.effect.is_plain_friction();
    plain.then(|| (simpler.effect, simpler.numbers.to_vec()))
}

/// The plain friction that a term holds, by its name, and how much of it.
pub fn of(term: &TermSpec) -> Option<(&'static str, f64)> {
    let (plain, numbers) = contained(term.effect().ok()?)?;
    let values = numbers
        .into_iter()
        .filter_map(|name| term.parameters.get(name).copied());
    Some((plain.name, values.reduce(f64::min)?))
}

/// Adds a new term to those of a twin: more or less of a friction that one of them holds to that one, else as one more.
pub fn add(term: TermSpec, to: &mut Vec<TermSpec>) {
    if let Ok(plain) = term.effect()
        && plain.is_plain_friction()
        && let Some(more) = plain
            .parameters
            .first()
            .and_then(|p| term.parameters.get(p.name))
    {
        for old in to.iter_mut().filter(|old| old.joint == term.joint) {
            let held = old.effect().ok().and_then(contained);
            if let Some((_, numbers)) = held.filter(|(held, _)| *held == plain) {
                for name in numbers {
                    let value = old.parameters.entry(name.to_owned()).or_default();
                    *value = (*value + more).max(0.0);
                }
                return;
            }
        }
    }
    to.push(term);
}

/// A term told in N m, in the units that the recordings are in, by joint \[N m per recorded unit\].
pub fn in_recorded_units(term: &TermSpec, model: &Model, units_nm: &[f64]) -> TermSpec {
    let mut term = term.clone();
    let at = |name: &Option<String>| name.as_ref().and_then(|name| model.joint_index(name));
    let Ok(effect) = term.effect() else {
        return term;
    };
    let Some(joint) = at(&term.joint).filter(|_| effect.layer != Layer::Body) else {
        return term;
    };
    for (name, value) in &mut term.parameters {
        if is_of_effort(name) {
            *value /= units_nm[joint];
        }
    }
    if effect.place == PlaceKind::TwoJoints
        && let Some(source) = at(&term.source_joint)
        && let Some(coefficient) = term.parameters.get_mut("coefficient")
    {
        *coefficient *= units_nm[source] / units_nm[joint];
    }
    if let Some(table) = &mut term.table {
        let of_joint = at(&table.of_joint).unwrap_or(joint);
        for value in &mut table.values {
            *value /= units_nm[joint];
        }
        if table.against == Against::Load {
            for knot in &mut table.knots {
                *knot /= units_nm[of_joint];
            }
        }
    }
    term
}

/// The least that a factor of a hypothesis may be: a friction that the twin has already may be less.
pub fn least(problem: &Problem, hypothesis: Hypothesis, minimum: f64) -> f64 {
    let known = &problem.known_friction[hypothesis.place.joint];
    minimum - known.get(hypothesis.effect.name).copied().unwrap_or(0.0)
}
