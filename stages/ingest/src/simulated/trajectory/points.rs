//! Motion from point to point along quintic polynomials, with rests.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use tauscope_bus::JointArray;
use tauscope_dynamics::Model;

use super::teach::{Allowed, Teach};
use super::{JointRange, QUINTIC_PEAK_ACCELERATION, QUINTIC_PEAK_VELOCITY, Target, quintic};
use crate::simulated::check;
use crate::simulated::error::ScenarioError;
use crate::simulated::scenario::PointsSpec;

/// Minimum duration of a move and its rest, needed if the points coincide and there is no rest \[s\].
/// Resolution: far below any motion; only keeps the time increasing.
const STILL_S: f64 = 1e-3;

/// The motion. Points are drawn on demand, so its duration is not limited.
pub(in crate::simulated) struct Points {
    spec: PointsSpec,
    joints: Vec<JointRange>,
    teach: Teach,
    rng: ChaCha8Rng,
    /// Number of remaining moves; `None` for no end.
    moves_left: Option<u64>,
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
    /// Creates a motion that begins with a rest at the first point; `model` includes the tool.
    pub fn new(
        spec: &PointsSpec,
        model: &Model,
        joints: &[JointRange],
        allowed: Allowed,
        mut rng: ChaCha8Rng,
    ) -> Result<Self, ScenarioError> {
        check::order("motion.points.rest_s", spec.rest_s)?;
        let mut teach = Teach::new(spec, model, joints, allowed, &mut rng)?;
        let moves_left = match (spec.cycles, teach.list()) {
            (None, _) => None,
            (Some(cycles), Some(list)) if list.len() > 1 => {
                Some(u64::from(cycles) * list.len() as u64)
            }
            (Some(_), _) => {
                return Err(ScenarioError::Range {
                    what: "motion.points.cycles",
                    reason: "a cycle needs a list of two points or more: give `through`, \
                             `through_m` or `within.count`"
                        .to_owned(),
                });
            }
        };
        let Some(first) = teach.next(&mut rng) else {
            return Err(teach.no_point(spec));
        };
        let mut points = Self {
            spec: spec.clone(),
            joints: joints.to_vec(),
            teach,
            rng,
            moves_left,
            from: first,
            to: first,
            start_s: 0.0,
            move_s: 0.0,
            end_s: 0.0,
        };
        points.end_s = points.rest();
        Ok(points)
    }

    /// Returns the length of a cycle, if there is a list of points and all rests have the same length \[s\].
    pub fn cycle_s(&self) -> Option<f64> {
        let [shortest, longest] = self.spec.rest_s;
        let list = self.teach.list().filter(|list| list.len() > 1)?;
        (shortest >= longest).then(|| self.shortest_cycle_s(list))
    }

    /// Refuses cycles that do not fit into a recording.
    pub fn check_fit(&self, recording: &str, duration_s: f64) -> Result<(), ScenarioError> {
        let (Some(cycles), Some(list)) = (self.spec.cycles, self.teach.list()) else {
            return Ok(());
        };
        let needed_s = self.spec.rest_s[0] + f64::from(cycles) * self.shortest_cycle_s(list);
        if needed_s <= duration_s {
            return Ok(());
        }
        Err(ScenarioError::Range {
            what: "motion.points.cycles",
            reason: format!(
                "{cycles} cycles take at least {needed_s:.3} s, the `duration_s` of recording \
                 `{recording}` is {duration_s} s: make it longer, or take fewer cycles"
            ),
        })
    }

    fn shortest_cycle_s(&self, list: &[JointArray]) -> f64 {
        let ways = list.iter().zip(list.iter().cycle().skip(1));
        let moves =
            ways.map(|(from, to)| (self.move_s(from, to) + self.spec.rest_s[0]).max(STILL_S));
        moves.sum()
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

    /// Plans the next move and the rest after it.
    fn go_on(&mut self) {
        self.from = self.to;
        self.start_s = self.end_s;
        match &mut self.moves_left {
            Some(0) => {
                self.move_s = 0.0;
                self.end_s = f64::INFINITY;
                return;
            }
            Some(left) => *left -= 1,
            None => {}
        }
        // A first point was found, so staying there is always possible.
        self.to = self.teach.next(&mut self.rng).unwrap_or(self.from);
        self.move_s = self.move_s(&self.from, &self.to);
        self.end_s = self.start_s + (self.move_s + self.rest()).max(STILL_S);
    }

    /// Returns the shortest duration of a move within the limits \[s\].
    fn move_s(&self, from: &JointArray, to: &JointArray) -> f64 {
        let mut move_s = 0.0_f64;
        for (j, joint) in self.joints.iter().enumerate() {
            let way = (to[j] - from[j]).abs();
            let by_velocity = QUINTIC_PEAK_VELOCITY * way / (self.spec.speed * joint.velocity);
            let by_acceleration =
                (QUINTIC_PEAK_ACCELERATION * way / self.spec.acceleration_rad_s2).sqrt();
            move_s = move_s.max(by_velocity).max(by_acceleration);
        }
        move_s
    }

    fn rest(&mut self) -> f64 {
        let [shortest, longest] = self.spec.rest_s;
        shortest + (longest - shortest) * self.rng.random::<f64>()
    }
}
