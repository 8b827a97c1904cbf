//! Efforts over all recordings, unfiltered, from the bodies to what is recorded.

use std::sync::Arc;

/// An effort by track, row-major, one number per joint and sample \[N m or N\].
pub type TrackEfforts = Vec<Vec<f64>>;

/// Efforts of all tracks under some physics, layer by layer.
#[derive(Debug, Clone)]
pub struct Efforts {
    /// Rigid body and [`Layer::Body`] terms: what the gears transmit.
    pub body: Arc<TrackEfforts>,
    /// With the [`Layer::Joint`] terms.
    pub mechanical: Arc<TrackEfforts>,
    /// With the [`Layer::Record`] terms: what is recorded.
    pub recorded: Arc<TrackEfforts>,
}

impl Efforts {
    /// Under no physics but bodies, of which the gears transmit `body`.
    pub fn of_bodies(body: Arc<TrackEfforts>) -> Self {
        Self {
            mechanical: Arc::clone(&body),
            recorded: Arc::clone(&body),
            body,
        }
    }
}

/// Zero effort, as many numbers as `like` has.
pub fn zeros(like: &[Vec<f64>]) -> TrackEfforts {
    like.iter().map(|like| vec![0.0; like.len()]).collect()
}

/// Multiplies the effort of bodies by the torque scales, one per joint.
pub fn scale(bodies: &mut [Vec<f64>], gains: &[f64]) {
    if gains.iter().all(|gain| (gain - 1.0).abs() <= 0.0) {
        return;
    }
    for body in bodies {
        for (k, value) in body.iter_mut().enumerate() {
            *value *= gains[k % gains.len()];
        }
    }
}

/// The difference of two efforts.
pub fn subtract(mut from: TrackEfforts, what: &[Vec<f64>]) -> TrackEfforts {
    for (from, what) in from.iter_mut().zip(what) {
        for (a, b) in from.iter_mut().zip(what) {
            *a -= b;
        }
    }
    from
}
