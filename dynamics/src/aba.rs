//! Forward dynamics: the accelerations caused by efforts and contacts.

use nalgebra::{DVector, Matrix6, Vector3, Vector6};

use crate::crba::mass_matrix;
use crate::data::Data;
use crate::data::{Articulated, check_lengths};
use crate::kinematics::{forward_kinematics, link_jacobian};
use crate::model::Model;
use crate::rnea::rnea;

/// An external force and moment on a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// The link, an index into [`Model::links`].
    pub link: usize,
    /// Force on the link along the world's axes \[N\].
    pub force_n: Vector3<f64>,
    /// Moment on it about its origin, along the world's axes \[N m\].
    pub moment_nm: Vector3<f64>,
}

/// Computes the accelerations \[rad/s² or m/s²\] caused by the joint efforts `effort` \[N m or N\] and the external
/// `wrenches` at `q`, `qd`, gravity and tool included: the articulated-body algorithm (RBDA section 7.3), with
/// classical accelerations. Poses are computed as well, so [`crate::link_pose`] and [`crate::link_jacobian`] may be
/// called afterwards.
///
/// A joint that moves no inertia (a point mass on its axis) has no finite acceleration. If joints follow others
/// ([`Model::followers`]), the mass matrix is solved instead, and memory is allocated.
///
/// # Panics
/// If a slice does not have one number per joint, `data` was made for a model with another number of joints, or a
/// wrench names a link that does not exist.
pub fn forward_dynamics<'d>(
    model: &Model,
    data: &'d mut Data,
    q: &[f64],
    qd: &[f64],
    effort: &[f64],
    wrenches: &[Wrench],
) -> &'d [f64] {
    check_lengths(model, data, &[q, qd, effort]);
    if model.is_coupled() {
        return coupled(model, data, q, qd, effort, wrenches);
    }
    forward_kinematics(model, data, q);
    begin(model, data, qd);
    for wrench in wrenches {
        apply(model, data, wrench);
    }
    gather(model, data, effort);
    release(model, data)
}

/// Solves the mass matrix, because a joint may move several bodies: M qdd = effort - bias + Jᵀ wrench (RBDA section
/// 6.1).
fn coupled<'d>(
    model: &Model,
    data: &'d mut Data,
    q: &[f64],
    qd: &[f64],
    effort: &[f64],
    wrenches: &[Wrench],
) -> &'d [f64] {
    let n = model.dof();
    let bias = rnea(model, data, q, qd, &vec![0.0; n]);
    let mut drive = DVector::from_fn(n, |j, _| effort[j] - bias[j]);
    let inertia = mass_matrix(model, data, q).clone();
    for wrench in wrenches {
        let stacked = stack(&wrench.force_n, &wrench.moment_nm);
        drive += link_jacobian(model, data, wrench.link).tr_mul(&stacked);
    }
    match inertia.cholesky() {
        Some(factored) => data
            .acceleration
            .copy_from_slice(factored.solve(&drive).as_slice()),
        // As for a joint that moves no inertia.
        None => data.acceleration.fill(f64::NAN),
    }
    &data.acceleration
}

/// Index of a joint's axis, the body's z, in a spatial vector.
fn axis(prismatic: bool) -> usize {
    if prismatic { 5 } else { 2 }
}

