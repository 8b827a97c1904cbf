//! Fits all numbers of an explanation together: Gauss-Newton with Levenberg's damping on the filtered effort, with an
//! active set of bounds (Nocedal and Wright, *Numerical Optimization*, 2006, sections 10.3 and 16.7).

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::body_prior;
use crate::fit::body_step::body_step;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::Products;
use crate::physics::active::Active;
use crate::physics::friction::least;

/// Most Gauss-Newton steps of a fit.
/// Resolution: bounds the computing time of a fit that does not converge.
const MAX_ITERATIONS: usize = 20;
/// How often the damping is raised at most for one step.
/// Resolution: bounds the computing time; 8⁶ times the damping leaves next to no step.
const MOST_TRIES: usize = 6;
/// A step that gains less log-likelihood than this is the last \[nats\].
/// Statistical: a likelihood ratio of 1.01.
const CONVERGED: f64 = 0.01;
/// A step is also the last if it gains less than this share of the distance from the explanation that the fit is
/// compared with.
/// Tuned: by hand, on no recorded seeds; not swept.
const CONVERGED_SHARE: f64 = 0.01;
/// Damping of the first step, as a share of the diagonal.
/// Resolution: changes the number of steps.
const FIRST_DAMPING: f64 = 1e-4;
/// Factor on the damping where the equations cannot be solved, after a step that gains, and after one that does not.
/// Resolution: changes the number of steps.
const DAMPING_FACTORS: [f64; 3] = [10.0, 0.2, 8.0];
/// Least damping.
/// Resolution: below it a step is one of Gauss and Newton.
const LEAST_DAMPING: f64 = 1e-9;
/// A bound that is a share of the largest effort may be exceeded by this factor.
/// Tuned: by hand, on no recorded seeds; not swept.
const OVER_LARGEST_EFFORT: f64 = 1.1;

/// A Gaussian prior that holds a fit near the numbers of another one.
#[derive(Debug)]
pub(crate) struct Anchor {
    centre: DVector<f64>,
    weight: DVector<f64>,
}

impl Anchor {
    /// The numbers of the effects that act on these joints, with a share of the information of all recordings.
    pub fn new(problem: &Problem, fit: &Fit, joints: &[usize], share: f64) -> Self {
        let jacobian = fit.jacobian_at(problem, Some(joints));
        let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
        let products = Products::new(problem, &columns, &fit.residual, None);
        let (normal, _) = products.normal(&fit.variance, &vec![0.0; columns.len()]);
        Self {
            centre: numbers(fit, &fit.parameters_at(Some(joints))),
            weight: normal.diagonal() * share,
        }
    }

    /// Logarithm of its density, up to a constant.
    fn log_density(&self, numbers: &DVector<f64>) -> f64 {
        let off = numbers - &self.centre;
        -0.5 * off.component_mul(&off).dot(&self.weight)
    }
}

fn numbers(fit: &Fit, free: &[(usize, usize)]) -> DVector<f64> {
    let all = free.iter().map(|&(i, c)| fit.actives[i].coordinates[c]);
    DVector::from_iterator(free.len(), all)
}

impl Fit {
    /// Improves all numbers together.
    #[must_use]
    pub fn refined(self, problem: &Problem) -> Self {
        self.refined_at(problem, None, f64::NAN)
    }

    /// Improves the numbers of the effects that act on these joints, or of all if `joints` is `None`. Stops when the fit is
    /// precise enough to be compared with an explanation of the likelihood `rival`, or at convergence if that is NaN.
    /// Bodies become physically consistent and are fitted with their prior.
    #[must_use]
    pub fn refined_at(self, problem: &Problem, joints: Option<&[usize]>, rival: f64) -> Self {
        self.improved(problem, joints, rival, None)
    }

    /// The same, held near an anchor.
    #[must_use]
    pub(crate) fn refined_near(self, problem: &Problem, joints: &[usize], anchor: &Anchor) -> Self {
        self.improved(problem, Some(joints), f64::NAN, Some(anchor))
    }

