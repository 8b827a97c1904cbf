//! `geometry_msgs/msg/InertiaStamped`: how a tool that is taken up makes itself known.

use serde::{Deserialize, Serialize};

use super::header::{HEADER, Header, TIME};
use super::wrench_stamped::{VECTOR3, Vector3};
use super::{DecodeError, Message};

/// `geometry_msgs/msg/Inertia`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Inertia {
    /// Mass \[kg\].
    pub m: f64,
    /// Centre of mass \[m\].
    pub com: Vector3,
    /// Inertia about the centre of mass \[kg m²\], this and the following.
    pub ixx: f64,
    /// xy.
    pub ixy: f64,
    /// xz.
    pub ixz: f64,
    /// yy.
    pub iyy: f64,
    /// yz.
    pub iyz: f64,
    /// zz.
    pub izz: f64,
}

/// `geometry_msgs/msg/InertiaStamped`: mass, centre of mass and inertia in the header's frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct InertiaStamped {
    /// Time, and the link whose frame is meant.
    pub header: Header,
    /// The inertia.
    pub inertia: Inertia,
}

impl Message for InertiaStamped {
    const TYPE: &'static str = "geometry_msgs/msg/InertiaStamped";
    const TEXT: &'static str = "std_msgs/Header header\nInertia inertia\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[
        HEADER,
        TIME,
        (
            "geometry_msgs/Inertia",
            "float64 m\ngeometry_msgs/Vector3 com\nfloat64 ixx\nfloat64 ixy\nfloat64 ixz\n\
             float64 iyy\nfloat64 iyz\nfloat64 izz\n",
        ),
        VECTOR3,
    ];
    const TYPE_HASH: &'static str =
        "RIHS01_766be45976252babf7f9d8ac4ae7c912a7ceccf71035622529f27518b695aa09";

    fn check(&self) -> Result<(), DecodeError> {
        self.header.stamp.check()
    }
}
