//! Friction that is more or less than a twin says: told beside it, kept with it.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Against, Layer, PlaceKind, TermSpec};

use crate::data::problem::Problem;
use crate::physics::active::Hypothesis;
use crate::physics::parameter_units::is_of_effort;

/// A plain friction, and which effects hold it.
struct Plain {
    effect: &'static str,
    number: &'static str,
    /// Effects with the numbers of theirs that are more by as much as it is.
    held_by: &'static [(&'static str, &'static [&'static str])],
}

/// Coulomb and viscous friction.
const PLAIN: [Plain; 2] = [
    Plain {
        effect: "coulomb_friction",
        number: "coulomb_nm",
        held_by: &[
            ("coulomb_friction", &["coulomb_nm"]),
            ("stribeck_friction", &["coulomb_nm", "static_nm"]),
            (
                "asymmetric_coulomb",
                &["coulomb_positive_nm", "coulomb_negative_nm"],
            ),
            ("presliding_hysteresis", &["coulomb_nm"]),
            ("friction_step", &["coulomb_after_nm", "coulomb_before_nm"]),
        ],
    },
    Plain {
        effect: "viscous_friction",
        number: "viscous_nms_per_rad",
        held_by: &[
            ("viscous_friction", &["viscous_nms_per_rad"]),
            ("temperature_viscous", &["viscous_warm_nms_per_rad"]),
        ],
    },
];

/// Which of the plain frictions an effect is, Coulomb 0 and viscous 1.
pub fn plain(effect: &str) -> Option<usize> {
    PLAIN.iter().position(|plain| plain.effect == effect)
}

/// Coulomb and viscous friction that a term holds.
pub fn of(term: &TermSpec) -> [f64; 2] {
    PLAIN.map(|plain| {
        let own = plain
            .held_by
            .iter()
            .find(|(effect, _)| *effect == term.effect);
        let values = own.into_iter().flat_map(|(_, names)| *names);
        let values = values.filter_map(|name| term.parameters.get(*name).copied());
        values.reduce(f64::min).unwrap_or(0.0)
    })
}

/// Adds a new term to those of a twin: more or less of a friction that one of them holds to that one, else as one more.
pub fn add(term: TermSpec, to: &mut Vec<TermSpec>) {
    if let Some(plain) = plain(&term.effect).map(|which| &PLAIN[which])
        && let Some(more) = term.parameters.get(plain.number)
    {
        for old in to.iter_mut().filter(|old| old.joint == term.joint) {
            if let Some((_, names)) = plain
                .held_by
                .iter()
                .find(|(effect, _)| *effect == old.effect)
            {
                for name in *names {
                    let value = old.parameters.entry((*name).to_owned()).or_default();
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
    plain(hypothesis.effect.name).map_or(minimum, |which| {
        minimum - problem.known_friction[hypothesis.place.joint][which]
    })
}
