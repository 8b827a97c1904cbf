//! Quantities that the terms of a twin change in a robot's model.

use std::collections::{BTreeMap, BTreeSet};

use tauscope_dynamics::terms::{Quantity, TermSpec};
use tauscope_dynamics::{Drive, Inertia, Model};
use tauscope_explain::report::Finding;

/// Smallest change of gravity that is written \[m/s²\]. Resolution: of a file with seven digits.
const LEAST_GRAVITY_M_S2: f64 = 1e-6;

/// Relative difference below which two numbers are equal. Resolution: of nine digits.
const SAME: f64 = 1e-9;

/// New values of a joint's quantities; `None` if the old value stays.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointCorrections {
    /// Viscous friction \[N m s/rad or N s/m\].
    pub damping: Option<f64>,
    /// Dry friction \[N m or N\].
    pub friction: Option<f64>,
    /// Dry friction at rest, if it is larger \[N m or N\].
    pub static_friction: Option<f64>,
    /// Inertia of the rotor \[kg m² or kg\].
    pub armature: Option<f64>,
    /// Stiffness and rest position of a spring \[N m/rad, rad; or N/m, m\].
    pub spring: Option<[f64; 2]>,
    /// Error of the zero \[rad or m\].
    pub zero: Option<f64>,
}

/// New values in a robot's model.
#[derive(Debug, Clone, Default)]
pub struct Corrections {
    /// By joint.
    pub joints: BTreeMap<String, JointCorrections>,
    /// The whole inertia of links, in their frames.
    pub bodies: BTreeMap<String, Inertia>,
    /// Gravity in the base \[m/s²\].
    pub gravity: Option<[f64; 3]>,
    /// Inertia of links before, for the reader of a file.
    pub before: BTreeMap<String, Inertia>,
    /// Effects that are not written, or only approximated, and why.
    pub lost: Vec<String>,
}

impl Corrections {
    /// Collects the changes that these terms make in the model of a robot. Terms of the same kind add up. Bodies are
    /// taken from the twin if `findings` name them; the twin's small changes of the other bodies are not corrections.
    pub fn of(model: &Model, terms: &[TermSpec], findings: &[Finding]) -> Self {
        let mut all = Self::default();
        let mut turned = model.clone();
        let named = named_links(model, terms, findings);
        for spec in terms {
            let Ok(effect) = spec.effect() else { continue };
            let place = spec.joint.as_ref().or(spec.link.as_ref());
            let place = place.map_or_else(String::new, |place| format!(" at {place}"));
            let quantities = match effect.quantities(spec) {
                Ok((quantities, lost)) => {
                    let lost = lost.map(|lost| format!("{}{place}: {lost}", effect.name));
                    all.lost.extend(lost);
                    quantities
                }
                Err(why) => {
                    all.lost
                        .push(format!("{}{place} is not written: {why}", effect.name));
                    continue;
                }
            };
            for quantity in quantities {
                match quantity {
                    Quantity::Body => match spec.build(model) {
                        Ok(_) => all.add_body(model, spec, &named),
                        // MuJoCo fuses links without joints when it reads a URDF.
                        Err(why) if names_link(findings, spec) => {
                            let lost = format!("{}{place} is not written: {why}", effect.name);
                            all.lost.push(lost);
                        }
                        Err(_) => {}
                    },
                    Quantity::Gravity => {
                        if let Ok(term) = spec.build(model) {
                            term.alter(&mut turned);
                        }
                    }
                    own => {
                        if let Some(joint) = &spec.joint {
                            all.joints.entry(joint.clone()).or_default().add(own);
                        }
                    }
                }
            }
        }
        for joint in model.joints() {
            if let Some(own) = all.joints.get_mut(&joint.name) {
                own.drop_stated(joint.drive);
            }
        }
        all.joints
            .retain(|_, own| *own != JointCorrections::default());
        let (before, after) = (model.gravity(), turned.gravity());
        let change = before.iter().zip(after).map(|(a, b)| (a - b).abs());
        let is_turned = change.fold(0.0, f64::max) > LEAST_GRAVITY_M_S2;
        all.gravity = is_turned.then_some(after);
        all
    }

    /// Whether all corrections are bodies, so that a corrected URDF replaces the corrected twin.
    pub fn is_only_bodies(&self) -> bool {
        let is_else = !self.joints.is_empty() || self.gravity.is_some() || !self.lost.is_empty();
        !self.bodies.is_empty() && !is_else
    }

