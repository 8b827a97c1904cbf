// Zero velocity at rest is exact.
#![allow(clippy::float_cmp)]

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tauscope_bus::MAX_JOINTS;

use super::*;
use crate::simulated::scenario::{FourierSpec, PointsSpec};
use crate::simulated::tests::arm;

fn joints() -> Vec<JointRange> {
    (0..3)
        .map(|j| JointRange {
            name: format!("joint{}", j + 1),
            lower: -2.0,
            upper: 1.0 + f64::from(j),
            velocity: 2.0,
            effort: 50.0,
        })
        .collect()
}

/// Velocity and acceleration are the derivatives of the position, all within their limits.
fn check(trajectory: &mut Trajectory, duration_s: f64, velocity: f64, acceleration: f64) {
    let h = 1e-4;
    let mut t_s = h;
    while t_s < duration_s - h {
        let [before, now, after] = [t_s - h, t_s, t_s + h].map(|t| trajectory.at(t));
        for (j, joint) in joints().iter().enumerate() {
            let v = (after.position[j] - before.position[j]) / (2.0 * h);
            let a = (after.velocity[j] - before.velocity[j]) / (2.0 * h);
            assert!(
                (v - now.velocity[j]).abs() < 2e-3,
                "t {t_s} joint {j}: {v} {now:?}"
            );
            assert!(
                (a - now.acceleration[j]).abs() < 2e-2,
                "t {t_s} joint {j}: {a} {now:?}"
            );
            assert!(
                (joint.lower..=joint.upper).contains(&now.position[j]),
                "t {t_s}: {now:?}"
            );
            assert!(now.velocity[j].abs() < velocity + 1e-9, "t {t_s}: {now:?}");
            assert!(
                now.acceleration[j].abs() < acceleration + 1e-9,
                "t {t_s}: {now:?}"
            );
        }
        t_s += 0.0037;
    }
}

#[test]
fn points_are_joined_smoothly_within_the_limits() {
    let spec = PointsSpec::default();
    let rng = ChaCha8Rng::seed_from_u64(1);
    let points = Points::new(&spec, &arm(), &joints(), Box::new(|_| true), rng).unwrap();
    let mut trajectory = Trajectory::Points(Box::new(points));
    check(&mut trajectory, 20.0, 0.4 * 2.0, 3.0);
}

#[test]
fn given_points_are_visited_in_order() {
    let through = vec![vec![0.0, 0.0, 0.0], vec![0.5, -0.5, 1.0]];
    let spec = PointsSpec {
        through: through.clone(),
        rest_s: [1.0, 1.0],
        ..PointsSpec::default()
    };
    let rng = ChaCha8Rng::seed_from_u64(1);
    let mut points = Points::new(&spec, &arm(), &joints(), Box::new(|_| true), rng).unwrap();
    let mut rests = Vec::new();
    for i in 0..2000 {
        let now = points.at(f64::from(i) * 0.01);
        let at_rest = now.velocity == [0.0; MAX_JOINTS];
        if at_rest && rests.last() != Some(&now.position[..3].to_vec()) {
            rests.push(now.position[..3].to_vec());
        }
    }
    assert!(rests.len() > 4);
    for (i, rest) in rests.iter().enumerate() {
        assert_eq!(rest, &through[i % 2]);
    }
}

#[test]
fn a_point_that_is_nowhere_allowed_is_an_error() {
    let rng = ChaCha8Rng::seed_from_u64(1);
    let spec = PointsSpec::default();
    let error = Points::new(&spec, &arm(), &joints(), Box::new(|_| false), rng).unwrap_err();
    assert!(
        error.to_string().contains("none of 1000 random points"),
        "{error}"
    );
}

#[test]
fn excitation_swings_within_the_limits_and_begins_and_ends_at_rest() {
    let spec = FourierSpec {
        period_s: 5.0,
        ..FourierSpec::default()
    };
    let rng = ChaCha8Rng::seed_from_u64(2);
    let mut trajectory = Trajectory::Fourier(Fourier::new(&spec, &joints(), 12.0, rng).unwrap());
    check(&mut trajectory, 12.0, 0.5 * 2.0, 4.0);
    for t_s in [0.0, 12.0] {
        let end = trajectory.at(t_s);
        for j in 0..3 {
            assert!((end.position[j] - joints()[j].middle()).abs() < 1e-9);
            assert!(end.velocity[j].abs() < 1e-9, "{end:?}");
        }
    }
    let middle = trajectory.at(6.0);
    assert!(
        middle.velocity[..3].iter().any(|v| v.abs() > 0.05),
        "{middle:?}"
    );
}

#[test]
fn a_spline_goes_through_its_rows_and_finds_a_sine() {
    let times: Vec<f64> = (0..=100)
        .map(|i| f64::from(i) * 0.1 + 0.01 * f64::from(i % 3))
        .collect();
    let rows = times.iter().map(|t| [t.sin(); MAX_JOINTS]).collect();
    let mut trajectory = Trajectory::Spline(Spline::new(times.clone(), rows, 3));
    let mut t = 1.0;
    while t < 9.0 {
        let now = trajectory.at(t);
        assert!(
            (now.position[0] - t.sin()).abs() < 1e-5,
            "{t} {}",
            now.position[0]
        );
        assert!(
            (now.velocity[0] - t.cos()).abs() < 1e-3,
            "{t} {}",
            now.velocity[0]
        );
        assert!(
            (now.acceleration[0] + t.sin()).abs() < 1e-2,
            "{t} {}",
            now.acceleration[0]
        );
        t += 0.0173;
    }
    let end = trajectory.at(20.0);
    assert!((end.position[2] - times[100].sin()).abs() < 1e-12);
    assert_eq!(end.velocity, [0.0; MAX_JOINTS]);
}
