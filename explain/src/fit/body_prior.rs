//! The prior of a body's inertial parameters: physically consistent, and about as wide as a gripper.
//!
//! If a motion hardly depends on an inertia, its estimate may have any sign. A hard bound at the edge of physical
//! consistency would stop a search there, and the intervals would ignore the bound. A smooth prior keeps estimates away
//! from the edge without a bound.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, SMatrix, SVector};
use tauscope_dynamics::kinematic_tree::reach_m;
use tauscope_dynamics::{Inertia, Model};

use crate::physics::active::{Active, BODY};

/// Standard deviation of the mass distribution of a usual body, in each direction \[m\].
/// Tuned: by hand, about that of a gripper, on no recorded seeds; not swept.
const USUAL_SPREAD_M: f64 = 0.05;
/// A body that is not physically consistent restarts with at least this share of the usual variance in each direction.
/// Tuned: by hand, on no recorded seeds; not swept.
const FIRST_SHARE: f64 = 0.1;

/// A centre may always be this far from its link's frame, however short the arm is \[m\].
/// Physical: tools are shorter.
const LONG_TOOL_M: f64 = 1.0;

/// A body and the data of its prior.
#[derive(Debug, Clone, Copy)]
pub struct Body {
    /// Its inertial parameters.
    pub inertia: Inertia,
    /// Those of the URDF, if it is a link.
    pub of_urdf: Option<Inertia>,
}

/// Logarithm of the prior density of all bodies, up to a constant; minus infinity if one is not physically consistent.
///
/// With the mass m, the covariance S of a body's density about its centre and the usual one s² in each direction,
/// `ln det(S / s²) - tr(S) / s²`: the log-determinant divergence from a usual body (Lee, Wensing and Park, "Geometric Robot
/// Dynamic Identification: A Convex Programming Approach", 2020) as the exponent of a density. A link is expected to be as its
/// URDF has it: with the pseudo-inertias P and P₀, `ln det(P P₀⁻¹) - tr(P P₀⁻¹)`, the same divergence.
pub fn log_density(model: &Model, actives: &[Active]) -> f64 {
    let all = bodies(model, actives);
    all.map(|(_, body)| density_of(&body)).sum()
}

/// The same of one body.
pub fn density_of(body: &Body) -> f64 {
    let shape = match &body.of_urdf {
        Some(link) => relative(&body.inertia, link),
        None => {
            shape(&body.inertia).map(|shape| DMatrix::from_iterator(3, 3, shape.iter().copied()))
        }
    };
    let Some(shape) = shape else {
        let nothing = body.inertia == Inertia::zero();
        return if nothing { 0.0 } else { f64::NEG_INFINITY };
    };
    let trace = shape.trace();
    (shape.cholesky()).map_or(f64::NEG_INFINITY, |factor| {
        factor.determinant().ln() - trace
    })
}

/// Covariance of the density about the centre, over the usual variance; `None` without a mass.
fn shape(body: &Inertia) -> Option<Matrix3<f64>> {
    let mass = body.mass_kg();
    (mass > 0.0).then(|| body.spread_kgm2() / (mass * USUAL_SPREAD_M * USUAL_SPREAD_M))
}

/// A link's pseudo-inertia in the frame in which its URDF's is the identity.
fn relative(body: &Inertia, of_urdf: &Inertia) -> Option<DMatrix<f64>> {
    let root = pseudo_inertia(of_urdf).cholesky()?.l();
    let half = root.solve_lower_triangular(&pseudo_inertia(body))?;
    let whole = root.solve_lower_triangular(&half.transpose())?;
    Some(DMatrix::from_iterator(4, 4, whole.iter().copied()))
}

/// The effects that are bodies: their indices and bodies.
pub fn bodies(model: &Model, actives: &[Active]) -> impl Iterator<Item = (usize, Body)> {
    let all = actives.iter().enumerate();
    all.filter_map(|(i, active)| {
        let (inertia, of_urdf) = active.body(model)?;
        Some((i, Body { inertia, of_urdf }))
    })
}

/// Replaces bodies that are not physically consistent. Returns whether there were any.
pub fn make_consistent(model: &Model, actives: &mut [Active]) -> bool {
    let mut odd = false;
    for active in actives {
        if let Some((body, of_urdf)) = active.body(model) {
            let least_m2 = FIRST_SHARE * USUAL_SPREAD_M * USUAL_SPREAD_M;
            let mut nearest = body.nearest_consistent(least_m2);
            // A motion that shows the mass alone may leave the centre anywhere, and no step comes back from there.
            let from_link_m = nearest.com_m().iter().map(|x| x * x).sum::<f64>().sqrt();
            let farthest_m = reach_m(model, active.hypothesis.place.link).max(LONG_TOOL_M);
            if of_urdf.is_none() && from_link_m > farthest_m {
                let mass = nearest.mass_kg();
                let moment = 2.0 * mass * USUAL_SPREAD_M * USUAL_SPREAD_M;
                nearest = Inertia::new(mass, [0.0; 3], [moment, 0.0, 0.0, moment, 0.0, moment]);
            }
            if let Some(link) = of_urdf
                && nearest.mass_kg() <= 0.0
            {
                let little = link.parameters().map(|parameter| FIRST_SHARE * parameter);
                nearest = Inertia::from_parameters(little);
            }
            if nearest != body {
                odd = true;
                let own = of_urdf.map_or(nearest, |link| nearest - link);
                active.coordinates[..BODY].copy_from_slice(&own.parameters());
            }
        }
    }
    odd
}

