//! A joint whose rotor and link are two masses: the encoder is on the rotor, and the link moves nearly like the
//! rotor.
//!
//! Given the rotor's motion θ(t) as measured and that of the other joints, the link of joint j moves by
//!
//! M(q) q̈ + rest(q, q̇) = T,   with q = θ + δ,
//!
//! where M is the inertia that the joint moves (it does not depend on q itself), rest is the remaining effort of the
//! rigid body, and T is the torque of the transmission as a function of δ and δ̇ (Spong, "Modeling and Control of
//! Elastic Joint Robots", 1987, with the rotor's motion given). The state is δ, so nothing drifts: M δ̈ = T + F with
//! F = -rest - M θ̈. F is interpolated linearly between samples, and M is the mean of both. The effort of the motor
//! is J θ̈ + T, that of the other joints the rigid body's with the link's motion.

use std::sync::Arc;

use super::{Expansion, MotionSample, Site};
use crate::{Data, Model, rnea};

/// Largest deviation of the link from its rotor that is simulated \[rad\]: no transmission survives it.
/// Physical: gears deflect by hundredths of a radian.
const LARGEST_DEVIATION: f64 = 1.0;

/// Smallest inertia that is not treated as zero \[kg m²\].
/// Physical: far below the rotor of any robot; it only keeps a quotient finite.
const LEAST_INERTIA: f64 = 1e-9;

/// Error of the predicted link position below which a second iteration of a step changes nothing \[rad\].
/// Physical: below the resolution of encoders, 1e-5 rad and more.
const NEAR_ENOUGH: f64 = 1e-6;

/// Deviation of the link from its position without compliance, and its rate.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Deviation {
    /// Deviation \[rad\].
    pub angle: f64,
    /// Rate \[rad/s\].
    pub rate: f64,
}

/// Transmission between rotor and link. Accelerations are those of the link: torque divided by the inertia that it
/// moves.
pub(super) trait Transmission {
    /// Deviation at rest under a constant forcing \[rad/s²\].
    fn settled(&self, inertia: f64, forcing: f64) -> Deviation;

    /// Deviation `dt_s` later; the forcing is linear from the first to the second value.
    fn advance(&self, inertia: f64, from: Deviation, forcing: [f64; 2], dt_s: f64) -> Deviation;

    /// Acceleration of the link by the transmitted torque \[rad/s²\].
    fn acceleration(&self, inertia: f64, at: Deviation) -> f64;
}

/// The link behind the transmission, simulated along a motion.
#[derive(Debug)]
pub(super) struct TwoMasses {
    joint: usize,
    model: Model,
    data: Data,
    rigid: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    before: Option<Before>,
    /// Effort for the last evaluated position of the link.
    link: Vec<f64>,
    /// Expansion of the bodies' effort along the motion, if it was supplied, and index of the next sample.
    along: Option<(Arc<Expansion>, usize)>,
}

/// State at the previous sample.
#[derive(Debug, Clone, Copy)]
struct Before {
    deviation: Deviation,
    /// F \[N m\].
    load: f64,
    /// M \[kg m²\].
    inertia: f64,
}

impl TwoMasses {
    pub fn new(site: &Site<'_>) -> Self {
        let n = site.model.dof();
        Self {
            joint: site.joint,
            model: site.model.clone(),
            data: Data::new(site.model),
            rigid: vec![0.0; n],
            position: vec![0.0; n],
            velocity: vec![0.0; n],
            acceleration: vec![0.0; n],
            before: None,
            link: vec![0.0; n],
            along: None,
        }
    }

    /// Supplies the expansion of the bodies' effort along the following motion.
    pub fn expand(&mut self, along: &Arc<Expansion>) {
        self.along = Some((Arc::clone(along), 0));
    }

    pub fn reset(&mut self) {
        self.before = None;
    }

    /// Adds the effort of the motion minus that without `transmission`; the rotor's own inertia is not included.
    pub fn act(
        &mut self,
        at: &MotionSample<'_>,
        transmission: &impl Transmission,
        effort: &mut [f64],
    ) {
        self.follow(at, transmission, effort);
        if let Some((_, next)) = &mut self.along {
            *next += 1;
        }
    }

    fn follow(
        &mut self,
        at: &MotionSample<'_>,
        transmission: &impl Transmission,
        effort: &mut [f64],
    ) {
        let j = self.joint;
        let rotor_acceleration = at.acceleration[j];
        self.position.copy_from_slice(at.position);
        self.velocity.copy_from_slice(at.velocity);
        self.acceleration.copy_from_slice(at.acceleration);
        self.effort(Deviation::default(), at, rotor_acceleration);
        self.rigid.copy_from_slice(&self.link);
        let faster = self.effort(Deviation::default(), at, rotor_acceleration + 1.0);
        let inertia = faster - self.rigid[j];
        if inertia < LEAST_INERTIA {
            return;
        }
        let (deviation, rest) = match self.before {
            None => self.settle(at, transmission, inertia),
            Some(before) => self.advance(before, at, transmission, inertia),
        };
        if at.dt_s > 0.0 || self.before.is_none() {
            self.before = Some(Before {
                deviation,
                load: -rest - inertia * rotor_acceleration,
                inertia,
            });
        }
        let link_acceleration = transmission.acceleration(inertia, deviation) - rest / inertia;
        self.effort(deviation, at, link_acceleration);
        for ((effort, link), rigid) in effort.iter_mut().zip(&self.link).zip(&self.rigid) {
            *effort += link - rigid;
        }
    }

