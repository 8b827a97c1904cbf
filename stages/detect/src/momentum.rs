//! External joint torque by the generalized momentum observer (Haddadin, De Luca and Albu-Schäffer,
//! "Robot Collisions: A Survey on Detection, Isolation, and Identification", 2017, section III-D;
//! equation 2 of Tajiri and Iwamoto; the observer that Salt Ducaju et al. take their forces from).
//!
//! ```text
//! r = K (p - ∫ (τ - n + Ṁ q̇ + r) dt),   p = M(q) q̇,   r → τ_ext
//! ```
//!
//! τ is the motors' measured effort, n what the twin says the motion costs beyond its inertia:
//! `expected_effort - M(q) q̈` with the twin's own q̈. So whatever a corrected twin knows (friction, a
//! payload, an offset) is in n, and the twin's delayed acceleration is not in the result: ṗ stands in
//! its place. What a corrected twin changes about *inertia* stays with the twin's acceleration.
//!
//! Differentiated, the observer is a low-pass, `ṙ = K (ṗ - Ṁ q̇ - τ + n - r)`. By the product rule
//! `ṗ - Ṁ q̇` over a step is the mean mass matrix times the change of velocity; with the input constant
//! over the step, the step is solved exactly, so that clocks may be uneven and no integral drifts.
//!
//! Sign: the measured effort is the motors'. It exceeds the twin's by friction and the like less Jᵀ F,
//! with F the force on the robot; at rest the result is minus the residual.

use nalgebra::DMatrix;
use tauscope_bus::{JointArray, MAX_JOINTS, TwinState, flags};
use tauscope_dynamics::{Data, Model, mass_matrix};

use crate::config::ConfigError;
use crate::stage::Setup;

/// The papers' gain \[1/s\].
pub const DEFAULT_GAIN_PER_S: f64 = 100.0;

/// The observer counts as settled after so many of its time constants: 1 % of a step is missing still.
const SETTLED: f64 = 4.605_170_185_988_092;

/// The observer of one robot. No allocation per sample.
#[derive(Debug, Clone)]
pub struct MomentumObserver {
    gain_per_s: f64,
    model: Model,
    data: Data,
    /// Effort unit per N m by joint; 0 where that is not known.
    effort_per_nm: Vec<f64>,
    /// Stamp of the sample before, and its velocity, τ - n \[N m\] and mass matrix.
    before_ns: Option<i64>,
    velocity: JointArray,
    driving: JointArray,
    mass: DMatrix<f64>,
    /// Step \[s\], and the share of a change that is followed in it; kept, for clocks are often even.
    step: (f64, f64),
    /// Estimate by joint \[N m\].
    torque_nm: JointArray,
    started_ns: i64,
}

impl MomentumObserver {
    /// An observer with the gain K \[1/s\] for the robot of `setup`; `detector` asks for it.
    ///
    /// # Errors
    /// If `setup` has no model.
    pub fn new(
        setup: &Setup,
        gain_per_s: f64,
        detector: &'static str,
    ) -> Result<Self, ConfigError> {
        let Some(model) = setup.model.clone() else {
            return Err(ConfigError::NoModel { detector });
        };
        let n = model.dof();
        let known = |per_nm: f64| per_nm.is_finite() && per_nm != 0.0;
        Ok(Self {
            gain_per_s,
            data: Data::new(&model),
            model,
            effort_per_nm: (setup.joints.iter())
                .map(|joint| Some(joint.effort_per_nm).filter(|&per_nm| known(per_nm)))
                .map(Option::unwrap_or_default)
                .collect(),
            before_ns: None,
            velocity: [0.0; MAX_JOINTS],
            driving: [0.0; MAX_JOINTS],
            mass: DMatrix::zeros(n, n),
            step: (0.0, 0.0),
            torque_nm: [0.0; MAX_JOINTS],
            started_ns: 0,
        })
    }

    /// Takes the next sample and returns the external torque on the robot by joint \[N m, N\]. It is 0
    /// at a joint whose effort cannot be turned into a torque ([`MomentumObserver::knows`]). After
    /// [`flags::RESET`] it begins anew at 0; a repeated stamp changes nothing.
    pub fn update(&mut self, sample: &TwinState) -> &JointArray {
        self.update_beside(sample, &sample.expected_effort)
    }

    /// As [`MomentumObserver::update`] beside another twin's `expected_effort`.
    pub fn update_beside(
        &mut self,
        sample: &TwinState,
        expected_effort: &JointArray,
    ) -> &JointArray {
        let n = self.effort_per_nm.len();
        let stamp_ns = sample.header.stamp_ns;
        let before_ns = self.before_ns.filter(|_| !sample.header.has(flags::RESET));
        if before_ns.is_some_and(|before_ns| stamp_ns <= before_ns) {
            return &self.torque_nm;
        }
        let mass = mass_matrix(&self.model, &mut self.data, &sample.position[..n]);
        let (mass, mass_before) = (mass.as_slice(), self.mass.as_mut_slice());
        // M q̈ now, and twice the mean mass matrix times the change of velocity.
        let (mut inertial, mut momentum) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for k in 0..n {
            let acceleration = sample.acceleration[k];
            let change = sample.velocity[k] - self.velocity[k];
            // Symmetric: a row is a column.
            let rows = mass[k * n..].iter().zip(&mass_before[k * n..]);
            let sums = inertial[..n].iter_mut().zip(&mut momentum[..n]);
            for ((inertial, momentum), (now, then)) in sums.zip(rows) {
                *inertial += now * acceleration;
                *momentum += (now + then) * change;
            }
        }
        mass_before.copy_from_slice(mass);
        self.velocity[..n].copy_from_slice(&sample.velocity[..n]);
        let dt_s = before_ns.map(|before_ns| (stamp_ns - before_ns) as f64 * 1e-9);
        if let Some(dt_s) = dt_s.filter(|dt_s| dt_s.to_bits() != self.step.0.to_bits()) {
            self.step = (dt_s, -(-self.gain_per_s * dt_s).exp_m1());
        }
        for j in (0..n).filter(|&j| self.effort_per_nm[j] != 0.0) {
            let excess = sample.effort[j] - expected_effort[j];
            let driving = excess / self.effort_per_nm[j] + inertial[j];
            let before = std::mem::replace(&mut self.driving[j], driving);
            if let Some(dt_s) = dt_s {
                let input = 0.5 * (momentum[j] / dt_s - (driving + before));
                self.torque_nm[j] += self.step.1 * (input - self.torque_nm[j]);
            }
        }
        if dt_s.is_none() {
            self.torque_nm = [0.0; MAX_JOINTS];
            self.started_ns = stamp_ns;
        }
        self.before_ns = Some(stamp_ns);
        &self.torque_nm
    }

    /// The robot, and where its links were at the newest sample.
    pub(crate) fn robot(&self) -> (&Model, &Data) {
        (&self.model, &self.data)
    }

    /// What the last update returned.
    pub fn torque_nm(&self) -> &JointArray {
        &self.torque_nm
    }

    /// Whether the effort of this joint can be turned into a torque.
    pub fn knows(&self, joint: usize) -> bool {
        self.effort_per_nm[joint] != 0.0
    }

    /// Whether what was assumed at the start has been forgotten: all but 1 % of it.
    pub fn settled(&self) -> bool {
        self.before_ns.is_some_and(|before_ns| {
            let since_s = (before_ns - self.started_ns) as f64 * 1e-9;
            self.gain_per_s * since_s >= SETTLED
        })
    }
}
