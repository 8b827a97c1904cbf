//! What is known of a body before anything is measured: it has mass in every direction, and is as wide as a gripper.
//!
//! A motion that hardly shows an inertia leaves it with any sign. Held at the edge of what a body can be, it would be a corner in
//! which a search gets stuck, with intervals that know nothing of the edge. A smooth prior keeps away from the edge without one.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, SMatrix, SVector};
use tauscope_dynamics::Inertia;

use crate::active::{Active, BODY};

/// Standard deviation of the density of a body that nothing is known of, in each direction \[m\].
const USUAL_SPREAD_M: f64 = 0.05;
/// What was no body begins with at least this share of the usual variance in each direction.
const FIRST_SHARE: f64 = 0.1;
/// Logarithm of the prior density of all bodies, but for a constant; minus infinity if one of them is none.
///
/// With the mass m, the covariance S of a body's density about its centre and the usual one s² in each direction,
/// `ln det(S / s²) - tr(S) / s²`: the log-determinant divergence from a usual body (Lee, Wensing and Park, "Geometric Robot
/// Dynamic Identification: A Convex Programming Approach", 2020) as the exponent of a density.
pub fn log_density(actives: &[Active]) -> f64 {
    bodies(actives).map(|(_, body)| density_of(&body)).sum()
}

/// The same of one body.
pub fn density_of(body: &Inertia) -> f64 {
    let Some(shape) = shape(body) else {
        let nothing = *body == Inertia::zero();
        return if nothing { 0.0 } else { f64::NEG_INFINITY };
    };
    shape.cholesky().map_or(f64::NEG_INFINITY, |factor| {
        factor.determinant().ln() - shape.trace()
    })
}

/// Covariance of the density about the centre, over the usual variance; `None` without a mass.
fn shape(body: &Inertia) -> Option<Matrix3<f64>> {
    let mass = body.mass_kg();
    (mass > 0.0).then(|| body.spread_kgm2() / (mass * USUAL_SPREAD_M * USUAL_SPREAD_M))
}

/// The bodies among pieces of physics, and which they are.
pub fn bodies(actives: &[Active]) -> impl Iterator<Item = (usize, Inertia)> {
    let all = actives.iter().enumerate();
    all.filter_map(|(i, active)| Some((i, active.body()?)))
}

/// Makes bodies of those that are none; whether there were any.
pub fn make_consistent(actives: &mut [Active]) -> bool {
    let mut odd = false;
    for active in actives {
        if let Some(body) = active.body() {
            let least_m2 = FIRST_SHARE * USUAL_SPREAD_M * USUAL_SPREAD_M;
            let nearest = body.nearest_consistent(least_m2);
            active.coordinates[..BODY].copy_from_slice(&nearest.parameters());
            odd |= nearest != body;
        }
    }
    odd
}

