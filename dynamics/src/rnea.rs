//! Inverse dynamics: the effort of a motion.

use nalgebra::{Matrix3, Vector3};

use crate::data::Data;
use crate::data::{Slot, check_lengths};
use crate::model::Model;

/// Computes the effort \[N m or N\] of the motion `q`, `qd`, `qdd` at each joint, gravity and tool included: the
/// recursive Newton-Euler algorithm (RBDA section 5.3).
///
/// In the form of Luh, Walker and Paul (1980) with classical accelerations in body frames. The moment is computed
/// from the pseudo-inertia ∫ r rᵀ dm instead of the inertia, so that one matrix, \[α×\] + \[ω×\]², gives a body's
/// force, its moment and the acceleration of its children's origins.
///
/// # Panics
/// If a slice does not have one number per joint, or `data` was made for a model with another number of joints.
pub fn rnea<'d>(
    model: &Model,
    data: &'d mut Data,
    q: &[f64],
    qd: &[f64],
    qdd: &[f64],
) -> &'d [f64] {
    check_lengths(model, data, &[q, qd, qdd]);
    recursion(model, data, |j| (q[j], qd[j], qdd[j]))
}

/// Computes the effort \[N m or N\] that holds the robot at rest at `q` against gravity, tool included: [`rnea`]
/// without motion.
///
/// # Panics
/// As [`rnea`].
pub fn gravity_effort<'d>(model: &Model, data: &'d mut Data, q: &[f64]) -> &'d [f64] {
    check_lengths(model, data, &[q]);
    recursion(model, data, |j| (q[j], 0.0, 0.0))
}

#[inline]
fn recursion<'d>(
    model: &Model,
    data: &'d mut Data,
    motion: impl Fn(usize) -> (f64, f64, f64),
) -> &'d [f64] {
    accelerate(model, data, motion);
    for (i, body) in model.bodies.iter().enumerate() {
        let slot = &mut data.slots[i + 1];
        let load = &body.load;
        let (spin, k, a, h) = (
            &slot.spin,
            &load.pseudo_inertia,
            &slot.linear,
            &load.first_moment,
        );
        slot.force = a * load.mass + spin * h;
        let m = spin * k;
        slot.moment = Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12) + h.cross(a);
    }
    let Data { slots, effort, .. } = data;
    effort.fill(0.0);
    for (i, body) in model.bodies.iter().enumerate().rev() {
        let (done, rest) = slots.split_at_mut(i + 1);
        let (parent, slot) = (&mut done[body.parent], &rest[0]);
        let own = if body.prismatic {
            slot.force.z
        } else {
            slot.moment.z
        };
        effort[body.joint] += body.ratio * own;
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
pub(crate) fn accelerate(
    model: &Model,
    data: &mut Data,
    motion: impl Fn(usize) -> (f64, f64, f64),
) {
    let base = &mut data.slots[0];
    base.linear = -model.gravity;
    for (i, body) in model.bodies.iter().enumerate() {
        let (done, rest) = data.slots.split_at_mut(i + 1);
        let (parent, slot) = (&done[body.parent], &mut rest[0]);
        let (q, qd, qdd) = motion(body.joint);
        slot.place(body, q);
        let (qd, qdd) = (body.ratio * qd, body.ratio * qdd);
        follow(parent, slot, body.prismatic, qd, qdd);
    }
}

/// Computes velocity and acceleration of a body from those of its parent; the joint's axis is the body's z.
#[inline]
fn follow(parent: &Slot, slot: &mut Slot, prismatic: bool, qd: f64, qdd: f64) {
    let r = &slot.rotation;
    let mut omega = r.tr_mul(&parent.omega);
    let mut alpha = r.tr_mul(&parent.alpha);
    let mut linear = r.tr_mul(&(parent.linear + parent.spin * slot.translation));
    if prismatic {
        // Coriolis: 2 ω × z qd.
        linear.x += 2.0 * omega.y * qd;
        linear.y -= 2.0 * omega.x * qd;
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
fn spin(w: &Vector3<f64>, a: &Vector3<f64>) -> Matrix3<f64> {
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
