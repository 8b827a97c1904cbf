//! Findings about the bodies of a URDF.

/// Severity of a finding about a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum BodySeverity {
    /// Unusual, or of no effect on the motion: the twin uses the numbers as they are.
    Odd,
    /// No real body has these numbers.
    Impossible,
}

/// A link, and the line of its `<inertial>`, or else of its `<link>`, from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkPlace {
    /// Its name.
    pub link: String,
    /// Its line.
    pub line: u32,
    /// The line of its `<inertia>`, where it has one.
    pub inertia_line: u32,
}

/// A fault in the inertial numbers of one or several links. Moments are principal moments of inertia about the centre of
/// mass, in ascending order \[kg m²\].
#[derive(Debug, Clone, PartialEq)]
pub enum BodyFault {
    /// The inertia is not positive definite.
    NotPositiveDefinite {
        /// Principal moments.
        moments_kgm2: [f64; 3],
        /// The six numbers, where they look like the first two rows of a matrix.
        rows: Option<[f64; 6]>,
    },
    /// The largest principal moment exceeds the sum of the other two.
    TriangleBroken {
        /// Principal moments.
        moments_kgm2: [f64; 3],
        /// An attribute that has a decimal slip, its value, and the value with which a real body would have the numbers.
        slip: Option<(&'static str, f64, f64)>,
    },
    /// The radius of gyration is several times as long as the link and its neighbours.
    TooLarge {
        /// Mass.
        mass_kg: f64,
        /// Root of the largest principal moment over the mass.
        gyration_m: f64,
        /// Longest extent of the link and its neighbours.
        length_m: f64,
    },
    /// The mass is at one point, or nearly so.
    PointMass {
        /// Root of the largest principal moment over the mass; the largest of all links.
        gyration_m: f64,
    },
    /// The link has an inertia, but no mass.
    NoMass {
        /// Largest principal moment.
        moment_kgm2: f64,
    },
    /// The centre of mass is far outside of the link.
    CentreFar {
        /// Distance from the origin of the link's frame.
        distance_m: f64,
        /// Longest extent of the link and its neighbours.
        length_m: f64,
        /// Whether the distance fits the link if it is in mm.
        is_in_mm: bool,
    },
    /// All inertias are in another unit.
    InertiaUnit {
        /// The probable unit.
        unit: &'static str,
        /// That unit in kg m².
        factor: f64,
        /// Whether the masses are in g.
        masses_in_g: bool,
    },
    /// All masses are in g, the inertias in kg m².
    MassUnit {
        /// Sum of the masses that move, as written.
        total: f64,
    },
    /// The distances between the joints are in mm. There is no substitute.
    LengthUnit {
        /// Distance of the farthest point from the base with all joints straight, as written.
        reach_m: f64,
    },
    /// Most links have the same six numbers as their inertia.
    SameInertia {
        /// Principal moments.
        moments_kgm2: [f64; 3],
        /// Number of moving links with a mass.
        of_links: usize,
    },
    /// Most links have the same mass.
    SameMass {
        /// The mass.
        mass_kg: f64,
        /// Number of moving links with a mass.
        of_links: usize,
    },
}

/// Numbers with which the twin works instead of impossible ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Substitute {
    /// Name of the link.
    pub link: String,
    /// Mass \[kg\].
    pub mass_kg: Option<f64>,
    /// Centre of mass, `<origin xyz>` of `<inertial>` \[m\].
    pub com_m: Option<[f64; 3]>,
    /// Inertia along the axes of the `<inertial>`: xx, xy, xz, yy, yz, zz \[kg m²\].
    pub inertia_kgm2: Option<[f64; 6]>,
    /// Principal moments of the uniform cylinder that the inertia is of, the largest first \[kg m²\]; `None` if the
    /// substitute is the URDF's own inertia in another unit.
    pub cylinder_kgm2: Option<[f64; 3]>,
}

/// A finding about the body of one or several links. [`Display`](std::fmt::Display) gives its sentences.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyFinding {
    /// Severity.
    pub severity: BodySeverity,
    /// The links, at least one, in the order of the document.
    pub links: Vec<LinkPlace>,
    /// The fault.
    pub fault: BodyFault,
    /// The substitutes of an impossible body, see [`with_plausible_bodies`](crate::with_plausible_bodies); empty for an odd
    /// one.
    pub substitutes: Vec<Substitute>,
}

impl BodyFinding {
    /// Name of the first link.
    pub fn link(&self) -> &str {
        self.links.first().map_or("", |place| &place.link)
    }

    /// Line of the first link's element with the fault, from 1: `<inertia>` or `<inertial>`.
    pub fn line(&self) -> u32 {
        let is_elsewhere = matches!(
            self.fault,
            BodyFault::CentreFar { .. }
                | BodyFault::NoMass { .. }
                | BodyFault::MassUnit { .. }
                | BodyFault::SameMass { .. }
        );
        self.links.first().map_or(0, |place| {
            if is_elsewhere {
                place.line
            } else {
                place.inertia_line
            }
        })
    }
}
