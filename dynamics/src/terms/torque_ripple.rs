//! Effort that goes up and down with the joint's angle: cogging, gear teeth, eccentric gears.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind, Scale};

/// Effort -A sin(n q + φ) for up to two n, searched as the factors of sin n q and cos n q.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_ripple",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[
        Parameter::at_least("amplitude_nm", 0.0),
        Parameter::at_least("cycles_per_rev", 0.0),
        Parameter::any("phase_rad"),
        Parameter::at_least("amplitude2_nm", 0.0).or(0.0),
        Parameter::at_least("cycles_per_rev2", 0.0).or(1.0),
        Parameter::any("phase2_rad").or(0.0),
    ],
    coordinates: &[
        Coordinate::factor("sine_nm"),
        Coordinate::factor("cosine_nm"),
        CYCLES,
        Coordinate::factor("sine2_nm"),
        Coordinate::factor("cosine2_nm"),
        CYCLES,
    ],
    to_parameters: |c| {
        let [amplitude, cycles, phase] = wave(&c[..3]);
        let [amplitude2, cycles2, phase2] = wave(&c[3..]);
        vec![amplitude, cycles, phase, amplitude2, cycles2, phase2]
    },
    to_coordinates: |p| {
        let [sine, cosine, cycles] = factors(&p[..3]);
        let [sine2, cosine2, cycles2] = factors(&p[3..]);
        vec![sine, cosine, cycles, sine2, cosine2, cycles2]
    },
    build: |site, values| {
        joint_law(
            &EFFECT,
            site,
            values,
            |[sine, cosine, cycles, sine2, cosine2, cycles2], j, at| {
                let (sin, cos) = (cycles * at.position[j]).sin_cos();
                let first = sine * sin + cosine * cos;
                if *sine2 == 0.0 && *cosine2 == 0.0 {
                    return first;
                }
                let (sin, cos) = (cycles2 * at.position[j]).sin_cos();
                first + sine2 * sin + cosine2 * cos
            },
        )
    },
};

const CYCLES: Coordinate = Coordinate::shape("cycles_per_rev", 1.0, 64.0, 64, Scale::Linear);

/// Amplitude, cycles and phase.
fn wave(factors: &[f64]) -> [f64; 3] {
    let (sine, cosine) = (0.0 - factors[0], 0.0 - factors[1]);
    [sine.hypot(cosine), factors[2], cosine.atan2(sine)]
}

fn factors(wave: &[f64]) -> [f64; 3] {
    let (sin, cos) = wave[2].sin_cos();
    [-wave[0] * cos, -wave[0] * sin, wave[1]]
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, push};
    use super::*;

    #[test]
    fn two_waves_over_the_angle() {
        let robot = TwoJoints::new();
        let coordinates = (EFFECT.to_coordinates)(&[1.5, 20.0, -0.6, 0.4, 16.0, 2.0]);
        let mut term = (EFFECT.build)(&robot.site(), &coordinates);
        let q = 0.37_f64;
        let effort = push(&mut *term, [q, 9.0], [0.0; 2], [0.0; 2]);
        let expected = -1.5 * (20.0 * q - 0.6).sin() - 0.4 * (16.0 * q + 2.0).sin();
        assert!((effort[0] - expected).abs() < 1e-12);
    }
}