/// What the prior adds to normal equations of the `free` coordinates: its information, which leaves out what bends the other way,
/// and its gradient.
pub fn normal(actives: &[Active], free: &[(usize, usize)]) -> (DMatrix<f64>, DVector<f64>) {
    let n = free.len();
    let (mut information, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for (i, body) in bodies(actives) {
        let own = of_body(free, i);
        let (curvature, slope) = about(&body);
        for &(a, c) in &own {
            gradient[a] = slope[c];
            for &(b, d) in &own {
                information[(a, b)] = curvature[(c, d)];
            }
        }
    }
    (information, gradient)
}

/// Where among the `free` coordinates those of the body are that an active is, and which they are.
pub fn of_body(free: &[(usize, usize)], index: usize) -> Vec<(usize, usize)> {
    let all = free.iter().enumerate();
    let own = all.filter(|(_, (of, c))| *of == index && *c < BODY);
    own.map(|(at, (_, c))| (at, *c)).collect()
}

/// Information and gradient of the prior at a body, by its ten parameters; zero where it has no mass.
pub fn about(body: &Inertia) -> (SMatrix<f64, BODY, BODY>, SVector<f64, BODY>) {
    let (mut information, mut gradient) = (SMatrix::zeros(), SVector::zeros());
    let Some(inverse) = pseudo_inertia(body).try_inverse() else {
        return (information, gradient);
    };
    let by_trace = slope_of_trace(body);
    let turned: [Matrix4<f64>; BODY] = std::array::from_fn(|c| inverse * pseudo_inertia(&unit(c)));
    for (c, first) in turned.iter().enumerate() {
        // The determinant of the pseudo-inertia is that of m S times m.
        let of_mass = if c == 0 { 4.0 / body.mass_kg() } else { 0.0 };
        gradient[c] = first.trace() - of_mass - by_trace[c];
        for (d, second) in turned.iter().enumerate() {
            information[(c, d)] = (first * second).trace();
        }
    }
    (information, gradient)
}

/// The body with one of its parameters 1 and the others 0.
fn unit(parameter: usize) -> Inertia {
    let mut parameters = [0.0; BODY];
    parameters[parameter] = 1.0;
    Inertia::from_parameters(parameters)
}

/// ∫ (r, 1) (r, 1)ᵀ dm about the frame's origin, linear in the ten parameters (Wensing, Kim and Slotine, "Linear Matrix
/// Inequalities for Physically Consistent Inertial Parameter Identification", 2018, equation 15).
fn pseudo_inertia(body: &Inertia) -> Matrix4<f64> {
    let [mass, hx, hy, hz, xx, xy, xz, yy, yz, zz] = body.parameters();
    let half = 0.5 * (xx + yy + zz);
    Matrix4::new(
        half - xx,
        -xy,
        -xz,
        hx, //
        -xy,
        half - yy,
        -yz,
        hy, //
        -xz,
        -yz,
        half - zz,
        hz, //
        hx,
        hy,
        hz,
        mass,
    )
}

/// How `tr(S) / s²` grows with each of the ten parameters: it is `(½ tr(I) - |h|² / m) / (m s²)` with the first moment h and the inertia I
/// about the origin.
fn slope_of_trace(body: &Inertia) -> [f64; BODY] {
    let [mass, hx, hy, hz, xx, _, _, yy, _, zz] = body.parameters();
    let (half, first) = (0.5 * (xx + yy + zz), hx * hx + hy * hy + hz * hz);
    let usual = USUAL_SPREAD_M * USUAL_SPREAD_M;
    let mut slope = [0.0; BODY];
    slope[0] = (2.0 * first / mass - half) / (mass * mass * usual);
    for (slope, h) in slope[1..4].iter_mut().zip([hx, hy, hz]) {
        *slope = -2.0 * h / (mass * mass * usual);
    }
    for diagonal in [4, 7, 9] {
        slope[diagonal] = 0.5 / (mass * usual);
    }
    slope
}

#[cfg(test)]
pub mod tests {
    use std::collections::BTreeSet;

    use tauscope_dynamics::Model;

    use super::*;
    use crate::library;

    pub const ARM: &str = include_str!("../../../tests/data/demo_arm.urdf");

    /// A payload.
    pub fn carried(body: Inertia) -> Vec<Active> {
        let model = Model::from_urdf(ARM).unwrap();
        let all = library::hypotheses(&model, true, &BTreeSet::new());
        let payload = all.iter().find(|h| h.effect.name == "payload").unwrap();
        vec![payload.with(body.parameters().to_vec())]
    }

    /// All its coordinates.
    pub fn free() -> Vec<(usize, usize)> {
        (0..BODY).map(|c| (0, c)).collect()
    }

    fn some_body() -> Inertia {
        let inertia = [0.01, 0.001, -0.002, 0.012, 0.0015, 0.009];
        Inertia::new(1.3, [0.05, -0.02, 0.1], inertia)
    }

    #[test]
    fn the_gradient_is_that_of_the_density() {
        let actives = carried(some_body());
        let (_, gradient) = normal(&actives, &free());
        for c in 0..BODY {
            let beside = |step: f64| {
                let mut there = actives.clone();
                there[0].coordinates[c] += step;
                log_density(&there)
            };
            let slope = (beside(1e-7) - beside(-1e-7)) / 2e-7;
            let size = 1.0 + slope.abs();
            assert!((gradient[c] - slope).abs() < 1e-4 * size, "{c}: {slope}");
        }
    }

    #[test]
    fn what_is_no_body_is_impossible_and_becomes_one() {
        let mut odd = carried(Inertia::new(1.0, [0.1; 3], [-0.1, 0.0, 0.0, 0.1, 0.0, 0.1]));
        assert!(log_density(&odd).is_infinite());
        assert!(make_consistent(&mut odd));
        assert!(log_density(&odd).is_finite());
        assert!(!make_consistent(&mut odd));
    }

    #[test]
    fn a_body_of_the_usual_size_is_likeliest() {
        let moment = 2.0 * USUAL_SPREAD_M * USUAL_SPREAD_M;
        let usual = carried(Inertia::new(
            1.0,
            [0.1, 0.0, 0.2],
            [moment, 0.0, 0.0, moment, 0.0, moment],
        ));
        let (_, gradient) = normal(&usual, &free());
        assert!(gradient.amax() < 1e-6, "{gradient}");
    }
}
