//! Unfiltered efforts over all recordings, at each layer from the rigid bodies to the recorded signal.

use std::sync::Arc;

/// Efforts by track, each row-major with one number per sample and joint \[N m or N\].
pub type TrackEfforts = Vec<Vec<f64>>;

/// Efforts of all tracks for a set of effects, by layer.
#[derive(Debug, Clone)]
pub struct Efforts {
    /// Effort of the rigid bodies and the [`Layer::Body`] terms, which the gears transmit.
    pub body: Arc<TrackEfforts>,
    /// `body` with the [`Layer::Joint`] terms, such as friction.
    pub mechanical: Arc<TrackEfforts>,
    /// `mechanical` with the [`Layer::Record`] terms, as the sensor records it.
    pub recorded: Arc<TrackEfforts>,
}

impl Efforts {
    /// Creates the efforts without joint and record terms, so that every layer equals `body`.
    pub fn of_bodies(body: Arc<TrackEfforts>) -> Self {
        Self {
            mechanical: Arc::clone(&body),
            recorded: Arc::clone(&body),
            body,
        }
    }
}

/// Returns zero efforts in the shape of `like`.
pub fn zeros(like: &[Vec<f64>]) -> TrackEfforts {
    like.iter().map(|like| vec![0.0; like.len()]).collect()
}

/// Multiplies the efforts by the torque scales `gains`, one per joint.
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

/// Returns `from` minus `what`.
pub fn subtract(mut from: TrackEfforts, what: &[Vec<f64>]) -> TrackEfforts {
    for (from, what) in from.iter_mut().zip(what) {
        for (a, b) in from.iter_mut().zip(what) {
            *a -= b;
        }
    }
    from
}
