//! Corrupt readings: an effort that jumps for one or two samples and returns, as no arm can move.
//!
//! A single one in a training recording would teach a detector that such residuals are normal. One in a validation
//! recording would raise every threshold of mean and standard deviation beyond any real contact.

use tauscope_bus::TwinState;
use tauscope_detect::{ContactKind, LabelledContact, Lesson};
use tauscope_dynamics::terms::words::counted;
use tauscope_pipeline::cell::CellFacts;

use crate::metrics::statistics::quantile;
use crate::twin::is_free_of;

/// Ratio of a bad reading's jump to the 99 % quantile of the deviation of a sample from the mean of its neighbours.
/// Chosen: for white noise 63 standard deviations. A smaller jump raises the standard deviation of 5000 samples by a
/// third at most; a smaller ratio would remove real changes of the effort.
const STANDS_OUT: f64 = 20.0;
/// Smallest number of samples from which the normal deviation is estimated.
/// Statistical: the 99 % quantile needs a hundred samples.
const ENOUGH: usize = 100;

/// A bad reading of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BadReading {
    /// Index of the sample.
    index: usize,
    joint: usize,
}

/// Smallest distance of the values from `at` to `to` from both neighbours, if all lie on the same side; otherwise 0.
fn departure(residual: &[f64], at: usize, to: usize) -> f64 {
    let (before, after) = (residual[at - 1], residual[to + 1]);
    let sides = residual[at..=to]
        .iter()
        .flat_map(|value| [value - before, value - after]);
    let (low, high) = sides.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), side| {
        (low.min(side), high.max(side))
    });
    low.max(-high).max(0.0)
}

fn find(lesson: &Lesson, joints: usize) -> Vec<BadReading> {
    let mut found: Vec<BadReading> = Vec::new();
    let samples = &lesson.samples;
    if samples.len() < ENOUGH {
        return found;
    }
    for joint in 0..joints {
        let of = |sample: &TwinState| sample.effort[joint] - sample.expected_effort[joint];
        let residual: Vec<f64> = samples.iter().map(of).collect();
        let triples = residual.windows(3);
        let mut usual: Vec<f64> = triples
            .map(|r| (r[1] - 0.5 * (r[0] + r[2])).abs())
            .collect();
        usual.sort_by(f64::total_cmp);
        let bound = STANDS_OUT * quantile(&usual, 0.99);
        if bound <= 0.0 {
            // Most samples repeat the previous one, so the normal deviation cannot be estimated.
            continue;
        }
        for (at, sample) in samples.iter().enumerate().skip(1).take(samples.len() - 3) {
            let stands_out = [at, at + 1]
                .into_iter()
                .any(|to| departure(&residual, at, to) > bound);
            let known = found
                .last()
                .is_some_and(|last| last.joint == joint && at - last.index < 2);
            if stands_out && !known && is_free_of(lesson, sample.header.stamp_ns) {
                found.push(BadReading { index: at, joint });
            }
        }
    }
    found
}

/// Excludes bad readings, and the filters' response to them, from `lesson`. Returns a note that names the first.
pub fn leave_out(lesson: &mut Lesson, facts: &CellFacts) -> Option<String> {
    let found = find(lesson, facts.joint_names.len());
    let first = found.first()?;
    let sample = &lesson.samples[first.index];
    let begin_ns = lesson.samples[0].header.stamp_ns;
    let at_s = (sample.header.stamp_ns - begin_ns) as f64 * 1e-9;
    let note = format!(
        "{}: {} that jumped for one or two samples as no arm can, the first at {} ({:.3} {} at {at_s:.3} s): excluded from learning and from thresholds",
        lesson.name,
        counted(found.len(), "reading"),
        facts.joint_names[first.joint],
        sample.effort[first.joint],
        facts.effort_unit.as_str(),
    );
    let contacts = lesson.contacts.get_or_insert_default();
    // Detectors do not learn from a label that is marked `ignore`, nor from the time just after it.
    contacts.extend(found.iter().map(|bad| {
        let stamp_ns = lesson.samples[bad.index].header.stamp_ns;
        LabelledContact {
            on_ns: stamp_ns,
            off_ns: stamp_ns,
            kind: ContactKind::Contact,
            ignore: true,
        }
    }));
    Some(note)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use tauscope_pipeline::cell::EffortUnit;

    /// A slowly varying residual with noise, plus `also` at each sample.
    fn lesson(also: impl Fn(usize) -> f64) -> Lesson {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let sample = |k: usize| {
            let mut sample = TwinState::default();
            sample.header.stamp_ns = k as i64 * 10_000_000;
            sample.effort[0] =
                3.0 * (0.01 * k as f64).sin() + random.random_range(-0.1..0.1) + also(k);
            sample
        };
        Lesson {
            name: "rec".to_owned(),
            samples: (0..1000).map(sample).collect(),
            contacts: None,
        }
    }

    fn facts() -> CellFacts {
        CellFacts {
            name: "cell".to_owned(),
            urdf: None,
            joint_names: vec!["joint1".to_owned()],
            effort_unit: EffortUnit::Nm,
            torque_constants_nm_per_a: None,
            tool: None,
            impedance: None,
        }
    }

    fn left_out(lesson: &mut Lesson) -> Vec<i64> {
        leave_out(lesson, &facts());
        let contacts = lesson.contacts.iter().flatten();
        contacts.map(|contact| contact.on_ns / 10_000_000).collect()
    }

    #[test]
    fn one_or_two_samples_that_jump_away_and_back_are_left_out_and_told() {
        for last in [500, 501] {
            let mut lesson = lesson(|k| if (500..=last).contains(&k) { 9.0 } else { 0.0 });
            let note = leave_out(&mut lesson, &facts());
            assert!(note.is_some_and(|note| note.contains("at joint1 (") && note.contains("at 5.000 s")));
            let contacts = lesson.contacts.as_deref().unwrap_or_default();
            assert_eq!(contacts.len(), 1);
            assert!(contacts[0].ignore && contacts[0].on_ns == 5_000_000_000);
        }
    }

    #[test]
    fn what_an_arm_does_is_no_bad_reading() {
        // Nothing; a friction reversal that persists; a push of 50 ms.
        assert!(left_out(&mut lesson(|_| 0.0)).is_empty());
        assert!(left_out(&mut lesson(|k| if k > 500 { 9.0 } else { 0.0 })).is_empty());
        assert!(
            left_out(&mut lesson(|k| if (500..505).contains(&k) {
                9.0
            } else {
                0.0
            }))
            .is_empty()
        );
    }
}
