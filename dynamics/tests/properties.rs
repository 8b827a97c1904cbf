//! Properties that hold for every robot.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use nalgebra::{DMatrix, DVector, Rotation3, Vector3};
use proptest::prelude::*;
use tauscope_dynamics::{
    Data, Follower, Inertia, Model, Wrench, forward_dynamics, forward_kinematics, gravity_effort,
    link_jacobian, link_pose, mass_matrix, regressor, rnea,
};

mod robots;
use robots::{robot, robot_in_motion};

/// Largest difference, relative to the largest number or 1.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(1.0_f64, |scale, x| scale.max(x.abs()));
    a.iter()
        .zip(b)
        .fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()))
        / scale
}

proptest! {
    #[test]
    fn the_mass_matrix_has_the_columns_that_rnea_gives((model, [q, ..]) in robot_in_motion()) {
        let mut data = Data::new(&model);
        let n = model.dof();
        let zeros = vec![0.0; n];
        let gravity = gravity_effort(&model, &mut data, &q).to_vec();
        let mut columns = DMatrix::zeros(n, n);
        for j in 0..n {
            let mut unit = zeros.clone();
            unit[j] = 1.0;
            let effort = rnea(&model, &mut data, &q, &zeros, &unit);
            for i in 0..n {
                columns[(i, j)] = effort[i] - gravity[i];
            }
        }
        let matrix = mass_matrix(&model, &mut data, &q);
        prop_assert!(difference(matrix.as_slice(), columns.as_slice()) < 1e-12);
        prop_assert_eq!(matrix, &matrix.transpose());
        prop_assert!(matrix.clone().cholesky().is_some(), "positive definite");
    }

    #[test]
    fn forward_dynamics_undoes_inverse_dynamics((model, [q, qd, qdd]) in robot_in_motion()) {
        let mut data = Data::new(&model);
        let effort = rnea(&model, &mut data, &q, &qd, &qdd).to_vec();
        let again = forward_dynamics(&model, &mut data, &q, &qd, &effort, &[]);
        prop_assert!(difference(again, &qdd) < 1e-8);
    }

    #[test]
    fn a_wrench_on_a_link_is_its_jacobian_transposed_as_effort(
        (model, [q, qd, effort]) in robot_in_motion(),
        link in any::<prop::sample::Index>(),
        wrench in prop::array::uniform6(-20.0..20.0_f64),
    ) {
        let mut data = Data::new(&model);
        let link = link.index(model.links().len());
        let (force_n, moment_nm) =
            (Vector3::from_row_slice(&wrench[..3]), Vector3::from_row_slice(&wrench[3..]));
        let pushed = [Wrench { link, force_n, moment_nm }];
        let pushed = forward_dynamics(&model, &mut data, &q, &qd, &effort, &pushed).to_vec();
        let jacobian = link_jacobian(&model, &mut data, link);
        let equal = DVector::from_vec(effort) + jacobian.transpose() * DVector::from_row_slice(&wrench);
        let equal = forward_dynamics(&model, &mut data, &q, &qd, equal.as_slice(), &[]);
        prop_assert!(difference(&pushed, equal) < 1e-8);
    }

    #[test]
    fn regressor_times_parameters_is_rnea((mut model, [q, qd, qdd]) in robot_in_motion()) {
        let tool = Inertia::new(1.3, [0.1, 0.02, -0.1], [0.01, 0.001, 0.0, 0.02, 0.0, 0.015]);
        model.set_tool(model.links().len() - 1, tool);
        let mut data = Data::new(&model);
        let effort = rnea(&model, &mut data, &q, &qd, &qdd).to_vec();
        let parameters: Vec<f64> =
            (0..model.dof() + model.followers().len()).flat_map(|body| model.body_parameters(body)).collect();
        let product = regressor(&model, &mut data, &q, &qd, &qdd) * DVector::from_vec(parameters);
        prop_assert!(difference(product.as_slice(), &effort) < 1e-12);
    }

    #[test]
    fn jacobians_are_the_derivatives_of_poses((model, [q, ..]) in robot_in_motion()) {
        let step = 1e-6;
        let mut data = Data::new(&model);
        for link in 0..model.links().len() {
            forward_kinematics(&model, &mut data, &q);
            let jacobian = link_jacobian(&model, &mut data, link).clone();
            for j in 0..model.dof() {
                let mut at = |offset: f64| {
                    let mut q = q.clone();
                    q[j] += offset;
                    forward_kinematics(&model, &mut data, &q);
                    link_pose(&model, &data, link)
                };
                let (before, after) = (at(-step), at(step));
                let moved = after.translation.vector - before.translation.vector;
                let turned = (after.rotation * before.rotation.inverse()).scaled_axis();
                let column = [moved / (2.0 * step), turned / (2.0 * step)].map(<[f64; 3]>::from);
                let column = [column[0], column[1]].concat();
                prop_assert!(difference(jacobian.column(j).as_slice(), &column) < 1e-8);
            }
        }
    }

    #[test]
    fn a_tool_is_a_link_fixed_there(
        (model, [q, qd, qdd]) in robot_in_motion(),
        link in any::<prop::sample::Index>(),
        mass_kg in 0.1..4.0_f64,
        com_m in prop::array::uniform3(-0.3..0.3_f64),
    ) {
        let link = link.index(model.links().len());
        let inertia_kgm2 = [0.02, 0.003, -0.001, 0.03, 0.002, 0.025];
        let tool = Inertia::new(mass_kg, com_m, inertia_kgm2);
        let mut data = Data::new(&model);
        let without = rnea(&model, &mut data, &q, &qd, &qdd).to_vec();
        // By hand: what the tool's momentum takes, through the link's Jacobian.
        let by_hand = DVector::from_row_slice(&without)
            + tool_effort(&model, link, mass_kg, com_m, inertia_kgm2, [&q, &qd, &qdd]);
        let mut with = model.clone();
        with.set_tool(0, Inertia::new(9.0, [1.0; 3], [1.0; 6]));
        with.set_tool(link, tool);
        let effort = rnea(&with, &mut data, &q, &qd, &qdd).to_vec();
        prop_assert!(difference(&effort, by_hand.as_slice()) < 1e-5);
        let mut attached = model.clone();
        attached.attach(link, tool);
        prop_assert!(difference(rnea(&attached, &mut data, &q, &qd, &qdd), &effort) < 1e-12);
        with.set_tool(link, Inertia::zero());
        prop_assert!(difference(rnea(&with, &mut data, &q, &qd, &qdd), &without) < 1e-12);
    }

    #[test]
    fn what_follows_a_joint_costs_that_joint_what_it_would_cost_alone(
        xml in robot(),
        seed in -2.0..2.0_f64,
    ) {
        let model = Model::from_urdf(&xml).unwrap();
        let alone = Model::from_urdf(&without_mimics(&xml)).unwrap();
        let n = model.dof();
        let motion: Vec<f64> = (0..n).map(|j| (seed + j as f64).sin()).collect();
        // Of each joint of the robot in which none follows another: the joint that moves it, ratio and offset.
        let moved: Vec<(usize, f64, f64)> = alone
            .joint_names()
            .map(|name| {
                let follower = model.followers().iter().find(|one| one.name == name);
                let own = |one: &Follower| (one.joint, one.ratio, one.offset);
                follower.map_or_else(|| (model.joint_index(name).unwrap(), 1.0, 0.0), own)
            })
            .collect();
        let q: Vec<f64> = moved.iter().map(|(j, ratio, offset)| ratio * motion[*j] + offset).collect();
        let qd: Vec<f64> = moved.iter().map(|(j, ratio, _)| ratio * motion[*j]).collect();
        let (mut data, mut other) = (Data::new(&model), Data::new(&alone));
        let mut wanted = vec![0.0; n];
        for ((joint, ratio, _), effort) in moved.iter().zip(rnea(&alone, &mut other, &q, &qd, &qd)) {
            wanted[*joint] += ratio * effort;
        }
        let effort = rnea(&model, &mut data, &motion, &motion, &motion);
        prop_assert!(difference(effort, &wanted) < 1e-12);
        let link = model.links().len() - 1;
        forward_kinematics(&model, &mut data, &motion);
        forward_kinematics(&alone, &mut other, &q);
        let far = link_pose(&model, &data, link).inverse() * link_pose(&alone, &other, link);
        prop_assert!(far.translation.vector.norm() < 1e-12);
    }

    #[test]
    fn the_order_of_the_document_does_not_matter(xml in robot(), seed in -2.0..2.0_f64) {
        let model = Model::from_urdf(&xml).unwrap();
        let shuffled = Model::from_urdf(&with_parts_reversed(&xml)).unwrap();
        let place: Vec<usize> =
            model.joint_names().map(|name| shuffled.joint_index(name).unwrap()).collect();
        let motion: Vec<f64> = (0..model.dof()).map(|j| (seed + j as f64).sin()).collect();
        let mut moved = vec![0.0; model.dof()];
        for (&to, value) in place.iter().zip(&motion) {
            moved[to] = *value;
        }
        let (mut data, mut other) = (Data::new(&model), Data::new(&shuffled));
        let effort = rnea(&model, &mut data, &motion, &motion, &motion);
        let other = rnea(&shuffled, &mut other, &moved, &moved, &moved);
        let other: Vec<f64> = place.iter().map(|&to| other[to]).collect();
        prop_assert!(difference(&other, effort) < 1e-12);
    }
}

