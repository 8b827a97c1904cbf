//! External joint torque by the generalized momentum observer (Haddadin, De Luca and Albu-Schäffer,
//! "Robot Collisions: A Survey on Detection, Isolation, and Identification", 2017, section III-D;
//! equation 2 of Tajiri and Iwamoto; the observer that Salt Ducaju et al. take their forces from).
//!
//! ```text
//! r = K (p - ∫ (τ - n + Ṁ q̇ + r) dt),   p = M(q) q̇,   r → τ_ext
//! ```
//!
//! τ is the motors' measured effort. n is the twin's effort without the inertial part:
//! `expected_effort - M(q) q̈` with the twin's own q̈. n therefore contains every correction of the twin (friction, a
//! payload, an offset), while ṗ replaces the twin's low-passed, delayed acceleration. Only a correction of *inertia*
//! still uses the twin's acceleration.
//!
//! Differentiated, the observer is a low-pass, `ṙ = K (ṗ - Ṁ q̇ - τ + n - r)`. By the product rule
//! `ṗ - Ṁ q̇` over a step is the mean mass matrix times the change of velocity; with the input constant
//! over the step, the step is solved exactly, so that samples may be unevenly spaced and no integral drifts.
//! The mass matrix is never formed: only its product with Δq̇/Δt - q̈ is computed, at both ends of the step.
//!
//! Sign: with the force F on the robot, the measured effort minus the twin's effort is the unmodelled effort (such as
//! friction) minus Jᵀ F. At rest the estimate is therefore minus the residual.

pub(crate) mod gain;

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState, flags};
use tauscope_dynamics::{Data, InertialEffort, Model};

use super::error::ConfigError;
use super::setup::{JointSetup, Setup};
use super::shared::Tap;
pub use gain::DEFAULT_GAIN_PER_S;

/// Settling time of the observer, in time constants, after which 1 % of a step remains.
/// Statistical: ln 100.
const SETTLED: f64 = 4.605_170_185_988_092;

/// The observer of one robot. No allocation per sample.
#[derive(Debug, Clone)]
pub struct MomentumObserver {
    gain_per_s: f64,
    inertia: Tap<Inertia>,
    /// N m per effort unit by joint; 0 where unknown.
    nm_per_effort: Vec<f64>,
    /// Stamp of the previous sample, and its measured minus its expected effort \[N m\].
    before_ns: Option<i64>,
    excess: JointArray,
    /// Time step \[s\] and its low-pass coefficient; cached, because steps are often equal.
    step: (f64, f64),
    /// Estimate by joint \[N m\].
    torque_nm: JointArray,
    started_ns: i64,
}

impl MomentumObserver {
    /// Creates an observer with the gain K \[1/s\] for the robot of `setup`; `detector` is named in errors.
    ///
    /// # Errors
    /// If `setup` has no model, or no joint whose effort can be converted to a torque.
    pub fn new(
        setup: &Setup,
        gain_per_s: f64,
        detector: &'static str,
    ) -> Result<Self, ConfigError> {
        let Some(inertia) = Inertia::of(setup) else {
            return Err(ConfigError::NoModel { detector });
        };
        if !setup.joints.iter().any(JointSetup::tells_torque) {
            return Err(ConfigError::NoTorque { detector });
        }
        Ok(Self {
            gain_per_s,
            inertia,
            nm_per_effort: (setup.joints.iter())
                .map(|joint| {
                    if joint.tells_torque() {
                        joint.effort_per_nm.recip()
                    } else {
                        0.0
                    }
                })
                .collect(),
            before_ns: None,
            excess: [0.0; MAX_JOINTS],
            step: (0.0, 0.0),
            torque_nm: [0.0; MAX_JOINTS],
            started_ns: 0,
        })
    }

    /// Processes the next sample and returns the external torque on the robot by joint \[N m, N\]. It is 0
    /// at a joint whose effort cannot be converted to a torque ([`MomentumObserver::knows`]).
    /// [`flags::RESET`] restarts it at 0; a repeated stamp changes nothing.
    pub fn update(&mut self, sample: &TwinState) -> &JointArray {
        self.update_beside(sample, &sample.expected_effort)
    }