/// Outward pass: velocities, and the inertia and bias force of each body alone.
fn begin(model: &Model, data: &mut Data, qd: &[f64]) {
    let Data {
        slots, articulated, ..
    } = data;
    for (i, body) in model.bodies.iter().enumerate() {
        let (done, rest) = slots.split_at_mut(i + 1);
        let (parent, slot) = (&done[body.parent], &mut rest[0]);
        let qd = qd[body.joint];
        let r = &slot.rotation;
        let carried = r.tr_mul(&parent.omega);
        let centripetal = parent.omega.cross(&parent.omega.cross(&slot.translation));
        let mut angular = Vector3::zeros();
        let mut linear = r.tr_mul(&centripetal);
        let turn = carried.cross(&(Vector3::z() * qd));
        slot.omega = carried;
        if body.prismatic {
            linear += turn * 2.0;
        } else {
            angular = turn;
            slot.omega.z += qd;
        }
        let inertia = body.inertia();
        let w = &slot.omega;
        let hx = inertia.first_moment.cross_matrix();
        let here = &mut articulated[i + 1];
        here.velocity_product = stack(&angular, &linear);
        here.bias = stack(
            &w.cross(&(inertia.rotational * w)),
            &w.cross(&w.cross(&inertia.first_moment)),
        );
        set_block(&mut here.inertia, 0, 0, &inertia.rotational);
        set_block(&mut here.inertia, 0, 3, &hx);
        set_block(&mut here.inertia, 3, 0, &-hx);
        set_block(
            &mut here.inertia,
            3,
            3,
            &nalgebra::Matrix3::from_diagonal_element(inertia.mass),
        );
        let rt = r.transpose();
        set_block(&mut here.transform, 0, 0, &rt);
        set_block(&mut here.transform, 0, 3, &nalgebra::Matrix3::zeros());
        set_block(
            &mut here.transform,
            3,
            0,
            &(-rt * slot.translation.cross_matrix()),
        );
        set_block(&mut here.transform, 3, 3, &rt);
    }
}

/// Subtracts an external wrench from the bias force of the body it acts on.
fn apply(model: &Model, data: &mut Data, wrench: &Wrench) {
    let frame = &model.frames[wrench.link];
    if frame.slot == 0 {
        return; // The base does not move.
    }
    let slot = &data.slots[frame.slot];
    let lever = slot.world_rotation * frame.translation;
    let moment = wrench.moment_nm + lever.cross(&wrench.force_n);
    data.articulated[frame.slot].bias -= stack(
        &slot.world_rotation.tr_mul(&moment),
        &slot.world_rotation.tr_mul(&wrench.force_n),
    );
}

/// Inward pass: articulated inertia and bias force of each subtree (RBDA equations 7.21 to 7.26).
fn gather(model: &Model, data: &mut Data, effort: &[f64]) {
    for (i, body) in model.bodies.iter().enumerate().rev() {
        let (done, rest) = data.articulated.split_at_mut(i + 1);
        let (parent, here): (&mut Articulated, _) = (&mut done[body.parent], &mut rest[0]);
        let axis = axis(body.prismatic);
        here.column = here.inertia.column(axis).into();
        here.pivot = here.column[axis];
        here.free_effort = effort[body.joint] - here.bias[axis];
        if body.parent > 0 {
            let scaled = here.column / here.pivot;
            let inertia = here.inertia - scaled * here.column.transpose();
            let bias = here.bias + inertia * here.velocity_product + scaled * here.free_effort;
            parent.inertia += here.transform.tr_mul(&(inertia * here.transform));
            parent.bias += here.transform.tr_mul(&bias);
        }
    }
}

/// Second outward pass: accelerations (RBDA equations 7.27 to 7.29).
fn release<'d>(model: &Model, data: &'d mut Data) -> &'d [f64] {
    let Data {
        articulated,
        acceleration,
        ..
    } = data;
    articulated[0].acceleration = stack(&Vector3::zeros(), &-model.gravity);
    for (i, body) in model.bodies.iter().enumerate() {
        let (done, rest) = articulated.split_at_mut(i + 1);
        let (parent, here) = (&done[body.parent], &mut rest[0]);
        let carried = here.transform * parent.acceleration + here.velocity_product;
        let qdd = (here.free_effort - here.column.dot(&carried)) / here.pivot;
        here.acceleration = carried;
        here.acceleration[axis(body.prismatic)] += qdd;
        acceleration[body.joint] = qdd;
    }
    acceleration
}

fn stack(angular: &Vector3<f64>, linear: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
    )
}

fn set_block(m: &mut Matrix6<f64>, row: usize, column: usize, block: &nalgebra::Matrix3<f64>) {
    m.fixed_view_mut::<3, 3>(row, column).copy_from(block);
}
