//! The arm itself: its URDF, and the physics that the URDF does not tell of.

use nalgebra::{DVector, Vector3};
use tauscope_dynamics::terms::{MotionSample, Term, TermSpec};
use tauscope_dynamics::{
    Data, Model, forward_kinematics, link_jacobian, link_pose, mass_matrix, rnea,
};

use super::error::ScenarioError;

/// A solution is found once no velocity changes by more than this \[rad/s\].
const TOLERANCE: f64 = 1e-10;
const MAX_ITERATIONS: usize = 30;
/// Step by which slopes of the physics are found \[rad/s\].
const SLOPE_STEP: f64 = 1e-6;

/// A force that acts on the arm now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contact {
    pub link: usize,
    /// In the link's frame \[m\].
    pub point_m: [f64; 3],
    /// On the robot, world frame \[N\].
    pub force_n: [f64; 3],
}

/// The arm and its state.
///
/// Equation of motion: `M(q) qdd + h(q, qd) + physics(q, qd, qdd) = effort + Jᵀ F`, with the physics
/// as the effort that it costs.
#[derive(Debug)]
pub(super) struct Plant {
    model: Model,
    data: Data,
    terms: Vec<Box<dyn Term>>,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

impl Plant {
    /// An arm at rest.
    pub fn new(
        model: &Model,
        physics: &[TermSpec],
        position: &[f64],
    ) -> Result<Self, ScenarioError> {
        let joint_names: Vec<_> = model.joints().iter().map(|j| j.name.clone()).collect();
        let terms = physics.iter().map(|spec| spec.build(&joint_names));
        Ok(Self {
            terms: terms.collect::<Result<_, _>>()?,
            model: model.clone(),
            data: Data::new(model),
            position: position.to_vec(),
            velocity: vec![0.0; position.len()],
        })
    }

    /// \[rad\]
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// \[rad/s\]
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    pub fn link_name(&self, link: usize) -> &str {
        &self.model.links()[link].name
    }

    /// Where a point of a link is in the world \[m\].
    pub fn world_point(&mut self, link: usize, point_m: [f64; 3]) -> [f64; 3] {
        forward_kinematics(&self.model, &mut self.data, &self.position);
        let pose = link_pose(&self.model, &self.data, link);
        (pose.translation.vector + pose.rotation * Vector3::from(point_m)).into()
    }

    /// Moves on by `dt_s` under a constant effort \[N m\].
    ///
    /// Semi-implicit: the new velocity is the solution v of
    /// `M (v - v0) = dt (effort + Jᵀ F - h(q0, v0) - physics(q0, v))`, the new position q0 + dt v. The
    /// physics is taken at the new velocity because friction near standstill is far stiffer than any
    /// explicit step could be: its smoothed sign changes within 2 mrad/s.
    pub fn step(&mut self, dt_s: f64, effort_nm: &[f64], contacts: impl Iterator<Item = Contact>) {
        let n = self.position.len();
        let rest = vec![0.0; n];
        let bias = rnea(
            &self.model,
            &mut self.data,
            &self.position,
            &self.velocity,
            &rest,
        );
        let mut drive: Vec<f64> = effort_nm.iter().zip(bias).map(|(e, h)| e - h).collect();
        for contact in contacts {
            self.add_contact(&contact, &mut drive);
        }
        let inertia = mass_matrix(&self.model, &mut self.data, &self.position);
        let inertia = inertia.clone();

        let before = self.velocity.clone();
        let mut velocity = before.clone();
        for _ in 0..MAX_ITERATIONS {
            let physics = self.physics(0.0, &before, &velocity, dt_s);
            let damping = self.damping(&before, &velocity, &physics, dt_s);
            let change = DVector::from_fn(n, |j, _| velocity[j] - before[j]);
            let mut missing = -(&inertia * change);
            for j in 0..n {
                missing[j] += dt_s * (drive[j] - physics[j]);
            }
            let mut system = inertia.clone();
            for j in 0..n {
                system[(j, j)] += dt_s * damping[j];
            }
            // The mass matrix is positive definite, and damping only adds to it.
            let Some(factors) = system.cholesky() else {
                velocity.fill(f64::NAN);
                break;
            };
            let step = factors.solve(&missing);
            for j in 0..n {
                velocity[j] += step[j];
            }
            if step.amax() < TOLERANCE {
                break;
            }
        }
        // Once more with the time that passes, so that what has a memory remembers this step.
        self.physics(dt_s, &before, &velocity, dt_s);
        for (position, velocity) in self.position.iter_mut().zip(&velocity) {
            *position += dt_s * velocity;
        }
        self.velocity = velocity;
    }

    /// The effort that the physics costs at `velocity`, reached from `before` within `step_s`.
    /// `elapsed_s` passes for what has a memory.
    fn physics(
        &mut self,
        elapsed_s: f64,
        before: &[f64],
        velocity: &[f64],
        step_s: f64,
    ) -> Vec<f64> {
        let acceleration: Vec<f64> = velocity
            .iter()
            .zip(before)
            .map(|(v, v0)| (v - v0) / step_s)
            .collect();
        let mut effort = vec![0.0; velocity.len()];
        let at = MotionSample {
            dt_s: elapsed_s,
            position: &self.position,
            velocity,
            acceleration: &acceleration,
        };
        for term in &mut self.terms {
            term.add_effort(&at, &mut effort);
        }
        effort
    }

    /// How fast the physics' effort grows with velocity, joint by joint: the larger of its slope and,
    /// where it brakes, of its line through standstill. The latter keeps a step through the kink of
    /// Coulomb friction from going too far.
    fn damping(
        &mut self,
        before: &[f64],
        velocity: &[f64],
        physics: &[f64],
        step_s: f64,
    ) -> Vec<f64> {
        let n = velocity.len();
        let beside: Vec<f64> = velocity.iter().map(|v| v + SLOPE_STEP).collect();
        let beside = self.physics(0.0, before, &beside, step_s);
        let rest = vec![0.0; n];
        let at_rest = self.physics(0.0, before, &rest, step_s);
        (0..n)
            .map(|j| {
                let slope = (beside[j] - physics[j]) / SLOPE_STEP;
                let line = if velocity[j].abs() > SLOPE_STEP {
                    (physics[j] - at_rest[j]) / velocity[j]
                } else {
                    0.0
                };
                slope.max(line).max(0.0)
            })
            .collect()
    }

    /// Adds `Jᵀ F`.
    fn add_contact(&mut self, contact: &Contact, drive: &mut [f64]) {
        forward_kinematics(&self.model, &mut self.data, &self.position);
        let pose = link_pose(&self.model, &self.data, contact.link);
        let arm = pose.rotation * Vector3::from(contact.point_m);
        let force = Vector3::from(contact.force_n);
        let moment = arm.cross(&force);
        let jacobian = link_jacobian(&self.model, &mut self.data, contact.link);
        for (j, effort) in drive.iter_mut().enumerate() {
            for k in 0..3 {
                *effort += jacobian[(k, j)] * force[k] + jacobian[(k + 3, j)] * moment[k];
            }
        }
    }
}
