//! The normal distribution.

/// ln(2 Φ(z)) with the normal distribution function Φ.
pub fn log_twice_share_above_zero(z: f64) -> f64 {
    if z > 6.0 {
        return std::f64::consts::LN_2;
    }
    if z < -6.0 {
        // Mills' ratio: Φ(z) is about φ(z) / |z|.
        return -0.5 * z * z - (z.abs() * (std::f64::consts::TAU).sqrt()).ln()
            + std::f64::consts::LN_2;
    }
    (2.0 * share_below(z)).ln()
}

/// The normal distribution function (Abramowitz and Stegun, equation 26.2.17; absolute error below 7.5e-8).
fn share_below(z: f64) -> f64 {
    let x = z.abs();
    let t = 1.0 / (1.0 + 0.231_641_9 * x);
    let series = t
        * (0.319_381_530
            + t * (-0.356_563_782
                + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt() * series;
    if z > 0.0 { 1.0 - tail } else { tail.max(1e-12) }
}