    /// Position of the link at rest at the beginning of the recording, found by iteration, because its load depends
    /// on its position.
    fn settle(
        &mut self,
        at: &MotionSample<'_>,
        transmission: &impl Transmission,
        inertia: f64,
    ) -> (Deviation, f64) {
        let mut deviation = Deviation::default();
        let mut rest = self.effort(deviation, at, 0.0);
        for _ in 0..10 {
            let forcing = -rest / inertia - at.acceleration[self.joint];
            let next = limited(transmission.settled(inertia, forcing));
            // Half steps, so that the iteration of a soft joint does not oscillate.
            let step = 0.5 * (next.angle - deviation.angle);
            deviation.angle = if step.abs() < NEAR_ENOUGH {
                next.angle
            } else {
                deviation.angle + step
            };
            rest = self.effort(deviation, at, 0.0);
            if step.abs() < NEAR_ENOUGH {
                break;
            }
        }
        (deviation, rest)
    }

    /// Position of the link after `at.dt_s`: a step with the load at the previous position and, if the prediction was
    /// wrong, a second step with the load at the new position.
    fn advance(
        &mut self,
        before: Before,
        at: &MotionSample<'_>,
        transmission: &impl Transmission,
        inertia: f64,
    ) -> (Deviation, f64) {
        let j = self.joint;
        let from = before.deviation;
        let mut rest = self.effort(from, at, 0.0);
        if at.dt_s <= 0.0 {
            return (from, rest);
        }
        let mean = 0.5 * (before.inertia + inertia);
        let mut expected = from;
        for _ in 0..2 {
            let load = -rest - inertia * at.acceleration[j];
            let forcing = [before.load / mean, load / mean];
            let next = limited(transmission.advance(mean, from, forcing, at.dt_s));
            rest = self.effort(next, at, 0.0);
            let off = (next.angle - expected.angle).abs();
            expected = next;
            if off < NEAR_ENOUGH {
                break;
            }
        }
        (expected, rest)
    }

    /// Effort of the rigid body at the joint for this deviation of the link; the efforts of all joints are stored in
    /// `link`.
    fn effort(&mut self, deviation: Deviation, at: &MotionSample<'_>, acceleration: f64) -> f64 {
        let j = self.joint;
        if let Some((along, k)) = &self.along {
            let off = [
                deviation.angle,
                deviation.rate,
                acceleration - at.acceleration[j],
            ];
            along.effort(*k, off, &mut self.link);
            return self.link[j];
        }
        self.position[j] = at.position[j] + deviation.angle;
        self.velocity[j] = at.velocity[j] + deviation.rate;
        self.acceleration[j] = acceleration;
        let (q, qd, qdd) = (&self.position, &self.velocity, &self.acceleration);
        let effort = rnea(&self.model, &mut self.data, q, qd, qdd);
        self.link.copy_from_slice(effort);
        self.link[j]
    }
}

/// Limits the deviation of a link that has torn off.
fn limited(deviation: Deviation) -> Deviation {
    if deviation.angle.abs() <= LARGEST_DEVIATION {
        return deviation;
    }
    let angle = if deviation.angle.is_nan() {
        0.0
    } else {
        LARGEST_DEVIATION.copysign(deviation.angle)
    };
    Deviation { angle, rate: 0.0 }
}

/// Exact steps of the damped oscillator δ̈ + 2 ζ ω δ̇ + ω² δ = f with ζ < 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Oscillator {
    frequency: f64,
    damping: f64,
    dt_s: f64,
    /// Transition matrix of a deviation from the steady state and its rate.
    angle: [f64; 2],
    rate: [f64; 2],
}

impl Oscillator {
    /// Creates the oscillator for steps of `dt_s`; `frequency` ω in rad/s, `damping` ζ.
    ///
    /// A mode above the Nyquist frequency keeps its static flexibility only (residual flexibility; Craig and Kurdila,
    /// *Fundamentals of Structural Dynamics*, 2006, section 11.4). Samples do not determine its oscillation, and its alias
    /// would be a resonance at a frequency that the joint does not have.
    pub fn new(frequency: f64, damping: f64, dt_s: f64) -> Self {
        let decay = frequency * damping;
        let swing = frequency * (1.0 - damping * damping).sqrt();
        let (sin, cos) = (swing * dt_s).sin_cos();
        let is_sampled = swing * dt_s < std::f64::consts::PI;
        let left = f64::from(is_sampled) * (-decay * dt_s).exp();
        Self {
            frequency,
            damping,
            dt_s,
            angle: [left * (cos + decay / swing * sin), left * sin / swing],
            rate: [
                -left * frequency * frequency / swing * sin,
                left * (cos - decay / swing * sin),
            ],
        }
    }

