//! The arm itself: its URDF, and the physics beyond the URDF.

use nalgebra::{Cholesky, DMatrix, DVector, LU};
use tauscope_dynamics::terms::TermSpec;
use tauscope_dynamics::{Data, Model, mass_matrix, rnea};

use super::error::ScenarioError;

mod contact;
mod drive;
mod physics;
mod transmission;

pub(super) use contact::Contact;
use contact::add_contact;
use drive::Motors;
pub(super) use drive::{Damping, Drive};
use physics::{Carried, JointTerms, Loads, Physics, Step};
use transmission::{Coupling, Rotor};

/// Convergence tolerance of Newton's iteration, as the largest change of a velocity \[rad/s\].
/// Resolution: far below any encoder's noise.
const TOLERANCE: f64 = 1e-10;
/// Maximum number of iterations per step.
/// Resolution: bounds the computing time of a step.
const MAX_ITERATIONS: usize = 30;
/// Finite-difference step for slopes of the physics \[rad/s\].
/// Resolution: between the curvature over a long step and the rounding over a short one.
const SLOPE_STEP: f64 = 1e-6;
/// Number of iterations that find the deflection of elastic joints at rest.
/// Resolution: bounds the computing time before the first sample.
const SETTLING_STEPS: usize = 100;

/// The arm and its state.
///
/// Equation of motion: `M(q) qdd + h(q, qd) + physics(q, qd, qdd) = effort + Jᵀ F`, with the physics
/// as the effort that it costs. A joint with elasticity or backlash transmits the torque T to its link,
/// `M qdd + h = T + Jᵀ F`, from its rotor, which carries the encoder: `J θdd + physics = effort - T`.
#[derive(Debug)]
pub(super) struct Plant {
    /// The arm with the bodies it carries now; `empty` is the arm without them.
    model: Model,
    empty: Model,
    carried: Vec<Carried>,
    /// Whether each of these is carried now.
    there: Vec<bool>,
    data: Data,
    loads: Loads,
    joints: JointTerms,
    rotors: Vec<Rotor>,
    /// Position of the links.
    link_position: Vec<f64>,
    link_velocity: Vec<f64>,
    /// Position of the encoders.
    position: Vec<f64>,
    velocity: Vec<f64>,
    /// Effort of the drives in the last step.
    applied_nm: Vec<f64>,
    /// Time since the start of the recording \[s\].
    recording_s: f64,
    /// Start of the recording in the session \[s\].
    session_start_s: f64,
    work: Work,
}

/// Buffers of a step, reused for the next. Velocities are those of the links, followed by those of the
/// rotors.
#[derive(Debug)]
struct Work {
    zero: Vec<f64>,
    /// Bias effort (gravity, Coriolis) plus external loads, minus the effort of contacts.
    load: Vec<f64>,
    velocity: Vec<f64>,
    beside: Vec<f64>,
    effort: Vec<f64>,
    effort_beside: Vec<f64>,
    effort_at_rest: Vec<f64>,
    couplings: Vec<Coupling>,
    /// Index of each joint's motor in the velocities.
    motor: Vec<usize>,
    inertia: DMatrix<f64>,
    system: DMatrix<f64>,
    missing: DVector<f64>,
}

impl Work {
    /// Adds the torques between links and rotors; the rotors follow the `links` joints of the arm.
    fn add_couplings(
        &mut self,
        rotors: &[Rotor],
        dt_s: f64,
        links: usize,
        system: &mut DMatrix<f64>,
    ) {
        for (k, (rotor, coupling)) in rotors.iter().zip(&self.couplings).enumerate() {
            let (link, motor) = (rotor.joint, links + k);
            let through = dt_s * coupling.at(self.velocity[motor], self.velocity[link]);
            self.missing[link] += through;
            self.missing[motor] =
                -through - rotor.inertia * (self.velocity[motor] - rotor.velocity);
            let slope = dt_s * coupling.slope;
            system[(link, link)] += slope;
            system[(motor, motor)] = rotor.inertia + slope;
            system[(link, motor)] = -slope;
            system[(motor, link)] = -slope;
        }
    }
}

impl Work {
    fn new(n: usize, rotors: &[Rotor]) -> Self {
        let zero = || vec![0.0; n];
        let all = n + rotors.len();
        let mut motor: Vec<_> = (0..n).collect();
        for (k, rotor) in rotors.iter().enumerate() {
            motor[rotor.joint] = n + k;
        }
        Self {
            zero: vec![0.0; all],
            load: zero(),
            velocity: vec![0.0; all],
            beside: vec![0.0; all],
            effort: zero(),
            effort_beside: zero(),
            effort_at_rest: zero(),
            couplings: vec![Coupling::default(); rotors.len()],
            motor,
            inertia: DMatrix::zeros(n, n),
            system: DMatrix::zeros(all, all),
            missing: DVector::zeros(all),
        }
    }
}

