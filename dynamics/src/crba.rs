//! The joint-space mass matrix.

use nalgebra::DMatrix;

use crate::data::Data;
use crate::data::{Composite, check_lengths};
use crate::inertia::symmetric;
use crate::kinematics::forward_kinematics;
use crate::model::Model;
use crate::real::{Real, matrix, vector};

/// The mass matrix \[kg m², kg m, kg\] at `q`, tool included: n x n, symmetric, both triangles filled,
/// by the composite-rigid-body algorithm (RBDA section 6.2). Poses are computed as well, see
/// [`link_pose`](crate::link_pose) and [`link_jacobian`](crate::link_jacobian).
///
/// The algorithm works in the world's frame, in which the inertias of a subtree are summed and a force is the same
/// for every axis.
///
/// # Panics
/// If `q` does not have one number per joint, or `data` was made for a model with another number of joints.
pub fn mass_matrix<'d, T: Real>(model: &Model, data: &'d mut Data<T>, q: &[T]) -> &'d DMatrix<T> {
    check_lengths(model, data, &[q]);
    forward_kinematics(model, data, q);
    let Data {
        slots, mass_matrix, ..
    } = data;
    for (body, slot) in model.bodies.iter().zip(&mut slots[1..]) {
        let (load, rotation, p) = (&body.load, &slot.world_rotation, &slot.world_translation);
        let mass = T::splat(load.mass);
        let h = rotation * vector::<T>(&load.first_moment);
        // ∫ (R r + p)(R r + p)ᵀ dm.
        let shift = p * (h + p * T::splat(0.5 * load.mass)).transpose();
        let turned = rotation * matrix::<T>(&load.pseudo_inertia);
        let entry = |i, j| turned.row(i).dot(&rotation.row(j)) + shift[(i, j)] + shift[(j, i)];
        slot.composite = Composite {
            mass,
            first_moment: h + p * mass,
            pseudo_inertia: symmetric([
                entry(0, 0),
                entry(0, 1),
                entry(0, 2),
                entry(1, 1),
                entry(1, 2),
                entry(2, 2),
            ]),
        };
    }
    // Joints on different branches are not coupled.
    let n = model.dof();
    let entries = mass_matrix.as_mut_slice();
    entries.fill(T::zero());
    for (i, body) in model.bodies.iter().enumerate().rev() {
        let slot = &slots[i + 1];
        let (angular, linear) = (slot.angular, slot.linear_at_origin);
        let Composite {
            mass,
            first_moment,
            pseudo_inertia,
        } = slot.composite;
        // Force for a unit acceleration of the joint; the moment is about the world's origin.
        let force = linear * mass + angular.cross(&first_moment);
        let moment = angular * pseudo_inertia.trace() - pseudo_inertia * angular
            + first_moment.cross(&linear);
        let mut at = i + 1;
        while at > 0 {
            let (here, slot) = (&model.bodies[at - 1], &slots[at]);
            let value = slot.angular.dot(&moment) + slot.linear_at_origin.dot(&force);
            entries[here.joint * n + body.joint] += value;
            if at != i + 1 {
                entries[body.joint * n + here.joint] += value;
            }
            at = here.parent;
        }
        if body.parent > 0 {
            let parent = &mut slots[body.parent].composite;
            parent.mass += mass;
            parent.first_moment += first_moment;
            parent.pseudo_inertia += pseudo_inertia;
        }
    }
    mass_matrix
}
