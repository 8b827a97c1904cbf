//! Shapes of the links: the primitive shapes of the URDF, or a skeleton for links with meshes only, whose files may
//! be missing.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rerun::archetypes::{Boxes3D, Capsules3D, Cylinders3D, Ellipsoids3D};
use rerun::{
    EntityPath, FillMode, Quaternion, Rgba32, SerializationError, SerializedComponentColumn,
};
use tauscope_dynamics::{Data, Geometry, Model, forward_kinematics, link_pose};

use crate::error::RecordError;
use crate::rerun::store::{Out, Store};

/// Radius of a skeleton's bones, relative to the robot's length.
/// Layout: by eye; no number depends on it.
const BONE_RADIUS: f64 = 0.03;
/// Radius of the drum at each joint, relative to the bones' radius.
/// Layout: by eye; no number depends on it.
const DRUM_RADIUS: f32 = 1.25;
/// Length of the drum at each joint, relative to the bones' radius.
/// Layout: by eye; no number depends on it.
const DRUM_LENGTH: f32 = 3.6;

/// The shapes of one link, in its frame.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Shapes {
    boxes: Vec<([f32; 3], Pose)>,
    /// Length, radius and pose; along z, centred at the pose.
    cylinders: Vec<(f32, f32, Pose)>,
    /// Radius and pose.
    spheres: Vec<(f32, Pose)>,
    /// Length, radius and pose; from the pose along z.
    bones: Vec<(f32, f32, Pose)>,
}

/// Translation \[m\] and rotation x, y, z, w.
type Pose = ([f32; 3], [f32; 4]);

/// The shapes of all links of a robot.
pub(super) fn of(model: &Model) -> Vec<Shapes> {
    let mut all: Vec<_> = model
        .links()
        .iter()
        .map(|link| Shapes::simple(&link.shapes))
        .collect();
    // Bones for a robot without primitive shapes, and for each link with meshes only.
    let bare = all.iter().all(Shapes::is_empty);
    let bony: Vec<_> = model
        .links()
        .iter()
        .zip(&all)
        .map(|(link, shapes)| shapes.is_empty() && (bare || !link.shapes.is_empty()))
        .collect();
    if bony.contains(&true) {
        add_skeleton(model, &bony, &mut all);
    }
    all
}

/// Adds bones from each bony link's origin to its children's, and a drum at each joint that moves one.
fn add_skeleton(model: &Model, bony: &[bool], all: &mut [Shapes]) {
    let mut data = Data::new(model);
    forward_kinematics(model, &mut data, &vec![0.0; model.dof()]);
    let pose = |link| link_pose(model, &data, link);
    let bones: Vec<_> = model
        .links()
        .iter()
        .enumerate()
        .filter_map(|(child, link)| link.parent.map(|parent| (parent, child)))
        .map(|(parent, child)| {
            (
                parent,
                (pose(parent).inverse() * pose(child)).translation.vector,
            )
        })
        .collect();
    let length: f64 = bones.iter().map(|(_, bone)| bone.norm()).sum();
    let radius = (BONE_RADIUS * length) as f32;
    for (parent, bone) in bones {
        if bony[parent] && bone.norm() > 1e-6 {
            all[parent]
                .bones
                .push((bone.norm() as f32, radius, along(bone)));
        }
    }
    for joint in model.joints().iter().filter(|joint| bony[joint.child_link]) {
        let drum = (
            DRUM_LENGTH * radius,
            DRUM_RADIUS * radius,
            along(joint.axis.into()),
        );
        all[joint.child_link].cylinders.push(drum);
    }
}

