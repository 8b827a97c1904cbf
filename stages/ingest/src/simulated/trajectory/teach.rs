//! Choice of the points of a motion.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitBall, UnitSphere};
use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::Model;

use super::JointRange;
use crate::simulated::check;
use crate::simulated::error::ScenarioError;
use crate::simulated::inverse::{Goal, Inverse};
use crate::simulated::link_point::LinkPoint;
use crate::simulated::scenario::{PointsSpec, ReachSpec, WithinSpec};

/// Maximum number of random points of the joints' ranges that are tried.
/// Resolution: bounds the computing time; a motion that is not found by then is an error.
const TRIES: usize = 1000;
/// Maximum number of random places that are tried. Each needs an inverse kinematics.
/// Resolution: bounds the computing time; a place that is not found by then is an error.
const PLACE_TRIES: usize = 200;

/// Predicate that tests whether the arm may be at a point.
pub(in crate::simulated) type Allowed = Box<dyn FnMut(&[f64]) -> bool + Send>;

/// Sequence of the points of a motion.
pub(super) struct Teach {
    joints: Vec<JointRange>,
    allowed: Allowed,
    points: Points,
}

enum Points {
    /// A list, visited repeatedly.
    List {
        points: Vec<JointArray>,
        next: usize,
    },
    /// New random points within this fraction of the joints' ranges.
    Range(f64),
    /// New random places within a radius.
    Within(Box<Within>),
}

/// Places within a radius.
struct Within {
    inverse: Inverse,
    radius_m: f64,
    turn_rad: f64,
    any_orientation: bool,
    centre: Isometry3<f64>,
    /// Joint positions that reach the centre.
    start: JointArray,
}

impl Teach {
    pub fn new(
        spec: &PointsSpec,
        model: &Model,
        joints: &[JointRange],
        allowed: Allowed,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, ScenarioError> {
        let ways = [
            !spec.through.is_empty(),
            !spec.through_m.is_empty(),
            spec.within.is_some(),
        ];
        let given = ways.iter().filter(|way| **way).count();
        if given > 1 {
            return refuse("give at most one of `through`, `through_m` and `within`");
        }
        if spec.reach.is_some() && spec.through_m.is_empty() && spec.within.is_none() {
            return refuse(
                "`reach` is for `through_m` and `within`: give one of them, or leave it out",
            );
        }
        let mut teach = Self {
            joints: joints.to_vec(),
            allowed,
            points: Points::Range(spec.range),
        };
        let reach = spec.reach.clone().unwrap_or_default();
        if !spec.through.is_empty() {
            teach.points = Points::list(joint_points(&spec.through, joints)?);
        } else if !spec.through_m.is_empty() {
            let points = places(&spec.through_m, &reach, model, joints)?;
            teach.points = Points::list(points);
        } else if let Some(within) = &spec.within {
            let around = Within::new(within, &reach, model, joints)?;
            teach.points = Points::Within(Box::new(around));
            let count = within.count.unwrap_or(0);
            let points: Option<Vec<_>> = (0..count).map(|_| teach.next(rng)).collect();
            let Some(points) = points else {
                return Err(teach.no_point(spec));
            };
            if count > 0 {
                teach.points = Points::list(points);
            }
        }
        Ok(teach)
    }

    /// Returns the points, if they are a list.
    pub fn list(&self) -> Option<&[JointArray]> {
        match &self.points {
            Points::List { points, .. } => Some(points),
            _ => None,
        }
    }

    /// Returns the next point; `None` if no allowed point is found.
    pub fn next(&mut self, rng: &mut ChaCha8Rng) -> Option<JointArray> {
        let n = self.joints.len();
        match &mut self.points {
            Points::List { points, next } => {
                let point = points[*next];
                *next = (*next + 1) % points.len();
                Some(point)
            }
            Points::Range(range) => (0..TRIES).find_map(|_| {
                let mut point = [0.0; MAX_JOINTS];
                for (value, joint) in point.iter_mut().zip(&self.joints) {
                    let share = *range * (2.0 * rng.random::<f64>() - 1.0);
                    *value = joint.middle() + share * joint.half();
                }
                (self.allowed)(&point[..n]).then_some(point)
            }),
            Points::Within(within) => (0..PLACE_TRIES).find_map(|_| {
                let point = within.draw(rng)?;
                (self.allowed)(&point[..n]).then_some(point)
            }),
        }
    }

    /// Returns the error for a next point that is not found.
    pub fn no_point(&self, spec: &PointsSpec) -> ScenarioError {
        let min_height_m = spec.min_height_m.unwrap_or(0.0);
        match &self.points {
            Points::Within(within) => ScenarioError::Range {
                what: "motion.points.within",
                reason: format!(
                    "none of {PLACE_TRIES} random points within {} m can be reached by link `{}`{}: \
                     take a smaller `radius_m` or `turn_rad`, or another `about_m` or `reach.posture`",
                    within.radius_m,
                    within.inverse.link_name(),
                    match spec.min_height_m {
                        Some(_) => format!(" with every link {min_height_m} m above the base"),
                        None => String::new(),
                    }
                ),
            },
            _ => ScenarioError::NoPoint {
                tries: TRIES,
                min_height_m,
            },
        }
    }
}

impl Points {
    fn list(points: Vec<JointArray>) -> Self {
        Self::List { points, next: 0 }
    }
}

impl Within {
    fn new(
        spec: &WithinSpec,
        reach: &ReachSpec,
        model: &Model,
        joints: &[JointRange],
    ) -> Result<Self, ScenarioError> {
        let (mut inverse, posture) = inverse(reach, model, joints)?;
        let mut centre = inverse.pose(&posture[..joints.len()]);
        if let Some(about_m) = spec.about_m {
            centre.translation = Translation3::from(about_m);
        }
        let goal = goal(&centre, reach);
        let start = inverse.reach(&goal, &posture);
        let start = start.map_err(|missed| {
            let what = "motion.points.within.about_m".to_owned();
            ScenarioError::out_of_reach(what, inverse.link_name(), &goal, missed)
        })?;
        Ok(Self {
            inverse,
            radius_m: spec.radius_m,
            turn_rad: spec.turn_rad,
            any_orientation: reach.any_orientation,
            centre,
            start,
        })
    }

