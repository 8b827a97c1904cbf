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

/// Share of a step that is still missing when the observer counts as settled.
const SETTLED: f64 = 0.01;

/// The observer of one robot. No allocation per sample.
#[derive(Debug, Clone)]
pub struct MomentumObserver {
    gain_per_s: f64,
    model: Model,
    data: Data,
    /// Effort unit per N m by joint; 0 where that is not known.
    effort_per_nm: Vec<f64>,
    before: Option<Before>,
    /// Mass matrix of the sample before.
    mass: DMatrix<f64>,
    /// Estimate by joint \[N m\].
    torque_nm: JointArray,
    started_ns: i64,
}

/// What the next step needs of the sample before.
#[derive(Debug, Clone, Copy)]
struct Before {
    stamp_ns: i64,
    velocity: JointArray,
    /// τ - n \[N m\].
    driving: JointArray,
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
            before: None,
            mass: DMatrix::zeros(n, n),
            torque_nm: [0.0; MAX_JOINTS],
            started_ns: 0,
        })
    }

    /// Takes the next sample and returns the external torque on the robot by joint \[N m, N\]. It is 0
    /// at a joint whose effort cannot be turned into a torque ([`MomentumObserver::knows`]). After
    /// [`flags::RESET`] it begins anew at 0; a repeated stamp changes nothing.
    pub fn update(&mut self, sample: &TwinState) -> &JointArray {
        let n = self.effort_per_nm.len();
        let stamp_ns = sample.header.stamp_ns;
        let before = self.before.filter(|_| !sample.header.has(flags::RESET));
        if before.is_some_and(|before| stamp_ns <= before.stamp_ns) {
            return &self.torque_nm;
        }
        let mass = mass_matrix(&self.model, &mut self.data, &sample.position[..n]);
        let mut driving = [0.0; MAX_JOINTS];
        for (j, driving) in driving[..n].iter_mut().enumerate() {
            if self.effort_per_nm[j] != 0.0 {
                let excess = sample.effort[j] - sample.expected_effort[j];
                let row = mass.column(j);
                let inertial = row.iter().zip(&sample.acceleration).map(|(m, a)| m * a);
                *driving = excess / self.effort_per_nm[j] + inertial.sum::<f64>();
            }
        }
        match before {
            None => {
                self.torque_nm = [0.0; MAX_JOINTS];
                self.started_ns = stamp_ns;
            }
            Some(before) => {
                let dt_s = (stamp_ns - before.stamp_ns) as f64 * 1e-9;
                let approach = -(-self.gain_per_s * dt_s).exp_m1();
                let mut change = [0.0; MAX_JOINTS];
                for (k, change) in change[..n].iter_mut().enumerate() {
                    *change = (sample.velocity[k] - before.velocity[k]) / (2.0 * dt_s);
                }
                for j in (0..n).filter(|&j| self.effort_per_nm[j] != 0.0) {
                    let (now, then) = (mass.column(j), self.mass.column(j));
                    let masses = now.iter().zip(&then);
                    let momentum: f64 = (masses.zip(&change))
                        .map(|((now, then), change)| (now + then) * change)
                        .sum();
                    let input = momentum - 0.5 * (driving[j] + before.driving[j]);
                    self.torque_nm[j] += approach * (input - self.torque_nm[j]);
                }
            }
        }
        self.mass.copy_from(mass);
        self.before = Some(Before {
            stamp_ns,
            velocity: sample.velocity,
            driving,
        });
        &self.torque_nm
    }

    /// Whether the effort of this joint can be turned into a torque.
    pub fn knows(&self, joint: usize) -> bool {
        self.effort_per_nm[joint] != 0.0
    }

    /// Whether what was assumed at the start has been forgotten: all but 1 % of it.
    pub fn settled(&self) -> bool {
        self.before.is_some_and(|before| {
            let since_s = (before.stamp_ns - self.started_ns) as f64 * 1e-9;
            (-self.gain_per_s * since_s).exp() <= SETTLED
        })
    }
}
