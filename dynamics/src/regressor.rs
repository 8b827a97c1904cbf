//! Inverse dynamics as a matrix: what each inertial parameter adds to each joint's effort.

use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3};

use crate::data::Data;
use crate::data::check_lengths;
use crate::inertia::PARAMETERS_PER_BODY;
use crate::model::Model;
use crate::rnea::accelerate;

/// The joint-torque regressor Y of the motion, with effort = Y θ: n x 10 n. Row i is joint i; columns
/// 10 j to 10 j + 9 are the parameters of the body that joint j moves, in the frame of its child link:
/// m, m c (x, y, z), and the inertia about the frame's origin (xx, xy, xz, yy, yz, zz), as
/// [`Model::body_parameters`] gives them (Atkeson, An and Hollerbach, "Estimation of Inertial
/// Parameters of Manipulator Loads and Links", 1986; Siciliano et al., *Robotics*, 2009, section 7.2.2).
///
/// # Panics
/// If a slice is not one number per joint, or `data` was made for a model with another number of
/// joints.
pub fn regressor<'d>(
    model: &Model,
    data: &'d mut Data,
    q: &[f64],
    qd: &[f64],
    qdd: &[f64],
) -> &'d DMatrix<f64> {
    check_lengths(model, data, &[q, qd, qdd]);
    accelerate(model, data, |j| (q[j], qd[j], qdd[j]));
    let Data {
        slots, regressor, ..
    } = data;
    // A body loads only the joints that carry it.
    regressor.fill(0.0);
    for (i, body) in model.bodies.iter().enumerate() {
        let slot = &slots[i + 1];
        // The body's motion along the child link's axes.
        let to_link = body.alignment.transpose();
        let (force, moment) = body_columns(
            &(to_link * slot.omega),
            &(to_link * slot.alpha),
            &(to_link * slot.linear),
            &(to_link * slot.spin * body.alignment),
        );
        let (mut force, mut moment) = (body.alignment * force, body.alignment * moment);
        let first = PARAMETERS_PER_BODY * body.joint;
        let mut at = i + 1;
        while at > 0 {
            let (here, slot) = (&model.bodies[at - 1], &slots[at]);
            let row = if here.prismatic {
                force.row(2)
            } else {
                moment.row(2)
            };
            regressor
                .fixed_view_mut::<1, PARAMETERS_PER_BODY>(here.joint, first)
                .copy_from(&row);
            force = slot.rotation * force;
            moment = slot.rotation * moment + slot.translation.cross_matrix() * force;
            at = here.parent;
        }
    }
    regressor
}

type Columns = SMatrix<f64, 3, PARAMETERS_PER_BODY>;

/// Force and moment about the origin by each parameter of one body.
fn body_columns(
    w: &Vector3<f64>,
    alpha: &Vector3<f64>,
    a: &Vector3<f64>,
    spin: &Matrix3<f64>,
) -> (Columns, Columns) {
    let (mut force, mut moment) = (Columns::zeros(), Columns::zeros());
    force.set_column(0, a);
    force.fixed_view_mut::<3, 3>(0, 1).copy_from(spin);
    moment
        .fixed_view_mut::<3, 3>(0, 1)
        .copy_from(&-a.cross_matrix());
    let euler = inertia_columns(alpha) + w.cross_matrix() * inertia_columns(w);
    moment.fixed_view_mut::<3, 6>(0, 4).copy_from(&euler);
    (force, moment)
}

/// The matrix L(v) with I v = L(v) (xx, xy, xz, yy, yz, zz).
fn inertia_columns(v: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let (x, y, z) = (v.x, v.y, v.z);
    #[rustfmt::skip]
    let columns = SMatrix::<f64, 3, 6>::new(
        x,   y,   z,   0.0, 0.0, 0.0,
        0.0, x,   0.0, y,   z,   0.0,
        0.0, 0.0, x,   0.0, y,   z,
    );
    columns
}
