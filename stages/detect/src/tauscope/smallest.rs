//! Smallest detectable force, link by link.

use nalgebra::Vector3;
use tauscope_bus::MAX_JOINTS;

use super::late::LateIn;
use super::learnt::{Learnt, Smallest};
use super::pieces::pieces;
use super::place::Place;
use super::spans::Follow;
use crate::frame::{Lessons, Setup};

/// Stride over the contact-free samples: one in this many is an evaluated posture.
/// Resolution: a minute at 100 Hz still gives 11 000 forces for each link; changes the computing time.
const EVERY: usize = 50;

/// Returns, by link, the smallest detectable force over the postures and speeds of contact-free recordings, the
/// points of the link and the directions of the world's axes; empty without a model. A link whose joint has no
/// measured effort has no such force: its touch cannot be distinguished from one of the link that carries it.
pub(crate) fn smallest(
    learnt: &Learnt,
    lessons: &Lessons<'_>,
    late: &LateIn,
    setup: &Setup,
    follow: Follow,
) -> Vec<Smallest> {
    let mut setup = setup.clone();
    for (joint, is_measured) in setup.joints.iter_mut().zip(measured(lessons)) {
        if !is_measured {
            joint.effort_per_nm = f64::NAN;
        }
    }
    let place = Place::new(&setup);
    let per_nm = place.effort_per_nm().to_vec();
    let Some(mut points) = place.into_points() else {
        return Vec::new();
    };
    let w = learnt.windows.len() - 1;
    let n = learnt.joints.len();
    // The scores of a force of 1 N, by link.
    let mut scores: Vec<(usize, Vec<f64>)> = Vec::new();
    let mut count = 0;
    learnt.each(
        &pieces(lessons, late, follow),
        follow,
        f64::INFINITY,
        |sample, windows, _| {
            count += 1;
            if count % EVERY != 0 {
                return;
            }
            let inverse = windows.inverse_correlation(w);
            let usual = learnt.windows[w].usual;
            points.each_link(sample, |_, link| {
                let of_link = scores.iter().position(|(of, _)| *of == link.link);
                let at = of_link.unwrap_or_else(|| {
                    scores.push((link.link, Vec::new()));
                    scores.len() - 1
                });
                for (arm, _) in link.around() {
                    let mut information = Vector3::<f64>::zeros();
                    let mut rows = [Vector3::zeros(); MAX_JOINTS];
                    let told = (rows.iter_mut().enumerate().take(n))
                        .filter(|(a, _)| per_nm[*a].is_finite());
                    for (a, row) in told {
                        *row = link.moved(a, &arm) * (per_nm[a] / windows.noise(w, a));
                    }
                    for a in 0..n {
                        for b in 0..n {
                            information += rows[a].component_mul(&rows[b]) * inverse[a * n + b];
                        }
                    }
                    let score = information.iter().map(|score| score / usual);
                    scores[at].1.extend(score);
                }
            });
        },
    );
    let points = &points;
    let of_link = |(link, mut scores): (usize, Vec<f64>)| {
        scores.sort_by(f64::total_cmp);
        // The force that is sufficient in this share of the cases; in the others it scores less than 1.
        let force = |share: f64| {
            let at = ((1.0 - share) * (scores.len() - 1) as f64).round() as usize;
            Some(scores[at].max(0.0).sqrt().recip()).filter(|force| *force < FELT_N)
        };
        Smallest {
            link: points.link_name(link).to_owned(),
            half_n: force(0.5),
            most_n: force(0.9),
        }
    };
    scores.into_iter().map(of_link).collect()
}

/// Returns, by joint, whether its effort is measured: an effort that never changes is not.
fn measured(lessons: &Lessons<'_>) -> [bool; MAX_JOINTS] {
    let all = lessons.train.iter().chain(lessons.validation);
    let mut samples = all.flat_map(|lesson| &lesson.samples);
    let mut measured = [false; MAX_JOINTS];
    let Some(first) = samples.next() else {
        return measured;
    };
    for sample in samples {
        for (j, measured) in measured.iter_mut().enumerate() {
            *measured |= sample.effort[j].to_bits() != first.effort[j].to_bits();
        }
    }
    measured
}

/// Force above which a direction counts as not sensed \[N\].
/// Physical: more than any arm of this kind withstands.
const FELT_N: f64 = 1e4;