impl Plant {
    /// Creates an arm at rest, its encoders at `position`, with `physics` except the terms of the record.
    pub fn new(
        model: &Model,
        physics: &[TermSpec],
        position: &[f64],
    ) -> Result<Self, ScenarioError> {
        let n = position.len();
        let physics = Physics::new(model, physics)?;
        let mut plant = Self {
            data: Data::new(model),
            model: physics.model.clone(),
            empty: physics.model,
            there: vec![false; physics.carried.len()],
            carried: physics.carried,
            loads: physics.loads,
            joints: physics.joints,
            work: Work::new(n, &physics.rotors),
            rotors: physics.rotors,
            link_position: position.to_vec(),
            link_velocity: vec![0.0; n],
            position: position.to_vec(),
            velocity: vec![0.0; n],
            applied_nm: vec![0.0; n],
            recording_s: 0.0,
            session_start_s: 0.0,
        };
        plant.pick_up_and_drop();
        plant.settle();
        Ok(plant)
    }

    /// Sets the links to their deflection from the rotors at rest.
    fn settle(&mut self) {
        if self.rotors.is_empty() {
            return;
        }
        for rotor in &mut self.rotors {
            rotor.position = self.position[rotor.joint];
        }
        let zero = &self.work.zero[..self.link_position.len()];
        for _ in 0..SETTLING_STEPS {
            let load = rnea(&self.model, &mut self.data, &self.link_position, zero, zero);
            self.work.load.copy_from_slice(load);
            let inertia = mass_matrix(&self.model, &mut self.data, &self.link_position);
            for rotor in &self.rotors {
                let j = rotor.joint;
                self.link_position[j] =
                    rotor.position + rotor.sag(self.work.load[j], inertia[(j, j)]);
            }
        }
    }

    /// Sets the start of the recording in its session.
    pub fn starting_at(mut self, session_start_s: f64) -> Self {
        self.session_start_s = session_start_s;
        self
    }

    /// Returns the start of the recording in its session \[s\].
    pub fn session_start_s(&self) -> f64 {
        self.session_start_s
    }

    /// Returns the position of the encoders \[rad\].
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the velocity of the encoders \[rad/s\].
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    pub fn link_name(&self, link: usize) -> &str {
        &self.model.links()[link].name
    }

    /// Returns the effort of the drives in the last step, which balances the arm at its beginning \[N m\].
    pub fn applied_nm(&self) -> &[f64] {
        &self.applied_nm
    }

    /// Integrates over `dt_s`.
    ///
    /// Semi-implicit: the new velocity is the solution v of
    /// `M (v - v0) = dt (effort(v) + Jᵀ F - h(q0, v0) - physics(q0, v))`, the new position q0 + dt v. The
    /// physics is taken at the new velocity because friction near standstill is far stiffer than any
    /// explicit step could be: its smoothed sign changes within 2 mrad/s. So is a drive's velocity loop
    /// on a light joint.
    pub fn step(&mut self, dt_s: f64, drive: &Drive<'_>, contacts: impl Iterator<Item = Contact>) {
        self.pick_up_and_drop();
        let n = self.link_position.len();
        let (model, data, work) = (&self.model, &mut self.data, &mut self.work);
        let bias = rnea(
            model,
            data,
            &self.link_position,
            &self.link_velocity,
            &work.zero[..n],
        );
        work.load.copy_from_slice(bias);
        for contact in contacts {
            add_contact(model, data, &self.link_position, &contact, &mut work.load);
        }
        let session_s = self.session_start_s + self.recording_s;
        self.loads.add(
            &self.link_position,
            self.recording_s,
            session_s,
            &mut work.load,
        );
        work.inertia
            .copy_from(mass_matrix(model, data, &self.link_position));
        work.velocity[..n].copy_from_slice(&self.link_velocity);
        for (k, rotor) in self.rotors.iter().enumerate() {
            let j = rotor.joint;
            let (q, v) = (self.link_position[j], self.link_velocity[j]);
            work.couplings[k] = rotor.coupling(q, v, work.inertia[(j, j)], dt_s);
            work.velocity[n + k] = rotor.velocity;
        }
        for _ in 0..MAX_ITERATIONS {
            let Some(largest) = self.approach(dt_s, drive) else {
                self.velocity.fill(f64::NAN);
                return;
            };
            if largest < TOLERANCE {
                break;
            }
        }
        let work = &mut self.work;
        let step = Step {
            position: &self.link_position,
            before: &self.link_velocity,
            rotors: &self.rotors,
            load: &work.load,
            inertia: &work.inertia,
            dt_s,
            recording_s: self.recording_s,
            session_s,
        };
        // Evaluated once more with the elapsed time, so that terms with internal state record this step.
        self.joints
            .cost(&step, dt_s, &work.velocity, &mut work.effort);
        let (links, rotors) = work.velocity.split_at(n);
        for (rotor, &velocity) in self.rotors.iter_mut().zip(rotors) {
            rotor.position += dt_s * velocity;
            rotor.velocity = velocity;
        }
        for (j, &motor) in work.motor.iter().enumerate() {
            let velocity = work.velocity[motor];
            self.link_position[j] += dt_s * links[j];
            self.velocity[j] = velocity;
            self.position[j] = match motor.checked_sub(n) {
                Some(k) => self.rotors[k].position,
                None => self.link_position[j],
            };
        }
        let motors = Motors(&work.motor, &work.velocity);
        for (j, applied_nm) in self.applied_nm.iter_mut().enumerate() {
            *applied_nm = drive.effort(j, motors).0;
        }
        self.link_velocity.copy_from_slice(links);
        self.recording_s += dt_s;
    }