    fn improved(
        self,
        problem: &Problem,
        joints: Option<&[usize]>,
        rival: f64,
        anchor: Option<&Anchor>,
    ) -> Self {
        let free = self.parameters_at(joints);
        if free.is_empty() {
            return self;
        }
        let mut fit = self.consistent(problem);
        let mut damping = FIRST_DAMPING;
        let [unsolved, good, bad] = DAMPING_FACTORS;
        let objective = |fit: &Self| {
            let near = anchor.map_or(0.0, |anchor| anchor.log_density(&numbers(fit, &free)));
            fit.likelihood() + body_prior::log_density(&problem.model, &fit.actives) + near
        };
        let mut best = objective(&fit);
        for _ in 0..MAX_ITERATIONS {
            let jacobian = fit.jacobian_at(problem, joints);
            let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
            let products = Products::new(problem, &columns, &fit.residual, None);
            let ridge = vec![0.0; columns.len()];
            let (mut normal, mut right) = products.normal(&fit.variance, &ridge);
            if let Some(Anchor { centre, weight }) = anchor {
                normal += DMatrix::from_diagonal(weight);
                right += (centre - numbers(&fit, &free)).component_mul(weight);
            }
            let mut used = vec![true; free.len()];
            let mut gained = None;
            for _ in 0..MOST_TRIES {
                let step = loop {
                    let step = body_step(
                        &problem.model,
                        &fit.actives,
                        &free,
                        (&normal, &right),
                        &used,
                        damping,
                    );
                    let Some(out) = step.as_ref().map(|step| fit.out(problem, &free, step)) else {
                        break None;
                    };
                    let held = (0..free.len()).filter(|&k| used[k] && out[k]);
                    let held: Vec<usize> = held.collect();
                    if held.is_empty() {
                        break step;
                    }
                    for k in held {
                        used[k] = false;
                    }
                };
                let Some(step) = step else {
                    damping *= unsolved;
                    continue;
                };
                let moved = fit.moved(problem, &free, &step);
                let next = Self::beside(problem, moved, Some(&fit));
                let reached = objective(&next);
                if reached > best {
                    gained = Some(reached - best);
                    best = reached;
                    fit = next;
                    damping = (damping * good).max(LEAST_DAMPING);
                    break;
                }
                damping *= bad;
            }
            let enough = CONVERGED.max(CONVERGED_SHARE * (best - rival).abs());
            if gained.is_none_or(|gained| gained < enough) {
                break;
            }
        }
        fit
    }

    /// The same with physically consistent bodies.
    fn consistent(self, problem: &Problem) -> Self {
        let mut actives = self.actives.clone();
        if body_prior::make_consistent(&problem.model, &mut actives) {
            Self::beside(problem, actives, Some(&self))
        } else {
            self
        }
    }

    /// Which coordinates are at a bound that the step would cross.
    fn out(&self, problem: &Problem, free: &[(usize, usize)], step: &DVector<f64>) -> Vec<bool> {
        let one = |(&(i, c), step): (&(usize, usize), &f64)| {
            let active = &self.actives[i];
            let (lower, upper) = bounds(problem, active, c);
            let value = active.coordinates[c];
            (value <= lower && *step < 0.0) || (value >= upper && *step > 0.0)
        };
        free.iter().zip(step).map(one).collect()
    }

    /// The physics with its coordinates moved by `step`, within their bounds.
    fn moved(
        &self,
        problem: &Problem,
        parameters: &[(usize, usize)],
        step: &DVector<f64>,
    ) -> Vec<Active> {
        let mut actives = self.actives.clone();
        for (&(i, c), step) in parameters.iter().zip(step) {
            let (lower, upper) = bounds(problem, &actives[i], c);
            let value = &mut actives[i].coordinates[c];
            *value = (*value + step).clamp(lower, upper);
        }
        body_prior::make_consistent(&problem.model, &mut actives);
        actives
    }
}

/// Lowest and highest value of a coordinate.
pub(crate) fn bounds(problem: &Problem, active: &Active, c: usize) -> (f64, f64) {
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
                (lower * largest, OVER_LARGEST_EFFORT * upper * largest)
            }
            Scale::Log | Scale::Linear => (lower, upper),
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => {
            (f64::NEG_INFINITY, f64::INFINITY)
        }
    }
}
