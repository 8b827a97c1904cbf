//! Obstacles: planes, boxes and spheres that a link runs into.

use nalgebra::{Rotation3, Vector3};
use tauscope_dynamics::Model;

use super::error::ScenarioError;
use super::link_point::LinkPoint;
use super::plant::{Contact, Plant};
use super::scenario::{ContactKind, LabelSpec, ObstacleSpec, RecordingSpec};
use super::simulation::Event;

/// Gap below which two touches of an obstacle are merged into one, since the arm bounces \[s\].
/// Chosen: for simulated cells only; the arm bounces within less, and two deliberate touches are further apart.
const BOUNCE_S: f64 = 0.2;

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    /// Everything where `normal · p < offset_m`.
    Plane {
        normal: Vector3<f64>,
        offset_m: f64,
    },
    Box {
        centre: Vector3<f64>,
        half: Vector3<f64>,
        turned: Rotation3<f64>,
    },
    Sphere {
        centre: Vector3<f64>,
        radius_m: f64,
    },
}

impl Shape {
    /// Returns the signed distance of a point from the surface, negative inside, and the outward normal.
    fn distance(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        match self {
            Self::Plane { normal, offset_m } => (normal.dot(point) - offset_m, *normal),
            Self::Sphere { centre, radius_m } => {
                let from = point - centre;
                let out = from.try_normalize(0.0).unwrap_or_else(Vector3::z);
                (from.norm() - radius_m, out)
            }
            Self::Box {
                centre,
                half,
                turned,
            } => {
                let at = turned.inverse() * (point - centre);
                let beyond = at.abs() - half;
                let outside = beyond
                    .map(|b| b.max(0.0))
                    .component_mul(&at.map(f64::signum));
                if let Some(out) = outside.try_normalize(0.0) {
                    return (outside.norm(), turned * out);
                }
                let k = beyond.imax();
                let mut out = Vector3::zeros();
                out[k] = at[k].signum();
                (beyond[k], turned * out)
            }
        }
    }
}

/// An obstacle and its current touch.
#[derive(Debug)]
pub(super) struct Obstacle {
    shape: Shape,
    stiffness: f64,
    damping: f64,
    tip: LinkPoint,
    radius_m: f64,
    window_s: [f64; 2],
    kind: ContactKind,
    label: LabelSpec,
    touching: bool,
    event: Option<Event>,
}

/// The obstacles of a recording.
pub(super) fn obstacles(
    spec: &RecordingSpec,
    model: &Model,
) -> Result<Vec<Obstacle>, ScenarioError> {
    let each = spec.obstacles.iter().enumerate();
    each.map(|(i, obstacle)| {
        Obstacle::new(obstacle, model).map_err(|error| match error {
            ScenarioError::Range { what, reason } => ScenarioError::Range {
                what,
                reason: format!("number {} of recording `{}`: {reason}", i + 1, spec.name),
            },
            other => other,
        })
    })
    .collect()
}

fn wrong<T>(reason: String) -> Result<T, ScenarioError> {
    Err(ScenarioError::Range {
        what: "obstacles",
        reason,
    })
}

impl Obstacle {
    fn new(spec: &ObstacleSpec, model: &Model) -> Result<Self, ScenarioError> {
        let shape = match (&spec.plane, &spec.cuboid, &spec.sphere) {
            (Some(plane), None, None) => {
                let Some(normal) = Vector3::from(plane.normal).try_normalize(0.0) else {
                    return wrong("`plane.normal` has no length, say where the arm may be".into());
                };
                Shape::Plane {
                    normal,
                    offset_m: normal.dot(&Vector3::from(plane.point_m)),
                }
            }
            (None, Some(cuboid), None) => {
                if !cuboid.size_m.iter().all(|edge| *edge > 0.0) {
                    return wrong("`box.size_m` has an edge that is not above 0".into());
                }
                let [roll, pitch, yaw] = cuboid.rpy_rad;
                Shape::Box {
                    centre: cuboid.center_m.into(),
                    half: 0.5 * Vector3::from(cuboid.size_m),
                    turned: Rotation3::from_euler_angles(roll, pitch, yaw),
                }
            }
            (None, None, Some(sphere)) => {
                if sphere.radius_m <= 0.0 {
                    return wrong("`sphere.radius_m` is not above 0".into());
                }
                Shape::Sphere {
                    centre: sphere.center_m.into(),
                    radius_m: sphere.radius_m,
                }
            }
            _ => return wrong("give exactly one of `plane`, `box` and `sphere`".into()),
        };
        let to_s = spec.to_s.unwrap_or(f64::INFINITY);
        if spec.from_s >= to_s {
            return wrong(format!(
                "it is taken away (`to_s` {to_s}) before it is put there (`from_s` {})",
                spec.from_s
            ));
        }
        Ok(Self {
            shape,
            stiffness: spec.stiffness_n_per_m,
            damping: spec.damping_ns_per_m,
            tip: LinkPoint::find(model, "an obstacle", spec.link.as_deref(), spec.point_m)?,
            radius_m: spec.radius_m,
            window_s: [spec.from_s, to_s],
            kind: spec.kind,
            label: spec.label.clone(),
            touching: false,
            event: None,
        })
    }

