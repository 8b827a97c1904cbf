//! Inverse dynamics as a matrix: the effort of each joint by inertial parameter.

use nalgebra::{DMatrix, Matrix3, RowVector3, Vector3};

use crate::data::{Data, Slot, check_lengths};
use crate::inertia::PARAMETERS_PER_BODY;
use crate::model::{Body, Model};
use crate::real::{Real, matrix};
use crate::rnea::accelerate;

/// The joint-torque regressor Y of the motion, with effort = Y θ: n x 10 b, with n joints and b bodies: one for each
/// joint, then one for each joint that follows another ([`Model::followers`]). Row i is joint i; columns
/// 10 j to 10 j + 9 are the parameters of the body that joint j moves, in the frame of its child link:
/// m, m c (x, y, z), and the inertia about the frame's origin (xx, xy, xz, yy, yz, zz), as
/// [`Model::body_parameters`] gives them (Atkeson, An and Hollerbach, "Estimation of Inertial
/// Parameters of Manipulator Loads and Links", 1986; Siciliano et al., *Robotics*, 2009, section 7.2.2).
///
/// # Panics
/// If a slice does not have one number per joint, or `data` was made for a model with another number of joints.
pub fn regressor<'d, T: Real>(
    model: &Model,
    data: &'d mut Data<T>,
    q: &[T],
    qd: &[T],
    qdd: &[T],
) -> &'d DMatrix<T> {
    check_lengths(model, data, &[q, qd, qdd]);
    accelerate(model, data, |j| (q[j], qd[j], qdd[j]));
    let Data {
        slots, regressor, ..
    } = data;
    // A body loads only the joints that carry it.
    let n = model.dof();
    let entries = regressor.as_mut_slice();
    entries.fill(T::zero());
    for (i, body) in model.bodies.iter().enumerate() {
        let motion = Motion::of(body, &slots[i + 1]);
        let first = PARAMETERS_PER_BODY * body.block * n;
        // Rotation from the child link's axes to those of the current joint, and the body's origin in its frame.
        let (mut rotation, mut origin) = (matrix::<T>(&body.alignment), Vector3::zeros());
        let mut at = i + 1;
        loop {
            let (here, slot) = (&model.bodies[at - 1], &slots[at]);
            // A unit velocity of the joint about or along its axis z, along the child link's axes.
            let axis = rotation.row(2).transpose();
            let (angular, linear) = if here.prismatic {
                (Vector3::zeros(), axis)
            } else {
                let lever: RowVector3<T> = rotation.row(1) * origin.x - rotation.row(0) * origin.y;
                (axis, lever.transpose())
            };
            let ratio = T::splat(here.ratio);
            let (angular, linear) = (angular * ratio, linear * ratio);
            let columns = entries[first..].chunks_exact_mut(n);
            for (column, value) in columns.zip(motion.power(&angular, &linear)) {
                column[here.joint] += value;
            }
            if here.parent == 0 {
                break;
            }
            rotation = slot.rotation * rotation;
            origin = slot.rotation * origin + slot.translation;
            at = here.parent;
        }
    }
    regressor
}

/// The motion of a body, along the axes of its link.
struct Motion<T: Real> {
    /// Angular velocity \[rad/s\].
    omega: Vector3<T>,
    /// Angular acceleration \[rad/s²\].
    alpha: Vector3<T>,
    /// Acceleration of the origin less gravity \[m/s²\].
    linear: Vector3<T>,
    /// Acceleration of a point of the body relative to `linear`, by its position \[1/s²\].
    spin: Matrix3<T>,
}

impl<T: Real> Motion<T> {
    fn of(body: &Body, slot: &Slot<T>) -> Self {
        let alignment = matrix::<T>(&body.alignment);
        let to_link = alignment.transpose();
        Self {
            omega: to_link * slot.omega,
            alpha: to_link * slot.alpha,
            linear: to_link * slot.linear,
            spin: to_link * slot.spin * alignment,
        }
    }

    /// Power of each inertial parameter if the body moves with `angular` and `linear`: the derivatives of the body's
    /// force and moment about its origin with respect to the parameter, times these velocities. The effort of a joint
    /// is the power for its unit velocity (Jourdain's principle).
    ///
    /// The force is \[a, S, 0\], the moment \[0, -a×, L(α) + ω× L(ω)\], with I v = L(v) (xx, xy, xz, yy, yz, zz). The
    /// product avoids rotating a matrix of 3 x 10 from joint to joint.
    fn power(&self, angular: &Vector3<T>, linear: &Vector3<T>) -> [T; PARAMETERS_PER_BODY] {
        let of_mass = self.linear.dot(linear);
        let of_first_moment = self.spin.tr_mul(linear) + self.linear.cross(angular);
        let of_alpha = inertia_power(&self.alpha, angular);
        let of_omega = inertia_power(&self.omega, &angular.cross(&self.omega));
        let inertia = |k: usize| of_alpha[k] + of_omega[k];
        let [x, y, z] = of_first_moment.into();
        [
            of_mass,
            x,
            y,
            z,
            inertia(0),
            inertia(1),
            inertia(2),
            inertia(3),
            inertia(4),
            inertia(5),
        ]
    }
}

/// L(v)ᵀ w: derivatives of w·I v with respect to the inertia's xx, xy, xz, yy, yz, zz.
fn inertia_power<T: Real>(v: &Vector3<T>, w: &Vector3<T>) -> [T; 6] {
    [
        v.x * w.x,
        v.y * w.x + v.x * w.y,
        v.z * w.x + v.x * w.z,
        v.y * w.y,
        v.z * w.y + v.y * w.z,
        v.z * w.z,
    ]
}