impl Shapes {
    fn simple(shapes: &[tauscope_dynamics::Shape]) -> Self {
        let mut simple = Self::default();
        for shape in shapes {
            let pose = to_pose(&shape.origin);
            match &shape.geometry {
                Geometry::Box { size_m } => {
                    simple
                        .boxes
                        .push((size_m.map(|size| (0.5 * size) as f32), pose));
                }
                Geometry::Cylinder { radius_m, length_m } => {
                    simple
                        .cylinders
                        .push((*length_m as f32, *radius_m as f32, pose));
                }
                Geometry::Sphere { radius_m } => simple.spheres.push((*radius_m as f32, pose)),
                Geometry::Mesh { .. } => {}
            }
        }
        simple
    }

    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Draws them as static data.
    pub fn draw(
        &self,
        entity: &EntityPath,
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<(), RecordError> {
        if !self.boxes.is_empty() {
            let (sizes, poses): (Vec<_>, Vec<_>) = self.boxes.iter().copied().unzip();
            let shapes = Boxes3D::from_half_sizes(sizes)
                .with_centers(translations(&poses))
                .with_quaternions(rotations(&poses))
                .with_fill_mode(FillMode::Solid);
            out(store.always(entity, &shapes)?)?;
        }
        if !self.cylinders.is_empty() {
            let (lengths, radii, poses) = unzip3(&self.cylinders);
            let shapes = Cylinders3D::from_lengths_and_radii(lengths, radii)
                .with_centers(translations(&poses))
                .with_quaternions(rotations(&poses))
                .with_fill_mode(FillMode::Solid);
            out(store.always(entity, &shapes)?)?;
        }
        if !self.spheres.is_empty() {
            let (radii, poses): (Vec<_>, Vec<_>) = self.spheres.iter().copied().unzip();
            let shapes = Ellipsoids3D::from_radii(radii)
                .with_centers(translations(&poses))
                .with_fill_mode(FillMode::Solid);
            out(store.always(entity, &shapes)?)?;
        }
        if !self.bones.is_empty() {
            let (lengths, radii, poses) = unzip3(&self.bones);
            let shapes = Capsules3D::from_lengths_and_radii(lengths, radii)
                .with_translations(translations(&poses))
                .with_quaternions(rotations(&poses))
                .with_fill_mode(FillMode::Solid);
            out(store.always(entity, &shapes)?)?;
        }
        Ok(())
    }

    /// Columns with one colour per row for all shapes.
    pub fn colour_columns(
        &self,
        colours: &[Rgba32],
    ) -> Result<Vec<SerializedComponentColumn>, SerializationError> {
        let colours = || colours.iter().copied();
        let mut columns = Vec::new();
        if !self.boxes.is_empty() {
            let shapes = Boxes3D::update_fields().with_colors(colours());
            columns.extend(shapes.columns_of_unit_batches()?);
        }
        if !self.cylinders.is_empty() {
            let shapes = Cylinders3D::update_fields().with_colors(colours());
            columns.extend(shapes.columns_of_unit_batches()?);
        }
        if !self.spheres.is_empty() {
            let shapes = Ellipsoids3D::update_fields().with_colors(colours());
            columns.extend(shapes.columns_of_unit_batches()?);
        }
        if !self.bones.is_empty() {
            let shapes = Capsules3D::update_fields().with_colors(colours());
            columns.extend(shapes.columns_of_unit_batches()?);
        }
        Ok(columns)
    }
}

fn to_pose(pose: &Isometry3<f64>) -> Pose {
    let translation = pose.translation.vector.map(|metre| metre as f32);
    (
        translation.into(),
        pose.rotation.coords.map(|part| part as f32).into(),
    )
}

/// The pose at the origin whose z axis points along `bone`.
fn along(bone: Vector3<f64>) -> Pose {
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &bone)
        // Opposite direction: any half turn about a horizontal axis.
        .unwrap_or_else(|| {
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        });
    to_pose(&Isometry3::from_parts(Point3::origin().into(), rotation))
}

fn translations(poses: &[Pose]) -> impl Iterator<Item = [f32; 3]> {
    poses.iter().map(|(translation, _)| *translation)
}

fn rotations(poses: &[Pose]) -> impl Iterator<Item = Quaternion> {
    poses
        .iter()
        .map(|(_, rotation)| Quaternion::from_xyzw(*rotation))
}

fn unzip3(shapes: &[(f32, f32, Pose)]) -> (Vec<f32>, Vec<f32>, Vec<Pose>) {
    (
        shapes.iter().map(|shape| shape.0).collect(),
        shapes.iter().map(|shape| shape.1).collect(),
        shapes.iter().map(|shape| shape.2).collect(),
    )
}
