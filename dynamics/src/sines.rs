//! Sines and cosines of many angles at once.

/// 2/π, and π/2 as the sum of its first 33 bits, of which a small multiple is exact, and the remainder.
/// Physical: the digits of 2/π and π/2.
const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
const HALF_PI_HIGH: f64 = 1.570_796_326_734_125_6;
const HALF_PI_LOW: f64 = 6.077_100_506_506_192e-11;
/// Constant whose addition and subtraction round to the nearest integer, which is then in the last bits of the sum.
/// Physical: 1.5 · 2⁵², above which a double has no fraction.
const ROUNDING: f64 = 6_755_399_441_055_744.0;
/// Largest angle \[rad\] for which the multiple of π/2 is exact.
/// Physical: a multiple of the first 33 bits of π/2 is exact up to a factor of 2²⁰; this is well below.
const FAR: f64 = 1e5;

/// Coefficients of the polynomials in r² of FDLIBM (Sun Microsystems, 1993) for sin r = r + r³ (…) and
/// cos r = 1 - r²/2 + r⁴ (…) on |r| ≤ π/4, highest power first.
/// Physical: the minimax coefficients as published.
const SINE: [f64; 6] = [
    1.589_690_995_211_55e-10,
    -2.505_076_025_340_686_3e-8,
    2.755_731_370_707_006_8e-6,
    -1.984_126_982_985_795e-4,
    8.333_333_333_322_49e-3,
    -1.666_666_666_666_663_2e-1,
];
const COSINE: [f64; 6] = [
    -1.135_964_755_778_819_5e-11,
    2.087_572_321_298_175e-9,
    -2.755_731_435_139_066_3e-7,
    2.480_158_728_947_673e-5,
    -1.388_888_888_887_411e-3,
    4.166_666_666_666_66e-2,
];

/// Computes sine and cosine of each of `angles` \[rad\], accurate to one or two units in the last place; without a
/// branch per angle, so that the processor computes several at once.
///
/// # Panics
/// If the slices have different lengths.
pub(crate) fn sines(angles: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    let n = angles.len();
    let (sin, cos) = (&mut sin[..n], &mut cos[..n]);
    let mut far = false;
    for k in 0..n {
        let angle = angles[k];
        far |= angle.abs() > FAR;
        // The reduction of Cody and Waite to |r| ≤ π/4, as in FDLIBM.
        let rounded = angle * TWO_OVER_PI + ROUNDING;
        let quarters = rounded - ROUNDING;
        let r = (angle - quarters * HALF_PI_HIGH) - quarters * HALF_PI_LOW;
        let square = r * r;
        let polynomial = |of: [f64; 6]| of.into_iter().reduce(|sum, c| sum * square + c);
        let sine = r + r * square * polynomial(SINE).unwrap_or(0.0);
        let cosine = 1.0 - 0.5 * square + square * square * polynomial(COSINE).unwrap_or(0.0);
        // An odd number of quarter turns swaps the two. The second bit of the number is the sign of the sine, and
        // that of the number plus one the sign of the cosine.
        let bits = rounded.to_bits();
        let swap = (bits & 1).wrapping_neg();
        let (s, c) = (sine.to_bits(), cosine.to_bits());
        let changed = (s ^ c) & swap;
        sin[k] = f64::from_bits((s ^ changed) ^ ((bits & 2) << 62));
        cos[k] = f64::from_bits((c ^ changed) ^ ((bits.wrapping_add(1) & 2) << 62));
    }
    if far {
        for (k, angle) in angles.iter().enumerate() {
            (sin[k], cos[k]) = angle.sin_cos();
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn worst(angles: &[f64]) -> f64 {
        let (mut sin, mut cos) = (vec![0.0; angles.len()], vec![0.0; angles.len()]);
        sines(angles, &mut sin, &mut cos);
        let errors = angles
            .iter()
            .zip(sin.iter().zip(&cos))
            .map(|(angle, (sin, cos))| {
                let (exact_sin, exact_cos) = angle.sin_cos();
                (sin - exact_sin).abs().max((cos - exact_cos).abs())
            });
        errors.fold(0.0, f64::max)
    }

    proptest! {
        #[test]
        fn they_are_those_of_the_standard_library(
            near in prop::collection::vec(-7.0..7.0_f64, 1..20),
            far in prop::collection::vec(-1e6..1e6_f64, 1..20),
        ) {
            prop_assert!(worst(&near) < 3e-16);
            prop_assert!(worst(&far) < 3e-16);
        }
    }

    #[test]
    fn quarter_turns_are_exact_to_rounding() {
        let angles: Vec<f64> = (-40..40)
            .map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4)
            .collect();
        assert!(worst(&angles) < 3e-16);
    }

    #[test]
    fn what_is_no_angle_has_no_sine() {
        let (mut sin, mut cos) = ([0.0], [0.0]);
        sines(&[f64::NAN], &mut sin, &mut cos);
        assert!(sin[0].is_nan() && cos[0].is_nan());
    }
}
