//! Physics beyond the URDF, sorted by the way in which the plant simulates it.

use nalgebra::DMatrix;
use tauscope_dynamics::terms::{MotionSample, Simulated, Term, TermSpec};
use tauscope_dynamics::{Inertia, Model};

use super::super::error::ScenarioError;
use super::transmission::Rotor;

/// A body that is carried for part of the recording.
#[derive(Debug)]
pub(super) struct Carried {
    link: usize,
    inertia: Inertia,
    /// Begin and end \[s from the start of the recording\].
    window_s: [f64; 2],
}

/// The physics of an arm. `model` already includes the permanent terms of its bodies.
#[derive(Debug)]
pub(super) struct Physics {
    pub model: Model,
    pub carried: Vec<Carried>,
    pub loads: Loads,
    pub rotors: Vec<Rotor>,
    pub joints: JointTerms,
}

impl Physics {
    /// Sorts `specs`; skips the terms that act on the record only.
    pub fn new(nominal: &Model, specs: &[TermSpec]) -> Result<Self, ScenarioError> {
        let mut model = nominal.clone();
        let mut carried = Vec::new();
        let mut rotors: Vec<Rotor> = Vec::new();
        let (mut loads, mut joints) = (Vec::new(), Vec::new());
        for spec in specs {
            let term = spec.build(&model)?;
            if term.alter(&mut model) {
                continue;
            }
            let site = spec.site(nominal)?;
            let effect = term.effect();
            match effect.simulated {
                Simulated::Model | Simulated::Record => {}
                Simulated::Joint => joints.push(term),
                Simulated::Load => loads.push(term),
                Simulated::CarriedForAWhile => {
                    let (body, window) = term.coordinates().split_at(10);
                    carried.push(Carried {
                        link: site.link,
                        inertia: Inertia::from_parameters(std::array::from_fn(|i| body[i])),
                        window_s: [window[0], window[1]],
                    });
                }
                Simulated::Transmission(compliance) => {
                    if rotors.iter().any(|rotor| rotor.joint == site.joint) {
                        let joint = model.joints()[site.joint].name.clone();
                        return Err(ScenarioError::TwoTransmissions { joint });
                    }
                    rotors.push(Rotor::new(&*term, compliance, site.joint));
                }
                Simulated::No(reason) => {
                    let effect = effect.name;
                    return Err(ScenarioError::NotSimulated { effect, reason });
                }
            }
        }
        let n = nominal.dof();
        Ok(Self {
            model,
            carried,
            loads: Loads {
                terms: loads,
                zero: vec![0.0; n],
            },
            rotors,
            joints: JointTerms {
                terms: joints,
                position: vec![0.0; n],
                velocity: vec![0.0; n],
                acceleration: vec![0.0; n],
                transmitted: vec![0.0; n],
            },
        })
    }
}

impl Carried {
    pub fn is_there(&self, recording_s: f64) -> bool {
        self.window_s[0] <= recording_s && recording_s < self.window_s[1]
    }

    pub fn attach(&self, model: &mut Model) {
        model.attach(self.link, self.inertia);
    }
}

/// External forces.
#[derive(Debug)]
pub(super) struct Loads {
    terms: Vec<Box<dyn Term>>,
    zero: Vec<f64>,
}

impl Loads {
    /// Adds the effort that they cost at the links' position; times \[s\].
    pub fn add(&mut self, position: &[f64], recording_s: f64, session_s: f64, load: &mut [f64]) {
        let at = MotionSample {
            dt_s: 0.0,
            recording_s,
            session_s,
            position,
            velocity: &self.zero,
            acceleration: &self.zero,
            transmitted: &self.zero,
        };
        for term in &mut self.terms {
            term.act(&at, load);
        }
    }
}

/// The current step.
pub(super) struct Step<'a> {
    /// Position of the links \[rad\].
    pub position: &'a [f64],
    /// Velocity of the links at the beginning of the step.
    pub before: &'a [f64],
    pub rotors: &'a [Rotor],
    /// Effort at zero acceleration without the joint terms \[N m\].
    pub load: &'a [f64],
    pub inertia: &'a DMatrix<f64>,
    pub dt_s: f64,
    pub recording_s: f64,
    pub session_s: f64,
}

/// Terms that act in the joints, on the motor side.
#[derive(Debug)]
pub(super) struct JointTerms {
    terms: Vec<Box<dyn Term>>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    transmitted: Vec<f64>,
}

impl JointTerms {
    /// Computes the effort that the terms cost if the step ends with `velocity`, of the links followed by
    /// the rotors. Terms with internal state advance by `elapsed_s`; 0 is a trial evaluation.
    pub fn cost(&mut self, step: &Step<'_>, elapsed_s: f64, velocity: &[f64], effort: &mut [f64]) {
        let n = step.position.len();
        let (links, rotors) = velocity.split_at(n);
        for ((acceleration, v), v0) in self.acceleration.iter_mut().zip(links).zip(step.before) {
            *acceleration = (v - v0) / step.dt_s;
        }
        for (j, transmitted) in self.transmitted.iter_mut().enumerate() {
            let row = step.inertia.row(j);
            let inertial = row.iter().zip(&self.acceleration).map(|(m, a)| m * a);
            *transmitted = step.load[j] + inertial.sum::<f64>();
        }
        self.position.copy_from_slice(step.position);
        self.velocity.copy_from_slice(links);
        for (rotor, &velocity) in step.rotors.iter().zip(rotors) {
            let j = rotor.joint;
            self.position[j] = rotor.position;
            self.velocity[j] = velocity;
            self.acceleration[j] = (velocity - rotor.velocity) / step.dt_s;
            self.transmitted[j] += rotor.inertia * self.acceleration[j];
        }
        effort.fill(0.0);
        let at = MotionSample {
            dt_s: elapsed_s,
            recording_s: step.recording_s,
            session_s: step.session_s,
            position: &self.position,
            velocity: &self.velocity,
            acceleration: &self.acceleration,
            transmitted: &self.transmitted,
        };
        for term in &mut self.terms {
            term.act(&at, effort);
        }
    }
}
