//! Rigid-body inertia.

use std::ops::{Add, AddAssign, Sub};

use nalgebra::{Isometry3, Matrix3, Scalar, Vector3};

/// Number of inertial parameters of a rigid body, and of columns of [`regressor`](crate::regressor) per moving body.
pub const PARAMETERS_PER_BODY: usize = 10;

/// Ten inertial parameters of a rigid body, in some frame: mass, first moment, and the second moment about the
/// frame's origin (RBDA section 2.13). They are additive for bodies that move together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Inertia {
    pub(crate) mass: f64,
    pub(crate) first_moment: Vector3<f64>,
    /// About the frame's origin.
    pub(crate) rotational: Matrix3<f64>,
}

impl Inertia {
    /// A body with the given mass \[kg\], centre of mass \[m\] and inertia about that centre along the
    /// frame's axes: xx, xy, xz, yy, yz, zz \[kg m²\].
    ///
    /// Nothing is checked, because the difference of two bodies is an inertia too.
    pub fn new(mass_kg: f64, com_m: [f64; 3], inertia_kgm2: [f64; 6]) -> Self {
        Self::from_parts(mass_kg, com_m.into(), symmetric(inertia_kgm2))
    }

    /// The body of these ten parameters, in the order of [`Inertia::parameters`].
    pub fn from_parameters([mass, hx, hy, hz, xx, xy, xz, yy, yz, zz]: [f64; 10]) -> Self {
        Self {
            mass,
            first_moment: Vector3::new(hx, hy, hz),
            rotational: symmetric([xx, xy, xz, yy, yz, zz]),
        }
    }

    /// The zero inertia: no body.
    pub fn zero() -> Self {
        Self::default()
    }

    pub(crate) fn from_parts(mass: f64, com: Vector3<f64>, about_com: Matrix3<f64>) -> Self {
        let at_com = Self {
            mass,
            first_moment: Vector3::zeros(),
            rotational: about_com,
        };
        at_com.transformed(&Isometry3::translation(com.x, com.y, com.z))
    }

    /// Mass \[kg\].
    pub fn mass_kg(&self) -> f64 {
        self.mass
    }

    /// Centre of mass \[m\]; the origin for a body without mass.
    pub fn com_m(&self) -> [f64; 3] {
        if self.mass == 0.0 {
            return [0.0; 3];
        }
        (self.first_moment / self.mass).into()
    }

    /// Inertia about the frame's origin: xx, xy, xz, yy, yz, zz \[kg m²\].
    pub fn inertia_about_origin_kgm2(&self) -> [f64; 6] {
        let i = &self.rotational;
        [i.m11, i.m12, i.m13, i.m22, i.m23, i.m33]
    }

    /// Inertia about the centre of mass: xx, xy, xz, yy, yz, zz \[kg m²\]; about the origin for a body
    /// without mass.
    pub fn inertia_about_com_kgm2(&self) -> [f64; 6] {
        let com = -Vector3::from(self.com_m());
        self.moved(&Matrix3::identity(), &com)
            .inertia_about_origin_kgm2()
    }

    /// The parameters in which a robot's dynamics are linear, in the order of the regressor's
    /// columns: m, m c (x, y, z), and the inertia about the frame's origin (xx, xy, xz, yy, yz, zz).
    pub fn parameters(&self) -> [f64; 10] {
        let [xx, xy, xz, yy, yz, zz] = self.inertia_about_origin_kgm2();
        let h = self.first_moment;
        [self.mass, h.x, h.y, h.z, xx, xy, xz, yy, yz, zz]
    }

    /// Body of the same mass and centre whose mass density is nowhere negative: the nearest covariance of its density
    /// about its centre, in the Frobenius norm, that has a variance of at least `least_m2` in each direction
    /// (Wensing, Kim and Slotine, "Linear Matrix Inequalities for Physically Consistent Inertial Parameter
    /// Identification", 2018). A body that already satisfies this is returned unchanged. Without a positive mass, no
    /// body.
    #[must_use]
    pub fn nearest_consistent(&self, least_m2: f64) -> Self {
        if self.mass <= 0.0 {
            return Self::zero();
        }
        let mut eigen = self.spread_kgm2().symmetric_eigen();
        if eigen.eigenvalues.iter().all(|value| *value > 0.0) {
            return *self;
        }
        let least = least_m2 * self.mass;
        eigen.eigenvalues.apply(|value| *value = value.max(least));
        let spread = eigen.recompose();
        let about_com = Matrix3::identity() * spread.trace() - spread;
        Self::from_parts(self.mass, self.com_m().into(), about_com)
    }

    /// ½ tr(I) - I about the centre of mass: mass times the covariance of the density \[kg m²\].
    pub fn spread_kgm2(&self) -> Matrix3<f64> {
        let about_com = symmetric(self.inertia_about_com_kgm2());
        Matrix3::identity() * (0.5 * about_com.trace()) - about_com
    }

