//! Where the links are, and how they move with the joints.

use nalgebra::{Isometry3, Matrix6xX, Rotation3, UnitQuaternion, Vector3};

use crate::data::check_lengths;
use crate::{Data, Model};

/// Computes the pose of every link at the positions `q` \[rad or m\]; [`link_pose`] and
/// [`link_jacobian`] answer from it (RBDA section 4.4).
///
/// # Panics
/// If `q` is not one number per joint, or `data` was made for a model with another number of joints.
pub fn forward_kinematics(model: &Model, data: &mut Data, q: &[f64]) {
    check_lengths(model, data, &[q]);
    for (i, body) in model.bodies.iter().enumerate() {
        let (done, rest) = data.slots.split_at_mut(i + 1);
        let (parent, slot) = (&done[body.parent], &mut rest[0]);
        body.place(q[body.joint], slot);
        slot.world_rotation = parent.world_rotation * slot.rotation;
        slot.world_translation =
            parent.world_translation + parent.world_rotation * slot.translation;
    }
}

/// Pose of a link's frame in the world after [`forward_kinematics`].
///
/// # Panics
/// If `link` is not an index into [`Model::links`].
pub fn link_pose(model: &Model, data: &Data, link: usize) -> Isometry3<f64> {
    let frame = &model.frames[link];
    let slot = &data.slots[frame.slot];
    let rotation = Rotation3::from_matrix_unchecked(slot.world_rotation * frame.rotation);
    Isometry3::from_parts(
        link_origin(model, data, link).into(),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

/// Origin of a link's frame in the world after [`forward_kinematics`] \[m\].
pub(crate) fn link_origin(model: &Model, data: &Data, link: usize) -> Vector3<f64> {
    let frame = &model.frames[link];
    let slot = &data.slots[frame.slot];
    slot.world_translation + slot.world_rotation * frame.translation
}

/// Jacobian of a link after [`forward_kinematics`]: 6 x n; rows are the linear velocity (x, y, z) of
/// the link's origin and then the angular velocity, along the world's axes; columns are the joints in
/// document order (RBDA section 4.2; Siciliano et al., *Robotics*, 2009, section 3.1.3).
///
/// # Panics
/// If `link` is not an index into [`Model::links`].
pub fn link_jacobian<'d>(model: &Model, data: &'d mut Data, link: usize) -> &'d Matrix6xX<f64> {
    let frame = &model.frames[link];
    let Data {
        slots, jacobian, ..
    } = data;
    jacobian.fill(0.0);
    let carrier = &slots[frame.slot];
    let point = carrier.world_translation + carrier.world_rotation * frame.translation;
    let mut at = frame.slot;
    while at > 0 {
        let (body, slot) = (&model.bodies[at - 1], &slots[at]);
        let axis: Vector3<f64> = slot.world_rotation.column(2).into();
        let mut column = jacobian.column_mut(body.joint);
        if body.prismatic {
            column.fixed_rows_mut::<3>(0).copy_from(&axis);
        } else {
            let lever = point - slot.world_translation;
            column.fixed_rows_mut::<3>(0).copy_from(&axis.cross(&lever));
            column.fixed_rows_mut::<3>(3).copy_from(&axis);
        }
        at = body.parent;
    }
    jacobian
}
