//! Isolation of a contact: the touched link and the force, for detectors that give only a score.
//!
//! A force on link k loads only the joints between the base and k, by τ = Jᵀ F (Haddadin, De Luca and
//! Albu-Schäffer, "Robot Collisions: A Survey on Detection, Isolation, and Identification", 2017,
//! sections V and VI). For every link, the force that best explains the residual of all joints is
//! computed, with the contact point at the link's centre of mass. The touched link is the one that
//! leaves the least residual unexplained over all samples of the contact.

use nalgebra::{Matrix3, Vector3};
use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian, link_pose};

use super::loaded::LoadedJoints;
use super::setup::Setup;

/// Damping of the least-squares force, relative to the trace of its information matrix: directions that no
/// joint senses stay at zero instead of unbounded.
/// Chosen: halves a force along a direction with a hundredth of the information, and lowers an evenly sensed force by
/// 3 %. Less damping turns noise into force near singular poses, more underestimates every force.
const DAMPING: f64 = 1e-2;

/// Location and force of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The touched link, as an index into the model's links.
    pub link: usize,
    /// An alternative link that the residual does not distinguish from the touched one, if there is one.
    pub other_link: Option<usize>,
    /// Force on the robot, world frame \[N\].
    pub force_n: [f64; 3],
    /// Assumed point of application, world frame \[m\].
    pub point_m: [f64; 3],
}

/// Locates contacts of one robot. No allocation per call.
#[derive(Debug)]
pub struct Isolation {
    /// Standard deviation of the contact-free residual by joint \[effort unit\]; infinite if unknown.
    noise: Vec<f64>,
    /// Effort unit per N m by joint.
    effort_per_nm: Vec<f64>,
    model: Option<(Model, Data)>,
    /// Loaded joints of the current contact, and the part of the residual that a force on each link explains, summed
    /// over the contact's samples, by the joint that carries the link \[squared standard deviations\].
    loaded: LoadedJoints,
    explained: JointArray,
}

impl Isolation {
    /// Creates the isolation for the robot of `setup`; without a model it determines only the loaded joints.
    pub fn new(setup: Setup) -> Self {
        Self {
            noise: setup
                .joints
                .iter()
                .map(|joint| joint.noise.unwrap_or(f64::INFINITY))
                .collect(),
            effort_per_nm: setup
                .joints
                .iter()
                .map(|joint| joint.effort_per_nm)
                .collect(),
            model: setup.model.map(|model| {
                let data = Data::new(&model);
                (model, data)
            }),
            loaded: LoadedJoints::default(),
            explained: [0.0; MAX_JOINTS],
        }
    }

    /// Starts a new contact.
    pub fn begin(&mut self) {
        self.loaded = LoadedJoints::default();
        self.explained = [0.0; MAX_JOINTS];
    }

    /// Returns the joints that the contact loads: bit j for joint j. The sample is added to the contact if `counts`.
    pub fn loaded_joints(&mut self, sample: &TwinState, score: f64, counts: bool) -> u32 {
        if counts {
            let residuals = sample.residual.iter().zip(&self.noise);
            self.loaded.add(score, residuals.map(|(r, n)| (*r, *n)));
        }
        self.loaded.mask()
    }

    /// Returns the link that explains the contact best, with the force of this sample; `None` without a model or if
    /// no link explains any of the residual. The sample is added to the contact if `counts`.
    pub fn locate(&mut self, sample: &TwinState, counts: bool) -> Option<Contact> {
        let (model, data) = self.model.as_mut()?;
        let n = self.noise.len();
        forward_kinematics(model, data, &sample.position[..n]);
        let mut best: Option<(f64, Contact)> = None;
        // A link whose joint has no known torque cannot be distinguished from its parent link.
        let told = |joint: &usize| self.effort_per_nm[*joint].is_finite();
        for joint in (0..n).filter(told) {
            let link = model.body_link(joint);
            let pose = link_pose(model, data, link);
            let arm = pose.rotation * Vector3::from(model.links()[link].com_m());
            let jacobian = link_jacobian(model, data, link);

            // Weighted least squares: minimise Σ ((τ_j - J_jᵀ F) / σ_j)² + λ |F|².
            let (mut information, mut pull) = (Matrix3::zeros(), Vector3::zeros());
            for j in 0..n {
                let weight = self.effort_per_nm[j] / self.noise[j];
                let torque = -sample.residual[j] / self.effort_per_nm[j];
                if !(weight.is_finite() && torque.is_finite()) {
                    continue;
                }
                let column = jacobian.column(j);
                let angular = column.fixed_rows::<3>(3).into_owned();
                let row = (column.fixed_rows::<3>(0) + angular.cross(&arm)) * weight;
                information += row * row.transpose();
                pull += row * (torque * weight);
            }
            let damped = information + Matrix3::identity() * (DAMPING * information.trace());
            let Some(inverse) = damped.try_inverse() else {
                continue;
            };
            let force = inverse * pull;
            if counts {
                // Reduction of Σ (τ_j / σ_j)² by the force.
                self.explained[joint] += 2.0 * pull.dot(&force) - force.dot(&(information * force));
            }
            let explained = self.explained[joint];
            if best.is_none_or(|(most, _)| explained > most) {
                let contact = Contact {
                    link,
                    other_link: None,
                    force_n: force.into(),
                    point_m: (pose.translation.vector + arm).into(),
                };
                best = Some((explained, contact));
            }
        }
        best.map(|(_, contact)| contact)
    }

    /// Returns the name of a link.
    pub fn link_name(&self, link: usize) -> &str {
        self.model
            .as_ref()
            .map_or("", |(model, _)| model.links()[link].name.as_str())
    }
}
