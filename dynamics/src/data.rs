//! Working memory of the algorithms.

use nalgebra::{DMatrix, Matrix3, Matrix6, Matrix6xX, Vector3, Vector6};

use crate::inertia::PARAMETERS_PER_BODY;
use crate::model::{Body, Model};

/// Working memory and results for one [`Model`] (or any other with the same tree). Each algorithm overwrites its
/// results; nothing is allocated after [`Data::new`].
#[derive(Debug, Clone)]
pub struct Data {
    /// The base, then one slot per body in traversal order.
    pub(crate) slots: Vec<Slot>,
    pub(crate) articulated: Vec<Articulated>,
    /// Per joint in document order.
    pub(crate) effort: Vec<f64>,
    pub(crate) acceleration: Vec<f64>,
    pub(crate) mass_matrix: DMatrix<f64>,
    pub(crate) regressor: DMatrix<f64>,
    pub(crate) jacobian: Matrix6xX<f64>,
}

/// Pose, motion and load of one body, in its own frame unless stated otherwise.
#[derive(Debug, Clone, Default)]
pub(crate) struct Slot {
    /// Pose in the parent's frame.
    pub rotation: Matrix3<f64>,
    pub translation: Vector3<f64>,
    /// Last angle of the joint \[rad\], with its sine and cosine: derivatives move one joint at a time, so the others
    /// are reused.
    angle: Option<[f64; 3]>,
    /// Angular velocity and acceleration.
    pub omega: Vector3<f64>,
    pub alpha: Vector3<f64>,
    /// \[α×\] + \[ω×\]²: maps a point of the body to its acceleration relative to the origin.
    pub spin: Matrix3<f64>,
    /// Acceleration of the origin, gravity included as an acceleration of the base.
    pub linear: Vector3<f64>,
    /// Force and moment about the origin that the parent exerts on this body.
    pub force: Vector3<f64>,
    pub moment: Vector3<f64>,
    /// Pose in the world.
    pub world_rotation: Matrix3<f64>,
    pub world_translation: Vector3<f64>,
    /// Angular velocity, and velocity of the point at the world's origin, for a unit velocity of the joint.
    pub angular: Vector3<f64>,
    pub linear_at_origin: Vector3<f64>,
    /// Inertia of the subtree from here on.
    pub composite: Composite,
}

/// One body in the articulated-body algorithm; spatial vectors are (angular, linear).
#[derive(Debug, Clone, Default)]
pub(crate) struct Articulated {
    pub inertia: Matrix6<f64>,
    pub bias: Vector6<f64>,
    /// Maps the parent's acceleration to this body's frame.
    pub transform: Matrix6<f64>,
    /// Acceleration caused by the velocities alone.
    pub velocity_product: Vector6<f64>,
    /// Inertia times the joint's axis, its projection on the axis, and the joint's free effort.
    pub column: Vector6<f64>,
    pub pivot: f64,
    pub free_effort: f64,
    pub acceleration: Vector6<f64>,
}

/// A subtree's mass, first moment and pseudo-inertia ∫ r rᵀ dm about the world's origin, along its axes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Composite {
    pub mass: f64,
    pub first_moment: Vector3<f64>,
    pub pseudo_inertia: Matrix3<f64>,
}

impl Slot {
    /// Computes the body's pose in its parent's frame for the joint position `q` \[rad or m\].
    #[inline]
    pub fn place(&mut self, body: &Body, q: f64) {
        let q = body.ratio * q + body.offset;
        let r = &body.rotation;
        if body.prismatic {
            self.rotation = *r;
            self.translation = body.translation + r.column(2) * q;
        } else {
            let (sin, cos) = self.sin_cos(q);
            let (x, y) = (r.column(0), r.column(1));
            self.rotation.set_column(0, &(x * cos + y * sin));
            self.rotation.set_column(1, &(y * cos - x * sin));
            self.rotation.set_column(2, &r.column(2));
            self.translation = body.translation;
        }
    }

    /// Sine and cosine of an angle \[rad\].
    #[inline]
    fn sin_cos(&mut self, angle: f64) -> (f64, f64) {
        match self.angle {
            Some([last, sin, cos]) if last.to_bits() == angle.to_bits() => (sin, cos),
            _ => {
                let (sin, cos) = angle.sin_cos();
                self.angle = Some([angle, sin, cos]);
                (sin, cos)
            }
        }
    }
}

impl Data {
    /// Memory for `model`.
    pub fn new(model: &Model) -> Self {
        let (n, bodies) = (model.dof(), model.bodies.len());
        let mut slots = vec![Slot::default(); bodies + 1];
        slots[0].world_rotation = Matrix3::identity();
        Self {
            slots,
            articulated: vec![Articulated::default(); bodies + 1],
            effort: vec![0.0; n],
            acceleration: vec![0.0; n],
            mass_matrix: DMatrix::zeros(n, n),
            regressor: DMatrix::zeros(n, bodies * PARAMETERS_PER_BODY),
            jacobian: Matrix6xX::zeros(n),
        }
    }
}

/// Panics if a slice does not have one number per joint: a mistake of the caller, like an index out of bounds.
#[track_caller]
pub(crate) fn check_lengths(model: &Model, data: &Data, slices: &[&[f64]]) {
    let n = model.dof();
    assert!(
        data.effort.len() == n && data.slots.len() == model.bodies.len() + 1,
        "Data is for {} joints and {} bodies, the model has {n} and {}",
        data.effort.len(),
        data.slots.len() - 1,
        model.bodies.len()
    );
    for slice in slices {
        assert!(
            slice.len() == n,
            "{} numbers given, the model has {n} joints",
            slice.len()
        );
    }
}