    /// The state one step later; the forcing is linear from the first to the second value.
    pub fn step(&self, from: Deviation, forcing: [f64; 2]) -> Deviation {
        let stiffness = self.frequency * self.frequency;
        let rate = (forcing[1] - forcing[0]) / self.dt_s / stiffness;
        let lag = 2.0 * self.damping / self.frequency * rate;
        let off = from.angle - (forcing[0] / stiffness - lag);
        let drift = from.rate - rate;
        Deviation {
            angle: forcing[1] / stiffness - lag + self.angle[0] * off + self.angle[1] * drift,
            rate: rate + self.rate[0] * off + self.rate[1] * drift,
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::tests::{TwoJoints, motion_with, sample};
    use super::*;

    /// Effort of the first joint's motor along a motion, by small steps: `torque` is the transmitted torque at a
    /// deviation, for the inertia that the joint moves.
    pub fn simulated(
        robot: &TwoJoints,
        samples: u32,
        start: f64,
        torque: impl Fn(Deviation, f64) -> f64,
    ) -> Vec<[f64; 2]> {
        let model = &robot.model;
        let mut data = Data::new(model);
        let steps = 2000;
        let dt = 0.01 / f64::from(steps);
        let fine = motion_with(model, samples * steps, dt);
        let mut at = Deviation {
            angle: start,
            rate: 0.0,
        };
        let mut efforts = Vec::new();
        for (k, now) in fine.iter().enumerate() {
            let (mut q, mut qd, mut qdd) = (now.position, now.velocity, now.acceleration);
            q[0] += at.angle;
            qd[0] += at.rate;
            qdd[0] = 0.0;
            let rest = rnea(model, &mut data, &q, &qd, &qdd)[0];
            qdd[0] = 1.0;
            let inertia = rnea(model, &mut data, &q, &qd, &qdd)[0] - rest;
            qdd[0] = (torque(at, inertia) - rest) / inertia;
            if k % steps as usize == 0 {
                let effort = rnea(model, &mut data, &q, &qd, &qdd);
                efforts.push([
                    effort[0] - now.transmitted[0],
                    effort[1] - now.transmitted[1],
                ]);
            }
            at.rate += dt * (qdd[0] - now.acceleration[0]);
            at.angle += dt * at.rate;
        }
        efforts
    }

    #[test]
    fn the_oscillator_is_exact_in_one_step_or_many() {
        let whole = Oscillator::new(30.0, 0.1, 0.1);
        let part = Oscillator::new(30.0, 0.1, 0.001);
        let start = Deviation {
            angle: 0.01,
            rate: -0.3,
        };
        let end = whole.step(start, [5.0, -9.0]);
        let mut at = start;
        let (mut x, mut v) = (start.angle, start.rate);
        for k in 0..100 {
            let forcing = |share: f64| 5.0 - 14.0 * share;
            let (a, b) = (f64::from(k) / 100.0, f64::from(k + 1) / 100.0);
            at = part.step(at, [forcing(a), forcing(b)]);
            for i in 0..1000 {
                let f = forcing(a + (b - a) * (f64::from(i) + 0.5) / 1000.0);
                v += 1e-6 * (f - 2.0 * 0.1 * 30.0 * v - 900.0 * x);
                x += 1e-6 * v;
            }
        }
        assert!((at.angle - end.angle).abs() < 1e-12 && (at.rate - end.rate).abs() < 1e-10);
        assert!((x - end.angle).abs() < 1e-6 && (v - end.rate).abs() < 1e-4);
    }

    /// Guards against an elasticity that was found on a sound arm by the alias of its resonance.
    #[test]
    fn a_mode_above_the_nyquist_frequency_is_static() {
        let (frequency, dt_s, forcing) = (400.0, 0.01, 3.0);
        let start = Deviation {
            angle: 0.2,
            rate: -1.0,
        };
        let at = Oscillator::new(frequency, 0.05, dt_s).step(start, [forcing, forcing]);
        assert!((at.angle - forcing / (frequency * frequency)).abs() < 1e-15);
        assert!(at.rate.abs() < 1e-12);
    }

    #[test]
    fn nothing_moves_nothing() {
        let model = Model::massless(&["one".to_owned(), "two".to_owned()]);
        let site = Site {
            model: &model,
            joint: 0,
            source: 0,
            link: 0,
        };
        let mut term =
            (super::super::effect("joint_elasticity").unwrap().build)(&site, &[0.5, 1e3]);
        let mut effort = [0.0; 2];
        let at = sample(0.01, 0.0, [0.1; 2], [0.2; 2], [3.0; 2]);
        term.act(&at.view(), &mut effort);
        assert_eq!(effort, [1.5, 0.0]);
    }
}
