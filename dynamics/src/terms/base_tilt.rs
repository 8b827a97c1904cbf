//! A base that is not level.

use std::f64::consts::TAU;

use nalgebra::{Rotation3, Vector3};

use super::ghost::While;
use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Simulated, Site, Term, Traits, Words,
};
use crate::{Data, Model, gravity_effort};

/// The base is rolled about its x axis and then pitched about the resulting y axis, R = Rx(roll) Ry(pitch); gravity
/// in its frame is Rᵀ g. To first order linear in the angles.
pub(super) static EFFECT: Effect = Effect {
    name: "base_tilt",
    words: Words::new(
        "Base tilt",
        "a base that is tilted",
        "The base is not level, or its mounting differs from the model.",
        "The base: is it level, are its screws tight, and does the URDF have it as it is mounted?",
        "The base is tilted: roll {roll_rad}, pitch {pitch_rad}.",
    ),
    family: Family::Mounting,
    place: PlaceKind::Base,
    layer: Layer::Body,
    odds_nats: -3.0,
    parameters: &[Parameter::any("roll_rad"), Parameter::any("pitch_rad")],
    coordinates: &[
        Coordinate::bending_factor("roll_rad"),
        Coordinate::bending_factor("pitch_rad"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::As(|_| vec![super::Quantity::Gravity]),
    simulated: Simulated::Model,
    concealed: Some(|draw| {
        let (sin, cos) = draw.chance.between(0.0, TAU).sin_cos();
        Drawn::new([1e-3, 0.3], move |angle| {
            vec![("roll_rad", angle * cos), ("pitch_rad", angle * sin)]
        })
    }),
    traits: Traits::NONE,
    build: |site, values| BaseTilt::boxed(&EFFECT, site, values, While::Always),
};

/// Gravity in the frame of the tilted base.
fn tilted(gravity: &Vector3<f64>, [roll, pitch]: [f64; 2]) -> Vector3<f64> {
    let roll = Rotation3::from_axis_angle(&Vector3::x_axis(), roll);
    let pitch = Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
    (roll * pitch).inverse_transform_vector(gravity)
}

/// A tilt by the first two of its coordinates, permanent or temporary.
#[derive(Debug)]
pub(super) struct BaseTilt {
    effect: &'static Effect,
    coordinates: Vec<f64>,
    there: While,
    model: Model,
    data: Data,
}

impl BaseTilt {
    pub fn boxed(
        effect: &'static Effect,
        site: &Site<'_>,
        coordinates: &[f64],
        there: While,
    ) -> Box<dyn Term> {
        let mut model = site.model.clone();
        let level = Vector3::from(model.gravity());
        let tilted = tilted(&level, array(coordinates));
        // The effort is linear in gravity, so the difference of gravity gives the difference of effort.
        model.set_gravity((tilted - level).into());
        Box::new(Self {
            effect,
            coordinates: coordinates.to_vec(),
            there,
            data: Data::new(&model),
            model,
        })
    }
}

impl Term for BaseTilt {
    fn effect(&self) -> &'static Effect {
        self.effect
    }

    fn coordinates(&self) -> &[f64] {
        &self.coordinates
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let share = self.there.share(at);
        if share <= 0.0 {
            return;
        }
        let added = gravity_effort(&self.model, &mut self.data, at.position);
        for (effort, added) in effort.iter_mut().zip(added) {
            *effort += share * added;
        }
    }

    fn alter(&self, model: &mut Model) -> bool {
        if self.there != While::Always {
            return false;
        }
        let gravity = tilted(&model.gravity().into(), array(&self.coordinates));
        model.set_gravity(gravity.into());
        true
    }
}
