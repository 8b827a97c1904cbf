//! `fisher_discriminant`: the rival of [`contact_classifier`](crate::salt_ducaju::contact_classifier) in Salt Ducaju et al., section V: the
//! same detection, and Fisher's linear discriminant (R. A. Fisher, "The statistical utilization of
//! multiple measurements", 1938) on the same two unit vectors, that of the force's derivative and that
//! of the tool's velocity.
//!
//! The paper says no more of it. Here the six components are the measurements, the direction is
//! `w = S⁻¹ (m_coll - m_coop)` with the scatter S within both kinds, and the bound lies half-way between
//! the means.

use nalgebra::{Matrix6, Vector6};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::ConfigError;
use crate::frame::detector::Detector;
use crate::frame::lesson::{ContactKind, LearnError, Lessons};
use crate::frame::stage::Setup;
use crate::salt_ducaju::contact_machine::{
    ContactDetector, MachineSettings, NewContact, Rule, unit,
};
use crate::salt_ducaju::contact_signals::{SignalSettings, Signals};
use crate::salt_ducaju::contact_tuning;

/// Canonical name.
pub(crate) const NAME: &str = "fisher_discriminant";

/// Added to the scatter, as a share of its trace: few contacts do not span all six directions.
const RIDGE: f64 = 1e-3;

/// Settings of `fisher_discriminant`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// How the external force is had and watched.
    pub signals: SignalSettings,
    /// When a contact begins and ends.
    pub detection: MachineSettings,
    /// What was learnt from labelled contacts; it does not run without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub discriminant: Option<Discriminant>,
}

/// A direction and a bound.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Discriminant {
    /// Weights of the unit vectors' components: force x, y, z, velocity x, y, z.
    pub weights: [f64; 6],
    /// A contact whose weighted sum is above this is a collision.
    pub bound: f64,
}

impl Rule for Discriminant {
    fn classify(&mut self, contact: &NewContact) -> ContactKind {
        let sum = Vector6::from(self.weights).dot(&measurements(contact));
        if sum > self.bound {
            ContactKind::Collision
        } else {
            ContactKind::Cooperation
        }
    }
}

/// The detector.
///
/// # Errors
/// If `setup` has no model, or nothing was learnt.
pub(crate) fn build(settings: &Settings, setup: &Setup) -> Result<Box<dyn Detector>, ConfigError> {
    let signals = Signals::tap(&settings.signals, setup, NAME)?;
    let Some(discriminant) = settings.discriminant else {
        return Err(ConfigError::NotLearnt { detector: NAME });
    };
    let shared = (&settings.signals, &settings.detection);
    Ok(Box::new(ContactDetector::new(
        NAME,
        signals,
        shared,
        discriminant,
    )))
}

/// Both unit vectors; zeros for one without length.
fn measurements(contact: &NewContact) -> Vector6<f64> {
    let mut all = Vector6::zeros();
    all.fixed_rows_mut::<3>(0)
        .copy_from_slice(&unit(contact.rise_n));
    all.fixed_rows_mut::<3>(3)
        .copy_from_slice(&unit(contact.velocity_m_per_s));
    all
}

/// Tunes `F_th` as [`contact_classifier::learn`](crate::salt_ducaju::contact_classifier::learn) does, and learns the discriminant from the training
/// contacts that are found.
///
/// # Errors
/// If the training recordings name no collisions and cooperations, or hold none of one kind or no
/// contact-free time.
pub fn learn(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Result<Settings, LearnError> {
    let tracks = contact_tuning::tracks(&settings.signals, setup, lessons, NAME)?;
    let mut learnt = settings.clone();
    learnt.signals = tracks.tuned(&settings.signals);
    learnt.detection.force_threshold_n = contact_tuning::force_threshold(&tracks, NAME)?;
    // Which contacts Algorithm 1 asks about depends on its answers: those that collide go on being asked about.
    let mut rule = Discriminant {
        weights: [0.0; 6],
        bound: -1.0,
    };
    let window = settings.signals.window;
    let found = contact_tuning::found(&tracks, &learnt.detection, window, &mut rule, NAME)?;
    let found: Vec<_> = found
        .iter()
        .map(|found| (found.kind, measurements(&found.contact)))
        .collect();
    learnt.discriminant = Some(discriminant(&found));
    Ok(learnt)
}

/// Fisher's linear discriminant between collisions and cooperations.
pub(crate) fn discriminant(found: &[(ContactKind, Vector6<f64>)]) -> Discriminant {
    Moments::of(found).discriminant()
}

/// What Fisher's discriminant is made from, for collisions and cooperations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moments {
    /// How many there are of each kind.
    pub counts: [f64; 2],
    /// Means of the measurements.
    pub means: [Vector6<f64>; 2],
    /// Scatter within both kinds.
    pub scatter: Matrix6<f64>,
}

impl Moments {
    /// Of measured contacts.
    pub fn of(found: &[(ContactKind, Vector6<f64>)]) -> Self {
        let mut moments = Self {
            counts: [0.0; 2],
            means: [Vector6::zeros(); 2],
            scatter: Matrix6::zeros(),
        };
        let kinds = [ContactKind::Collision, ContactKind::Cooperation];
        for (k, kind) in kinds.into_iter().enumerate() {
            let of_kind = || found.iter().filter(move |(other, _)| *other == kind);
            let count = of_kind().count() as f64;
            let mean = of_kind().map(|(_, x)| x).sum::<Vector6<f64>>() / count.max(1.0);
            for (_, x) in of_kind() {
                moments.scatter += (x - mean) * (x - mean).transpose();
            }
            (moments.counts[k], moments.means[k]) = (count, mean);
        }
        moments
    }

    /// Together with others, whose means are taken for the same and whose scatter is added.
    pub fn and(&self, other: &Self) -> Self {
        let both = |k: usize| {
            let (own, others) = (self.counts[k], other.counts[k]);
            let sum = self.means[k] * own + other.means[k] * others;
            sum / (own + others).max(1.0)
        };
        Self {
            counts: std::array::from_fn(|k| self.counts[k] + other.counts[k]),
            means: [both(0), both(1)],
            scatter: self.scatter + other.scatter,
        }
    }

    /// The direction that parts the kinds best, and the bound half-way between their means.
    pub fn discriminant(&self) -> Discriminant {
        let [collision, cooperation] = self.means;
        // Both kinds without any scatter: then any direction in which they differ will do.
        let ridge = (RIDGE * self.scatter.trace()).max(f64::EPSILON);
        let scatter = self.scatter + Matrix6::identity() * ridge;
        let apart = collision - cooperation;
        let weights = scatter
            .cholesky()
            .map_or(apart, |scatter| scatter.solve(&apart));
        Discriminant {
            weights: weights.into(),
            bound: 0.5 * weights.dot(&(collision + cooperation)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_parts_two_clouds_that_a_plane_parts() {
        let mut found = Vec::new();
        for i in 0..20 {
            let wiggle = 0.3 * f64::from(i).sin();
            let x = |z: f64| Vector6::new(wiggle, 0.4 * wiggle, z, wiggle * wiggle, 0.0, -z);
            found.push((ContactKind::Collision, x(0.9 + 0.5 * wiggle)));
            found.push((ContactKind::Cooperation, x(0.2 + 0.5 * wiggle)));
        }
        let learnt = discriminant(&found);
        for (kind, x) in found {
            let sum = Vector6::from(learnt.weights).dot(&x);
            assert_eq!(sum > learnt.bound, kind == ContactKind::Collision);
        }
    }
}
