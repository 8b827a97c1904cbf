//! The arm itself: its URDF, and the physics that the URDF does not tell of.

use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use tauscope_dynamics::terms::{Layer, MotionSample, Term, TermSpec};
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

/// What the drives are told: an effort, and a velocity to keep to. Their own loop is fast, so it acts
/// on the velocity at the end of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Drive<'a> {
    /// \[N m\]
    pub effort_nm: &'a [f64],
    /// Effort by velocity error \[N m s/rad\].
    pub damping: &'a [f64],
    /// The velocity to keep to \[rad/s\].
    pub velocity: &'a [f64],
    /// The most a drive can give, either way \[N m\].
    pub limit_nm: &'a [f64],
}

impl Drive<'_> {
    /// The effort of joint `j` at `velocity`, and how fast it falls with it.
    fn effort(&self, j: usize, velocity: f64) -> (f64, f64) {
        let free = self.effort_nm[j] + self.damping[j] * (self.velocity[j] - velocity);
        let limit = self.limit_nm[j];
        if free.abs() > limit {
            (limit.copysign(free), 0.0)
        } else {
            (free, self.damping[j])
        }
    }
}

/// The arm and its state.
///
/// Equation of motion: `M(q) qdd + h(q, qd) + physics(q, qd, qdd) = effort + Jᵀ F`, with the physics
/// as the effort that it costs.
#[derive(Debug)]
pub(super) struct Plant {
    model: Model,
    data: Data,
    physics: Physics,
    position: Vec<f64>,
    velocity: Vec<f64>,
    /// Of the step that led here.
    applied_nm: Vec<f64>,
    /// Time since the start of the recording, and of the recording since that of the session \[s\].
    recording_s: f64,
    session_start_s: f64,
    work: Work,
}

/// Memory of a step, used again for the next.
#[derive(Debug)]
struct Work {
    zero: Vec<f64>,
    /// Gravity and the like, less the contacts.
    load: Vec<f64>,
    velocity: Vec<f64>,
    beside: Vec<f64>,
    effort: Vec<f64>,
    effort_beside: Vec<f64>,
    effort_at_rest: Vec<f64>,
    inertia: DMatrix<f64>,
    system: DMatrix<f64>,
    missing: DVector<f64>,
}

impl Work {
    fn new(n: usize) -> Self {
        let zero = || vec![0.0; n];
        Self {
            zero: zero(),
            load: zero(),
            velocity: zero(),
            beside: zero(),
            effort: zero(),
            effort_beside: zero(),
            effort_at_rest: zero(),
            inertia: DMatrix::zeros(n, n),
            system: DMatrix::zeros(n, n),
            missing: DVector::zeros(n),
        }
    }
}

impl Plant {
    /// An arm at rest.
    pub fn new(
        model: &Model,
        physics: &[TermSpec],
        position: &[f64],
    ) -> Result<Self, ScenarioError> {
        let n = position.len();
        Ok(Self {
            physics: Physics::new(model, physics)?,
            model: model.clone(),
            data: Data::new(model),
            position: position.to_vec(),
            velocity: vec![0.0; n],
            applied_nm: vec![0.0; n],
            recording_s: 0.0,
            session_start_s: 0.0,
            work: Work::new(n),
        })
    }

    /// Sets when the recording starts in its session.
    pub fn starting_at(mut self, session_start_s: f64) -> Self {
        self.session_start_s = session_start_s;
        self
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

    /// Effort of the drives in the step that led here \[N m\].
    pub fn applied_nm(&self) -> &[f64] {
        &self.applied_nm
    }

    /// Moves on by `dt_s`.
    ///
    /// Semi-implicit: the new velocity is the solution v of
    /// `M (v - v0) = dt (effort(v) + Jᵀ F - h(q0, v0) - physics(q0, v))`, the new position q0 + dt v. The
    /// physics is taken at the new velocity because friction near standstill is far stiffer than any
    /// explicit step could be: its smoothed sign changes within 2 mrad/s. So is a drive's velocity loop
    /// on a light joint.
    pub fn step(&mut self, dt_s: f64, drive: &Drive<'_>, contacts: impl Iterator<Item = Contact>) {
        let (model, data, work) = (&self.model, &mut self.data, &mut self.work);
        let bias = rnea(model, data, &self.position, &self.velocity, &work.zero);
        work.load.copy_from_slice(bias);
        for contact in contacts {
            add_contact(model, data, &self.position, &contact, &mut work.load);
        }
        work.inertia
            .copy_from(mass_matrix(model, data, &self.position));
        work.velocity.copy_from_slice(&self.velocity);
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
            position: &self.position,
            before: &self.velocity,
            load: &work.load,
            inertia: &work.inertia,
            dt_s,
            recording_s: self.recording_s,
            session_s: self.session_start_s + self.recording_s,
        };
        // Once more with the time that passes, so that what has a memory remembers this step.
        self.physics
            .cost(&step, dt_s, &work.velocity, &mut work.effort);
        for (j, &velocity) in work.velocity.iter().enumerate() {
            self.position[j] += dt_s * velocity;
            self.applied_nm[j] = drive.effort(j, velocity).0;
        }
        self.velocity.copy_from_slice(&work.velocity);
        self.recording_s += dt_s;
    }

