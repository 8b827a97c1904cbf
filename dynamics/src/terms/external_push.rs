//! A temporary external force on the arm.

use nalgebra::Vector3;

use super::ghost::While;
use super::law::array;
use super::{
    Coordinate, CoordinateKind, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter,
    PlaceKind, Simulated, Term, Traits, Words,
};
use crate::kinematics::link_origin;
use crate::{Data, Model, forward_kinematics, link_jacobian};

/// A constant force on the origin of a link, along the world's axes: effort -Jᵀ F while it lasts.
pub(super) static EFFECT: Effect = Effect {
    name: "external_push",
    words: Words {
        without_numbers: Some(
            "Something pushed link {place} or a link further out. The recordings determine neither the force nor its point of action.",
        ),
        ..Words::new(
            "External push",
            "a push from outside",
            "Something or somebody pushed the arm for a while.",
            "Link {place}: find out what touched the arm at that time.",
            "Something pushed link {place} with ({force_x_n}, {force_y_n}, {force_z_n}).",
        )
    },
    family: Family::Contact,
    place: PlaceKind::Link,
    layer: Layer::Body,
    odds_nats: -5.0,
    parameters: &[
        Parameter::any("force_x_n"),
        Parameter::any("force_y_n"),
        Parameter::any("force_z_n"),
        Parameter::any("t_start_s"),
        Parameter::any("t_end_s"),
    ],
    coordinates: &[
        Coordinate::factor("force_x_n"),
        Coordinate::factor("force_y_n"),
        Coordinate::factor("force_z_n"),
        Coordinate {
            name: "t_start_s",
            kind: CoordinateKind::SessionTime,
        },
        Coordinate {
            name: "t_end_s",
            kind: CoordinateKind::SessionTime,
        },
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::PASSES),
    simulated: Simulated::Load,
    concealed: Some(|draw| {
        let shortest_s = draw.shortest_s;
        let start = draw.start_session_s + shortest_s * draw.chance.between(0.15, 0.6);
        let end = start + shortest_s * draw.chance.between(0.12, 0.25);
        let force = draw.along(["force_x_n", "force_y_n", "force_z_n"]);
        Drawn::new([0.1, 100.0], move |size| {
            let mut all = force(size);
            all.extend([("t_start_s", start), ("t_end_s", end)]);
            all
        })
    }),
    traits: Traits {
        most_at_one_place: 8,
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(ExternalPush {
            values: array(values),
            at_link: AtLink::new(site.model, site.link),
        })
    },
};

#[derive(Debug)]
struct ExternalPush {
    values: [f64; 5],
    at_link: AtLink,
}

impl Term for ExternalPush {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let [x, y, z, start, end] = self.values;
        let share = While::InSession([start, end]).share(at);
        if share > 0.0 {
            self.at_link.place(at.position);
            self.at_link
                .resist(&(Vector3::new(x, y, z) * share), effort);
        }
    }
}

/// The origin of a link, and forces on it.
#[derive(Debug)]
pub(super) struct AtLink {
    link: usize,
    model: Model,
    data: Data,
}

impl AtLink {
    pub fn new(model: &Model, link: usize) -> Self {
        Self {
            link,
            data: Data::new(model),
            model: model.clone(),
        }
    }

    /// Computes the link's pose and returns its origin in the world \[m\].
    pub fn place(&mut self, position: &[f64]) -> Vector3<f64> {
        forward_kinematics(&self.model, &mut self.data, position);
        link_origin(&self.model, &self.data, self.link)
    }

    /// Adds the effort that balances `force_n`.
    pub fn resist(&mut self, force_n: &Vector3<f64>, effort: &mut [f64]) {
        let jacobian = link_jacobian(&self.model, &mut self.data, self.link);
        for (effort, column) in effort.iter_mut().zip(jacobian.column_iter()) {
            *effort -= column.fixed_rows::<3>(0).dot(force_n);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, assert_near, sample};
    use super::*;
    use crate::{Wrench, forward_dynamics};

    #[test]
    fn the_effort_holds_the_arm_against_the_push() {
        let robot = TwoJoints::new();
        let site = robot.site();
        let force_n = [3.0, -7.0, 11.0];
        let [x, y, z] = force_n;
        let mut term = (EFFECT.build)(&site, &[x, y, z, 105.0, 106.0]);
        let q = [0.4, -0.9];
        let mut at = |t: f64| {
            let mut effort = [0.0; 2];
            term.act(&sample(0.01, t, q, [0.0; 2], [0.0; 2]).view(), &mut effort);
            effort
        };
        assert_eq!(at(4.99), [0.0; 2]);
        assert_eq!(at(6.01), [0.0; 2]);
        let mut effort = at(5.5);
        // It ends in the middle of this sample.
        assert_near(at(6.0), effort.map(|x| 0.5 * x));
        let mut data = Data::new(&robot.model);
        let gravity = crate::gravity_effort(&robot.model, &mut data, &q);
        effort.iter_mut().zip(gravity).for_each(|(e, g)| *e += g);
        let push = Wrench {
            link: site.link,
            force_n: force_n.into(),
            moment_nm: Vector3::zeros(),
        };
        let still = forward_dynamics(&robot.model, &mut data, &q, &[0.0; 2], &effort, &[push]);
        assert!(still.iter().all(|qdd| qdd.abs() < 1e-10), "{still:?}");
    }
}
