//! Inertial effort of accelerations, computed at two successive positions together.

use std::ops::{Add, AddAssign, Mul, Sub};

use nalgebra::{Matrix3, Vector3};

use crate::data::Data;
use crate::data::check_lengths;
use crate::model::Model;
use crate::sines::sines;

/// Product of the mass matrix and accelerations at the newest and at the previous position, without forming the
/// matrix: [`rnea`](crate::rnea) without velocities and gravity (RBDA section 5.3), in body frames, in which inertias
/// are constant. Both positions are processed in one recursion. No allocation per call.
#[derive(Debug, Clone)]
pub struct InertialEffort {
    bodies: Vec<Body>,
    /// Position of each body's joint, its sine and its cosine.
    position: Vec<f64>,
    sin: Vec<f64>,
    cos: Vec<f64>,
    effort: Vec<f64>,
}

/// Constant properties of a body, in its own frame, and its present motion.
#[derive(Debug, Clone)]
struct Body {
    joint: usize,
    /// The position of its own joint is `ratio` times that of `joint`, plus `offset`.
    ratio: f64,
    offset: f64,
    /// Slot of the parent: 0 is the base, i + 1 the body i.
    parent: usize,
    prismatic: bool,
    /// Pose in the parent's frame at position zero, in rows.
    home: [[f64; 3]; 3],
    origin: [f64; 3],
    mass: f64,
    first_moment: [f64; 3],
    inertia: [[f64; 3]; 3],
    /// Pose in the parent's frame.
    rotation: [Vector; 3],
    translation: Vector,
    /// Angular acceleration, and acceleration of the origin.
    alpha: Vector,
    linear: Vector,
    /// Force and moment about the origin that the parent exerts.
    force: Vector,
    moment: Vector,
}

/// A number at the newest position and at the previous one, in two SIMD lanes.
#[derive(Debug, Clone, Copy, Default)]
struct Pair([f64; 2]);

type Vector = [Pair; 3];

impl Add for Pair {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self([self.0[0] + other.0[0], self.0[1] + other.0[1]])
    }
}

impl AddAssign for Pair {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Pair {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0] - other.0[0], self.0[1] - other.0[1]])
    }
}

impl Mul for Pair {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self([self.0[0] * other.0[0], self.0[1] * other.0[1]])
    }
}

impl Mul<f64> for Pair {
    type Output = Self;
    #[inline]
    fn mul(self, other: f64) -> Self {
        Self([self.0[0] * other, self.0[1] * other])
    }
}

#[inline]
fn cross<T: Copy>(a: &Vector, b: &[T; 3]) -> Vector
where
    Pair: Mul<T, Output = Pair>,
{
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline]
fn plus(a: &Vector, b: &Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// R v.
#[inline]
fn turned(r: &[Vector; 3], v: &Vector) -> Vector {
    std::array::from_fn(|i| r[i][0] * v[0] + r[i][1] * v[1] + r[i][2] * v[2])
}

/// Rᵀ v.
#[inline]
fn turned_back(r: &[Vector; 3], v: &Vector) -> Vector {
    std::array::from_fn(|i| r[0][i] * v[0] + r[1][i] * v[1] + r[2][i] * v[2])
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|k| matrix[(i, k)]))
}

impl InertialEffort {
    /// Creates the recursion for `model` with its present tool; both positions are zero.
    pub fn new(model: &Model) -> Self {
        let (n, bodies) = (model.dof(), model.bodies.len());
        let body = |body: &crate::model::Body| {
            let k = &body.load.pseudo_inertia;
            Body {
                joint: body.joint,
                ratio: body.ratio,
                offset: body.offset,
                parent: body.parent,
                prismatic: body.prismatic,
                home: rows(&body.rotation),
                origin: body.translation.into(),
                mass: body.load.mass,
                first_moment: body.load.first_moment.into(),
                inertia: rows(&(Matrix3::from_diagonal_element(k.trace()) - k)),
                rotation: Default::default(),
                translation: Vector::default(),
                alpha: Vector::default(),
                linear: Vector::default(),
                force: Vector::default(),
                moment: Vector::default(),
            }
        };
        let mut new = Self {
            bodies: model.bodies.iter().map(body).collect(),
            position: vec![0.0; bodies],
            sin: vec![0.0; bodies],
            cos: vec![0.0; bodies],
            effort: vec![0.0; n],
        };
        let zeros = vec![0.0; n];
        new.place(&zeros);
        new.place(&zeros);
        new
    }

