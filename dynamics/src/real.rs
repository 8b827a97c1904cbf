//! Numbers of the algorithms: one sample, or several at once in SIMD lanes.

use nalgebra::{Matrix3, SimdRealField, Vector3};
use simba::simd::WideF64x4;

/// One number of each of four samples, in SIMD lanes.
pub type Lanes = WideF64x4;

/// A number of the algorithms: `f64`, or [`Lanes`] for four samples of a batch at once. The algorithms are the same; a
/// lane of a result is that of `f64` to rounding.
pub trait Real: SimdRealField<Element = f64> + Copy {}

impl Real for f64 {}
impl Real for Lanes {}

/// A constant vector in all lanes.
#[inline]
pub(crate) fn vector<T: Real>(of: &Vector3<f64>) -> Vector3<T> {
    of.map(T::splat)
}

/// A constant matrix in all lanes.
#[inline]
pub(crate) fn matrix<T: Real>(of: &Matrix3<f64>) -> Matrix3<T> {
    of.map(T::splat)
}