/// Newton and Euler for a body fixed to a link, in world axes, with velocities by finite differences.
fn tool_effort(
    model: &Model,
    link: usize,
    mass_kg: f64,
    com_m: [f64; 3],
    [xx, xy, xz, yy, yz, zz]: [f64; 6],
    [q, qd, qdd]: [&[f64]; 3],
) -> DVector<f64> {
    let mut data = Data::new(model);
    let local = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    // The Jacobian of the tool's centre, and its angular momentum's factor, at a time around now.
    let mut at = |t: f64| {
        let q: Vec<f64> = (0..q.len())
            .map(|j| q[j] + qd[j] * t + 0.5 * qdd[j] * t * t)
            .collect();
        let qd = DVector::from_iterator(q.len(), (0..q.len()).map(|j| qd[j] + qdd[j] * t));
        forward_kinematics(model, &mut data, &q);
        let pose = link_pose(model, &data, link);
        let lever = pose.rotation * Vector3::from(com_m);
        let mut jacobian = link_jacobian(model, &mut data, link).clone();
        for mut column in jacobian.column_iter_mut() {
            let angular: Vector3<f64> = column.fixed_rows::<3>(3).into();
            let linear = column.fixed_rows::<3>(0) + angular.cross(&lever);
            column.fixed_rows_mut::<3>(0).copy_from(&linear);
        }
        let velocity = &jacobian * qd;
        let rotation: Rotation3<f64> = pose.rotation.to_rotation_matrix();
        let turning = rotation * local * rotation.transpose() * velocity.fixed_rows::<3>(3);
        let momentum = nalgebra::Vector6::from_iterator(
            velocity
                .iter()
                .take(3)
                .map(|v| v * mass_kg)
                .chain(turning.iter().copied()),
        );
        (jacobian, momentum)
    };
    let step = 1e-5;
    let (jacobian, _) = at(0.0);
    let mut rate = (at(step).1 - at(-step).1) / (2.0 * step);
    let weight = Vector3::from(model.gravity()) * mass_kg;
    let mut linear = rate.fixed_rows_mut::<3>(0);
    linear -= weight;
    jacobian.transpose() * rate
}

/// The robot with its followers as independent joints.
fn without_mimics(xml: &str) -> String {
    let mut parts = xml.split("<mimic ");
    let first = parts.next().unwrap().to_owned();
    first
        + &parts
            .map(|part| part.split_once("/>").unwrap().1)
            .collect::<String>()
}

/// The robot with its elements in the opposite order.
fn with_parts_reversed(xml: &str) -> String {
    let document = xml
        .replace("<joint", "\u{1}<joint")
        .replace("<link", "\u{1}<link");
    let document = document.replace("</robot>", "\u{1}</robot>");
    let parts: Vec<&str> = document.split('\u{1}').collect();
    let (head, rest) = parts.split_first().unwrap();
    let (tail, body) = rest.split_last().unwrap();
    let body: String = body.iter().rev().copied().collect();
    format!("{head}{body}{tail}")
}
