//! From point to point along quintic polynomials, with rests.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{JointArray, MAX_JOINTS};

use super::{JointRange, QUINTIC_PEAK_ACCELERATION, QUINTIC_PEAK_VELOCITY, Target, quintic};
use crate::simulated::error::ScenarioError;
use crate::simulated::scenario::PointsSpec;

/// Random points that are tried before it is given up.
const TRIES: usize = 1000;

/// Says whether the arm may stand at a point.
pub(in crate::simulated) type Allowed = Box<dyn FnMut(&[f64]) -> bool + Send>;

/// The motion; points are drawn as they are needed, so it can go on for ever.
pub(in crate::simulated) struct Points {
    spec: PointsSpec,
    joints: Vec<JointRange>,
    allowed: Allowed,
    rng: ChaCha8Rng,
    next_given: usize,
    from: JointArray,
    to: JointArray,
    start_s: f64,
    move_s: f64,
    end_s: f64,
}

impl std::fmt::Debug for Points {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Points")
            .field("spec", &self.spec)
            .finish_non_exhaustive()
    }
}

impl Points {
    /// Begins with a rest at the first point.
    pub fn new(
        spec: &PointsSpec,
        joints: &[JointRange],
        allowed: Allowed,
        rng: ChaCha8Rng,
    ) -> Result<Self, ScenarioError> {
        for point in &spec.through {
            super::super::check::position("motion.points.through", point, joints)?;
        }
        super::super::check::order("motion.points.rest_s", spec.rest_s)?;
        let mut points = Self {
            spec: spec.clone(),
            joints: joints.to_vec(),
            allowed,
            rng,
            next_given: 0,
            from: [0.0; MAX_JOINTS],
            to: [0.0; MAX_JOINTS],
            start_s: 0.0,
            move_s: 0.0,
            end_s: 0.0,
        };
        let Some(first) = points.draw() else {
            return Err(ScenarioError::NoPoint {
                tries: TRIES,
                min_height_m: spec.min_height_m.unwrap_or(0.0),
            });
        };
        (points.from, points.to) = (first, first);
        points.end_s = points.rest();
        Ok(points)
    }

    pub fn at(&mut self, t_s: f64) -> Target {
        while t_s >= self.end_s {
            self.go_on();
        }
        let mut target = Target::default();
        let [s, ds, dds] = if self.move_s > 0.0 {
            quintic((t_s - self.start_s) / self.move_s)
        } else {
            [1.0, 0.0, 0.0]
        };
        let duration_s = self.move_s.max(f64::MIN_POSITIVE);
        for j in 0..self.joints.len() {
            let way = self.to[j] - self.from[j];
            target.position[j] = self.from[j] + way * s;
            target.velocity[j] = way * ds / duration_s;
            target.acceleration[j] = way * dds / duration_s / duration_s;
        }
        target
    }

    /// Plans the move from where the last one ended, and the rest after it.
    fn go_on(&mut self) {
        self.from = self.to;
        // A first point was found, so staying there is always possible.
        self.to = self.draw().unwrap_or(self.from);
        let mut move_s = 0.0_f64;
        for (j, joint) in self.joints.iter().enumerate() {
            let way = (self.to[j] - self.from[j]).abs();
            let by_velocity = QUINTIC_PEAK_VELOCITY * way / (self.spec.speed * joint.velocity);
            let by_acceleration =
                (QUINTIC_PEAK_ACCELERATION * way / self.spec.acceleration_rad_s2).sqrt();
            move_s = move_s.max(by_velocity).max(by_acceleration);
        }
        self.start_s = self.end_s;
        self.move_s = move_s;
        // Time goes on even if the points are the same and there is no rest.
        self.end_s = self.start_s + (move_s + self.rest()).max(1e-3);
    }

    fn rest(&mut self) -> f64 {
        let [shortest, longest] = self.spec.rest_s;
        shortest + (longest - shortest) * self.rng.random::<f64>()
    }

    fn draw(&mut self) -> Option<JointArray> {
        let mut point = [0.0; MAX_JOINTS];
        let n = self.joints.len();
        if !self.spec.through.is_empty() {
            point[..n].copy_from_slice(&self.spec.through[self.next_given]);
            self.next_given = (self.next_given + 1) % self.spec.through.len();
            return Some(point);
        }
        (0..TRIES).find_map(|_| {
            for (value, joint) in point.iter_mut().zip(&self.joints) {
                let share = self.spec.range * (2.0 * self.rng.random::<f64>() - 1.0);
                *value = joint.middle() + share * joint.half();
            }
            (self.allowed)(&point[..n]).then_some(point)
        })
    }
}
