//! Inverse dynamics: the effort of a motion.

use nalgebra::{Matrix3, Vector3};

use crate::data::Data;
use crate::data::{Slot, check_lengths};
use crate::model::Model;
use crate::real::{Real, matrix, vector};

/// Computes the effort \[N m or N\] of the motion `q`, `qd`, `qdd` at each joint, gravity and tool included: the
/// recursive Newton-Euler algorithm (RBDA section 5.3).
///
/// In the form of Luh, Walker and Paul (1980) with classical accelerations in body frames. The moment is computed
/// from the pseudo-inertia ∫ r rᵀ dm instead of the inertia, so that one matrix, \[α×\] + \[ω×\]², gives a body's
/// force, its moment and the acceleration of its children's origins.
///
/// # Panics
/// If a slice does not have one number per joint, or `data` was made for a model with another number of joints.
pub fn rnea<'d, T: Real>(
    model: &Model,
    data: &'d mut Data<T>,
    q: &[T],
    qd: &[T],
    qdd: &[T],
) -> &'d [T] {
    check_lengths(model, data, &[q, qd, qdd]);
    recursion(model, data, |j| (q[j], qd[j], qdd[j]))
}

/// Computes the effort \[N m or N\] that holds the robot at rest at `q` against gravity, tool included: [`rnea`]
/// without motion.
///
/// # Panics
/// As [`rnea`].
pub fn gravity_effort<'d, T: Real>(model: &Model, data: &'d mut Data<T>, q: &[T]) -> &'d [T] {
    check_lengths(model, data, &[q]);
    recursion(model, data, |j| (q[j], T::zero(), T::zero()))
}

#[inline]
fn recursion<'d, T: Real>(
    model: &Model,
    data: &'d mut Data<T>,
    motion: impl Fn(usize) -> (T, T, T),
) -> &'d [T] {
    accelerate(model, data, motion);
    for (i, body) in model.bodies.iter().enumerate() {
        let slot = &mut data.slots[i + 1];
        let load = &body.load;
        let k = matrix::<T>(&load.pseudo_inertia);
        let h = vector::<T>(&load.first_moment);
        let (spin, a) = (&slot.spin, &slot.linear);
        slot.force = a * T::splat(load.mass) + spin * h;
        let m = spin * k;
        slot.moment = Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12) + h.cross(a);
    }
    let Data { slots, effort, .. } = data;
    effort.fill(T::zero());
    for (i, body) in model.bodies.iter().enumerate().rev() {
        let (done, rest) = slots.split_at_mut(i + 1);
        let (parent, slot) = (&mut done[body.parent], &rest[0]);
        let own = if body.prismatic {
            slot.force.z
        } else {
            slot.moment.z
        };
        effort[body.joint] += T::splat(body.ratio) * own;
        if body.parent > 0 {
            let force = slot.rotation * slot.force;
            parent.moment += slot.rotation * slot.moment + slot.translation.cross(&force);
            parent.force += force;
        }
    }
    effort
}

/// Computes pose, angular velocity and accelerations of every body.
#[inline]
pub(crate) fn accelerate<T: Real>(
    model: &Model,
    data: &mut Data<T>,
    motion: impl Fn(usize) -> (T, T, T),
) {
    let base = &mut data.slots[0];
    base.linear = vector(&-model.gravity);
    for (i, body) in model.bodies.iter().enumerate() {
        let (done, rest) = data.slots.split_at_mut(i + 1);
        let (parent, slot) = (&done[body.parent], &mut rest[0]);
        let (q, qd, qdd) = motion(body.joint);
        slot.place(body, q);
        let ratio = T::splat(body.ratio);
        let (qd, qdd) = (ratio * qd, ratio * qdd);
        follow(parent, slot, body.prismatic, qd, qdd);
    }
}

/// Computes velocity and acceleration of a body from those of its parent; the joint's axis is the body's z.
#[inline]
fn follow<T: Real>(parent: &Slot<T>, slot: &mut Slot<T>, prismatic: bool, qd: T, qdd: T) {
    let r = &slot.rotation;
    let mut omega = r.tr_mul(&parent.omega);
    let mut alpha = r.tr_mul(&parent.alpha);
    let mut linear = r.tr_mul(&(parent.linear + parent.spin * slot.translation));
    if prismatic {
        // Coriolis: 2 ω × z qd.
        let twice = qd + qd;
        linear.x += omega.y * twice;
        linear.y -= omega.x * twice;
        linear.z += qdd;
    } else {
        // ω × z qd.
        alpha.x += omega.y * qd;
        alpha.y -= omega.x * qd;
        alpha.z += qdd;
        omega.z += qd;
    }
    slot.spin = spin(&omega, &alpha);
    slot.omega = omega;
    slot.alpha = alpha;
    slot.linear = linear;
}

/// \[α×\] + \[ω×\]².
#[inline]
fn spin<T: Real>(w: &Vector3<T>, a: &Vector3<T>) -> Matrix3<T> {
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
    Matrix3::new(
        -yy - zz,
        xy - a.z,
        xz + a.y,
        xy + a.z,
        -xx - zz,
        yz - a.x,
        xz - a.y,
        yz + a.x,
        -xx - yy,
    )
}
