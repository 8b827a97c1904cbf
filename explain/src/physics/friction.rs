//! Friction and rotors that differ from the twin's: reported as a difference, stored as a sum.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Effect, Layer, PlaceKind, TermSpec};

use crate::data::problem::Problem;
use crate::physics::active::Hypothesis;
use crate::physics::parameter_units::power_of_effort;

/// The plain friction or the rotor that an effect is or contains, and the effect's parameters that are proportional to it.
fn contained(effect: &'static Effect) -> Option<(&'static Effect, Vec<&'static str>)> {
    if effect.may_be_overstated() {
        return Some((effect, effect.parameters.iter().map(|p| p.name).collect()));
    }
    let simpler = effect.simpler?;
    let plain = simpler.effect.may_be_overstated();
    plain.then(|| (simpler.effect, simpler.numbers.to_vec()))
}

/// The plain friction or the rotor that a term contains: its name and its value.
pub fn of(term: &TermSpec) -> Option<(&'static str, f64)> {
    let (plain, numbers) = contained(term.effect().ok()?)?;
    let values = numbers
        .into_iter()
        .filter_map(|name| term.parameters.get(name).copied());
    Some((plain.name, values.reduce(f64::min)?))
}

/// Adds a new term to those of a twin. Plain friction or a rotor is added to the term of the same joint that contains it already, if
/// there is one.
pub fn add(term: TermSpec, to: &mut Vec<TermSpec>) {
    if let Ok(plain) = term.effect()
        && plain.may_be_overstated()
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

/// Converts a term from N m into the recordings' units; `units_nm` are N m per recorded unit, by joint.
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
        *value *= units_nm[joint].powi(-power_of_effort(name));
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
        if table.against.is_of_load() {
            for knot in &mut table.knots {
                *knot /= units_nm[of_joint];
            }
        }
    }
    term
}

/// Lowest value of a hypothesis' factor. Friction that the twin has already may be reduced to zero.
pub fn least(problem: &Problem, hypothesis: Hypothesis, minimum: f64) -> f64 {
    let known = &problem.known_friction[hypothesis.place.joint];
    minimum - known.get(hypothesis.effect.name).copied().unwrap_or(0.0)
}
