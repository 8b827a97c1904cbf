//! An outlier among peers: B. Iglewicz and D. C. Hoaglin, *How to Detect and Handle Outliers*, 1993, page 12.

use crate::robust::median;

/// Fewest peers for a test of outliers.
/// Resolution: three faults do not move a median of seven.
pub const LEAST_PEERS: usize = 7;
/// Standard deviation of a normal distribution over its median absolute deviation.
/// Physical: 1 / the normal quantile of 3/4.
const DEVIATIONS: f64 = 1.4826;
/// Modified z-score beyond which a value is an outlier among many peers.
/// Statistical: of 3,000 values of a hundred healthy cells, one lies beyond it in 1 of 600 fleets.
const OUTLIER: f64 = 5.0;
/// Coefficient of 1/n in the relative increase of that limit for n peers, because the spread of few is uncertain.
/// Statistical: the 1 - 2.9e-7 quantile of Student's t with 0.37 n degrees (the efficiency of the median absolute
/// deviation) over the normal one, to first order.
const FEW: f64 = 18.0;
/// Lower bound on the spread of peers, as a share of their median.
/// Resolution: arms of one make differ by more; a few equal values do not prove precision.
const LEAST_SPREAD: f64 = 0.05;

/// Deviation of a value from its peers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AmongPeers {
    /// Median of the peers.
    pub median: f64,
    /// Modified z-score.
    pub score: f64,
    /// Whether the value is an outlier.
    pub is_outlier: bool,
}

/// Compares `value`, with the standard deviation of its error, with its peers; `None` for too few peers.
pub fn among(value: f64, deviation: f64, peers: &[f64]) -> Option<AmongPeers> {
    let peers: Vec<f64> = peers
        .iter()
        .copied()
        .filter(|peer| peer.is_finite())
        .collect();
    if peers.len() < LEAST_PEERS || !value.is_finite() {
        return None;
    }
    let count = peers.len() as f64;
    let middle = median(peers.clone());
    let apart = peers.iter().map(|peer| (peer - middle).abs()).collect();
    let spread = (DEVIATIONS * median(apart)).max(LEAST_SPREAD * middle.abs());
    let spread = spread.hypot(deviation);
    let score = if spread > 0.0 {
        (value - middle) / spread
    } else {
        0.0
    };
    Some(AmongPeers {
        median: middle,
        score,
        is_outlier: score.abs() > OUTLIER * (1.0 + FEW / count),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_lies_far_beyond_what_peers_differ_by() {
        let peers: Vec<f64> = (0..60).map(|k| 4.0 + 0.1 * f64::from(k % 11 - 5)).collect();
        assert!(!among(4.9, 0.05, &peers).unwrap().is_outlier);
        assert!(among(8.0, 0.05, &peers).unwrap().is_outlier);
        assert!(among(8.0, 0.05, &peers[..5]).is_none());
        // A value with a large error is no outlier.
        assert!(!among(8.0, 3.0, &peers).unwrap().is_outlier);
    }
}