    /// Sets the position `q` \[rad or m\]; the newest position becomes the previous one.
    ///
    /// # Panics
    /// If `q` does not have one number per joint.
    pub fn place(&mut self, q: &[f64]) {
        for (position, body) in self.position.iter_mut().zip(&self.bodies) {
            *position = body.ratio * q[body.joint] + body.offset;
        }
        sines(&self.position, &mut self.sin, &mut self.cos);
        for (b, body) in self.bodies.iter_mut().enumerate() {
            let (sin, cos) = (self.sin[b], self.cos[b]);
            for (i, (&[x, y, z], &origin)) in body.home.iter().zip(&body.origin).enumerate() {
                let (row, translation) = if body.prismatic {
                    ([x, y, z], origin + z * self.position[b])
                } else {
                    ([x * cos + y * sin, y * cos - x * sin, z], origin)
                };
                for (entry, newest) in body.rotation[i].iter_mut().zip(row) {
                    entry.follow(newest);
                }
                body.translation[i].follow(translation);
            }
        }
    }

    /// Computes M(q) a + M(q') a' \[N m, N\] by joint: a = `newest` at the newest position q, a' = `previous` at the
    /// previous one \[rad/s², m/s²\].
    ///
    /// # Panics
    /// If the slices do not have one number per joint.
    pub fn sum(&mut self, newest: &[f64], previous: &[f64]) -> &[f64] {
        let Self { bodies, effort, .. } = self;
        let n = effort.len();
        let (newest, previous) = (&newest[..n], &previous[..n]);
        for i in 0..bodies.len() {
            let (done, rest) = bodies.split_at_mut(i);
            let body = &mut rest[0];
            if body.parent == 0 {
                (body.alpha, body.linear) = Default::default();
            } else {
                let parent = &done[body.parent - 1];
                let carried = cross(&parent.alpha, &body.translation);
                body.linear = turned_back(&body.rotation, &plus(&parent.linear, &carried));
                body.alpha = turned_back(&body.rotation, &parent.alpha);
            }
            let own = Pair([newest[body.joint], previous[body.joint]]) * body.ratio;
            if body.prismatic {
                body.linear[2] += own;
            } else {
                body.alpha[2] += own;
            }
            let (a, alpha, h) = (&body.linear, &body.alpha, &body.first_moment);
            let spun = cross(alpha, h);
            body.force = std::array::from_fn(|i| a[i] * body.mass + spun[i]);
            // h × a = -(a × h).
            let pulled = cross(a, h);
            let inertia = &body.inertia;
            body.moment = std::array::from_fn(|i| {
                let row = &inertia[i];
                alpha[0] * row[0] + alpha[1] * row[1] + alpha[2] * row[2] - pulled[i]
            });
        }
        effort.fill(0.0);
        for i in (0..bodies.len()).rev() {
            let (done, rest) = bodies.split_at_mut(i);
            let body = &rest[0];
            let own = if body.prismatic {
                body.force[2]
            } else {
                body.moment[2]
            };
            effort[body.joint] += body.ratio * (own.0[0] + own.0[1]);
            if body.parent > 0 {
                let parent = &mut done[body.parent - 1];
                let force = turned(&body.rotation, &body.force);
                let moment = turned(&body.rotation, &body.moment);
                // t × f = -(f × t).
                let levered = cross(&force, &body.translation);
                for k in 0..3 {
                    parent.force[k] += force[k];
                    parent.moment[k] += moment[k] - levered[k];
                }
            }
        }
        effort
    }

    /// Computes the poses of the links in `data` at the newest position, as
    /// [`forward_kinematics`](crate::forward_kinematics) does.
    ///
    /// # Panics
    /// If `model` or `data` belongs to another robot.
    pub fn pose(&self, model: &Model, data: &mut Data) {
        check_lengths(model, data, &[&self.effort]);
        for (i, body) in self.bodies.iter().enumerate() {
            let (done, rest) = data.slots.split_at_mut(i + 1);
            let (parent, slot) = (&done[body.parent], &mut rest[0]);
            slot.rotation = Matrix3::from_fn(|r, c| body.rotation[r][c].0[0]);
            slot.translation = Vector3::from_fn(|r, _| body.translation[r].0[0]);
            slot.world_rotation = parent.world_rotation * slot.rotation;
            slot.world_translation =
                parent.world_translation + parent.world_rotation * slot.translation;
            let axis: Vector3<f64> = slot.world_rotation.column(2) * body.ratio;
            (slot.angular, slot.linear_at_origin) = if body.prismatic {
                (Vector3::zeros(), axis)
            } else {
                (axis, slot.world_translation.cross(&axis))
            };
        }
    }
}

impl Pair {
    #[inline]
    fn follow(&mut self, newest: f64) {
        self.0 = [newest, self.0[0]];
    }
}
