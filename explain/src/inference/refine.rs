//! The most probable numbers of an explanation, shapes and times included, and their covariance.
//!
//! Gauss-Newton on the whitened effort with Gaussian priors of the factors, nuisances projected out (Nocedal and Wright,
//! *Numerical Optimization*, 2006, section 10.3; the covariance is Laplace's).

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::consistent_bodies::make_consistent;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::solved;
use crate::physics::active::Active;
use crate::physics::friction::least;

use super::space::Space;

/// Most steps. Resolution: bounds the computing time.
const STEPS: usize = 8;
/// A step that gains less is the last \[nats\]. Statistical: a likelihood ratio of 1.01.
const CONVERGED: f64 = 0.01;
/// Halvings of a step that does not gain. Resolution: bounds the computing time.
const HALVINGS: usize = 6;

/// An explanation with its most probable numbers.
pub struct Solution {
    /// The effects.
    pub fit: Fit,
    /// Covariance of all coordinates, in the order of [`Fit::parameters`].
    pub covariance: DMatrix<f64>,
    /// Means of the nuisances.
    pub nuisances: DVector<f64>,
}

/// Refines all coordinates. `centres` and `deviations` are the prior means and standard deviations of all coordinates; the
/// latter are infinite for shapes.
pub fn refine(
    problem: &Problem,
    space: &Space,
    start: Fit,
    (centres, deviations): (&[f64], &[f64]),
) -> Solution {
    let mut fit = start;
    let free = fit.parameters();
    let prior = precisions(deviations);
    let numbers = |fit: &Fit| {
        DVector::from_iterator(
            free.len(),
            free.iter()
                .zip(centres)
                .map(|(&(i, c), centre)| fit.actives[i].coordinates[c] - centre),
        )
    };
    let cost = |fit: &Fit| {
        let residual = Column {
            joint: None,
            values: fit.residual.clone(),
        };
        let x = numbers(fit);
        0.5 * space.square(&residual) + 0.5 * x.component_mul(&x).dot(&prior)
    };
    let mut least = cost(&fit);
    let mut linear;
    let mut step_count = 0;
    loop {
        let jacobian = fit.jacobian(problem);
        let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
        let residual = Column {
            joint: None,
            values: fit.residual.clone(),
        };
        let products = space.products(&columns, &residual);
        let mut normal = products.normal.clone();
        for i in 0..free.len() {
            normal[(i, i)] += prior[i];
        }
        let right = &products.right - numbers(&fit).component_mul(&prior);
        linear = (products, normal.clone());
        step_count += 1;
        if step_count > STEPS || free.is_empty() {
            break;
        }
        let Some(next) = improved(problem, &fit, &free, (normal, right), least, &cost) else {
            break;
        };
        let gained = least - next.1;
        (fit, least) = next;
        if gained < CONVERGED {
            // The products belong to the numbers before the last step, which was small.
            break;
        }
    }
    let (products, normal) = linear;
    let covariance = inverse(&normal);
    let nuisances = space.means(products.of_residual.clone());
    Solution {
        fit,
        covariance,
        nuisances,
    }
}

/// Covariance of all coordinates of a fit, in the order of [`Fit::parameters`]. `deviations` as in [`refine`].
pub fn covariance(problem: &Problem, space: &Space, fit: &Fit, deviations: &[f64]) -> DMatrix<f64> {
    let jacobian = fit.jacobian(problem);
    let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
    let residual = Column {
        joint: None,
        values: fit.residual.clone(),
    };
    let mut normal = space.products(&columns, &residual).normal;
    for (i, precision) in precisions(deviations).iter().enumerate() {
        normal[(i, i)] += precision;
    }
    inverse(&normal)
}

/// Precisions of priors with these standard deviations.
fn precisions(deviations: &[f64]) -> DVector<f64> {
    let of = |d: &f64| if d.is_finite() { 1.0 / (d * d) } else { 0.0 };
    DVector::from_iterator(deviations.len(), deviations.iter().map(of))
}

/// A step of Gauss and Newton within the bounds, shortened until it gains.
fn improved(
    problem: &Problem,
    fit: &Fit,
    free: &[(usize, usize)],
    (normal, right): (DMatrix<f64>, DVector<f64>),
    least: f64,
    cost: &dyn Fn(&Fit) -> f64,
) -> Option<(Fit, f64)> {
    let mut used = vec![true; free.len()];
    let step = loop {
        let step = solved(&normal, &right, &used, 1e-9)?;
        let mut held = false;
        for (k, &(i, c)) in free.iter().enumerate().filter(|(k, _)| step[*k] != 0.0) {
            let active = &fit.actives[i];
            let (lower, upper) = bounds(problem, active, c);
            let value = active.coordinates[c];
            if (value <= lower && step[k] < 0.0) || (value >= upper && step[k] > 0.0) {
                used[k] = false;
                held = true;
            }
        }
        if !held {
            break step;
        }
    };
    let mut share = 1.0;
    for _ in 0..HALVINGS {
        let mut actives = fit.actives.clone();
        for (k, &(i, c)) in free.iter().enumerate() {
            let (lower, upper) = bounds(problem, &actives[i], c);
            let value = &mut actives[i].coordinates[c];
            *value = (*value + share * step[k]).clamp(lower, upper);
        }
        make_consistent(&problem.model, &mut actives);
        let next = Fit::beside(problem, actives, Some(fit));
        let reached = cost(&next);
        if reached < least {
            return Some((next, reached));
        }
        share *= 0.5;
    }
    None
}

/// Lowest and highest value of a coordinate.
pub fn bounds(problem: &Problem, active: &Active, c: usize) -> (f64, f64) {
    match active.kind(c) {
        CoordinateKind::Factor { minimum, .. } => {
            (least(problem, active.hypothesis, minimum), f64::INFINITY)
        }
        CoordinateKind::Shape {
            lower,
            upper,
            scale,
            ..
        } => match scale {
            Scale::OfEffort => {
                let largest = problem.largest_effort[active.hypothesis.place.joint];
                (lower * largest, upper * largest)
            }
            Scale::Waves => {
                let most = problem.most_waves(active.hypothesis.place.joint);
                (lower, upper.min(most).max(lower))
            }
            Scale::Log | Scale::Linear => (lower, upper),
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => {
            (f64::NEG_INFINITY, f64::INFINITY)
        }
    }
}

/// The inverse of a positive matrix, scaled to a unit diagonal first.
fn inverse(normal: &DMatrix<f64>) -> DMatrix<f64> {
    let n = normal.nrows();
    let scale: Vec<f64> = (0..n).map(|i| normal[(i, i)].max(1e-300).sqrt()).collect();
    let mut scaled = DMatrix::from_fn(n, n, |a, b| normal[(a, b)] / (scale[a] * scale[b]));
    for i in 0..n {
        scaled[(i, i)] += 1e-10;
    }
    let inverse = scaled.cholesky().map(|factor| factor.inverse());
    inverse.map_or_else(
        || DMatrix::from_diagonal_element(n, n, f64::INFINITY),
        |inverse| DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] / (scale[a] * scale[b])),
    )
}