    /// Refuses an arm that starts inside the obstacle.
    pub fn check_start(&self, plant: &mut Plant) -> Result<(), ScenarioError> {
        let (tip, _) = plant.motion_of(&self.tip);
        let depth_m = self.radius_m - self.shape.distance(&tip).0;
        if self.window_s[0] > 0.0 || depth_m <= 0.0 {
            return Ok(());
        }
        wrong(format!(
            "the tip on `{}` begins {depth_m:.4} m inside of it, at [{:.3}, {:.3}, {:.3}]: move the \
             obstacle, or give `from_s`",
            plant.link_name(self.tip.link),
            tip.x,
            tip.y,
            tip.z
        ))
    }

    /// Returns the force on the arm, if there is one: `max(0, K depth + B depth')` along the normal.
    pub fn contact(&self, time_s: f64, plant: &mut Plant) -> Option<Contact> {
        let [from_s, to_s] = self.window_s;
        if !(from_s <= time_s && time_s < to_s) {
            return None;
        }
        let (tip, velocity) = plant.motion_of(&self.tip);
        let (outside_m, normal) = self.shape.distance(&tip);
        let depth_m = self.radius_m - outside_m;
        if depth_m <= 0.0 {
            return None;
        }
        let force_n = self.stiffness * depth_m - self.damping * normal.dot(&velocity);
        (force_n > 0.0).then(|| Contact {
            link: self.tip.link,
            point_m: plant.in_link(self.tip.link, tip - normal * self.radius_m),
            force_n: (normal * force_n).into(),
        })
    }

    /// Records the contact of the step from `time_s` to `until_s`; returns a touch that has ended.
    pub fn note(
        &mut self,
        time_s: f64,
        until_s: f64,
        contact: Option<&Contact>,
        plant: &mut Plant,
    ) -> Option<Event> {
        self.touching = contact.is_some();
        let over = |event: &Event| time_s - event.off_s >= BOUNCE_S;
        let ended = self.event.take_if(|event| over(event));
        let Some(contact) = contact else {
            return ended;
        };
        let on_s = self.event.as_ref().map_or(time_s, |event| event.on_s);
        match &mut self.event {
            Some(event) if event.peak_n() >= norm(&contact.force_n) => event.off_s = until_s,
            event => {
                let push = plant.event_of(contact, [on_s, until_s], self.kind, &self.label);
                *event = Some(push);
            }
        }
        ended
    }

    /// Returns the touch that has not ended yet.
    pub fn rest(&mut self) -> Option<Event> {
        self.event.take()
    }

    pub fn touching(&self) -> bool {
        self.touching
    }
}

fn norm(force_n: &[f64; 3]) -> f64 {
    Vector3::from(*force_n).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_to_a_box_are_those_to_its_nearest_point() {
        let cuboid = Shape::Box {
            centre: Vector3::new(1.0, 0.0, 0.0),
            half: Vector3::new(0.1, 0.2, 0.3),
            turned: Rotation3::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2),
        };
        // Turned about z by a quarter, its edge of 0.4 m lies along x.
        let (outside, normal) = cuboid.distance(&Vector3::new(1.5, 0.0, 0.0));
        assert!((outside - 0.3).abs() < 1e-12 && (normal - Vector3::x()).norm() < 1e-12);
        let (outside, normal) = cuboid.distance(&Vector3::new(1.0, 0.0, 0.28));
        assert!((outside + 0.02).abs() < 1e-12 && (normal - Vector3::z()).norm() < 1e-12);
        let (outside, normal) = cuboid.distance(&Vector3::new(1.23, 0.14, 0.0));
        assert!((outside - 0.05).abs() < 1e-12, "{outside}");
        assert!((normal - Vector3::new(0.6, 0.8, 0.0)).norm() < 1e-12);
    }
}
