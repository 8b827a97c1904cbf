//! The joint-space mass matrix.

use nalgebra::{DMatrix, Vector3};

use crate::data::check_lengths;
use crate::{Data, Model};

/// The mass matrix \[kg m², kg m, kg\] at `q`, tool included: n x n, symmetric, both triangles filled,
/// by the composite-rigid-body algorithm (RBDA section 6.2).
///
/// # Panics
/// If `q` is not one number per joint, or `data` was made for a model with another number of joints.
pub fn mass_matrix<'d>(model: &Model, data: &'d mut Data, q: &[f64]) -> &'d DMatrix<f64> {
    check_lengths(model, data, &[q]);
    let Data {
        slots, mass_matrix, ..
    } = data;
    for (body, slot) in model.bodies.iter().zip(&mut slots[1..]) {
        body.place(q[body.joint], slot);
        slot.composite = body.inertia();
    }
    // Joints on different branches do not feel each other.
    mass_matrix.fill(0.0);
    for (i, body) in model.bodies.iter().enumerate().rev() {
        let slot = &slots[i + 1];
        let composite = slot.composite;
        // What a unit acceleration along the axis takes.
        let z = Vector3::z();
        let (mut force, mut moment) = if body.prismatic {
            (z * composite.mass, composite.first_moment.cross(&z))
        } else {
            (
                z.cross(&composite.first_moment),
                composite.rotational.column(2).into(),
            )
        };
        let mut at = i + 1;
        loop {
            let here = &model.bodies[at - 1];
            let value = if here.prismatic { force.z } else { moment.z };
            mass_matrix[(here.joint, body.joint)] = value;
            mass_matrix[(body.joint, here.joint)] = value;
            if here.parent == 0 {
                break;
            }
            let slot = &slots[at];
            force = slot.rotation * force;
            moment = slot.rotation * moment + slot.translation.cross(&force);
            at = here.parent;
        }
        if body.parent > 0 {
            let slot = &slots[i + 1];
            let moved = composite.moved(&slot.rotation, &slot.translation);
            slots[body.parent].composite += moved;
        }
    }
    mass_matrix
}
