//! Inertia's effort without the mass matrix, against the mass matrix.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use nalgebra::{DVector, Vector3};
use proptest::prelude::*;
use tauscope_dynamics::{
    Data, InertialEffort, forward_kinematics, link_pose, mass_matrix, point_jacobian,
};

mod robots;
use robots::robot_in_motion;

proptest! {
    #[test]
    fn it_is_the_mass_matrix_times_the_accelerations((model, [before, q, a]) in robot_in_motion()) {
        let mut data = Data::new(&model);
        let other: Vec<f64> = a.iter().map(|a| 1.0 - 0.5 * a).collect();
        let column = |a: &[f64]| DVector::from_column_slice(a);
        let wanted = mass_matrix(&model, &mut data, &q) * column(&a)
            + mass_matrix(&model, &mut data, &before) * column(&other);
        let mut inertial = InertialEffort::new(&model);
        inertial.place(&before);
        inertial.place(&q);
        let found = column(inertial.sum(&a, &other));
        prop_assert!((found - &wanted).amax() < 1e-12 * wanted.amax().max(1.0));
    }

    #[test]
    fn it_poses_the_links_as_forward_kinematics_does(
        (model, [before, q, _]) in robot_in_motion(),
        link in any::<prop::sample::Index>(),
    ) {
        let link = link.index(model.links().len());
        let (mut data, mut wanted) = (Data::new(&model), Data::new(&model));
        let mut inertial = InertialEffort::new(&model);
        inertial.place(&before);
        inertial.place(&q);
        inertial.pose(&model, &mut data);
        forward_kinematics(&model, &mut wanted, &q);
        let far = link_pose(&model, &data, link).inverse() * link_pose(&model, &wanted, link);
        prop_assert!(far.translation.vector.norm() < 1e-12 && far.rotation.angle() < 1e-7);
        let columns = |data: &Data| {
            let mut all = vec![Vector3::zeros(); 2 * model.dof()];
            point_jacobian(&model, data, link, &Vector3::new(0.1, -0.2, 0.3), |j, linear, angular| {
                (all[2 * j], all[2 * j + 1]) = (linear, angular);
            });
            all
        };
        for (found, wanted) in columns(&data).iter().zip(columns(&wanted)) {
            prop_assert!((found - wanted).norm() < 1e-12);
        }
    }
}
