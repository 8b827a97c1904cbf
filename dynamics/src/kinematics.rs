//! Poses and Jacobians of the links.

use nalgebra::{Isometry3, Matrix6xX, Rotation3, UnitQuaternion, Vector3};

use crate::data::Data;
use crate::data::{Slot, check_lengths};
use crate::model::Model;
use crate::real::{Real, vector};

/// Computes the pose of every link at the positions `q` \[rad or m\] for [`link_pose`] and [`link_jacobian`] (RBDA
/// section 4.4).
///
/// # Panics
/// If `q` does not have one number per joint, or `data` was made for a model with another number of joints.
pub fn forward_kinematics<T: Real>(model: &Model, data: &mut Data<T>, q: &[T]) {
    check_lengths(model, data, &[q]);
    for (i, body) in model.bodies.iter().enumerate() {
        let (done, rest) = data.slots.split_at_mut(i + 1);
        let (parent, slot) = (&done[body.parent], &mut rest[0]);
        slot.place(body, q[body.joint]);
        slot.world_rotation = parent.world_rotation * slot.rotation;
        slot.world_translation =
            parent.world_translation + parent.world_rotation * slot.translation;
        let axis: Vector3<T> = slot.world_rotation.column(2) * T::splat(body.ratio);
        (slot.angular, slot.linear_at_origin) = if body.prismatic {
            (Vector3::zeros(), axis)
        } else {
            (axis, slot.world_translation.cross(&axis))
        };
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
pub fn link_jacobian<'d, T: Real>(
    model: &Model,
    data: &'d mut Data<T>,
    link: usize,
) -> &'d Matrix6xX<T> {
    let Data {
        slots, jacobian, ..
    } = data;
    jacobian.as_mut_slice().fill(T::zero());
    columns(
        model,
        slots,
        link,
        &Vector3::zeros(),
        |j, linear, angular| {
            let mut column = jacobian.fixed_columns_mut::<1>(j);
            column.fixed_rows_mut::<3>(0).copy_from(&linear);
            column.fixed_rows_mut::<3>(3).copy_from(&angular);
        },
    );
    jacobian
}

/// World position \[m\] of the point `point_m` \[m, in the link's frame\] of a link, after [`forward_kinematics`].
/// `column` is called with each nonzero column of its Jacobian: joint, linear velocity of the point, angular
/// velocity, along the world's axes.
///
/// # Panics
/// If `link` is not an index into [`Model::links`].
#[inline]
pub fn point_jacobian(
    model: &Model,
    data: &Data,
    link: usize,
    point_m: &Vector3<f64>,
    column: impl FnMut(usize, Vector3<f64>, Vector3<f64>),
) -> Vector3<f64> {
    columns(model, &data.slots, link, point_m, column)
}

#[inline]
fn columns<T: Real>(
    model: &Model,
    slots: &[Slot<T>],
    link: usize,
    point_m: &Vector3<f64>,
    mut column: impl FnMut(usize, Vector3<T>, Vector3<T>),
) -> Vector3<T> {
    let frame = &model.frames[link];
    let carrier = &slots[frame.slot];
    let on_carrier = vector(&(frame.translation + frame.rotation * point_m));
    let point = carrier.world_translation + carrier.world_rotation * on_carrier;
    let before = |slot: &usize| (*slot > 0).then(|| model.bodies[*slot - 1].parent);
    let chain = |from| std::iter::successors(Some(from), before).take_while(|slot| *slot > 0);
    for at in chain(frame.slot) {
        let joint = model.bodies[at - 1].joint;
        let (mut linear, mut angular) = velocity(&slots[at], &point);
        if model.is_coupled() {
            // A joint that moves several bodies of the chain has one column.
            let also = |slot: &usize| model.bodies[*slot - 1].joint == joint;
            if chain(frame.slot)
                .take_while(|slot| *slot != at)
                .any(|slot| also(&slot))
            {
                continue;
            }
            for slot in chain(at).skip(1).filter(also) {
                let (moved, turned) = velocity(&slots[slot], &point);
                linear += moved;
                angular += turned;
            }
        }
        column(joint, linear, angular);
    }
    point
}

/// Velocity of a point of the world, and angular velocity, for a unit velocity of a body's joint.
#[inline]
fn velocity<T: Real>(slot: &Slot<T>, point: &Vector3<T>) -> (Vector3<T>, Vector3<T>) {
    (
        slot.linear_at_origin + slot.angular.cross(point),
        slot.angular,
    )
}
