//! Working memory of the algorithms.

use nalgebra::{DMatrix, Matrix3, Matrix6, Matrix6xX, Vector3, Vector6};

use crate::inertia::PARAMETERS_PER_BODY;
use crate::model::{Body, Model};
use crate::real::{Real, matrix, vector};

/// Working memory and results for one [`Model`] (or any other with the same tree). Each algorithm overwrites its
/// results; nothing is allocated after [`Data::new`]. `T` is `f64` for one sample, [`Lanes`](crate::Lanes) for four.
#[derive(Debug, Clone)]
pub struct Data<T: Real = f64> {
    /// The base, then one slot per body in traversal order.
    pub(crate) slots: Vec<Slot<T>>,
    pub(crate) articulated: Vec<Articulated>,
    /// Per joint in document order.
    pub(crate) effort: Vec<T>,
    pub(crate) acceleration: Vec<f64>,
    pub(crate) mass_matrix: DMatrix<T>,
    pub(crate) regressor: DMatrix<T>,
    pub(crate) jacobian: Matrix6xX<T>,
}

/// Pose, motion and load of one body, in its own frame unless stated otherwise.
#[derive(Debug, Clone)]
pub(crate) struct Slot<T: Real> {
    /// Pose in the parent's frame.
    pub rotation: Matrix3<T>,
    pub translation: Vector3<T>,
    /// Last angle of the joint \[rad\], with its sine and cosine: derivatives move one joint at a time, so the others
    /// are reused.
    angle: Option<[T; 3]>,
    /// Angular velocity and acceleration.
    pub omega: Vector3<T>,
    pub alpha: Vector3<T>,
    /// \[α×\] + \[ω×\]²: maps a point of the body to its acceleration relative to the origin.
    pub spin: Matrix3<T>,
    /// Acceleration of the origin, gravity included as an acceleration of the base.
    pub linear: Vector3<T>,
    /// Force and moment about the origin that the parent exerts on this body.
    pub force: Vector3<T>,
    pub moment: Vector3<T>,
    /// Pose in the world.
    pub world_rotation: Matrix3<T>,
    pub world_translation: Vector3<T>,
    /// Angular velocity, and velocity of the point at the world's origin, for a unit velocity of the joint.
    pub angular: Vector3<T>,
    pub linear_at_origin: Vector3<T>,
    /// Inertia of the subtree from here on.
    pub composite: Composite<T>,
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
#[derive(Debug, Clone, Copy)]
pub(crate) struct Composite<T: Real> {
    pub mass: T,
    pub first_moment: Vector3<T>,
    pub pseudo_inertia: Matrix3<T>,
}

impl<T: Real> Slot<T> {
    fn new() -> Self {
        let (zero, none) = (Vector3::zeros(), Matrix3::zeros());
        Self {
            rotation: none,
            translation: zero,
            angle: None,
            omega: zero,
            alpha: zero,
            spin: none,
            linear: zero,
            force: zero,
            moment: zero,
            world_rotation: none,
            world_translation: zero,
            angular: zero,
            linear_at_origin: zero,
            composite: Composite {
                mass: T::zero(),
                first_moment: zero,
                pseudo_inertia: none,
            },
        }
    }

    /// Computes the body's pose in its parent's frame for the joint position `q` \[rad or m\].
    #[inline]
    pub fn place(&mut self, body: &Body, q: T) {
        let q = T::splat(body.ratio) * q + T::splat(body.offset);
        let r = matrix::<T>(&body.rotation);
        let translation = vector::<T>(&body.translation);
        if body.prismatic {
            self.rotation = r;
            self.translation = translation + r.column(2) * q;
        } else {
            let (sin, cos) = self.sin_cos(q);
            let (x, y) = (r.column(0), r.column(1));
            self.rotation.set_column(0, &(x * cos + y * sin));
            self.rotation.set_column(1, &(y * cos - x * sin));
            self.rotation.set_column(2, &r.column(2));
            self.translation = translation;
        }
    }

    /// Sine and cosine of an angle \[rad\].
    #[inline]
    fn sin_cos(&mut self, angle: T) -> (T, T) {
        match self.angle {
            Some([last, sin, cos]) if last == angle => (sin, cos),
            _ => {
                let (sin, cos) = angle.simd_sin_cos();
                self.angle = Some([angle, sin, cos]);
                (sin, cos)
            }
        }
    }
}

impl<T: Real> Data<T> {
    /// Memory for `model`.
    pub fn new(model: &Model) -> Self {
        let (n, bodies) = (model.dof(), model.bodies.len());
        let mut slots = vec![Slot::new(); bodies + 1];
        slots[0].world_rotation = Matrix3::identity();
        let zero = T::zero();
        Self {
            slots,
            articulated: vec![Articulated::default(); bodies + 1],
            effort: vec![zero; n],
            acceleration: vec![0.0; n],
            mass_matrix: DMatrix::from_element(n, n, zero),
            regressor: DMatrix::from_element(n, bodies * PARAMETERS_PER_BODY, zero),
            jacobian: Matrix6xX::from_element(n, zero),
        }
    }
}

/// Panics if a slice does not have one number per joint: a mistake of the caller, like an index out of bounds.
#[track_caller]
pub(crate) fn check_lengths<T: Real>(model: &Model, data: &Data<T>, slices: &[&[T]]) {
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