    /// Draws a random point; returns `None` if it cannot be reached.
    fn draw(&mut self, rng: &mut ChaCha8Rng) -> Option<JointArray> {
        let offset: [f64; 3] = UnitBall.sample(rng);
        let axis: [f64; 3] = UnitSphere.sample(rng);
        let angle_rad = self.turn_rad * rng.random::<f64>();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(axis) * angle_rad);
        let goal = Goal {
            place: self.centre.translation.vector + Vector3::from(offset) * self.radius_m,
            orientation: (!self.any_orientation).then_some(turn * self.centre.rotation),
        };
        self.inverse.reach_from(&goal, &self.start).ok()
    }
}

fn refuse<T>(reason: &str) -> Result<T, ScenarioError> {
    Err(ScenarioError::Range {
        what: "motion.points",
        reason: reason.to_owned(),
    })
}

fn joint_points(
    through: &[Vec<f64>],
    joints: &[JointRange],
) -> Result<Vec<JointArray>, ScenarioError> {
    let point = |values: &Vec<f64>| {
        check::position("motion.points.through", values, joints)?;
        let mut point = [0.0; MAX_JOINTS];
        point[..joints.len()].copy_from_slice(values);
        Ok(point)
    };
    through.iter().map(point).collect()
}

/// Returns joint positions for each place, searched from those of the previous place.
fn places(
    through_m: &[[f64; 3]],
    reach: &ReachSpec,
    model: &Model,
    joints: &[JointRange],
) -> Result<Vec<JointArray>, ScenarioError> {
    let (mut inverse, posture) = inverse(reach, model, joints)?;
    let mut pose = inverse.pose(&posture[..joints.len()]);
    let mut from = posture;
    let mut points = Vec::with_capacity(through_m.len());
    for (i, &place) in through_m.iter().enumerate() {
        pose.translation = Translation3::from(place);
        let goal = goal(&pose, reach);
        from = inverse.reach(&goal, &from).map_err(|missed| {
            let what = format!("motion.points.through_m, point {}", i + 1);
            ScenarioError::out_of_reach(what, inverse.link_name(), &goal, missed)
        })?;
        points.push(from);
    }
    Ok(points)
}

fn goal(pose: &Isometry3<f64>, reach: &ReachSpec) -> Goal {
    Goal {
        place: pose.translation.vector,
        orientation: (!reach.any_orientation).then_some(pose.rotation),
    }
}

/// Returns the inverse kinematics of the configured point, and the posture from which it starts.
fn inverse(
    reach: &ReachSpec,
    model: &Model,
    joints: &[JointRange],
) -> Result<(Inverse, JointArray), ScenarioError> {
    let mut posture = [0.0; MAX_JOINTS];
    for (value, joint) in posture.iter_mut().zip(joints) {
        *value = joint.middle();
    }
    if let Some(given) = &reach.posture {
        check::position("motion.points.reach.posture", given, joints)?;
        posture[..joints.len()].copy_from_slice(given);
    }
    let link = reach.link.as_deref();
    let point = LinkPoint::find(model, "motion.points.reach", link, reach.point_m)?;
    Ok((Inverse::new(model, joints, point), posture))
}
