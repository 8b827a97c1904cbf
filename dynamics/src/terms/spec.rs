//! Terms in files.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::table::{self, TableSpec};
use super::{EFFECTS, Effect, PlaceKind, Site, Term, Time, effect};
use crate::Model;

mod error;

pub use error::TermError;

/// A term in a file: `{effect: viscous_friction, joint: joint1, parameters: {viscous_nms_per_rad: 3.0}}`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TermSpec {
    /// Canonical name of the effect.
    pub effect: String,
    /// The joint, for effects of a joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// The link, for effects of a link. Optional for effects of the tool (default: the link `tool`, or else the last
    /// of the chain) and of the base (default: the root).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The joint that drives it, for couplings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_joint: Option<String>,
    /// Its parameters by canonical name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, f64>,
    /// The curve of an `unknown` effect, which has no other parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<TableSpec>,
}

impl TermSpec {
    /// The spec of a term that was built at this site.
    pub fn of(term: &dyn Term, site: &Site<'_>) -> Self {
        let effect = term.effect();
        let joint = |index: usize| Some(site.model.joints()[index].name.clone());
        let link = |index: usize| Some(site.model.links()[index].name.clone());
        let (mut at_joint, mut at_link, mut source_joint) = (None, None, None);
        match effect.place {
            PlaceKind::Joint => at_joint = joint(site.joint),
            PlaceKind::TwoJoints => {
                at_joint = joint(site.joint);
                source_joint = joint(site.source);
            }
            PlaceKind::Link | PlaceKind::Tool => at_link = link(site.link),
            PlaceKind::Base => at_link = link(site.model.base_link()),
            PlaceKind::All => {}
        }
        let values = (effect.to_parameters)(term.coordinates());
        let named = effect.parameters.iter().zip(values);
        Self {
            effect: effect.name.to_owned(),
            joint: at_joint,
            link: at_link,
            source_joint,
            parameters: named.map(|(p, value)| (p.name.to_owned(), value)).collect(),
            table: term.table().map(|table| TableSpec::of(table, site.model)),
        }
    }

    /// Builds the term for a robot.
    ///
    /// # Errors
    /// If the effect, its place or a parameter is unknown, a place or parameter is missing, or a value is impossible.
    pub fn build(&self, model: &Model) -> Result<Box<dyn Term>, TermError> {
        let effect = self.effect()?;
        let site = self.site(model)?;
        for (name, &value) in &self.parameters {
            effect.check(name, value)?;
        }
        if effect.name == table::EFFECT.name {
            return self.build_table(&site);
        }
        if self.table.is_some() {
            return Err(TermError::NoTable {
                effect: effect.name,
            });
        }
        let value = |parameter: &super::Parameter| {
            let given = self.parameters.get(parameter.name).copied();
            given
                .or(parameter.default)
                .ok_or(TermError::MissingParameter {
                    effect: effect.name,
                    parameter: parameter.name,
                })
        };
        let values = effect.parameters.iter().map(value);
        let values = values.collect::<Result<Vec<_>, _>>()?;
        let coordinates = (effect.to_coordinates)(&values);
        Ok((effect.build)(&site, &coordinates))
    }

    /// The term for a session that begins now: for a step, the simpler effect with its value after the step.
    #[must_use]
    pub fn from_now_on(&self) -> Self {
        let known = self.effect().ok().filter(|e| e.time() == Time::Step);
        let afterwards = known.and_then(|effect| {
            let simpler = effect.simpler?;
            let value = *self.parameters.get(*simpler.numbers.first()?)?;
            let value = *(simpler.effect.to_parameters)(&[value]).first()?;
            let number = simpler.effect.parameters.first()?.name;
            Some(Self {
                effect: simpler.effect.name.to_owned(),
                parameters: BTreeMap::from([(number.to_owned(), value)]),
                ..self.clone()
            })
        });
        afterwards.unwrap_or_else(|| self.clone())
    }

    /// A payload of a part of the session as a permanent one, if it is present at this time.
    fn without_times(self, session_s: f64) -> Self {
        let time = |name: &str| self.parameters.get(name).copied();
        let is_there = time("t_start_s").is_some_and(|start_s| start_s <= session_s)
            && time("t_end_s").is_some_and(|end_s| session_s < end_s);
        if !is_there {
            return self;
        }
        let mut parameters = self.parameters;
        parameters.retain(|name, _| !name.starts_with("t_"));
        Self {
            effect: super::payload::EFFECT.name.to_owned(),
            parameters,
            ..self
        }
    }

