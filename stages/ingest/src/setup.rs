//! Facts of a cell that its source needs.

/// Facts of a cell that its source needs; the program determines them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Setup {
    /// The cell's name: the prefix of tauscope's own Zenoh keys.
    pub cell: String,
    /// The joints, in URDF order.
    pub joint_names: Vec<String>,
    /// Effort limit of each joint in the robot file \[N m or N\]; empty without a robot file.
    pub effort_limits: Vec<Option<f64>>,
    /// The attached tool, unless a topic reports another one.
    pub tool: Option<Tool>,
    /// Whether the link that carries tools is known.
    pub has_tool_link: bool,
}

/// A tool, in the frame of the link it is attached to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tool {
    /// Mass \[kg\].
    pub mass_kg: f64,
    /// Centre of mass \[m\].
    pub com_m: [f64; 3],
    /// Inertia about the centre of mass: xx, xy, xz, yy, yz, zz \[kg m²\].
    pub inertia_kgm2: [f64; 6],
}

impl Tool {
    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.mass_kg.is_finite()
            && self.com_m.iter().all(|value| value.is_finite())
            && self.inertia_kgm2.iter().all(|value| value.is_finite())
    }
}
