//! A joint whose zero differs from the model: B. W. Mooring, Z. S. Roth and M. R. Driels, *Fundamentals of
//! Manipulator Calibration*, 1991.

use std::sync::Arc;

use super::displaced::Displaced;
use super::ghost::While;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Simulated, Site, Term, Traits, Words,
};
use crate::Model;

/// The true position of the joint is the recorded one plus the offset. The effort of this effect is that at the true
/// position minus that at the recorded position. To first order linear in the offset.
pub(super) static EFFECT: Effect = Effect {
    name: "joint_zero_offset",
    words: Words::new(
        "Joint zero offset",
        "a joint zero that is off",
        "The joint stands elsewhere than its recorded position says, by a constant: a crash, or a changed encoder or motor.",
        "Joint {place}: master its zero anew; did the arm crash, or was an encoder, motor or belt changed?",
        "The zero of joint {place} is off: the joint stands at its recorded position plus {offset_rad}. The corrected twin \
         makes up for it; to mend it, master the joint anew.",
    ),
    family: Family::Mounting,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: -4.0,
    parameters: &[Parameter::any("offset_rad")],
    coordinates: &[Coordinate::bending_factor("offset_rad")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::As(|p| vec![super::Quantity::Zero(p[0])]),
    simulated: Simulated::Model,
    concealed: Some(|draw| {
        let sign = if draw.chance.coin() { 1.0 } else { -1.0 };
        Drawn::new([1e-3, 0.1], move |size| vec![("offset_rad", sign * size)])
    }),
    traits: Traits {
        is_off_list: true,
        smallest_told_as: Some("offset_rad"),
        ..Traits::NONE
    },
    build: |site, values| JointZeroOffset::boxed(&EFFECT, site, values, While::Always),
};

/// An offset by the first of its coordinates, permanent or temporary.
#[derive(Debug)]
pub(super) struct JointZeroOffset {
    effect: &'static Effect,
    coordinates: Vec<f64>,
    there: While,
    joint: usize,
    robot: Displaced,
}

impl JointZeroOffset {
    pub fn boxed(
        effect: &'static Effect,
        site: &Site<'_>,
        coordinates: &[f64],
        there: While,
    ) -> Box<dyn Term> {
        Box::new(Self::new(effect, site, coordinates, there))
    }

    pub fn new(
        effect: &'static Effect,
        site: &Site<'_>,
        coordinates: &[f64],
        there: While,
    ) -> Self {
        Self {
            effect,
            coordinates: coordinates.to_vec(),
            there,
            joint: site.joint,
            robot: Displaced::new(site.model, site.joint),
        }
    }
}

impl Term for JointZeroOffset {
    fn effect(&self) -> &'static Effect {
        self.effect
    }

    fn coordinates(&self) -> &[f64] {
        &self.coordinates
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let offset = self.coordinates[0] * self.there.share(at);
        if offset == 0.0 {
            self.robot.skip();
            return;
        }
        let j = self.joint;
        let truly = [at.position[j] + offset, at.velocity[j], at.acceleration[j]];
        self.robot.act(at, truly, effort);
    }

    fn know_recorded(&mut self, efforts: &Arc<Vec<f64>>) {
        self.robot.know_recorded(efforts);
    }

    fn alter(&self, model: &mut Model) -> bool {
        if self.there != While::Always {
            return false;
        }
        model.shift_zero(self.joint, self.coordinates[0]);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::Site;
    use super::super::tests::{TwoJoints, motion, run};
    use super::*;
    use crate::{Data, rnea};

    #[test]
    fn it_costs_what_the_robot_costs_where_the_joint_truly_is() {
        let robot = TwoJoints::new();
        let motion = motion(&robot.model, 50);
        let mut data = Data::new(&robot.model);
        for joint in [0, 1] {
            let site = Site {
                joint,
                ..robot.site()
            };
            let mut term = (EFFECT.build)(&site, &[0.15]);
            for (at, added) in motion.iter().zip(run(&mut *term, &motion)) {
                let mut position = at.position;
                position[joint] += 0.15;
                let there = rnea(
                    &robot.model,
                    &mut data,
                    &position,
                    &at.velocity,
                    &at.acceleration,
                );
                for j in 0..2 {
                    let expected = there[j] - at.transmitted[j];
                    assert!((added[j] - expected).abs() < 1e-9, "joint {joint}");
                }
            }
        }
    }
}
