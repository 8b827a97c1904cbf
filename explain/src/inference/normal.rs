//! The normal distribution.

/// Below this, Mills' ratio stands for the distribution function. Resolution: it is 3 % off there.
const TAIL: f64 = -6.0;

/// ln(2 Φ(z)) with the normal distribution function Φ.
pub fn log_twice_share_above_zero(z: f64) -> f64 {
    log_twice_tail(z) - 0.5 * z * z
}

/// ln(2 Φ(z)) + z²/2, which a tail far below zero does not overflow.
pub fn log_twice_tail(z: f64) -> f64 {
    if z < TAIL {
        // Mills' ratio: Φ(z) is about φ(z) / |z|.
        return std::f64::consts::LN_2 - (z.abs() * std::f64::consts::TAU.sqrt()).ln();
    }
    (2.0 * share_below(z)).ln() + 0.5 * z * z
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_goes_on_where_the_series_ends() {
        let step = log_twice_tail(TAIL - 1e-6) - log_twice_tail(TAIL + 1e-6);
        assert!(step.abs() < 0.05, "{step}");
        assert!((log_twice_share_above_zero(0.0)).abs() < 1e-6);
        assert!((log_twice_share_above_zero(8.0) - std::f64::consts::LN_2).abs() < 1e-6);
    }
}