    /// Updates the arm's model to the bodies that it carries now.
    fn pick_up_and_drop(&mut self) {
        let mut changed = false;
        for (there, carried) in self.there.iter_mut().zip(&self.carried) {
            let now = carried.is_there(self.recording_s);
            changed |= now != *there;
            *there = now;
        }
        if !changed {
            return;
        }
        self.model.clone_from(&self.empty);
        for (_, carried) in self.there.iter().zip(&self.carried).filter(|(is, _)| **is) {
            carried.attach(&mut self.model);
        }
    }

    /// Takes one step of Newton's iteration for the new velocity; returns its largest change, `None` if
    /// the system is singular.
    fn approach(&mut self, dt_s: f64, drive: &Drive<'_>) -> Option<f64> {
        let n = self.link_position.len();
        let work = &mut self.work;
        let step = Step {
            position: &self.link_position,
            before: &self.link_velocity,
            rotors: &self.rotors,
            load: &work.load,
            inertia: &work.inertia,
            dt_s,
            recording_s: self.recording_s,
            session_s: self.session_start_s + self.recording_s,
        };
        for (beside, velocity) in work.beside.iter_mut().zip(&work.velocity) {
            *beside = velocity + SLOPE_STEP;
        }
        self.joints
            .cost(&step, 0.0, &work.velocity, &mut work.effort);
        self.joints
            .cost(&step, 0.0, &work.beside, &mut work.effort_beside);
        self.joints
            .cost(&step, 0.0, &work.zero, &mut work.effort_at_rest);
        let mut system = std::mem::replace(&mut work.system, DMatrix::zeros(0, 0));
        system.fill(0.0);
        system.view_mut((0, 0), (n, n)).copy_from(&work.inertia);
        for j in 0..n {
            let mut missing = -dt_s * work.load[j];
            for k in 0..n {
                missing -= work.inertia[(j, k)] * (work.velocity[k] - self.link_velocity[k]);
            }
            work.missing[j] = missing;
        }
        work.add_couplings(&self.rotors, dt_s, n, &mut system);
        let mut one_sided = false;
        for (j, &motor) in work.motor.iter().enumerate() {
            let velocity = work.velocity[motor];
            let (effort, limited) = drive.effort(j, Motors(&work.motor, &work.velocity));
            work.missing[motor] += dt_s * (effort - work.effort[j]);
            // Slope of the physics' effort or, if larger, its secant slope from standstill. The secant
            // keeps a step through the kink of Coulomb friction from overshooting.
            let slope = (work.effort_beside[j] - work.effort[j]) / SLOPE_STEP;
            let line = if velocity.abs() > SLOPE_STEP {
                (work.effort[j] - work.effort_at_rest[j]) / velocity
            } else {
                0.0
            };
            let fall = if limited { 0.0 } else { drive.damping.of(j) };
            system[(motor, motor)] += dt_s * (slope.max(line).max(0.0) + fall);
            if let (Damping::Coupled(damping), false) = (drive.damping, limited) {
                for (k, &other) in work.motor.iter().enumerate().filter(|(k, _)| *k != j) {
                    system[(motor, other)] += dt_s * damping[(j, k)];
                }
            }
            one_sided |= limited && matches!(drive.damping, Damping::Coupled(_));
        }
        if one_sided {
            // Asymmetric: a saturated joint does not react to the other joints' velocities, but they react to its.
            let factors = LU::new(system);
            if !factors.solve_mut(&mut work.missing) {
                return None;
            }
            work.system = DMatrix::zeros(work.velocity.len(), work.velocity.len());
        } else {
            // The mass matrix is positive definite, and this only adds to it.
            let factors = Cholesky::new(system)?;
            factors.solve_mut(&mut work.missing);
            work.system = factors.unpack_dirty();
        }
        for (velocity, change) in work.velocity.iter_mut().zip(&work.missing) {
            *velocity += change;
        }
        Some(work.missing.amax())
    }
}
