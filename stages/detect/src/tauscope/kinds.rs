//! Collision or cooperation, by what is known as the alarm is raised.
//!
//! Who runs into something is pushed back: the force points against the motion of the touched point (Salt Ducaju et
//! al., section II-C). And it rises faster than a hand that means to lead. Fisher's linear discriminant weighs both.

use nalgebra::Vector6;

use super::Tauscope;
use super::learnt::Learnt;
use super::place::Touch;
use crate::detector::Detector;
use crate::fisher_discriminant::{Discriminant, discriminant};
use crate::lesson::{ContactKind, Lessons};
use crate::stage::Setup;

pub use crate::fisher_discriminant::Discriminant as Kinds;

/// A point slower than this has no direction of motion \[m/s\].
const STANDSTILL_M_PER_S: f64 = 0.005;
/// No force is told smaller than this \[N\].
const LEAST_FORCE_N: f64 = 0.1;
/// An alarm belongs to the contact that began last, from so much before its beginning to so much behind its end \[ns\].
const BEFORE_NS: i64 = 20_000_000;
const AFTER_NS: i64 = 150_000_000;
/// So many contacts of either kind are needed.
const LEAST: usize = 3;

/// What the kinds are told by: the cosine between force and motion of the touched point, and the logarithms of its speed and of the
/// force that has been reached.
pub(crate) fn measurements(touch: &Touch) -> Vector6<f64> {
    let force = nalgebra::Vector3::from(touch.contact.force_n);
    let speed = touch.velocity_m_per_s.norm();
    let along = if speed < STANDSTILL_M_PER_S {
        0.0
    } else {
        force.dot(&touch.velocity_m_per_s) / (force.norm() * speed).max(f64::MIN_POSITIVE)
    };
    Vector6::new(
        along,
        (speed + STANDSTILL_M_PER_S).ln(),
        (force.norm() + LEAST_FORCE_N).ln(),
        0.0,
        0.0,
        0.0,
    )
}

/// What kind of contact it is.
pub(crate) fn classify(kinds: &Discriminant, measurements: &Vector6<f64>) -> &'static str {
    if Vector6::from(kinds.weights).dot(measurements) > kinds.bound {
        "collision"
    } else {
        "cooperation"
    }
}

/// Learns from the training contacts that the detector finds; nothing where the labels do not name both kinds, or the
/// robot is not known.
pub(crate) fn learn(
    learnt: &Learnt,
    settings: &super::Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Option<Kinds> {
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
    // As it will run: it takes its time to tell the kinds.
    let mut detector = Tauscope::new(learnt, settings, setup);
    detector.tells_kinds = true;
    for lesson in lessons.train {
        let mut raised_ns = None;
        for sample in lesson.anew() {
            detector.judge(&sample);
            let newest = detector.alarm.as_ref().map(|alarm| alarm.raised_ns);
            if newest == raised_ns {
                continue;
            }
            raised_ns = newest;
            let Some(alarm) = detector.alarm.as_ref() else {
                continue;
            };
            let now = alarm.raised_ns;
            let contacts = lesson.contacts.iter().flatten().filter(|contact| {
                (contact.on_ns - BEFORE_NS..=contact.off_ns + AFTER_NS).contains(&now)
            });
            let contact = contacts.max_by_key(|contact| contact.on_ns);
            if let (Some(contact), Some(seen)) = (contact, alarm.measurements) {
                found.push((contact.kind, seen));
            }
        }
    }
    let count = |kind| found.iter().filter(|(of, _)| *of == kind).count();
    let enough = count(ContactKind::Collision) >= LEAST && count(ContactKind::Cooperation) >= LEAST;
    enough.then(|| discriminant(&found))
}
