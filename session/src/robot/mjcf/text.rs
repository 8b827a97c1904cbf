//! Poses and names as a URDF writes them.

use mjcf_rs::Pose;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// A pose of the parser's as one of ours.
pub fn isometry(pose: &Pose) -> Isometry3<f64> {
    let (p, q) = (pose.translation, pose.rotation);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z));
    Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), rotation)
}

/// An `<origin>`.
pub fn origin(at: &Isometry3<f64>) -> String {
    let (p, [roll, pitch, yaw]) = (at.translation, angles(&at.rotation));
    format!(
        "<origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>",
        p.x, p.y, p.z
    )
}

/// Roll, pitch and yaw about fixed axes \[rad\], also where the pitch is a right angle.
fn angles(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let m = rotation.to_rotation_matrix();
    let level = m[(0, 0)].hypot(m[(1, 0)]);
    let pitch = (-m[(2, 0)]).atan2(level);
    if level > 1e-7 {
        [
            m[(2, 1)].atan2(m[(2, 2)]),
            pitch,
            m[(1, 0)].atan2(m[(0, 0)]),
        ]
    } else {
        // Roll and yaw turn about the same axis.
        [0.0, pitch, (-m[(0, 1)]).atan2(m[(1, 1)])]
    }
}

/// A name as an XML attribute.
pub fn escaped(name: &str) -> String {
    name.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
}
