//! Classification of a contact as collision or cooperation as its alarm is raised.
//!
//! In a collision the tool runs into something and is pushed back: a force on the tool explains the residual and
//! points against the tool's motion (Salt Ducaju et al., section II-C, assumption A1). A person who guides the robot
//! may touch any link, from any side, also while the tool is at rest. A stiff obstacle builds up its force at once, a
//! hand more slowly. Fisher's linear discriminant weighs these measurements.

use nalgebra::{Matrix6, Vector6};

use super::learnt::{KindContacts, Kinds, Learnt, MEASURED};
use super::place::ToolTouch;
use super::{NAME, Tauscope};
use crate::frame::{ContactKind, Detector, Discriminant, Lessons, Moments, Setup};

/// Tool speed below which its direction of motion is undefined \[m/s\].
/// Chosen: a few times the noise of the speed (encoders with 1 mrad/s a joint, levers below 1 m). A smaller value
/// gives noise a direction, a larger one ignores the direction of slow collisions.
const STANDSTILL_M_PER_S: f64 = 0.005;
/// Force that is added before taking the logarithm, so that smaller forces are hardly distinguished \[N\].
/// Chosen: a sixth of a cooperation's force when it is detected (1.8 N by [`PRIOR_MEANS`]). A smaller value
/// distinguishes forces within the noise, a larger one compresses those of contacts.
const LEAST_FORCE_N: f64 = 0.3;
/// Minimum number of contacts of each kind.
/// Statistical: three measurements need as many contacts of a kind to span them.
const LEAST: usize = 3;

/// Returns the measurements that distinguish the kinds. The first is the share of the residual's rise that a force on
/// the tool explains, times the cosine between this force and the reversed motion (from -1 to 1). The others are the
/// logarithms of the tool's speed before the contact and of that force.
pub(crate) fn measurements(touch: &ToolTouch) -> Vector6<f64> {
    let (force_n, speed) = (touch.force_n.norm(), touch.velocity_m_per_s.norm());
    let against = if speed < STANDSTILL_M_PER_S {
        0.0
    } else {
        let along = touch.force_n.dot(&touch.velocity_m_per_s);
        -along / (force_n * speed).max(f64::MIN_POSITIVE)
    };
    Vector6::new(
        against * touch.share,
        (speed + STANDSTILL_M_PER_S).ln(),
        (force_n + LEAST_FORCE_N).ln(),
        0.0,
        0.0,
        0.0,
    )
}

/// Classifies a contact.
pub(crate) fn classify(kinds: &Discriminant, measurements: &Vector6<f64>) -> &'static str {
    if Vector6::from(kinds.weights).dot(measurements) > kinds.bound {
        "collision"
    } else {
        "cooperation"
    }
}

/// Learns from the training contacts that the detector finds; `None` if the labels do not name both kinds or there is
/// no model of the robot.
pub(crate) fn learn(
    learnt: &Learnt,
    settings: &super::Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Option<(Kinds, KindContacts)> {
    setup.model.as_ref()?;
    let labelled = |kind| {
        let contacts = lessons
            .train
            .iter()
            .flat_map(|lesson| lesson.contacts.iter().flatten());
        contacts
            .filter(move |contact| contact.kind == kind && !contact.ignore)
            .count()
    };
    if labelled(ContactKind::Collision) < LEAST || labelled(ContactKind::Cooperation) < LEAST {
        return None;
    }
    let mut found: Vec<(ContactKind, Vector6<f64>)> = Vec::new();
    // Delays alarms as in operation, so that contacts can be classified.
    let mut detector = Tauscope::new(learnt, settings, setup, true);
    for lesson in lessons.train {
        let mut newest_on_ns = None;
        let mut raised_ns = None;
        for sample in lesson.anew() {
            detector.judge(&sample);
            let newest = detector.watch.raised_ns();
            if newest == std::mem::replace(&mut raised_ns, newest) {
                continue;
            }
            let Some(now) = newest else {
                continue;
            };
            let contacts = lesson.contacts.iter().flatten();
            let matching = contacts.filter(|contact| contact.matches(now));
            let contact = matching.max_by_key(|contact| contact.on_ns);
            // Only the first alarm of a contact counts.
            if let (Some(contact), Some(seen)) = (contact, detector.measurements)
                && newest_on_ns.replace(contact.on_ns) < Some(contact.on_ns)
            {
                found.push((contact.kind, seen));
            }
        }
    }
    let own = Moments::of(&found);
    let enough = own.counts.iter().all(|count| *count >= LEAST as f64);
    enough.then(|| (own.and(&prior()).discriminant(), KindContacts::of(&own)))
}

impl KindContacts {
    fn of(moments: &Moments) -> Self {
        let all = moments.counts[0] + moments.counts[1];
        Self {
            counts: moments.counts,
            means: moments.means.map(|mean| std::array::from_fn(|i| mean[i])),
            covariance: std::array::from_fn(|i| {
                std::array::from_fn(|j| moments.scatter[(i, j)] / all)
            }),
        }
    }

    /// Returns a note if the prior outweighs the robot's own contacts.
    pub(super) fn note(&self) -> Option<String> {
        let [collisions, cooperations] = self.counts;
        (collisions.min(cooperations) < PRIOR_CONTACTS).then(|| {
            format!(
                "{NAME} classifies contacts by its prior more than by this robot's contacts: the prior counts as {PRIOR_CONTACTS} contacts of each kind, and it found {collisions} collisions and {cooperations} cooperations to learn from"
            )
        })
    }
}

/// Weight of the prior, as a number of contacts of each kind: few contacts of the robot's own adjust the discriminant
/// towards what separates its kinds, but do not determine it.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), with kinds reported; not swept.
const PRIOR_CONTACTS: f64 = 40.0;
/// Mean measurements of collisions and cooperations.
/// Statistical: over 349 collisions and 573 cooperations of twelve simulated arms under impedance control, seeds 701
/// to 712, which nothing else was tuned or judged on: `tests/contacts/kinds_prior.py TAUSCOPE ROBOT.urdf OUT`.
#[expect(
    clippy::approx_constant,
    reason = "a measured mean that happens to be near -π"
)]
const PRIOR_MEANS: [[f64; MEASURED]; 2] = [[0.536, -1.804, 2.163], [-0.027, -3.141, 0.594]];
/// Covariance of the measurements within a kind.
/// Statistical: over the same contacts.
const PRIOR_COVARIANCE: [[f64; MEASURED]; MEASURED] = [
    [0.209, -0.010, 0.001],
    [-0.010, 0.763, 0.079],
    [0.001, 0.079, 0.378],
];

/// Returns the moments of the prior, with the weight of [`PRIOR_CONTACTS`] contacts of each kind.
fn prior() -> Moments {
    let six = |x: [f64; MEASURED]| Vector6::from_fn(|i, _| x.get(i).copied().unwrap_or(0.0));
    let mut scatter = Matrix6::zeros();
    for (i, row) in PRIOR_COVARIANCE.iter().enumerate() {
        for (j, covariance) in row.iter().enumerate() {
            scatter[(i, j)] = covariance * (2.0 * PRIOR_CONTACTS);
        }
    }
    Moments {
        counts: [PRIOR_CONTACTS; 2],
        means: PRIOR_MEANS.map(six),
        scatter,
    }
}