/// What the prior adds to the normal equations of the `free` coordinates: its information, without the part of the
/// curvature that is negative, and its gradient.
pub fn normal(
    model: &Model,
    actives: &[Active],
    free: &[(usize, usize)],
) -> (DMatrix<f64>, DVector<f64>) {
    let n = free.len();
    let (mut information, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for (i, body) in bodies(model, actives) {
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

/// The coordinates of one body among the `free` ones: (position among the free ones, which of the ten).
pub fn of_body(free: &[(usize, usize)], index: usize) -> Vec<(usize, usize)> {
    let all = free.iter().enumerate();
    let own = all.filter(|(_, (of, c))| *of == index && *c < BODY);
    own.map(|(at, (_, c))| (at, *c)).collect()
}

/// Information and gradient of the prior at a body, by its ten parameters; zero where it has no mass.
pub fn about(body: &Body) -> (SMatrix<f64, BODY, BODY>, SVector<f64, BODY>) {
    let (mut information, mut gradient) = (SMatrix::zeros(), SVector::zeros());
    let Some(inverse) = pseudo_inertia(&body.inertia).try_inverse() else {
        return (information, gradient);
    };
    let turned: [Matrix4<f64>; BODY] = std::array::from_fn(|c| inverse * pseudo_inertia(&unit(c)));
    for (c, first) in turned.iter().enumerate() {
        gradient[c] = first.trace();
        for (d, second) in turned.iter().enumerate() {
            information[(c, d)] = (first * second).trace();
        }
    }
    let of_urdf = (body.of_urdf).and_then(|link| pseudo_inertia(&link).try_inverse());
    if let Some(usual) = of_urdf {
        for (c, gradient) in gradient.iter_mut().enumerate() {
            *gradient -= (usual * pseudo_inertia(&unit(c))).trace();
        }
    } else {
        let by_trace = slope_of_trace(&body.inertia);
        // The determinant of the pseudo-inertia is that of m S times m.
        gradient[0] -= 4.0 / body.inertia.mass_kg();
        for (gradient, slope) in gradient.iter_mut().zip(by_trace) {
            *gradient -= slope;
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

    use super::*;
    use crate::physics::library;

    pub const ARM: &str = include_str!("../../../tests/data/demo_arm.urdf");

    pub fn model() -> Model {
        Model::from_urdf(ARM).unwrap()
    }

    /// A payload.
    pub fn carried(body: Inertia) -> Vec<Active> {
        let all = library::hypotheses(&model(), true, &BTreeSet::new());
        let payload = all.iter().find(|h| h.effect.name == "payload").unwrap();
        vec![payload.with(body.parameters().to_vec())]
    }

    /// A link that is so much heavier, its centre and its inertia as far off.
    fn altered(share: f64) -> Vec<Active> {
        let of = library::unnamed_bodies(&model(), &BTreeSet::new())[2];
        let link = model().links()[of.place.link].inertia;
        let mut change = link.parameters().map(|parameter| share * parameter);
        change[2] += 0.02 * share;
        vec![of.with(change.to_vec())]
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
        for actives in [carried(some_body()), altered(0.3)] {
            let (_, gradient) = normal(&model(), &actives, &free());
            for c in 0..BODY {
                let beside = |step: f64| {
                    let mut there = actives.clone();
                    there[0].coordinates[c] += step;
                    log_density(&model(), &there)
                };
                let slope = (beside(1e-7) - beside(-1e-7)) / 2e-7;
                let size = 1.0 + slope.abs();
                assert!((gradient[c] - slope).abs() < 1e-4 * size, "{c}: {slope}");
            }
        }
    }

    #[test]
    fn what_is_no_body_is_impossible_and_becomes_one() {
        let payload = Inertia::new(1.0, [0.1; 3], [-0.1, 0.0, 0.0, 0.1, 0.0, 0.1]);
        // The other is a link without any mass that is left.
        for mut odd in [carried(payload), altered(-1.5)] {
            assert!(log_density(&model(), &odd).is_infinite());
            assert!(make_consistent(&model(), &mut odd));
            assert!(log_density(&model(), &odd).is_finite());
            assert!(!make_consistent(&model(), &mut odd));
        }
    }

    #[test]
    fn a_body_of_the_usual_size_and_a_link_as_in_the_urdf_are_likeliest() {
        let moment = 2.0 * USUAL_SPREAD_M * USUAL_SPREAD_M;
        let usual = carried(Inertia::new(
            1.0,
            [0.1, 0.0, 0.2],
            [moment, 0.0, 0.0, moment, 0.0, moment],
        ));
        for likeliest in [usual, altered(0.0)] {
            let (_, gradient) = normal(&model(), &likeliest, &free());
            assert!(gradient.amax() < 1e-6, "{gradient}");
        }
    }
}
