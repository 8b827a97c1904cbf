//! The hypotheses for a robot.

use std::collections::{BTreeMap, BTreeSet};

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{EFFECTS, Effect, PlaceKind, UNKNOWN};

use crate::physics::active::{Hypothesis, Whereabouts};

/// Returns plain friction of a joint with an unlimited possible decrease.
pub fn any_plain_friction() -> BTreeMap<&'static str, f64> {
    let plain = EFFECTS.iter().filter(|effect| effect.is_plain_friction());
    plain.map(|effect| (effect.name, f64::INFINITY)).collect()
}

/// Returns the hypotheses that describe without naming a cause: a curve at each joint, and where `bodies` are known,
/// each link's body.
pub fn unnamed(model: &Model, bodies: bool, without: &BTreeSet<String>) -> Vec<Hypothesis> {
    let curve = |joint: usize| Hypothesis {
        effect: &UNKNOWN,
        place: Whereabouts {
            joint,
            ..Whereabouts::default()
        },
    };
    let mut all: Vec<Hypothesis> = (0..model.dof()).map(curve).collect();
    if bodies {
        all.extend(unnamed_bodies(model, without));
    }
    all
}

/// Returns an unnamed body for each moving link that has a body in the URDF, except for the last link, where every
/// additional body is a payload.
pub fn unnamed_bodies(model: &Model, without: &BTreeSet<String>) -> Vec<Hypothesis> {
    let describes =
        |effect: &&&Effect| effect.traits.describes_only && effect.place == PlaceKind::Link;
    let effect = EFFECTS.iter().find(describes);
    let Some(&effect) = effect.filter(|effect| !without.contains(effect.name)) else {
        return Vec::new();
    };
    let tool = model.links()[model.tool_link()].joint;
    let joints = model.joints().iter().enumerate();
    let links = joints.filter(|(joint, _)| Some(*joint) != tool);
    let has_body = |link: &usize| {
        let inertia = model.links()[*link].inertia;
        inertia.mass_kg() > 0.0 && inertia.nearest_consistent(0.0) == inertia
    };
    let links = links
        .map(|(joint, _)| model.body_link(joint))
        .filter(has_body);
    let at = |link: usize| Hypothesis {
        effect,
        place: Whereabouts {
            link,
            ..Whereabouts::default()
        },
    };
    links.map(at).collect()
}

/// Returns every hypothesis for a robot, except for the effects named in `without`. `bodies` is false for an external
/// twin, whose masses and links are unknown.
pub fn hypotheses(model: &Model, bodies: bool, without: &BTreeSet<String>) -> Vec<Hypothesis> {
    let joints = 0..model.dof();
    let mut all = Vec::new();
    for &effect in EFFECTS {
        // The unknown friction and load of an external twin imitate rare kinds of friction.
        let is_blurred = effect.traits.is_off_list && !bodies;
        if is_blurred || effect.traits.describes_only || without.contains(effect.name) {
            continue;
        }
        let mut add = |place: Whereabouts| all.push(Hypothesis { effect, place });
        match effect.place {
            PlaceKind::Joint if bodies || effect.layer != tauscope_dynamics::terms::Layer::Body => {
                joints.clone().for_each(|joint| {
                    add(Whereabouts {
                        joint,
                        ..Whereabouts::default()
                    });
                });
            }
            PlaceKind::TwoJoints => {
                for joint in joints.clone() {
                    for source in joints.clone().filter(|source| *source != joint) {
                        add(Whereabouts {
                            joint,
                            source,
                            link: 0,
                        });
                    }
                }
            }
            PlaceKind::Link if bodies => {
                // One link of each joint represents all links fixed to it.
                for joint in joints.clone() {
                    add(Whereabouts {
                        link: model.body_link(joint),
                        ..Whereabouts::default()
                    });
                }
            }
            PlaceKind::Tool if bodies => {
                add(Whereabouts {
                    link: model.tool_link(),
                    ..Whereabouts::default()
                });
            }
            PlaceKind::Base if bodies => add(Whereabouts::default()),
            PlaceKind::All => add(Whereabouts::default()),
            _ => {}
        }
    }
    all
}