    /// Whether there is nothing to write.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty() && self.bodies.is_empty() && self.gravity.is_none()
    }

    /// The robot with the corrections: its bodies, zeros and gravity, and the drives of its joints.
    pub fn applied(&self, model: &Model) -> (Model, Vec<Drive>) {
        let mut arm = model.clone();
        for (name, inertia) in &self.bodies {
            if let Some(link) = model.link_index(name) {
                arm.attach(link, *inertia - model.links()[link].inertia);
            }
        }
        if let Some(gravity) = self.gravity {
            arm.set_gravity(gravity);
        }
        let mut drives: Vec<Drive> = Vec::new();
        for (j, joint) in model.joints().iter().enumerate() {
            let own = self.joints.get(&joint.name).copied().unwrap_or_default();
            if let Some(zero) = own.zero {
                arm.shift_zero(j, zero);
            }
            let [stiffness, rest] = own
                .spring
                .unwrap_or([joint.drive.stiffness, joint.drive.rest]);
            drives.push(Drive {
                damping: own.damping.unwrap_or(joint.drive.damping),
                friction: own.friction.unwrap_or(joint.drive.friction),
                rotor_inertia: own.armature.unwrap_or(joint.drive.rotor_inertia),
                stiffness,
                rest,
            });
        }
        (arm, drives)
    }

    /// Adds a term's inertia to its link, if the link is one of `named`.
    fn add_body(&mut self, model: &Model, spec: &TermSpec, named: &BTreeSet<usize>) {
        let body = body_of(model, spec).filter(|(link, _)| named.contains(link));
        let Some((link, change)) = body else { return };
        let link = &model.links()[link];
        self.before.insert(link.name.clone(), link.inertia);
        let own = self.bodies.entry(link.name.clone()).or_insert(link.inertia);
        *own += change;
    }
}

/// The link whose inertia a term changes, and the change.
fn body_of(model: &Model, spec: &TermSpec) -> Option<(usize, Inertia)> {
    spec.build(model).ok().and_then(|term| term.inertia())
}

/// Whether a finding is about the link of a term.
fn names_link(findings: &[Finding], spec: &TermSpec) -> bool {
    spec.link.is_some() && findings.iter().any(|finding| finding.link == spec.link)
}

/// Links whose mass or inertia a finding corrects: it names the link, or the link's joint and a term's parameters.
fn named_links(model: &Model, terms: &[TermSpec], findings: &[Finding]) -> BTreeSet<usize> {
    let is_named = |spec: &TermSpec, link: usize| {
        let link = &model.links()[link];
        let mover = link.joint.map(|joint| &model.joints()[joint].name);
        findings.iter().any(|finding| {
            let is_mover = finding.joint.is_some() && finding.joint.as_ref() == mover;
            let mut keys = spec.parameters.keys();
            let is_there = finding.link.as_ref() == Some(&link.name) || is_mover;
            is_there && keys.all(|name| finding.parameters.contains_key(name))
        })
    };
    let of = |spec: &TermSpec| {
        let (link, _) = body_of(model, spec)?;
        is_named(spec, link).then_some(link)
    };
    terms.iter().filter_map(of).collect()
}

impl JointCorrections {
    /// Removes values that the robot's file already states.
    fn drop_stated(&mut self, drive: Drive) {
        let is_new = |x: &f64, stated: f64| (x - stated).abs() > SAME * stated.abs();
        self.damping = self.damping.filter(|x| is_new(x, drive.damping));
        self.friction = self.friction.filter(|x| is_new(x, drive.friction));
        self.armature = self.armature.filter(|x| is_new(x, drive.rotor_inertia));
        let is_new_spring =
            |[k, rest]: &[f64; 2]| is_new(k, drive.stiffness) || is_new(rest, drive.rest);
        self.spring = self.spring.filter(is_new_spring);
    }

    fn add(&mut self, quantity: Quantity) {
        let add = |to: &mut Option<f64>, x: f64| *to = Some(to.unwrap_or(0.0) + x);
        match quantity {
            Quantity::Damping(x) => add(&mut self.damping, x),
            Quantity::DryFriction(x) => add(&mut self.friction, x),
            Quantity::StaticFriction(x) => add(&mut self.static_friction, x),
            Quantity::Armature(x) => add(&mut self.armature, x),
            Quantity::Zero(x) => add(&mut self.zero, x),
            Quantity::Spring { stiffness, rest } => {
                // Two springs pull as one with the sum of both stiffnesses.
                let [k, at] = self.spring.unwrap_or_default();
                let sum = k + stiffness;
                let at = if sum > 0.0 {
                    (k * at + stiffness * rest) / sum
                } else {
                    0.0
                };
                self.spring = Some([sum, at]);
            }
            Quantity::Body | Quantity::Gravity => {}
        }
    }
}
