//! An outlier among peers: B. Iglewicz and D. C. Hoaglin, *How to Detect and Handle Outliers*, 1993, page 12.

use crate::robust::median;

/// Peers from which on one can be an outlier among them.
/// Resolution: a median of seven is moved by no three faults.
pub const LEAST_PEERS: usize = 7;
/// Standard deviation of a normal distribution over its median absolute deviation.
/// Physical: 1 / the normal quantile of 3/4.
const DEVIATIONS: f64 = 1.4826;
/// A modified z-score beyond this is an outlier among many peers.
/// Statistical: of 3,000 numbers of a hundred healthy cells, one lies beyond it in 1 of 600 fleets.
const OUTLIER: f64 = 5.0;
/// Share by which the limit grows with one over the number of peers: a spread of few is itself uncertain.
/// Statistical: the 1 - 2.9e-7 quantile of Student's t with 0.37 n degrees (the efficiency of the median absolute
/// deviation) over the normal one, to first order.
const FEW: f64 = 18.0;
/// The spread of peers counts as no less than this share of their median.
/// Resolution: arms of one make differ by more; twins are no proof of precision.
const LEAST_SPREAD: f64 = 0.05;

/// How far a value lies from its peers' median.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AmongPeers {
    /// The peers' median.
    pub median: f64,
    /// The modified z-score.
    pub score: f64,
    /// Whether it is an outlier.
    pub is_outlier: bool,
}

/// `value` with its error's standard deviation among the values of its peers; `None` for too few peers.
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
        // What is hardly known is no outlier.
        assert!(!among(8.0, 3.0, &peers).unwrap().is_outlier);
    }
}