    /// Brings the new velocity nearer to the solution by a step of Newton's, and gives that step's
    /// largest change; `None` if there is no such step.
    fn approach(&mut self, dt_s: f64, drive: &Drive<'_>) -> Option<f64> {
        let n = self.position.len();
        let work = &mut self.work;
        let step = Step {
            position: &self.position,
            before: &self.velocity,
            load: &work.load,
            inertia: &work.inertia,
            dt_s,
            recording_s: self.recording_s,
            session_s: self.session_start_s + self.recording_s,
        };
        for (beside, velocity) in work.beside.iter_mut().zip(&work.velocity) {
            *beside = velocity + SLOPE_STEP;
        }
        self.physics
            .cost(&step, 0.0, &work.velocity, &mut work.effort);
        self.physics
            .cost(&step, 0.0, &work.beside, &mut work.effort_beside);
        self.physics
            .cost(&step, 0.0, &work.zero, &mut work.effort_at_rest);
        let mut system = std::mem::replace(&mut work.system, DMatrix::zeros(0, 0));
        system.copy_from(&work.inertia);
        for j in 0..n {
            let velocity = work.velocity[j];
            let (effort, fall) = drive.effort(j, velocity);
            let mut missing = dt_s * (effort - work.load[j] - work.effort[j]);
            for k in 0..n {
                missing -= work.inertia[(j, k)] * (work.velocity[k] - self.velocity[k]);
            }
            work.missing[j] = missing;
            // How fast the physics' effort grows: its slope or, where that is more, the slope of its
            // line through standstill, which keeps a step through the kink of Coulomb friction from
            // going too far.
            let slope = (work.effort_beside[j] - work.effort[j]) / SLOPE_STEP;
            let line = if velocity.abs() > SLOPE_STEP {
                (work.effort[j] - work.effort_at_rest[j]) / velocity
            } else {
                0.0
            };
            system[(j, j)] += dt_s * (slope.max(line).max(0.0) + fall);
        }
        // The mass matrix is positive definite, and this only adds to it.
        let factors = Cholesky::new(system)?;
        factors.solve_mut(&mut work.missing);
        work.system = factors.unpack_dirty();
        for (velocity, change) in work.velocity.iter_mut().zip(&work.missing) {
            *velocity += change;
        }
        Some(work.missing.amax())
    }
}

/// Takes `Jᵀ F` off the load.
fn add_contact(
    model: &Model,
    data: &mut Data,
    position: &[f64],
    contact: &Contact,
    load: &mut [f64],
) {
    forward_kinematics(model, data, position);
    let pose = link_pose(model, data, contact.link);
    let force = Vector3::from(contact.force_n);
    let moment = (pose.rotation * Vector3::from(contact.point_m)).cross(&force);
    let jacobian = link_jacobian(model, data, contact.link);
    for (j, load) in load.iter_mut().enumerate() {
        for k in 0..3 {
            *load -= jacobian[(k, j)] * force[k] + jacobian[(k + 3, j)] * moment[k];
        }
    }
}

/// The step that is being taken.
struct Step<'a> {
    position: &'a [f64],
    /// The velocity it begins with.
    before: &'a [f64],
    /// What acts without the physics and without acceleration \[N m\].
    load: &'a [f64],
    inertia: &'a DMatrix<f64>,
    dt_s: f64,
    recording_s: f64,
    session_s: f64,
}

/// What the URDF does not tell of.
#[derive(Debug)]
struct Physics {
    terms: Vec<Box<dyn Term>>,
    acceleration: Vec<f64>,
    transmitted: Vec<f64>,
}

impl Physics {
    fn new(model: &Model, specs: &[TermSpec]) -> Result<Self, ScenarioError> {
        let terms = specs.iter().map(|spec| {
            let term = spec.build(model)?;
            match term.effect().layer {
                Layer::Joint => Ok(term),
                _ => Err(ScenarioError::NotSimulated {
                    effect: term.effect().name,
                }),
            }
        });
        Ok(Self {
            terms: terms.collect::<Result<_, ScenarioError>>()?,
            acceleration: vec![0.0; model.dof()],
            transmitted: vec![0.0; model.dof()],
        })
    }

    /// The effort that it costs to end the step with `velocity`. `elapsed_s` passes for what has a
    /// memory: 0 only tries.
    fn cost(&mut self, step: &Step<'_>, elapsed_s: f64, velocity: &[f64], effort: &mut [f64]) {
        for ((acceleration, v), v0) in self.acceleration.iter_mut().zip(velocity).zip(step.before) {
            *acceleration = (v - v0) / step.dt_s;
        }
        for (j, transmitted) in self.transmitted.iter_mut().enumerate() {
            let row = step.inertia.row(j);
            let inertial = row.iter().zip(&self.acceleration).map(|(m, a)| m * a);
            *transmitted = step.load[j] + inertial.sum::<f64>();
        }
        effort.fill(0.0);
        let at = MotionSample {
            dt_s: elapsed_s,
            recording_s: step.recording_s,
            session_s: step.session_s,
            position: step.position,
            velocity,
            acceleration: &self.acceleration,
            transmitted: &self.transmitted,
        };
        for term in &mut self.terms {
            term.act(&at, effort);
        }
    }
}
