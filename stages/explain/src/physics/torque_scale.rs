//! The scale between N m and a recorded current, where nobody knows the torque constants.

use std::sync::Arc;

use nalgebra::DVector;
use tauscope_dynamics::terms::{
    Coordinate, EFFECTS, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Simulated, Term, Traits, Words,
};

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::{Products, solved};
use crate::physics::active::{Active, Column, Hypothesis, Whereabouts};
use crate::physics::columns::columns;

/// Effort of the bodies times 1 + x: not a finding, but a number that every fit needs. Acts after all other
/// [`Layer::Body`] terms.
pub static DRIVE_GAIN: Effect = Effect {
    name: "drive_gain",
    words: Words::new(
        "Torque scale",
        "torque scale",
        "What a recorded effort of 1 is in N m.",
        "The effort of joint {place} is recorded {gain} times the model's.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    parameters: &[Parameter::ratio("gain", f64::NEG_INFINITY)],
    coordinates: &[Coordinate::factor("gain_minus_one")],
    to_parameters: |c| vec![1.0 + c[0]],
    to_coordinates: |p| vec![p[0] - 1.0],
    simpler: None,
    limit: None,
    excitation: Excitation::Poses,
    simulated: Simulated::Record,
    concealed: None,
    traits: Traits::NONE,
    build: |site, values| {
        Box::new(DriveGain {
            joint: site.joint,
            values: [values[0]],
        })
    },
};

#[derive(Debug)]
struct DriveGain {
    joint: usize,
    values: [f64; 1],
}

impl Term for DriveGain {
    fn effect(&self) -> &'static Effect {
        &DRIVE_GAIN
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, _at: &MotionSample<'_>, effort: &mut [f64]) {
        effort[self.joint] *= 1.0 + self.values[0];
    }
}

/// Whether a piece of physics is the scale of a drive.
pub fn is_drive(hypothesis: &Hypothesis) -> bool {
    *hypothesis.effect == DRIVE_GAIN
}

/// The scales of joints that nobody knows, as they are at first.
pub fn unknown_gains(first: &[(usize, f64)]) -> Vec<Active> {
    let one = |&(joint, gain): &(usize, f64)| {
        let place = Whereabouts {
            joint,
            ..Whereabouts::default()
        };
        Hypothesis {
            effect: &DRIVE_GAIN,
            place,
        }
        .with(vec![gain - 1.0])
    };
    first.iter().map(one).collect()
}

/// The scale of each joint in an explanation; 1 where it is out of the question.
pub fn gains(actives: &[Active], joints: usize) -> Vec<f64> {
    let mut gains = vec![1.0; joints];
    for active in actives.iter().filter(|active| is_drive(&active.hypothesis)) {
        gains[active.hypothesis.place.joint] = 1.0 + active.coordinates[0];
    }
    gains
}

/// By coordinate of a fit, how far it is off if the URDF's masses and centres of mass are: the root of the sum of squares over all
/// links. A drive whose joint carries next to nothing has no scale of its own, however small its interval.
pub fn off_with_the_links(problem: &Problem, fit: &Fit) -> Vec<f64> {
    let model = &problem.model;
    let mut nuisance: Vec<Arc<Column>> = Vec::new();
    let mut size: Vec<f64> = Vec::new();
    for joint in model.joints() {
        let (link, place) = (
            &model.links()[joint.child_link],
            Whereabouts {
                link: joint.child_link,
                ..Whereabouts::default()
            },
        );
        for (effect, off) in EFFECTS
            .iter()
            .filter_map(|effect| Some((*effect, effect.traits.off_in_urdf?(link))))
        {
            let shape = vec![0.0; effect.coordinates.len()];
            let all = columns(problem, fit, Hypothesis { effect, place }, &shape);
            size.extend(all.factors.iter().map(|_| off));
            nuisance.extend(all.factors.iter().cloned());
        }
    }
    let own = fit.jacobian(problem);
    let p = own.len();
    let all: Vec<&Column> = own.iter().chain(&nuisance).map(AsRef::as_ref).collect();
    let products = Products::new(problem, &all, &fit.residual, None);
    let (normal, _) = products.normal(&fit.variance, &vec![0.0; all.len()]);
    let mine = normal.view((0, 0), (p, p)).into_owned();
    let mut squares = vec![0.0; p];
    for (k, size) in size.iter().enumerate() {
        let right = DVector::from_iterator(p, (0..p).map(|a| normal[(a, p + k)] * size));
        if let Some(off) = solved(&mine, &right, &vec![true; p], 0.0) {
            for (sum, off) in squares.iter_mut().zip(off.iter()) {
                *sum += off * off;
            }
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}