    /// The term at a time of its session: for a continuous change, the simpler effect with its value at that time;
    /// for a part of a session, the permanent effect, if it is present at that time.
    #[must_use]
    pub fn at_session(self, session_s: f64) -> Self {
        if self.effect().is_ok_and(|e| e.traits.in_session) {
            return self.without_times(session_s);
        }
        let settled = self.effect().ok().and_then(|effect| {
            let (at, simpler) = (effect.traits.drifts?, effect.simpler?.effect);
            let value = |p: &super::Parameter| self.parameters.get(p.name).copied();
            let values = effect.parameters.iter().map(value);
            let values = values.collect::<Option<Vec<f64>>>()?;
            let parameter = simpler.parameters.first()?;
            let number = at(&(effect.to_coordinates)(&values), session_s);
            Some((simpler.name, parameter.name, number.max(parameter.minimum)))
        });
        let Some((effect, parameter, number)) = settled else {
            return self;
        };
        Self {
            effect: effect.to_owned(),
            parameters: BTreeMap::from([(parameter.to_owned(), number)]),
            ..self
        }
    }

    /// The effect with the spec's name.
    ///
    /// # Errors
    /// If the effect does not exist.
    pub fn effect(&self) -> Result<&'static Effect, TermError> {
        effect(&self.effect).ok_or_else(|| TermError::UnknownEffect {
            effect: self.effect.clone(),
            known: list(EFFECTS.iter().map(|effect| effect.name)),
        })
    }

    /// The site of the spec in this robot.
    ///
    /// # Errors
    /// If the effect or a joint or link is unknown, or one is missing.
    pub fn site<'m>(&self, model: &'m Model) -> Result<Site<'m>, TermError> {
        let effect = self.effect()?;
        let joint = |name: &Option<String>, key| match name {
            Some(name) => model
                .joint_index(name)
                .ok_or_else(|| TermError::UnknownJoint {
                    effect: effect.name,
                    joint: name.clone(),
                    known: list(model.joint_names()),
                }),
            None => Err(TermError::MissingPlace {
                effect: effect.name,
                key,
            }),
        };
        let link = || match &self.link {
            Some(name) => {
                let index = model
                    .link_index(name)
                    .ok_or_else(|| TermError::UnknownLink {
                        effect: effect.name,
                        link: name.clone(),
                        known: list(model.links().iter().map(|link| link.name.as_str())),
                    });
                index.map(Some)
            }
            None => Ok(None),
        };
        let mut site = Site {
            model,
            joint: 0,
            source: 0,
            link: 0,
        };
        match effect.place {
            PlaceKind::Joint => site.joint = joint(&self.joint, "joint")?,
            PlaceKind::TwoJoints => {
                site.joint = joint(&self.joint, "joint")?;
                site.source = joint(&self.source_joint, "source_joint")?;
            }
            PlaceKind::Link => {
                site.link = link()?.ok_or(TermError::MissingPlace {
                    effect: effect.name,
                    key: "link",
                })?;
            }
            PlaceKind::Tool => site.link = link()?.unwrap_or_else(|| model.tool_link()),
            PlaceKind::Base => site.link = link()?.unwrap_or_else(|| model.base_link()),
            PlaceKind::All => {}
        }
        Ok(site)
    }

    fn build_table(&self, site: &Site<'_>) -> Result<Box<dyn Term>, TermError> {
        let Some(spec) = &self.table else {
            return Err(TermError::MissingTable {
                effect: table::EFFECT.name,
            });
        };
        let of_joint = match &spec.of_joint {
            None => site.joint,
            Some(name) => site
                .model
                .joint_index(name)
                .ok_or_else(|| TermError::UnknownJoint {
                    effect: table::EFFECT.name,
                    joint: name.clone(),
                    known: list(site.model.joint_names()),
                })?,
        };
        super::table(site, spec.table(of_joint))
    }
}