    /// Does the same as [`MomentumObserver::update`] with the `expected_effort` of another twin.
    pub fn update_beside(
        &mut self,
        sample: &TwinState,
        expected_effort: &JointArray,
    ) -> &JointArray {
        let n = self.nm_per_effort.len();
        let stamp_ns = sample.header.stamp_ns;
        let before_ns = self.before_ns.filter(|_| !sample.header.has(flags::RESET));
        if before_ns.is_some_and(|before_ns| stamp_ns <= before_ns) {
            return &self.torque_nm;
        }
        let dt_s = before_ns.map(|before_ns| (stamp_ns - before_ns) as f64 * 1e-9);
        if let Some(dt_s) = dt_s.filter(|dt_s| dt_s.to_bits() != self.step.0.to_bits()) {
            // 1 - exp(-K Δt), without cancellation where K Δt is small.
            self.step = (dt_s, -(-self.gain_per_s * dt_s).exp_m1());
        }
        let inertial_nm = self.inertia.with(|inertia| inertia.update(sample));
        for j in (0..n).filter(|&j| self.nm_per_effort[j] != 0.0) {
            let excess = (sample.effort[j] - expected_effort[j]) * self.nm_per_effort[j];
            let before = std::mem::replace(&mut self.excess[j], excess);
            // ṗ - Ṁ q̇ - τ + n = M (Δq̇/Δt - q̈) - (τ - expected_effort), averaged over the step.
            let input = inertial_nm[j] - 0.5 * (excess + before);
            self.torque_nm[j] += self.step.1 * (input - self.torque_nm[j]);
        }
        // The first sample has no step: the loop above only stores its excess.
        if dt_s.is_none() {
            self.torque_nm = [0.0; MAX_JOINTS];
            self.started_ns = stamp_ns;
        }
        self.before_ns = Some(stamp_ns);
        &self.torque_nm
    }

    /// Calls `work` with the robot model and its link poses at the newest sample.
    pub(crate) fn with_robot<R>(&mut self, work: impl FnOnce(&Model, &Data) -> R) -> R {
        self.inertia.with(|inertia| {
            let (model, data) = inertia.robot();
            work(model, data)
        })
    }

    /// Returns the result of the last update.
    pub fn torque_nm(&self) -> &JointArray {
        &self.torque_nm
    }

    /// Returns whether the effort of this joint can be converted to a torque.
    pub fn knows(&self, joint: usize) -> bool {
        (self.nm_per_effort.get(joint)).is_some_and(|&per_effort| per_effort != 0.0)
    }

    /// Returns whether the initial transient has decayed to 1 %.
    pub fn settled(&self) -> bool {
        self.before_ns.is_some_and(|before_ns| {
            let since_s = (before_ns - self.started_ns) as f64 * 1e-9;
            self.gain_per_s * since_s >= SETTLED
        })
    }
}

/// Inertial effort of the arm's motion beyond that of the twin's filtered acceleration. No allocation per sample.
#[derive(Debug, Clone)]
pub(crate) struct Inertia {
    model: Model,
    data: Data,
    effort: InertialEffort,
    /// Stamp of the previous sample, its velocity and the twin's acceleration.
    before_ns: Option<i64>,
    velocity: JointArray,
    acceleration: JointArray,
    /// Mean inertial effort over the newest step, by joint \[N m\].
    mean_nm: JointArray,
}

impl Inertia {
    fn new(model: Model) -> Self {
        Self {
            data: Data::new(&model),
            effort: InertialEffort::new(&model),
            model,
            before_ns: None,
            velocity: [0.0; MAX_JOINTS],
            acceleration: [0.0; MAX_JOINTS],
            mean_nm: [0.0; MAX_JOINTS],
        }
    }

    /// Returns the inertia of the robot of `setup`, shared with its other detectors; `None` without a model.
    pub fn of(setup: &Setup) -> Option<Tap<Self>> {
        let model = setup.model.as_ref()?;
        let new = || Self::new(model.clone());
        Some(match &setup.shared {
            Some(shared) => shared.tap((), new),
            None => Tap::own(new()),
        })
    }

    /// Returns the mean of M (Δq̇/Δt - q̈) over the step to this sample, by joint \[N m\]; 0 at the first sample. A
    /// repeated stamp changes nothing.
    pub fn update(&mut self, sample: &TwinState) -> JointArray {
        let stamp_ns = sample.header.stamp_ns;
        let n = self.model.dof();
        let before_ns = self.before_ns.filter(|_| !sample.header.has(flags::RESET));
        if before_ns.is_some_and(|before_ns| stamp_ns <= before_ns) {
            return self.mean_nm;
        }
        self.effort.place(&sample.position[..n]);
        self.mean_nm = [0.0; MAX_JOINTS];
        if let Some(before_ns) = before_ns {
            // Each end of the step has weight 1/2.
            let per_s = 0.5 / ((stamp_ns - before_ns) as f64 * 1e-9);
            let (mut newest, mut previous) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
            for j in 0..n {
                let rate = (sample.velocity[j] - self.velocity[j]) * per_s;
                newest[j] = rate - 0.5 * sample.acceleration[j];
                previous[j] = rate - 0.5 * self.acceleration[j];
            }
            let sum = self.effort.sum(&newest[..n], &previous[..n]);
            self.mean_nm[..n].copy_from_slice(sum);
        }
        self.velocity[..n].copy_from_slice(&sample.velocity[..n]);
        self.acceleration[..n].copy_from_slice(&sample.acceleration[..n]);
        self.before_ns = Some(stamp_ns);
        self.mean_nm
    }

    /// Returns the robot model and its link poses at the newest sample.
    fn robot(&mut self) -> (&Model, &Data) {
        self.effort.pose(&self.model, &mut self.data);
        (&self.model, &self.data)
    }
}
