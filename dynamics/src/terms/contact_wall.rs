//! An elastic wall that the arm runs into.

use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};

use super::external_push::AtLink;
use super::law::array;
use super::{
    Coordinate, Draw, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Site, Term, Traits, Words,
};
use crate::{Data, forward_kinematics, link_pose};

/// Largest distance of a wall that is searched \[m\].
/// Physical: farther than any arm on a fixed base reaches.
const RANGE_M: f64 = 10.0;
/// Reciprocal of the share of time that the arm is in a drawn wall: a fifth.
/// Chosen: for simulated cells only; enough contact to identify the wall, and enough free motion to compare it with.
const IN_IT: usize = 5;

/// Distance of a wall that the arm is in for that share of the time \[m\]; `None` if the arm begins in it.
fn drawn_offset(draw: &Draw<'_>) -> Option<f64> {
    let normal = draw.direction;
    let model = draw.site.model;
    let tool = &model.links()[model.tool_link()];
    let link = model.joints()[tool.joint?].child_link;
    let mut data = Data::new(model);
    let along = draw.path.iter().map(|(_, position)| {
        forward_kinematics(model, &mut data, position);
        let place = link_pose(model, &data, link).translation.vector;
        (0..3).map(|k| normal[k] * place[k]).sum::<f64>()
    });
    let along: Vec<f64> = along.collect();
    let mut sorted = along.clone();
    sorted.sort_by(f64::total_cmp);
    let offset = *sorted.get(sorted.len() * (IN_IT - 1) / IN_IT)?;
    let begins_in_it =
        |((recording_s, _), along): (&(f64, &[f64]), &f64)| *recording_s == 0.0 && *along > offset;
    let possible = !draw.path.iter().zip(&along).any(begins_in_it);
    possible.then_some(offset)
}

/// Force -k (n·p - d) n on the origin p of the last moving link's frame if n·p > d, in the world frame: effort -Jᵀ F.
/// Searched by the normal's azimuth and elevation.
pub(super) static EFFECT: Effect = Effect {
    name: "contact_wall",
    words: Words::new(
        "Contact with a wall",
        "contact with something stiff",
        "The arm pressed against something firm.",
        "The surroundings of the tool: what does the arm run into?",
        "The end of the arm runs into something stiff, {stiffness_n_per_m}.",
    ),
    family: Family::Contact,
    place: PlaceKind::Tool,
    layer: Layer::Body,
    odds_nats: -5.0,
    parameters: &[
        Parameter::at_least("stiffness_n_per_m", 0.0),
        Parameter::ratio("normal_x", f64::NEG_INFINITY),
        Parameter::ratio("normal_y", f64::NEG_INFINITY),
        Parameter::ratio("normal_z", f64::NEG_INFINITY),
        Parameter::any("offset_m"),
    ],
    coordinates: &[
        Coordinate::positive_factor("stiffness_n_per_m"),
        Coordinate::shape("azimuth_rad", -PI, PI, 12, Scale::Linear),
        Coordinate::shape("elevation_rad", -FRAC_PI_2, FRAC_PI_2, 7, Scale::Linear),
        Coordinate::shape("offset_m", -RANGE_M, RANGE_M, 25, Scale::Linear),
    ],
    to_parameters: |c| {
        let normal = normal(c[1], c[2]);
        vec![c[0], normal.x, normal.y, normal.z, c[3]]
    },
    to_coordinates: |p| {
        let azimuth = p[2].atan2(p[1]);
        let elevation = p[3].atan2(p[1].hypot(p[2]));
        vec![p[0], azimuth, elevation, p[4]]
    },
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::PASSES),
    simulated: Simulated::Load,
    concealed: Some(|draw| {
        let offset = drawn_offset(draw)?;
        let normal = draw.along(["normal_x", "normal_y", "normal_z"])(1.0);
        Drawn::new([10.0, 5000.0], move |stiffness| {
            let mut all = normal.clone();
            all.extend([("stiffness_n_per_m", stiffness), ("offset_m", offset)]);
            all
        })
    }),
    traits: Traits::NONE,
    build: |site, values| Box::new(ContactWall::new(site, array(values))),
};

/// Unit normal from azimuth and elevation \[rad\].
fn normal(azimuth: f64, elevation: f64) -> Vector3<f64> {
    let (sin, cos) = elevation.sin_cos();
    Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin)
}

#[derive(Debug)]
struct ContactWall {
    values: [f64; 4],
    normal: Vector3<f64>,
    at_link: AtLink,
}

impl ContactWall {
    fn new(site: &Site<'_>, values: [f64; 4]) -> Self {
        let model = site.model;
        let moving = model.links()[site.link].joint;
        let link = moving.map_or(site.link, |joint| model.joints()[joint].child_link);
        Self {
            values,
            normal: normal(values[1], values[2]),
            at_link: AtLink::new(model, link),
        }
    }
}

impl Term for ContactWall {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let [stiffness, _, _, offset] = self.values;
        let depth = self.normal.dot(&self.at_link.place(at.position)) - offset;
        if depth > 0.0 {
            let force_n = self.normal * (-stiffness * depth);
            self.at_link.resist(&force_n, effort);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, push};
    use super::*;

    #[test]
    fn pushes_back_where_the_link_is_in_the_wall() {
        let robot = TwoJoints::new();
        let site = robot.site_for(PlaceKind::Tool);
        // A floor at a height of 0.6 m: its normal points down, the direction of the push.
        let wall = [1000.0, 0.0, 0.0, -1.0, -0.6];
        let coordinates = (EFFECT.to_coordinates)(&wall);
        let mut term = (EFFECT.build)(&site, &coordinates);
        // In the upright pose the frame of the second joint is at a height of 0.8 m.
        assert_eq!(push(&mut *term, [0.0, 0.0], [0.0; 2], [0.0; 2]), [0.0; 2]);
        let q = 1.3_f64;
        let effort = push(&mut *term, [q, 0.0], [0.0; 2], [0.0; 2]);
        // The axis is (0, 1, 0.2) scaled to 1; the force is along z, so only x and the y axis matter.
        let axis = Vector3::new(0.0, 1.0, 0.2).normalize();
        let turn = nalgebra::Rotation3::from_scaled_axis(axis * q);
        let lever = turn * Vector3::new(0.0, 0.0, 0.5);
        let depth = -(0.3 + lever.z) + 0.6;
        assert!(depth > 0.0);
        let moment = lever.cross(&Vector3::new(0.0, 0.0, 1000.0 * depth));
        assert!((effort[0] + axis.dot(&moment)).abs() < 1e-9);
        assert_eq!(effort[1], 0.0);
    }
}
