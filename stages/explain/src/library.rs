//! Which hypotheses there are for a robot.

use std::collections::BTreeSet;

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{EFFECTS, PlaceKind};

use crate::active::{Hypothesis, Whereabouts};

/// Every hypothesis for a robot, but for the effects named in `without`. Where the twin is a topic, `bodies`
/// is false: nothing is known of masses and links.
pub fn hypotheses(model: &Model, bodies: bool, without: &BTreeSet<String>) -> Vec<Hypothesis> {
    let joints = 0..model.dof();
    let mut all = Vec::new();
    for &effect in EFFECTS {
        if effect.name == "unknown" || without.contains(effect.name) {
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
                // The child link of each joint stands for all that is fixed to it.
                for joint in model.joints() {
                    add(Whereabouts {
                        link: joint.child_link,
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
