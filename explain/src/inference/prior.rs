//! Priors of the numbers of effects: how large they usually are. How often an effect is met stands in its own file.

use tauscope_dynamics::terms::{Coordinate, CoordinateKind, Family, PlaceKind, words};

use crate::data::problem::Problem;
use crate::physics::active::Hypothesis;

/// Magnitude of a joint's measured effort \[N m or N\].
#[derive(Debug, Clone, Copy)]
pub struct Magnitude {
    /// Root mean square.
    pub rms: f64,
    /// Largest value.
    pub peak: f64,
}

/// Share of a joint's effort that an effect usually has. Chosen: of the order of friction on arms with gears.
pub const USUAL_SHARE: f64 = 0.3;
/// Usual mass that an arm carries, as a share of its own. Physical: rated payloads are a tenth to a third.
const CARRIED_SHARE: f64 = 0.1;
/// Usual distance of a carried body from the flange \[m\]. Physical: that of grippers.
const CARRIED_AT_M: f64 = 0.15;

/// Usual deviation of a link's centre of mass that is worth a finding \[m\]. Chosen: ten times a usual error of a URDF.
const CENTRE_M: f64 = 0.05;
/// Usual tilt of a base that is worth a finding \[rad\]. Chosen: 6 degrees.
const TILT_RAD: f64 = 0.1;
/// Usual offset of a joint's zero \[rad\]. Chosen: 1 degree.
const ZERO_RAD: f64 = 0.02;
/// Usual deviation of an unknown torque scale from its estimate by gravity, as a share. Chosen: drives of
/// one arm are alike by order of magnitude.
const SCALE_SHARE: f64 = 1.0;
/// Usual deviation of a torque constant, as a share. Chosen: by order of magnitude.
const GAIN_SHARE: f64 = 0.2;

/// Standard deviations of the factors of a hypothesis, in the order of its factors. `column_peaks` are the largest
/// values of the factors' columns over the largest effort, at the joint where that is most; `effort` is that of its own joint.
pub fn deviations(
    problem: &Problem,
    hypothesis: Hypothesis,
    column_peaks: &[f64],
    effort: Magnitude,
) -> Vec<f64> {
    let model = &problem.model;
    let arm_kg: f64 = model
        .links()
        .iter()
        .map(|link| link.inertia.mass_kg())
        .sum();
    let link_kg = model.links()[hypothesis.place.link].inertia.mass_kg();
    let mass_kg = if hypothesis.is_body() {
        CARRIED_SHARE * arm_kg
    } else {
        (0.5 * link_kg).max(0.02 * arm_kg)
    };
    let family = hypothesis.effect.family;
    let factors = hypothesis.effect.coordinates.iter();
    let factors = factors.filter(|c| matches!(c.kind, CoordinateKind::Factor { .. }));
    let of = |(coordinate, peak): (&Coordinate, &f64)| {
        if hypothesis.is_torque_scale() {
            return SCALE_SHARE * problem.first_gains[hypothesis.place.joint].abs();
        }
        let of_effort = USUAL_SHARE / peak.max(1e-12);
        let usual = match words::unit(coordinate.name).map_or("", |(_, unit)| unit) {
            "kg" => mass_kg,
            "kg m" => mass_kg * CARRIED_AT_M,
            "kg m²" if family == Family::Body => mass_kg * CARRIED_AT_M * CARRIED_AT_M,
            "m" => CENTRE_M,
            "N" => USUAL_SHARE * 9.81 * arm_kg,
            "N m" if hypothesis.only_joint().is_some() => USUAL_SHARE * effort.rms,
            "rad" if hypothesis.effect.place == PlaceKind::Base => TILT_RAD,
            "rad" => ZERO_RAD,
            _ if hypothesis.effect.traits.is_scale => GAIN_SHARE,
            _ if hypothesis.is_coupling() => USUAL_SHARE,
            _ => of_effort,
        };
        usual.min(3.0 * of_effort)
    };
    factors.zip(column_peaks).map(of).collect()
}

/// Prior mean of the factors of a hypothesis.
pub fn centre(problem: &Problem, hypothesis: Hypothesis) -> f64 {
    if hypothesis.is_torque_scale() {
        problem.first_gains[hypothesis.place.joint] - 1.0
    } else {
        0.0
    }
}