impl Effect {
    /// Index of a parameter, after checking its value.
    ///
    /// # Errors
    /// If the parameter does not exist or the value is impossible.
    pub fn check(&self, parameter: &str, value: f64) -> Result<usize, TermError> {
        let found = self.parameters.iter().position(|p| p.name == parameter);
        let Some(index) = found else {
            return Err(TermError::UnknownParameter {
                effect: self.name,
                parameter: parameter.to_owned(),
                known: list(self.parameters.iter().map(|known| known.name)),
            });
        };
        let known = &self.parameters[index];
        // Relative to a twin that already contains the effect, a term may reduce it.
        let minimum = match self.words.less {
            Some(_) if index == 0 => f64::NEG_INFINITY,
            _ => known.minimum,
        };
        if !(value.is_finite() && value >= minimum) {
            return Err(TermError::OutOfRange {
                effect: self.name,
                parameter: known.name,
                value,
                expected: match minimum {
                    f64::NEG_INFINITY => "a number".to_owned(),
                    minimum => format!("a number of at least {minimum}"),
                },
            });
        }
        Ok(index)
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints() -> Model {
        Model::massless(&["joint1".to_owned(), "joint2".to_owned()])
    }

    fn spec(json: &str) -> TermSpec {
        serde_json::from_str(json).unwrap()
    }

    const VISCOUS: &str = r#"{"effect":"viscous_friction","joint":"joint2","parameters":{"viscous_nms_per_rad":3.0}}"#;

    #[test]
    fn a_spec_becomes_a_term_and_a_spec_again() {
        let model = joints();
        let spec = spec(VISCOUS);
        let term = spec.build(&model).unwrap();
        assert_eq!(term.coordinates(), [3.0]);
        let again = TermSpec::of(&*term, &spec.site(&model).unwrap());
        assert_eq!(serde_json::to_string(&again).unwrap(), VISCOUS);
    }

    #[test]
    fn what_changes_steadily_is_what_it_was_at_the_end() {
        let drift = r#"{"effect":"friction_drift","joint":"joint2","parameters":{"coulomb_start_nm":2.0,"growth_nm_per_s":-0.01}}"#;
        let coulomb =
            r#"{"effect":"coulomb_friction","joint":"joint2","parameters":{"coulomb_nm":1.0}}"#;
        assert_eq!(spec(drift).at_session(100.0), spec(coulomb));
        assert_eq!(spec(VISCOUS).at_session(100.0), spec(VISCOUS));
    }

    #[test]
    fn what_was_picked_up_and_kept_is_a_payload_from_then_on() {
        let carried = |from_s: f64, to_s: f64| {
            let text = format!(
                r#"{{"effect": "payload_in_session", "link": "tool", "parameters":
                {{"mass_kg": 2.0, "t_start_s": {from_s:?}, "t_end_s": {to_s:?}}}}}"#
            );
            spec(&text)
        };
        let payload = r#"{"effect": "payload", "link": "tool", "parameters": {"mass_kg": 2.0}}"#;
        assert_eq!(carried(50.0, 1e6).at_session(100.0), spec(payload));
        assert_eq!(carried(-1e6, 50.0).at_session(100.0), carried(-1e6, 50.0));
    }

    #[test]
    fn less_friction_than_the_twin_has_is_a_term() {
        let less = spec(&VISCOUS.replace("3.0", "-3.0"));
        assert_eq!(less.build(&joints()).unwrap().coordinates(), [-3.0]);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let message = |json: &str| spec(json).build(&joints()).unwrap_err().to_string();
        for (from, to, expected) in [
            (
                "joint2",
                "joint7",
                "`viscous_friction` names joint `joint7`, which the robot does not have; its joints: joint1, joint2",
            ),
            (
                r#""joint":"joint2","#,
                "",
                "`viscous_friction` needs the key `joint`",
            ),
            (
                "viscous_nms_per_rad",
                "coulomb_nm",
                "`viscous_friction` has no parameter `coulomb_nm`; it has: viscous_nms_per_rad",
            ),
            (
                "\"viscous_nms_per_rad\":3.0",
                "",
                "`viscous_friction` needs the parameter `viscous_nms_per_rad`",
            ),
        ] {
            assert_eq!(message(&VISCOUS.replace(from, to)), expected);
        }
        let drag = r#"{"effect":"quadratic_drag","joint":"joint1","parameters":{"drag_nms2_per_rad2":-3.0}}"#;
        assert_eq!(
            message(drag),
            "`drag_nms2_per_rad2` of `quadratic_drag` is -3, it must be a number of at least 0"
        );
        let unknown = message(&VISCOUS.replace("viscous_friction", "viscous"));
        assert!(unknown.starts_with("there is no effect `viscous`; known are: "));
    }
}
