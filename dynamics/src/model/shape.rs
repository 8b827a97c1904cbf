//! Shapes of links, for drawing.

use nalgebra::Isometry3;

/// One `<visual>` of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Pose of the geometry in the link's frame.
    pub origin: Isometry3<f64>,
    /// Geometry.
    pub geometry: Geometry,
}

/// A geometry, centred on its origin.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// A box with edges along x, y and z.
    Box {
        /// Lengths of the edges \[m\].
        size_m: [f64; 3],
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius \[m\].
        radius_m: f64,
        /// Length \[m\].
        length_m: f64,
    },
    /// A sphere.
    Sphere {
        /// Radius \[m\].
        radius_m: f64,
    },
    /// A mesh in a file.
    Mesh {
        /// Path or URI as in the URDF; not resolved.
        filename: String,
        /// Factors along x, y and z.
        scale: [f64; 3],
    },
}