    /// Returns the body in a frame in which this frame has the given pose.
    #[must_use]
    pub fn transformed(&self, pose: &Isometry3<f64>) -> Self {
        self.moved(
            pose.rotation.to_rotation_matrix().matrix(),
            &pose.translation.vector,
        )
    }

    /// Returns the body in a frame in which this one is rotated and then shifted by `p`.
    pub(crate) fn moved(&self, rotation: &Matrix3<f64>, p: &Vector3<f64>) -> Self {
        let h = rotation * self.first_moment;
        let (hx, px) = (h.cross_matrix(), p.cross_matrix());
        // ∫ -[r×]² dm with r replaced by R r + p.
        let rotational = rotation * self.rotational * rotation.transpose()
            - hx * px
            - px * hx
            - px * px * self.mass;
        Self {
            mass: self.mass,
            first_moment: h + p * self.mass,
            rotational,
        }
    }
}

impl Add for Inertia {
    type Output = Self;
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl AddAssign for Inertia {
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.first_moment += other.first_moment;
        self.rotational += other.rotational;
    }
}

impl Sub for Inertia {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            mass: self.mass - other.mass,
            first_moment: self.first_moment - other.first_moment,
            rotational: self.rotational - other.rotational,
        }
    }
}

/// The matrix of xx, xy, xz, yy, yz, zz.
pub(crate) fn symmetric<T: Scalar + Copy>([xx, xy, xz, yy, yz, zz]: [T; 6]) -> Matrix3<T> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn the_nearest_consistent_body_has_no_negative_mass_anywhere() {
        let body = Inertia::new(2.0, [0.1, -0.2, 0.3], [0.01, 0.0, 0.0, 0.02, 0.0, 0.025]);
        assert_eq!(body.nearest_consistent(0.0), body);
        let odd = Inertia::new(2.0, [0.1, -0.2, 0.3], [-0.3, 0.02, 0.0, 0.1, 0.0, 0.01]);
        let nearest = odd.nearest_consistent(0.0);
        let [xx, xy, xz, yy, yz, zz] = nearest.inertia_about_com_kgm2();
        let principal = symmetric([xx, xy, xz, yy, yz, zz]).symmetric_eigenvalues();
        // The triangle inequality of principal moments.
        for k in 0..3 {
            assert!(2.0 * principal[k] <= principal.sum() + 1e-12, "{principal}");
        }
        assert!((nearest.mass_kg() - 2.0).abs() < 1e-12);
        assert!((nearest.com_m()[2] - 0.3).abs() < 1e-12);
        let wide = odd.nearest_consistent(0.01).spread_kgm2();
        assert!((wide.symmetric_eigenvalues().min() - 2.0 * 0.01).abs() < 1e-12);
        assert_eq!(
            Inertia::new(-1.0, [0.1; 3], [0.1; 6]).nearest_consistent(0.0),
            Inertia::zero()
        );
    }

    #[test]
    fn a_shift_follows_steiner() {
        let rod = Inertia::new(2.0, [0.0, 0.3, 0.0], [0.1, 0.0, 0.0, 0.2, 0.0, 0.3]);
        let about_origin = rod.inertia_about_origin_kgm2();
        let expected = [0.1 + 2.0 * 0.09, 0.0, 0.0, 0.2, 0.0, 0.3 + 2.0 * 0.09];
        for (a, b) in about_origin.iter().zip(expected) {
            assert!((a - b).abs() < 1e-15);
        }
        assert_eq!(rod.com_m(), [0.0, 0.3, 0.0]);
    }

    #[test]
    fn a_turn_and_its_inverse_change_nothing() {
        let body = Inertia::new(1.7, [0.1, -0.2, 0.4], [0.3, 0.01, -0.02, 0.2, 0.03, 0.25]);
        let pose = Isometry3::from_parts(
            Vector3::new(0.5, -1.0, 0.2).into(),
            UnitQuaternion::from_euler_angles(0.3, -1.2, 2.0),
        );
        let there = body.transformed(&pose);
        let com = pose * nalgebra::Point3::from(Vector3::from(body.com_m()));
        assert!((Vector3::from(there.com_m()) - com.coords).norm() < 1e-14);
        let back = there.transformed(&pose.inverse());
        assert!((back.rotational - body.rotational).norm() < 1e-14);
        assert!((back.first_moment - body.first_moment).norm() < 1e-14);
    }

    #[test]
    fn parameters_are_the_body() {
        let about_com = [0.3, 0.01, -0.02, 0.2, 0.03, 0.25];
        let body = Inertia::new(1.7, [0.1, -0.2, 0.4], about_com);
        assert_eq!(Inertia::from_parameters(body.parameters()), body);
        for (a, b) in body.inertia_about_com_kgm2().iter().zip(about_com) {
            assert!((a - b).abs() < 1e-15);
        }
        assert_eq!(body - body, Inertia::zero());
    }

    #[test]
    fn what_is_not_there_has_no_centre() {
        assert_eq!(Inertia::zero().com_m(), [0.0; 3]);
    }
}
