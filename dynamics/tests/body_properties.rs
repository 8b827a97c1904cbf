//! Physical consistency of random bodies.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::float_cmp, reason = "numbers are read as they are written")]

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use tauscope_dynamics::{BodyFault, check_bodies};

mod arm;
use arm::{arm, impossible, substituted};

/// Inertia about the centre of mass of points that each have a share of the mass.
fn of_points(mass: f64, points: &[[f64; 3]], shares: &[f64]) -> ([f64; 3], [f64; 6]) {
    let total: f64 = shares.iter().sum();
    let weighed = || {
        points
            .iter()
            .zip(shares)
            .map(|(p, s)| (Vector3::from(*p), mass * s / total))
    };
    let com = weighed().map(|(p, m)| p * m).sum::<Vector3<f64>>() / mass;
    let about: Matrix3<f64> = weighed()
        .map(|(p, m)| {
            let r = p - com;
            (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * m
        })
        .sum();
    let i = about;
    (com.into(), [i.m11, i.m12, i.m13, i.m22, i.m23, i.m33])
}

/// Points within 0.2 m of the frame of `fore`, and their shares.
fn points() -> impl Strategy<Value = (Vec<[f64; 3]>, Vec<f64>)> {
    let point = prop::array::uniform3(-0.11..0.11_f64);
    let share = 0.05..1.0_f64;
    prop::collection::vec((point, share), 2..12).prop_map(|both| both.into_iter().unzip())
}

/// The numbers of `numbers` with `digits` significant digits of the largest.
fn printed(numbers: [f64; 6], digits: i32) -> [f64; 6] {
    let largest = numbers.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let places = (digits - 1 - largest.log10().floor() as i32).max(0) as usize;
    numbers.map(|x| format!("{x:.places$}").parse().unwrap())
}

proptest! {
    #[test]
    fn a_body_of_point_masses_is_never_impossible(
        (points, shares) in points(), mass in 0.2..20.0_f64, digits in 1..12_i32,
    ) {
        let (com, exact) = of_points(mass, &points, &shares);
        for numbers in [exact, printed(exact, digits)] {
            let xml = arm(|index, link| {
                if index == 2 {
                    (link.1, link.2, link.3) = (mass, com, numbers);
                }
            });
            for finding in check_bodies(&xml).unwrap() {
                let is_point = matches!(finding.fault, BodyFault::PointMass { .. });
                prop_assert!(is_point, "{}", finding);
            }
        }
    }

    #[test]
    fn six_numbers_in_another_order_are_flagged_where_they_are_not_positive_definite(
        (points, shares) in points(), order in Just([0, 1, 2, 3, 4, 5]).prop_shuffle(),
    ) {
        let (com, numbers) = of_points(2.6, &points, &shares);
        let permuted = order.map(|k| numbers[k]);
        let [xx, xy, xz, yy, yz, zz] = permuted;
        let moments = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).symmetric_eigenvalues();
        let scale = moments.amax();
        prop_assume!(moments.min() < -0.02 * scale && scale > 1e-2);
        let xml = arm(|index, link| {
            if index == 2 {
                (link.2, link.3) = (com, permuted);
            }
        });
        let findings = check_bodies(&xml).unwrap();
        let found = impossible(&findings);
        prop_assert_eq!(found.len(), 1, "{:?}", found);
        prop_assert_eq!(found[0].link(), "fore");
        prop_assert!(found[0].to_string().contains("principal moment is -"), "{}", found[0]);
        let after = substituted(&xml, "fore");
        prop_assert_eq!(after.mass_kg(), 2.6);
    }
}
